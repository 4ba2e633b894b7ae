"""Reference numbers for the paper's cases; tests refer to them by name.

They come from an independent study of the model or from a closed form, never from this
package. All in natural units, per contact; the interface of Fig. 4 unless another is
named.
"""

CRITICAL_STIFFNESS = 2.989
"""``K*`` of Eq. (8) with re-attachment at once; to .003."""
CRITICAL_STIFFNESS_PRINTED = 3.59
"""The value printed in the paper, which neither study nor closed form gives."""

INSTABILITY = (0.9344, 1.2892)
"""Displacements of slider and drive at the quasi-static instability, ``K = 2``."""
INSTABILITY_NEVER = (0.9247, 1.2820)
"""The same for contacts that never re-attach, Fig. 5."""

PERIOD = 1.487
"""Period of stick-slip in Fig. 4, ``K = 2``, delay .2, ``v = 1``; to .010."""
V1_FIG4 = 0.7142311
"""Velocity at which smooth sliding of Fig. 4 loses stability, delay .2, ``K = 2``; to
1e-6.
"""

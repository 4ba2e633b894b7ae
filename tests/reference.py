"""Settled numbers of the paper's cases: each stands here once, and a test names it.

They come from an independent study of the model or from a closed form, never from this
package. All in natural units, per contact; the interface of Fig. 4 unless another is
named.
"""

CRITICAL_STIFFNESS = 2.989
"""``K*`` of Eq. (8), broken contacts re-attaching at once; to .003."""
CRITICAL_STIFFNESS_PRINTED = 3.59
"""What the paper prints for it, which follows from neither."""

INSTABILITY = (0.9344, 1.2892)
"""Displacements of slider and drive at the quasi-static instability, ``K = 2``."""
INSTABILITY_NEVER = (0.9247, 1.2820)
"""The same with contacts that never re-attach, Fig. 5."""

PERIOD = 1.487
"""Stick-slip of Fig. 4, ``K = 2``, delay .2, ``v = 1``; to .010."""
V1_FIG4 = 0.7142311
"""Where smooth sliding loses stability in the rig of Fig. 4, delay .2, ``K = 2``; to
1e-6.
"""

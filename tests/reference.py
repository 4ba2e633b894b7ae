"""Settled numbers of the paper's cases: each stands here once, and a test names it.

They come from an independent study of the model or from a closed form, never from this package. All in natural units,
per contact; the interface of Fig. 4 unless another is named.
"""

CRITICAL_STIFFNESS = 2.989
"""``K*`` of Eq. (8), broken contacts re-attaching at once; to .003."""
CRITICAL_STIFFNESS_PRINTED = 3.59
"""What the paper prints for it, which follows from neither."""
CRITICAL_STIFFNESS_ESTIMATE = 1 / 0.11
"""Eq. (9)."""
KINETIC_FRICTION = {0.1: 0.505, 0.3: 0.54498}
"""``F_k`` without delay, by the standard deviation of the thresholds."""
STATIC_FRICTION, STATIC_DISPLACEMENT = 0.79560, 0.8435
"""First maximum of the friction force in rigid motion, and where it is."""

INSTABILITY = (0.9344, 1.2892)
"""Displacements of slider and drive at the quasi-static instability, ``K = 2``."""
INSTABILITY_NEVER = (0.9247, 1.2820)
"""The same with contacts that never re-attach, Fig. 5."""

PERIOD, PEAK_TO_PEAK, LARGEST_VELOCITY = 1.487, 0.77, 13.0
"""Stick-slip of Fig. 4, ``K = 2``, delay .2, ``v = 1``; to .010, .02 and .7."""

V1, V1_FREQUENCY = 1.388221, 7.265139
"""Fig. 7a: where smooth sliding loses stability, and the angular frequency there; to 1e-6."""
V1_DOWN = 0.705
"""Fig. 7a: where the branch of stick-slip ends."""
LINEAR_CRITICAL_DELAY = 0.138218
"""Delay from which smooth sliding is unstable in the rig of Fig. 7a at ``v = 1``; to 1e-6."""
CRITICAL_DELAY = 0.0755
"""``tau*`` of Fig. 6: from which stick-slip is sustained there; to .0005."""
V1_FIG4 = 0.7142311
"""Where smooth sliding loses stability in the rig of Fig. 4, delay .2, ``K = 2``; to 1e-6."""

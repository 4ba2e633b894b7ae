"""Sustained stick-slip, the nonlinear side of stability: whether it persists, from
which start, and how far it can be followed.

`stickslip.stability` finds where smooth sliding is unstable to the smallest
perturbation. Stick-slip that has started may persist where smooth sliding is stable.
The names keep the two apart: *critical* values are linear; *sustained* motion is
nonlinear and depends on a start; the branch of a cycle that is followed ends at its
*fold*.

- `is_sustained`: whether an oscillation persists from a start, with the evidence.
- `sustained`: the ranges of a parameter in which it does, each value started anew. The
  lower edge along the delay is the paper's ``tau*``.
- `cycle_branch`: the cycle itself, continued from value to value of a parameter up to
  where it decays (``v1'`` on the way down, ``v2`` on the way up).
- `bistable_range`: the range between the fold and the linear boundary, where both
  smooth sliding and stick-slip persist; `bistable_region` over two parameters.

All of them use forward runs of the master equation, Eqs. (1)-(4) and (11). With the
error of `METHOD`, 1e-4, ``tau*`` of Fig. 6 is .07574, as with 1e-5; 1e-3 changes it by
.4 %. A linear structure runs on single contacts, those of the rig's method or 10,000:
where smooth sliding is stable, an oscillation within six standard deviations of their
noise does not count. With 1,000 contacts folds lie about 4 % beyond those of the master
equation, with 10,000 about 2 %.
"""

from stickslip.cycles.bistable import BistableRange, bistable_range, bistable_region
from stickslip.cycles.branch import cycle_branch
from stickslip.cycles.cycle_run import METHOD
from stickslip.cycles.edges import Edge, Interval
from stickslip.cycles.oscillation_verdict import Verdict, is_sustained
from stickslip.cycles.persistence import Sustained, sustained

__all__ = [
    "METHOD",
    "BistableRange",
    "Edge",
    "Interval",
    "Sustained",
    "Verdict",
    "bistable_range",
    "bistable_region",
]
__all__ += ["cycle_branch", "is_sustained", "sustained"]

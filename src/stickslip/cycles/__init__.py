"""Sustained stick-slip: does it persist, from where, and how far it can be followed.

The nonlinear side of stability.

`stickslip.stability` says where smooth sliding is unstable to the smallest
perturbation. Stick-slip that has started may persist where smooth sliding is stable.
The names keep the two apart: *critical* values are linear, *sustained* ones are
nonlinear and belongs to a start, and the branch of a cycle that is followed ends at its
*fold*.

- `is_sustained`: does an oscillation persist from a start? With the evidence.
- `sustained`: where it does, along a parameter, afresh from the same start at each
  value. The lower edge along the delay is the paper's ``tau*``.
- `cycle_branch`: the cycle itself, carried from value to value of a parameter up to
  where it decays (``v1'`` on the way down, ``v2`` on the way up).
- `bistable_range`: between the fold and the linear boundary smooth sliding and
  stick-slip both persist; `bistable_region` over two parameters.

All of it rests on forward runs of the master equation, Eqs. (1)-(4) and (11). With the
error of `METHOD`, 1e-4, ``tau*`` of Fig. 6 is .07574, as with 1e-5; 1e-3 moves it by
.4 %. A linear structure runs on single contacts, those of the rig's method or 10,000:
where smooth sliding is stable, an oscillation within six standard deviations of their
noise is none. Of 1,000 contacts folds lie some 4 % beyond those of the master equation,
of 10,000 some 2 %.
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

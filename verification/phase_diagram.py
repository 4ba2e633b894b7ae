"""The phase diagram of the interface of Fig. 4 on a coarse grid: simulated regimes
against the computed boundaries.

The linear boundary is about small disturbances of smooth sliding, so it is compared
with runs that start from there. Below it the interface is bistable: a start at rest,
which is a finite disturbance, leads to stick-slip down to where the cycle itself ends
in a fold. Between the two, the noise of N contacts may by itself start stick-slip; with
more contacts it does so less, hence more of them here than in the example.
"""

from __future__ import annotations

import math
from dataclasses import replace

import xarray as xr

from stickslip import Contacts
from stickslip.cycles import bistable_range
from stickslip.io import rig_files as rig
from stickslip.paper import Claim
from stickslip.paper.figure import at_least, near
from stickslip.stability import critical
from stickslip.sweep.plan import Plan, read_plan
from stickslip.sweep.study import FROM_REST, FROM_SLIDING, KINDS
from verification.study import finding

_CONTACTS = 20_000
_MARGIN = 1.25
"""Factor of velocity on either side of a boundary within which nothing is claimed:
growth rates near it are so small that a run may end before an oscillation has grown out
of the noise, and below it noise may trigger slips.
"""
_OSCILLATES = ("stick-slip", "sustained oscillation")


def regimes() -> tuple[Claim, ...]:
    """Check the regimes on a coarse grid, and of runs about the fold."""
    plan = read_plan(rig.example_file("phase_diagram"))
    many = replace(plan.study.rig, method=Contacts(_CONTACTS, seed=1))
    plan = replace(plan, study=replace(plan.study, rig=many))
    axes = dict(plan.axes) | {
        name: plan.axes[name][3::6] for name in ("stiffness", "velocity")
    }
    diagram = replace(plan, axes=axes).run()
    return _linear(plan, diagram), _starts(diagram), _fold(plan)


def _linear(plan: Plan, diagram: xr.Dataset) -> Claim:
    claimed = 0
    as_claimed = 0
    for stiffness in diagram["stiffness"].to_numpy().tolist():
        edges = critical(
            plan.study.rig.with_values(stiffness=stiffness),
            "velocity",
            between=(0.02, 30),
        ).edges
        for velocity in diagram["velocity"].to_numpy().tolist():
            beyond = velocity / edges[0].value
            if 1 / _MARGIN <= beyond <= _MARGIN:
                continue
            here = diagram["regime"].sel(
                stiffness=stiffness, velocity=velocity, start=FROM_SLIDING
            )
            seen = KINDS[here.item()]
            claimed += 1
            as_claimed += (
                seen in _OSCILLATES if beyond > 1 else seen == "smooth sliding"
            )
    cells = diagram["regime"].size / 2
    return finding(
        (
            "From smooth sliding, the stable side of the linear boundary stays smooth "
            "and "
            "the unstable side oscillates"
        ),
        near("fraction of the cells that do", as_claimed / claimed, 1.0, 0.0),
        at_least(
            (
                "fraction of the grid that is far enough from the boundary to be "
                "classified"
            ),
            claimed / cells,
            0.8,
        ),
        evidence=(
            f"{cells:.0f} rigs of {_CONTACTS:,} contacts; those within a factor "
            f"{_MARGIN:g} left out"
        ),
    )


def _starts(diagram: xr.Dataset) -> Claim:
    undecided = (diagram["regime"] == KINDS.index("undecided")).any("start")
    smooth = (diagram["regime"] == KINDS.index("smooth sliding")) | undecided
    strange = (~smooth.sel(start=FROM_SLIDING) & smooth.sel(start=FROM_REST)).sum()
    return finding(
        "A start at rest oscillates wherever a start from smooth sliding does",
        near("cells where it does not", float(strange), 0.0, 0.0),
        evidence="the same grid from both starts; undecided cells left out",
    )


def _fold(plan: Plan) -> Claim:
    cases = []
    for stiffness in (1.8, 2.5):
        here = plan.study.rig.with_values(stiffness=stiffness)
        (band,) = bistable_range(
            here, "velocity", between=(0.1, 3.0), step=0.1, tolerance=0.01
        ).bands
        low = band.low.value
        high = band.high.value
        for velocity, start, expected in (
            (math.sqrt(low * high), FROM_REST, "stick-slip"),
            (math.sqrt(low * high), FROM_SLIDING, "smooth sliding"),
            (low * _MARGIN, FROM_REST, "stick-slip"),
            (low / _MARGIN, FROM_REST, "smooth sliding"),
        ):
            seen = plan.study(
                stiffness=stiffness, velocity=velocity, start=start, seed=1
            )["regime"]
            cases.append(seen == expected)
    return finding(
        (
            "From rest stick-slip persists down to the fold of its cycle; from there "
            "to "
            "the linear limit both are stable"
        ),
        near(
            "fraction of the runs that do as computed",
            sum(cases) / len(cases),
            1.0,
            0.0,
        ),
        evidence=(
            f"{len(cases)} runs of {_CONTACTS:,} contacts at two stiffnesses, on "
            "both sides of the fold"
        ),
    )

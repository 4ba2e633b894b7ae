"""The phase diagram of the interface of Fig. 4 on a coarse grid: simulated regimes against the computed boundaries.

The linear boundary speaks of small disturbances of smooth sliding, so it is compared with runs that start from there.
Below it the interface is bistable: a start at rest, which is a finite disturbance, leads to stick-slip down to where
the cycle itself ends in a fold. Between the two, N contacts may kick themselves over; more contacts do so less, hence
more of them here than in the example.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import xarray as xr

import stickslip as ss
from stickslip.simulate import Contacts
from stickslip.sweep import summary
from stickslip.sweep.plan import Plan, read_plan

EXAMPLE = Path(__file__).parents[1] / "examples" / "phase_diagram.toml"

CONTACTS = 20_000
MARGIN = 1.25
"""Factor of velocity on either side of the linear boundary within which nothing is claimed: growth rates beside it are
so small that a run may end before an oscillation has grown out of the noise, and below it noise may trigger slips."""


Diagram = tuple[Plan, xr.Dataset]


@pytest.fixture(scope="module")
def diagram() -> Diagram:
    plan = read_plan(EXAMPLE)
    study = replace(plan.study, method=Contacts(CONTACTS))
    axes = dict(plan.axes) | {name: plan.axes[name][3::6] for name in ("stiffness", "velocity")}
    result = replace(plan, study=study, axes=axes).run()
    assert summary(result).failed == 0
    return plan, result


def rigs(diagram: Diagram) -> Iterator[tuple[ss.Interface, ss.Slider, xr.Dataset]]:
    plan, result = diagram
    for stiffness in result["stiffness"].values.tolist():
        setting = plan.study.at({"stiffness": stiffness})
        assert isinstance(setting.rig, ss.Slider)
        yield setting.interface, setting.rig, result.sel(stiffness=stiffness)


def test_smooth_sliding_is_lost_where_linear_theory_says(diagram: Diagram) -> None:
    claimed = 0
    for interface, slider, column in rigs(diagram):
        (edge,) = ss.critical_velocities(interface, slider, between=(0.02, 30)).edges
        assert edge.loses_stability
        for velocity in column["velocity"].values.tolist():
            cell = column.sel(velocity=velocity, start="smooth")
            if velocity < edge.value / MARGIN:
                assert cell["regime"] == "smooth sliding", (slider, velocity, cell["reason"].item())
            elif velocity > edge.value * MARGIN:
                assert cell["regime"] in ("stick-slip", "small oscillation"), (slider, velocity, cell["reason"].item())
            else:
                continue
            claimed += 1
    assert claimed >= 0.8 * diagram[1]["regime"].size / 2


@pytest.mark.parametrize("stiffness", [1.8, 2.5])
def test_from_rest_stick_slip_lasts_down_to_the_fold_of_its_cycle(stiffness: float) -> None:
    study = replace(read_plan(EXAMPLE).study, method=Contacts(CONTACTS))
    setting = study.at({"stiffness": stiffness})
    assert isinstance(setting.rig, ss.Slider)
    (band,) = ss.bistable_band(setting.interface, setting.rig, between=(0.1, 3.0), step=0.1, tolerance=0.01).bands
    assert (band.low.kind, band.high.kind) == ("fold", "linear")

    def kind(velocity: float, start: str) -> float | str:
        return study(stiffness=stiffness, velocity=velocity, start=start, seed=1)["regime"]

    # The same rig at the same speed stick-slips or slides smoothly, as it was started.
    middle = math.sqrt(band.low.value * band.high.value)
    assert kind(middle, "cold") == "stick-slip"
    assert kind(middle, "smooth") == "smooth sliding"
    assert kind(band.low.value * MARGIN, "cold") == "stick-slip"
    assert kind(band.low.value / MARGIN, "cold") == "smooth sliding"


def test_a_start_at_rest_only_adds_to_what_oscillates(diagram: Diagram) -> None:
    _, result = diagram
    undecided = (result["regime"] == "undecided").any("start")
    calm = (result["regime"] == "smooth sliding") | undecided
    assert bool((calm.sel(start="smooth") | ~calm.sel(start="cold")).all())

"""An answer with its pictures as one self-contained HTML page, to forward or print."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from stickslip import __version__, plot
from stickslip.advise.answer import ElasticPrediction, Prediction
from stickslip.advise.axis import AxisAnswer
from stickslip.advise.chart import chart
from stickslip.advise.mitigations import Mitigation, has, machine_parameters
from stickslip.io.rig_files import to_toml
from stickslip.model.drive import constant
from stickslip.model.parameters import DELAY
from stickslip.progress import Progress, heard, part
from stickslip.simulation import simulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# The map extends by this factor in either direction, or by twice the change if that is
# more.
_AROUND = 10.0
_POINTS = 60  # of the map


def report(
    found: Prediction | ElasticPrediction | AxisAnswer,
    *,
    progress: Progress | None = None,
) -> str:
    """Return a self-contained HTML page with the verdict, its pictures, its evidence,
    and the rig.

    If there are mitigations, it shows the force before and after the smallest one or
    pair, and the way there. The map of stability is drawn if linear theory applies.
    """
    pictures = [
        (title, base64.b64encode(plot.drawn(figure, "svg")).decode())
        for title, figure in _pictures(found, heard(progress))
    ]
    rig = to_toml(found.rig, own=True)
    return found.html(pictures=pictures, rig=rig, version=__version__)


def _pictures(
    found: Prediction | ElasticPrediction | AxisAnswer, watch: Progress
) -> Iterator[tuple[str, Figure]]:
    figure = found.plot()
    figure.suptitle("")  # it is the headline of the page
    at = "after a move" if isinstance(found, AxisAnswer) else "at each speed"
    yield f"What it does {at}", figure
    watch(0.3)
    if not isinstance(found, Prediction):
        return
    changes = found.combined or found.mitigations[:1]
    goal = {each.parameter: each.to for each in changes}
    if changes:
        title = f"Before and after: {found.changed(*changes)}"
        yield title, _before_and_after(found, goal)
    watch(0.5)
    if found.theory_note or not found.has_verdict:  # without a map of stability
        return
    title = "The way there, on the map of stability"
    yield (
        title if changes else "Where smooth sliding is stable",
        _map(found, changes, watch),
    )


def _before_and_after(found: Prediction, goal: Mapping[str, float]) -> Figure:
    """Draw the run of a prediction beside a run of the same length with other values of
    parameters.
    """
    before = found.recording.rig
    after = found.rig.with_values(**goal)
    lasts = replace(
        after,
        drive=constant(after.natural.velocity, before.drive.duration),
        start=before.start,
    )
    return plot.side_by_side(found.run, simulate(lasts, long=True))


def _map(found: Prediction, changes: Sequence[Mitigation], watch: Progress) -> Figure:
    """Draw the map of stability over the two changed parameters, or over the speed and
    one that is, or could be, changed.
    """
    rig = found.rig
    goal = {each.parameter: each.to for each in changes}
    beside = [
        each.name
        for each in (*machine_parameters(rig), DELAY)
        if has(rig, each) and each.name not in (*goal, "velocity") and not each.rescales
    ]
    other = next(name for name in (*goal, *beside) if name != "velocity")
    over: Any = tuple(goal) if found.combined else ("velocity", other)
    steps = [2.0 * math.exp(each.size) for each in changes]
    around = max([_AROUND, *steps])
    found_map = chart(rig, over, around, _POINTS, part(watch, 0.5, 1.0))
    return plot.chart(found_map, to=goal or None)

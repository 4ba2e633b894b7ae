"""One page to forward: an answer with its pictures, in one file that needs no other
and can be printed.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from stickslip import __version__, plot
from stickslip.advise.answer import ElasticPrediction, Prediction
from stickslip.advise.axis import AxisAnswer
from stickslip.advise.chart import chart
from stickslip.advise.mitigations import has, turnable
from stickslip.io.rig_files import to_toml
from stickslip.model.drive import constant
from stickslip.model.parameters import DELAY
from stickslip.progress import Progress, part
from stickslip.simulation import simulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# of the map: a factor on either side of the rig, or twice as far as the change; its
# points
_AROUND = 10.0
_POINTS = 60


def report(
    found: Prediction | ElasticPrediction | AxisAnswer,
    *,
    progress: Progress | None = None,
) -> str:
    """Return a page with the verdict, its pictures, what it rests on, and the rig; HTML
    that asks for no other file.

    Where it has mitigations, the force before and after the smallest is shown, or the
    smallest pair, and the way there.
    """
    pictures = [
        (title, base64.b64encode(plot.drawn(figure, "svg")).decode())
        for title, figure in _pictures(found, progress or (lambda _done: None))
    ]
    rig = to_toml(found.rig, own=True)
    return found.html(pictures=pictures, rig=rig, version=__version__)


def _pictures(
    found: Prediction | ElasticPrediction | AxisAnswer, watch: Progress
) -> Iterator[tuple[str, Figure]]:
    figure = found.plot()
    figure.suptitle("")  # the page has it as its headline
    at = "after a move" if isinstance(found, AxisAnswer) else "at each speed"
    yield f"What it does {at}", figure
    watch(0.3)
    if not isinstance(found, Prediction) or not (
        changes := found.combined or found.mitigations[:1]
    ):
        return
    rig = found.rig
    before = found.recording.rig
    goal = {each.parameter: each.to for each in changes}
    after = rig.with_values(**goal)
    lasts = replace(
        after,
        drive=constant(after.natural.velocity, before.drive.duration),
        start=before.start,
    )
    yield (
        f"Before and after: {found.changed(*changes)}",
        plot.side_by_side(found.run, simulate(lasts, long=True)),
    )
    watch(0.5)
    beside = (
        each.name
        for each in (*turnable(rig), DELAY)
        if has(rig, each) and each.name not in goal and not each.rescales
    )
    alone = "velocity", next(beside) if "velocity" in goal else changes[0].parameter
    over: Any = tuple(goal) if found.combined else alone
    around = max(
        _AROUND,
        *(2.0 * max(each.to / each.now, each.now / each.to) for each in changes),
    )
    found_map = chart(rig, over, around, _POINTS, part(watch, 0.5, 1.0))
    yield "The way there, on the map of stability", plot.chart(found_map, to=goal)

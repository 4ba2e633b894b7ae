"""One page to forward: an answer with its pictures, in one file that needs no other
and can be printed.
"""

from __future__ import annotations

import base64
import html
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from stickslip import __version__, plot
from stickslip.advise.answer import ElasticPrediction, Prediction
from stickslip.advise.chart import chart
from stickslip.io.rig_files import to_toml
from stickslip.model.drive import constant
from stickslip.progress import Progress, part
from stickslip.simulation import simulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# of the map: a factor on either side of the rig, or twice as far as the change; its
# points
_AROUND = 10.0
_POINTS = 60
_STYLE = """
body { font: 11pt/1.45 system-ui, sans-serif; max-width: 52em; margin: 2em auto; padding: 0 1em; color: #222; }
h1 { font-size: 1.5em; margin: 0; } h2 { font-size: 1.05em; margin: 1.4em 0 .3em; } .verdict { font-size: 1.2em; }
img { max-width: 100%; display: block; margin: .5em 0; } table { border-collapse: collapse; }
td { padding: .15em .8em .15em 0; vertical-align: top; border-bottom: 1px solid #ddd; }
pre { font-size: 8.5pt; white-space: pre-wrap; background: #f6f6f6; padding: .8em; } footer { color: #666; }
@media print { body { margin: 0; max-width: none; } img, tr { break-inside: avoid; } h2 { break-after: avoid; } }
"""  # noqa: E501


def report(
    found: Prediction | ElasticPrediction, *, progress: Progress | None = None
) -> str:
    """Return a page with the verdict, its pictures, what it rests on, and the rig; HTML
    that asks for no other file.

    Where it has mitigations, the force before and after the smallest is shown, or the
    smallest pair, and the way there.
    """
    name = html.escape(found.rig.name)
    watch = progress or (lambda _done: None)
    shown = (
        (html.escape(title), base64.b64encode(plot.drawn(it, "svg")))
        for title, it in _pictures(found, watch)
    )
    image = '<h2>{}</h2><img alt="" src="data:image/svg+xml;base64,{}">'
    pictures = "".join(image.format(title, data.decode()) for title, data in shown)
    return (
        '<!doctype html><html lang="en"><head><meta '
        f'charset="utf-8"><title>{name}</title>'
        '<meta name="viewport" content="width=device-width, '
        f'initial-scale=1"><style>{_STYLE}</style></head><body>'
        f"<h1>{name}</h1><p "
        f'class="verdict">{html.escape(found.headline)}</p>{pictures}{found.tables()}'
        f"<h2>The rig</h2><pre>{html.escape(to_toml(found.rig, own=True))}</pre>"
        f"<footer>stickslip {__version__}: <code>stickslip report</code> of the rig "
        "above</footer></body></html>\n"
    )


def _pictures(
    found: Prediction | ElasticPrediction, watch: Progress
) -> Iterator[tuple[str, Figure]]:
    yield "What it does at each speed", found.plot()
    watch(0.3)
    if not isinstance(found, Prediction) or not (
        changes := found.pair or found.mitigations[:1]
    ):
        return
    rig = found.rig
    before = found.recording.rig
    goal = {each.parameter: each.stops for each in changes}
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
    alone = "velocity", "stiffness" if "velocity" in goal else changes[0].parameter
    over: Any = tuple(goal) if found.pair else alone
    around = max(
        _AROUND,
        *(
            2.0 * max(each.stops / each.value, each.value / each.stops)
            for each in changes
        ),
    )
    found_map = chart(rig, over, around, _POINTS, part(watch, 0.5, 1.0))
    yield "The way there, on the map of stability", plot.chart(found_map, to=goal)

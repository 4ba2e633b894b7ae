"""Describe what a picture shows in words and numbers, so that a test notices a change.

Places are in per cent of the panel, from its lower left corner. With ``REDRAW=1`` in
the environment the present description is written to tests/data/drawn: look at the
picture and at the difference before you commit it.
"""

import os
import re
from pathlib import Path
from types import MappingProxyType

import numpy as np
from matplotlib import colors
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Annotation, Text

KEPT = Path(__file__).parent / "data" / "drawn"
NUMBER = re.compile(r"-?\d+\.?\d*(?:e[-+]?\d+)?")


def assert_drawn(figure, name):
    """Compare a picture with its kept description."""
    assert_kept(as_drawn(figure), name)


def assert_kept(now, name, rtol=0.002, atol=1e-6, errors=MappingProxyType({})):
    """Compare a text with the kept one: words exactly, numbers within tolerances; lines
    that contain a word of `errors` have absolute tolerances of their own.
    """
    file = KEPT / f"{name}.txt"
    if os.environ.get("REDRAW"):
        KEPT.mkdir(exist_ok=True)
        file.write_text(now, encoding="utf-8")
    before = file.read_text(encoding="utf-8")
    for old, new in zip(before.splitlines(), now.splitlines(), strict=True):
        assert NUMBER.sub("#", old) == NUMBER.sub("#", new)
        numbers = [
            np.array([float(word) for word in NUMBER.findall(line)])
            for line in (old, new)
        ]
        own = [error for words, error in errors.items() if words in old]
        error = max(own, default=0.5 if "panel" in now else atol)
        assert np.allclose(*numbers, rtol=rtol, atol=error), f"{old}\n{new}"


def as_drawn(figure: Figure) -> str:
    """Describe a picture: its panels, and a line for each thing in them."""
    found = [f"picture of {len(figure.axes)} panels, {_words(figure.texts)}"]
    for ax in figure.axes:
        for each in (ax, *ax.child_axes):
            found += _panel(each)
    for legend in figure.legends:
        found.append(f"legend: {_words(legend.get_texts())}")
    return "\n".join(found) + "\n"


def _panel(ax: Axes) -> list[str]:
    found = []
    for name, axis in (("x", ax.xaxis), ("y", ax.yaxis)):
        low, high = axis.get_view_interval()
        found.append(
            f"{name} {axis.get_scale()} from {low:.5g} to {high:.5g}: "
            f"{axis.get_label_text()!r}"
        )
    found.insert(
        0,
        "panel "
        + " ".join(
            repr(ax.get_title(loc=side)) for side in ("left", "center", "right")
        ),
    )
    found += [
        f"  {_thing(ax, each)}"
        for each in (*ax.lines, *ax.collections, *ax.patches, *ax.images, *ax.texts)
    ]
    if (legend := ax.get_legend()) is not None:
        found.append(f"  legend: {_words(legend.get_texts())}")
    return found


def _thing(ax: Axes, each: object) -> str:
    match each:
        case Line2D():
            style = (
                f"{_colour(each.get_color())} {each.get_linestyle()} "
                f"{each.get_marker()} {each.get_linewidth():.2g}"
            )
            where = _places(ax, each.get_transform(), each.get_xydata())
            return f"line {style} {each.get_label()!r}: {where}"
        case Collection():
            offsets = np.ma.getdata(each.get_offsets())
            paths = each.get_paths()
            if len(offsets) > 1 or np.any(offsets):
                where = _places(ax, each.get_offset_transform(), offsets)
            else:
                corners = (
                    np.concatenate([path.vertices for path in paths])
                    if paths
                    else np.zeros((0, 2))
                )
                where = _places(ax, each.get_transform(), corners)
            values = (
                ""
                if each.get_array() is None
                else f" values {_summary(each.get_array())}"
            )
            colours = f"{_colour(each.get_facecolor())} {_colour(each.get_edgecolor())}"
            return f"{type(each).__name__} {colours}: {where}{values}"
        case Patch():
            corners = each.get_path().vertices
            return (
                f"patch {_colour(each.get_facecolor())}: "
                f"{_places(ax, each.get_transform(), corners)}"
            )
        case AxesImage():
            return (
                f"image over {np.array(each.get_extent())}: "
                f"{_summary(each.get_array())}"
            )
        case Annotation():
            xy = _places(
                ax, ax.transData if each.xycoords == "data" else ax.transAxes, [each.xy]
            )
            return f"words {each.get_text()!r} at {xy}, off by {each.xyann}"
        case Text():
            return (
                f"words {each.get_text()!r} at "
                f"{_places(ax, each.get_transform(), [each.get_position()])}"
            )
    return type(each).__name__


def _places(ax: Axes, transform: object, points: object) -> str:
    """Return about ten of the points, evenly spaced by number."""
    points = np.asarray(points, float)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return "nowhere"
    some = points[np.unique(np.linspace(0, len(points) - 1, 9).round().astype(int))]
    shown = 100.0 * ax.transAxes.inverted().transform(transform.transform(some))
    return f"{len(points)} points " + " ".join(
        f"({x + 0.0:.1f}, {y + 0.0:.1f})" for x, y in np.clip(shown, -999, 999)
    )


def _summary(array: object) -> str:
    array = np.ma.masked_invalid(np.ma.asarray(array, float))
    return (
        f"{array.count()} from {array.min():.4g} to {array.max():.4g}, mean "
        f"{array.mean():.4g}"
    )


def _colour(colour: object) -> str:
    found = np.unique(np.atleast_2d(colors.to_rgba_array(colour)), axis=0)[:3]
    return " ".join(colors.to_hex(each, keep_alpha=True) for each in found)


def _words(texts: list[Text]) -> str:
    return ", ".join(repr(text.get_text()) for text in texts)

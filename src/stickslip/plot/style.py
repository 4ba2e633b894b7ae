"""What all pictures share: the style, labels with units, legends, and files."""

import io
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis, YAxis
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.figure import Figure
from matplotlib.mathtext import MathTextParser
from matplotlib.ticker import LogLocator, NullFormatter
from PIL import Image

from stickslip.arrays import Array as Array
from stickslip.arrays import units_of
from stickslip.errors import InputError, dataset, printable
from stickslip.io import files
from stickslip.io.files import FileName
from stickslip.measure.trace import check_numbers
from stickslip.plot.palette import COLUMN, PAGE
from stickslip.progress import Progress, heard
from stickslip.words import prefixed

_STYLE = mpl.rc_params_from_file(
    Path(__file__).with_name("house.mplstyle"), use_default_template=False
)
_FORMATS = {
    "": ("picture", "png", "svg", "pdf"),
    "contacts": ("film", "gif"),
    "sound": ("sound", "wav"),
    "page": ("page", "html"),
}
_PRINTED = {
    r"^u(?=[A-Z]|[msg]\b)": "µ",
    r"/time\b": " per time unit",
    r"\b([A-Za-z]+)_([A-Za-z]+)\b": r"$\1_{\\mathrm{\2}}$",
    r"\bk\b": "$k$",
}
"""Patterns in units, and their form in print."""
_POWER = re.compile(r"\$10\^\{-?\d+\}\$(?: |$)")
PER_SECOND = 20  # frames of a film per second
# A line of more points is reduced to its envelope: it looks the same, but the file is
# smaller.
MOST_POINTS = 6_000


@contextmanager
def house_style() -> Iterator[None]:
    """Draw in the style of the package within this context, and restore the settings
    after it.

    To set the style permanently: ``matplotlib.style.use("stickslip.plot.house")``.
    """
    with mpl.rc_context(dict(_STYLE)):
        yield


def new_figure(width: float = COLUMN, height: float = 2.6) -> Figure:
    """Return an empty figure of a size in inches, in the style of the package."""
    with house_style():
        return Figure(figsize=(width, height), layout="constrained")


def given_or_new(ax: Axes | None, width: float = COLUMN, height: float = 2.6) -> Axes:
    """Return the axes given, or those of a new figure in the style of the package."""
    return new_figure(width, height).add_subplot() if ax is None else ax


def unit_text(units: str) -> str:
    """Return a unit in its printed form: ``"x_s/time"`` as "x_s per time unit" with an
    index; empty for no unit.
    """
    if units in ("", "1"):
        return ""
    if units == "time":
        return "time units"
    if power := _POWER.match(units):  # added by `dress`
        return (power[0] + unit_text(units[power.end() :])).strip()
    if "$" in units:
        # a unit from a file is text, not a formula
        return printable(units).replace("$", r"\$")
    text = printable(units)
    for pattern, drawn_as in _PRINTED.items():
        text = re.sub(pattern, drawn_as, text)
    return text


def _drawable(text: str) -> str:
    """Return a text with its dollar signs escaped, unless it has a valid formula."""
    try:
        MathTextParser("path").parse(text)
    except ValueError:
        return text.replace("$", r"\$")
    return text


def label(variable: xr.DataArray, most: int = 200) -> str:
    """Return the label of an axis: long name and unit of a variable, in two lines if it
    is longer than `most` characters.
    """
    name = str(variable.attrs.get("long_name", variable.name))
    units = units_of(variable)
    words = _drawable(name).split()
    lengths = [len(word) + 1 for word in words]
    if unit := _drawable(unit_text(units)):
        words.append(f"({unit})")
        lengths.append(len(units) + 3)
    if sum(lengths) - 1 <= most or len(words) < 2:
        return " ".join(words)
    cut = min(
        range(1, len(words)),
        key=lambda i: max(sum(lengths[:i]), sum(lengths[i:])),
    )
    return f"{' '.join(words[:cut])}\n{' '.join(words[cut:])}"


def minus(value: float) -> str:
    """Return a number of an axis, with a typographic minus sign."""
    return f"{value:.6g}".replace("-", "\N{MINUS SIGN}")


def dress(axis: Axis, variable: xr.DataArray) -> float:
    """Label an axis with the name and unit of a variable; return the factor of its
    unit.

    SI units get a prefix that suits the values. If the attribute ``spacing`` is "log",
    the axis is logarithmic, with plain numbers.
    """
    units = units_of(variable)
    log = variable.attrs.get("spacing") == "log"
    values = np.abs(np.asarray(variable.values, dtype=float))
    upright = isinstance(axis, YAxis)
    largest = middle = float(np.nanmax(values, initial=0.0))
    if log:
        # on a logarithmic axis, the geometric mean decides on the prefix
        middle = float(np.exp(np.nanmean(np.log(values[values > 0]))))
    factor = 1.0
    if not 0.5 <= middle < 5e3:
        factor, units = prefixed(middle, units)
    # put the power of ten into the label, as matplotlib would write it above the axis
    if factor == 1.0 and not log and middle > 0.0 and not 1e-5 <= middle < 1e6:
        power = math.floor(math.log10(middle))
        factor = 10.0**power
        units = f"$10^{{{power}}}$ {'' if units == '1' else units}".strip()
    named = variable.assign_attrs(units=units)
    axis.set_label_text(label(named, 24 if upright else 200))
    if log:
        (axis.axes.set_yscale if upright else axis.axes.set_xscale)("log")
        number_plainly(axis, factor, decades=largest > 3000 * np.nanmin(values))
    elif factor != 1.0:
        axis.set_major_formatter(lambda value, _: minus(value / factor))
    return factor


def number_plainly(axis: Axis, factor: float = 1.0, *, decades: bool = False) -> None:
    """Label a logarithmic axis with numbers over a factor, without powers of ten; with
    `decades`, label only the decades.
    """
    axis.set_major_locator(LogLocator(subs=(1.0,) if decades else (1.0, 2.0, 5.0)))
    axis.set_major_formatter(lambda value, _: minus(value / factor))
    axis.set_minor_formatter(NullFormatter())


# a logarithmic axis over a smaller ratio than this is labelled without powers of ten
_FEW_DECADES = 30.0


def legend_above(ax: Axes, *, columns: int = 4) -> None:
    """Put a legend above the axes on the right, where it hides no data, if it has any
    entry.
    """
    if ax.get_legend_handles_labels()[0]:
        ax.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            borderaxespad=0.2,
            ncols=columns,
            columnspacing=1.4,
        )


def panel(
    ax: Axes,
    title: str = "",
    x: xr.DataArray | str | None = None,
    y: xr.DataArray | str | None = None,
    legend: Any = None,
    **properties: Any,
) -> None:
    """Set the title of a panel, the labels of its axes, by variables or texts, its
    legend, and other properties of the axes.
    """
    ax.set(**properties)
    for axis, named in ((ax.xaxis, x), (ax.yaxis, y)):
        factor = 1.0
        if isinstance(named, str):
            axis.set_label_text(named)
        elif named is not None:
            factor = dress(axis, named)
        low, high = axis.get_view_interval()
        if axis.get_scale() == "log" and high < _FEW_DECADES * low:
            number_plainly(axis, factor)  # rather than as 6 x 10^-2
    if legend == "above":
        legend_above(ax)
    elif legend is not None:
        ax.legend(loc=legend)
    if title:
        ax.set_title(title, loc="left")


def interval(ax: Axes, row: float, ends: Any, value: float, color: str) -> None:
    """Draw an interval as a horizontal bar in a row, with a mark at a value."""
    ax.plot(ends, [row, row], color=color, linewidth=7, solid_capstyle="butt")
    ax.plot(value, row, "|", color="white", markersize=7)


def variable(data: xr.Dataset, name: str) -> xr.DataArray:
    """Return a variable along time; `InputError` if the Dataset does not have it."""
    dataset("plot", data, "a run, or a trace of read_trace()")
    if name not in data:
        there = ", ".join(map(str, data.data_vars)) or "none"
        raise InputError(f"plot: this Dataset has no variable {name}; it has: {there}")
    # average over the blocks of an elastic slider
    if data[name].dims == ("time", "block"):
        return data[name].mean("block", keep_attrs=True)
    if data[name].dims != ("time",):
        raise InputError(
            f"plot: {name} has the dimensions {data[name].dims}: must be along time "
            "alone; select one"
        )
    if data.sizes["time"] == 0:
        raise InputError(f"plot: {name} is empty")
    check_numbers("plot", data[name])
    check_numbers("plot", data["time"])
    return data[name]


def along_time(
    run: xr.Dataset, name: str, ax: Axes | None, height: float = 2.2, **style: Any
) -> tuple[Axes, xr.DataArray]:
    """Draw a variable against time, reduced to its envelope, on the axes given or new
    ones; return the axes and the variable.
    """
    drawn = variable(run, name)
    ax = given_or_new(ax, PAGE, height)
    ax.plot(*envelope(run["time"].values, drawn.values), **style)
    panel(ax, "", run["time"], drawn)
    ax.margins(x=0.01)
    return ax, drawn


def envelope(x: Array, y: Array, most: int = MOST_POINTS) -> tuple[Array, Array]:
    """Reduce a long line to about `most` points: the smallest and largest value of each
    group of points, in their order.
    """
    group = y.size // (most // 2)
    if group < 3 or not np.all(np.isfinite(y)):
        return x, y
    whole = y.size // group * group
    blocks = y[:whole].reshape(-1, group)
    first = np.arange(0, whole, group)
    low = first + blocks.argmin(axis=1)
    high = first + blocks.argmax(axis=1)
    kept = np.unique(np.r_[0, low, high, whole : y.size, y.size - 1])
    return x[kept], y[kept]


def format_of(path: FileName, kind: str = "") -> str:
    """Return the format of a picture, film, sound or page from the suffix of its name;
    `InputError` for another suffix.
    """
    what, *formats = _FORMATS.get(kind, _FORMATS[""])
    suffix = Path(path).suffix.lower().removeprefix(".")
    if suffix not in formats:
        named = ", ".join("." + each for each in formats)
        raise InputError(f"{path}: a {what} is written as {named}, chosen by suffix")
    return suffix


class _Film(PillowWriter):
    """A writer of films to memory, so that the file is written only once.

    Artists that are marked as animated are drawn in each frame, the others once; all
    are drawn in each frame if none is marked.
    """

    def setup(self, fig: Figure, outfile: Any, dpi: float | None = None) -> None:
        super().setup(fig, outfile, dpi)
        self.own_dpi = fig.dpi
        fig.set_dpi(self.dpi)
        self.pictures: list[Image.Image] = []
        agg: Any = RendererAgg  # it has no types
        self.renderer = agg(*self.frame_size, self.dpi)
        moving = fig.findobj(Artist.get_animated)
        self.moving = sorted(moving, key=Artist.get_zorder) or [fig]
        fig.draw(self.renderer)
        self.still = self.renderer.copy_from_bbox(fig.bbox)

    def grab_frame(self, **_options: Any) -> None:
        self.renderer.restore_region(self.still)
        for artist in self.moving:
            artist.draw(self.renderer)
        picture = Image.fromarray(np.asarray(self.renderer.buffer_rgba()))
        self.pictures.append(picture.convert("RGB"))

    def finish(self) -> None:
        self.fig.set_dpi(self.own_dpi)
        self.content = io.BytesIO()
        first, *others = self.pictures
        first.save(
            self.content,
            "gif",
            save_all=True,
            append_images=others,
            duration=1000 // self.fps,
            loop=0,
        )


def save(
    shown: Figure | FuncAnimation | tuple[int, Array],
    path: FileName,
    *,
    progress: Progress | None = None,
) -> Path:
    """Write a figure as PNG, SVG or PDF, by suffix, a film as GIF, or a sound as WAV;
    completely or not at all; `progress` is called with the fraction of a film drawn.
    """
    files.target(path)
    if isinstance(shown, Figure):
        return files.write(path, drawn(shown, format_of(path)))
    if isinstance(shown, FuncAnimation):
        format_of(path, "contacts")
        film = _Film(PER_SECOND)
        report = heard(progress)

        def count(frame: int, frames: int) -> None:
            report((frame + 1) / frames)

        with house_style():
            shown.save(Path(path), film, dpi=100, progress_callback=count)
        return files.write(path, film.content.getbuffer())
    from scipy.io import wavfile  # slow to import, and seldom needed

    format_of(path, "sound")
    sound = io.BytesIO()
    wavfile.write(sound, *shown)
    return files.write(path, sound.getbuffer())


def drawn(figure: Figure, kind: str) -> memoryview:
    """Return a figure as PNG, SVG or PDF, without a date, so that the same figure gives
    the same bytes.
    """
    date = {"svg": "Date", "pdf": "CreationDate"}.get(kind)
    picture = io.BytesIO()
    with house_style():
        figure.savefig(picture, format=kind, metadata={date: None} if date else {})
    return picture.getbuffer()

"""A run as a film and as a sound."""

import math

import numpy as np
import xarray as xr
from matplotlib.animation import FuncAnimation
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, to_rgba
from matplotlib.patches import Rectangle
from scipy.integrate import cumulative_trapezoid

from stickslip.arrays import Array
from stickslip.errors import InputError
from stickslip.io.headings import ratio
from stickslip.measure import regime
from stickslip.plot import style
from stickslip.plot.palette import BLACK, BLUE, GREY, ORANGE, PAGE, VERMILLION
from stickslip.plot.replay import ATTACHED, RENEWED, frames
from stickslip.plot.style import house_style, new_figure, panel, variable
from stickslip.progress import Progress, heard
from stickslip.simulation import rig_of
from stickslip.words import engineering

_FRAMES = 200  # 10 s
_RATE = 44_100  # samples per second, as on a compact disc
_AUDIBLE = (20.0, 20_000.0)  # Hz: the range of human hearing, as textbooks give it
_LOUD = 0.9  # amplitude, as a fraction of the largest possible sample
# in x_s: distance of contacts, their height, and the room for the spring
_PITCH = 0.64
_HIGH = 2.1
_REACH = 9.0


@house_style()
def contacts(run: xr.Dataset, *, progress: Progress | None = None) -> FuncAnimation:
    """Return a film of the last cycles of a run: the slider on some of its contacts,
    which stretch, break and re-attach, and the force.

    The run, of one rigid slider, is repeated from its provenance, so that the contacts
    shown are those of the run. For a solver that does not follow single contacts, those
    of another run of the same rig are shown. Frames are closer together where the
    slider is fast, so that the film slows down during slips; `progress` is called with
    the fraction done. Write it with `save`, as GIF. Raises `InputError` for another
    run, or if a piece of the drive ends on a condition.
    """
    seen = frames(rig_of(run), 1.0, _FRAMES, heard(progress))
    figure = new_figure(PAGE, 3.6)
    above, below = figure.subplots(2, 1, height_ratios=(1.0, 1.1))
    span = seen.times[[0, -1]]
    own = run.sel(time=slice(*span))
    line = (
        (own["time"], own["spring_force"]) if seen.exact else (seen.times, seen.force)
    )
    below.plot(*line, color=BLUE)
    panel(below, "", run["time"], run["spring_force"], xlim=span)
    (cursor,) = below.plot([], [], "o", color=VERMILLION, markersize=6)

    lengths = seen.drive - seen.slider
    shortest = min(float(lengths.min()), 0.0)
    scale = min(1.0, _REACH / (max(float(lengths.max()), 1.0) - shortest))
    # right end of the slider; the drive is drawn at rest, at 0
    right = -1.5 - scale * (lengths - shortest)
    count = seen.flags.shape[1]
    wide = _PITCH * count
    high = 1.6 * _HIGH
    middle = _HIGH + 0.5 * high
    coils = middle + np.r_[0, 0, np.tile([0.5, -0.5], 9), 0, 0]
    farthest = right.min() - wide
    feet = right[:, None] - wide + _PITCH * (np.arange(count) + 0.5)
    held = (seen.flags & ATTACHED) > 0
    renewed = (seen.flags & RENEWED) > 0
    broke = np.vstack([np.zeros_like(held[:1]), held[:-1] & (~held[1:] | renewed[1:])])
    colours = LinearSegmentedColormap.from_list("stretched", [BLUE, VERMILLION])
    block = above.add_patch(
        Rectangle(
            (0, _HIGH), wide, high, edgecolor=BLACK, facecolor="#F4F5F7", linewidth=1.2
        )
    )
    bristles = above.add_collection(LineCollection([], linewidths=1.8))
    (ground,) = above.plot([], [], color=GREY, linewidth=0.8)
    (spring,) = above.plot([], [], color=BLACK, linewidth=1.0)
    (flashes,) = above.plot([], [], "o", color=ORANGE, markersize=7, alpha=0.8)
    above.axhline(0.0, color=GREY, linewidth=0.8)
    above.plot([0, 0], [_HIGH, _HIGH + high], color=BLACK, linewidth=4)
    named = f"{count} of {seen.contacts} contacts"
    words = above.text(0, middle, named, va="center", ha="center")
    above.set(
        xlim=(farthest - 1, 0.6),
        ylim=(-1.0, _HIGH + high + 0.3),
        aspect="equal",
    )
    above.axis("off")

    def show(i: int) -> None:
        x = seen.stretching[i]
        bristles.set_segments(_bristles(feet[i], x, held[i]))
        bristles.set_color(
            np.where(held[i, :, None], colours(np.abs(x) / 1.2), to_rgba(GREY))
        )
        block.set_x(right[i] - wide)
        words.set_x(right[i] - 0.5 * wide)
        spring.set_data(np.linspace(right[i], 0.0, 22), coils)
        shift = (right[i] - seen.slider[i]) % 2.0
        ground.set_data(*_ground_marks(farthest - 4, shift))
        lately = broke[max(i - 2, 0) : i + 1].any(axis=0)
        flashes.set_data(feet[i][lately], np.full(int(lately.sum()), 0.4 * _HIGH))
        cursor.set_data([seen.times[i]], [seen.force[i]])

    for moving in (cursor, block, bristles, ground, spring, flashes, words):
        moving.set_animated(True)
    show(0)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # else each frame computes the layout again
    return FuncAnimation(
        figure, show, len(seen.times), interval=1000 / style.PER_SECOND
    )


def _bristles(feet: Array, stretching: Array, attached: Array) -> list[Array]:
    """Return a line segment for each contact, from the slider to its tip.

    The tip of an attached contact is on the ground, behind its foot by its stretching;
    that of a detached contact hangs halfway down.
    """
    behind = np.where(attached, stretching, 0.0)
    height = np.where(attached, 0.0, 0.5 * _HIGH)
    tips = np.stack([feet - behind, height], axis=1)
    roots = np.stack([feet, np.full(feet.size, _HIGH)], axis=1)
    return list(np.stack([roots, tips], axis=1))


def _ground_marks(left: float, shift: float) -> tuple[Array, Array]:
    """Return the hatching of the ground, which is at rest while the picture moves with
    the drive; NaN separates the strokes.
    """
    marks = np.arange(left, 3, 2.0) + shift
    x = np.ravel([marks, marks - 0.6, marks * np.nan], "F")
    y = np.tile([0.0, -0.8, np.nan], marks.size)
    return x, y


def sound(run: xr.Dataset) -> tuple[int, Array]:
    """Return a run or a measured trace as a sound: the spring force about its mean, in
    real time.

    Write it with `save`, as WAV; in a notebook,
    ``IPython.display.Audio(samples, rate=rate)``.

    Parameters
    ----------
    run : Dataset
        A force along time, in SI units, with an audible oscillation: from 20 Hz to
        20 kHz.

    Returns
    -------
    rate, samples : int, ndarray of int16
        Samples per second, 44,100, and the samples.

    Raises
    ------
    InputError
        If nothing is audible, or the times have no unit of time.

    Examples
    --------
    >>> rate, samples = ss.plot.sound(ss.simulate(ss.example("brake_pad")))
    >>> rate, len(samples)  # of 0.2 s
    (44100, 8819)
    """
    force = variable(run, "spring_force")
    seen = regime(run)
    if not (seconds := ratio(seen.time_unit, "s")):
        raise InputError(
            f"sound: times are in {seen.time_unit or 'no unit'}: give the rig in SI "
            "units, or the unit"
        )
    # an undecided regime may have a period, such as that of a drive with several speeds
    if seen.kind == "smooth sliding" or not math.isfinite(seen.period):
        raise InputError(
            f"sound: nothing is audible: {seen.kind}, no oscillation with a period"
        )
    frequency = seen.frequency
    if not _AUDIBLE[0] <= frequency <= _AUDIBLE[1]:
        remedy = (
            "see a run as a film, --kind contacts as .gif; a stiffer spring or a "
            "lighter slider change its pitch"
        )
        raise InputError(
            f"sound: {engineering(frequency, 'Hz', 3)} is inaudible, outside 20 Hz to "
            f"20 kHz; {remedy}"
        )
    t = seconds * force["time"].values
    F = force.values
    # Each sample is the mean over its time, so that higher frequencies of a run with
    # more samples are not aliased.
    way = np.interp(
        np.arange(t[0], t[-1], 1.0 / _RATE),
        t,
        cumulative_trapezoid(F - F.mean(), t, initial=0),
    )
    heard = np.diff(way)
    return _RATE, np.asarray(
        32_767 * _LOUD * heard / np.abs(heard).max(),
        dtype=np.int16,
    )

"""A run to see in motion, and to hear."""

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
from stickslip.simulation import rig_of
from stickslip.words import engineering

_FRAMES = 200  # 10 s
_RATE = 44_100  # samples a second, as on a compact disc
_AUDIBLE = (20.0, 20_000.0)  # Hz: the range of human hearing, as textbooks give it
_LOUD = 0.9  # of the largest sample that there is
# in x_s: from contact to contact, their height, room for the spring
_PITCH = 0.64
_HIGH = 2.1
_REACH = 9.0


@house_style()
def contacts(run: xr.Dataset) -> FuncAnimation:
    """Film the slider on some of its contacts that stretch, break and re-attach, in
    step with the force, as it ends.

    The run, of one rigid slider, is made again by its provenance, and each contact that
    is shown was computed; of a solver that follows no contacts one by one, contacts of
    the same rig are shown. Frames lie closer together where the slider is fast, so that
    it slows down through the slips. Write it with `save`, as GIF. Raises `InputError`
    if it is no such run, or its drive has pieces that end on a condition.
    """
    seen = frames(rig_of(run), 1.0, _FRAMES, lambda _share: None)
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
    # the end of the slider; the drive stays in its place, at 0
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

    show(0)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # else it is looked for in each frame
    return FuncAnimation(
        figure, show, len(seen.times), interval=1000 / style.PER_SECOND
    )


def _bristles(feet: Array, stretching: Array, attached: Array) -> list[Array]:
    """Return a segment for each contact, from the slider to its tip.

    The tip of an attached contact is on the ground, behind its foot by its stretching;
    that of a detached one hangs half-way down.
    """
    behind = np.where(attached, stretching, 0.0)
    height = np.where(attached, 0.0, 0.5 * _HIGH)
    tips = np.stack([feet - behind, height], axis=1)
    roots = np.stack([feet, np.full(feet.size, _HIGH)], axis=1)
    return list(np.stack([roots, tips], axis=1))


def _ground_marks(left: float, shift: float) -> tuple[Array, Array]:
    """Return the strokes below the ground, which stand still while the picture moves
    with the drive; NaN parts one stroke from the next.
    """
    marks = np.arange(left, 3, 2.0) + shift
    x = np.ravel([marks, marks - 0.6, marks * np.nan], "F")
    y = np.tile([0.0, -0.8, np.nan], marks.size)
    return x, y


def sound(run: xr.Dataset) -> tuple[int, Array]:
    """Return a run or a measured trace as it sounds: the spring force about its mean,
    at its own pace.

    Write it with `save`, as WAV; in a notebook,
    ``IPython.display.Audio(samples, rate=rate)``.

    Parameters
    ----------
    run : Dataset
        A force along time, in units of SI, with an oscillation that can be heard: from
        20 Hz to 20 kHz.

    Returns
    -------
    rate, samples : int, ndarray of int16
        Samples a second, 44,100, and the samples.

    Raises
    ------
    InputError
        If there is nothing to hear, or the times are in no unit of seconds.

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
    # through speeds, it is undecided as a whole
    if seen.kind == "smooth sliding" or not math.isfinite(seen.period):
        raise InputError(
            f"sound: there is none: {seen.kind}, no oscillation with a period"
        )
    frequency = seen.frequency
    if not _AUDIBLE[0] <= frequency <= _AUDIBLE[1]:
        remedy = (
            "see a run as a film, --kind contacts as .gif; a stiffer spring or a "
            "lighter slider change its pitch"
        )
        raise InputError(
            f"sound: {engineering(frequency, 'Hz', 3)} is not heard, as 20 Hz to 20 "
            f"kHz are; {remedy}"
        )
    t = seconds * force["time"].values
    F = force.values
    # Each sample is the mean over its time: of a run with more samples nothing is heard
    # at a wrong pitch.
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

"""The strokes of a reciprocating test."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Range
from stickslip.measure.periods import rises
from stickslip.measure.slips import turning_points
from stickslip.measure.trace import FEWEST_CYCLES, FEWEST_READINGS, Array, Trace

# A stroke covers at least this fraction of the range of the displacement; or its force
# passes the middle of two plateaus by this fraction of half their difference.
LEAST_WAY = 0.5
# Two plateaus explain at least this fraction of the variance of a force: the middle
# between 8/pi^2, for a sine, and 1, for steps.
PLATEAUS = 1.0 - 0.5 * (1.0 - 8.0 / math.pi**2)
# A force is near its plateau within this fraction of it: a sine for 0.4 of the time,
# steps for all of it.
NEAR = 0.1


def find_strokes(trace: Trace) -> tuple[list[Trace], float, float]:
    """Return the strokes of a reciprocating test, the friction, which is half the
    difference of the two plateaus of the force, and the offset, which is their mean.

    Each stroke is turned into its own direction, without the offset and the reversals.
    For another test the list is empty, and the numbers are NaN.
    """
    edges = _reversals(trace)
    if len(edges) < 3:
        return [], math.nan, math.nan
    times = np.append(trace.t, np.inf)[edges]
    parts = [trace.part(*ends) for ends in itertools.pairwise(times)]
    levels = np.array([_plateau(part) for part in parts])
    middle = 0.5 * float(np.median(levels[::2]) + np.median(levels[1::2]))
    loaded = []
    sides = []
    for part, level in zip(parts, levels, strict=True):
        side = 1.0 if level >= middle else -1.0
        there = part.t[(side * part.force >= side * level) & _between_ends(part)]
        if there.size < 2 or _rests(part, trace):
            continue
        reached = part.part(there[0], np.nextafter(there[-1], np.inf))
        if reached.t.size >= FEWEST_READINGS:
            loaded.append(reached)
            sides.append(side)
    if {*sides} != {1.0, -1.0}:
        return [], math.nan, math.nan
    # A soft spring is still being loaded in the middle half of a whole stroke.
    levels = np.array([_plateau(part) for part in loaded])
    ahead, behind = (
        float(np.median(levels[np.equal(sides, side)])) for side in (1.0, -1.0)
    )
    offset = 0.5 * (ahead + behind)
    friction = 0.5 * (ahead - behind)
    strokes = [
        _along(part, side, offset) for part, side in zip(loaded, sides, strict=True)
    ]
    known = trace.displacement is not None or _takes_two_levels(trace.force)
    if not (known or _are_plateaus(strokes, trace, friction)):
        return [], math.nan, math.nan
    return strokes, friction, offset


def _between_ends(stroke: Trace) -> NDArray[np.bool_]:
    """Return a mask of the readings of a stroke away from its ends, near which the
    drive may rest; all of them where the displacement is not known or turns.
    """
    way = stroke.displacement
    everywhere = np.ones(stroke.t.size, dtype=bool)
    if way is None:
        return everywhere
    margin = 0.5 * NEAR * np.ptp(way)
    turns = [np.max(np.maximum.accumulate(x) - x) > margin for x in (way, -way)]
    inside = (way >= way.min() + margin) & (way <= way.max() - margin)
    return everywhere if all(turns) else inside


def _rests(part: Trace, trace: Trace) -> bool:
    """Whether the drive rests in a part of a trace, as after a test."""
    if part.displacement is None or trace.displacement is None:
        return False
    return bool(np.ptp(part.displacement) < NEAR * np.ptp(trace.displacement))


def _are_plateaus(strokes: list[Trace], trace: Trace, level: float) -> bool:
    """Whether a force stays near its plateaus for half of the time, and neither climbs
    nor falls in a typical stroke.
    """
    near = sum(np.count_nonzero(part.force >= (1.0 - NEAR) * level) for part in strokes)
    rise = np.median([abs(part.rise) for part in strokes])
    return bool(near >= LEAST_WAY * trace.t.size and rise < NEAR * level)


def _along(trace: Trace, side: float, offset: float) -> Trace:
    """Return a stroke turned into its own direction, forward or back (`side` -1),
    without the offset.
    """
    force = side * (trace.force - offset)
    velocity = trace.velocity
    if velocity is not None and trace.drive is not None:
        velocity = trace.drive - side * (trace.drive - velocity)
    return replace(
        trace,
        force=force,
        velocity=velocity,
        sign=side * trace.sign,
        largest=float(force.max()),
    )


def join_strokes(strokes: Sequence[Trace], friction: float) -> Trace:
    """Return the middle halves of strokes as one trace, each about the same friction:
    without their reversals, and the steps of a long test.
    """
    middles = [_middle(stroke.force) for stroke in strokes]
    sizes = [middle.size for middle in middles]
    force = np.concatenate([middle - middle.mean() + friction for middle in middles])
    return Trace(
        t=strokes[0].step * np.arange(force.size, dtype=float),
        force=force,
        sign=strokes[0].sign,
        largest=max(stroke.largest for stroke in strokes),
        reading_step=strokes[0].reading_step,
        part_number=np.repeat(np.arange(len(sizes), dtype=float), sizes),
        measured=True,
        time_unit=strokes[0].time_unit,
        force_unit=strokes[0].force_unit,
        quantity=strokes[0].quantity,
    )


def without_path(strokes: Sequence[Trace]) -> list[Trace]:
    """Return strokes without the changes of friction along the way: what strokes
    forward and back have in common at the same places.
    """
    place = np.linspace(0.0, 1.0, min(stroke.t.size for stroke in strokes))
    path = np.zeros(place.size)
    for stroke in strokes:
        force = stroke.force[:: int(stroke.sign)]  # from the same end of the way
        path += np.interp(place, np.linspace(0.0, 1.0, force.size), force)
    path /= len(strokes)
    level = []
    for stroke in strokes:
        along = np.linspace(0.0, 1.0, stroke.t.size)[:: int(stroke.sign)]
        force = stroke.force - np.interp(along, place, path)
        level.append(replace(stroke, force=force))
    return level


def _middle(force: Array) -> Array:
    """Return the middle half of a stroke, away from its reversals."""
    quarter = force.size // 4
    return force[quarter : force.size - quarter]


def _plateau(stroke: Trace) -> float:
    """Return the mean force in the middle half of a stroke."""
    return float(_middle(stroke.force).mean())


def _reversals(trace: Trace) -> list[int]:
    """Return the first samples of the strokes, and the end of the last one.

    They come from the displacement or, if that is not known, from a force that
    alternates between two plateaus.
    """
    size = trace.t.size
    if (way := trace.displacement) is not None:
        least = LEAST_WAY * np.ptp(way)
        peaks, troughs = turning_points(way, least) if least > 0 else ((), ())
        return [
            0,
            *sorted({*peaks, *troughs} - {0, size - 1}),
            size,
        ]
    low, high = _two_levels(trace.force)
    if not (low < 0.0 < high or _takes_two_levels(trace.force)):
        return []
    level = LEAST_WAY * 0.5 * (high - low)
    about = trace.force - 0.5 * (high + low)
    crossed = (
        rises(trace.t, force, -level, level)[0].tolist() for force in (about, -about)
    )
    edges = [
        0,
        *sorted(itertools.chain(*crossed)),
        size,
    ]
    lengths = np.diff(edges)
    if lengths.size >= FEWEST_CYCLES:
        lengths = lengths[1:-1]  # the first and the last may be cut off
    elif not are_to_and_fro(low, high):
        return []  # few turns are reversals only if the force changes its sign
    return edges if lengths.min() >= FEWEST_READINGS else []


def are_to_and_fro(low: float, high: float) -> bool:
    """Whether two forces lie on both sides of zero, the nearer at least half as far
    from it as the other.
    """
    nearer, farther = sorted((-low, high))
    return nearer >= LEAST_WAY * farther > 0.0


def _takes_two_levels(force: Array) -> bool:
    """Whether a force alternates between two levels, which explain it."""
    low, high = _two_levels(force)
    rest = force - np.where(force > 0.5 * (low + high), high, low)
    return bool((rest**2).mean() <= (1.0 - PLATEAUS) * force.var())


def _two_levels(force: Array) -> Range:
    """Return the two levels that fit a force best, by least squares."""
    low, high = (float(edge) for edge in np.quantile(force, (0.05, 0.95)))
    middle = math.nan
    for _ in range(20):
        before = middle
        middle = 0.5 * (low + high)
        above = force > middle
        if middle == before or above.all() or not above.any():
            break
        low = float(force[~above].mean())
        high = float(force[above].mean())
    return low, high

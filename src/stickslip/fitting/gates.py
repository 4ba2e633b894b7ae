"""What is refused a fit, with the figure that decided, and what a reader should know of a trace that is not."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from stickslip.errors import InputError
from stickslip.fitting.events import FEWEST, LARGEST_DROP, LOST, PLATEAU, Events, with_unit
from stickslip.fitting.summary import FITTED, comparable, resampled, statistics
from stickslip.measure.bench import about_the_sensor
from stickslip.measure.slips import turning_points, weighted_median

FEWEST_SAMPLES, LONGEST_GAP, LARGEST_NOISE = 20.0, 4, 0.03
LEAST_SAWTOOTH, CLEAR_SAWTOOTH = 1.5, 4.0
MOST_DRIFT, STEP, LOAD_CHANGE = 0.2, 2.0, 0.05
DIFFERENT = 3.0
_LEAST_ERROR = 0.02
RESOLVED = 5.0
"""Samples of a slip from which on it is resolved."""


def check(events: Events) -> tuple[str, ...]:
    """Raise `InputError` where a fit would mislead, with the figure that decided; return what a reader should know."""
    for fault in _faults(events):
        raise InputError(f"fit: {fault}")
    return tuple(_notes(events))


def _faults(events: Events) -> Iterator[str]:
    """What makes a fit mislead, the plainest first."""
    peak, smallest, least = events.mean_peak, events.smallest, with_unit(events.smallest, events.force_unit)
    for fault in about_the_sensor(events.force):
        yield f"{fault}; reduce its gain, and record again"
    if events.gap > LONGEST_GAP:
        yield f"{events.gap} samples in a row are missing: at most {LONGEST_GAP} are filled in; cut the trace there"
    if events.load_change > LOAD_CHANGE:
        yield f"the normal load changes by {100 * events.load_change:.0f} %: must be constant; cut the trace"
    if events.noise > LARGEST_NOISE * peak:
        yield (
            f"the noise is {100 * events.noise / peak:.2g} % of the peak force: at most {100 * LARGEST_NOISE:g} %; "
            "smooth the trace, or record it with less noise"
        )
    if smallest > LARGEST_DROP * peak:
        yield (
            f"drops below {least}, {100 * smallest / peak:.2g} % of the peak force, cannot be told from "
            f"noise: at most {100 * LARGEST_DROP:g} %; record faster, or with less noise"
        )
    if events.sawtooth < LEAST_SAWTOOTH:
        yield (
            f"the force rises for {events.sawtooth:.2g} times as long as it drops: this is an oscillation or noise, "
            f"not stick-slip, where it is at least {LEAST_SAWTOOTH:g}"
        )
    if events.samples_per_period < FEWEST_SAMPLES:
        yield (
            f"{events.samples_per_period:.3g} samples from slip to slip: at least {FEWEST_SAMPLES:g} are needed; "
            "record faster, or pull slower"
        )
    if len(events) < FEWEST:
        yield f"{len(events)} slips: at least {FEWEST} are needed; record for longer"
    if (doubled := events.count_at(PLATEAU * smallest)) < (1.0 - LOST) * len(events):
        yield (
            f"{len(events)} drops of at least {least}, but {doubled} of at least twice that: how many slips "
            "there are depends on what is called one; give the smallest drop (--smallest), on a plateau of n(h)"
        )
    change, when = _largest_step(events)
    if change > STEP:
        yield (
            f"the loading rate changes {change:.2g} times at t = {with_unit(when, events.time_unit, 4)}: the "
            "speed or the load was changed; fit one part of the trace"
        )
    name, z = halves(events)
    if z > DIFFERENT:
        yield (
            f"the halves of the trace differ: {name} by {z:.2g} standard errors, at most {DIFFERENT:g}; fit one part "
            "of the trace"
        )


def _notes(events: Events) -> Iterator[str]:
    """What a reader should know."""
    if abs(math.log(events.drift)) > math.log1p(MOST_DRIFT):
        yield (
            f"the loading rate in the last third is {events.drift:.2f} times that in the first: the drive or the rig "
            "is not steady; what is fitted depends on the order of the slips, not on time"
        )
    if events.sawtooth < CLEAR_SAWTOOTH:
        yield f"rises last only {events.sawtooth:.2g} times as long as drops: hardly stick-slip"
    if events.slip_samples < RESOLVED:
        yield f"slips are not resolved (samples in each: {events.slip_samples:.2g}): only bounds on mass and delay"


def halves(events: Events) -> tuple[str, float]:
    """The statistic by which the halves of a trace differ most, and by how many standard errors."""
    middle = len(events) // 2
    parts = events.part(0, middle), events.part(middle, 2 * middle)
    one, other = (comparable(statistics(part.peaks, part.troughs)) for part in parts)
    # Errors of the whole trace, doubled: of half as many slips, and of a difference.
    error = 2.0 * comparable(resampled(events.peaks, events.troughs)).std(axis=0)
    z = np.abs(one - other) / np.maximum(error, _LEAST_ERROR)
    worst = int(np.argmax(z))
    return FITTED[worst], float(z[worst])


def _largest_step(events: Events) -> tuple[float, float]:
    """Largest ratio of the median loading rates on both sides of a drop, and its time.

    By the time that rises take, ringing weighs little; of joined slips a sudden change of the speed would be ringing.
    """
    peaks, troughs = turning_points(events.force, events.smallest, events.rise)
    took = events.time[peaks[1:]] - events.time[troughs[:-1]]
    slopes = (events.force[peaks[1:]] - events.force[troughs[:-1]]) / took
    many = max(8, slopes.size // 8)
    best, when = 1.0, 0.0
    for i in range(many, slopes.size - many + 1):
        sides = slice(i - many, i), slice(i, i + many)
        before, behind = (weighted_median(slopes[side], took[side]) for side in sides)
        if (ratio := max(before / behind, behind / before)) > best:
            best, when = ratio, float(events.time[peaks[i]])
    return best, when

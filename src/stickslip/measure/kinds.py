"""The kind of motion in a window, by its features: missing evidence for a verdict
first, then a few rules, each a test that would deny its word.
"""

import math
from typing import Literal

import numpy as np

from stickslip import words
from stickslip.measure.features import (
    CLIMBS,
    NORMAL,
    ONE_SIDED,
    SLIP_PHASE,
    SMALL,
    Window,
)
from stickslip.measure.periods import PERIODIC
from stickslip.measure.slips import WHITE
from stickslip.measure.strokes import are_to_and_fro
from stickslip.measure.trace import ERRORS, FEWEST_CYCLES, RESTS

Kind = Literal["smooth sliding", "stick-slip", "sustained oscillation", "undecided"]

SMOOTH: Kind = "smooth sliding"
SLIPS: Kind = "stick-slip"
LASTS: Kind = "sustained oscillation"
OPEN: Kind = "undecided"


def decide(seen: Window) -> tuple[Kind, str]:
    """Kind of motion, and why."""
    if reason := _still(seen):
        return SMOOTH, reason
    if reason := _missing(seen):
        return OPEN, reason
    contacts = seen.trace.contacts
    fast = seen.are_slips and seen.ripple > SMALL
    if seen.is_contact_noise and not fast and seen.is_narrow:
        noise = f"no more than the noise of {contacts} contacts"
        return SMOOTH, f"{_fluctuation(seen)}: {noise}"
    if reason := _changes(seen):
        return OPEN, reason
    if seen.is_stick_slip and not seen.slips_throughout:
        return OPEN, (
            "drops as fast as slips in a part of the window only: judge each part by "
            "itself (--from, --to)"
        )
    manner = "periodic" if seen.cycles else "irregular"
    if seen.is_stick_slip:
        few = f", of few contacts ({contacts})," if seen.is_contact_noise else ""
        return SLIPS, f"{manner}{few} and persistent; {_how_fast(seen)}"
    if _oscillates(seen):
        force = seen.trace.force
        if seen.trace.measured and are_to_and_fro(force.min(), force.max()):
            return OPEN, (
                "the force goes to and fro about zero: strokes, of which a measured "
                "displacement would tell, or an oscillation about a mean that was lost"
            )
        size = f"{_percent(seen.part)}, peak to peak"
        return LASTS, f"{manner}, {size}; {_sticking(seen)}; {_how_fast(seen)}"
    return _uneven(seen)


def _still(seen: Window) -> str:
    """Why sliding is smooth whatever else the window holds; empty if it may not be."""
    small = seen.ripple <= SMALL
    if seen.trend < 0 and small and not seen.are_slips and seen.count >= FEWEST_CYCLES:
        return f"{_change(seen)}, and is down to {_percent(seen.ripple)}"
    if seen.is_still:
        moves = "oscillates" if seen.cycles else "fluctuates"
        return f"the force {moves} by {_percent(seen.swing.value)}, peak to peak"
    # a sawtooth of two or three samples a cycle has the spectrum of noise, too
    normal = seen.kurtosis.value >= NORMAL + ONE_SIDED * seen.kurtosis.error
    masked = small and seen.is_mostly_noise
    white = seen.is_white_noise and normal and seen.hidden <= SMALL
    if not (seen.is_level and (masked or white)):
        return ""
    if seen.found.size == 0:
        return f"the force shows noise only, {_percent(seen.swing.value)}"
    few = seen.trace.measured and seen.count < FEWEST_CYCLES
    if few and not seen.shows_cycles:
        noise = _percent(seen.found.noise / seen.largest)
        return f"the force shows no series of cycles, beside noise of {noise} (rms)"
    return ""


def _missing(seen: Window) -> str:
    """Return the reason why the data do not suffice for a verdict; empty if they do."""
    trace = seen.trace
    if trace.t[0] < (until := trace.steady_load_from):
        at = words.engineering(until, trace.time_unit, 3)
        return f"the normal load changes until {at}: hold it for a while, to tell"
    if seen.count >= FEWEST_CYCLES or seen.velocity_deviation < RESTS:
        return ""
    if seen.shows_cycles:
        lacking = FEWEST_CYCLES - seen.count
        each = trace.length / max(seen.count, 1)
        more = words.engineering(lacking * each, trace.time_unit, 2)
        return (
            f"too short: {seen.count} of the {FEWEST_CYCLES} complete cycles that a "
            f"verdict needs; {lacking} more, about {more}, would tell"
        )
    # as a sawtooth that scatters so, peak to peak
    stands_out = abs(trace.rise) > math.sqrt(12.0) * seen.scatter
    if seen.is_mostly_noise and (seen.is_level or not stands_out):
        return _hidden(seen)
    if not stands_out:
        size = words.engineering(float(np.ptp(trace.force)), trace.force_unit, 3)
        return (
            f"the force changes by {size} in the window, and in no series of slips or "
            "cycles: a longer record would tell"
        )
    way = "rises" if trace.rise > 0 else "falls"
    size = words.engineering(abs(trace.rise), trace.force_unit, 3)
    return (
        f"the force still {way}, by {size} in the window, and shows no complete slip: "
        "a held slider, or a drift; stiffness and velocity tell"
    )


def _changes(seen: Window) -> str:
    """Why an oscillation that is seen may not persist; empty if it does."""
    if seen.trend < 0 or (seen.trend > 0 and not seen.are_slips):
        return _change(seen)
    if seen.persists or not (seen.is_stick_slip or _oscillates(seen)):
        return ""
    if seen.pause > 1.0:
        return (
            f"{seen.found.size} drops, the last so long before the end that they seem "
            f"to have ended: {words.number(seen.pause, 2)} times the longest wait that "
            "chance makes"
        )
    value, error = seen.change
    low, high = (math.exp(value + sign * ERRORS * error) for sign in (-1, 1))
    return (
        f"{seen.found.size} drops; whether they persist is not shown: the amplitude "
        f"changes by a factor {math.exp(value):.2g} ({low:.2g} to {high:.2g}) from one "
        "half of the window to the other"
    )


def _oscillates(seen: Window) -> bool:
    """Whether a force without slips oscillates by itself: it has a period, and its
    amplitude scatters less than that of noise, or is larger than contact noise.
    """
    if not seen.cycles:
        return bool(seen.trace.contacts) and not seen.trace.measured
    # Its amplitude scatters as that of noise does, or is no more than a slider may
    # make of it.
    normal = seen.kurtosis.value >= NORMAL and not seen.is_even
    as_noise = normal or seen.contact_noise[0] < ERRORS
    return not (seen.trace.measured and (as_noise or seen.falls_fast))


def _uneven(seen: Window) -> tuple[Kind, str]:
    """Kind of a motion that neither slips nor oscillates."""
    deviation = seen.velocity_deviation
    if not math.isnan(deviation):
        strays = f"{deviation:.2g} times the drive's velocity off that (rms)"
        if deviation < RESTS:
            return SMOOTH, f"the slider moves evenly, {strays}"
        by = f"its {seen.trace.contacts or ''} contacts".replace("  ", " ")
        return (
            OPEN,
            f"the slider moves unevenly, {strays}: by itself, or shaken by {by}",
        )
    # the noise of the sensor leaves so much of the correlation of a period
    left = PERIODIC * max(1.0 - (seen.found.noise / seen.scatter) ** 2, 0.0)
    repeats = seen.correlation - WHITE / math.sqrt(seen.rest.size) > left
    hidden = seen.is_mostly_noise and repeats
    # noise falls as it rises, and climbs at many rates; its largest drops are few, and
    # it does not climb to them
    few = seen.loading.gain.value <= CLIMBS
    is_fast = seen.found.slip_phase(seen.trace) <= SLIP_PHASE and not few
    dips = is_fast or seen.climbs
    normal = seen.kurtosis.value >= NORMAL and seen.is_narrow
    as_noise = normal and not seen.is_even and not seen.hides_slips
    if as_noise and not hidden and not dips:
        return SMOOTH, f"{_fluctuation(seen)}, as slow noise does"
    if seen.is_mostly_noise:
        return OPEN, _hidden(seen)
    if seen.falls_fast:
        return OPEN, (
            f"drops of {_percent(seen.part)} as fast as slips, but the force climbs to "
            "them at many rates: stiffness and velocity tell, or a steady load"
        )
    return OPEN, (
        f"irregular oscillation of {_percent(seen.part)}, neither slips nor "
        f"noise; {_how_fast(seen)}"
    )


def _hidden(seen: Window) -> str:
    noise = _percent(float(np.ptp(seen.rest)) / seen.largest)
    return f"noise of {noise} hides any oscillation, and slips: record more often"


def _percent(part: float) -> str:
    return f"{100 * part:.3g} % of the largest force"


def _fluctuation(seen: Window) -> str:
    period = "with a period" if seen.cycles else "without a period"
    return f"the force fluctuates by {_percent(seen.part)}, {period}"


def _change(seen: Window) -> str:
    how = "decays" if seen.trend < 0 else "still grows"
    return (
        f"the amplitude {how}, by a factor {math.exp(seen.change.value):.2g} from one "
        "half of the window to the other"
    )


def _sticking(seen: Window) -> str:
    """Whether the slider sticks in an oscillation."""
    stuck = seen.trace.stuck
    if stuck is None:
        return "whether the slider sticks, the force alone does not tell"
    if stuck < RESTS:
        return "the slider never sticks"
    return f"the slider sticks for {100 * stuck:.0f} % of the time"


def _how_fast(seen: Window) -> str:
    """The number that slips are recognised by, in words."""
    if math.isnan(seen.seen_velocity):
        part = 100 * seen.found.slip_phase(seen.trace)
        return f"slipping takes {part:.0f} % of each cycle"
    peak = words.number(seen.seen_velocity, 3)
    return f"peak slider velocity {peak} times that of the drive"

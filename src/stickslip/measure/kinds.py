"""The kind of motion in a window, decided by its features: first whether the evidence
suffices for a verdict, then a few rules, each a test that can fail.
"""

import math
from typing import Literal

import numpy as np

from stickslip import words
from stickslip.measure.features import (
    CLIMBS,
    LASTING,
    NORMAL,
    ONE_SIDED,
    SLIP_PHASE,
    SMALL,
    Window,
)
from stickslip.measure.periods import PERIODIC
from stickslip.measure.slips import WHITE
from stickslip.measure.strokes import are_to_and_fro
from stickslip.measure.trace import ERRORS, FEWEST_CYCLES, STEADY_DEVIATION, STUCK_TIME

Kind = Literal["smooth sliding", "stick-slip", "sustained oscillation", "undecided"]

SMOOTH: Kind = "smooth sliding"
SLIPS: Kind = "stick-slip"
LASTS: Kind = "sustained oscillation"
OPEN: Kind = "undecided"

FALLS_SLOWLY = (
    "the force jumps up and falls slowly: its sign seems reversed (--flip on a command "
    "line, flip=True), or the drive stops and starts again"
)


def decide(seen: Window) -> tuple[Kind, str]:
    """Return the kind of motion and the reason for it."""
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
        return OPEN, f"{reason}: {_longer(seen)}"
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
                "the force alternates about zero: strokes, which a measured "
                "displacement would show, or an oscillation whose mean is missing"
            )
        falls = seen.slips.slip_phase(seen.trace)
        if seen.trace.measured and falls >= 1.0 - SLIP_PHASE:
            return OPEN, FALLS_SLOWLY
        size = f"{_percent(seen.part)}, peak to peak"
        reason = f"{manner}, {size}; {_sticking(seen)}; {_how_fast(seen)}"
        if seen.trace.measured:
            forced = "by itself, or forced by the drive or the track"
            reason += f"; {forced}: other speeds would decide"
        return LASTS, reason
    return _uneven(seen)


def _still(seen: Window) -> str:
    """Return why sliding is smooth, whatever the other features; empty if it may not
    be smooth.
    """
    small = seen.ripple <= SMALL
    if seen.trend < 0 and small and not seen.are_slips and seen.count >= FEWEST_CYCLES:
        return f"{_change(seen)}, and is down to {_percent(seen.ripple)}"
    if seen.is_still:
        moves = "oscillates" if seen.cycles else "fluctuates"
        return f"the force {moves} by {_percent(seen.swing.value)}, peak to peak"
    # a sawtooth of two or three samples per cycle has the spectrum of noise, too, but
    # not its kurtosis
    normal = seen.kurtosis.value >= NORMAL + ONE_SIDED * seen.kurtosis.error
    masked = small and seen.is_mostly_noise
    white = seen.is_white_noise and normal and seen.is_narrow
    hides_little = seen.hidden <= SMALL
    if not (seen.is_level and (masked or (white and hides_little))):
        return ""
    if np.ptp(seen.trace.force) < 1.5 * seen.trace.reading_step:
        return ""  # two neighbouring readings hide what happens between them
    if seen.slips.size == 0:
        return f"the force shows noise only, {_percent(_noise(seen))}"
    few = seen.trace.measured and seen.count < FEWEST_CYCLES
    if few and not seen.shows_cycles:
        noise = _percent(seen.slips.noise / seen.largest)
        return f"the force shows no series of cycles above noise of {noise} (rms)"
    return ""


def _missing(seen: Window) -> str:
    """Return why the data do not suffice for a verdict; empty if they do."""
    trace = seen.trace
    if trace.t[0] < (until := trace.steady_load_from):
        at = words.engineering(until, trace.time_unit, 3)
        return f"the normal load changes until {at}: then hold it for a while"
    if seen.count >= FEWEST_CYCLES or seen.velocity_deviation < STEADY_DEVIATION:
        return ""
    size = words.engineering(float(np.ptp(trace.force)), trace.force_unit, 3)
    # compared with the peak to peak of a sawtooth of this scatter
    sawtooth = math.sqrt(12.0) * seen.scatter
    stands_out = abs(trace.rise) > max(sawtooth, trace.reading_step)
    if seen.scatter < trace.reading_step and not stands_out:
        steps = words.engineering(trace.reading_step, trace.force_unit, 3)
        return (
            f"the force changes by {size} in the window, and was recorded in steps of "
            f"{steps}: a finer record would decide"
        )
    if seen.shows_cycles:
        lacking = FEWEST_CYCLES - seen.count
        each = trace.length / max(seen.count, 1)
        more = words.engineering(lacking * each, trace.time_unit, 2)
        return (
            f"too short: {seen.count} of the {FEWEST_CYCLES} complete cycles that a "
            f"verdict needs; {lacking} more, about {more}, would suffice"
        )
    if seen.is_mostly_noise and (seen.is_level or not stands_out):
        return _hidden(seen)
    if not stands_out:
        return (
            f"the force changes by {size} in the window, without a series of slips or "
            f"cycles: {_longer(seen)}"
        )
    way = "rises" if trace.rise > 0 else "falls"
    size = words.engineering(abs(trace.rise), trace.force_unit, 3)
    shown = (
        f"the force still {way}, by {size} in the window, and shows no complete slip"
    )
    if trace.pace is not None:
        return f"{shown}: {_longer(seen)}"
    return f"{shown}: a held slider, or a drift; stiffness and velocity would decide"


def _changes(seen: Window) -> str:
    """Return why an oscillation may not persist; empty if it does, or if there is no
    oscillation.
    """
    if seen.trend < 0 or (seen.trend > 0 and not seen.are_slips):
        return _change(seen)
    if seen.persists or not (seen.is_stick_slip or _oscillates(seen)):
        return ""
    if seen.pause > 1.0:
        return (
            f"{seen.slips.size} drops, which seem to have ended: the time since the "
            f"last is {words.number(seen.pause, 2)} times the longest wait expected by "
            "chance"
        )
    value, error = seen.change
    low, high = (math.exp(value + sign * ERRORS * error) for sign in (-1, 1))
    return (
        f"{seen.slips.size} drops; whether they persist is not shown: the amplitude "
        f"changes by a factor {math.exp(value):.2g} ({low:.2g} to {high:.2g}) from one "
        "half of the window to the other"
    )


def _oscillates(seen: Window) -> bool:
    """Whether a force without slips oscillates by itself rather than as noise: a
    measured one must have a period and no sign of noise.
    """
    if not seen.cycles:
        return bool(seen.trace.contacts) and not seen.trace.measured
    # Signs of noise: its amplitude scatters as that of noise, or is no larger than the
    # noise of the contacts makes it.
    normal = seen.kurtosis.value >= NORMAL and not seen.is_even
    as_noise = normal or seen.contact_noise[0] < ERRORS
    return not (seen.trace.measured and (as_noise or seen.falls_fast))


def _uneven(seen: Window) -> tuple[Kind, str]:
    """Return the kind of a motion that neither slips nor oscillates, and the reason."""
    deviation = seen.velocity_deviation
    if not math.isnan(deviation):
        rms = f"rms deviation from the drive's velocity: {deviation:.2g} of it"
        if deviation < STEADY_DEVIATION:
            return SMOOTH, f"the slider moves evenly ({rms})"
        by = f"its {seen.trace.contacts or ''} contacts".replace("  ", " ")
        reason = f"the slider moves unevenly ({rms}), by itself, or shaken by {by}"
        if not seen.trace.measured:
            reason += ": a run with more contacts would decide"
        return OPEN, reason
    # correlation that the noise of the sensor leaves of that of a periodic force
    left = PERIODIC * max(1.0 - (seen.slips.noise / seen.scatter) ** 2, 0.0)
    repeats = seen.correlation - WHITE / math.sqrt(seen.trace.residual.size) > left
    hidden = seen.is_mostly_noise and repeats
    # Noise falls as fast as it rises, and climbs at various rates. Rare drops, to which
    # the force does not climb, take little of the time, too.
    rare = seen.is_mostly_noise and seen.loading.gain.value <= CLIMBS
    fast = seen.slips.slip_phase(seen.trace) <= SLIP_PHASE and not rare
    dips = fast or seen.climbs
    normal = seen.kurtosis.value >= NORMAL and seen.is_narrow
    # ... and keeps its size, if not exactly
    fades = seen.change.value < -LASTING
    as_noise = normal and not seen.is_even and not seen.hides_slips and not fades
    if as_noise and not hidden and not dips:
        return SMOOTH, f"{_fluctuation(seen)}, as slow noise does"
    if seen.is_mostly_noise:
        return OPEN, _hidden(seen)
    if seen.falls_fast:
        return OPEN, (
            f"drops of {_percent(seen.part)} as fast as slips, but the force climbs to "
            "them at various rates: stiffness and velocity, or a steady load, would "
            "decide"
        )
    return OPEN, (
        f"irregular oscillation of {_percent(seen.part)}, neither slips nor "
        f"noise; {_how_fast(seen)}: stiffness and velocity would show whether the "
        "slider sticks"
    )


def _longer(seen: Window) -> str:
    """Return the remedy for a window that is too short."""
    return f"a longer {'record' if seen.trace.measured else 'run'} would decide"


def _hidden(seen: Window) -> str:
    noise = _percent(_noise(seen))
    return f"noise of {noise} hides any oscillation, and slips: record more often"


def _noise(seen: Window) -> float:
    """Return the force without its drift, peak to peak, over the largest force."""
    return float(np.ptp(seen.trace.residual)) / seen.largest


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
    """Return whether the slider sticks in an oscillation, in words."""
    stuck = seen.trace.stuck
    if stuck is None:
        return "the force alone does not show whether the slider sticks"
    if stuck < STUCK_TIME:
        return "the slider never sticks"
    return f"the slider sticks for {100 * stuck:.0f} % of the time"


def _how_fast(seen: Window) -> str:
    """Return the number by which slips are recognised, in words."""
    if math.isnan(seen.seen_velocity):
        part = 100 * seen.slips.slip_phase(seen.trace)
        return f"slipping takes {part:.0f} % of each cycle"
    peak = words.number(seen.seen_velocity, 3)
    return f"peak slider velocity {peak} times that of the drive"

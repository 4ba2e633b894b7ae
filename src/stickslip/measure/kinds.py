"""The kind of motion in a window, by its features: what is missing for a verdict
first, then a few rules, each a test that would deny its word.
"""

import math
from typing import Literal

from stickslip import words
from stickslip.measure.features import (
    HELD_TIME,
    NORMAL,
    ONE_SIDED,
    SLIDER_VELOCITY,
    SMALL,
    TINY,
    Features,
)
from stickslip.measure.trace import ERRORS, FEWEST_CYCLES, RESTS

Kind = Literal["smooth sliding", "stick-slip", "sustained oscillation", "undecided"]

SMOOTH: Kind = "smooth sliding"
SLIPS: Kind = "stick-slip"
LASTS: Kind = "sustained oscillation"
OPEN: Kind = "undecided"


def is_stick_slip(seen: Features) -> bool:
    """Whether the force climbs to its drops, and these are as fast as slips."""
    return seen.are_slips and seen.climbs and seen.count >= FEWEST_CYCLES


def decide(seen: Features, force_unit: str, time_unit: str) -> tuple[Kind, str]:
    """Kind of motion, and why."""
    if reason := _still(seen):
        return SMOOTH, reason
    if reason := _missing(seen, force_unit, time_unit):
        return OPEN, reason
    if reason := _noise_of_contacts(seen):
        return SMOOTH, reason
    if reason := _changes(seen):
        return OPEN, reason
    if is_stick_slip(seen):
        manner = "periodic" if seen.cycles else "irregular"
        if 0 < seen.contact_noise < seen.noise_limit:
            manner = f"irregular, of few contacts ({seen.contacts}),"
        return SLIPS, f"{manner} and persistent; {_how_slips_show(seen)}"
    if seen.are_slips and seen.drops >= FEWEST_CYCLES:
        return OPEN, (
            f"{seen.drops} fast drops, to which the force does not climb at one rate: "
            "dips, rather than slips"
        )
    if _oscillates(seen):
        manner = "periodic" if seen.cycles else "irregular"
        size = f"{_percent(seen.part)}, peak to peak"
        return LASTS, f"{manner}, {size}; {_sticking(seen)}; {_how_slips_show(seen)}"
    return _uneven(seen, time_unit)


def _still(seen: Features) -> str:
    """Why sliding is smooth whatever else the window holds; empty if it may not be."""
    shrinks = not seen.steady and seen.change.value < 0
    small = seen.ripple <= SMALL
    if seen.count >= FEWEST_CYCLES and shrinks and small and not seen.are_slips:
        return f"{_change(seen)}, and is down to {_percent(seen.ripple)}"
    grows = not seen.steady and seen.change.value > 0
    if seen.swing.value < TINY and not seen.are_slips and not grows:
        moves = "oscillates" if seen.cycles else "fluctuates"
        return f"the force {moves} by {_percent(seen.swing.value)}, peak to peak"
    # a sawtooth of two or three samples a cycle has the spectrum of noise, too
    least = NORMAL + ONE_SIDED * seen.kurtosis.error
    normal = seen.kurtosis.value >= least
    masked = small and seen.is_mostly_noise
    white = seen.is_white_noise and normal and seen.is_narrow
    noise_only = seen.drops == 0 and seen.is_level and (masked or white)
    return (
        f"the force shows noise only, {_percent(seen.swing.value)}"
        if noise_only
        else ""
    )


def _missing(seen: Features, force_unit: str, time_unit: str) -> str:
    """What a verdict lacks; empty if the data suffice."""
    if seen.count >= FEWEST_CYCLES or seen.velocity_deviation < RESTS:
        return ""
    if seen.drops:
        lacking = FEWEST_CYCLES - seen.count
        each = seen.span / max(seen.count, 1)
        more = words.engineering(lacking * each, time_unit, 2)
        return (
            f"too short: {seen.count} of the {FEWEST_CYCLES} complete cycles that a "
            f"verdict needs; {lacking} more, about {more}, would tell"
        )
    # as a sawtooth that scatters so, peak to peak
    stands_out = abs(seen.drift) > math.sqrt(12.0) * seen.scatter
    drifts = stands_out and not seen.is_level
    if seen.is_mostly_noise and not drifts:
        noise = _percent(seen.part)
        return f"noise of {noise} masks any oscillation, and slips: record more often"
    way = "rises" if seen.drift > 0 else "falls"
    size = words.engineering(abs(seen.drift), force_unit, 3)
    return (
        f"the force still {way}, by {size} in the window, and shows no complete slip: "
        "a held slider, or a drift; stiffness and velocity tell"
    )


def _noise_of_contacts(seen: Features) -> str:
    """Why a fluctuation is noise of the contacts; empty if it is not known to be."""
    slips = seen.are_slips and seen.ripple > SMALL
    if not seen.contact_noise < seen.noise_limit or slips or not seen.is_narrow:
        return ""
    return f"{_fluctuation(seen)}: no more than the noise of {seen.contacts} contacts"


def _changes(seen: Features) -> str:
    """Why what is seen of an oscillation may not persist; empty if it does."""
    change = seen.change
    oscillates = is_stick_slip(seen) or _oscillates(seen)
    if not seen.steady and change.value < 0:
        return _change(seen)
    if not seen.steady and not seen.are_slips:
        return _change(seen)
    if not oscillates or seen.persists:
        return ""
    if seen.pause > 1.0:
        return (
            f"{seen.drops} drops, the last so long before the end that they seem to "
            f"have ended: {words.number(seen.pause, 2)} times the longest wait that "
            "chance makes"
        )
    low, high = (
        math.exp(change.value + sign * ERRORS * change.error) for sign in (-1, 1)
    )
    return (
        f"{seen.drops} drops; whether they persist is not shown: the amplitude changes "
        f"by a factor {math.exp(change.value):.2g} ({low:.2g} to {high:.2g}) from one "
        "half of the window to the other"
    )


def _oscillates(seen: Features) -> bool:
    """Whether a force without slips oscillates by itself: a period, and an amplitude
    that scatters less than that of noise; or more than its contacts make.
    """
    if not seen.cycles:
        return bool(seen.contacts) and not seen.measured
    # Its amplitude scatters as that of noise does, or is no more than a slider may
    # make of it.
    as_noise = seen.kurtosis.value >= NORMAL or seen.contact_noise < ERRORS
    return not (seen.measured and as_noise)


def _uneven(seen: Features, time_unit: str) -> tuple[Kind, str]:
    """Kind of a motion that neither slips nor oscillates."""
    deviation = seen.velocity_deviation
    if not math.isnan(deviation):
        strays = f"{deviation:.2g} times the drive's velocity off that (rms)"
        if deviation < RESTS:
            return SMOOTH, f"the slider moves evenly, {strays}"
        by = f"its {seen.contacts} contacts" if seen.contacts else "its contacts"
        return (
            OPEN,
            f"the slider moves unevenly, {strays}: by itself, or shaken by {by}",
        )
    if seen.line >= TINY and seen.is_mostly_noise:
        period = words.engineering(seen.line_period, time_unit, 2)
        noise = _percent(seen.part)
        return OPEN, (
            f"a period of {period} stands out of noise of {noise}, which hides slips: "
            "record more often"
        )
    if seen.kurtosis.value >= NORMAL and seen.is_narrow:
        return SMOOTH, f"{_fluctuation(seen)}, as slow noise does"
    return OPEN, (
        f"irregular oscillation of {_percent(seen.part)}, neither slips nor "
        f"noise; {_how_slips_show(seen)}"
    )


def _percent(part: float) -> str:
    return f"{100 * part:.3g} % of the largest force"


def _fluctuation(seen: Features) -> str:
    period = "with a period" if seen.cycles else "without a period"
    return f"the force fluctuates by {_percent(seen.part)}, {period}"


def _change(seen: Features) -> str:
    trend = math.exp(seen.change.value)
    how = "decays" if trend < 1.0 else "still grows"
    return (
        f"the amplitude {how}, by a factor {trend:.2g} from one half of the window to "
        "the other"
    )


def _sticking(seen: Features) -> str:
    """Whether the slider sticks in an oscillation."""
    if math.isnan(seen.stuck):
        return "whether the slider sticks, the force alone does not tell"
    if seen.stuck < RESTS:
        return "the slider never sticks"
    return f"the slider sticks for {100 * seen.stuck:.0f} % of the time"


def _how_slips_show(seen: Features) -> str:
    """The number that slips are recognised by, in words."""
    if seen.slip_test == SLIDER_VELOCITY:
        peak = words.number(seen.slips.value, 3)
        return f"peak slider velocity {peak} times that of the drive"
    if seen.slip_test == HELD_TIME and seen.are_slips:
        part = 100 * seen.slips.value
        return f"the force rises at its full rate for {part:.0f} % of the time"
    return f"slipping takes {100 * seen.slip_phase:.0f} % of each cycle"

"""Runs that judge a rig: how long they last, with which contacts, how many of them, and what they may cost."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from stickslip.advise import linear
from stickslip.errors import InputError, UndecidedError
from stickslip.measure import Regime, regime_of
from stickslip.measure.arrays import Trace
from stickslip.measure.slips import SLIP_VELOCITY
from stickslip.model import Contacts, FromRest, FromSliding, Method, Start
from stickslip.model.drive import Drive, constant
from stickslip.model.rig import Rig
from stickslip.progress import Progress
from stickslip.simulation import Recording, estimate, record
from stickslip.stability import growth_rate

CYCLES = 12.0
"""A run lasts a dozen cycles of the slowest oscillation that the rig can have ..."""
_SHORTEST = 60.0
_RINGING = 10.0
"""... at least this far, in mean thresholds, and until the free slider has rung out, in units of ``1/eta``."""
_DECAYS, _LONGEST = 6.0, 4.0
"""A last test lasts for so many times 1/decay rate, but not for more than so many runs."""
_MOST_RUNS = 3
"""How often a run that cannot be judged is made, each time twice as long."""
_NO_NOISE = 2.0 * SLIP_VELOCITY
"""Times the velocity of the drive that no noise of contacts in smooth sliding reaches."""
_PARTS = 10
"""Parts of a run over which the error of a variance is told."""
OSCILLATES = ("stick-slip", "sustained oscillation")
_READING = 0.006
"""Seconds that it takes to set up a run and to read it."""
PRECISION = 0.05
"""Where motion changes is found to this part of the value; nor is one set more closely on a machine."""
CONFIDENCE, FRACTION = 0.95, 2.0 / 3.0
"""Of a change that is advised: at this confidence, at least this fraction of all runs slides smoothly."""
SEEDS = math.ceil(math.log(1.0 - CONFIDENCE) / math.log(FRACTION))
"""Runs of other contacts that must all slide smoothly for that: were the fraction smaller, so many would rarely do."""
_USUAL, _MOST_AGED = Contacts(10_000, seed=1), 2_000


class Spent(Exception):  # noqa: N818 - not an error: it ends a search
    """The work that was allowed is done."""


class Budget:
    """What runs may cost, in seconds by estimate and not by the clock, so that the same rig gets the same answer."""

    def __init__(self, seconds: float) -> None:
        self.left = seconds

    def pay(self, seconds: float) -> None:
        """Take the cost of a run, or raise `Spent` if there is not as much left."""
        if seconds > self.left:
            raise Spent
        self.left -= seconds


def contacts_of(rig: Rig) -> Contacts:
    """The contacts that judge a rig: its own, as their noise is its own; for a rig without a number of them, many."""
    own = rig.method if isinstance(rig.method, Contacts) else _USUAL
    return own if rig.interface.ageing is None else replace(own, count=min(own.count, _MOST_AGED))


def other_contacts(method: Contacts, other: int) -> Contacts:
    """Other contacts of the same kind."""
    return replace(method, seed=method.seed + other)


def cycle_of(setting: Rig) -> float:
    """Travel of the drive in the slowest cycle of a rig: a life of a contact and the loading, or a free oscillation."""
    slider = setting.slider
    stretch = setting.interface.threshold_distribution.moment(1)
    period = 2.0 * math.pi / slider.frequency if slider.mass > 0 else 0.0
    delay = setting.interface.delay.moment(1)
    detached = setting.velocity * delay if math.isfinite(delay) else 0.0
    return float(max(stretch * (1.0 + 1.0 / slider.stiffness) + detached, setting.velocity * period))


def length_of(setting: Rig) -> float:
    """Travel of the drive after which a run can be judged."""
    damping = setting.slider.damping
    ringing = setting.velocity * _RINGING / damping if damping > 0 else 0.0
    shortest = _SHORTEST * setting.interface.threshold_distribution.moment(1)
    cycles = CYCLES * cycle_of(setting)
    return max(shortest, cycles, min(ringing, 5.0 * cycles))


def until_decayed(setting: Rig) -> float:
    """Travel of the drive in which the slowest mode decays, within reason; 0 where nothing is known of modes."""
    longest = _LONGEST * length_of(setting)
    try:
        rate = growth_rate(setting).real
    except UndecidedError:  # distributions with heavy tails have no slowest mode: what decays with them may take long
        return longest
    except InputError:
        return 0.0
    return min(setting.velocity * _DECAYS / -rate, longest) if rate < 0 else 0.0


def at_speed(setting: Rig, speed: float, distance: float | None = None) -> Rig:
    """The rig at a constant speed, for as long as it takes to judge a run unless a distance is given."""
    return replace(setting, drive=constant(speed, (length_of(setting) if distance is None else distance) / speed))


def cost_of(rig: Rig) -> float:
    """Seconds that a run takes, with its reading."""
    return estimate(rig).seconds + _READING


def until_judged(
    case: Rig,
    budget: Budget,
    *,
    most: int = _MOST_RUNS,
    fewest: float = 0.0,
    long: bool = True,
    progress: Progress | None = None,
) -> tuple[Recording, Regime]:
    """Make a run that ends at a constant speed, and again twice as long while its regime is undecided.

    The caller has paid for the first; the second lasts for the time `fewest` at least; without `long` the first is
    refused where it takes too long.
    """
    run = record(case, progress=progress, long=long)
    seen = regime_of(run)
    for _ in range(most - 1):
        if seen.kind != "undecided":
            break
        method = contacts_of(case) if isinstance(case.method, Contacts) else case.method
        case = replace(case, method=method, drive=_longer(case.drive, fewest))
        try:
            budget.pay(cost_of(case))
        except Spent:
            break
        run = record(case, progress=progress, long=True)
        seen = regime_of(run)
    return run, seen


def _longer(drive: Drive, fewest: float) -> Drive:
    """The drive, with its last piece so much longer that the whole takes twice the time, or that which is given."""
    *before, last = drive.pieces
    lasts = max(2.0 * drive.duration, fewest) - (drive.duration - last.duration)
    return Drive((*before, replace(last, duration=lasts)))


def judge(
    setting: Rig, method: Method, budget: Budget, *, start: Start = FromRest(), distance: float | None = None
) -> Regime:
    """The regime that a start leads to at the constant speed of a rig, in natural units; runs on until it can be told.

    An oscillation about stable smooth sliding is sustained only if it outlasts the slowest mode.

    Raises
    ------
    Spent
        If the budget does not allow for a first run. What cannot be told with what is left is undecided.
    """
    case = replace(at_speed(setting, setting.velocity, distance), method=method, start=start)
    budget.pay(cost_of(case))
    run, seen = until_judged(case, budget)
    if seen.kind not in OSCILLATES or not linear.is_stable(setting):
        return seen
    try:
        run, seen = outlasting(run, seen, budget)
        if seen.kind not in OSCILLATES or not isinstance(method, Contacts):
            return seen
        if steady_state(run, seen, budget) == "noise":
            return replace(seen, kind="smooth sliding", reason=f"noise of {method.count} contacts, as from sliding")
    except Spent:
        return untold(seen)
    return seen


def untold(seen: Regime) -> Regime:
    """A regime of which runs do not tell, within what they may cost, whether it is noise."""
    return replace(seen, kind="undecided", reason="an oscillation, or noise of its contacts: longer runs would tell")


def outlasting(run: Recording, seen: Regime, budget: Budget) -> tuple[Recording, Regime]:
    """A run of an oscillation about stable smooth sliding, made longer until that has lasted or decayed.

    It lasts if it does not become weaker any more, after the slowest mode has had time to decay.
    """
    setting = run.rig.natural
    needed = until_decayed(setting) / setting.velocity
    for _ in range(_MOST_RUNS):
        if seen.kind not in OSCILLATES or (run.rig.drive.duration >= needed and _is_steady(run, seen)):
            return run, seen
        case = replace(run.rig, drive=_longer(run.rig.drive, needed))
        budget.pay(cost_of(case))
        run, seen = until_judged(case, budget)
    if seen.kind in OSCILLATES and not _is_steady(run, seen):
        reason = "the oscillation becomes weaker little by little: a longer run would tell whether it decays"
        seen = replace(seen, kind="undecided", reason=reason)
    return run, seen


def _is_steady(run: Recording, seen: Regime) -> bool:
    """Whether the force varies no less in what is judged than for as long before it, within three standard errors."""
    begin, end = seen.window
    before, after = _variance(run, begin - (end - begin), begin), _variance(run, begin, end)
    return before[0] - after[0] < 3.0 * math.hypot(before[1], after[1])


def steady_state(run: Recording, seen: Regime, budget: Budget) -> Literal["noise", "leaves", "stays"]:
    """What a linearly stable rig does that does not look smooth from rest, told by runs from smooth sliding.

    A rig that does the same from rest and from sliding is in its steady state. Noise of its contacts has four times the
    variance with a quarter of them: then that is what it does. Otherwise its contacts leave smooth sliding. Where the
    run from sliding fluctuates less, smooth sliding stays, once reached.

    Raises
    ------
    Spent
        If the budget does not allow for these runs, or they do not tell.
    """
    method, begin = run.rig.method, seen.window[0]
    assert isinstance(method, Contacts)
    own = replace(run.rig, start=FromSliding(), method=other_contacts(method, 1))
    budget.pay(cost_of(own))
    (from_rest, error), (from_sliding, other) = _variance(run, begin), _variance(record(own, long=True), begin)
    # Noise that a mode amplifies stays as it is for as long as the mode takes to decay: few values of a variance.
    judged = run.rig.drive.duration * (1.0 - begin / seen.window[1])
    few = math.sqrt(2.0 * until_decayed(run.rig.natural) / (_DECAYS * run.rig.natural.velocity * judged))
    if from_rest - from_sliding > max(math.log(2.0), 3.0 * max(math.hypot(error, other), few)):
        return "stays"
    if from_rest - from_sliding > math.log(2.0):
        raise Spent
    fewer = replace(own, method=replace(method, count=max(method.count // 4, 1), seed=method.seed + 2))
    budget.pay(cost_of(fewer))
    risen = _variance(record(fewer, long=True), begin)[0] - 0.5 * (from_rest + from_sliding)
    return "noise" if risen > math.log(2.0) else "leaves"  # twice the variance lies between as much and four times


def _variance(run: Recording, begin: float, end: float = math.inf) -> tuple[float, float]:
    """Logarithm of the variance of the force between two times, with its standard error over parts of the run."""
    trace = Trace.of_recording(run).part(begin, end)
    squares = (trace.force - trace.force.mean()) ** 2
    parts = np.array([part.mean() for part in np.array_split(squares, _PARTS)])
    mean = max(float(parts.mean()), 1e-300)
    return math.log(mean), float(parts.std(ddof=1)) / mean / math.sqrt(_PARTS)


def rms_over_mean(run: Recording, begin: float) -> float:
    """Standard deviation of the force from a time on, over its mean."""
    force = Trace.of_recording(run).part(begin).force
    return float(force.std() / abs(force.mean()))


def slides_smoothly(setting: Rig, method: Contacts, budget: Budget, start: Start) -> bool:
    """Whether `SEEDS` runs of other contacts all slide smoothly, one of them until the slowest mode decays."""
    usual = length_of(setting)
    long = max(until_decayed(setting), 2.0 * usual)
    distances = [usual, long, *[usual] * (SEEDS - 2)]  # what does not slide is most often told by the first, short one
    try:
        for other, distance in enumerate(distances, start=1):
            seen = judge(setting, other_contacts(method, other), budget, start=start, distance=distance)
            # So few contacts that slips are no larger than their noise: how fast the slider goes tells them apart.
            fast = seen.largest_velocity is not None and seen.largest_velocity > _NO_NOISE
            if fast or seen.kind != "smooth sliding":
                return False
    except InputError:  # such a rig cannot be simulated
        return False
    return True


def first_smooth(smooth: Callable[[float], bool], begin: float, end: float, ill: float) -> float | None:
    """A value between two ends down to `PRECISION` below which it slides smoothly, the nearest one within `PRECISION`.

    Steps double from the beginning on; the end itself is the last that is tried. It does not slide smoothly at `ill`,
    before the beginning. None if there is no such value.
    """
    step, value = 1.0 + PRECISION, begin
    while not smooth(value):
        ill = value
        if value == end:
            return None
        value = min(value * step, end)
        step *= step
    value = linear.bisect(smooth, ill, value, PRECISION)[1] * (1.0 + PRECISION)
    return value if value <= end else None

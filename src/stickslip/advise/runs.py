"""Runs that judge a rig: how long they last, with which contacts, how many of them, and what they may cost."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from stickslip.advise.bands import OSCILLATES, PRECISION, by_theory
from stickslip.cycles.edges import halved
from stickslip.errors import InputError, UndecidedError
from stickslip.measure import Regime, regime_of
from stickslip.measure.arrays import Trace
from stickslip.measure.slips import SLIP_VELOCITY
from stickslip.model import Contacts, FromRest, FromSliding, Start
from stickslip.model.drive import Drive, constant
from stickslip.model.rig import Rig
from stickslip.progress import Progress
from stickslip.simulation import Recording, estimate, record
from stickslip.stability import growth_rate

_CYCLES = 12.0
"""A run lasts a dozen cycles of the slowest oscillation that the rig can have ..."""
_SHORTEST, _RINGING = 60.0, 10.0
"""... at least this far, in mean thresholds, and until the free slider has rung out, in units of ``1/eta``."""
_DECAYS, _LONGEST = 6.0, 4.0
"""A last test lasts for so many times 1/decay rate, but not for more than so many runs."""
MOST_RUNS = 3
"""How often a run that cannot be judged is made, each time twice as long."""
_NO_NOISE = 2.0 * SLIP_VELOCITY
"""Times the velocity of the drive that no noise of contacts in smooth sliding reaches."""
_PARTS = 10
"""Parts of a run over which the error of a variance is told."""
_TWICE = math.log(2.0)
"""Between as much variance and four times as much."""
_READING = 0.006
"""Seconds that it takes to set up a run and to read it."""
SEEDS = math.ceil(math.log(1.0 - 0.95) / math.log(2.0 / 3.0))
"""Runs of other contacts that must all slide smoothly: then, at 95 % confidence, two of three of all runs do."""
_USUAL, _MOST_AGED = Contacts(10_000, seed=1), 2_000

Steady = Literal["stays", "leaves", "noise"]
"""What linearly stable smooth sliding does: it stays, noise of the contacts leaves it, or noise is all that is seen."""


class Spent(Exception):  # noqa: N818 - not an error: it ends a search
    """The work that was allowed is done."""


class Budget:
    """What runs may cost, in seconds by estimate and not by the clock, so that the same rig gets the same answer."""

    def __init__(self, seconds: float) -> None:
        self.left = seconds

    def pay(self, case: Rig) -> None:
        """Take the cost of a run, or raise `Spent` if there is not as much left."""
        if (seconds := cost_of(case)) > self.left:
            raise Spent
        self.left -= seconds


def cost_of(case: Rig) -> float:
    """Seconds that a run takes, with its reading."""
    return estimate(case).seconds + _READING


def contacts_of(rig: Rig, other: int = 0) -> Contacts:
    """The contacts that judge a rig, or others of their kind: its own, as their noise is; many if it has no number."""
    own = rig.method if isinstance(rig.method, Contacts) else _USUAL
    count = own.count if rig.interface.ageing is None else min(own.count, _MOST_AGED)
    return replace(own, count=count, seed=own.seed + other)


# How long


def cycle_of(rig: Rig) -> float:
    """Travel of the drive in the slowest cycle of a rig: a life of a contact and the loading, or a free oscillation."""
    slider, velocity = rig.slider, rig.natural.velocity
    stretch = rig.interface.threshold_distribution.moment(1)
    period = 2.0 * math.pi / slider.frequency if slider.mass > 0 else 0.0
    delay = rig.interface.delay.moment(1)
    detached = velocity * delay if math.isfinite(delay) else 0.0
    return float(max(stretch * (1.0 + 1.0 / slider.stiffness) + detached, velocity * period))


def length_of(rig: Rig) -> float:
    """Travel of the drive after which a run can be judged."""
    damping, cycles = rig.slider.damping, _CYCLES * cycle_of(rig)
    ringing = rig.natural.velocity * _RINGING / damping if damping > 0 else 0.0
    return max(_SHORTEST * rig.interface.threshold_distribution.moment(1), cycles, min(ringing, 5.0 * cycles))


def until_decayed(rig: Rig) -> float:
    """Travel of the drive in which the slowest mode decays, within reason; 0 where nothing is known of modes."""
    longest = _LONGEST * length_of(rig)
    try:
        rate = growth_rate(rig.natural).real
    except UndecidedError:  # distributions with heavy tails have no slowest mode: what decays with them may take long
        return longest
    except InputError:
        return 0.0
    return min(rig.natural.velocity * _DECAYS / -rate, longest) if rate < 0 else 0.0


def at_speed(rig: Rig, factor: float = 1.0, distance: float | None = None) -> Rig:
    """The rig at a constant speed, a factor on its own, for as long as it takes to judge a run, or for a distance."""
    speed = factor * rig.natural.velocity
    there = replace(rig, drive=constant(speed))
    return replace(there, drive=constant(speed, (length_of(there) if distance is None else distance) / speed))


def _longer(case: Rig, lasts: float = 0.0) -> Rig:
    """The run, with the last piece of its drive so much longer that it takes twice the time, or that which is given."""
    *before, last = case.drive.pieces
    lasts = max(2.0 * case.drive.duration, lasts) - (case.drive.duration - last.duration)
    return replace(case, drive=Drive((*before, replace(last, duration=lasts))))


# What they tell


def watch(
    case: Rig,
    budget: Budget,
    *,
    most: int = MOST_RUNS,
    spare: float = 0.0,
    long: bool = True,
    progress: Progress | None = None,
) -> tuple[Recording, Regime, Steady]:
    """What a run that ends at a constant speed shows, made longer until that can be told; the first is paid for.

    Of a linearly stable rig that does not look smooth, further runs, with what is to `spare` for them, tell an
    oscillation from the noise of its contacts.
    """
    run, seen = _until_told(case, budget, most, long, progress)
    budget.left += spare
    few = isinstance(case.method, Contacts)
    if seen.kind == "smooth sliding" or not few or by_theory(run.rig) != "stable":
        return run, seen, "stays"
    try:
        run, seen = _outlasting(run, seen, budget)
        state: Steady = "stays" if seen.kind == "smooth sliding" else _steady_state(run, seen, budget)
    except Spent:
        reason = "an oscillation, or noise of its contacts: longer runs would tell"
        return run, replace(seen, kind="undecided", reason=reason), "stays"
    if state == "noise":
        reason = "noise of the contacts: as much from sliding as from rest, and more with a quarter as many"
        seen = replace(seen, kind="smooth sliding", reason=reason)
    return run, seen, state


def judge(
    rig: Rig, method: Contacts, budget: Budget, *, start: Start = FromRest(), distance: float | None = None
) -> Regime:
    """The regime that a start leads to at the constant speed of a rig; undecided if the budget ends before it is told.

    Raises `Spent` if the budget does not allow for a first run.
    """
    case = replace(at_speed(rig, distance=distance), method=method, start=start)
    budget.pay(case)
    return watch(case, budget)[1]


def _until_told(
    case: Rig, budget: Budget, most: int = MOST_RUNS, long: bool = True, progress: Progress | None = None
) -> tuple[Recording, Regime]:
    """A run, and its regime; again, twice as long, of no more contacts than judge a rig, while that is undecided."""
    run = record(case, progress=progress, long=long)
    for _ in range(most - 1):
        if (seen := regime_of(run)).kind != "undecided":
            return run, seen
        method = contacts_of(case) if isinstance(case.method, Contacts) else case.method
        case = _longer(replace(case, method=method))
        try:
            budget.pay(case)
        except Spent:
            return run, seen
        run = record(case, progress=progress, long=True)
    return run, regime_of(run)


def _outlasting(run: Recording, seen: Regime, budget: Budget) -> tuple[Recording, Regime]:
    """A run of an oscillation about stable smooth sliding, made longer until that has decayed, or lasts.

    It lasts if it is no weaker after the slowest mode has had time to decay. Raises `Spent` if that cannot be told.
    """
    needed = until_decayed(run.rig) / run.rig.natural.velocity
    for _ in range(MOST_RUNS + 1):
        if seen.kind not in OSCILLATES or (run.rig.drive.duration >= needed and _is_steady(run, seen)):
            return run, seen
        case = _longer(run.rig, needed)
        budget.pay(case)
        run, seen = _until_told(case, budget)
    raise Spent


def _is_steady(run: Recording, seen: Regime) -> bool:
    """Whether the force varies no less in what is judged than for as long before it, within three standard errors."""
    begin, end = seen.window
    before, after = _variance(run, begin - (end - begin), begin), _variance(run, begin, end)
    return before[0] - after[0] < 3.0 * math.hypot(before[1], after[1])


def _steady_state(run: Recording, seen: Regime, budget: Budget) -> Steady:
    """What runs from smooth sliding tell; raises `Spent` if they cost too much, or do not tell.

    Where they fluctuate less than from rest, smooth sliding, once reached, stays. Else they leave it, or it is noise
    of the contacts, which has four times the variance with a quarter of them.
    """
    case, begin = run.rig, seen.window[0]
    sliding = replace(case, start=FromSliding(), method=contacts_of(case, 1))
    budget.pay(sliding)
    (from_rest, error), (from_sliding, other) = _variance(run, begin), _variance(record(sliding, long=True), begin)
    # Noise that a mode amplifies stays as it is for as long as the mode takes to decay: few values of a variance.
    judged = case.drive.duration * (1.0 - begin / seen.window[1])
    few = math.sqrt(2.0 * until_decayed(case) / (_DECAYS * case.natural.velocity * judged))
    if from_rest - from_sliding > max(_TWICE, 3.0 * max(math.hypot(error, other), few)):
        return "stays"
    if from_rest - from_sliding > _TWICE:
        raise Spent
    method = contacts_of(case, 2)
    fewer = replace(sliding, method=replace(method, count=max(method.count // 4, 1)))
    budget.pay(fewer)
    risen = _variance(record(fewer, long=True), begin)[0] - 0.5 * (from_rest + from_sliding)
    return "noise" if risen > _TWICE else "leaves"


def _variance(run: Recording, begin: float, end: float = math.inf) -> tuple[float, float]:
    """Logarithm of the variance of the force between two times, with its standard error over parts of the run."""
    trace = Trace.of_recording(run).part(begin, end)
    squares = (trace.force - trace.force.mean()) ** 2
    parts = np.array([part.mean() for part in np.array_split(squares, _PARTS)])
    mean = max(float(parts.mean()), 1e-300)
    return math.log(mean), float(parts.std(ddof=1)) / mean / math.sqrt(_PARTS)


def rms_over_mean(run: Recording, seen: Regime) -> float:
    """Standard deviation of the force in what is judged, over its mean."""
    force = Trace.of_recording(run).part(seen.window[0]).force
    return float(force.std() / abs(force.mean()))


def slides_smoothly(rig: Rig, method: Contacts, budget: Budget, start: Start) -> bool:
    """Whether `SEEDS` runs of other contacts all slide smoothly, one of them until the slowest mode decays."""
    usual = length_of(rig)
    long = max(until_decayed(rig), 2.0 * usual)
    distances = [usual, long, *[usual] * (SEEDS - 2)]  # what does not slide is most often told by the first, short one
    try:
        for other, distance in enumerate(distances, start=1):
            contacts = replace(method, seed=method.seed + other)
            seen = judge(rig, contacts, budget, start=start, distance=distance)
            # So few contacts that slips are no larger than their noise: how fast the slider goes tells them apart.
            fast = seen.largest_velocity is not None and seen.largest_velocity > _NO_NOISE
            if fast or seen.kind != "smooth sliding":
                return False
    except InputError:  # such a rig cannot be simulated
        return False
    return True


def first_smooth(smooth: Callable[[float], bool], begin: float, end: float, rough: float) -> float | None:
    """The nearest value between two ends that is smooth down to `PRECISION` below it, within `PRECISION`, if any.

    Steps double from the beginning on, up to the end itself. At `rough`, before the beginning, it does not.
    """
    step, value = 1.0 + PRECISION, begin
    while not smooth(value):
        if value == end:
            return None
        rough, value = value, min(value * step, end)
        step *= step
    width = 1.001 * math.log1p(PRECISION)  # to which doubled steps are halved, whatever the rounding
    value = halved(smooth, rough, value, width)[1] * (1.0 + PRECISION)
    return value if value <= end else None

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
_MOST_RUNS = 3
"""How often a run that cannot be judged is made, each time twice as long."""
_NO_NOISE = 2.0 * SLIP_VELOCITY
"""Times the velocity of the drive that no noise of contacts in smooth sliding reaches."""
_PARTS = 10
"""Parts of a run over which the error of a variance is told."""
_READING = 0.006
"""Seconds that it takes to set up a run and to read it."""
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

    def pay(self, case: Rig) -> None:
        """Take the cost of a run, or raise `Spent` if there is not as much left."""
        if (seconds := cost_of(case)) > self.left:
            raise Spent
        self.left -= seconds


def cost_of(case: Rig) -> float:
    """Seconds that a run takes, with its reading."""
    return estimate(case).seconds + _READING


def contacts_of(rig: Rig) -> Contacts:
    """The contacts that judge a rig: its own, as their noise is its own; for a rig without a number of them, many."""
    own = rig.method if isinstance(rig.method, Contacts) else _USUAL
    return own if rig.interface.ageing is None else replace(own, count=min(own.count, _MOST_AGED))


def others(method: Contacts, other: int) -> Contacts:
    """Other contacts of the same kind."""
    return replace(method, seed=method.seed + other)


# How long


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
    damping, cycles = setting.slider.damping, _CYCLES * cycle_of(setting)
    ringing = setting.velocity * _RINGING / damping if damping > 0 else 0.0
    return max(_SHORTEST * setting.interface.threshold_distribution.moment(1), cycles, min(ringing, 5.0 * cycles))


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


def _longer(case: Rig, lasts: float) -> Rig:
    """The run, with the last piece of its drive so much longer that it takes twice the time, or that which is given."""
    *before, last = case.drive.pieces
    lasts = max(2.0 * case.drive.duration, lasts) - (case.drive.duration - last.duration)
    return replace(case, drive=Drive((*before, replace(last, duration=lasts))))


# What they tell


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
        case = _longer(replace(case, method=method), fewest)
        try:
            budget.pay(case)
        except Spent:
            break
        run = record(case, progress=progress, long=True)
        seen = regime_of(run)
    return run, seen


def judge(
    setting: Rig, method: Contacts, budget: Budget, *, start: Start = FromRest(), distance: float | None = None
) -> Regime:
    """The regime that a start leads to at the constant speed of a rig, in natural units; runs on until it can be told.

    Raises `Spent` if the budget does not allow for a first run. What cannot be told with what is left is undecided.
    """
    case = replace(at_speed(setting, setting.velocity, distance), method=method, start=start)
    budget.pay(case)
    run, seen = until_judged(case, budget)
    if seen.kind in OSCILLATES and by_theory(setting) == "stable":
        _, seen, _ = about_stable_sliding(run, seen, budget)
    return seen


def about_stable_sliding(
    run: Recording, seen: Regime, budget: Budget, kinds: tuple[str, ...] = OSCILLATES
) -> tuple[Recording, Regime, Literal["stays", "leaves", "noise"]]:
    """What a linearly stable rig does that does not look smooth from rest, and whether smooth sliding stays.

    An oscillation is sustained only if it outlasts the slowest mode. A rig that does the same from rest and from
    sliding is in its steady state: noise of its contacts has four times the variance with a quarter of them, or else
    they leave smooth sliding. Where the run from sliding fluctuates less, smooth sliding, once reached, stays.
    """
    try:
        run, seen = _outlasting(run, seen, budget)
        state = "stays" if seen.kind not in kinds else _steady_state(run, seen, budget)
    except Spent:
        reason = "an oscillation, or noise of its contacts: longer runs would tell"
        return run, replace(seen, kind="undecided", reason=reason), "stays"
    if state == "noise":
        count, rms = getattr(run.rig.method, "count", 0), 100 * rms_over_mean(run, seen)
        reason = (
            f"the force fluctuates by {rms:.2g} % rms, noise of {count} contacts: as much from sliding as from rest, "
            "and more with a quarter as many"
        )
        seen = replace(seen, kind="smooth sliding", reason=reason)
    return run, seen, state


def _steady_state(run: Recording, seen: Regime, budget: Budget) -> Literal["stays", "leaves", "noise"]:
    """What runs from smooth sliding tell; raises `Spent` if they cost too much, or do not tell."""
    case, method, begin = run.rig, contacts_of(run.rig), seen.window[0]
    sliding = replace(case, start=FromSliding(), method=others(method, 1))
    budget.pay(sliding)
    (from_rest, error), (from_sliding, other) = _variance(run, begin), _variance(record(sliding, long=True), begin)
    # Noise that a mode amplifies stays as it is for as long as the mode takes to decay: few values of a variance.
    judged = case.drive.duration * (1.0 - begin / seen.window[1])
    few = math.sqrt(2.0 * until_decayed(case.natural) / (_DECAYS * case.natural.velocity * judged))
    if from_rest - from_sliding > max(math.log(2.0), 3.0 * max(math.hypot(error, other), few)):
        return "stays"
    if from_rest - from_sliding > math.log(2.0):
        raise Spent
    fewer = replace(sliding, method=replace(others(method, 2), count=max(method.count // 4, 1)))
    budget.pay(fewer)
    risen = _variance(record(fewer, long=True), begin)[0] - 0.5 * (from_rest + from_sliding)
    return "noise" if risen > math.log(2.0) else "leaves"  # twice the variance lies between as much and four times


def _outlasting(run: Recording, seen: Regime, budget: Budget) -> tuple[Recording, Regime]:
    """A run of an oscillation about stable smooth sliding, made longer until that has lasted or decayed.

    It lasts if it does not become weaker any more, after the slowest mode has had time to decay.
    """
    setting = run.rig.natural
    needed = until_decayed(setting) / setting.velocity
    for _ in range(_MOST_RUNS):
        if seen.kind not in OSCILLATES or (run.rig.drive.duration >= needed and _is_steady(run, seen)):
            return run, seen
        case = _longer(run.rig, needed)
        budget.pay(case)
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


def slides_smoothly(setting: Rig, method: Contacts, budget: Budget, start: Start) -> bool:
    """Whether `SEEDS` runs of other contacts all slide smoothly, one of them until the slowest mode decays."""
    usual = length_of(setting)
    long = max(until_decayed(setting), 2.0 * usual)
    distances = [usual, long, *[usual] * (SEEDS - 2)]  # what does not slide is most often told by the first, short one
    try:
        for other, distance in enumerate(distances, start=1):
            seen = judge(setting, others(method, other), budget, start=start, distance=distance)
            # So few contacts that slips are no larger than their noise: how fast the slider goes tells them apart.
            fast = seen.largest_velocity is not None and seen.largest_velocity > _NO_NOISE
            if fast or seen.kind != "smooth sliding":
                return False
    except InputError:  # such a rig cannot be simulated
        return False
    return True


def first_smooth(smooth: Callable[[float], bool], begin: float, end: float, rough: float) -> float | None:
    """A value between two ends down to `PRECISION` below which it slides smoothly, the nearest one within `PRECISION`.

    Steps double from the beginning on; the end itself is the last that is tried. It does not slide smoothly at `rough`,
    before the beginning. None if there is no such value.
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

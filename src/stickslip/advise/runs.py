"""Runs that judge a rig: how long they last, with which contacts, how many of them, and what they may cost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Literal

import numpy as np

from stickslip.cycles.verdict import linearly_unstable
from stickslip.errors import InputError, UndecidedError
from stickslip.measure import Regime, regime
from stickslip.model import Contacts, FromRest, FromSliding, MasterEquation, Population
from stickslip.model.drive import Drive, constant
from stickslip.model.methods import DRAWN
from stickslip.model.rig import Rig
from stickslip.simulation import Recording, estimate, record
from stickslip.simulation.work import course_of
from stickslip.stability import growth_rate

OSCILLATES = ("stick-slip", "sustained oscillation")
# A run lasts a dozen cycles of the slowest oscillation that the rig can have, at least this far in mean thresholds, and
# until the free slider has rung out, in units of 1/eta.
_CYCLES, _SHORTEST, _RINGING = 12.0, 60.0, 10.0
_DECAYS, _LONGEST = 6.0, 4.0  # a last test: so many times 1/decay rate, but not more than so many runs
_MOST_RUNS = 4  # how often a run that cannot be judged is made, each time at least twice as long
_PARTS = 10  # of a run, over which the error of a variance is told
_TWICE = math.log(2.0)  # between as much variance and four times as much
# Runs of other contacts that must all slide smoothly: then, at 95 % confidence, two of three of all runs do.
SEEDS = math.ceil(math.log(1.0 - 0.95) / math.log(2.0 / 3.0))
_USUAL, _MOST_AGED = Contacts(10_000, seed=1), 2_000
_COUNTED = 100_000  # contacts from which on they are counted by cohorts, where that is cheaper than to follow each ...
_ROUGH = 1e-3  # ... or are infinitely many, to an error below their noise: 1/sqrt(N)

# What linearly stable smooth sliding does: it stays, noise of the contacts leaves it, or noise is all that is seen.
Steady = Literal["stays", "leaves", "noise"]


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
    """Travel of the drive in which the slowest mode decays, within reason; 0 if it grows."""
    longest = _LONGEST * length_of(rig)
    try:
        rate = growth_rate(rig.natural).real
    except (InputError, UndecidedError):  # with heavy tails there is no slowest mode: what decays may take long
        return longest
    return min(rig.natural.velocity * _DECAYS / -rate, longest) if rate < 0 else 0.0


def method_of(rig: Rig, other: int = 0, part: int = 1) -> Contacts | Population | MasterEquation:
    """The contacts that judge a rig, or others of their kind, or a part of so many: its own, as their noise is.

    Many are counted by cohorts, or taken as infinitely many, where that can be done at less cost than to follow each.
    """
    own = rig.method if isinstance(rig.method, DRAWN) else _USUAL
    count = own.count if rig.interface.ageing is None else min(own.count, _MOST_AGED)
    count, seed = max(count // part, 1), own.seed + other
    each = Contacts(count, seed=seed)
    if count < _COUNTED:
        return each
    for many in (Population(count, seed), MasterEquation(rtol=_ROUGH)):
        with suppress(InputError):
            if estimate(replace(rig, method=many)).seconds < estimate(replace(rig, method=each)).seconds:
                return many
    return each


def trial(rig: Rig, distance: float | None = None, other: int = 0) -> Rig:
    """A run from rest at the constant speed of a rig, for as long as it takes to judge it, or for a distance."""
    speed = rig.natural.velocity
    drive = constant(speed, (length_of(rig) if distance is None else distance) / speed)
    return replace(rig, drive=drive, method=method_of(rig, other), start=FromRest())


class Spent(Exception):  # noqa: N818 - not an error: it ends a search
    """The work that was allowed is done."""


class Trials:
    """Runs within what they may cost, in seconds by estimate, not by the clock: the same rig gets the same answer.

    What a run has cost is known better than before it: by how often its contacts have broken. The next one is taken to
    be like it.
    """

    def __init__(self, seconds: float) -> None:
        self.allowed, self.spent, self._part, self._known = seconds, 0.0, 1.0, dict[Rig, Regime]()

    def of(self, part: float) -> Trials:
        """Runs within a part of what is left, which know of those before; what they cost is to be added."""
        left = Trials(part * (self.allowed - self.spent))
        left._part, left._known = self._part, self._known
        return left

    def record(self, case: Rig) -> Recording:
        """Make a run; raise `Spent` if it would cost more than there is left."""
        work = estimate(case).seconds
        if self.spent + work * self._part > self.allowed:
            raise Spent
        run = record(case, long=True)
        self._part = _part_broken(run)
        self.spent += work * self._part
        return run

    def judge(self, case: Rig) -> Regime:
        """The regime that a run leads to; raises `Spent` if the work that is allowed ends before it is told."""
        if case not in self._known:
            self._known[case] = self.watch(self.record(case), spent=True)[1]
        return self._known[case]

    def slide_smoothly(self, rigs: Sequence[Rig], seeds: int) -> bool:
        """Whether so many runs of each rig, all of other contacts, slide smoothly at last.

        The second of each lasts until its slowest mode has decayed. What does not slide, the first tells most often.
        """
        try:
            for other in range(1, seeds + 1):
                for rig in rigs:
                    distance = max(until_decayed(rig), 2.0 * length_of(rig)) if other == 2 else None
                    if self.judge(trial(rig, distance, other)).kind != "smooth sliding":
                        return False
        except InputError:  # such a rig cannot be simulated
            return False
        return True

    def watch(self, run: Recording, most: int = _MOST_RUNS, *, spent: bool = False) -> tuple[Recording, Regime, Steady]:
        """What a run that ends at a constant speed shows, made longer until that can be told, or the work is `spent`.

        An oscillation of a linearly stable rig must outlast its slowest mode, and then be no noise of its contacts.
        """
        case, few, lasts = run.rig, isinstance(run.rig.method, DRAWN), 0.0
        for left in reversed(range(most)):
            seen = regime(run.dataset())
            doubtful = few and seen.kind in OSCILLATES and linearly_unstable(case) is False
            if seen.kind != "undecided" and not doubtful:
                return run, seen, "noise" if seen.is_noise else "stays"
            try:
                if doubtful:
                    lasts = until_decayed(case) / case.natural.velocity
                    if case.drive.duration >= lasts and _is_steady(run, seen):
                        return self._from_sliding(run, seen)
                case = _longer(case, lasts)
                if left > 0:
                    run = self.record(case)
            except Spent:
                if spent:
                    raise
                break
            except UndecidedError:
                break
        if seen.kind != "undecided":
            reason = "an oscillation, or noise of its contacts: longer runs would decide"
            seen = replace(seen, kind="undecided", reason=reason)
        return run, seen, "stays"

    def _from_sliding(self, run: Recording, seen: Regime) -> tuple[Recording, Regime, Steady]:
        """Judge by runs from smooth sliding whether an oscillation persists; raises `UndecidedError` if they cannot.

        Where they fluctuate less than from rest, smooth sliding is stable once reached. Else they leave it, or it is
        noise of the contacts, which has four times the variance with a quarter of them.
        """
        case, begin = run.rig, seen.window[0]

        def fluctuation(other: int, part: int = 1) -> tuple[float, float]:
            return _variance(
                self.record(replace(case, start=FromSliding(), method=method_of(case, other, part))), begin
            )

        (from_rest, error), (from_sliding, other_error) = _variance(run, begin), fluctuation(1)
        more = from_rest - from_sliding
        # Noise that a mode amplifies stays as it is for as long as the mode takes to decay: few values of a variance.
        judged = case.drive.duration * (1.0 - begin / seen.window[1])
        few = math.sqrt(2.0 * until_decayed(case) / (_DECAYS * case.natural.velocity * judged))
        if more > max(_TWICE, 3.0 * max(math.hypot(error, other_error), few)):
            return run, seen, "stays"
        if more > _TWICE:
            raise UndecidedError("more of it from rest than from sliding, but not by three standard errors")
        if fluctuation(2, part=4)[0] - 0.5 * (from_rest + from_sliding) > _TWICE:
            reason = "noise of the contacts: as much from sliding as from rest, and more with a quarter as many"
            return run, replace(seen, kind="smooth sliding", reason=reason), "noise"
        return run, seen, "leaves"


def _longer(case: Rig, lasts: float) -> Rig:
    """The run, of no more contacts than judge it, its last piece longer: it takes twice the time, at least `lasts`."""
    *before, last = case.drive.pieces
    lasts = max(2.0 * case.drive.duration, lasts) - (case.drive.duration - last.duration)
    method = method_of(case) if isinstance(case.method, DRAWN) else case.method
    return replace(case, drive=Drive((*before, replace(last, duration=lasts))), method=method)


def _part_broken(run: Recording) -> float:
    """How often contacts have broken in a run, over how often they would in smooth sliding, by the energy they lost.

    In stick-slip from a soft spring it is a hundredth: contacts hold once a cycle, not once in the way that they take.
    """
    if "broken_energy" not in run.track.columns or run.rig.interface.temperature is not None:
        return 1.0
    each = 0.5 * run.rig.interface.threshold_distribution.moment(2)
    return float(min(run.track["broken_energy"][-1] / each / course_of(run.rig.natural).lifetimes, 1.0))


def _is_steady(run: Recording, seen: Regime) -> bool:
    """Whether the force varies no less in what is judged than for as long before it, within three standard errors."""
    begin, end = seen.window
    before, after = _variance(run, begin - (end - begin), begin), _variance(run, begin, end)
    return before[0] - after[0] < 3.0 * math.hypot(before[1], after[1])


def _variance(run: Recording, begin: float, end: float = math.inf) -> tuple[float, float]:
    """Logarithm of the variance of the force between two times, with its standard error over parts of the run."""
    force = run.dataset()["spring_force"].sel(time=slice(begin, end)).to_numpy()
    squares = (force - force.mean()) ** 2
    parts = np.array([part.mean() for part in np.array_split(squares, _PARTS)])
    mean = max(float(parts.mean()), 1e-300)
    return math.log(mean), float(parts.std(ddof=1)) / mean / math.sqrt(_PARTS)

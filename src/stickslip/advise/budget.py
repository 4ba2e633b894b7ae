"""Runs that decide what a rig does: how long they last, with which contacts, and how
many of them a search may make.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from itertools import product
from typing import Any, TypeVar

from stickslip.cycles.oscillation_verdict import linearly_unstable
from stickslip.errors import InputError, UndecidedError
from stickslip.loops import HALVINGS, bounded
from stickslip.measure import Regime
from stickslip.measure.features import CHANGE, NOISE_OF_CONTACTS, REPEATS, TINY
from stickslip.measure.regimes import regime_of_run
from stickslip.measure.trace import ERRORS, Trace
from stickslip.model import Contacts, OnArrest, Slider
from stickslip.model.drive import constant
from stickslip.model.methods import DRAWN
from stickslip.model.rig import Rig
from stickslip.model.structure import Structure
from stickslip.simulation import Recording, estimate, record
from stickslip.simulation.engines.start import lifetimes_in
from stickslip.simulation.estimates import Course
from stickslip.sliding.response import STEP
from stickslip.stability import contact_noise, growth_rate
from stickslip.stability.modes import smooth_sliding
from stickslip.stability.scan import doubtful_below
from stickslip.structures.runs import longest_step

Answer = TypeVar("Answer")
OSCILLATES = ("stick-slip", "sustained oscillation")
# A run lasts a dozen cycles of the slowest oscillation that the rig can have, at least
# this far in mean thresholds, and until the free slider has rung out, in units of
# 1/eta, if that takes no more cycles than `_RINGS`.
_CYCLES = 12.0
_SHORTEST = 60.0
_RINGING = 10.0
_RINGS = 60.0
# a last test: so many times 1/decay rate, but not more than so many runs
_DECAYS = 6.0
_PATIENCE = 4.0
_LONGEST = 8.0  # runs: what stays undecided is made twice as long, up to that
# Runs of other contacts that must all slide smoothly: then, at 95 % confidence, two of
# three of all runs do.
SEEDS = math.ceil(math.log(1.0 - 0.95) / math.log(2.0 / 3.0))
# Velocity off the drive's (rms), over it, up to which runs fluctuate as linear theory
# gives near a limit: within a fifth. Beyond, by as little as a third of that.
SWAYS = 0.2
# contacts: noise of more is below what a regime takes for nothing
_UNSEEN = math.ceil((ERRORS * NOISE_OF_CONTACTS / TINY) ** 2)
# Seconds that count as one run, as an estimate counts them from its work, by
# `is_expensive`: of most that is twice what it takes.
_SECONDS = {False: 0.15, True: 0.05}
# looks at linear theory that do, by `is_expensive`: an integral over all ages; also
# those at contacts of which that is known
_LOOKS = {False: 10.0, True: 1.0}
# terms of sums that follow the response of contacts, of which a look takes as many
_TERMS = 1.6e6
_WAVES = 1 << 15  # frequencies of a scan, without ageing or temperature
# steps of a structure that last as long as one run, and lives of its contacts
_STEPS = 4e5
_LIVES_IN_STEPS = 1e6
_LEAST = 0.5  # what the shortest run counts, as its regime is to be found
# contacts that are few: where one run of them decides little, by convention
_FEW = 300


def cycle_of(rig: Rig) -> float:
    """Travel of the drive in the slowest cycle of a rig: a life of a contact and the
    loading, or a free oscillation.
    """
    slider = _slowest(rig)
    velocity = rig.natural.velocity
    stretch = rig.interface.threshold_distribution.moment(1)
    period = 2.0 * math.pi / slider.frequency if slider.mass > 0 else 0.0
    delay = rig.interface.delay.moment(1)
    detached = velocity * delay if math.isfinite(delay) else 0.0
    return float(
        max(stretch * (1.0 + 1.0 / slider.stiffness) + detached, velocity * period)
    )


def _slowest(rig: Rig) -> Slider:
    """The slider, or the slowest motion of a structure."""
    found: Slider = getattr(rig.slider, "slowest", rig.slider)
    return found


def length_of(rig: Rig) -> float:
    """Travel of the drive after which the regime of a run can be decided."""
    damping = _slowest(rig).damping
    cycle = cycle_of(rig)
    ringing = rig.natural.velocity * _RINGING / damping if damping > 0 else 0.0
    return max(
        _SHORTEST * rig.interface.threshold_distribution.moment(1),
        _CYCLES * cycle,
        min(ringing, _RINGS * cycle),
    )


def until_decayed(rig: Rig) -> float:
    """Travel of the drive in which the slowest mode decays; 0 if it grows, NaN where
    none decays exponentially.
    """
    try:
        rate = growth_rate(rig.natural).real
    except (InputError, UndecidedError):  # with heavy tails there is no slowest mode
        return math.nan
    return rig.natural.velocity * _DECAYS / -rate if rate < 0 else 0.0


def method_of(rig: Rig, other: int = 0) -> Contacts:
    """The contacts that decide what a rig does, or others of their kind: its own, up
    to a number whose noise is not seen.
    """
    own = rig.method if isinstance(rig.method, DRAWN) else Contacts(10_000, seed=1)
    return Contacts(min(own.count, _UNSEEN), seed=own.seed + other)


def trial(rig: Rig, distance: float = 0.0, other: int = 0) -> Rig:
    """A run from rest at the constant speed of a rig, for as long as it takes to
    judge it, at least for a distance.
    """
    # the same, however it came about: less friction is a higher speed
    speed = float(f"{rig.natural.velocity:.12g}")
    there = Rig(
        rig.interface, rig.slider, constant(speed), method=method_of(rig, other)
    )
    return replace(
        there, drive=constant(speed, max(length_of(there), distance) / speed)
    )


def survives_noise(rig: Rig, most: float = 1.0) -> bool:
    """Whether smooth sliding that is linearly stable stays, with the noise of the
    contacts: whether that moves the velocity by less than a part of it, rms.
    """
    if not isinstance(rig.method, DRAWN):
        return True
    try:
        return rig.method.count >= contact_noise(rig, contacts=1).contacts_for(
            most, of="velocity"
        )
    except (InputError, UndecidedError):  # no theory of their noise
        return True


def is_expensive(rig: Rig) -> bool:
    """Whether contacts age, or heat breaks them: a run, or a look at linear theory,
    then takes some thirty times as long.
    """
    return rig.interface.ageing is not None or rig.interface.activation is not None


def varies(rig: Rig) -> bool:
    """Whether one run decides little: contacts are few, or wait for an arrest that may
    not come.
    """
    count = getattr(rig.method, "count", math.inf)
    return count < _FEW or isinstance(rig.interface.delay, OnArrest)


def runs_of(rig: Rig) -> float:
    """Number of usual runs as which a run counts, by the work that it takes."""
    if isinstance(rig.natural.slider, Structure):
        lives = float(lifetimes_in(rig.natural, Course(0.0))[0])
        contacts = rig.method.count if isinstance(rig.method, DRAWN) else _UNSEEN
        steps = rig.natural.drive.duration / longest_step(rig.natural.slider)
        return max(contacts * lives / _LIVES_IN_STEPS + steps / _STEPS, _LEAST)
    seconds = 0.0
    with suppress(InputError):  # it cannot be simulated, which takes no time
        seconds = estimate(rig).reference_seconds
    return max(seconds / _SECONDS[is_expensive(rig)], _LEAST)


def looks_of(rig: Rig) -> float:
    """Number of usual looks at linear theory as which one counts, by the terms of its
    sums, or the frequencies of a scan.
    """
    try:
        sliding = smooth_sliding(rig)
        if sliding.response.inert:
            return 1.0
        if not sliding.response.certain:
            return max(sliding.response.terms(sliding.velocity) / _TERMS, 1.0)
        waves = doubtful_below(sliding, None) * sliding.scales.memory / STEP
        return max(waves / _WAVES, 1.0)
    except (InputError, UndecidedError):  # there is no theory
        return 1.0


class BudgetExhausted(Exception):  # noqa: N818 - not an error: it ends a search
    """The search has used up the number of runs that it was given."""


class Budget:
    """Number of runs that a search may make, looks at linear theory among them.

    Counts, no times: the same rig gets the same answer on any machine. No question is
    asked twice.
    """

    def __init__(self, runs: float) -> None:
        self.allowed = runs
        self.spent = 0.0
        self._known = dict[Any, Any]()

    @contextmanager
    def limited_to(self, fraction: float) -> Iterator[None]:
        """Allow no more than a fraction of what is left."""
        allowed = self.allowed
        self.allowed = self.spent + fraction * (allowed - self.spent)
        try:
            yield
        finally:
            self.allowed = allowed

    def spend(self, runs: float) -> None:
        """Use up a number of runs; raise `BudgetExhausted` if fewer are left."""
        if self.spent + runs > self.allowed:
            raise BudgetExhausted
        self.spent += runs

    def theory(
        self, ask: Callable[..., Answer], rig: Rig, *given: Any, more: float = 0.0
    ) -> Answer:
        """Ask linear theory about a rig, at the cost of a look at the response of its
        contacts, once where that is expensive, and of a number of looks more.
        """
        contacts = rig.interface, rig.natural.velocity
        key = ask, *contacts, rig.slider, given
        if key not in self._known:
            dear = is_expensive(rig)
            known = not dear or contacts in self._known
            look = 1.0 / _LOOKS[False] if known else looks_of(rig) / _LOOKS[dear]
            self.spend(look + more / _LOOKS[dear])
            self._known[contacts] = True
            self._known[key] = ask(rig, *given)
        found: Answer = self._known[key]
        return found

    def record(self, rig: Rig) -> Recording:
        """Make a run."""
        self.spend(runs_of(rig))
        return record(rig, estimated=False)

    def longer(self, run: Recording, times: float) -> Recording:
        """Make a run so many times as long, of the contacts that decide its regime."""
        rig = replace(run.rig, method=method_of(run.rig))
        if rig.method == run.rig.method:
            self.spend((times - 1.0) * runs_of(rig))
            return run.longer(times * rig.drive.duration)
        return self.record(rig)

    def regime(self, rig: Rig) -> Regime:
        """Regime of a run that is made longer until it is decided, or `_LONGEST`.

        Raises `BudgetExhausted` if the budget ends before.
        """
        if rig not in self._known:
            *_, (_, self._known[rig]) = self.looks(self.record(rig), _LONGEST)
        found: Regime = self._known[rig]
        return found

    def slide_smoothly(self, rigs: Sequence[Rig], others: Iterable[int]) -> bool:
        """Whether the runs of each rig with other contacts, by their number from 1 on,
        slide smoothly at last.

        The first shows most often what does not slide. What comes after it lasts as
        long as that took to decide, the second until its slowest mode has decayed.
        """
        try:
            for other, rig in product(others, rigs):
                lasts = 0.0
                if other > 1:
                    first = self.regime(trial(rig, other=1))
                    lasts = first.window[1] * rig.natural.velocity
                if other == 2:
                    length = length_of(rig)
                    until = max(self.theory(until_decayed, rig), 2.0 * length)
                    lasts = max(lasts, min(_PATIENCE * length, until))
                if self.regime(trial(rig, lasts, other)).kind != "smooth sliding":
                    return False
        except InputError:  # such a rig cannot be simulated
            return False
        return True

    def looks(
        self, run: Recording, longest: float = math.inf
    ) -> Iterator[tuple[Recording, Regime]]:
        """Make a run that ends at a constant speed longer until its regime is decided:
        the run and its regime, each time, of which the last is final.

        No run is longer than `longest` times `length_of`. Raises `BudgetExhausted` if
        the budget ends before.
        """
        turns = bounded("Budget.looks", HALVINGS)
        while True:
            next(turns)
            seen = regime_of_run(run)
            yield run, _doubtful(seen)
            travel = run.rig.drive.duration * run.rig.natural.velocity
            kept, lasts = self._compared_with_theory(run, seen, travel)
            if kept.kind != "undecided" and travel >= lasts:
                yield run, kept
                return
            if travel > 0.9 * longest * length_of(run.rig):
                return
            run = self.longer(run, max(2.0, lasts / travel))

    def _compared_with_theory(
        self, run: Recording, seen: Regime, travel: float
    ) -> tuple[Regime, float]:
        """Regime of a run in the light of linear theory, and the travel for which it
        must last.

        An oscillation of a linearly stable rig must outlast its slowest mode; what does
        not slip must be seen not to decay as that does, and what decays to do so as
        fast: else it may decay to a smaller oscillation that lasts.
        """
        case = run.rig
        if seen.is_noise and not self._covered(case) and not self._fades(run, seen):
            return _doubtful(seen), 0.0
        tests = {test.name: test for test in seen.table}
        decays = _is_smooth_by_decay(seen)
        unstable = self.theory(linearly_unstable, case)
        if decays and unstable:
            return _doubtful(seen), 0.0
        if unstable is not False or not (decays or seen.kind in OSCILLATES):
            return seen, 0.0
        until = self.theory(until_decayed, case)
        lasts = min(_PATIENCE * length_of(case), until)
        noise = replace(
            seen,
            kind="smooth sliding",
            reason="irregular slips, no more than the noise of the contacts makes",
        )
        repeats = REPEATS in tests and tests[REPEATS].passed
        irregular = noise.is_noise and not repeats
        if irregular and (self._covered(case) or self._fades(run, seen)):
            return noise, lasts
        slips = seen.kind == "stick-slip"
        if not slips and CHANGE in tests and until and survives_noise(case):
            half = 0.5 * (1.0 - seen.window[0] / seen.window[1])
            # change of the amplitude beyond that of the slowest mode in half a window
            beyond = math.log(seen.trend) + _DECAYS * half * travel / until
            if decays is (beyond > ERRORS * tests[CHANGE].error):
                return _doubtful(seen), lasts
        return seen, lasts

    def _covered(self, rig: Rig) -> bool:
        """Whether linear theory covers the noise of the contacts of a rig."""
        count = getattr(rig.method, "count", 0)
        key = "covered", rig.interface, rig.slider, rig.natural.velocity, count
        if key not in self._known:
            self._known[key] = survives_noise(rig, SWAYS)
        found: bool = self._known[key]
        return found

    def _fades(self, run: Recording, seen: Regime) -> bool:
        """Whether the force of four times as many contacts fluctuates half as much, as
        noise does, or as much.

        It decides where the velocity fluctuates by more than the linear theory of noise
        covers. Of a run that is made longer, or with other contacts, they are asked
        once.
        """
        rig = run.rig
        assert isinstance(rig.method, DRAWN)
        drive = constant(rig.natural.velocity)
        key = "fades", replace(rig, drive=drive, method=replace(rig.method, seed=0))
        if key not in self._known:
            method = replace(rig.method, count=4 * rig.method.count)
            many = fluctuation(self.record(replace(rig, method=method)), seen)
            self._known[key] = many
        noise: float = self._known[key]
        return noise < math.sqrt(0.5) * fluctuation(run, seen)


def _doubtful(seen: Regime) -> Regime:
    """A regime as undecided, if only because the oscillation may still decay."""
    reason = "the oscillation may still decay: longer runs would decide"
    if seen.kind == "undecided":
        reason = seen.reason
    return replace(seen, kind="undecided", reason=reason)


def _is_smooth_by_decay(seen: Regime) -> bool:
    """Whether sliding counts as smooth because an oscillation that is seen decays."""
    error = next((test.error for test in seen.table if test.name == CHANGE), math.nan)
    swings = seen.peak_to_peak >= TINY * seen.static_friction
    smooth = seen.kind == "smooth sliding" and swings and not seen.is_noise
    return smooth and math.log(seen.trend) < -ERRORS * error


def fluctuation(run: Recording, seen: Regime) -> float:
    """Standard deviation of the spring force over its mean, in the window of a
    regime and after it.
    """
    late = Trace.of_run(run).part(seen.window[0]).force
    return float(late.std() / abs(late.mean()))

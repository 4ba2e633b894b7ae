"""The runs that decide the motion of a rig: their length, their contacts, and how many
of them a search may make.
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
# A run lasts for `_CYCLES` of the slowest oscillation of the rig, for at least
# `_SHORTEST` mean thresholds of travel, and until the free slider has rung down, which
# takes `_RINGING`/eta, but at most `_RINGS` cycles.
_CYCLES = 12.0
_SHORTEST = 60.0
_RINGING = 10.0
_RINGS = 60.0
# The last run lasts until the slowest mode has decayed, for `_DECAYS` over its decay
# rate, but at most `_PATIENCE` times as long as a usual run.
_DECAYS = 6.0
_PATIENCE = 4.0
# An undecided run is doubled in length up to this many usual lengths.
_LONGEST = 8.0
# Number of runs with other contacts that must all slide smoothly: then, at 95 %
# confidence, at least two thirds of all such runs do.
SEEDS = math.ceil(math.log(1.0 - 0.95) / math.log(2.0 / 3.0))
# Relative rms deviation from the drive velocity up to which the fluctuations of runs
# near a stability limit agree with linear theory, within a fifth. Beyond it, they may
# be a third of what the theory predicts.
LINEAR_NOISE = 0.2
# number of contacts above which the noise of their force is not seen in a regime
_UNSEEN = math.ceil((ERRORS * NOISE_OF_CONTACTS / TINY) ** 2)
# Estimated seconds of work that count as one run, by `is_expensive`. Most runs take
# half of their estimate.
_SECONDS = {False: 0.15, True: 0.05}
# Number of evaluations of linear theory that count as one run, by `is_expensive`: an
# expensive one integrates over all ages. Evaluations for contacts whose response is
# already known count as cheap.
_EVALUATIONS = {False: 10.0, True: 1.0}
# number of terms, in sums over the response of contacts, of a usual evaluation
_TERMS = 1.6e6
_WAVES = 1 << 15  # number of frequencies of a usual scan, without ageing or temperature
# steps of a structure, and lifetimes of its contacts, that take as long as one run
_STEPS = 4e5
_LIVES_IN_STEPS = 1e6
_LEAST = 0.5  # cost of the shortest run, whose regime must still be found
# With fewer contacts than this, one run decides little; a convention.
_FEW = 300


def cycle_of(rig: Rig) -> float:
    """Return the travel of the drive in the slowest cycle of a rig: that of loading and
    detachment of a contact, or of a free oscillation, whichever is longer.
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
    """Return the slider, or that of the slowest mode of a structure."""
    found: Slider = getattr(rig.slider, "slowest", rig.slider)
    return found


def length_of(rig: Rig) -> float:
    """Return the travel of the drive after which the regime of a run can be decided."""
    damping = _slowest(rig).damping
    cycle = cycle_of(rig)
    ringing = rig.natural.velocity * _RINGING / damping if damping > 0 else 0.0
    return max(
        _SHORTEST * rig.interface.threshold_distribution.moment(1),
        _CYCLES * cycle,
        min(ringing, _RINGS * cycle),
    )


def until_decayed(rig: Rig) -> float:
    """Return the travel of the drive in which the slowest mode decays; 0 if it grows,
    NaN if no mode decays exponentially.
    """
    try:
        rate = growth_rate(rig.natural).real
    except (InputError, UndecidedError):  # with heavy tails there is no slowest mode
        return math.nan
    return rig.natural.velocity * _DECAYS / -rate if rate < 0 else 0.0


def method_of(rig: Rig, other: int = 0, most: float = _UNSEEN) -> Contacts:
    """Return the method of the runs that decide the motion of a rig: its own contacts,
    or with `other` > 0 differently drawn ones; by default no more than a number whose
    noise is not seen in the force.
    """
    own = rig.method if isinstance(rig.method, DRAWN) else Contacts(10_000, seed=1)
    return Contacts(int(min(own.count, most)), seed=own.seed + other)


def trial(
    rig: Rig, distance: float = 0.0, other: int = 0, most: float = _UNSEEN
) -> Rig:
    """Return the rig for a run from rest at its constant speed, long enough to decide
    the regime, and at least for a distance; `other` and `most` as in `method_of`.
    """
    # rounded, so that equal rigs compare equal however they were computed
    speed = float(f"{rig.natural.velocity:.12g}")
    method = method_of(rig, other, most)
    there = Rig(rig.interface, rig.slider, constant(speed), method=method)
    return replace(
        there, drive=constant(speed, max(length_of(there), distance) / speed)
    )


def survives_noise(rig: Rig, most: float = 1.0) -> bool:
    """Whether linearly stable smooth sliding survives the noise of the contacts: the
    velocity then fluctuates by less than the fraction `most` of it, rms.
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
    """Whether contacts age, or heat breaks them: a run, or an evaluation of linear
    theory, then takes some thirty times as long.
    """
    return rig.interface.ageing is not None or rig.interface.activation is not None


def varies(rig: Rig) -> bool:
    """Whether one run decides little: the contacts are few, or their noise ends smooth
    sliding, or they re-attach only at an arrest, which may not come.
    """
    count = getattr(rig.method, "count", math.inf)
    waits = isinstance(rig.interface.delay, OnArrest)
    return count < _FEW or waits or not survives_noise(rig)


def cost_of_run(rig: Rig) -> float:
    """Return the cost of a run in usual runs, from its estimated work."""
    if isinstance(rig.natural.slider, Structure):
        lives = float(lifetimes_in(rig.natural, Course(0.0))[0])
        contacts = rig.method.count if isinstance(rig.method, DRAWN) else _UNSEEN
        steps = rig.natural.drive.duration / longest_step(rig.natural.slider)
        return max(contacts * lives / _LIVES_IN_STEPS + steps / _STEPS, _LEAST)
    seconds = 0.0
    with suppress(InputError):  # a rig that cannot be simulated costs nothing
        seconds = estimate(rig).reference_seconds
    return max(seconds / _SECONDS[is_expensive(rig)], _LEAST)


def cost_of_theory(rig: Rig) -> float:
    """Return the cost of an evaluation of linear theory in usual ones, from the number
    of terms of its sums, or of frequencies of its scan.
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
    """The number of runs that a search may make, which evaluations of linear theory
    also use up.

    It counts runs rather than time, so that a rig gets the same answer on any machine.
    Results are cached.
    """

    def __init__(self, runs: float) -> None:
        self.allowed = runs
        self.spent = 0.0
        self._known = dict[Any, Any]()

    @contextmanager
    def limited_to(self, fraction: float) -> Iterator[None]:
        """Allow, within a `with` block, only a fraction of what is left."""
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
        """Return a result of linear theory for a rig, at the cost of one evaluation and
        `more`; an expensive response of the contacts is paid for only once.
        """
        contacts = rig.interface, rig.natural.velocity
        key = ask, *contacts, rig.slider, given
        if key not in self._known:
            per_run = _EVALUATIONS[is_expensive(rig)]
            first = 1.0 / _EVALUATIONS[False]
            if is_expensive(rig) and contacts not in self._known:
                first = cost_of_theory(rig) / per_run
            self.spend(first + more / per_run)
            self._known[contacts] = True
            self._known[key] = ask(rig, *given)
        found: Answer = self._known[key]
        return found

    def record(self, rig: Rig) -> Recording:
        """Simulate a rig, at the cost of its run."""
        self.spend(cost_of_run(rig))
        return record(rig, estimated=False)

    def longer(self, run: Recording, times: float) -> Recording:
        """Return a run that is `times` as long, with the contacts that decide its
        regime.
        """
        rig = replace(run.rig, method=method_of(run.rig))
        if rig.method == run.rig.method:
            self.spend((times - 1.0) * cost_of_run(rig))
            return run.longer(times * rig.drive.duration)
        return self.record(rig)

    def regime(self, rig: Rig) -> Regime:
        """Return the regime of a run, which is made longer, up to `_LONGEST`, until the
        regime is decided.

        Raises `BudgetExhausted` if the budget does not suffice.
        """
        if rig not in self._known:
            *_, (_, self._known[rig]) = self.until_decided(self.record(rig), _LONGEST)
        found: Regime = self._known[rig]
        return found

    def slide_smoothly(self, rigs: Sequence[Rig], others: Iterable[int]) -> bool:
        """Whether the runs of each rig with other contacts, `others` numbered from 1,
        end in smooth sliding.

        The first run finds most rigs that do not slide smoothly. The next ones last as
        long as it took to decide, the second also until its slowest mode has decayed.
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
        except InputError:  # the rig cannot be simulated
            return False
        return True

    def until_decided(
        self, run: Recording, longest: float = math.inf
    ) -> Iterator[tuple[Recording, Regime]]:
        """Make a run, which ends at a constant speed, longer until its regime is
        decided; yield the run and its regime each time, the last of which is final.

        No run is longer than `longest` times `length_of`. Raises `BudgetExhausted` if
        the budget does not suffice.
        """
        turns = bounded("Budget.until_decided", HALVINGS)
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
        """Return the regime of a run, corrected by linear theory, and the travel for
        which the run must last.

        If smooth sliding is linearly stable, an oscillation must outlast the slowest
        mode. One without slips must decay significantly more slowly than that mode, and
        one that counts as decaying must decay as fast as it: else it may decay to a
        smaller oscillation that persists.
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
        """Whether linear theory describes the noise of the contacts of a rig."""
        count = getattr(rig.method, "count", 0)
        key = "covered", rig.interface, rig.slider, rig.natural.velocity, count
        if key not in self._known:
            self._known[key] = survives_noise(rig, LINEAR_NOISE)
        found: bool = self._known[key]
        return found

    def _fades(self, run: Recording, seen: Regime) -> bool:
        """Whether the force of four times as many contacts fluctuates half as much, as
        noise does, rather than as much.

        It decides where the velocity fluctuates by more than the linear theory of noise
        allows. The run with more contacts is made once, also for runs that are longer
        or have differently drawn contacts.
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
    """Return a regime as undecided: by its own reason, or because the oscillation may
    still decay.
    """
    reason = "the oscillation may still decay: longer runs would decide"
    if seen.kind == "undecided":
        reason = seen.reason
    return replace(seen, kind="undecided", reason=reason)


def _is_smooth_by_decay(seen: Regime) -> bool:
    """Whether sliding counts as smooth because a visible oscillation decays."""
    error = next((test.error for test in seen.table if test.name == CHANGE), math.nan)
    swings = seen.peak_to_peak >= TINY * seen.static_friction
    smooth = seen.kind == "smooth sliding" and swings and not seen.is_noise
    return smooth and math.log(seen.trend) < -ERRORS * error


def fluctuation(run: Recording, seen: Regime) -> float:
    """Return the standard deviation of the spring force over its mean, from the start
    of the window of a regime on.
    """
    late = Trace.of_run(run).part(seen.window[0]).force
    return float(late.std() / abs(late.mean()))

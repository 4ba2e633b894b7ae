"""Runs that judge a rig: how long they last, with which contacts, how many of them, and what they may cost."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, TypeVar

from stickslip.cycles.verdict import linearly_unstable
from stickslip.errors import InputError, UndecidedError
from stickslip.measure import Regime, regime
from stickslip.measure.arrays import ERRORS
from stickslip.measure.evidence import NOISE_OF_CONTACTS, REPEATS, SMALL, TINY, noise_of
from stickslip.model import Contacts, FromRest
from stickslip.model.drive import Drive, constant
from stickslip.model.methods import DRAWN
from stickslip.model.rig import Rig
from stickslip.simulation import Recording, estimate, record
from stickslip.simulation.engines.beginnings import lifetimes_in
from stickslip.simulation.work import course_of
from stickslip.sliding import respond
from stickslip.sliding.response import Effort
from stickslip.stability import contact_noise, growth_rate

Answer = TypeVar("Answer")
OSCILLATES = ("stick-slip", "sustained oscillation")
# A run lasts a dozen cycles of the slowest oscillation that the rig can have, at least this far in mean thresholds, and
# until the free slider has rung out, in units of 1/eta.
_CYCLES, _SHORTEST, _RINGING = 12.0, 60.0, 10.0
_DECAYS, _PATIENCE = 6.0, 4.0  # a last test: so many times 1/decay rate, of what slips not more than so many runs
_LONGEST = 8.0  # runs: what cannot be judged is made twice as long, up to that
# Runs of other contacts that must all slide smoothly: then, at 95 % confidence, two of three of all runs do.
SEEDS = math.ceil(math.log(1.0 - 0.95) / math.log(2.0 / 3.0))
_USUAL = Contacts(10_000, seed=1)
# Independent contacts whose noise, three standard deviations of it, could just hide a small oscillation; and as many
# as slide as smoothly as more do: their noise is told from none no more.
_FEW, _UNSEEN = (math.ceil((ERRORS * NOISE_OF_CONTACTS / swing) ** 2) for swing in (SMALL, TINY))


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


def until_decayed(rig: Rig, patience: float = _PATIENCE) -> float:
    """Travel of the drive in which the slowest mode decays, at most so many runs; 0 if it grows."""
    try:
        rate = growth_rate(rig.natural).real
    except (InputError, UndecidedError):  # with heavy tails there is no slowest mode: what decays may take long
        return _PATIENCE * length_of(rig)
    return min(rig.natural.velocity * _DECAYS / -rate, patience * length_of(rig)) if rate < 0 else 0.0


def method_of(rig: Rig, other: int = 0) -> Contacts:
    """The contacts that judge a rig, or others of their kind: its own, as their noise is, as far as that is seen."""
    own = rig.method if isinstance(rig.method, DRAWN) else _USUAL
    return Contacts(min(own.count, _UNSEEN), seed=own.seed + other)


def trial(rig: Rig, distance: float = 0.0, other: int = 0) -> Rig:
    """A run from rest at the constant speed of a rig, for as long as it takes to judge it, at least for a distance."""
    speed = rig.natural.velocity
    drive = constant(speed, max(length_of(rig), distance) / speed)
    return replace(rig, drive=drive, method=method_of(rig, other), start=FromRest())


def stays(rig: Rig) -> bool:
    """Whether smooth sliding that is linearly stable stays, with the noise of the contacts."""
    try:
        return contact_noise(rig).linear
    except (InputError, UndecidedError):  # infinitely many, or no theory of their noise
        return True


def effort(rig: Rig) -> Effort:
    """What linear theory takes."""
    try:
        return respond(rig.interface).effort(rig.natural.velocity)
    except InputError:  # there is none
        return Effort(0.0, 0.0, 0.0)


class Spent(Exception):  # noqa: N818 - not an error: it ends a search
    """The work that was allowed is done."""


class Trials:
    """Runs, and looks at linear theory, within what they may cost.

    That is in seconds by estimate, not by the clock: the same rig gets the same answer. What a run has cost is known
    better than before it: by how often its contacts have broken. The next one is taken to be like it. No question is
    paid for twice.
    """

    def __init__(self, seconds: float) -> None:
        self.allowed, self.spent, self._part = seconds, 0.0, 1.0
        self.seen, self._known, self._tables = dict[Rig, Regime](), dict[Any, Any](), set[Any]()

    @contextmanager
    def within(self, part: float) -> Iterator[None]:
        """Allow no more than a part of what is left."""
        allowed, self.allowed = self.allowed, self.spent + part * (self.allowed - self.spent)
        try:
            yield
        finally:
            self.allowed = allowed

    def pay(self, seconds: float) -> None:
        """Count work; raise `Spent` if there is less left."""
        if self.spent + seconds > self.allowed:
            raise Spent
        self.spent += seconds

    def theory(self, ask: Callable[..., Answer], rig: Rig, *given: Any, looks: float = 0.0, roots: int = 0) -> Answer:
        """What linear theory says of a rig, asked once; it takes so many seconds in `looks`, and roots off the axis."""
        table = rig.interface, rig.natural.velocity
        if (key := (ask, rig.slider, table, given)) not in self._known:
            cost = effort(rig)
            self.pay(looks or (cost.again if table in self._tables else cost.look) + roots * cost.root)
            self._tables.add(table)
            self._known[key] = ask(rig, *given)
        found: Answer = self._known[key]
        return found

    def record(self, case: Rig) -> Recording:
        """Make a run; raise `Spent` if it would cost more than there is left."""
        if self.theory(linearly_unstable, case) is False:
            self.theory(noise_of, case, roots=1)  # as its regime will ask
        work = estimate(case).seconds
        self.pay(work * self._part)
        run, foreseen = record(case, long=True), self._part
        self._part = _part_broken(run)
        self.spent += work * (self._part - foreseen)
        return run

    def judge(self, case: Rig) -> Regime:
        """The regime that a run leads to; raises `Spent` if the work that is allowed ends before it is told.

        Stick-slip of few contacts, where that costs less, is that of more, too, unless their noise makes it.
        """
        if case not in self.seen:
            few, seen, paid = replace(case, method=replace(method_of(case), count=_FEW)), None, False
            cheaper = 2.0 * (estimate(few).seconds + effort(case).root) < estimate(case).seconds
            if cheaper and (self.theory(linearly_unstable, case) or self.theory(stays, few, roots=1)):
                _, seen, paid = self.watch(self.record(few), _PATIENCE)
            if seen is None or seen.kind != "stick-slip":
                _, seen, paid = self.watch(self.record(case), _LONGEST)
            if not paid:
                raise Spent
            self.seen[case] = seen
        return self.seen[case]

    def slide_smoothly(self, rigs: Sequence[Rig], seeds: int) -> bool:
        """Whether so many runs of each rig, all of other contacts, slide smoothly at last.

        The second of each lasts until its slowest mode has decayed, and others as long as the first had to. What does
        not slide, the first tells most often.
        """
        lasts = dict.fromkeys(rigs, 0.0)
        try:
            for other in range(1, seeds + 1):
                for rig in rigs:
                    slowest = max(self.theory(until_decayed, rig, roots=1), 2.0 * length_of(rig)) if other == 2 else 0.0
                    seen = self.judge(trial(rig, max(lasts[rig], slowest), other))
                    if seen.kind != "smooth sliding":
                        return False
                    if other == 1:
                        lasts[rig] = seen.window[1] * rig.velocity
        except InputError:  # such a rig cannot be simulated
            return False
        return True

    def watch(self, run: Recording, longest: float = math.inf) -> tuple[Recording, Regime, bool]:
        """What a run that ends at a constant speed shows, or a longer one that tells; False if that was too dear.

        None is longer than so many times the length that judges a rig. An oscillation of a linearly stable rig must
        outlast its slowest mode; what slips is none, and need not wait for one that hardly decays.
        """
        case, lasts, speed = run.rig, 0.0, run.rig.natural.velocity
        while True:
            seen = regime(run.dataset())
            reason = "the oscillation may still decay: longer runs would decide"
            doubtful = replace(seen, kind="undecided", reason=reason if seen.kind != "undecided" else seen.reason)
            try:
                if seen.kind in OSCILLATES and self.theory(linearly_unstable, case) is False:
                    repeats = any(test.passed for test in seen.table if test.name == REPEATS)
                    if not repeats and stays(case) and (noise := replace(seen, kind="smooth sliding")).is_noise:
                        seen = replace(noise, reason="irregular slips, no more than the noise of the contacts makes")
                    patience = _PATIENCE if seen.kind == "stick-slip" else math.inf
                    lasts = self.theory(until_decayed, case, patience, roots=1) / speed
                if seen.kind != "undecided" and case.drive.duration >= lasts:
                    return run, seen, True
                if case.drive.duration > 0.9 * (most := longest * length_of(case) / speed):
                    return run, doubtful, True
                *before, last = case.drive.pieces  # of the contacts that judge it, its last piece longer
                more = last.duration + max(case.drive.duration, min(lasts, most) - case.drive.duration)
                drive = Drive((*before, replace(last, duration=more)))
                case = replace(case, drive=drive, method=method_of(case))
                run = self.record(case)
            except Spent:
                return run, doubtful, False


def _part_broken(run: Recording) -> float:
    """How often contacts have broken in a run, over how often they would in smooth sliding, by the energy they lost.

    In stick-slip from a soft spring it is a hundredth: contacts hold once a cycle, not once in the way that they take.
    """
    if "broken_energy" not in run.track.columns or run.rig.interface.mechanisms & {"ageing", "temperature"}:
        return 1.0
    rig, each = run.rig.natural, 0.5 * run.rig.interface.threshold_distribution.moment(2)
    return float(min(run.track["broken_energy"][-1] / each / lifetimes_in(rig, course_of(rig))[0], 1.0))

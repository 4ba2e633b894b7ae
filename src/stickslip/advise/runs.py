"""Runs that judge a rig: how long they last, with which contacts, how many of them,
and what they may cost.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import product
from typing import Any, TypeVar

import numpy as np

from stickslip.cycles.verdict import linearly_unstable
from stickslip.errors import InputError, UndecidedError
from stickslip.measure import Regime, regime
from stickslip.measure.features import CHANGE, NOISE_OF_CONTACTS, REPEATS, STEADY, TINY
from stickslip.measure.trace import ERRORS
from stickslip.model import Contacts, Langevin
from stickslip.model.drive import constant
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
# A run lasts a dozen cycles of the slowest oscillation that the rig can have, at least
# this far in mean thresholds, and until the free slider has rung out, in units of
# 1/eta.
_CYCLES = 12.0
_SHORTEST = 60.0
_RINGING = 10.0
# a last test: so many times 1/decay rate, but not more than so many runs
_DECAYS = 6.0
_PATIENCE = 4.0
_LONGEST = 8.0  # runs: what cannot be judged is made twice as long, up to that
# Runs of other contacts that must all slide smoothly: then, at 95 % confidence, two of
# three of all runs do.
SEEDS = math.ceil(math.log(1.0 - 0.95) / math.log(2.0 / 3.0))
_READING = 5e-3, 2e-7  # seconds that the regime of a run takes, and for each sample
# contacts: that noise of so many is seen no more
_UNSEEN = math.ceil((ERRORS * NOISE_OF_CONTACTS / TINY) ** 2)


def cycle_of(rig: Rig) -> float:
    """Travel of the drive in the slowest cycle of a rig: a life of a contact and the
    loading, or a free oscillation.
    """
    slider = rig.slider
    velocity = rig.natural.velocity
    stretch = rig.interface.threshold_distribution.moment(1)
    period = 2.0 * math.pi / slider.frequency if slider.mass > 0 else 0.0
    delay = rig.interface.delay.moment(1)
    detached = velocity * delay if math.isfinite(delay) else 0.0
    return float(
        max(stretch * (1.0 + 1.0 / slider.stiffness) + detached, velocity * period)
    )


def length_of(rig: Rig) -> float:
    """Travel of the drive after which a run can be judged."""
    damping = rig.slider.damping
    cycles = _CYCLES * cycle_of(rig)
    ringing = rig.natural.velocity * _RINGING / damping if damping > 0 else 0.0
    return max(
        _SHORTEST * rig.interface.threshold_distribution.moment(1),
        cycles,
        min(ringing, 5.0 * cycles),
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
    """The contacts that judge a rig, or others of their kind: its own, as their
    noise is, as far as that is seen.
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


def stays(rig: Rig) -> bool:
    """Whether smooth sliding that is linearly stable stays, with the noise of the
    contacts.
    """
    if not isinstance(rig.method, DRAWN):
        return True
    try:
        return rig.method.count >= contact_noise(rig, contacts=1).contacts_for(
            1.0, of="velocity"
        )
    except (InputError, UndecidedError):  # no theory of their noise
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

    That is in seconds by estimate, not by the clock: the same rig gets the same answer.
    What a run has cost is known better than before it: by how often its contacts have
    broken. The next one is taken to be like it. No question is paid for twice.
    """

    def __init__(self, seconds: float) -> None:
        self.allowed = seconds
        self.spent = 0.0
        self._times = 1.0
        self.seen = dict[Rig, Regime]()
        self._known = dict[Any, Any]()
        self._tables = set[Any]()

    @contextmanager
    def within(self, part: float) -> Iterator[None]:
        """Allow no more than a part of what is left."""
        allowed = self.allowed
        self.allowed = self.spent + part * (self.allowed - self.spent)
        try:
            yield
        finally:
            self.allowed = allowed

    def pay(self, seconds: float) -> None:
        """Count work; raise `Spent` if there is less left."""
        if self.spent + seconds > self.allowed:
            raise Spent
        self.spent += seconds

    def theory(
        self,
        ask: Callable[..., Answer],
        rig: Rig,
        *given: Any,
        looks: float = 0.0,
        roots: int = 0,
    ) -> Answer:
        """What linear theory says of a rig, asked once; it takes so many seconds in
        `looks`, and roots off the axis.
        """
        table = rig.interface, rig.natural.velocity
        if (key := (ask, rig.slider, table, given)) not in self._known:
            cost = effort(rig)
            self.pay(
                looks
                or (cost.again if table in self._tables else cost.look)
                + roots * cost.root
            )
            self._tables.add(table)
            self._known[key] = ask(rig, *given)
        found: Answer = self._known[key]
        return found

    def record(
        self, case: Rig, begun: Recording | None = None, times: float = 2.0
    ) -> Recording:
        """Make a run, or go on with one, so many times as long; raise `Spent` if
        that would cost more than is left.
        """
        work = estimate(case).seconds * (1.0 if begun is None else times - 1.0)
        self.pay(work * self._times)
        run = (
            record(case, long=True)
            if begun is None
            else begun.longer(times * case.drive.duration)
        )
        foreseen = self._times
        self._times = _taken(run)
        self.spent += (
            work * (self._times - foreseen)
            + _READING[0]
            + _READING[1] * run.track.times.size
        )
        return run

    def judge(self, case: Rig) -> Regime:
        """The regime that a run leads to; raises `Spent` if the work that is allowed
        ends before it is told.
        """
        if case not in self.seen:
            _, seen, paid = self.watch(self.record(case), _LONGEST)
            if not paid:
                raise Spent
            self.seen[case] = seen
        return self.seen[case]

    def slide_smoothly(self, rigs: Sequence[Rig], others: Iterable[int]) -> bool:
        """Whether the runs of each rig with other contacts, by their number from 1 on,
        slide smoothly at last.

        The second of each lasts until its slowest mode has decayed. What does not
        slide, the first tells most often.
        """
        try:
            for other, rig in product(others, rigs):
                until = self.theory(until_decayed, rig, roots=1) if other == 2 else 0.0
                length = length_of(rig) if other == 2 else 0.0
                lasts = min(_PATIENCE * length, max(until, 2.0 * length))
                if self.judge(trial(rig, lasts, other)).kind != "smooth sliding":
                    return False
        except InputError:  # such a rig cannot be simulated
            return False
        return True

    def _fades(self, run: Recording, seen: Regime) -> bool:
        """Whether the force of four times as many contacts fluctuates half as much, as
        noise does, or as much.

        It tells where the velocity fluctuates by more than its mean, which the linear
        theory of noise does not cover.
        """
        assert isinstance(run.rig.method, DRAWN)
        many = replace(
            run.rig, method=replace(run.rig.method, count=4 * run.rig.method.count)
        )
        return fluctuation(self.record(many), seen) < math.sqrt(0.5) * fluctuation(
            run, seen
        )

    def watch(
        self, run: Recording, longest: float = math.inf
    ) -> tuple[Recording, Regime, bool]:
        """What a run that ends at a constant speed shows, or a longer one that tells;
        False if that was too dear.

        None is longer than so many times the length that judges a rig. An oscillation
        of a linearly stable rig must outlast its slowest mode; what does not slip must
        be seen not to decay as that does, which may take longer.
        """
        while True:
            case = run.rig
            seen = regime(run.dataset())
            lasts = 0.0
            reason = "the oscillation may still decay: longer runs would decide"
            doubtful = replace(
                seen,
                kind="undecided",
                reason=reason if seen.kind != "undecided" else seen.reason,
            )
            way = case.drive.duration * case.natural.velocity
            try:
                if (
                    seen.kind in OSCILLATES
                    and self.theory(linearly_unstable, case) is False
                ):
                    tests, until = (
                        {test.name: test for test in seen.table},
                        self.theory(until_decayed, case, roots=1),
                    )
                    lasts, half = (
                        min(_PATIENCE * length_of(case), until),
                        0.5 * (1.0 - seen.window[0] / seen.window[1]),
                    )
                    repeats = REPEATS in tests and tests[REPEATS].passed
                    noise = replace(seen, kind="smooth sliding")
                    if (
                        not repeats
                        and noise.is_noise
                        and (stays(case) or self._fades(run, seen))
                    ):
                        seen = replace(
                            noise,
                            reason=(
                                "irregular slips, no more than the noise of the "
                                "contacts makes"
                            ),
                        )
                    elif (
                        stays(case)
                        and seen.kind != "stick-slip"
                        and CHANGE in tests
                        and until
                    ):
                        # less than that of the mode
                        fall = math.log(seen.trend) + _DECAYS * half * way / until
                        # by chance
                        seen = (
                            doubtful if fall <= tests[CHANGE].limit - STEADY else seen
                        )
                if seen.kind != "undecided" and way >= lasts:
                    return run, seen, True
                if way > 0.9 * longest * length_of(case):
                    return run, doubtful, True
                # of the contacts that judge it
                case = replace(case, method=method_of(case))
                run = self.record(
                    case,
                    run if case.method == run.rig.method else None,
                    max(2.0, lasts / way),
                )
            except Spent:
                return run, doubtful, False


def fluctuation(run: Recording, seen: Regime) -> float:
    """Standard deviation of the spring force over its mean, from where a regime was
    judged on.
    """
    late = (
        run.dataset()["spring_force"].sel(time=slice(seen.window[0], None)).to_numpy()
    )
    return float(late.std() / abs(late.mean()))


def _taken(run: Recording) -> float:
    """What a run has taken over its estimate, which is for smooth sliding.

    In stick-slip contacts may break a hundredth as often, by the energy that breaks
    lost; and the slider may go several times as far as the drive, while looks at ageing
    contacts go by its way.
    """
    rig = run.rig.natural
    course = course_of(run.rig.natural)
    if isinstance(rig.interface.ageing, Langevin) and rig.interface.activation is None:
        times = (
            float(np.abs(np.diff(run.track["displacement"])).sum()) / course.distance
        )
    elif "broken_energy" in run.track.columns and not rig.interface.mechanisms & {
        "ageing",
        "activation",
    }:
        each = 0.5 * rig.interface.threshold_distribution.moment(2)
        times = min(
            float(run.track["broken_energy"][-1]) / each / lifetimes_in(rig, course)[0],
            1.0,
        )
    else:
        return 1.0
    work = estimate(run.rig)
    looks = sum(
        part.seconds for part in work.parts if part.key == "simulation.contacts"
    )
    return float(1.0 + (times - 1.0) * looks / work.seconds)

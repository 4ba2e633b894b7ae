"""A run under a constant drive that can be continued, measured, and switched to other
parameters.
"""

import itertools
import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import InputError, UndecidedError, instance, number
from stickslip.kernels.drive import Quadratic, Stop
from stickslip.measure.features import TINY
from stickslip.measure.periods import rises
from stickslip.model import (
    Contacts,
    FromRest,
    FromSliding,
    MasterEquation,
    Output,
    Slider,
    Start,
)
from stickslip.model.drive import constant
from stickslip.model.rig import Rig
from stickslip.model.structure import Structure
from stickslip.progress import in_time
from stickslip.simulation import (
    Beginning,
    Leg,
    Panels,
    check_method,
    estimate,
    follow_leg,
)
from stickslip.simulation.estimates import Work
from stickslip.stability import contact_noise
from stickslip.structures.runs import (
    RADIAN,
    SteppedStructure,
    engine_for,
    longest_step,
)

# the largest error that keeps the settled numbers; see `stickslip.cycles`
METHOD = MasterEquation(rtol=1e-4)
# phase (rad) of a free oscillation in one cycle, above which times are not resolved to
# a fraction of a radian
MOST_TURNS = 1e11
MOST_TURNS_STEPPED = 3e6  # the same for a structure, followed in steps: some minutes
# most samples in a cycle; they cost little beside the steps of a slider that rings
MOST_SAMPLES = 100_000
LOOK = 3.0  # expected cycles in a look, after which the amplitude is measured

_MANY = Contacts(10_000, seed=1)
_NOISE = 6.0  # peak to peak of an oscillation by noise, in standard deviations
_LONG = 20.0  # seconds of a look above which it is compared with the whole run
_LOOKS = 7  # usual looks of a run: its start, and five changes that shrink


# either engine has the seconds of an advance, the spring force at samples, and the pull
CycleEngine = Panels | SteppedStructure


def check_rig(rig: Rig, start: Start, method: MasterEquation) -> None:
    """Raise `InputError`, with a remedy, if no cycle can be followed on a rig."""
    instance("rig", rig, Rig, "a Rig(interface, slider, drive)")
    instance(
        "cycles: start",
        start,
        FromRest | FromSliding,
        "FromRest() or FromSliding(...)",
    )
    instance("cycles: method", method, MasterEquation, "MasterEquation(...)")
    instance(
        "Rig.slider",
        rig.slider,
        Slider | Structure,
        "a Slider or a linear structure",
    )
    if method.memoryless:
        raise InputError(
            "MasterEquation.memoryless: without memory the oscillation is spurious; "
            "leave it False here"
        )
    if isinstance(rig.slider, Structure):
        engine_for(rig.interface, contacts_of(rig))
    elif check_method(rig.interface, method) is not Panels:
        raise InputError(
            f"Interface.ageing = {rig.interface.ageing}, activation = "
            f"{rig.interface.activation}: cycles are "
            "followed for Bell, also with LogarithmicGrowth, for Parabolic, and for "
            "growth by a rule alone; leave one "
            "out, or simulate"
        )
    if isinstance(rig.slider, Slider) and rig.slider.mass == 0:
        raise InputError(
            "Slider.mass = 0: a cycle needs a mass above 0; the massless limit is for "
            "`stability` only"
        )
    number("velocity", rig.velocity, above=0, hint=rig.unit_name("velocity"))


def contacts_of(rig: Rig) -> Contacts:
    """Return the contacts for runs of a structure: those of its method, or 10,000."""
    return rig.method if isinstance(rig.method, Contacts) else _MANY


def noise_of(rig: Rig) -> float:
    """Return the peak to peak of the force by the noise of contacts under a structure
    in stable smooth sliding, in natural units; 0 under a slider, which has no noise.
    """
    if not isinstance(rig.slider, Structure):
        return 0.0
    count = contacts_of(rig).count
    with suppress(InputError, UndecidedError):
        return _NOISE * contact_noise(rig.natural, contacts=count).spring_force
    return _NOISE / math.sqrt(count)


def _frequency(rig: Rig) -> float:
    """Angular frequency of the slider, or of the slowest oscillation of a structure."""
    if not isinstance(rig.slider, Structure):
        return float(rig.slider.frequency)
    roots = np.linalg.eigvals(rig.slider.system.A)
    turning = np.abs(roots[np.abs(roots.imag) > 0.0])
    return float(turning.min() if turning.size else np.abs(roots).max())


def _fastest(rig: Rig) -> float:
    """Angular frequency of the slider, or of the fastest motion of a structure."""
    if isinstance(rig.slider, Structure):
        return 1.0 / (RADIAN * longest_step(rig.slider))
    return _frequency(rig)


def work_of_run(rig: Rig, start: Start) -> Work:
    """Estimate the work of a run until it usually decides whether an oscillation
    persists.
    """
    velocity = rig.natural.velocity
    cycle = _expected_cycle(rig) / velocity
    duration = _LOOKS * LOOK * cycle
    output = Output(interval=_interval(rig, cycle))
    method = contacts_of(rig) if isinstance(rig.slider, Structure) else METHOD
    natural = replace(rig.natural, start=start, method=method, output=output)
    return estimate(replace(natural, drive=constant(velocity, duration)))


class _Meter:
    """Adds up the estimated seconds of an engine during a look; called after each
    advance.
    """

    def __init__(self, rig: Rig, engine: CycleEngine) -> None:
        self.rig = rig
        self.engine = engine
        self.spent = 0.0
        self.most = _LONG

    def __call__(self, _: float) -> None:
        """Raise `UndecidedError` once a look has taken longer than the estimate of the
        whole run: the end of a cycle is out of reach.
        """
        self.spent += self.engine.seconds
        if self.spent > self.most:
            estimated = work_of_run(self.rig, FromRest()).reference_seconds
            if self.spent > max(estimated, _LONG):
                now = self.rig.in_units(self.engine.here()[0], "time")
                raise UndecidedError(
                    f"{self.rig.interface.threshold_distribution}: no cycle is "
                    f"complete at t = {now}, and a look at more takes longer than "
                    f"{in_time(self.spent)}; give a narrower distribution, or simulate"
                )
            self.most = estimated


class Look(NamedTuple):
    """Measurement of an interval of a few cycles; `cycles` are the amplitudes of the
    single cycles that it completes.
    """

    amplitude: float
    period: float
    fastest: float
    mean_force: float
    cycles: Array


@dataclass(frozen=True, eq=False)
class CycleRun:
    """An unfinished run, in natural units.

    It is immutable, so that one can return to it and try again.
    """

    rig: Rig  # with its scales, for messages
    engine: CycleEngine
    drive: Quadratic
    cycle: float  # expected travel of the drive in a cycle
    # samples of the cycle that the last look has left incomplete
    begun: Array | None = None

    @classmethod
    def begin(cls, rig: Rig, start: Start, method: MasterEquation) -> Self:
        """Return a run at the start of a rig.

        Raises `InputError` if a cycle lasts so many periods of the slider's own
        oscillation that no run could follow it.
        """
        velocity = rig.natural.velocity
        cycle = _expected_cycle(rig)
        turns = _fastest(rig) * cycle / velocity
        most = MOST_TURNS
        if isinstance(rig.slider, Structure):
            most = MOST_TURNS_STEPPED
        if turns > most:
            raise InputError(
                f"velocity = {rig.in_units(velocity, 'velocity')}: the slider could "
                f"oscillate {turns:.2g} rad "
                "on its spring in one cycle, more than a run resolves; give at least "
                f"{rig.in_units(velocity * turns / most, 'velocity', 2)}"
            )
        beginning = Beginning(rig.interface, rig.slider, velocity, start)
        engine: CycleEngine = (
            SteppedStructure(beginning, contacts_of(rig))
            if isinstance(rig.slider, Structure)
            else Panels(beginning, method)
        )
        place = beginning.drive_position(engine.contact_force())
        return cls(rig, engine, Quadratic(0.0, place, velocity, 0.0), cycle)

    def look(self) -> tuple[Self, Look]:
        """Continue for a few cycles and measure them; if none is complete, the next
        look is twice as long.
        """
        velocity = self.drive.velocity
        engine = self.engine.copy()
        rows = self._samples(engine, LOOK * self.cycle / velocity)
        # `completed` cycles may have begun in the last look; `cycles` are in this one.
        joined = (
            rows if self.begun is None else np.concatenate([self.begun, rows], axis=1)
        )
        completed, rest = _cycles(joined)
        run = replace(
            self,
            engine=engine,
            begun=joined[:, rest:] if completed.size else None,
        )
        cycles = completed if self.begun is None else _cycles(rows)[0]
        _, force, speed, _ = rows
        fastest = float(speed.max()) / velocity
        if cycles.size:
            oscillation = np.median(cycles[0])
            period = np.mean(cycles[1])
            mean = np.average(cycles[2], weights=cycles[1])
        else:
            oscillation = np.ptp(force)
            period = math.nan
            mean = force.mean()
            if oscillation > TINY:  # cycles longer than expected
                run = replace(run, cycle=2.0 * run.cycle)
        return run, Look(
            float(oscillation), float(period), fastest, float(mean), completed[0]
        )

    def _samples(self, engine: CycleEngine, duration: float) -> Array:
        """Follow the drive; return times, spring force, slider velocity and rate of the
        force at fine samples, as rows.
        """
        begin = engine.here()[0]
        each = self.cycle / self.drive.velocity
        count = math.ceil(duration / _interval(self.rig, each))
        times = begin + duration * np.arange(1, count + 1) / count
        leg = Leg(self.drive, begin + duration, times, Stop())
        samples, _ = follow_leg(engine, leg, _Meter(self.rig, engine))
        force, slope = engine.spring_force(samples, leg)
        return np.stack([times, force, samples[:, 1], slope])

    def turned(self, rig: Rig) -> "CycleRun":
        """Return this run, continued with the parameters of another rig: forces and
        positions, including that of the drive, are kept.
        """
        before = self.drive
        velocity = rig.natural.velocity
        time, _ = self.engine.here()
        place = before.position + before.velocity * (time - before.start)
        engine = self.engine.turned(rig.interface, rig.slider)
        if engine.drive_stiffness:
            pull = self.engine.pull(place, before.velocity)
            place += (pull - engine.pull(place, velocity)) / engine.drive_stiffness
        drive = Quadratic(time, place, velocity, 0.0)
        cycle = self.cycle / _expected_cycle(self.rig) * _expected_cycle(rig)
        return CycleRun(rig, engine, drive, cycle)


def _interval(rig: Rig, cycle: float) -> float:
    """Time between samples, fine enough for a slip, which takes about half a period of
    the slider on its spring; limited so that quick slips stay affordable.
    """
    finest = min(cycle / 200, 0.3 / _fastest(rig))
    return max(finest, cycle / MOST_SAMPLES)


def _expected_cycle(rig: Rig) -> float:
    """Expected travel of the drive in a cycle: that which loads a contact to its
    threshold, or that of one oscillation of the slider.
    """
    slider: Slider = getattr(rig.slider, "slowest", rig.slider)
    stretch = rig.interface.threshold_distribution.moment(1)
    return max(
        stretch * (1.0 + 1.0 / slider.stiffness),
        rig.natural.velocity * 2.0 * math.pi / _frequency(rig),
    )


def _cycles(rows: Array) -> tuple[Array, int]:
    """Return peak-to-peak of the spring force, period and mean force of each complete
    cycle, shape (3, n); and the sample at which the next cycle begins.

    A cycle goes from one rise through three quarters of the range to the next, with a
    drop below one quarter in between. Its extremes lie where the rate of the force is
    0, between the samples.
    """
    t, force, _, slope = rows
    low = float(force.min())
    high = float(force.max())
    quarter = 0.75 * low + 0.25 * high
    risen, times = rises(t, force, quarter, 0.25 * low + 0.75 * high)
    if risen.size < 2:
        return np.empty((3, 0)), 0
    oscillations = []
    means = []
    for a, b in itertools.pairwise(risen.tolist()):
        part = force[a : b + 1]
        top, bottom = (
            extreme(t, force, slope, a + int(i))
            for i in (np.argmax(part), np.argmin(part))
        )
        oscillations.append(top - bottom)
        means.append(float(part[1:].mean()))
    below = np.flatnonzero(force[: risen[-1]] < quarter)
    return np.array([oscillations, np.diff(times), means]), int(below[-1])


def extreme(
    t: Array,
    force: Array,
    slope: Array,
    i: int,
) -> float:
    """Return the extreme value next to a sample where the slope changes sign, by a
    parabola; the sample itself if the parabola does not fit.
    """
    for j in (i, i - 1):
        if 0 <= j < t.size - 1 and slope[j] * slope[j + 1] < 0:
            apart = t[j + 1] - t[j]
            turn = slope[j] - slope[j + 1]
            rise = 0.5 * (slope[j] + slope[j + 1]) * apart
            if abs(force[j + 1] - force[j] - rise) < 0.2 * abs(turn) * apart:
                return float(force[j] + 0.5 * slope[j] ** 2 / turn * apart)
    return float(force[i])

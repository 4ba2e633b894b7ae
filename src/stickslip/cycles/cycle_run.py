"""A run under a constant drive that can be continued, measured, and switched to
other parameters.
"""

import itertools
import math
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import InputError, UndecidedError, instance, number
from stickslip.kernels.drive import Quadratic, Stop
from stickslip.measure.features import TINY
from stickslip.measure.periods import rises
from stickslip.model import (
    FromRest,
    FromSliding,
    MasterEquation,
    Output,
    Slider,
    Start,
)
from stickslip.model.drive import constant
from stickslip.model.rig import Rig
from stickslip.progress import in_time
from stickslip.simulation import (
    Beginning,
    Leg,
    Panels,
    check_method,
    estimate,
    follow_leg,
)
from stickslip.simulation.engines.panel_trial import seconds_since
from stickslip.simulation.estimates import Work

# the largest error that keeps the settled numbers; see `stickslip.cycles`
METHOD = MasterEquation(rtol=1e-4)
# of a free oscillation in one cycle, in radian, above which times are not known to a
# part of one
MOST_TURNS = 1e11
# in a cycle: beside the steps of a slider that rings they cost little
MOST_SAMPLES = 100_000
LOOK = 3.0  # cycles, by their expected length, between two looks at the amplitude

_LONG = 20.0  # seconds from which a look is compared with the whole run by estimate
_LOOKS = 7  # that a run takes, about: five steps that shrink, and where it begins


def check_rig(rig: Rig, start: Start, method: MasterEquation) -> None:
    """Raise `InputError`, with what would be right, if no cycle can be followed on a
    rig.
    """
    instance("rig", rig, Rig, "a Rig(interface, slider, drive)")
    instance(
        "cycles: start", start, FromRest | FromSliding, "FromRest() or FromSliding(...)"
    )
    instance("cycles: method", method, MasterEquation, "MasterEquation(...)")
    instance("Rig.slider", rig.slider, Slider, "a Slider")
    if method.memoryless:
        raise InputError(
            "MasterEquation.memoryless: without memory the oscillation is spurious; "
            "leave it False here"
        )
    if check_method(rig.interface, method) is not Panels:
        raise InputError(
            f"Interface.ageing = {rig.interface.ageing}, activation = "
            f"{rig.interface.activation}: cycles are "
            "followed for Bell, also with LogarithmicGrowth, for Parabolic, and for "
            "growth by a rule alone; leave one "
            "out, or simulate"
        )
    if rig.slider.mass == 0:
        raise InputError(
            "Slider.mass = 0: a cycle needs a mass above 0; the massless limit is for "
            "`stability` only"
        )
    number("velocity", rig.velocity, above=0, hint=rig.unit_name("velocity"))


def work_of_run(rig: Rig, start: Start) -> Work:
    """Work of a run until it is clear whether its oscillation persists, most often."""
    velocity = rig.natural.velocity
    cycle = _expected_cycle(rig) / velocity
    duration = _LOOKS * LOOK * cycle
    output = Output(interval=_interval(rig, cycle))
    natural = replace(rig.natural, start=start, method=METHOD, output=output)
    return estimate(replace(natural, drive=constant(velocity, duration)))


class _Meter:
    """Seconds by count that an engine takes from now on for a look of a rig; called
    after each advance.
    """

    def __init__(self, rig: Rig, engine: Panels) -> None:
        self.rig = rig
        self.engine = engine
        self.before = engine.state.used
        self.spent = 0.0
        self.most = _LONG

    def __call__(self, _: float) -> None:
        """Raise `UndecidedError` once a look has taken longer than the run by estimate:
        what it waits for is not in reach.
        """
        self.spent += seconds_since(self.before, self.engine)
        self.before = self.engine.state.used
        if self.spent > self.most:
            estimated = work_of_run(self.rig, FromRest()).seconds
            if self.spent > max(estimated, _LONG):
                now = self.rig.in_units(self.engine.here()[0], "time")
                raise UndecidedError(
                    f"{self.rig.interface.threshold_distribution}: no cycle is "
                    f"complete at t = {now}, and a look at more takes longer than "
                    f"{in_time(self.spent)}; give a narrower distribution, or simulate"
                )
            self.most = estimated


class Look(NamedTuple):
    """Measurement of a stretch of a few cycles; `cycles` are the amplitudes of those
    that it completes, one by one.
    """

    amplitude: float
    period: float
    fastest: float
    mean_force: float
    cycles: Array


@dataclass(frozen=True, eq=False)
class CycleRun:
    """A run under way, in natural units.

    Immutable, so that one can go back and try again.
    """

    rig: Rig  # with the scales that reasons are given in
    engine: Panels
    drive: Quadratic
    cycle: float  # expected travel of the drive in one
    # rows of the cycle that the last look has left unfinished
    begun: Array | None = None

    @classmethod
    def begin(cls, rig: Rig, start: Start, method: MasterEquation) -> Self:
        """Return a rig at its start.

        Raises `InputError` if a cycle lasts so long against the slider's own
        oscillation that no run could follow it.
        """
        velocity = rig.natural.velocity
        cycle = _expected_cycle(rig)
        turns = rig.slider.frequency * cycle / velocity
        if turns > MOST_TURNS:
            raise InputError(
                f"velocity = {rig.in_units(velocity, 'velocity')}: the slider could "
                f"oscillate {turns:.2g} rad "
                "on its spring in one cycle, more than a run resolves; give at least "
                f"{rig.in_units(velocity * turns / MOST_TURNS, 'velocity', 2)}"
            )
        beginning = Beginning(rig.interface, rig.slider, velocity, start)
        engine = Panels(beginning, method)
        return cls(
            rig,
            engine,
            Quadratic(
                0.0, beginning.drive_position(engine.contact_force()), velocity, 0.0
            ),
            cycle,
        )

    def look(self) -> tuple[Self, Look]:
        """Go on for a few cycles and say what they show; stretches of the drive too
        short for that are doubled.
        """
        stiffness = self.rig.slider.stiffness
        velocity = self.drive.velocity
        engine = self.engine.copy()
        rows = self._samples(engine, LOOK * self.cycle / velocity)
        # One by one cycles go on from look to look; what the look shows is its own.
        joined = (
            rows if self.begun is None else np.concatenate([self.begun, rows], axis=1)
        )
        completed, rest = _cycles(joined, stiffness, velocity)
        run = replace(
            self, engine=engine, begun=joined[:, rest:] if completed.size else None
        )
        cycles = (
            completed if self.begun is None else _cycles(rows, stiffness, velocity)[0]
        )
        _, force, speed = rows
        fastest = float(speed.max()) / velocity
        if cycles.shape[1] == 0:
            oscillation = float(np.ptp(force))
            if oscillation > TINY:  # cycles longer than expected
                run = replace(run, cycle=2.0 * run.cycle)
            return run, Look(
                oscillation, math.nan, fastest, float(force.mean()), completed[0]
            )
        oscillation = np.median(cycles[0])
        period = np.mean(cycles[1])
        mean = np.average(cycles[2], weights=cycles[1])
        return run, Look(
            float(oscillation), float(period), fastest, float(mean), completed[0]
        )

    def _samples(self, engine: Panels, duration: float) -> Array:
        """Follow the drive; times, spring force and slider velocity of fine samples,
        as rows.
        """
        slider = self.rig.slider
        begin = engine.here()[0]
        each = self.cycle / self.drive.velocity
        count = math.ceil(duration / _interval(self.rig, each))
        times = begin + duration * np.arange(1, count + 1) / count
        leg = Leg(self.drive, begin + duration, times, Stop())
        samples, _ = follow_leg(engine, leg, _Meter(self.rig, engine))
        return np.stack(
            [
                times,
                slider.stiffness * (leg.drive_position(times) - samples[:, 0]),
                samples[:, 1],
            ]
        )

    def turned(self, rig: Rig) -> "CycleRun":
        """Return what goes on as another rig; forces and positions stay, and the
        drive goes on from where it is.
        """
        engine = self.engine.turned(rig.interface, rig.slider)
        time, X = engine.here()
        stretched = (
            self.drive.position + self.drive.velocity * (time - self.drive.start) - X
        )
        stretched *= self.rig.slider.stiffness / rig.slider.stiffness
        drive = Quadratic(time, X + stretched, rig.natural.velocity, 0.0)
        cycle = self.cycle / _expected_cycle(self.rig) * _expected_cycle(rig)
        return CycleRun(rig, engine, drive, cycle)


def _interval(rig: Rig, cycle: float) -> float:
    """Time between samples: a slip takes about half a period of the slider on its
    spring; a cap keeps very quick slips affordable.
    """
    slider: Slider = rig.slider
    finest = min(cycle / 200, 0.3 / slider.frequency)
    return max(finest, cycle / MOST_SAMPLES)


def _expected_cycle(rig: Rig) -> float:
    """Expected travel of the drive in a cycle: a contact loaded to its threshold, or
    an oscillation of the slider.
    """
    slider: Slider = rig.slider
    stretch = rig.interface.threshold_distribution.moment(1)
    return max(
        stretch * (1.0 + 1.0 / slider.stiffness),
        rig.natural.velocity * 2.0 * math.pi / slider.frequency,
    )


def _cycles(rows: Array, stiffness: float, velocity: float) -> tuple[Array, int]:
    """Peak-to-peak of the spring force, period and mean force of each complete cycle,
    shape (3, n); where the next is.

    A cycle goes from one rise through three quarters of the range to the next, with a
    drop below one quarter in between. The extremes lie where the slider is as fast as
    the drive, between the samples.
    """
    t, force, speed = rows
    low = float(force.min())
    high = float(force.max())
    quarter = 0.75 * low + 0.25 * high
    risen, times = rises(t, force, quarter, 0.25 * low + 0.75 * high)
    if risen.size < 2:
        return np.empty((3, 0)), 0
    slope = stiffness * (velocity - speed)
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


def extreme(t: Array, force: Array, slope: Array, i: int) -> float:
    """Value where the slope changes sign next to a sample, by a parabola, unless
    that does not fit.
    """
    for j in (i, i - 1):
        if 0 <= j < t.size - 1 and slope[j] * slope[j + 1] < 0:
            apart = t[j + 1] - t[j]
            turn = slope[j] - slope[j + 1]
            rise = 0.5 * (slope[j] + slope[j + 1]) * apart
            if abs(force[j + 1] - force[j] - rise) < 0.2 * abs(turn) * apart:
                return float(force[j] + 0.5 * slope[j] ** 2 / turn * apart)
    return float(force[i])

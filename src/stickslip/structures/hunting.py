"""Hunting of a position-controlled axis: first the roots of steady tracking, then one
slip, then moves.

An axis hunts if contacts that strengthen at rest let it stick, the integral of the
controller pulls it off, and it slips past its target. One slow pull, with only the
proportional and derivative gains, gives the length of a slip: the axis can hunt only if
it is longer than the break-away displacement. Whether it does hunt depends on the move:
up to a fold of the gain, the axis may also stand still.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from stickslip.arrays import Array
from stickslip.errors import InputError, instance
from stickslip.loops import HALVINGS, bounded
from stickslip.model import Contacts, Gaussian, Interface, Output, Rig, Slider
from stickslip.model.drive import constant
from stickslip.model.structure import ControlledAxis
from stickslip.simulation.driver import follow
from stickslip.simulation.engines.base import Beginning
from stickslip.simulation.run import simulate
from stickslip.stability import count_unstable, critical
from stickslip.structures.runs import SteppedStructure

MOST_CONTACTS = 2000  # most contacts of a simulated move
MOVES = (1.5, 3.0, 5.4, 8.0)  # moves in x_s, if none are given
# A hold after a move lasts for `_PERIODS` periods of hunting; the last `_JUDGED` of
# them decide.
_PERIODS = 12
_JUDGED = 5
# An axis hunts with a peak to peak above this fraction of the break-away displacement;
# one that creeps to rest stays far below.
_HUNTS = 0.3
_RISE = 1.1  # factor by which the gain is raised until hunting ends ...
_HALVINGS = 3  # ... and number of bisections after that
_LARGEST = 100.0  # largest gain tried, over that of the axis
# Speeds of a pull over that of the free motion of the axis: so slow that its inertia
# does not matter.
_QUICK, _SLOW = 1e-3, 2e-4
_SAMPLES = 40_000
_ROUNDING = 1e-9  # of an eigenvalue


class Tracking(NamedTuple):
    """Steady tracking at a speed."""

    unstable: int  #: number of unstable roots with the gains of the axis
    without_integral: int  #: number of unstable roots with ``ki = 0``
    limit: float  #: ``ki`` up to which tracking is steady; may be 0 or infinite
    frequency: float  #: of the oscillation beyond the limit, in cycles per time


class Slip(NamedTuple):
    """One slip of a slow pull with only the proportional and derivative gains."""

    break_away: float  #: displacement at which the slip begins
    length: float  #: length of the slip; 0 if the axis does not slip

    @property
    def peak_to_peak(self) -> float:
        """Width of hunting: the sum of the slip and the break-away displacement."""
        return self.length + self.break_away


@dataclass(frozen=True)
class Move:
    """Motion of an axis after a move."""

    distance: float
    peak_to_peak: float
    period: float  #: NaN if the axis stands still
    hunts: bool


def axis_of(rig: Rig) -> ControlledAxis:
    """Return the axis of a rig; `InputError` if its slider is none."""
    instance("rig", rig, Rig, "a Rig(interface, slider, drive)")
    instance("Rig.slider", rig.slider, ControlledAxis, "a ControlledAxis")
    assert isinstance(rig.slider, ControlledAxis)
    return rig.slider


def with_gain(axis: ControlledAxis, kp: float) -> ControlledAxis:
    """Return the axis with another proportional gain, the same damping ratio, and the
    same integral time ``kp/ki``.
    """
    factor = kp / axis.kp
    kd = axis.kd * math.sqrt(factor)
    return replace(axis, kp=kp, ki=axis.ki * factor, kd=kd)


def tracking(rig: Rig) -> Tracking:
    """Return the integral gain up to which an axis tracks steadily at the speed of a
    rig, by linear theory, in natural units; it includes the hold between samples.

    At the limit, ``kp + Re kappa(i w) = M w^2``, and
    ``ki = w^2 (kd + M eta) + w Im kappa(i w)``. Unstable roots are counted, without
    any assumption of passivity.

    Parameters
    ----------
    rig : Rig
        A rig with a `ControlledAxis` as its slider.

    Raises
    ------
    InputError
        If the slider is no axis, or the interface has no steady sliding.

    Examples
    --------
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1)
    ... )
    >>> axis = ss.model.ControlledAxis(mass=1e-4, kp=2.0, kd=0.00424, ki=1.0)
    >>> found = tracking(ss.Rig(interface, axis, ss.constant(1.0)))
    >>> round(found.limit, 3), found.unstable
    (4.352, 0)
    """
    axis = axis_of(rig)
    natural = rig.natural
    without = count_unstable(replace(natural, slider=replace(axis, ki=0.0)))
    unstable = count_unstable(natural) if axis.ki else without
    # frictionless: M s^3 + (kd + M eta) s^2 + kp s + ki
    routh = (axis.kd + axis.mass * axis.damping) * axis.kp / axis.mass
    if without or routh == 0.0:
        return Tracking(unstable, without, 0.0, math.nan)
    some = replace(natural, slider=replace(axis, ki=1e-3 * routh))
    found = critical(some, "ki", between=(1e-4 * routh, 2.0 * routh))
    lost = next((edge for edge in found.edges if edge.loses_stability), None)
    if lost is None:
        return Tracking(unstable, without, math.inf, math.nan)
    return Tracking(unstable, without, lost.value, lost.frequency / (2.0 * math.pi))


def strengthens(interface: Interface) -> bool:
    """Whether contacts strengthen at rest, without which no axis sticks."""
    return interface.ageing is not None or interface.delay.moment(1) > 0.0


def is_unstable(axis: ControlledAxis, stiffness: float) -> bool:
    """Whether a controlled axis diverges from its place while contacts of a constant
    stiffness hold it: 0 if all have broken, 1 if all are attached.
    """
    every = axis.sample_time
    if not every:  # criterion of Routh
        damping = axis.kd / axis.mass + axis.damping
        return axis.ki > damping * (axis.kp + stiffness)
    free = np.zeros((3, 3))  # of position, velocity, and the force held
    free[0, 1] = 1.0
    free[1] = np.array([-stiffness, -axis.damping * axis.mass, 1.0]) / axis.mass
    held = expm(every * free)
    # the force after an update, by position, velocity, sum of errors, and last position
    at_once = axis.kp + axis.ki * every + axis.kd / every
    update = np.array([-at_once, 0.0, 1.0, axis.kd / every])
    step = np.diag([0.0, 0.0, 1.0, 0.0])
    step[:2, :2] = held[:2, :2]
    step[:2] += np.outer(held[:2, 2], update)
    step[2:, 0] = -axis.ki * every, 1.0
    return bool(np.abs(np.linalg.eigvals(step)).max() > 1.0 + _ROUNDING)


def one_slip(interface: Interface, axis: ControlledAxis, method: Contacts) -> Slip:
    """Return the slip of an axis that is pulled slowly, starting at rest with all
    contacts unstretched. If it is not longer than the break-away displacement, the axis
    cannot hunt.
    """
    slider = Slider(
        stiffness=axis.kp,
        mass=axis.mass,
        damping=axis.kd / axis.mass + axis.damping,
    )
    mean = interface.threshold_distribution.moment(1)
    fastest = math.sqrt((axis.kp + 1.0) / axis.mass) * mean
    quick = _QUICK * fastest
    slow = _SLOW * fastest
    way = mean * (1.0 + 1.0 / axis.kp)
    drive = constant(quick, 0.5 * way / quick).then(constant(slow, way / slow))
    rest = replace(interface, initial=Gaussian(mean=0.0, std=0.0))
    run = simulate(
        Rig(rest, slider, drive),
        method=method,
        output=Output(interval=drive.duration / _SAMPLES),
        long=True,
    )
    force = run.spring_force.to_numpy()
    position = run.displacement.to_numpy()
    velocity = run.velocity.to_numpy()
    highest = np.maximum.accumulate(force)
    fallen = np.flatnonzero(force < 0.8 * highest)
    if not fallen.size:
        return Slip(float(position[np.argmax(force)]), 0.0)
    begin = int(np.argmax(force[: fallen[0]]))
    rests = fallen[0] + np.flatnonzero(velocity[fallen[0] :] <= 2.0 * slow)
    end = int(rests[0]) if rests.size else -1
    return Slip(float(position[begin]), float(position[end] - position[begin]))


class Hunt:
    """Simulation of moves of an axis, each followed by a hold; in natural units.

    Parameters
    ----------
    rig : Rig
        A rig with a `ControlledAxis`; moves have the speed of its drive.
    """

    def __init__(self, rig: Rig) -> None:
        natural = rig.natural
        self.interface = natural.interface
        self.axis = axis_of(natural)
        own = natural.method
        if not isinstance(own, Contacts):
            own = Contacts(MOST_CONTACTS, seed=1)
        self.method = Contacts(min(own.count, MOST_CONTACTS), seed=own.seed)
        mean = self.interface.threshold_distribution.moment(1)
        self.mean = mean
        slow = mean * 1e-2 * math.sqrt(1.0 / self.axis.mass)
        self.speed = abs(natural.velocity) or slow
        self.slip = one_slip(self.interface, self.axis, self.method)

    @property
    def possible(self) -> bool:
        """Whether the axis can hunt: it has an integral gain, contacts strengthen at
        rest, and the slip is longer than the break-away displacement.
        """
        return (
            self.axis.ki > 0.0
            and strengthens(self.interface)
            and self.slip.length > self.slip.break_away
        )

    @property
    def period(self) -> float:
        """Approximate time between two slips in the same direction, in which the
        integral reverses the force twice, at half the peak-to-peak position error.
        """
        return 8.0 / (self.axis.ki * self.slip.peak_to_peak)

    @property
    def moves(self) -> tuple[float, ...]:
        """Distances of the moves."""
        return self.axis.moves or tuple(self.mean * each for each in MOVES)

    def move(self, distance: float) -> Move:
        """Simulate a move and a hold, and return whether and how the axis hunts."""
        return self._move(distance)[0]

    def _move(self, distance: float) -> tuple[Move, SteppedStructure]:
        beginning = Beginning(self.interface, self.axis, self.speed)
        engine = SteppedStructure(beginning, self.method)
        go = constant(self.speed, distance / self.speed)
        follow(engine, go, 0.0, np.array([go.duration]))
        return self._hold(engine, distance), engine

    def _hold(self, engine: SteppedStructure, place: float) -> Move:
        """Hold an axis at a position for some periods of hunting, and return its
        motion.
        """
        period = self.period + 2.0 * self.interface.delay.moment(1)
        hold = constant(0.0, _PERIODS * period)
        # `follow` takes times since the start of the run, which includes the move
        begin, _ = engine.here()
        times = begin + np.linspace(0.0, hold.duration, 100 * _PERIODS)
        track = follow(engine, hold, place, times[:-1])
        late = track["displacement"][-100 * _JUDGED :]
        width = float(np.ptp(late))
        hunts = width > max(_HUNTS * self.slip.break_away, 2.5 * self.axis.encoder_step)
        every = _period(track.times[-late.size :], late) if hunts else math.nan
        return Move(place, width, every, hunts)

    def fold(self) -> float:
        """Return the gain above which hunting ends.

        The gain of an axis that hunts is raised, by `with_gain`, until it stands still.

        Raises
        ------
        InputError
            If the axis does not hunt after any of its moves.
        """
        for distance in self.moves:
            found, engine = self._move(distance)
            if found.hunts:
                break
        else:
            raise InputError("fold: the axis hunts after none of its moves")
        low = self.axis.kp
        high = low * _RISE
        turns = bounded("gains that hunt", HALVINGS)
        while high < _LARGEST * self.axis.kp:
            next(turns)
            raised = self._raised(engine, high, distance)
            if raised is None:
                break
            engine, low, high = raised, high, high * _RISE
        for _ in range(_HALVINGS):
            middle = math.sqrt(low * high)
            raised = self._raised(engine, middle, distance)
            if raised is None:
                high = middle
            else:
                engine, low = raised, middle
        return high

    def _raised(
        self, engine: SteppedStructure, kp: float, place: float
    ) -> SteppedStructure | None:
        """Return the engine with a higher gain, after a hold, if it still hunts."""
        raised = engine.turned(self.interface, with_gain(self.axis, kp))
        return raised if self._hold(raised, place).hunts else None


def _period(t: Array, x: Array) -> float:
    """Return the mean time between rises through the middle."""
    above = x > 0.5 * (x.max() + x.min())
    rises = t[1:][above[1:] & ~above[:-1]]
    return float(np.mean(np.diff(rises))) if rises.size > 1 else math.nan

"""Whether an oscillation persists: a run that is looked at until its fate is clear."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.answers import Answer
from stickslip.cycles.ride import METHOD, Look, Ride, natural_rig
from stickslip.errors import InputError, UndecidedError, whole
from stickslip.measure.slips import SLIP_VELOCITY
from stickslip.measure.verdict import TINY, Kind
from stickslip.model import Delay, FromRest, MasterEquation, Start
from stickslip.model.rig import Rig
from stickslip.model.units import Scales, in_words
from stickslip.sliding import kinetic_friction
from stickslip.stability import count_unstable

Array = NDArray[np.float64]

PATIENCE = 60
"""Looks after which what has not settled is undecided, unless its trend tells."""
STEADY = 1e-3
"""Change of ln(amplitude) from look to look that counts as none if it stays so small three times."""
REST = 0.01
"""... and that may still lie ahead, if the changes shrink geometrically."""
_STEADY_CYCLES, _EACH, _AHEAD = 6, 2e-5, 1e-3
"""So many changes of ln(amplitude) from cycle to cycle that are so small count as none, too; what may lie ahead."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Verdict(Answer):
    """Whether an oscillation persists from a start, with the evidence. Nonlinear: it belongs to the start.

    Attributes
    ----------
    sustained : bool or None
        None if the evidence does not suffice, for the reason given.
    kind : {"stick-slip", "sustained oscillation", "smooth sliding", "undecided"}
        Of the motion at the end. Stick-slip: the slider reaches at least 3.5 times the velocity of the drive, as in
        `stickslip.measure.regime`.
    reason : str
        Why, in plain words.
    peak_to_peak : float
        Of the spring force at the last look, in the unit of force: the median cycle.
    period : float
        In time; NaN without complete cycles.
    largest_velocity : float
        Of the slider, in velocities of the drive, at the last look.
    change : float
        Of ln(peak to peak) from the last look but one to the last; NaN with one look.
    travel : float
        Of the drive, in the unit of length, up to the verdict.
    linearly_unstable : bool or None
        Whether smooth sliding is unstable by itself there; None on its very boundary, and if there is no steady
        sliding.
    """

    sustained: bool | None
    kind: Kind
    reason: str
    peak_to_peak: float
    period: float
    largest_velocity: float
    change: float
    travel: float
    linearly_unstable: bool | None

    @property
    def has_cycle(self) -> bool:
        """Whether there is an oscillation that can be followed."""
        return bool(self.sustained) and self.kind != "undecided"

    def in_units(self, rig: Rig) -> Verdict:
        """Return a verdict found in natural units in those of a rig."""
        return replace(
            self,
            peak_to_peak=self.peak_to_peak * rig.unit("f_s"),
            period=self.period * rig.unit("time"),
            travel=self.travel * rig.unit("x_s"),
        )

    def __str__(self) -> str:
        return f"{self.kind}: {self.reason}"


def is_sustained(
    rig: Rig,
    *,
    start: Start = FromRest(),
    method: MasterEquation = METHOD,
    patience: int = PATIENCE,
) -> Verdict:
    """Tell whether an oscillation persists from a start, at a constant velocity of the drive.

    The run is looked at every three cycles, by their expected length: the drive travels ``<x_s> (1 + k/K)`` in one,
    or for one period of the slider on its spring, whichever is longer. It ends as soon as its fate is clear. The
    oscillation *persists* if its amplitude no longer changes (by less than 1e-3 three times running or by less than
    2e-5 in six cycles, or with changes that shrink geometrically and have less than 1 % left to go), or scatters about
    a constant without a trend. It
    *decays* if it is below 2 % of the kinetic friction and shrinks while smooth sliding is stable by linear theory.
    Where smooth sliding is unstable some oscillation always persists; the run then tells which.

    Parameters
    ----------
    rig : Rig
        Its drive moves at its first velocity all the time.
    start : FromRest or FromSliding
        `FromRest` contacts with a narrow distribution are the paper's start; ``FromSliding(perturbation=...)`` asks for
        small perturbations.
    method : MasterEquation
    patience : int
        Looks after which to give up, at 3 cycles each; up to five times as many while the amplitude drifts one way.

    Returns
    -------
    Verdict
        Undecided where the amplitude still drifts after all looks, and its trend does not tell where to.

    Raises
    ------
    InputError
        If no cycle can be followed on the rig: thresholds that age, no mass, a velocity that is not above 0.

    Examples
    --------
    >>> import stickslip as ss
    >>> interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1))
    >>> rig = ss.Rig(interface, ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4), ss.constant(velocity=1.0))
    >>> ss.cycles.is_sustained(rig).kind, ss.cycles.is_sustained(rig, start=ss.FromSliding(perturbation=0.05)).kind
    ('stick-slip', 'smooth sliding')
    """
    natural = natural_rig(rig, start, method)
    whole("patience", patience, at_least=1)
    return settle(Ride.begin(natural, start, method, rig.scales), patience)[0].in_units(rig)


def settle(ride: Ride, patience: int = PATIENCE) -> tuple[Verdict, Ride, Look]:
    """Go on until it is clear whether the oscillation persists."""
    travel, growing = 0.0, _linearly_unstable(ride.rig)
    floor = TINY * _friction(ride.rig)
    looks: list[Look] = []
    fate: tuple[bool | None, str] | None = None
    while fate is None:
        ride, look = ride.look()
        looks.append(look)
        travel += look.travel
        fate = _fate(looks, floor, growing, patience, ride.scales)
    last, (answer, reason) = looks[-1], fate
    limit = _limit(np.concatenate([look.cycles for look in looks]))
    if answer and limit is not None:
        last = last._replace(amplitude=limit)
    fastest = max(look.fastest for look in looks[-2:])
    kind: Kind = "undecided"
    if answer is False:
        kind = "smooth sliding"
    elif answer and last.amplitude > floor:
        kind = "stick-slip" if fastest >= SLIP_VELOCITY else "sustained oscillation"
    change = math.log(last.amplitude / looks[-2].amplitude) if len(looks) > 1 and last.amplitude > 0 else math.nan
    verdict = Verdict(
        sustained=answer,
        kind=kind,
        reason=reason,
        peak_to_peak=last.amplitude,
        period=last.period,
        largest_velocity=fastest,
        change=change,
        travel=travel,
        linearly_unstable=growing,
    )
    return verdict, ride, last


def _linearly_unstable(rig: Rig) -> bool | None:
    try:
        return count_unstable(rig) > 0
    except (InputError, UndecidedError):  # no steady sliding; on the boundary itself
        return None


def _friction(rig: Rig) -> float:
    """Kinetic friction; that without delay if contacts never re-attach."""
    interface = rig.interface
    if math.isinf(interface.delay.moment(1)):
        interface = replace(interface, delay=Delay(0.0))
    return kinetic_friction(interface, rig.velocity)


def _fate(
    looks: list[Look], floor: float, growing: bool | None, patience: int, scales: Scales | None = None
) -> tuple[bool | None, str] | None:
    """Whether it persists and why, as soon as the looks tell."""

    def said(force: float, digits: int = 3) -> str:
        return in_words(force, "force", scales, digits)

    size = np.array([look.amplitude for look in looks])
    now = said(size[-1], 4)
    if size[-1] < 1e-9 * floor and growing is not True:
        return False, "there is no oscillation left"
    limit = _limit(np.concatenate([look.cycles for look in looks]))
    if limit is not None and size[-1] > floor:
        return True, f"the oscillation of the force settles at {said(limit)}"
    if len(looks) < 3:
        return None
    step = np.diff(np.log(np.maximum(size, 1e-300)))
    if size[-1] < floor:
        if growing is not True and np.all(step[-2:] < 0):
            return False, f"the oscillation of the force decays; it is down to {now}"
    elif np.all(np.abs(step[-3:]) < STEADY) and len(looks) > 3:
        return True, f"the oscillation of the force, {now}, no longer changes"
    elif _left_to_go(step) < REST:
        return True, f"the oscillation of the force settles at {said(size[-1])}"
    elif len(looks) >= 10 and _has_no_trend(size[-8:]):
        return True, f"the oscillation of the force scatters about {said(float(np.median(size[-8:])))} without a trend"
    # What grows slowly from little will arrive; what drifts all one way, through a narrow place, will leave it.
    drifts = bool(np.all(step[-8:] < 0) or np.all(step[-8:] > 0))
    if len(looks) < (5 * patience if growing else 3 * patience if drifts else patience):
        return None
    if growing:
        return (
            True,
            f"smooth sliding is unstable by linear theory; the oscillation of the force, {now} so far, has not settled",
        )
    third = max(len(step) // 3, 2)
    if np.all(step[-2 * third :] < 0) and step[-third:].mean() < step[-2 * third : -third].mean() - STEADY / 10:
        return False, f"the oscillation of the force shrinks ever faster; it is down to {now}"
    return None, f"after {len(looks)} looks the oscillation of the force, {now}, still changes by {step[-1]:.2g} a look"


def _limit(cycles: Array) -> float | None:
    """Amplitude at which the last cycles settle, one by one; None if they do not."""
    last = cycles[-_STEADY_CYCLES - 1 :]
    if last.size <= _STEADY_CYCLES or last.min() <= 0:
        return None
    step = np.diff(np.log(last))
    left = 0.0 if np.all(np.abs(step) < _EACH) else _left_to_go(step, 5, 0.9)
    return float(last[-1] * math.exp(math.copysign(left, step[-1]))) if left < _AHEAD else None


def _left_to_go(step: Array, count: int = 4, slowest: float = 0.7) -> float:
    """Change of ln(amplitude) still ahead if the last steps shrink geometrically, all one way; else infinite."""
    last = step[-count:] * np.sign(step[-1])
    if last.size < count or last.min() <= 0:
        return math.inf
    ratio = float(np.max(last[1:] / last[:-1]))
    return math.inf if ratio > slowest else float(last[-1]) * ratio / (1.0 - ratio)


def _has_no_trend(size: Array) -> bool:
    """Whether amplitudes scatter about a constant: no trend beyond twice its error, and no deep drop."""
    x = np.arange(size.size) - 0.5 * (size.size - 1)
    y = np.log(np.maximum(size, 1e-300))
    slope = float(x @ y / (x @ x))
    rest = y - y.mean() - slope * x
    error = math.sqrt(float(rest @ rest) / (size.size - 2) / float(x @ x))
    return size.min() > 0.5 * size.max() and abs(slope) < 2 * error

"""Whether an oscillation persists: runs until its amplitude settles or decays."""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from stickslip.answers import Answer
from stickslip.arrays import Array
from stickslip.cycles.cycle_run import (
    METHOD,
    CycleRun,
    Look,
    check_rig,
    noise_of,
)
from stickslip.errors import InputError, UndecidedError
from stickslip.loops import bounded
from stickslip.measure.features import TINY
from stickslip.measure.kinds import Kind
from stickslip.measure.slips import SLIP_VELOCITY
from stickslip.model import Delay, FromRest, MasterEquation, Start
from stickslip.model.rig import Rig
from stickslip.sliding import kinetic_friction
from stickslip.stability import count_unstable

# looks after which an amplitude that has not settled is undecided, unless its trend
# decides
# decides
PATIENCE = 60
# amplitude over the strength of the contacts, above which an oscillation that still
# grows is unstable even without their friction
_RUNAWAY = 1e3


class Settles(NamedTuple):
    """Test whether amplitudes have settled: the last changes of their logarithm are
    negligible, or shrink geometrically with little left.
    """

    steps: int  # number of changes considered
    none: float  # a change below this is negligible, by the error of the runs
    ratio: float  # largest ratio of successive changes that counts as shrinking
    ahead: float  # largest change that may still be left

    def at(self, amplitudes: Array) -> float | None:
        """Return the amplitude to which these converge; None if they have not
        settled.
        """
        last = amplitudes[-self.steps - 1 :]
        if last.size <= self.steps or last.min() <= 0:
            return None
        step = np.diff(np.log(last))
        if np.all(np.abs(step) < self.none):
            return float(last[-1])
        step, sign = np.abs(step), np.sign(step)
        ratio = float(np.max(step[1:] / np.maximum(step[:-1], 1e-300)))
        if ratio > self.ratio or np.any(sign != sign[-1]):
            return None
        left = float(step[-1]) * ratio / (1.0 - ratio)
        return (
            float(last[-1] * math.exp(sign[-1] * left)) if left < self.ahead else None
        )


# for single cycles, which are known to the error of the run
CYCLES = Settles(6, 2e-5, 0.9, 1e-3)
# for the median of the cycles in a look, which settles even if cycles alternate
LOOKS = Settles(4, 1e-3, 0.7, 1e-2)


@dataclass(frozen=True, kw_only=True, repr=False)
class Verdict(Answer):
    """Whether an oscillation persists from a start, with the evidence.

    The result is nonlinear, and depends on the start.
    """

    #: None if the evidence does not suffice, for the reason given
    sustained: bool | None

    #: Kind of the final motion. In stick-slip the slider reaches at least 3.5 times the
    #: velocity of the drive, as in `stickslip.measure.regime`.
    kind: Kind

    reason: str  #: reason, in plain words
    #: settled peak to peak of the spring force; if it scatters, the median of the last
    #: looks
    peak_to_peak: float
    period: float  #: NaN without complete cycles
    mean_force: float  #: mean spring force in the last look
    #: largest velocity of the slider in the last looks, over that of the drive
    largest_velocity: float

    #: Whether smooth sliding is unstable by linear theory; None on its boundary, and if
    #: there is no steady sliding.
    linearly_unstable: bool | None

    @property
    def has_cycle(self) -> bool:
        """Whether there is an oscillation that can be followed."""
        return bool(self.sustained) and self.kind != "undecided"

    def __str__(self) -> str:
        return f"{self.kind}: {self.reason}"


def is_sustained(
    rig: Rig,
    *,
    start: Start = FromRest(),
    method: MasterEquation = METHOD,
) -> Verdict:
    """Return whether an oscillation persists from a start, at a constant velocity of
    the drive.

    The run is evaluated every three cycles, by their expected length: the drive travels
    ``<x_s> (1 + k/K)`` in a cycle, or for one period of the slider on its spring,
    whichever is longer. It ends as soon as the outcome is clear. The oscillation
    *persists* if its amplitude no longer changes (by less than 1e-3 in four successive
    looks or by less than 2e-5 in six successive cycles, or with changes that shrink
    geometrically and have less than 1 % left), or scatters about a constant without a
    trend. It *decays* if it is below 2 % of the kinetic friction and shrinks while
    smooth sliding is stable by linear theory. Where smooth sliding is unstable some
    oscillation always persists, and the run finds its amplitude.

    Parameters
    ----------
    rig : Rig
        The rig; its drive moves at its first velocity throughout.
    start : FromRest or FromSliding
        `FromRest` with a narrow distribution of contacts is the paper's start;
        ``FromSliding(perturbation=...)`` tests small perturbations.
    method : MasterEquation
        A linear structure runs on contacts, those of the rig's own method or 10,000.

    Returns
    -------
    Verdict
        Undecided if the amplitude still changes after 60 looks, or three times as many
        if it changes in one direction, without a trend that decides.

    Raises
    ------
    InputError
        If no cycle can be followed on the rig: thresholds that age by `Langevin`, no
        mass, a velocity not above 0.

    Examples
    --------
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1)
    ... )
    >>> rig = ss.Rig(
    ...     interface,
    ...     ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4),
    ...     ss.constant(velocity=1.0),
    ... )
    >>> from stickslip.cycles import is_sustained
    >>> (
    ...     is_sustained(rig).kind,
    ...     is_sustained(rig, start=ss.FromSliding(perturbation=0.05)).kind,
    ... )
    ('stick-slip', 'smooth sliding')
    """
    check_rig(rig, start, method)
    return settle(CycleRun.begin(rig, start, method))[0]


def settle(run: CycleRun) -> tuple[Verdict, CycleRun]:
    """Continue until it is clear whether the oscillation persists."""
    rig = run.rig
    looks = list[Look]()
    growing = linearly_unstable(run.rig)
    floor = TINY * _friction(rig)
    if growing is False:
        floor = max(floor, noise_of(rig))
    outcome: tuple[bool | None, float, str] | None = None
    turns = bounded("settle", 5 * PATIENCE + 3)
    while outcome is None:
        next(turns)
        run, look = run.look()
        looks.append(look)
        outcome = _outcome(looks, floor, growing)
    answer, amplitude, what = outcome
    last = looks[-1]
    fastest = max(look.fastest for look in looks[-2:])
    kind: Kind = "undecided"
    if answer is False:
        kind = "smooth sliding"
    elif answer and amplitude > floor:
        kind = "stick-slip" if fastest >= SLIP_VELOCITY else "sustained oscillation"
    verdict = Verdict(
        sustained=answer,
        kind=kind,
        reason=(
            "the oscillation of the force "
            f"{what.format(rig.in_units(amplitude, 'force', 3 if answer else 4))}"
        ),
        peak_to_peak=amplitude * rig.unit("f_s"),
        period=last.period * rig.unit("time"),
        mean_force=last.mean_force * rig.unit("f_s"),
        largest_velocity=fastest,
        linearly_unstable=growing,
    )
    return verdict, run


def linearly_unstable(rig: Rig) -> bool | None:
    """Return whether smooth sliding is unstable to the smallest perturbation, or None
    if that is not known.
    """
    try:
        return count_unstable(rig) > 0
    except (InputError, UndecidedError):  # no steady sliding, or on the boundary
        return None


def _friction(rig: Rig) -> float:
    """Return the kinetic friction, without delay if contacts never re-attach."""
    interface = rig.interface
    if math.isinf(interface.delay.moment(1)):
        interface = replace(interface, delay=Delay(0.0))
    return kinetic_friction(interface, rig.natural.velocity)


def _outcome(
    looks: list[Look],
    floor: float,
    growing: bool | None,
) -> tuple[bool | None, float, str] | None:
    """Return whether the oscillation persists, its amplitude, and why; None until the
    looks decide.
    """
    size = np.array([look.amplitude for look in looks])
    now = float(size[-1])
    step = np.diff(np.log(np.maximum(size, 1e-300)))
    if now < 1e-9 * floor and growing is not True:
        return False, now, "has decayed; none is left"
    if growing and now > _RUNAWAY and np.all(step[-2:] > 0):
        return True, now, "grows beyond all bounds, {} so far"
    limit = CYCLES.at(np.concatenate([look.cycles for look in looks])) or LOOKS.at(size)
    if limit is not None and now > floor:
        return True, limit, "settles at {}"
    if (
        now < floor
        and growing is not True
        and len(looks) >= 3
        and np.all(step[-2:] < 0)
    ):
        return False, now, "decays; it is down to {}"
    if now > floor and len(looks) >= 10 and _has_no_trend(size[-8:]):
        return True, float(np.median(size[-8:])), "scatters about {} without a trend"
    # An amplitude that grows slowly from a small one will settle eventually; one that
    # drifts in one direction past a fold nearby will leave it.
    drifts = bool(np.all(step[-8:] < 0) or np.all(step[-8:] > 0))
    if len(looks) < max(PATIENCE * (5 if growing else 3 if drifts else 1), 3):
        return None
    if growing:
        return (
            True,
            now,
            (
                "has not settled, {} so far, but smooth sliding is unstable by linear "
                "theory"
            ),
        )
    return (
        None,
        now,
        (
            f"{{}}; after {3 * len(looks)} cycles still changes by "
            f"{100.0 * abs(step[-1]):.2g} % every three"
        ),
    )


def _has_no_trend(size: Array) -> bool:
    """Return whether amplitudes scatter about a constant, with a trend below twice its
    error and without a deep drop.
    """
    (slope, _), covariance = np.polyfit(
        np.arange(size.size),
        np.log(np.maximum(size, 1e-300)),
        1,
        cov=True,
    )
    return bool(
        size.min() > 0.5 * size.max() and abs(slope) < 2.0 * math.sqrt(covariance[0, 0])
    )

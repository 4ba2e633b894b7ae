"""Stick-slip as it lasts: does it, from where, and how far it can be followed. The nonlinear side of stability.

`stickslip.stability` says where smooth sliding is unstable to the smallest disturbance. Stick-slip once started may
live on where smooth sliding is stable. The names keep the two apart: what is *critical* is linear, what is *lasting*
is nonlinear and belongs to a start, and a cycle that is followed dies at its *fold*.

- `is_sustained`: does an oscillation persist from a start? With the evidence.
- `lasting`, `lasting_velocities`, `lasting_delay` (the paper's ``tau*``): where it does, along a parameter, afresh from
  the same start at each value.
- `cycle_branch`: the cycle itself, carried from value to value of a parameter up to where it decays (``v1'`` on the way
  down, ``v2`` on the way up).
- `bistable_band`: between the fold and the linear boundary both smooth sliding and stick-slip last.

All of it rests on forward runs of the master equation on cohorts, Eqs. (1)-(4) and (11). With the 100 cohorts per
``x_s`` of `METHOD` amplitudes are within 1e-3 of those with 200, and thresholds within 3e-3; 50 move ``tau*`` by 1.5 %.

Natural units per contact.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError, UndecidedError, instance, number
from stickslip.io import datasets as store
from stickslip.measure.periods import rises
from stickslip.measure.slips import SLIP_VELOCITY
from stickslip.measure.verdict import TINY, Kind
from stickslip.model import FromRest, FromSliding, MasterEquation, Slider, Start
from stickslip.model.distributions import Distribution
from stickslip.model.parameters import DELAY, VELOCITY, Parameter, check_range, parameter_named
from stickslip.model.rig import Rig
from stickslip.simulation import check_method, initial_nodes, slider_constants, survival_table
from stickslip.stability import Crossings, count_unstable, critical

if TYPE_CHECKING:
    import xarray as xr

    from stickslip.kernels import cohorts as kernel
    from stickslip.kernels.drive import Quadratic
    from stickslip.kernels.oscillator import Slider as Constants

Array = NDArray[np.float64]

METHOD = MasterEquation(cells=100)
"""The fewest cohorts that keep the settled numbers; see above."""

LOOK = 3.0
"""Cycles, by their expected length, between two looks at the amplitude."""
PATIENCE = 60
"""Looks after which what has not settled is undecided, unless its trend tells."""
STEADY = 1e-3
"""Change of ln(amplitude) from look to look that counts as none if it stays so small three times."""
REST = 0.01
"""... and that may still lie ahead, if the changes shrink geometrically."""


# ---------------------------------------------------------------------------------------------------------------------
# Does it last?
# ---------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Whether an oscillation persists from a start, with the evidence. Nonlinear: it belongs to the start.

    Attributes
    ----------
    lasts : bool or None
        None if the evidence does not suffice, for the reason given.
    kind : {"stick-slip", "sustained oscillation", "smooth sliding", "undecided"}
        Of the motion at the end. Stick-slip: the slider reaches at least 3.5 times the velocity of the drive, as in
        `stickslip.measure.regime`.
    reason : str
        Why, in plain words.
    peak_to_peak : float
        Of the spring force at the last look, in ``f_s``: the median cycle.
    period : float
        In time; NaN without complete cycles.
    largest_velocity : float
        Of the slider, in velocities of the drive, at the last look.
    change : float
        Of ln(peak to peak) from the last look but one to the last; NaN with one look.
    travel : float
        Of the drive, in ``x_s``, up to the verdict.
    linearly_unstable : bool or None
        Whether smooth sliding is unstable by itself there; None on its very boundary, and if there is no steady
        sliding.
    """

    lasts: bool | None
    kind: Kind
    reason: str
    peak_to_peak: float
    period: float
    largest_velocity: float
    change: float
    travel: float
    linearly_unstable: bool | None

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
    oscillation *lasts* if its amplitude no longer changes (by less than 1e-3 three times running, or with changes
    that shrink geometrically and have less than 1 % left to go), or wavers without a trend. It *dies* if it is below
    2 % of the kinetic friction and shrinks while smooth sliding is stable by linear theory. Where smooth sliding is
    unstable some oscillation always persists; the run then tells which.

    Parameters
    ----------
    interface, slider
        The rig.
    velocity : float
        Of the drive, in ``x_s`` per time.
    start : Relaxed or Sliding
        `FromRest` contacts with a narrow distribution are the paper's start; ``FromSliding(perturbation=...)`` asks for
        small disturbances.
    method : MasterEquation
    patience : int
        Looks after which to give up, at 3 cycles each; up to five times as many while the amplitude drifts one way.

    Returns
    -------
    Verdict
        Undecided where the amplitude still drifts after all looks, and its trend does not tell where to.
    """
    natural = _check(rig, method)
    instance("is_sustained: start", start, FromRest | FromSliding, "FromRest() or FromSliding(...)")
    return _settle(_Ride.begin(natural, start, method), patience)[0].in_units(rig)


def _check(rig: Rig, method: MasterEquation) -> Rig:
    """The rig in natural units, if a cycle can be followed on it."""
    instance("rig", rig, Rig, "a Rig(interface, slider, drive)")
    natural = rig.natural
    interface = natural.interface
    instance("Rig.slider", natural.slider, Slider, "a Slider")
    instance("cycles: method", method, MasterEquation, "MasterEquation(...)")
    if method.memoryless:
        raise InputError("MasterEquation.memoryless: without memory the oscillation is spurious; leave it False here")
    if interface.ageing is not None:
        raise InputError(
            f"Interface.ageing = {interface.ageing}: cycles are followed for contacts that do not age only"
        )
    check_method(interface, method)
    if natural.slider.mass == 0:
        raise InputError("Slider.mass = 0: a cycle needs a mass above 0; the massless limit is for `stability` only")
    number("velocity", natural.velocity, above=0, hint="x_s per time")
    return natural


def _range(
    rig: Rig, parameter: Parameter | str, between: tuple[float, float], method: MasterEquation
) -> tuple[Parameter, Rig, float, float]:
    """The parameter, the rig and the range, in natural units."""
    natural, varied = _check(rig, method), parameter_named(parameter)
    low, high = check_range(varied, between)
    size = rig.unit(varied.unit)
    return varied, natural, low / size, high / size


def _scaled(values: tuple[float, float], size: float) -> tuple[float, float]:
    return values[0] * size, values[1] * size


class _Look(NamedTuple):
    """What a stretch of a few cycles shows."""

    amplitude: float
    period: float
    fastest: float
    mean_force: float
    travel: float


@dataclass(frozen=True, eq=False)
class _Ride:
    """A rig on its way: where it is, and all that moves it on. Immutable, so that one can go back and try again."""

    rig: Rig
    cells: int
    table: kernel.Table
    delays: kernel.Delays
    slider: Constants
    drive: Quadratic
    state: kernel.State
    cycle: float  # expected travel of the drive in one

    @classmethod
    def begin(cls, rig: Rig, start: Start, method: MasterEquation) -> _Ride:
        from stickslip.kernels import cohorts as kernel
        from stickslip.kernels.drive import Quadratic

        interface, slider, velocity = rig.interface, rig.slider, rig.velocity
        table, delays = _table(interface.threshold_distribution), kernel.Delays(*interface.delay.quadrature())
        if isinstance(start, FromRest):
            x, share = initial_nodes(interface)
            speed = rate = 0.0
        else:
            mean, delay = interface.threshold_distribution.moment(1), interface.delay.moment(1)
            if math.isinf(delay):
                raise InputError("FromSliding: contacts that never re-attach have no steady sliding; start FromRest()")
            rate = velocity / (mean + velocity * delay)
            x, share = kernel.smooth_sliding(table, method.cells, mean / (mean + velocity * delay))
            speed = velocity * (1.0 + start.perturbation)
        state = kernel.initial_state(table, delays, x, share, velocity=speed, rate=rate)
        balance = 0.0
        if isinstance(start, FromSliding):
            drag = slider.mass * slider.damping * velocity
            balance = (float(state.scalar[kernel.CONTACT_FORCE]) + drag) / slider.stiffness
        return cls(
            rig=rig,
            cells=method.cells,
            table=table,
            delays=delays,
            slider=slider_constants(slider),
            drive=Quadratic(0.0, balance, velocity, 0.0),
            state=state,
            cycle=_cycle(rig),
        )

    def on(self, travel: float) -> tuple[_Ride, Array]:
        """Go on by a travel of the drive; with times, spring force and slider velocity of fine samples, as rows."""
        from stickslip.kernels import cohorts as kernel

        slider, velocity = self.rig.slider, self.rig.velocity
        begin, duration = float(self.state.scalar[kernel.TIME]), travel / velocity
        each = self.cycle / velocity
        # A slip lasts about half a period of the slider on its spring; a cap keeps very quick slips affordable.
        count = math.ceil(duration / max(min(each / 200, 0.3 / slider.frequency), each / 4000))
        times = begin + duration * np.arange(1, count + 1) / count
        done = kernel.advance(
            self.state,
            self.table,
            self.delays,
            self.slider,
            self.drive,
            until=begin + duration,
            times=times,
            cells=self.cells,
        )
        rows = done.rows[:, [kernel.TIME, kernel.DRIVE_FORCE, kernel.VELOCITY]].T
        return replace(self, state=done.state), rows

    def look(self) -> tuple[_Ride, _Look]:
        """Go on for a few cycles and say what they show; stretches of the drive too short for that are doubled."""
        travel = LOOK * self.cycle
        ride, rows = self.on(travel)
        cycles = _cycles(rows, ride.slider.stiffness, ride.rig.velocity)
        _, force, speed = rows
        fastest = float(speed.max()) / ride.rig.velocity
        if cycles.shape[1] == 0:
            oscillation = float(np.ptp(force))
            if oscillation > TINY:  # cycles longer than expected
                ride = replace(ride, cycle=2.0 * ride.cycle)
            return ride, _Look(oscillation, math.nan, fastest, float(force.mean()), travel)
        oscillation, period, mean = np.median(cycles[0]), np.mean(cycles[1]), np.average(cycles[2], weights=cycles[1])
        return ride, _Look(float(oscillation), float(period), fastest, float(mean), travel)

    def turn(self, rig: Rig) -> _Ride:
        """Change the rig or the drive under way: forces, positions and masses stay, the drive goes on from where it is.

        Contacts that are detached stay so for the same fraction of the new delay. Cohorts keep what is attached of
        them.
        """
        from stickslip.kernels import cohorts as kernel
        from stickslip.kernels.drive import Quadratic

        slider = rig.slider
        table, delays = self.table, self.delays
        scalar, cohort, broken = self.state.scalar.copy(), self.state.cohort.copy(), self.state.broken.copy()
        cursor, used = self.state.cursor.copy(), self.state.used.copy()
        if rig.interface.delay != self.rig.interface.delay:
            delays = kernel.Delays(*rig.interface.delay.quadrature())
            ratio = _stretched(self.delays, delays)
            n = used[1]
            broken[0, :n] = scalar[kernel.TIME] - ratio * (scalar[kernel.TIME] - broken[0, :n])
            cursor[:] = 0
        if rig.interface.thresholds != self.rig.interface.thresholds:
            table = _table(rig.interface.threshold_distribution)
            n = used[0]
            share = np.array([kernel.survival(table, reach) for reach in cohort[kernel.REACH, :n]])
            held = share > kernel.EXTINCT  # the others break as soon as they are stretched further
            cohort[kernel.MASS, :n] = np.where(held, cohort[kernel.ALIVE, :n] / np.where(held, share, 1.0), 0.0)
        at = float(scalar[kernel.POSITION] + scalar[kernel.DRIVE_FORCE] / slider.stiffness)
        return replace(
            self,
            rig=rig,
            table=table,
            delays=delays,
            slider=slider_constants(slider),
            drive=Quadratic(float(scalar[kernel.TIME]), at, rig.velocity, 0.0),
            state=kernel.State(scalar, cohort, broken, cursor, used),
            cycle=self.cycle / _cycle(self.rig) * _cycle(rig),
        )


def _table(distribution: Distribution) -> kernel.Table:
    from stickslip.kernels import cohorts as kernel

    return kernel.tabulate(*survival_table(distribution))


def _cycle(rig: Rig) -> float:
    """Expected travel of the drive in a cycle: loading by a threshold, or an oscillation of the slider on its spring."""
    slider: Slider = rig.slider
    stretch = rig.interface.threshold_distribution.moment(1)
    return max(stretch * (1.0 + 1.0 / slider.stiffness), rig.velocity * 2.0 * math.pi / slider.frequency)


def _stretched(old: kernel.Delays, new: kernel.Delays) -> float:
    """Ratio of two distributions of delays that differ in scale only."""
    if old.time.size == new.time.size and old.time.size and np.allclose(old.weight, new.weight, rtol=1e-6):
        ratio = float(new.time.max() / old.time.max()) if old.time.max() > 0 else math.nan
        if np.allclose(new.time, ratio * old.time, rtol=1e-6) and ratio > 0:
            return ratio
    raise InputError(
        "Interface.delay: a cycle can be carried over only to a delay that is the old one scaled (the parameter DELAY does "
        "that); use is_sustained() afresh at each value"
    )


def _cycles(rows: Array, stiffness: float, velocity: float) -> Array:
    """Swing of the spring force, period and mean force of each complete cycle: shape (3, n).

    A cycle goes from one rise through three quarters of the range to the next, with a fall below one quarter in
    between. The extremes lie where the slider is as fast as the drive, between the samples.
    """
    t, force, speed = rows
    low, high = float(force.min()), float(force.max())
    risen, times = rises(t, force, 0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high)
    if risen.size < 2:
        return np.empty((3, 0))
    slope = stiffness * (velocity - speed)
    oscillations, means = [], []
    for a, b in itertools.pairwise(risen.tolist()):
        part = force[a : b + 1]
        top, bottom = (_extreme(t, force, slope, a + int(i)) for i in (np.argmax(part), np.argmin(part)))
        oscillations.append(top - bottom)
        means.append(float(part[1:].mean()))
    return np.array([oscillations, np.diff(times), means])


def _extreme(t: Array, force: Array, slope: Array, i: int) -> float:
    """Value where the slope changes sign next to a sample, by a parabola."""
    for j in (i, i - 1):
        if 0 <= j < t.size - 1 and slope[j] * slope[j + 1] < 0:
            way = slope[j] / (slope[j] - slope[j + 1]) * (t[j + 1] - t[j])
            return float(force[j] + 0.5 * way * slope[j])
    return float(force[i])


def _settle(ride: _Ride, patience: int = PATIENCE) -> tuple[Verdict, _Ride, _Look]:
    """Go on until it is clear whether the oscillation persists."""
    rig, travel, growing = ride.rig, 0.0, _linearly_unstable(ride.rig)
    floor = TINY * _friction(rig)
    looks: list[_Look] = []
    fate: tuple[bool | None, str] | None = None
    while fate is None:
        ride, look = ride.look()
        looks.append(look)
        travel += look.travel
        fate = _fate(looks, floor, growing, patience)
    last, (answer, reason) = looks[-1], fate
    fastest = max(look.fastest for look in looks[-2:])
    kind: Kind = "undecided"
    if answer is False:
        kind = "smooth sliding"
    elif answer and last.amplitude > floor:
        kind = "stick-slip" if fastest >= SLIP_VELOCITY else "sustained oscillation"
    change = math.log(last.amplitude / looks[-2].amplitude) if len(looks) > 1 and last.amplitude > 0 else math.nan
    verdict = Verdict(
        lasts=answer,
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
    """Kinetic friction ``<x_s^2>/(2 (<x_s> + v <tau>))``; that without delay if contacts never re-attach."""
    distribution, delay = rig.interface.threshold_distribution, rig.interface.delay.moment(1)
    detached = rig.velocity * delay if math.isfinite(delay) else 0.0
    return distribution.moment(2) / (2.0 * (distribution.moment(1) + detached))


def _fate(looks: list[_Look], floor: float, growing: bool | None, patience: int) -> tuple[bool | None, str] | None:
    """Whether it lasts and why, as soon as the looks tell."""
    size = np.array([look.amplitude for look in looks])
    now = f"{size[-1]:.4g} f_s"
    if size[-1] < 1e-9 * floor and growing is not True:
        return False, "there is no oscillation left"
    if len(looks) < 3:
        return None
    step = np.diff(np.log(np.maximum(size, 1e-300)))
    if size[-1] < floor:
        if growing is not True and np.all(step[-2:] < 0):
            return False, f"the oscillation of the force decays; it is down to {now}"
    elif np.all(np.abs(step[-3:]) < STEADY) and len(looks) > 3:
        return True, f"the oscillation of the force, {now}, no longer changes"
    elif _left_to_go(step) < REST:
        return True, f"the oscillation of the force settles at {size[-1]:.3g} f_s"
    elif len(looks) >= 10 and _wavers(size[-8:]):
        return True, f"the oscillation of the force wavers about {np.median(size[-8:]):.3g} f_s without a trend"
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


def _left_to_go(step: Array) -> float:
    """Change of ln(amplitude) still ahead if the last four steps shrink geometrically, all one way; else infinite."""
    last = step[-4:] * np.sign(step[-1])
    if last.size < 4 or last.min() <= 0:
        return math.inf
    ratio = float(np.max(last[1:] / last[:-1]))
    return math.inf if ratio > 0.7 else float(last[-1]) * ratio / (1.0 - ratio)


def _wavers(size: Array) -> bool:
    """Whether amplitudes scatter about a constant: no trend beyond twice its error, and no deep fall."""
    x = np.arange(size.size) - 0.5 * (size.size - 1)
    y = np.log(np.maximum(size, 1e-300))
    slope = float(x @ y / (x @ x))
    rest = y - y.mean() - slope * x
    error = math.sqrt(float(rest @ rest) / (size.size - 2) / float(x @ x))
    return size.min() > 0.5 * size.max() and abs(slope) < 2 * error


# ---------------------------------------------------------------------------------------------------------------------
# Where it lasts
# ---------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Edge:
    """An end of a stretch of a parameter in which an oscillation persists (nonlinear).

    Attributes
    ----------
    value : float
        Middle of the bracket.
    dies_at, lasts_at : float
        The bracket: runs on either side of the edge. Equal at an end of the range searched.
    end_of_range : bool
        The oscillation persists up to the end of the range: the edge lies outside it.
    """

    value: float
    dies_at: float
    lasts_at: float
    end_of_range: bool = False

    def scaled(self, size: float) -> Edge:
        """Return the edge in a unit that is smaller by a factor."""
        return replace(self, value=self.value * size, dies_at=self.dies_at * size, lasts_at=self.lasts_at * size)

    def __float__(self) -> float:
        return self.value

    def __str__(self) -> str:
        if self.end_of_range:
            return f"{self.value:.4g} (end of the range searched)"
        return f"{self.value:.4g} (± {0.5 * abs(self.dies_at - self.lasts_at):.1g})"


@dataclass(frozen=True, kw_only=True)
class Window:
    """A stretch of a parameter in which an oscillation persists."""

    low: Edge
    high: Edge

    def __str__(self) -> str:
        return f"from {self.low} to {self.high}"


@dataclass(frozen=True, kw_only=True)
class Sustained:
    """Where an oscillation persists along a parameter, afresh from the same start at each value; nowhere is an answer too.

    Attributes
    ----------
    parameter, unit : str
    searched : (float, float)
    start : Relaxed or Sliding
    windows : tuple of Window
        Rising. Windows narrower than the grid of the search may be missed.
    grid : tuple of (float, Verdict)
        The runs of the grid.
    undecided : tuple of float
        Values at which a run could not tell.
    """

    parameter: str
    unit: str
    searched: tuple[float, float]
    start: Start
    windows: tuple[Window, ...]
    grid: tuple[tuple[float, Verdict], ...]
    undecided: tuple[float, ...] = ()

    def in_units(self, rig: Rig) -> Sustained:
        """Return what was found in natural units in those of a rig."""
        if rig.scales is None:
            return self
        size = rig.unit(self.unit)
        return replace(
            self,
            unit=rig.scales.si_name(self.unit),
            searched=_scaled(self.searched, size),
            windows=tuple(Window(low=w.low.scaled(size), high=w.high.scaled(size)) for w in self.windows),
            grid=tuple((value * size, verdict.in_units(rig)) for value, verdict in self.grid),
            undecided=tuple(value * size for value in self.undecided),
        )

    def __iter__(self) -> Iterator[Window]:
        return iter(self.windows)

    def __len__(self) -> int:
        return len(self.windows)

    def __str__(self) -> str:
        low, high = self.searched
        where = f"for {self.parameter} from {low:g} to {high:g} {self.unit}, from {self.start}"
        doubt = f"; undecided at {', '.join(f'{v:.4g}' for v in self.undecided)}" if self.undecided else ""
        if not self.windows:
            return f"no oscillation persists {where} ({len(self.grid)} runs){doubt}"
        return f"{where}, an oscillation persists {' and '.join(map(str, self.windows))}{doubt}"


def sustained(
    rig: Rig,
    parameter: Parameter | str,
    *,
    between: tuple[float, float],
    start: Start = FromRest(),
    points: int = 8,
    tolerance: float = 2e-3,
    method: MasterEquation = METHOD,
) -> Sustained:
    """Find where an oscillation persists along a parameter, afresh from the same start at each value (nonlinear).

    From a narrow start the lower edge along the velocity is where stick-slip decays on the way down, the paper's ``v1'``,
    and the upper edge where it decays on the way up, ``v2``; the velocities at which smooth sliding loses stability
    (``v1``, and ``v2'`` on the way down) are linear: `stickslip.stability.critical`.

    Parameters
    ----------
    parameter : Parameter or str
        As in `stickslip.stability.critical`.
    rig : Rig
        The parameter's own value in it does not matter.
    between : (float, float)
        Range searched, in the rig's own units, both above 0.
    start : Relaxed or Sliding
    points : int
        Runs per factor of 10, on a logarithmic grid; edges between two of them are found by halving.
    tolerance : float
        Relative width of the bracket about an edge.
    method : MasterEquation
    """
    turned, natural, low, high = _range(rig, parameter, between, method)
    tolerance = number("tolerance", tolerance, above=0, below=1)
    probe = _Probe(turned, natural, start, method)
    count = max(2, math.ceil(points * math.log10(high / low)) + 1)
    values = np.geomspace(low, high, count).tolist()
    values[0], values[-1] = low, high
    grid = [(value, probe(value)) for value in values]
    windows: list[Window] = []
    decided = [(value, verdict.lasts) for value, verdict in grid if verdict.lasts is not None]
    opened: Edge | None = None
    for i, (value, on) in enumerate(decided):
        before = decided[i - 1] if i else None
        if on and opened is None:
            opened = _edge(probe, before[0], value, tolerance) if before else _end(value)
        elif not on and opened is not None and before:
            windows.append(Window(low=opened, high=_edge(probe, value, before[0], tolerance)))
            opened = None
    if opened is not None:
        windows.append(Window(low=opened, high=_end(decided[-1][0])))
    found = Sustained(
        parameter=turned.name,
        unit=turned.unit,
        searched=(low, high),
        start=start,
        windows=tuple(windows),
        grid=tuple(grid),
        undecided=tuple(sorted(probe.undecided)),
    )
    return found.in_units(rig)


@dataclass(frozen=True, kw_only=True)
class SustainedOnset:
    """The smallest value of a parameter with which an oscillation is sustained from a start (nonlinear).

    Attributes
    ----------
    parameter : str
    value : float
        Middle of the bracket, in the rig's own units.
    dies_at, lasts_at : float
        The bracket.
    start : Relaxed or Sliding
    linear : float or None
        The linear onset beside it: where smooth sliding itself becomes unstable; None if it does not in the
        range.
    searched : (float, float)
    verdict : Verdict
        Of the run at `lasts_at`.
    """

    parameter: str
    value: float
    dies_at: float
    lasts_at: float
    start: Start
    linear: float | None
    searched: tuple[float, float]
    verdict: Verdict

    def in_units(self, rig: Rig) -> SustainedOnset:
        """Return what was found in natural units in those of a rig."""
        size = rig.unit(parameter_named(self.parameter).unit)
        return replace(
            self,
            value=self.value * size,
            dies_at=self.dies_at * size,
            lasts_at=self.lasts_at * size,
            linear=None if self.linear is None else self.linear * size,
            searched=_scaled(self.searched, size),
            verdict=self.verdict.in_units(rig),
        )

    def __float__(self) -> float:
        return self.value

    def __str__(self) -> str:
        linear = "none in the range" if self.linear is None else f"{self.linear:.6g}"
        return (
            f"{self.parameter} {self.value:.4g} (nonlinear: from {self.start} an oscillation decays at {self.dies_at:.4g} "
            f"and lasts at {self.lasts_at:.4g}); linear onset: {linear}"
        )


def sustained_onset(
    rig: Rig,
    parameter: Parameter | str = DELAY,
    *,
    between: tuple[float, float],
    start: Start = FromRest(),
    tolerance: float = 2e-3,
    method: MasterEquation = METHOD,
) -> SustainedOnset:
    """Return the smallest value of a parameter with which stick-slip is sustained from a given start (nonlinear).

    Along the delay this is the paper's critical delay ``tau*``. Not the linear one of `stickslip.stability.onset`, at
    which smooth sliding itself becomes unstable; that is given beside it. Values are tried upwards in steps of 1.4, then
    the edge is halved.

    Parameters
    ----------
    rig : Rig
        A `RandomDelay` is scaled as a whole, and the answer is its mean; the present value does not matter otherwise.
    parameter : Parameter or str
    between : (float, float)
        Range searched, in the rig's own units.
    start : FromRest or FromSliding
        The paper's is `FromRest`, with a narrow distribution of initial stretchings.
    tolerance : float
        Relative width of the bracket.
    method : MasterEquation

    Raises
    ------
    UndecidedError
        If no oscillation persists in the range, or one persists at its lower end already, or the runs cannot tell; the
        message gives the range and the evidence.
    """
    varied, natural, low, high = _range(rig, parameter, between, method)
    tolerance = number("tolerance", tolerance, above=0, below=1)
    crossings = critical(natural, varied, between=(low, high))
    linear = next((c.value for c in crossings.edges if c.loses_stability), None)
    if linear is not None:
        high = min(high, 1.01 * linear)
    probe = _Probe(varied, natural, start, method)
    dead: float | None = None
    value, verdict = low, probe(low)
    while not verdict.lasts:
        if verdict.lasts is False:
            dead = value
        if value >= high:
            doubt = f"; undecided at {', '.join(f'{v:.4g}' for v in probe.undecided)}" if probe.undecided else ""
            raise UndecidedError(
                f"no sustained onset: from {start} no oscillation persists for {varied.name} from {low:g} to {high:g} "
                f"(at the last: {verdict}){doubt}"
            )
        value = min(1.4 * value, high)
        verdict = probe(value)
    if dead is None:
        raise UndecidedError(
            f"no sustained onset: at {value:g}, the low end of the range searched ({low:g} to {high:g}), an oscillation "
            f"lasts ({verdict}); lower it"
        )
    edge = _edge(probe, dead, value, tolerance)
    found = SustainedOnset(
        parameter=varied.name,
        value=edge.value,
        dies_at=edge.dies_at,
        lasts_at=edge.lasts_at,
        start=start,
        linear=linear,
        searched=(low, high),
        verdict=probe.known[edge.lasts_at],
    )
    return found.in_units(rig)


class _Probe:
    """Runs along a parameter, each afresh from the start, remembered."""

    def __init__(self, parameter: Parameter, rig: Rig, start: Start, method: MasterEquation) -> None:
        self.parameter, self.rig, self.start, self.method = parameter, rig, start, method
        self.known: dict[float, Verdict] = {}

    def __call__(self, value: float) -> Verdict:
        if value not in self.known:
            there = self.parameter.set(self.rig, value)
            self.known[value] = _settle(_Ride.begin(there, self.start, self.method))[0]
        return self.known[value]

    @property
    def undecided(self) -> list[float]:
        return [value for value, verdict in self.known.items() if verdict.lasts is None]


def _edge(probe: Callable[[float], Verdict], dead: float, alive: float, tolerance: float) -> Edge:
    """Halve between a value where it decays and one where it lasts; where runs cannot tell, come as near as possible."""
    doubt: tuple[float, float] | None = None  # the end towards `dead`, the end towards `alive`
    while True:
        gaps = [(dead, alive)] if doubt is None else [(dead, doubt[0]), (doubt[1], alive)]
        one, two = max(gaps, key=lambda gap: abs(math.log(gap[0] / gap[1])))
        if abs(math.log(one / two)) <= tolerance:
            return Edge(value=math.sqrt(dead * alive), dies_at=dead, lasts_at=alive)
        middle = math.sqrt(one * two)
        answer = probe(middle).lasts
        if answer is False:
            dead = middle
        elif answer:
            alive = middle
        elif doubt is None:
            doubt = middle, middle
        else:
            doubt = (middle, doubt[1]) if one == dead else (doubt[0], middle)


def _end(value: float) -> Edge:
    return Edge(value=value, dies_at=value, lasts_at=value, end_of_range=True)


# ---------------------------------------------------------------------------------------------------------------------
# The cycle, followed
# ---------------------------------------------------------------------------------------------------------------------


class _Point(NamedTuple):
    """The settled cycle at one value of a parameter."""

    value: float
    verdict: Verdict
    look: _Look
    ride: _Ride


def cycle_branch(
    rig: Rig,
    parameter: Parameter | str = VELOCITY,
    *,
    between: tuple[float, float],
    begin: float | None = None,
    start: Start = FromRest(),
    step: float = 0.05,
    tolerance: float = 2e-3,
    method: MasterEquation = METHOD,
) -> xr.Dataset:
    """Follow the cycle of stick-slip in a parameter, both ways, up to where it decays (nonlinear).

    The motion is carried on from value to value: the parameter is turned by a step, the motion settles again. Where it
    decays the step is halved and taken back, until the end of the branch is known to the tolerance. A cycle of finite
    amplitude ends in a fold, where it meets an unstable cycle; forward runs do not go round it. Turned slowly down,
    the velocity ends at ``v1'``, and turned up at ``v2`` if there is one.

    Parameters
    ----------
    rig : Rig
    parameter : Parameter or str
    between : (float, float)
        Range of the parameter, in the rig's own units, both ends above 0.
    begin : float, optional
        Value at which to look for the cycle first, from `start`; by default that of the rig, or, if no
        oscillation persists there, the first at which one does of 17 over the range.
    start : Relaxed or Sliding
    step : float
        Largest change of the parameter at once, as a fraction of it.
    tolerance : float
        Relative width of the bracket about the ends of the branch.
    method : MasterEquation

    Returns
    -------
    xarray.Dataset
        Along the parameter, rising: ``amplitude`` (peak to peak of the spring force), ``period``, ``largest_velocity``
        of the slider, ``mean_force``, and ``linearly_unstable`` (whether smooth sliding is, there). Attributes:
        ``low_end`` and ``high_end`` ("fold", "end of range", "shrinks to nothing" or "undecided"), and the brackets
        ``low_dies_at``, ``low_lasts_at``, ``high_dies_at``, ``high_lasts_at``.

    Raises
    ------
    UndecidedError
        If no oscillation persists at `begin`, or anywhere that was looked.
    """
    import xarray as xr

    turned, natural, low, high = _range(rig, parameter, between, method)
    size = rig.unit(turned.unit)
    begin = None if begin is None else number("begin", begin, above=0, hint=turned.unit) / size
    first = _first_point(turned, natural, low, high, begin, start, method)
    down, low_edge, low_end = _follow(turned, first, low, step, tolerance)
    up, high_edge, high_end = _follow(turned, first, high, step, tolerance)
    points = [*reversed(down), first, *up]
    speeds = np.array([point.ride.rig.velocity for point in points])

    def along(values: list[float] | Array, units: str, name: str) -> tuple[str, Array, dict[str, str]]:
        return turned.name, np.asarray(values), {"units": units, "long_name": name}

    unstable = [math.nan if p.verdict.linearly_unstable is None else float(p.verdict.linearly_unstable) for p in points]
    arguments = {
        "rig": natural,
        "parameter": turned.name,
        "between": [low, high],
        "start": start,
        "method": method,
    }
    branch = xr.Dataset(
        {
            "amplitude": along(
                [p.look.amplitude for p in points], "f_s", "peak to peak of the spring force, per contact"
            ),
            "period": along([p.look.period for p in points], "time", "period of the cycle"),
            "largest_velocity": along(
                speeds * [p.verdict.largest_velocity for p in points], "x_s/time", "largest velocity of the slider"
            ),
            "mean_force": along([p.look.mean_force for p in points], "f_s", "mean spring force, per contact"),
            "linearly_unstable": along(unstable, "1", "whether smooth sliding is unstable by linear theory"),
        },
        coords={turned.name: along([p.value for p in points], turned.unit, turned.name)},
        attrs={
            "low_end": low_end,
            "low_dies_at": low_edge.dies_at * size,
            "low_lasts_at": low_edge.lasts_at * size,
            "high_end": high_end,
            "high_dies_at": high_edge.dies_at * size,
            "high_lasts_at": high_edge.lasts_at * size,
            "provenance": store.provenance("cycle_branch", arguments),
        },
    )
    return rig.in_its_units(branch)


def _first_point(
    parameter: Parameter,
    rig: Rig,
    low: float,
    high: float,
    begin: float | None,
    start: Start,
    method: MasterEquation,
) -> _Point:
    own = (
        parameter.get(rig) if begin is None else number("begin", begin, at_least=low, at_most=high, hint=parameter.unit)
    )
    values = [own] if low <= own <= high else []
    if begin is None:
        std = np.geomspace(low, high, 17).tolist()
        std[0], std[-1] = low, high
        values += sorted(std, key=lambda value: abs(math.log(value / math.sqrt(low * high))))
    for value in dict.fromkeys(values):
        verdict, ride, look = _settle(_Ride.begin(parameter.set(rig, value), start, method))
        if verdict.lasts and verdict.kind != "undecided":
            return _Point(value, verdict, look, ride)
    raise UndecidedError(
        f"no cycle to follow: from {start} no oscillation persists at {parameter.name} = "
        f"{', '.join(f'{v:.4g}' for v in values)}; the last: {verdict}"
    )


def _follow(
    parameter: Parameter, first: _Point, until: float, step: float, tolerance: float
) -> tuple[list[_Point], Edge, str]:
    """Carry the cycle on towards a value; the points, the end and what it is."""
    points, here = [], first
    way = 1.0 if until > first.value else -1.0
    stride = largest = math.log1p(number("step", step, above=0, below=1))
    dead: float | None = None
    died_unstable: bool | None = None
    while abs(math.log(until / here.value)) > 1e-12:
        value = here.value * math.exp(way * stride)
        if way * (value - until) > -1e-12 * until:
            value = until
        verdict, ride, look = _settle(here.ride.turn(parameter.set(here.ride.rig, value)))
        if verdict.lasts and verdict.kind != "undecided":
            here = _Point(value, verdict, look, ride)
            points.append(here)
            if dead is not None:
                stride = 0.5 * abs(math.log(dead / value))
        elif verdict.lasts is False:
            dead, died_unstable = value, verdict.linearly_unstable
            stride = 0.5 * abs(math.log(dead / here.value))
        else:
            dead = value if dead is None else dead
            return points, _bracket(dead, here.value), "undecided"
        if dead is not None and abs(math.log(dead / here.value)) <= tolerance:
            # Where smooth sliding turns stable just as the cycle dies, the one has become the other.
            gone = here.verdict.linearly_unstable and not died_unstable
            return points, _bracket(dead, here.value), "shrinks to nothing" if gone else "fold"
        if dead is None:
            stride = min(stride, largest)
    return points, _end(here.value), "end of range"


def _bracket(dead: float, alive: float) -> Edge:
    return Edge(value=math.sqrt(dead * alive), dies_at=dead, lasts_at=alive)


# ---------------------------------------------------------------------------------------------------------------------
# Where both last
# ---------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Bound:
    """One end of a bistable band.

    Attributes
    ----------
    value : float
    kind : {"fold", "linear", "end of range", "shrinks to nothing", "undecided"}
        *Fold*: stick-slip decays there (nonlinear). *Linear*: smooth sliding loses stability there.
    error : float
        Half the width of its bracket; 0 for a linear bound.
    """

    value: float
    kind: str
    error: float = 0.0

    def scaled(self, size: float) -> Bound:
        """Return the bound in a unit that is smaller by a factor."""
        return replace(self, value=self.value * size, error=self.error * size)

    def __str__(self) -> str:
        what = {"fold": "stick-slip decays: fold", "linear": "smooth sliding loses stability: linear"}.get(
            self.kind, self.kind
        )
        return f"{self.value:.5g} ({what})"


@dataclass(frozen=True, kw_only=True)
class Band:
    """A stretch of a parameter in which both smooth sliding and stick-slip last, each by itself."""

    low: Bound
    high: Bound

    def __contains__(self, value: float) -> bool:
        return self.low.value <= value <= self.high.value

    def __str__(self) -> str:
        return f"from {self.low} to {self.high}"


@dataclass(frozen=True, kw_only=True)
class BistableRange:
    """Where along a parameter both smooth sliding and stick-slip last; nowhere is an answer too.

    Attributes
    ----------
    parameter, unit : str
    searched : (float, float)
    bands : tuple of Band
        Rising.
    crossings : Crossings
        The linear boundaries in the range.
    notes : tuple of str
        What was looked at and found to be no band, and why.
    """

    parameter: str
    unit: str
    searched: tuple[float, float]
    bands: tuple[Band, ...]
    crossings: Crossings
    notes: tuple[str, ...] = ()

    def in_units(self, rig: Rig) -> BistableRange:
        """Return what was found in natural units in those of a rig."""
        if rig.scales is None:
            return self
        size = rig.unit(self.unit)
        return replace(
            self,
            unit=rig.scales.si_name(self.unit),
            searched=_scaled(self.searched, size),
            bands=tuple(Band(low=band.low.scaled(size), high=band.high.scaled(size)) for band in self.bands),
            crossings=self.crossings.in_units(rig),
        )

    def __bool__(self) -> bool:
        return bool(self.bands)

    def __iter__(self) -> Iterator[Band]:
        return iter(self.bands)

    def __contains__(self, value: float) -> bool:
        return any(value in band for band in self.bands)

    def __str__(self) -> str:
        low, high = self.searched
        where = f"for {self.parameter} from {low:g} to {high:g} {self.unit}"
        if not self.bands:
            return "\n".join([f"no bistable band found {where}", *self.notes])
        found = " and ".join(map(str, self.bands))
        return "\n".join([f"{where}, both smooth sliding and stick-slip last {found}", *self.notes])


def bistable_range(
    rig: Rig,
    parameter: Parameter | str = VELOCITY,
    *,
    between: tuple[float, float],
    start: Start = FromRest(),
    step: float = 0.05,
    tolerance: float = 2e-3,
    method: MasterEquation = METHOD,
) -> BistableRange:
    """Find where both smooth sliding and stick-slip last: between the cycle's fold and the linear boundary.

    At each value where smooth sliding loses stability (linear) the cycle is taken up on the unstable side and
    followed to the stable side until it decays. If there is no such value, the cycle is looked for from `start` on a
    grid of 17 values.

    Parameters
    ----------
    rig : Rig
        The parameter's own value in it does not matter.
    parameter : Parameter or str
    between : (float, float)
        Range searched, in the rig's own units.
    start : Relaxed or Sliding
        From where the cycle is taken up.
    step, tolerance : float
        As in `cycle_branch`.
    method : MasterEquation

    Returns
    -------
    BistableRange
        With the range searched. A cycle that lives apart from every linear boundary, beside one that has a boundary,
        is not looked for.
    """
    turned, natural, low, high = _range(rig, parameter, between, method)
    crossings = critical(natural, turned, between=(low, high))
    bands: list[Band] = []
    notes: list[str] = []
    edges = crossings.edges
    for i, edge in enumerate(edges):
        downwards = edge.loses_stability  # smooth sliding is stable below
        ends = [low, *(other.value for other in edges), high]
        furthest = ends[i] if downwards else ends[i + 2]
        beyond = 1.0 + (0.01 if downwards else -0.01)
        value = min(max(edge.value * beyond, low), high)
        verdict, ride, look = _settle(_Ride.begin(turned.set(natural, value), start, method))
        if not verdict.lasts or verdict.kind == "undecided":
            notes.append(f"at {turned.name} = {value:.4g}, next to the linear boundary {edge.value:.5g}: {verdict}")
            continue
        _, end, kind = _follow(turned, _Point(value, verdict, look, ride), furthest, step, tolerance)
        width = math.log(edge.value / end.value) * (1 if downwards else -1)
        if width <= (4 if kind == "undecided" else 1) * tolerance or kind == "shrinks to nothing":
            what = "shrinks to nothing" if kind == "shrinks to nothing" else f"lasts to {end.lasts_at:.5g} at most"
            notes.append(f"beyond the linear boundary {turned.name} = {edge.value:.5g} the cycle {what}: no band")
            continue
        fold = Bound(value=end.value, kind=kind, error=0.5 * abs(end.dies_at - end.lasts_at))
        linear = Bound(value=edge.value, kind="linear")
        if kind == "end of range" and furthest not in (low, high):
            fold = Bound(value=furthest, kind="linear")  # the same band as that of the next boundary
        band = Band(low=fold, high=linear) if downwards else Band(low=linear, high=fold)
        if band not in bands:
            bands.append(band)
    if not edges and crossings.unstable_at_ends[0]:
        notes.append("smooth sliding is unstable all the way: stick-slip alone lasts")
    elif not edges:
        try:
            first = _first_point(turned, natural, low, high, None, start, method)
        except UndecidedError as reason:
            notes.append(str(reason))
        else:
            folds = []
            for until in (low, high):
                _, end, kind = _follow(turned, first, until, step, tolerance)
                folds.append(Bound(value=end.value, kind=kind, error=0.5 * abs(end.dies_at - end.lasts_at)))
            bands.append(Band(low=folds[0], high=folds[1]))
    found = BistableRange(
        parameter=turned.name,
        unit=turned.unit,
        searched=(low, high),
        bands=tuple(bands),
        crossings=crossings,
        notes=tuple(notes),
    )
    return found.in_units(rig)


def bistable_region(
    rig: Rig,
    *,
    over: tuple[str, str],
    edge: xr.Dataset,
    between: tuple[float, float],
    places: int = 7,
    step: float = 0.15,
    tolerance: float = 0.02,
    progress: Callable[[float], None] | None = None,
) -> xr.Dataset:
    """Find the ends of the bistable band along one parameter at some values of another; takes seconds for each.

    Parameters
    ----------
    rig : Rig
        The values of the two parameters in it do not matter.
    over : (str, str)
        Names of two parameters: bands lie along the second.
    edge : xarray.Dataset
        The linear boundary over the two parameters, from `stickslip.stability.boundary`: the places are spread over it.
    between : (float, float)
        Range of the second parameter.
    places : int
        Values of the first parameter.
    step, tolerance : float
        As in `cycle_branch`.
    progress : callable, optional
        Called with the share that is done.

    Returns
    -------
    xarray.Dataset
        Along ``band``: ``band_<first>``, ``band_<second>_low`` and ``band_<second>_high``, and ``band_<second>_fold``,
        whichever of the two is where stick-slip decays (NaN if that lies beyond the range). Places at which no band was
        found, or a run could not be judged, are left out.
    """
    import xarray as xr

    across, up = (parameter_named(name) for name in over)
    reached = edge[across.name].to_numpy()
    values = np.geomspace(reached.min(), reached.max(), places + 2)[1:-1] if reached.size else np.empty(0)
    rows = []
    for i, value in enumerate(values.tolist()):
        if progress is not None:
            progress(i / places)
        here = rig.replace(**{across.name: value})
        try:
            bands = bistable_range(here, up, between=between, step=step, tolerance=tolerance)
        except (InputError, UndecidedError):
            continue
        for band in bands:
            fold = next((end.value for end in (band.low, band.high) if end.kind == "fold"), math.nan)
            rows.append((value, band.low.value, band.high.value, fold))
    table = np.array(rows).reshape(-1, 4)
    return xr.Dataset(
        {
            f"band_{across.name}": (
                "band",
                table[:, 0],
                {"units": rig.unit_name(across.unit), "long_name": across.name},
            ),
            f"band_{up.name}_low": (
                "band",
                table[:, 1],
                {"units": rig.unit_name(up.unit), "long_name": f"{up.name}, lower end"},
            ),
            f"band_{up.name}_high": (
                "band",
                table[:, 2],
                {"units": rig.unit_name(up.unit), "long_name": f"{up.name}, upper end"},
            ),
            f"band_{up.name}_fold": (
                "band",
                table[:, 3],
                {"units": rig.unit_name(up.unit), "long_name": f"{up.name}, fold"},
            ),
        }
    )

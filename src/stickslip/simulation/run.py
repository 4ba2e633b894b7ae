"""One function for all solvers: a rig in, a labelled Dataset out.

>>> import stickslip as ss
>>> interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.2))
>>> slider = ss.Slider(stiffness=2.0, mass=1e-4, damping=200.0)
>>> rig = ss.Rig(interface, slider, ss.constant(1.0, duration=20), method=ss.Contacts(10_000, seed=1))
>>> run = ss.simulate(rig)
>>> print(*run.sizes, *list(run.data_vars)[:4])
time displacement velocity spring_force friction_force

The method is a value: `Contacts` (N contacts, event by event) or `MasterEquation` (N to infinity, on cohorts).
Thresholds that age have solvers of their own behind the same two names: N contacts in small steps, with exact moments
of breaking, and for `Langevin` the kinetic equation of Eqs. (13)-(17).
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError, instance, shown
from stickslip.io import datasets as store
from stickslip.model import (
    Contacts,
    Delay,
    DelayModel,
    ExponentialGrowth,
    FromRest,
    FromSliding,
    Interface,
    Langevin,
    MasterEquation,
    Method,
    Output,
    PaperClosure,
    Slider,
    Start,
)
from stickslip.model.distributions import Distribution, SteadyState, one_valued, panels
from stickslip.model.drive import Drive, ForceAbove, ForceBelow, Piece, Travel, constant
from stickslip.model.rig import Rig
from stickslip.simulation.work import estimate
from stickslip.theory import ageing_constants, gaussian_ageing, growth_model, lives

if TYPE_CHECKING:
    import xarray as xr

    from stickslip.kernels.drive import Quadratic
    from stickslip.kernels.oscillator import Slider as SliderConstants

Array = NDArray[np.float64]
Progress = Callable[[float], None]
"""Called now and then with the fraction of the work that is done, 0 to 1."""


# ---------------------------------------------------------------------------------------------------------------------
# What the user chooses
# ---------------------------------------------------------------------------------------------------------------------


# ---------------------------------------------------------------------------------------------------------------------
# Runs
# ---------------------------------------------------------------------------------------------------------------------


def simulate(
    rig: Rig,
    *,
    method: Method | None = None,
    start: Start | None = None,
    output: Output | None = None,
    progress: Progress | None = None,
    long: bool = False,
) -> xr.Dataset:
    """Pull a slider on an interface by a spring, Eq. (11).

    Parameters
    ----------
    rig : Rig
        Interface, slider and drive.
    method : Contacts or MasterEquation, optional
        By default the rig's own. Or, to compare with for `Langevin` ageing, `PaperClosure`.
    start : FromRest or FromSliding, optional
        By default the rig's own.
    output : Output, optional
        Sampling and snapshots, in the rig's own units; by default the rig's own. It never changes the motion of contacts
        that do not age; those that age are followed in steps, which end at the samples.
    progress : callable, optional
        Called with the fraction of the drive that is done.
    long : bool
        Whether it may take more than an hour, or 4 GB of memory, by the estimate made before it starts.

    Returns
    -------
    xarray.Dataset
        In the rig's own units, on ``time``: ``displacement`` and ``velocity`` of the slider, ``spring_force`` and
        ``friction_force``, ``attached`` (fraction), ``drive_velocity``, and the energies ``work``, ``kinetic_energy``,
        ``spring_energy``, ``contact_energy``, ``damped_energy``, ``broken_energy``; with snapshots,
        ``stretching_density`` on ``(snapshot, stretching)``. In natural units forces and energies are per contact, in
        ``f_s`` and ``f_s x_s``. The attribute ``provenance`` tells how to make it again; see `rerun`. With thresholds
        that age ``work`` and the energies of contacts, damping and breaks are left out: breaks cannot be counted there
        (their rate diverges for newborns without strength).

    Raises
    ------
    InputError
        If the rig cannot be simulated: no mass, thresholds without a density for the master equation, a snapshot
        beyond the end; `Langevin` ageing of thresholds that are no Gaussian; ageing for which the method has no
        solver; if it would take too long and `long` is not set.

    Examples
    --------
    >>> import stickslip as ss
    >>> run = ss.simulate(ss.example("precision_stage"))
    >>> run.spring_force.units
    'N'
    """
    instance("simulate: rig", rig, Rig, "a Rig(interface, slider, drive)")
    changes = {"method": method, "start": start, "output": output}
    told = rig.replace(**{name: value for name, value in changes.items() if value is not None})
    case = told.natural
    _check(case)
    instance("simulate: long", long, bool, "True or False")
    if not long:
        estimate(told).check()
    if progress is not None and not callable(progress):
        raise InputError(f"simulate: progress = {shown(progress)}: must be a function of the fraction that is done")
    # Ageing contacts are followed in steps; samples finer than these show no more.
    times = _sample_times(case.slider, case.drive, case.output, angle=0.1 if case.interface.ageing is None else 0.35)
    motion = _Motion(case.interface, case.slider, case.drive, case.start, case.output, times)
    _follow(motion, case.method, progress)
    return rig.in_its_units(_dataset(motion, case.slider, store.provenance("simulate", {"rig": told})))


def pull_rigidly(
    interface: Interface,
    distance: float,
    velocity: float,
    method: Method,
    points: int,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Move a rigid slider at a constant velocity; the engine room of `stickslip.rigid.rigid_slide`.

    Returns
    -------
    xarray.Dataset
        ``friction_force`` and ``attached`` on ``points + 1`` positions ``X``.
    """
    duration = distance / velocity
    output = Output(interval=duration / points)
    motion = _Motion(
        interface, None, constant(velocity, duration), FromRest(), output, np.linspace(0.0, duration, points + 1)
    )
    _follow(motion, method, progress)
    x = ("displacement", velocity * motion.times, {"units": "x_s", "long_name": "displacement of the slider"})
    variables = {
        name: ("displacement", motion.rows[:, _COLUMNS.index(name)], LABELS[name])
        for name in ("friction_force", "attached")
    }
    return _as_dataset(variables, {"displacement": x}, {})


def rerun(run: xr.Dataset, progress: Progress | None = None) -> xr.Dataset:
    """Make a run again from its provenance: the same numbers, bit for bit.

    Raises
    ------
    InputError
        If the Dataset carries no provenance of `simulate`.
    """
    return simulate(rig_of(run), progress=progress, long=True)


def rig_of(run: xr.Dataset) -> Rig:
    """Return the rig that a run was made of, with its method, start and output.

    Raises
    ------
    InputError
        If the Dataset carries no provenance of `simulate`.
    """
    content = store.read_provenance(run)
    if content["call"] != "simulate":
        raise InputError(f"this file was made by {content['call']!r}, not by `simulate`")
    try:
        arguments = store.decode(content["arguments"], store.records())
        rig = arguments["rig"] if arguments.keys() == {"rig"} else None
    except RecursionError:
        rig = None
    instance("the provenance in this file", rig, Rig, "that of a rig; make the run again")
    assert isinstance(rig, Rig)
    return rig


def _check(rig: Rig) -> None:
    interface, slider, drive, start, output = rig.interface, rig.slider, rig.drive, rig.start, rig.output
    instance("simulate: Rig.slider", slider, Slider, "a Slider; other impedances are for `stability`")
    check_method(interface, rig.method)
    if slider.mass == 0:
        raise InputError("Slider.mass = 0: a simulation needs a mass above 0; the massless limit is for stability only")
    if output.snapshots and output.snapshots[-1] > drive.duration:
        raise InputError(
            f"Output.snapshots: {output.snapshots[-1]:g} lies beyond the end of the drive ({drive.duration:g})"
        )
    if isinstance(start, FromSliding):
        if drive.pieces[0].start <= 0:
            raise InputError(
                f"FromSliding: the drive starts at velocity {drive.pieces[0].start:g}: steady sliding needs one above 0"
            )
        if math.isinf(interface.delay.moment(1)):
            raise InputError("FromSliding: contacts that never re-attach have no steady sliding; start FromRest()")


def check_method(interface: Interface, method: object) -> None:
    """Raise `InputError` if the method cannot take the interface."""
    if interface.ageing is not None:
        _check_ageing(interface, method)
    elif isinstance(method, PaperClosure):
        raise InputError("PaperClosure: is for thresholds that age by Langevin; use MasterEquation")
    elif not isinstance(method, Contacts):
        interface.threshold_distribution.density(0.0)  # complains of a distribution without a density
        if one_valued(interface.threshold_distribution):
            raise InputError(
                f"Interface.thresholds = {interface.thresholds}: all thresholds are next to equal, and no density "
                "resolves them; give them a larger standard deviation, or use the method Contacts"
            )


def _check_ageing(interface: Interface, method: object) -> None:
    ageing, delayed = interface.ageing, interface.delay.moment(1) > 0
    if not isinstance(method, (Contacts, MasterEquation, PaperClosure)):
        raise InputError(f"Interface.ageing = {ageing}: not available with {type(method).__name__}; use Contacts")
    if not isinstance(ageing, Langevin):
        if not isinstance(method, Contacts):
            raise InputError(f"Interface.ageing = {ageing}: not available with {type(method).__name__}; use Contacts")
        return
    gaussian_ageing(interface)
    if isinstance(method, PaperClosure) and delayed:
        raise InputError(f"Interface.delay = {interface.delay}: not available with PaperClosure; use Contacts")
    if isinstance(method, MasterEquation) and (delayed or method.memoryless):
        what = "MasterEquation(memoryless=True)" if method.memoryless else f"Interface.delay = {interface.delay}"
        raise InputError(f"{what}: not available for ageing thresholds with MasterEquation; use Contacts")


def _sample_times(slider: Slider, drive: Drive, output: Output, *, angle: float = 0.1) -> Array:
    interval = output.interval
    if interval is None:
        # An angle (rad) of the fastest oscillation, within bounds on the size of the result.
        fastest = math.sqrt((slider.stiffness + 1.0) / slider.mass)
        count = min(max(drive.duration * fastest / angle, 2_000.0), 50_000.0)
        interval = drive.duration / math.ceil(count)
    count = drive.duration / interval
    if count > 50_000_000:
        raise InputError(
            f"Output.interval = {interval:g}: {count:.3g} samples; choose at least {drive.duration / 5e7:g}"
        )
    # The last sample lies on the end if the interval divides the duration, rounding aside.
    times = interval * np.arange(math.floor(count * (1 + 1e-12)) + 1)
    return np.asarray(np.minimum(times, drive.duration))


# ---------------------------------------------------------------------------------------------------------------------
# A run in the making
# ---------------------------------------------------------------------------------------------------------------------

_COLUMNS = (
    "displacement",
    "velocity",
    "friction_force",
    "attached",
    "contact_energy",
    "work",
    "damped_energy",
    "broken_energy",
)


@dataclass
class _Motion:
    """What the engines share: the rig (no slider: rigid motion), the times wanted, and the table that fills up."""

    interface: Interface
    slider: Slider | None
    drive: Drive
    start: Start
    output: Output
    times: Array
    rows: Array = field(init=False)
    drive_velocity: Array = field(init=False)
    drive_position: Array = field(init=False)
    filled: int = 0
    snapshots: list[_Snapshot] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.rows = np.empty((self.times.size, len(_COLUMNS)))
        self.drive_velocity = np.empty(self.times.size)
        self.drive_position = np.empty(self.times.size)

    @property
    def first_velocity(self) -> float:
        """Velocity of the slider at time 0."""
        drive = self.drive.pieces[0].start
        if self.slider is None:
            return drive
        return drive * (1.0 + self.start.perturbation) if isinstance(self.start, FromSliding) else 0.0

    @property
    def next_look(self) -> float:
        """Time of the next snapshot; infinite if none is left."""
        taken = len(self.snapshots)
        return self.output.snapshots[taken] if taken < len(self.output.snapshots) else math.inf

    def steady_attached(self) -> float:
        """Attached fraction in steady sliding at the drive's first velocity, Eq. (10)."""
        mean = self.interface.threshold_distribution.moment(1)
        return mean / (mean + self.drive.pieces[0].start * self.interface.delay.moment(1))

    def drive_origin(self, contact_force: float) -> float:
        """Position of the drive at time 0: a slider that starts sliding starts in balance."""
        if self.slider is None or isinstance(self.start, FromRest):
            return 0.0
        drag = self.slider.mass * self.slider.damping * self.drive.pieces[0].start
        return (contact_force + drag) / self.slider.stiffness


@dataclass(frozen=True)
class _Snapshot:
    """Stretchings at a moment, and the fraction of all contacts at each; `cells`: each stands for its neighbourhood."""

    time: float
    stretching: Array
    share: Array
    cells: bool

    def density(self, edges: Array) -> Array:
        """Fraction of contacts per unit stretching in each bin."""
        if not self.cells:
            counts, _ = np.histogram(self.stretching, edges, weights=self.share)
            return np.asarray(counts / np.diff(edges))
        if self.stretching.size == 0:  # nothing is attached
            return np.zeros(edges.size - 1)
        order = np.argsort(self.stretching)
        x, total = self.stretching[order], np.cumsum(self.share[order])
        between = np.append(0.5 * (x[1:] + x[:-1]), x[-1])
        below = np.interp(edges, np.append(x[0], between), np.append(0.0, total))
        return np.asarray(np.diff(below) / np.diff(edges))


@dataclass(frozen=True)
class _Pull:
    """A piece of the drive in its place: times, and where the drive is at its beginning."""

    begin: float
    position: float
    piece: Piece

    @property
    def end(self) -> float:
        return self.begin + self.piece.duration

    def velocity(self, t: Array) -> Array:
        return np.asarray(self.piece.start + self.piece.acceleration * (t - self.begin))

    def displacement(self, t: Array) -> Array:
        since = t - self.begin
        return np.asarray(self.position + since * (self.piece.start + 0.5 * self.piece.acceleration * since))

    def stop(self) -> tuple[int, float]:
        """The condition as the kernels take it: kind and value."""
        match self.piece.until:
            case Travel(distance):
                return 1, distance
            case ForceAbove(force):
                return 2, force
            case ForceBelow(force):
                return 3, force
            case None:
                return 0, 0.0


class _Engine(Protocol):
    """A solver on the way."""

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        ...

    def pull(self, pull: _Pull, report: Progress) -> float:
        """Follow a piece of the drive, fill rows, take snapshots; return the time at which it ended."""
        ...


def _follow(motion: _Motion, method: Method, progress: Progress | None) -> None:
    """Follow the drive from piece to piece."""
    engine = _engine(motion, method)
    report = progress or (lambda _: None)
    total = motion.drive.duration
    begin, position = 0.0, motion.drive_origin(engine.contact_force())
    for piece in motion.drive.pieces:
        pull = _Pull(begin, position, piece)
        first = motion.filled
        begin = engine.pull(pull, lambda t: report(min(t / total, 1.0)))
        sampled = slice(first, motion.filled)
        _check_finite(motion, sampled)
        motion.drive_velocity[sampled] = pull.velocity(motion.times[sampled])
        motion.drive_position[sampled] = pull.displacement(motion.times[sampled])
        position = float(pull.displacement(np.asarray(begin)))
    report(1.0)


def _check_finite(motion: _Motion, sampled: slice) -> None:
    motions = motion.rows[sampled, : _COLUMNS.index("attached") + 1]
    lost = np.flatnonzero(~np.isfinite(motions).all(axis=1))
    if lost.size:
        raise InputError(
            f"simulate: from t = {motion.times[sampled][lost[0]]:g} on the numbers of the run are not finite: the rig "
            f"has scales too far apart ({motion.slider}, drive of velocity {motion.drive.pieces[0].start:g})"
        )


def _engine(motion: _Motion, method: Method) -> _Engine:
    ageing = motion.interface.ageing
    match method:
        case Contacts() if isinstance(ageing, Langevin):
            return _Ageing(motion, _AgeingContacts(motion, ageing, method))
        case Contacts() if ageing is not None:
            return _Ageing(motion, _GrowingContacts(motion, method))
        case MasterEquation() if isinstance(ageing, Langevin):
            return _Ageing(motion, _AgeingDensity(motion, ageing, method))
        case PaperClosure():
            assert isinstance(ageing, Langevin)
            return _Ageing(motion, _AgeingClosure(motion, ageing, method))
        case Contacts():
            return _ContactsEngine(motion, method)
        case MasterEquation():
            return _Cohorts(motion, method)


class _ContactsEngine:
    """The event engine of `stickslip.kernels.events`, fed with random numbers in blocks of a fixed length."""

    _BLOCK = 16_384
    _EVENTS = 400_000  # between two reports of progress: some 50 ms

    def __init__(self, motion: _Motion, method: Contacts) -> None:
        from stickslip.kernels import events as kernel

        self._kernel, self._motion = kernel, motion
        self._distribution, self._delay = motion.interface.threshold_distribution, motion.interface.delay
        initial, thresholds, delays = (
            np.random.default_rng(seed) for seed in np.random.SeedSequence(method.seed).spawn(3)
        )
        self._threshold_rng, self._delay_rng = thresholds, delays
        x, threshold, pending = _first_contacts(motion, method.count, initial)
        self._state = kernel.make_state(-x, threshold, pending, self._delay.moment(1), velocity=motion.first_velocity)
        self._slider = slider_constants(motion.slider)
        fixed = self._delay.time if isinstance(self._delay, Delay) else math.nan
        self._draws = kernel.Draws(self._distribution.sample(self._threshold_rng, self._BLOCK), np.empty(0), fixed)

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        return self._kernel.contact_force(self._state)

    def pull(self, pull: _Pull, report: Progress) -> float:
        """Follow a piece of the drive to its end."""
        from stickslip.kernels.drive import Quadratic, Stop

        kernel, state, motion = self._kernel, self._state, self._motion
        drive = Quadratic(pull.begin, pull.position, pull.piece.start, pull.piece.acceleration)
        stop = Stop(*pull.stop(), float(state.motion[kernel.POSITION]))
        sampling = kernel.Sampling(motion.times, motion.rows)
        while True:
            piece = kernel.Piece(drive, pull.end, stop, motion.next_look)
            why = kernel.advance(state, self._slider, piece, sampling, self._draws, self._EVENTS)
            motion.filled = int(state.counts[kernel.SAMPLE])
            now = float(state.motion[kernel.TIME])
            if why == kernel.THRESHOLDS_USED_UP:
                self._draws = self._draws._replace(
                    thresholds=self._distribution.sample(self._threshold_rng, self._BLOCK)
                )
                state.counts[kernel.THRESHOLD] = 0
            elif why == kernel.DELAYS_USED_UP:
                self._draws = self._draws._replace(delays=self._delay.sample(self._delay_rng, self._BLOCK))
                state.counts[kernel.DELAY] = 0
            elif why == kernel.LOOK:
                x = kernel.stretchings(state)
                share = np.full(x.size, 1.0 / state.contacts.size)
                motion.snapshots.append(_Snapshot(motion.next_look, x, share, cells=False))
            elif why == kernel.BUDGET_SPENT:
                report(now)
            else:
                return now


def _first_contacts(motion: _Motion, count: int, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Draw stretchings and thresholds of all contacts (detached ones last), and when the latter are born again."""
    distribution, delay = motion.interface.threshold_distribution, motion.interface.delay
    if isinstance(motion.start, FromRest):
        initial, attached = motion.interface.initial, count
    else:
        initial, attached = SteadyState(thresholds=distribution), round(count * motion.steady_attached())
    x = initial.sample(rng, attached)
    largest = distribution.support[1]
    while (again := np.flatnonzero(np.abs(x) >= largest)).size:
        x[again] = initial.sample(rng, again.size)
    threshold = distribution.sample_beyond(rng, np.abs(x))
    detached = count - attached
    pending = _pending(delay, detached, rng)
    return np.append(x, np.zeros(detached)), np.append(threshold, np.zeros(detached)), pending


def _pending(delay: DelayModel, detached: int, rng: np.random.Generator) -> Array:
    """When contacts that are caught in the middle of a delay come back: long delays are met more often."""
    if isinstance(delay, Delay):
        return delay.time * rng.random(detached)
    if not detached:
        return np.empty(0)
    pool = delay.sample(rng, 4 * detached + 1000)
    return np.asarray(rng.choice(pool, detached, p=pool / pool.sum()) * rng.random(detached))


class _Cohorts:
    """The cohorts of `stickslip.kernels.cohorts`."""

    _STEPS = 5_000  # between two reports of progress

    def __init__(self, motion: _Motion, method: MasterEquation) -> None:
        from stickslip.kernels import cohorts as kernel

        self._kernel, self._motion, self._cells = kernel, motion, float(method.cells)
        interface = motion.interface
        self._table = kernel.tabulate(*survival_table(interface.threshold_distribution))
        delay, weight = interface.delay.quadrature()
        self._delays = kernel.Delays(delay, weight, method.memoryless)
        self._slider = slider_constants(motion.slider)
        if isinstance(motion.start, FromRest):
            (x, share), rate = initial_nodes(interface), 0.0
        else:
            attached = motion.steady_attached()
            x, share = kernel.smooth_sliding(self._table, self._cells, attached)
            rate = attached * motion.drive.pieces[0].start / interface.threshold_distribution.moment(1)
        self._state = kernel.initial_state(
            self._table, self._delays, x, share, velocity=motion.first_velocity, rate=rate
        )

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        return float(self._state.scalar[self._kernel.CONTACT_FORCE])

    def pull(self, pull: _Pull, report: Progress) -> float:
        """Follow a piece of the drive to its end."""
        from stickslip.kernels.drive import Quadratic, Stop

        kernel, motion = self._kernel, self._motion
        drive = Quadratic(pull.begin, pull.position, pull.piece.start, pull.piece.acceleration)
        stop = Stop(*pull.stop(), float(self._state.scalar[kernel.POSITION]))
        # A sample on the seam of two pieces belongs to the later one; the last piece keeps its end.
        wanted = motion.times[motion.filled : np.searchsorted(motion.times, pull.end * (1 + 1e-12), side="right")]
        while True:
            before = self._state
            done = kernel.advance(
                before,
                self._table,
                self._delays,
                self._slider,
                drive,
                until=pull.end,
                times=wanted,
                cells=self._cells,
                stop=stop,
                max_steps=self._STEPS,
            )
            self._state = done.state
            now = float(done.state.scalar[kernel.TIME])
            self._keep(done.rows)
            wanted = wanted[len(done.rows) :]
            while motion.next_look <= now:
                # From where the last leg began, aside: the run itself does not stop here.
                aside = kernel.advance(
                    before,
                    self._table,
                    self._delays,
                    self._slider,
                    drive,
                    until=motion.next_look,
                    times=np.empty(0),
                    cells=self._cells,
                ).state
                x, share = kernel.stretchings(aside)
                motion.snapshots.append(_Snapshot(motion.next_look, x, share, cells=True))
            report(now)
            if done.reason != kernel.PAUSED:
                return now

    def _keep(self, rows: Array) -> None:
        kernel, motion = self._kernel, self._motion
        columns = [
            kernel.POSITION,
            kernel.VELOCITY,
            kernel.CONTACT_FORCE,
            kernel.ATTACHED,
            kernel.STORED,
            kernel.WORK,
            kernel.DAMPED,
            kernel.LOST,
        ]
        motion.rows[motion.filled : motion.filled + len(rows)] = rows[:, columns]
        motion.filled += len(rows)


# ---------------------------------------------------------------------------------------------------------------------
# Thresholds that age
# ---------------------------------------------------------------------------------------------------------------------


class _Aged(Protocol):
    """A state of ageing contacts and the slider, and the kernel that advances it."""

    def advance(self, drive: Quadratic, times: Array, *, pausing: bool = False) -> Array:
        """Advance to the last of `times`; X, V, F_d, F_c and the attached share at each.

        Pausing at each, a run that is cut short at one of them has gone the same way till there.
        """
        ...

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        ...

    def stretchings(self) -> tuple[Array, Array, bool]:
        """Stretchings, their fractions, and whether each stands for its neighbourhood."""
        ...


class _Ageing:
    """Ageing contacts along the drive, in blocks of samples; a block in which a piece ends early is done again."""

    _BLOCK = 256

    def __init__(self, motion: _Motion, aged: _Aged) -> None:
        self._motion, self._aged = motion, aged
        self._pulled, self._X = 0, 0.0

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        return self._aged.contact_force()

    def pull(self, pull: _Pull, report: Progress) -> float:
        """Follow a piece of the drive to its end."""
        from stickslip.kernels.drive import Quadratic

        motion = self._motion
        self._pulled += 1
        drive = Quadratic(pull.begin, pull.position, pull.piece.start, pull.piece.acceleration)
        kind, value = pull.stop()
        origin, now = self._X, pull.begin
        last = self._pulled == len(motion.drive.pieces)
        # A sample on the seam of two pieces belongs to the later one; the last piece keeps its end.
        kept = int(np.searchsorted(motion.times, pull.end * (1 + (1e-12 if last else -1e-12)), side="right"))
        while now < pull.end:
            times = np.minimum(motion.times[motion.filled : min(motion.filled + self._BLOCK, kept)], pull.end)
            wanted = times.size
            if motion.filled + wanted == kept and (wanted == 0 or times[-1] < pull.end):
                times = np.append(times, pull.end)
            before = copy.deepcopy(self._aged) if kind or motion.next_look <= times[-1] else self._aged
            samples = self._aged.advance(drive, times, pausing=kind > 0)
            met = np.flatnonzero(_met(kind, value, samples[:wanted], origin))
            if met.size:
                times, wanted = times[: met[0] + 1], int(met[0]) + 1
                self._aged = copy.deepcopy(before)
                samples = self._aged.advance(drive, times, pausing=kind > 0)
            while motion.next_look <= times[-1]:
                aside = copy.deepcopy(before)
                aside.advance(drive, np.array([motion.next_look]))
                x, share, cells = aside.stretchings()
                motion.snapshots.append(_Snapshot(motion.next_look, x, share, cells=cells))
            rows = motion.rows[motion.filled : motion.filled + wanted]
            rows[:] = math.nan  # energies are not known
            rows[:, : _COLUMNS.index("attached") + 1] = samples[:wanted][:, [0, 1, 3, 4]]
            motion.filled += wanted
            self._X, now = float(samples[-1, 0]), float(times[-1])
            report(now)
            if met.size:
                break
        return now


def _met(kind: int, value: float, samples: Array, origin: float) -> NDArray[np.bool_]:
    """Which samples meet the condition that ends a piece, see `_Pull.stop`."""
    match kind:
        case 1:
            return np.asarray(np.abs(samples[:, 0] - origin) >= value)
        case 2:
            return np.asarray(samples[:, 2] >= value)
        case 3:
            return np.asarray(samples[:, 2] <= value)
    return np.zeros(len(samples), dtype=bool)


_AGEING_STEP = 0.02
"""Largest step of N ageing contacts in units of ``1/rate**2``, and of the slider in the mean threshold's stretching."""


_GROWING_REACH = 0.02
"""Largest way of the slider in a step of N contacts with growing thresholds, in ``x_s``."""


def _settling_time(motion: _Motion, ageing: Langevin) -> float:
    """How long to slide rigidly from the distribution of Eq. (10) to the steady state: lives, and times of ageing."""
    velocity, delay = motion.drive.pieces[0].start, motion.interface.delay.moment(1)
    return 5.0 * (motion.interface.threshold_distribution.moment(1) / velocity + delay) + 5.0 / ageing.rate**2


def _first_pull(motion: _Motion) -> Quadratic:
    """Drive at the first velocity, on and on."""
    from stickslip.kernels.drive import Quadratic

    return Quadratic(0.0, 0.0, motion.drive.pieces[0].start, 0.0)


def slider_constants(slider: Slider | None) -> SliderConstants:
    """Return a slider as the kernels take it; none is rigid motion."""
    from stickslip.kernels.oscillator import RIGID
    from stickslip.kernels.oscillator import Slider as SliderConstants

    return RIGID if slider is None else SliderConstants(slider.stiffness, slider.mass, slider.damping)


class _AgeingContacts:
    """N contacts of `stickslip.kernels.langevin_contacts`."""

    _DELAYS = 65_536

    def __init__(self, motion: _Motion, ageing: Langevin, method: Contacts) -> None:
        from stickslip.kernels.langevin_contacts import Contacts as Sampled

        initial, thresholds, delays = (
            np.random.default_rng(seed) for seed in np.random.SeedSequence(method.seed).spawn(3)
        )
        self._rng, self._constants = thresholds, ageing_constants(motion.interface)
        delay = motion.interface.delay
        self._delays = delay.sample(delays, 1 if isinstance(delay, Delay) else self._DELAYS)
        x, threshold, pending = _first_contacts(motion, method.count, initial)
        self._contacts = Sampled(x, threshold, np.append(np.full(method.count - pending.size, -math.inf), pending))
        self._state = np.zeros(4)
        if isinstance(motion.start, FromSliding):
            self._slider = slider_constants(None)
            end = _settling_time(motion, ageing)
            self.advance(_first_pull(motion), np.array([end]))
            self._contacts.attach[:] -= end
            self._state[:2] = 0.0
        self._state[2] = motion.first_velocity
        self._slider = slider_constants(motion.slider)

    def advance(self, drive: Quadratic, times: Array, *, pausing: bool = False) -> Array:
        """Advance to the last of `times`."""
        from stickslip.kernels.langevin_contacts import advance_contacts
        from stickslip.kernels.stepping import Course

        longest, reach = _AGEING_STEP / self._constants.rate**2, _AGEING_STEP * self._constants.mean
        course = Course(drive, self._slider, times, longest, reach, pausing)
        return advance_contacts(self._state, self._contacts, course, self._constants, self._delays, self._rng)

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        return _mean_force(self._contacts.stretching, self._contacts.attach, self._state[0])

    def stretchings(self) -> tuple[Array, Array, bool]:
        """Stretchings of attached contacts, and their fractions."""
        return *_of_attached(self._contacts.stretching, self._contacts.attach, self._state[0]), False


def _mean_force(x: Array, attach: Array, now: float) -> float:
    """Force per contact of stretchings `x` that hold from the times `attach` on."""
    return float(np.mean(np.where(attach <= now, x, 0.0)))


def _of_attached(x: Array, attach: Array, now: float) -> tuple[Array, Array]:
    """Stretchings of the contacts that hold now, and their fractions of all."""
    held = x[attach <= now]
    return held, np.full(held.size, 1.0 / x.size)


class _GrowingContacts:
    """N contacts whose thresholds grow by a fixed rule, of `stickslip.kernels.growth`."""

    _POOL = 65_536

    def __init__(self, motion: _Motion, method: Contacts) -> None:
        initial, thresholds, delays = (
            np.random.default_rng(seed) for seed in np.random.SeedSequence(method.seed).spawn(3)
        )
        from stickslip.kernels.growth import Growing

        interface = motion.interface
        self._growth, self._rng = growth_model(interface), thresholds
        self._pool = interface.threshold_distribution.sample(thresholds, self._POOL)
        delay = interface.delay
        self._delays = delay.sample(delays, 1 if isinstance(delay, Delay) else self._POOL)
        self._slider = slider_constants(motion.slider)
        if isinstance(motion.start, FromRest):
            # Growth towards a strength has come to its end; growth without end begins.
            born = -math.inf if isinstance(interface.ageing, ExponentialGrowth) else 0.0
            x, strength, _ = _first_contacts(motion, method.count, initial)
            attach = np.full(method.count, born)
        else:
            x, strength, attach = self._slide(motion, method.count, initial)
        self._contacts = Growing(x, strength, attach)
        self._state = np.array([0.0, 0.0, motion.first_velocity, 0.0])

    def _slide(self, motion: _Motion, count: int, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        """Stretchings, strengths, births in steady sliding: long lives are met more often, and anywhere within them."""
        velocity, delay = motion.drive.pieces[0].start, motion.interface.delay
        life = lives(self._growth, self._pool, velocity)
        share = life.mean() / (life.mean() + delay.moment(1)) if life.any() else 0.0
        attached = round(count * share)
        which = rng.choice(self._pool.size, attached, p=life / life.sum()) if attached else np.empty(0, dtype=int)
        age = rng.random(attached) * life[which]
        detached = count - attached
        pending = _pending(delay, detached, rng)
        strength = np.append(self._pool[which], rng.choice(self._pool, detached))
        return np.append(velocity * age, np.zeros(detached)), strength, np.append(-age, pending)

    def advance(self, drive: Quadratic, times: Array, *, pausing: bool = False) -> Array:
        """Advance to the last of `times`."""
        from stickslip.kernels.growth import advance_growing
        from stickslip.kernels.stepping import Course

        course = Course(drive, self._slider, times, math.inf, _GROWING_REACH, pausing)
        pools = self._pool, self._delays
        return advance_growing(self._state, self._contacts, course, self._growth, *pools, self._rng)

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        return _mean_force(self._contacts.stretching, self._contacts.attach, self._state[0])

    def stretchings(self) -> tuple[Array, Array, bool]:
        """Stretchings of attached contacts, and their fractions."""
        return *_of_attached(self._contacts.stretching, self._contacts.attach, self._state[0]), False


class _AgeingDensity:
    """The kinetic equation of `stickslip.kernels.langevin_density`."""

    def __init__(self, motion: _Motion, ageing: Langevin, method: MasterEquation) -> None:
        from stickslip.kernels.langevin_density import Cohorts, density_nodes

        self._constants = ageing_constants(motion.interface)
        mean = self._constants.mean
        self._step = 4.0 / method.cells
        self._nodes = density_nodes(self._constants, method.cells / 40.0)
        sliding = isinstance(motion.start, FromSliding)
        cohorts = _first_cohorts(motion.interface, self._nodes, 4.0 * self._step * mean, steady=sliding)
        count, room = cohorts[0].size, math.ceil(self._nodes[-1] / (self._step * mean)) + 3
        self._cohorts = Cohorts(*(np.append(part, np.zeros((room, *part.shape[1:])), 0) for part in cohorts))
        self._state = np.array([0.0, 0.0, 0.0, 0.0, count, 0.0])
        if isinstance(motion.start, FromSliding):
            self._slider = slider_constants(None)
            end = _settling_time(motion, ageing)
            self.advance(_first_pull(motion), np.array([end]))
            self._cohorts.place[:] -= self._state[1]
            self._state[:2] = 0.0
        self._state[2] = motion.first_velocity
        self._slider = slider_constants(motion.slider)

    def advance(self, drive: Quadratic, times: Array, *, pausing: bool = False) -> Array:
        """Advance to the last of `times`."""
        from stickslip.kernels.langevin_density import advance_density
        from stickslip.kernels.stepping import Course

        longest, reach = self._step / self._constants.rate**2, self._step * self._constants.mean
        course = Course(drive, self._slider, times, longest, reach, pausing)
        return advance_density(self._state, self._cohorts, self._nodes, course, self._constants)

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        x, share, _ = self.stretchings()
        return float(np.sum(x * share))

    def stretchings(self) -> tuple[Array, Array, bool]:
        """Mean stretchings of the cohorts, and their fractions."""
        share = self._cohorts.mass.sum(axis=1)
        kept = share > 0.0
        place = self._cohorts.place[kept] + self._cohorts.moment[kept].sum(axis=1) / share[kept]
        return self._state[1] - place, share[kept], True


class _AgeingClosure:
    """The paper's closure of `stickslip.kernels.closure`: cohorts of stretchings, and one distribution of thresholds."""

    def __init__(self, motion: _Motion, ageing: Langevin, method: PaperClosure) -> None:
        from stickslip.kernels.closure import Cohorts, Thresholds, threshold_edges

        self._constants = ageing_constants(motion.interface)
        self._step = 4.0 / method.cells
        edges = threshold_edges(self._constants, max(method.cells / 50.0, 2.0))
        distribution = motion.interface.threshold_distribution
        sliding = isinstance(motion.start, FromSliding)
        start = (
            Interface(thresholds=distribution, initial=SteadyState(thresholds=distribution))
            if sliding
            else motion.interface
        )
        x, share = initial_nodes(start)
        beyond = distribution.survival(edges)
        self._thresholds = Thresholds(edges, (beyond[:-1] - beyond[1:]) / (beyond[0] - beyond[-1]))
        room = x.size + math.ceil(3.0 / self._step) + 20
        self._cohorts = Cohorts(np.zeros(room), np.zeros(room))
        self._cohorts.place[: x.size], self._cohorts.weight[: x.size] = -x, share
        self._state = np.array([0.0, 0.0, 0.0, 0.0, x.size])
        if sliding:
            self._slider = slider_constants(None)
            end = 2.0 * _settling_time(motion, ageing)  # one distribution for all settles more slowly
            self.advance(_first_pull(motion), np.array([end]))
            self._cohorts.place[:] -= self._state[1]
            self._state[:2] = 0.0
        self._state[2] = motion.first_velocity
        self._slider = slider_constants(motion.slider)

    def advance(self, drive: Quadratic, times: Array, *, pausing: bool = False) -> Array:
        """Advance to the last of `times`, with room for as many cohorts as it takes; its steps end at each."""
        del pausing
        from stickslip.kernels.closure import Cohorts, advance_closure
        from stickslip.kernels.stepping import Course

        longest, reach = self._step / self._constants.rate**2, self._step * self._constants.mean
        course = Course(drive, self._slider, times, longest, reach)
        while True:
            state, cohorts, thresholds = copy.deepcopy((self._state, self._cohorts, self._thresholds))
            try:
                samples = advance_closure(state, cohorts, thresholds, course, self._constants)
            except ValueError:  # no room for another cohort
                self._cohorts = Cohorts(*(np.append(part, np.zeros(part.size)) for part in self._cohorts))
                continue
            self._state, self._cohorts, self._thresholds = state, cohorts, thresholds
            return samples

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        x, share, _ = self.stretchings()
        return float(np.sum(x * share))

    def stretchings(self) -> tuple[Array, Array, bool]:
        """Stretchings of the cohorts, and their fractions."""
        count = int(self._state[4])
        return self._state[1] - self._cohorts.place[:count], self._cohorts.weight[:count], True


def _first_cohorts(interface: Interface, gaps: Array, width: float, *, steady: bool) -> tuple[Array, Array, Array]:
    """Cohorts of contacts whose stretchings are no farther apart than `width`, the slider at 0.

    Returns their places of birth, the fraction of contacts by cohort and gap, and its moment about these places.
    """
    from stickslip.kernels.langevin_density import cell_widths

    distribution = interface.threshold_distribution
    x, share = initial_nodes(
        Interface(thresholds=distribution, initial=SteadyState(thresholds=distribution)) if steady else interface
    )
    kept = share > 1e-12
    x, share = x[kept], share[kept]
    mass = distribution.density(gaps + np.abs(x)[:, None]) * cell_widths(gaps)
    mass[:, 0] = 0.0  # none is on its boundary
    mass *= (share / mass.sum(axis=1) / share.sum())[:, None]
    # Those pulled back and those pulled ahead apart: as the slider moves, the gaps of ones widen, of others narrow.
    _, into = np.unique(np.floor(x / width), return_inverse=True)
    place = -np.bincount(into, share * x) / np.bincount(into, share)
    together, moment = np.zeros((2, place.size, gaps.size))
    np.add.at(together, into, mass)
    np.add.at(moment, into, mass * (-x - place[into])[:, None])
    return place, together, moment


def survival_table(distribution: Distribution) -> tuple[Array, Array, float]:
    """Tabulate survival and density of thresholds for cubic interpolation to 1e-13 (smooth distributions), and the spacing."""
    end = distribution.support[1]
    count = math.ceil(end / min(max(2e-3 * distribution.standard_deviation(), end / 2**20), end / 64))
    spacing = end / count
    x = spacing * np.arange(count + 1)
    survival = distribution.survival(x)
    survival[-1] = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        density = distribution.density(x)
    if not np.isfinite(density[0]):  # distributions with a singular start
        density[0] = (survival[0] - survival[1]) / spacing
    return survival, density, spacing


def initial_nodes(interface: Interface, finer: int = 1) -> tuple[Array, Array]:
    """Quadrature nodes of the initial stretchings, between the jumps of their distribution, and their weights of sum 1.

    Sixteen nodes for every four standard deviations do for distributions without jumps, and `finer` times as many may
    be asked for.
    """
    distribution, thresholds = interface.initial, interface.threshold_distribution
    std = distribution.standard_deviation()
    if std == 0:
        return np.array([distribution.moment(1)]), np.ones(1)
    low, high = (
        max(distribution.support[0], -thresholds.support[1]),
        min(distribution.support[1], thresholds.support[1]),
    )
    edges = [low, *(knot for knot in sorted({*distribution.knots, *thresholds.knots}) if low < knot < high), high]
    width = 4.0 * min(std, max(thresholds.standard_deviation(), 1e-3 * std))
    parts = [panels(left, right, math.ceil(finer * (right - left) / width)) for left, right in pairwise(edges)]
    x, weight = (np.concatenate(part) for part in zip(*parts, strict=True))
    weight = weight * distribution.density(x)
    kept = (weight > 0) & (thresholds.survival(np.abs(x)) > 0)
    return x[kept], weight[kept] / weight[kept].sum()


# ---------------------------------------------------------------------------------------------------------------------
# The result
# ---------------------------------------------------------------------------------------------------------------------

LABELS: Mapping[str, Mapping[str, str]] = {
    "time": {"units": "time", "long_name": "time"},
    "displacement": {"units": "x_s", "long_name": "displacement of the slider"},
    "velocity": {"units": "x_s/time", "long_name": "velocity of the slider"},
    "spring_force": {"units": "f_s", "long_name": "spring force per contact"},
    "friction_force": {"units": "f_s", "long_name": "friction force, per contact"},
    "attached": {"units": "1", "long_name": "fraction of attached contacts"},
    "drive_velocity": {"units": "x_s/time", "long_name": "velocity of the drive"},
    "work": {"units": "f_s x_s", "long_name": "work of the drive, per contact"},
    "kinetic_energy": {"units": "f_s x_s", "long_name": "kinetic energy of the slider, per contact"},
    "spring_energy": {"units": "f_s x_s", "long_name": "energy of the driving spring, per contact"},
    "contact_energy": {"units": "f_s x_s", "long_name": "energy stored in contacts, per contact"},
    "damped_energy": {"units": "f_s x_s", "long_name": "energy dissipated by damping, per contact"},
    "broken_energy": {"units": "f_s x_s", "long_name": "energy lost in breaks, per contact"},
    "stretching_density": {"units": "1/x_s", "long_name": "density of stretchings, per contact"},
    "x": {"units": "x_s", "long_name": "stretching"},
    "snapshot": {"units": "time", "long_name": "time of the snapshot"},
}
"""Units and names of every variable of a run."""


def _dataset(motion: _Motion, slider: Slider, provenance: str) -> xr.Dataset:
    kept = slice(0, motion.filled)
    values = {name: motion.rows[kept, i] for i, name in enumerate(_COLUMNS)}
    if motion.interface.ageing is not None:
        values = {name: values[name] for name in ("displacement", "velocity", "friction_force", "attached")}
    values["drive_velocity"] = motion.drive_velocity[kept]
    values["spring_force"] = slider.stiffness * (motion.drive_position[kept] - values["displacement"])
    values["kinetic_energy"] = 0.5 * slider.mass * values["velocity"] ** 2
    values["spring_energy"] = 0.5 * values["spring_force"] ** 2 / slider.stiffness
    variables: dict[str, Any] = {name: ("time", values[name], LABELS[name]) for name in LABELS if name in values}
    coordinates = {"time": ("time", motion.times[kept], LABELS["time"])}
    if motion.snapshots:
        low = min(float(s.stretching.min(initial=0.0)) for s in motion.snapshots)
        high = max(float(s.stretching.max(initial=0.0)) for s in motion.snapshots)
        edges = np.linspace(low, max(high, low + 1e-12) * (1 + 1e-12), motion.output.bins + 1)
        densities = np.array([s.density(edges) for s in motion.snapshots])
        variables["stretching_density"] = (("snapshot", "x"), densities, LABELS["stretching_density"])
        coordinates["snapshot"] = ("snapshot", np.array([s.time for s in motion.snapshots]), LABELS["snapshot"])
        coordinates["x"] = ("x", 0.5 * (edges[1:] + edges[:-1]), LABELS["x"])
    return _as_dataset(variables, coordinates, {"provenance": provenance})


def _as_dataset(variables: Mapping[str, Any], coordinates: Mapping[str, Any], attrs: Mapping[str, str]) -> xr.Dataset:
    import xarray as xr

    return xr.Dataset(dict(variables), dict(coordinates), dict(attrs))

"""One function for all solvers: a rig in, a labelled Dataset out.

The method is a value: `Contacts` (N contacts, event by event) or `MasterEquation` (N to
infinity, to a given error). Thresholds that age by `Langevin` have solvers of their own
behind the same two names: N contacts in small steps, with exact moments of breaking,
and the kinetic equation of Eqs. (13)-(17).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from stickslip.errors import InputError, instance
from stickslip.io import datasets as store
from stickslip.model import (
    ElasticBody,
    ExponentialGrowth,
    Interface,
    Mass,
    MasterEquation,
    Method,
    OnArrest,
    Output,
    Population,
    Slider,
    Start,
    TabulatedGrowth,
)
from stickslip.model.drive import Drive, constant, ramp
from stickslip.model.records import converted
from stickslip.model.rig import Rig
from stickslip.model.structure import Structure
from stickslip.progress import Progress, reporting
from stickslip.simulation import states
from stickslip.simulation.driver import Track, follow, load_points
from stickslip.simulation.engines import Beginning, Engine, engine_of
from stickslip.simulation.engines.base import Array
from stickslip.simulation.estimates import (
    LARGEST,
    Work,
    announce,
    course_of,
    pieces_and_looks,
    sample_interval,
    sampling,
)
from stickslip.simulation.result import LABELS, dataset_of, series_of, with_label
from stickslip.sliding.rigid_motion import static_friction

if TYPE_CHECKING:
    import xarray as xr


def simulate(
    rig: Rig,
    *,
    method: Method | None = None,
    start: Start | xr.Dataset | None = None,
    output: Output | None = None,
    progress: Progress | bool | None = None,
    long: bool = False,
) -> xr.Dataset:
    """Pull a slider on an interface by a spring, Eq. (11), or an elastic slider by one
    or several springs.

    Parameters
    ----------
    rig : Rig
        Interface, slider and drive.
    method : Contacts, MasterEquation or QuasiStatic, optional
        By default the rig's own.
    start : FromRest, FromSliding, Prestressed or xarray.Dataset, optional
        By default the rig's own. A run that was made with
        ``output=Output(state=True)`` is continued, along the drive of the rig: the
        Dataset holds both runs, bit for bit as if made in one piece, with samples at
        the interval of the first.
    output : Output, optional
        Sampling and snapshots, in the rig's unit of time (the second for a rig from a
        file); by default the rig's own. It never changes the motion of contacts that do
        not age; contacts that age are followed in steps, which end at the samples.
    progress : bool or callable, optional
        True for a progress bar, or a function that is called with the completed
        fraction of the drive.
    long : bool
        Whether the run may take more than an hour, or 4 GB of memory, by the estimate
        made before it starts. An estimate of more than a minute is logged (logger
        ``stickslip``): by default one line on standard error.

    Returns
    -------
    xarray.Dataset
        In the rig's own units, on ``time``: ``displacement`` and ``velocity`` of the
        slider, ``spring_force`` and ``friction_force``, ``attached`` (fraction),
        ``drive_velocity``, and the energies ``work``, ``kinetic_energy``,
        ``spring_energy``, ``contact_energy``, ``damped_energy``, ``broken_energy``;
        with snapshots, ``stretching_density`` on ``(snapshot, stretching)``. In natural
        units forces and energies are per contact, in ``f_s`` and ``f_s x_s``. The
        attribute ``provenance`` holds all that is needed to make it again; see `rerun`.
        With `Langevin` ageing ``work`` and the energies of contacts, damping and breaks
        are omitted: breaks cannot be counted there (their rate diverges for newborns
        without strength).

        For a `Chain` or a `Sheet`, on ``time`` and ``block``: ``displacement``,
        ``velocity``, ``friction_force`` (per contact of a block), ``attached``, and
        ``broken`` (breaks per contact since the start). ``spring_force`` and the
        energies, including ``bulk_energy`` and ``viscous_energy``, are sums over
        blocks, per contact of a block; ``pulling_force`` is the force of each driving
        spring. On ``block`` alone: ``first_break`` (with infinitely many contacts, the
        break of a thousandth), ``first_break_force``, ``half_detached``. See `fronts`
        and `events`.

    Raises
    ------
    InputError
        If the rig cannot be simulated: no mass, thresholds without a density for the
        master equation, a snapshot beyond the end; `Langevin` ageing of thresholds that
        are no Gaussian; ageing for which the method has no solver; if it would take too
        long and `long` is not set; if its numbers stop being finite.

    Examples
    --------
    >>> run = ss.simulate(ss.example("precision_stage"))
    >>> run.spring_force.units
    'N'
    """
    import xarray as xr

    instance("simulate: rig", rig, Rig, "a Rig(interface, slider, drive)")
    before = start if isinstance(start, xr.Dataset) else None
    changes = {
        "method": method,
        "start": start if before is None else None,
        "output": output,
    }
    given = rig.replace(
        **{name: value for name, value in changes.items() if value is not None}
    )
    if before is None:
        return record(given, progress=progress, long=long).dataset()
    return _gone_on(given, before, progress, long).dataset()


@dataclass(frozen=True, eq=False)
class Recording:
    """A run in natural units with its engine in the final state, converted to a Dataset
    only on request.
    """

    rig: Rig
    track: Track
    engine: Engine  # in its final state

    def dataset(self) -> xr.Dataset:
        """Return the run with names, units and provenance, in the rig's units."""
        provenance = store.provenance("simulate", {"rig": self.rig})
        marks = self.engine.marks()
        output = self.rig.output
        run = dataset_of(self.track, self.rig.slider, output.bins, provenance, marks)
        if self.rig.drive.load:
            load = np.interp(self.track.times, *load_points(self.rig.drive).T)
            run["load"] = with_label("load", "time", load)
        run = self.rig.in_its_units(run)
        return states.keep(run, (self.track, self.engine)) if output.state else run

    def series(self, names: Iterable[str]) -> dict[str, Array]:
        """Return those of the named time series that a rigid slider has, in the rig's
        units.
        """
        slider = self.rig.natural.slider
        assert not isinstance(slider, ElasticBody)
        found = {"time": self.track.times, **series_of(self.track, slider)}
        return {
            name: found[name] * self.rig.unit(LABELS[name]["units"])
            for name in names
            if name in found
        }

    def longer(self, duration: float) -> Recording:
        """Return the run continued to a duration, at the final speed of its drive."""
        drive = self.rig.drive
        return self.then(constant(drive.pieces[-1].end, duration - drive.duration))

    def then(
        self, more: Drive, progress: Progress | None = None, state: bool = False
    ) -> Recording:
        """Return the run continued along another drive; `state` is as in `Output`."""
        engine = self.engine.copy()
        interval = sample_interval(self.rig, engine.angle)
        rig = replace(
            self.rig,
            drive=self.rig.drive.then(more),
            output=replace(self.rig.output, interval=interval, state=state),
        )
        times = _sample_times(rig, engine.angle)[self.track.times.size :]
        load = load_points(rig.drive)
        track = follow(
            engine, more, self.track.end, times, (), progress, self.track, load
        )
        return Recording(rig, track, engine)


def record(
    rig: Rig,
    *,
    progress: Progress | bool | None = None,
    long: bool = False,
    estimated: bool = True,
) -> Recording:
    """Run a rig, with arguments as in `simulate`.

    A search that counts its runs passes ``estimated=False`` to skip the estimate.
    """
    case = rig.natural
    _check(case)
    _check_arrest(case)
    instance("simulate: long", long, bool, "True or False")
    solver = engine_of(case.interface, case.method, case.slider)
    _check_drive(rig, solver)
    if estimated:
        work = estimate(rig)
        if not long:
            work.check()
        announce(rig.name, work.seconds, work.longest.what)
    load = load_points(case.drive)
    first = float(np.interp(0.0, *load.T)) if load.size else 1.0
    beginning = Beginning(
        case.interface, case.slider, case.drive.velocity, case.start, first
    )
    times = _sample_times(case, solver.angle)
    with reporting(progress, "simulate") as report:
        engine = solver(beginning, case.method)
        origin = beginning.drive_position(engine.contact_force())
        looks = case.output.snapshots
        track = follow(engine, case.drive, origin, times, looks, report, load=load)
    return Recording(rig, track, engine)


def _gone_on(
    rig: Rig, run: xr.Dataset, progress: Progress | bool | None, long: bool
) -> Recording:
    """Continue a run along the drive of a rig that is otherwise the same."""
    before = rig_of(run)
    changed = ("drive", "output", "start", "operation", "name")
    alike = replace(rig, **{name: getattr(before, name) for name in changed})
    if alike != before:
        parts = ("interface", "slider", "method", "scales")
        others = [p for p in parts if getattr(rig, p) != getattr(before, p)]
        raise InputError(
            f"simulate: start: the run is of another rig ({', '.join(others)}); only "
            "the drive may change, give the rig that it was made of"
        )
    if rig.output.snapshots:
        raise InputError(
            "Output.snapshots: not available where a run goes on; leave them out"
        )
    if not long:
        estimate(rig).check()
    track, engine = states.kept(run)
    with reporting(progress, "simulate") as report:
        return Recording(before, track, engine).then(
            rig.drive, report, rig.output.state
        )


def estimate(rig: Rig) -> Work:
    """Return the work of a run of a rig; `InputError` if no solver supports it."""
    instance("estimate: rig", rig, Rig, "a Rig(interface, slider, drive)")
    engine = engine_of(rig.interface, rig.method, rig.slider)
    _check_drive(rig, engine)
    costed = _with_velocities(rig)
    parts = engine.cost(costed, rig.method, course_of(costed))
    work = Work(rig=rig, parts=parts)
    if work.bytes > LARGEST:  # the choice of samples would need arrays as large
        return work
    others = *pieces_and_looks(rig, engine.piece), sampling(rig, engine.angle)
    return replace(work, parts=work.parts + others)


def _with_velocities(rig: Rig) -> Rig:
    """Return a rig with a drive by velocity whose contacts break at least as often.

    A force is replaced by the velocity that it gives a free mass, and a smaller load by
    a longer path.
    """
    drive = rig.drive
    least = min((point.load for point in drive.load), default=1.0)
    if drive.force:
        largest = max(abs(f) for each in drive.force for f in (each.start, each.end))
        slider = rig.slider
        # the velocity of free flight, at most that which damping allows
        fastest = largest / slider.mass / max(slider.damping, 1.0 / drive.duration)
        with suppress(InputError):  # static friction is not known where contacts age
            fastest *= largest > least * static_friction(rig.interface)[0]
        drive = ramp(0.0, fastest, drive.duration)
    slower = converted(drive, lambda x, unit: x / least if unit == "x_s/time" else x)
    return replace(rig, drive=slower)


def pull_rigidly(
    interface: Interface, distance: float, velocity: float, method: Method, points: int
) -> Track:
    """Move a rigid slider at a constant velocity, with samples at ``points + 1``
    positions, for `rigid_slide`.
    """
    duration = distance / velocity
    engine = engine_of(interface, method)(Beginning(interface, None, velocity), method)
    return follow(
        engine,
        constant(velocity, duration),
        0.0,
        np.linspace(0.0, duration, points + 1),
    )


def rerun(run: xr.Dataset, progress: Progress | bool | None = None) -> xr.Dataset:
    """Make a run again from its provenance: the same numbers, bit for bit.

    Parameters
    ----------
    run : xarray.Dataset
        A run of `simulate`, as returned or from a file.
    progress : bool or callable, optional
        True for a progress bar, or a function that is called with the completed
        fraction of the drive.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the Dataset carries no provenance of `simulate`.

    Examples
    --------
    >>> run = ss.simulate(ss.example("precision_stage"))
    >>> ss.rerun(run).identical(run)
    True
    """
    return simulate(rig_of(run), progress=progress, long=True)


def rig_of(run: xr.Dataset) -> Rig:
    """Return the rig of a run, with its method, start and output; `InputError` without
    provenance.
    """
    content = store.read_provenance(run)
    if content["call"] != "simulate":
        raise InputError(
            f"this file was made by {content['call']!r}, not by `simulate`"
        )
    try:
        arguments = store.decode(content["arguments"], store.records())
        rig = arguments["rig"] if arguments.keys() == {"rig"} else None
    except RecursionError:
        rig = None
    instance(
        "the provenance in this file", rig, Rig, "that of a rig; make the run again"
    )
    assert isinstance(rig, Rig)
    return rig


def _check(rig: Rig) -> None:
    slider = rig.slider
    drive = rig.drive
    snapshots = rig.output.snapshots
    bodies = (Slider, Mass, ElasticBody, Structure)
    instance(
        "simulate: Rig.slider",
        slider,
        bodies,
        "a Slider, a Chain or a structure of `stickslip.model`; other impedances are "
        "for `stability`",
    )
    if not isinstance(slider, Structure) and slider.mass == 0:
        raise InputError(
            "Slider.mass = 0: a simulation needs a mass above 0; the massless limit is "
            "for stability and, at a "
            "temperature, for velocity_step and slide_hold_slide"
        )
    if snapshots and snapshots[-1] > drive.duration:
        raise InputError(
            f"Output.snapshots: {snapshots[-1]:g} lies beyond the end of the drive "
            f"({drive.duration:g})"
        )


_LOADED = {"newborn", "slip_to_slip_scatter", "on_arrest", "ageing"}
_SCALED = TabulatedGrowth | ExponentialGrowth | None
"""Mechanisms that a load may act on, as all their forces and lengths are proportional
to a threshold, and the types of ageing, from zero strength, for which this holds.
"""


def _check_drive(rig: Rig, engine: type[Engine]) -> None:
    """Raise `InputError` for a load or a force that the engine does not support, or a
    force on a spring.
    """
    drive = rig.drive
    if bool(drive.force) != isinstance(rig.slider, Mass):
        raise InputError(
            "Drive.force: pulls a Mass, and a velocity the spring of any other slider; "
            "give both, as pull(0.6, duration=10) and Mass(mass=1.0)",
            "Drive.force",
        )
    if drive.load:
        ageing = rig.interface.ageing
        alike = isinstance(ageing, _SCALED) and not getattr(ageing, "newborn", 0.0)
        taken = _LOADED if alike else _LOADED - {"ageing"}
        rig.interface.allow(taken, "Drive.load", "")
    part = "force" if drive.force else "load"
    if getattr(drive, part) and not engine.takes_loads:
        raise InputError(
            f"Drive.{part}: takes Contacts on a rigid slider, without Langevin, not "
            f"{type(rig.method).__name__} on a {type(rig.slider).__name__}; use these, "
            "or leave it out",
            f"Drive.{part}",
        )


def _check_arrest(rig: Rig) -> None:
    """Raise `InputError` for a hold in which a slider creeps to rest, so that the
    method detects no arrest.

    A free slider overshoots by ``exp(-pi zeta/sqrt(1 - zeta^2))`` of its displacement,
    and not at all from ``zeta = 1`` on.
    """
    slider = rig.slider
    method = rig.method
    holds = any(piece.start == piece.end == 0 for piece in rig.drive.pieces[1:])
    if (
        not holds
        or not isinstance(rig.interface.delay, OnArrest)
        or not isinstance(slider, Slider)
        or not slider.mass
    ):
        return
    seen = math.log(
        10.0 * method.rtol
        if isinstance(method, MasterEquation | Population)
        else np.finfo(float).eps
    )
    most = -seen / math.hypot(math.pi, seen)
    if slider.damping_ratio > most:
        raise InputError(
            f"Slider.damping: at the damping ratio {slider.damping_ratio:.3g} the "
            "slider creeps to rest in a hold, "
            f"and {type(method).__name__} sees no arrest at which contacts re-attach "
            "(OnArrest); give a damping ratio "
            f"below {most:.2g}, or a Delay",
            "Slider.damping",
        )


def _sample_times(rig: Rig, angle: float) -> Array:
    duration = rig.drive.duration
    interval = sample_interval(rig, angle)
    count = duration / interval
    if count > 50_000_000:
        raise InputError(
            f"Output.interval = {interval:g}: {count:.3g} samples; choose at least "
            f"{duration / 5e7:g}"
        )
    times = interval * np.arange(math.floor(count * (1 + 1e-12)) + 1)
    # A sample at the joint of two pieces lies on it exactly, as the last one does on
    # the end: a continued run has the same samples as one made in one piece.
    seams = np.cumsum([piece.duration for piece in rig.drive.parts])
    near = np.minimum(np.rint(seams / interval).astype(int), times.size - 1)
    on = np.abs(times[near] - seams) <= 1e-12 * seams
    times[near[on]] = seams[on]
    return np.asarray(np.minimum(times, duration))

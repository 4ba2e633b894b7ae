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
    """Pull a slider on an interface by a spring, Eq. (11); an elastic one by one spring
    or many.

    Parameters
    ----------
    rig : Rig
        Interface, slider and drive.
    method : Contacts, MasterEquation or QuasiStatic, optional
        By default the rig's own.
    start : FromRest, FromSliding, Prestressed or xarray.Dataset, optional
        By default the rig's own. From a run that was made with
        ``output=Output(state=True)`` this one goes on, with the rig's drive as what
        comes next: the Dataset is that of both, bit for bit as if made in one piece,
        with the samples at the interval of the first.
    output : Output, optional
        Sampling and snapshots, as a rig holds them: in its unit of time, which is the
        second for one from a file; by default the rig's own. It
        never changes the motion of contacts that do not age; those that age are
        followed in steps, which end at the samples.
    progress : bool or callable, optional
        True for a bar, or a function that is called with the fraction of the drive that
        is done.
    long : bool
        Whether it may take more than an hour, or 4 GB of memory, by the estimate made
        before it starts. Where that is more than a minute, it is logged (logger
        ``stickslip``): one line on standard error, by default.

    Returns
    -------
    xarray.Dataset
        In the rig's own units, on ``time``: ``displacement`` and ``velocity`` of the
        slider, ``spring_force`` and ``friction_force``, ``attached`` (fraction),
        ``drive_velocity``, and the energies ``work``, ``kinetic_energy``,
        ``spring_energy``, ``contact_energy``, ``damped_energy``, ``broken_energy``;
        with snapshots, ``stretching_density`` on ``(snapshot, stretching)``. In natural
        units forces and energies are per contact, in ``f_s`` and ``f_s x_s``. The
        attribute ``provenance`` says how to make it again; see `rerun`. With
        thresholds that age ``work`` and the energies of contacts, damping and breaks
        are left out: breaks cannot be counted there (their rate diverges for newborns
        without strength).

        Of a `Chain` or a `Sheet`, on ``time`` and ``block``: ``displacement``,
        ``velocity``, ``friction_force`` (per contact of a block), ``attached``, and
        ``broken`` (breaks per contact since the start). ``spring_force`` and the
        energies, ``bulk_energy`` and ``viscous_energy`` among them, are sums over
        blocks, per contact of a block; ``pulling_force`` is that of each driving
        spring. Once for each ``block``: ``first_break`` (of infinitely many contacts,
        that of a thousandth), ``first_break_force``, ``half_detached``. See `fronts`
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
    """A run as its engine left it, in natural units, which becomes a Dataset only
    where one is wanted.
    """

    rig: Rig
    track: Track
    engine: Engine  # as it stands at the end

    def dataset(self) -> xr.Dataset:
        """The run with names, units and provenance, in the rig's units."""
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
        """Variables along time of a slider without blocks, of those that it has, in
        the rig's units.
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
        """The run gone on with to a duration, at the speed that its drive ends with:
        by a piece more.
        """
        drive = self.rig.drive
        return self.then(constant(drive.pieces[-1].end, duration - drive.duration))

    def then(
        self, more: Drive, progress: Progress | None = None, state: bool = False
    ) -> Recording:
        """The run gone on with along a drive more; whether it keeps its `state`."""
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
    """Run a rig, as `simulate` does, whose arguments these are; a search that counts
    its runs has none of them `estimated`.
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
    """Go on from the end of a run, along the drive of a rig that is else the same."""
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
    """Return what a run of a rig would take; `InputError` if no solver takes it."""
    engine = engine_of(rig.interface, rig.method, rig.slider)
    _check_drive(rig, engine)
    costed = _with_velocities(rig)
    parts = engine.cost(costed, rig.method, course_of(costed))
    work = Work(rig=rig, parts=parts)
    if work.bytes > LARGEST:  # as arrays of all blocks are, by which samples are chosen
        return work
    others = *pieces_and_looks(rig, engine.piece), sampling(rig, engine.angle)
    return replace(work, parts=work.parts + others)


def _with_velocities(rig: Rig) -> Rig:
    """Return a rig whose contacts break as often, at most: with the velocity of a free
    mass in place of a force, and a longer way in place of a smaller load.
    """
    drive = rig.drive
    least = min((point.load for point in drive.load), default=1.0)
    if drive.force:
        largest = max(abs(f) for each in drive.force for f in (each.start, each.end))
        slider = rig.slider
        # in free flight, and at most as fast as damping allows
        fastest = largest / slider.mass / max(slider.damping, 1.0 / drive.duration)
        with suppress(InputError):  # not known where contacts age
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
        Of `simulate`, as it was or from a file.
    progress : bool or callable, optional
        True for a bar, or a function that is called with the fraction of the drive that
        is done.

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
    """Return the rig that a run was made of, with its method, start and output;
    `InputError` without provenance.
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
"""Mechanisms whose forces and lengths are all in proportion to a threshold, and kinds
of ageing, from nothing.
"""


def _check_drive(rig: Rig, engine: type[Engine]) -> None:
    """Raise `InputError` for a load or a force that cannot be taken, or a force on a
    spring.
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
    """Raise `InputError` for a hold in which a slider comes to rest without a turn that
    the method could see.

    A free slider overshoots by ``exp(-pi zeta/sqrt(1 - zeta^2))`` of its way, and by
    nothing from ``zeta = 1`` on.
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
    # The sample of a seam lies on it, rounding aside, as the last one does on the end:
    # a run that goes on has the same as one in one piece.
    seams = np.cumsum([piece.duration for piece in rig.drive.parts])
    near = np.minimum(np.rint(seams / interval).astype(int), times.size - 1)
    on = np.abs(times[near] - seams) <= 1e-12 * seams
    times[near[on]] = seams[on]
    return np.asarray(np.minimum(times, duration))

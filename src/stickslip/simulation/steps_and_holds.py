"""The two experiments of rate-and-state friction on contacts: velocity steps, and
slide-hold-slide.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from stickslip.errors import InputError, instance, sequence, shown, whole
from stickslip.io import datasets as store
from stickslip.model import (
    FixedGrowth,
    FromSliding,
    Interface,
    MasterEquation,
    Method,
    Rig,
    Slider,
)
from stickslip.model.drive import constant
from stickslip.simulation.driver import follow
from stickslip.simulation.engines import Beginning, Engine, engine_of
from stickslip.simulation.result import with_label

if TYPE_CHECKING:
    import xarray as xr

# fraction of the distance that is slid, and recorded, before the step
_APPROACH = 0.05


def velocity_step(
    rig: Rig | Interface,
    *,
    before: float | str,
    after: float | str,
    distance: float | str,
    stiffness: float | str = math.inf,
    method: Method | None = None,
    points: int = 2000,
) -> xr.Dataset:
    """Change the velocity suddenly in steady sliding, and record the friction force.

    The slider has no mass. It is driven rigidly or, with a finite `stiffness`, by a
    spring with which it is in balance at every moment.

    Parameters
    ----------
    rig : Rig or Interface
        The contacts, the method and the units.
    before, after : float or str
        Velocities of the drive, above 0, in the units of the rig (or as text,
        ``"10 um/s"``).
    distance : float or str
        Travel of the drive after the step, above 0, in the units of the rig.
    stiffness : float or str
        Stiffness of the driving spring, above 0: per contact in ``k``, or in the units
        of the rig; infinite for a rigid drive.
    method : Contacts, MasterEquation or Population, optional
        By default the rig's own; for an interface the master equation. Any interface
        that the method supports is allowed; a spring requires thermal activation, or
        `MasterEquation` with thresholds that grow.
    points : int
        Number of samples after the step.

    Returns
    -------
    xarray.Dataset
        On ``time``, 0 at the step: ``friction_force`` (equal to the spring force),
        ``displacement`` and ``velocity`` of the slider, 0 at the step, ``attached``,
        ``drive_velocity``. It begins a twentieth of the distance before the step.

    Raises
    ------
    InputError
        If a number is out of bounds, or the method does not support the interface.

    Examples
    --------
    >>> thresholds = ss.Gaussian(mean=1.0, std=0.3)
    >>> interface = ss.Interface(
    ...     thresholds=thresholds, activation=ss.Bell(width=0.01, attempts=1e6)
    ... )
    >>> run = ss.velocity_step(interface, before=1.0, after=10.0, distance=3.0)
    >>> change = float(run.friction_force[-1] - run.friction_force[0])
    >>> round(
    ...     change, 3
    ... )  # about A/2 ln(10) = .0115 less what a wide scatter takes, by theory
    0.01
    """
    import xarray as xr

    checked = _rig_of("velocity_step", rig, method)
    v = checked.read("velocity_step: before", before, "x_s/time")
    w = checked.read("velocity_step: after", after, "x_s/time")
    travel = checked.read("velocity_step: distance", distance, "x_s")
    count = whole("velocity_step: points", points, at_least=10, at_most=10_000_000)
    engine, origin, _ = _sliding(checked, v, "velocity_step", stiffness)
    first = max(round(_APPROACH * count), 2)
    approach = _APPROACH * travel / v
    times = np.append(
        np.linspace(0.0, approach, first + 1),
        approach + np.linspace(0.0, travel / w, count + 1)[1:],
    )
    track = follow(
        engine,
        constant(v, approach).then(constant(w, travel / w)),
        origin,
        times,
    )
    values = {
        name: track[name]
        for name in ("displacement", "velocity", "friction_force", "attached")
    }
    values["displacement"] = values["displacement"] - values["displacement"][first]
    values["drive_velocity"] = np.where(track.times <= approach, v, w)
    values["time"] = track.times - approach
    variables = {
        name: with_label(name, "time", value) for name, value in values.items()
    }
    arguments = {
        "rig": rig,
        "before": before,
        "after": after,
        "distance": distance,
        "stiffness": stiffness,
        "method": checked.method,
        "points": points,
    }
    provenance = store.provenance("velocity_step", arguments)
    return checked.in_its_units(xr.Dataset(variables, attrs={"provenance": provenance}))


def slide_hold_slide(
    rig: Rig | Interface,
    *,
    velocity: float | str,
    holds: Sequence[float | str],
    stiffness: float | str = math.inf,
    method: Method | None = None,
) -> xr.Dataset:
    """Stop the drive in steady sliding for a time and restart it; return how much the
    force relaxes and how high it peaks.

    Parameters
    ----------
    rig : Rig or Interface
        The contacts, the method and the units.
    velocity : float or str
        Velocity of the drive before and after the hold, above 0, in the units of the
        rig.
    holds : sequence of float or str
        Durations of the holds, each above 0, in the units of the rig. Each hold begins
        in the same steady sliding.
    stiffness : float or str
        Stiffness of the driving spring, as in `velocity_step`.
    method : Contacts, MasterEquation or Population, optional
        By default the rig's own; for an interface the master equation. Any interface
        that the method supports is allowed; a spring requires thermal activation, or
        `MasterEquation` with thresholds that grow.

    Returns
    -------
    xarray.Dataset
        One row for each ``hold``: ``relaxation``, the force at the end of the hold less
        that of sliding before it; ``peak``, the largest force afterwards less that of
        sliding; ``slip_to_peak``, the displacement of the slider from the end of the
        hold to the peak; and ``sliding_force`` of sliding before all holds, a mean over
        some displacement with `Contacts`.

    Raises
    ------
    InputError
        If a number is out of bounds, or the method does not support the interface.

    Examples
    --------
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.3),
    ...     activation=ss.Bell(width=0.01, attempts=1e6),
    ...     ageing=ss.LogarithmicGrowth(slope=0.02, time=1e-3),
    ... )
    >>> run = ss.slide_hold_slide(interface, velocity=1.0, holds=(100.0, 1000.0))
    >>> run.peak.round(3).values.tolist()  # healing: nearly .02 ln(10) a decade
    [0.089, 0.134]
    """
    import xarray as xr

    who = "slide_hold_slide"
    checked = _rig_of("slide_hold_slide", rig, method)
    v = checked.read(f"{who}: velocity", velocity, "x_s/time")
    listed = sequence(f"{who}: holds", holds, "times, such as (1.0, 10.0, 100.0)")
    times = np.array(
        [
            checked.read(f"{who}: holds[{i}]", value, "time")
            for i, value in enumerate(listed)
        ]
    )
    if not times.size:
        raise InputError(
            f"{who}: holds: must hold at least one time, such as (1.0, 10.0, 100.0)"
        )
    mean = checked.interface.threshold_distribution.moment(1)
    engine, origin, spring = _sliding(checked, v, who, stiffness)
    before = follow(
        engine,
        constant(v, mean / v),
        origin,
        np.linspace(0.0, mean / v, 401),
    )
    steady = float(before["friction_force"].mean())
    at_end = float(before["friction_force"][-1])
    origin += mean
    # far enough for the memory of a hold to decay, and for the spring to take up the
    # largest force
    travel = 2.0 * mean
    count = 8001
    rows = []
    if spring < math.inf:
        travel = travel + 2.0 * mean / spring
        count = 40_001
    for hold in times:
        again = engine.here()[0] + hold + np.linspace(0.0, travel / v, count)
        track = follow(
            engine.copy(),
            constant(0.0, hold).then(constant(v, travel / v)),
            origin,
            again,
        )
        force = track["friction_force"]
        best = int(np.argmax(force))
        rows.append(
            (
                force[0] - at_end,
                force[best] - steady,
                track["displacement"][best] - track["displacement"][0],
            )
        )
    columns = dict(
        zip(("relaxation", "peak", "slip_to_peak"), np.array(rows).T, strict=True)
    )
    columns["hold"] = times
    variables = {name: with_label(name, "hold", part) for name, part in columns.items()}
    variables["sliding_force"] = with_label("sliding_force", (), steady)
    arguments = {
        "rig": rig,
        "velocity": velocity,
        "holds": tuple(listed),
        "stiffness": stiffness,
        "method": checked.method,
    }
    provenance = store.provenance(who, arguments)
    return checked.in_its_units(xr.Dataset(variables, attrs={"provenance": provenance}))


def _rig_of(who: str, given: Rig | Interface, method: Method | None) -> Rig:
    """Return the rig that gives contacts, units and method; an interface alone has
    natural units.
    """
    instance(f"{who}: rig", given, (Rig, Interface), "a Rig or an Interface")
    rig = (
        given
        if isinstance(given, Rig)
        else Rig(given, Slider(stiffness=1.0, mass=1.0, damping=0.0), constant(1.0))
    )
    if method is not None or not isinstance(given, Rig):
        rig = replace(rig, method=MasterEquation() if method is None else method)
    return rig


def _sliding(
    rig: Rig,
    velocity: float,
    who: str,
    stiffness: float | str,
) -> tuple[Engine, float, float]:
    """Return an engine in steady sliding, the position of the drive, and the stiffness
    of its spring.
    """
    slider = None
    spring = math.inf
    interface = rig.interface
    if not (isinstance(stiffness, float) and stiffness == math.inf):
        spring = rig.read(f"{who}: stiffness", stiffness, "k")
        slider = Slider(stiffness=spring, mass=0.0, damping=0.0)
        growing = isinstance(rig.method, MasterEquation) and isinstance(
            interface.ageing, FixedGrowth
        )
        # without mass it would slip in zero time
        if interface.activation is None and not growing:
            raise InputError(
                f"{who}: Interface.activation = None: not available with a spring "
                f"(stiffness = {shown(stiffness)}); "
                "give a temperature, or use simulate(rig) with a slider that has a mass"
            )
    beginning = Beginning(interface, slider, velocity, FromSliding())
    engine = engine_of(interface, rig.method)(beginning, rig.method)
    return engine, beginning.drive_position(engine.contact_force()), spring

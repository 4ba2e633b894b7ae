"""The two experiments of rate and state, on contacts: velocity steps, and slide-hold-slide.

>>> import stickslip as ss
>>> interface = ss.Interface(
...     thresholds=ss.Gaussian(mean=1.0, std=0.3),
...     temperature=ss.Bell(width=0.01, attempts=1e6),
...     ageing=ss.LogarithmicGrowth(slope=0.02, time=1e-3),
... )
>>> run = ss.velocity_step(interface, before=1.0, after=10.0, distance=6.0)
>>> rise = float(run.friction_force.max() - run.friction_force[0])
>>> round(rise, 4)  # the direct effect: A ln(10), less what breaks meanwhile
0.0217
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError, instance, number, sequence, shown, whole
from stickslip.io import datasets as store
from stickslip.model import Contacts, FromSliding, Interface, MasterEquation, Method, Rig, Slider
from stickslip.model.drive import constant
from stickslip.model.quantities import read_quantity
from stickslip.simulation.engines import Beginning, Engine, engine_of
from stickslip.simulation.follow import follow
from stickslip.simulation.result import Labelled, labelled

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

_APPROACH = 0.05
"""Part of the distance that is slid at the velocity before a step, and recorded."""


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
    """Change the velocity in steady sliding at once, and record the friction force.

    The slider has no mass. It is rigidly driven or, with a finite `stiffness`, pulled by a spring, with which it is in
    balance at every moment.

    Parameters
    ----------
    rig : Rig or Interface
        Of a rig its contacts, its method and its units are taken.
    before, after : float or str
        Velocities of the drive, above 0, in the units of the rig (or as text, ``"10 um/s"``).
    distance : float or str
        How far the drive goes after the step, above 0, in the units of the rig.
    stiffness : float or str
        Of the driving spring, above 0: per contact in ``k``, or in the units of the rig; infinite for none.
    method : Contacts or MasterEquation, optional
        By default the rig's own; for an interface the master equation.
    points : int
        Samples after the step.

    Returns
    -------
    xarray.Dataset
        On ``time``, 0 at the step: ``friction_force`` (which is that of the spring), ``displacement`` and ``velocity``
        of the slider, 0 at the step, ``attached``, ``drive_velocity``. It begins a twentieth of the distance before the
        step.

    Raises
    ------
    InputError
        If a number cannot be, or the method cannot take the interface.

    Examples
    --------
    >>> import stickslip as ss
    >>> thresholds = ss.Gaussian(mean=1.0, std=0.3)
    >>> interface = ss.Interface(thresholds=thresholds, temperature=ss.Bell(width=0.01, attempts=1e6))
    >>> run = ss.velocity_step(interface, before=1.0, after=10.0, distance=3.0)
    >>> change = float(run.friction_force[-1] - run.friction_force[0])
    >>> round(change, 3)  # about A/2 ln(10) = .0115 less what a wide scatter takes, by theory
    0.01
    """
    import xarray as xr

    told = _natural(rig, "velocity_step", method, stiffness)
    v, w = (told.number(name, value, "x_s/time") for name, value in (("before", before), ("after", after)))
    way = told.number("distance", distance, "x_s")
    count = whole("velocity_step: points", points, at_least=10, at_most=10_000_000)
    engine, origin = told.sliding(v)
    first = max(round(_APPROACH * count), 2)
    approach = _APPROACH * way / v
    times = np.append(np.linspace(0.0, approach, first + 1), approach + np.linspace(0.0, way / w, count + 1)[1:])
    track = follow(engine, constant(v, approach).then(constant(w, way / w)), origin, times)
    start = track["displacement"][first]
    names = ("displacement", "velocity", "friction_force", "attached")
    values = {name: track[name] for name in names}
    values["displacement"] = values["displacement"] - start
    values["drive_velocity"] = np.where(track.times <= approach, v, w)
    provenance = store.provenance(
        "velocity_step",
        {
            "rig": rig,
            "before": before,
            "after": after,
            "distance": distance,
            "stiffness": stiffness,
            "method": told.method,
            "points": points,
        },
    )
    data = xr.Dataset(
        {name: labelled(name, "time", value) for name, value in values.items()},
        {"time": labelled("time", "time", track.times - approach)},
        {"provenance": provenance},
    )
    return told.in_its_units(data)


def slide_hold_slide(
    rig: Rig | Interface,
    *,
    velocity: float | str,
    holds: Sequence[float | str],
    stiffness: float | str = math.inf,
    method: Method | None = None,
) -> xr.Dataset:
    """Stop the drive in steady sliding for a time, go on, and tell how the force relaxes and how far it peaks.

    Parameters
    ----------
    rig : Rig or Interface
        Of a rig its contacts, its method and its units are taken.
    velocity : float or str
        Of the drive before and after, above 0, in the units of the rig.
    holds : sequence of float or str
        Times of rest, each above 0, in the units of the rig; of any length. Each begins in the same steady sliding.
    stiffness : float or str
        Of the driving spring, as in `velocity_step`.
    method : Contacts or MasterEquation, optional
        By default the rig's own; for an interface the master equation.

    Returns
    -------
    xarray.Dataset
        One row for each ``hold``: ``relaxation``, the force at the end of the hold less that of sliding before it;
        ``peak``, the largest force afterwards less that of sliding; ``slip_to_peak``, the displacement of the slider
        from the end of the hold to the peak; and ``sliding_force`` of sliding before all holds, a mean over some
        displacement with `Contacts`.

    Raises
    ------
    InputError
        If a number cannot be, or the method cannot take the interface.

    Examples
    --------
    >>> import stickslip as ss
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.3),
    ...     temperature=ss.Bell(width=0.01, attempts=1e6),
    ...     ageing=ss.LogarithmicGrowth(slope=0.02, time=1e-3),
    ... )
    >>> run = ss.slide_hold_slide(interface, velocity=1.0, holds=(100.0, 1000.0))
    >>> run.peak.round(3).values.tolist()  # healing: nearly .02 ln(10) a decade
    [0.089, 0.134]
    """
    import xarray as xr

    told = _natural(rig, "slide_hold_slide", method, stiffness)
    v = told.number("velocity", velocity, "x_s/time")
    listed = sequence("slide_hold_slide: holds", holds, "times, such as (1.0, 10.0, 100.0)")
    times = np.array([told.number(f"holds[{i}]", value, "time") for i, value in enumerate(listed)])
    if not times.size:
        raise InputError("slide_hold_slide: holds: must hold at least one time, such as (1.0, 10.0, 100.0)")
    mean = told.interface.threshold_distribution.moment(1)
    engine, origin = told.sliding(v)
    before = follow(engine, constant(v, mean / v), origin, np.linspace(0.0, mean / v, 401))
    steady, at_end = float(before["friction_force"].mean()), float(before["friction_force"][-1])
    origin += mean
    # As far as the memory of a hold goes, and what the spring takes up of the largest force meanwhile.
    way, count, rows = 2.0 * mean, 8001, []
    if told.stiffness < math.inf:
        way, count = way + 2.0 * mean / told.stiffness, 40_001
    for hold in times:
        again = engine.here()[0] + hold + np.linspace(0.0, way / v, count)
        drive = constant(0.0, hold).then(constant(v, way / v))
        track = follow(engine.copy(), drive, origin, again)
        force = track["friction_force"]
        best = int(np.argmax(force))
        slip = track["displacement"][best] - track["displacement"][0]
        rows.append((force[0] - at_end, force[best] - steady, slip))
    relaxation, peak, slip = np.array(rows).T
    provenance = store.provenance(
        "slide_hold_slide",
        {"rig": rig, "velocity": velocity, "holds": tuple(listed), "stiffness": stiffness, "method": told.method},
    )
    data = xr.Dataset(
        {
            "relaxation": _named(
                "hold", relaxation, "f_s", "force at the end of the hold less that of sliding, per contact"
            ),
            "peak": _named("hold", peak, "f_s", "largest force after the hold less that of sliding, per contact"),
            "slip_to_peak": _named("hold", slip, "x_s", "displacement from the end of the hold to the peak"),
            "sliding_force": _named((), np.asarray(steady), "f_s", "friction force of sliding, per contact"),
        },
        {"hold": _named("hold", times, "time", "time of rest")},
        {"provenance": provenance},
    )
    return told.in_its_units(data)


def _named(dims: str | tuple[str, ...], values: Array, units: str, name: str) -> Labelled:
    return dims, values, {"units": units, "long_name": name}


class _Told:
    """What a rig or an interface says, in natural units."""

    def __init__(self, who: str, interface: Interface, rig: Rig | None, method: Method, stiffness: float | str) -> None:
        self.who, self.interface, self.rig, self.method = who, interface, rig, method
        self.stiffness = self.number("stiffness", stiffness, "k", infinite=True)

    def number(self, name: str, value: float | str, unit: str, infinite: bool = False) -> float:
        """Read a number above 0 in the units of the rig."""
        place = f"{self.who}: {name}"
        if isinstance(value, str):
            if self.rig is None or self.rig.scales is None:
                raise InputError(f"{place} = {value!r}: must be a plain number, as there are no units but natural ones")
            value = read_quantity(value, self.rig.unit_name(unit), name)
        if infinite and value == math.inf:
            return value
        size = 1.0 if self.rig is None else self.rig.unit(unit)
        return number(place, value, above=0) / size

    def sliding(self, velocity: float) -> tuple[Engine, float]:
        """Return an engine in steady sliding, and where the drive is."""
        slider = None if math.isinf(self.stiffness) else Slider(stiffness=self.stiffness, mass=0.0, damping=0.0)
        beginning = Beginning(self.interface, slider, velocity, FromSliding())
        engine = engine_of(self.interface, self.method)(beginning, self.method)
        return engine, beginning.drive_position(engine.contact_force())

    def in_its_units(self, data: xr.Dataset) -> xr.Dataset:
        """Return a result in the units of the rig."""
        return data if self.rig is None else self.rig.in_its_units(data)


def _natural(rig: Rig | Interface, who: str, method: Method | None, stiffness: float | str) -> _Told:
    instance(f"{who}: rig", rig, (Rig, Interface), "a Rig or an Interface")
    interface = rig.interface if isinstance(rig, Rig) else rig
    chosen = method or (rig.method if isinstance(rig, Rig) else MasterEquation())
    instance(f"{who}: method", chosen, (Contacts, MasterEquation), "Contacts(...) or MasterEquation(...)")
    given: object = stiffness
    if not (isinstance(given, str) or (isinstance(given, float) and given == math.inf)):
        number(f"{who}: stiffness", given, above=0)
    if interface.temperature is None and (isinstance(chosen, Contacts) or stiffness != math.inf):
        what = "Contacts" if stiffness == math.inf else f"a spring (stiffness = {shown(stiffness)})"
        raise InputError(
            f"{who}: Interface.temperature = None: not available with {what}; give a temperature, or use simulate(rig) "
            "with a slider that has a mass"
        )
    return _Told(who, interface, rig if isinstance(rig, Rig) else None, chosen, stiffness)

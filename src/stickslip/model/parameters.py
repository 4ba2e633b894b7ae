"""The parameters of a rig, which can be read, set and varied by name."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from stickslip.errors import InputError, refused
from stickslip.model.body import Mass
from stickslip.model.drive import constant
from stickslip.model.records import Change, converted
from stickslip.model.units import Scales, natural_unit

if TYPE_CHECKING:
    from stickslip.model.rig import Rig


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One positive parameter of a `Rig` that can be read and set."""

    name: str
    unit: str  #: natural unit, ``"x_s/time"``, or its quantity, ``"velocity"``
    title: str = ""  #: its name in words
    zero: bool = False  #: whether it may be 0
    #: whether it is one of the rig's own units: varying it changes every quantity that
    #: has this unit
    rescales: bool = False
    #: parameter that stays constant when this one varies, though a rig file may give
    #: another quantity in its place that does not
    holds: str = ""
    #: the value in a rig in natural units
    get: Callable[[Rig], float] = field(repr=False)
    #: the same rig with another value
    set: Callable[[Rig, float], Rig] = field(repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "unit", natural_unit(self.unit))


_FIELDS = dict[str, dict[str, str]]()
"""For each part of a rig, its parameters and the fields that hold them."""


def _parameter_of_part(
    name: str, unit: str, title: str, part: str = "slider", field: str = "", **more: Any
) -> Parameter:
    """Make the parameter that reads and sets a field of the slider or of a part of the
    interface.

    Where the part has a method ``with_<field>``, that method sets it.
    """
    field = field or name
    _FIELDS.setdefault(part, {})[name] = field

    def held(rig: Rig) -> Any:
        found = rig.slider if part == "slider" else getattr(rig.interface, part)
        if not hasattr(found, field):
            where = "Rig" if part == "slider" else "Interface"
            fields = _FIELDS[part].items()
            others = [other for other, of in fields if hasattr(found, of)]
            remedy = "give one that has"
            if others:
                remedy = f"choose {', '.join(others)} or a Parameter of your own"
            kind = "None" if found is None else type(found).__name__
            raise InputError(f"{where}.{part}: {kind} has no {name} to vary; {remedy}")
        return found

    def set_(rig: Rig, new: float) -> Rig:
        found = held(rig)
        if hasattr(found, f"with_{field}"):
            found = getattr(found, f"with_{field}")(new)
        else:
            found = replace(found, **{field: new})
        if part == "slider":
            return replace(rig, slider=found)
        return replace(rig, interface=replace(rig.interface, **{part: found}))

    def get(rig: Rig) -> float:
        return float(getattr(held(rig), field))

    return Parameter(name=name, unit=unit, title=title, get=get, set=set_, **more)


@lru_cache
def damping_of_mode(number: int) -> Parameter:
    """Return the damping of a mode of `Modes` as a parameter, named ``damping_1`` and
    so on.
    """

    def dampings(rig: Rig) -> list[float]:
        found = [*getattr(rig.slider, "dampings", ())]
        if not 0 < number <= len(found):
            raise InputError(
                f"Rig.slider: has {len(found)} modes, none with the number {number}"
            )
        return found

    def set_(rig: Rig, new: float) -> Rig:
        found = dampings(rig)
        found[number - 1] = new
        return replace(rig, slider=replace(rig.slider, dampings=tuple(found)))

    return Parameter(
        name=f"damping_{number}",
        unit="1/time",
        title=f"damping of mode {number}",
        get=lambda rig: dampings(rig)[number - 1],
        set=set_,
    )


def _velocity(rig: Rig) -> float:
    if rig.drive.force:
        raise InputError(
            "Drive.force: is for runs alone, and this asks for a velocity; give one, "
            "and a slider on a spring, or simulate",
            "Drive.force",
        )
    if isinstance(rig.slider, Mass):
        raise InputError(
            f"Rig.slider = {rig.slider}: is pulled by a force, in runs alone, and this "
            "asks for a velocity; give a slider on a spring",
            "Rig.slider",
        )
    return rig.drive.velocity


def _set_velocity(rig: Rig, value: float) -> Rig:
    """Return the rig with the same path of the drive at another speed.

    A drive that is constant, or begins at rest, becomes a constant velocity over the
    same distance or duration.
    """
    drive = rig.drive
    before = VELOCITY.get(rig)
    if value == before:
        return rig
    if value > 0 and rig.operation.speeds:  # the first is the drive's velocity
        speeds = (value, *rig.operation.speeds[1:])
        rig = replace(rig, operation=replace(rig.operation, speeds=speeds))
    if before == 0 or drive == constant(before, drive.duration):
        longer = abs(before / value) if before and value else 1.0
        pieces = constant(value, drive.duration * longer).pieces
        return replace(rig, drive=replace(drive, pieces=pieces))
    if value * before <= 0:
        given, begin = (each * rig.unit("x_s/time") for each in (value, before))
        raise InputError(
            f"velocity = {given:g}: the drive begins with {begin:g}, not this way; "
            "give another drive"
        )
    return replace(rig, drive=drive.faster(value / before))


STIFFNESS = _parameter_of_part(
    "stiffness",
    "k",
    "stiffness of the driving spring",
    holds="damping",
)
"""Stiffness of the driving spring ``K/N``."""
MASS = _parameter_of_part(
    "mass",
    "f_s time^2/x_s",
    "mass of the slider",
    zero=True,
    holds="damping",
)
"""Mass ``M/N``."""
DAMPING = _parameter_of_part("damping", "1/time", "damping eta", zero=True)
"""``eta`` of Eq. (11)."""
VELOCITY = Parameter(
    name="velocity",
    unit="x_s/time",
    title="speed",
    get=_velocity,
    set=_set_velocity,
)
"""Velocity of the drive at its beginning; the path of the drive is unchanged."""
DELAY = _parameter_of_part(
    "delay",
    "time",
    "delay of re-attachment",
    "delay",
    "mean",
    zero=True,
)
"""Delay time; the mean of a `RandomDelay`, whose standard deviation is scaled in
proportion.
"""
STD = _parameter_of_part(
    "std",
    "1",
    "standard deviation of the thresholds",
    "thresholds",
)
"""Standard deviation of the thresholds at constant mean: the field ``std`` of the
distribution, or ``with_std`` of a histogram.
"""
AGEING = _parameter_of_part(
    "ageing",
    "time",
    "time of ageing of the thresholds",
    "ageing",
    "time",
)
"""Time in which thresholds age: ``rate**-2`` in `Langevin`."""


def _unit_of_the_rig(
    name: str,
    unit: str,
    title: str,
    force: int,
    length: int,
    holds: str = "",
) -> Parameter:
    """Make a parameter that is a unit of the rig, 1 in natural units.

    The units of force and length are proportional to it to the powers `force` and
    `length`.
    """

    def set_(rig: Rig, value: float) -> Rig:
        STIFFNESS.get(rig)  # raises for an impedance, whose unit cannot be changed
        factor = value / BY_NAME[name].get(rig)
        larger = Scales(force=factor**force, stretching=factor**length)
        scales = rig.scales
        # natural, so per contact: it stays as the number of contacts follows the load
        kept: Any = {"normal_load": rig.operation.normal_load} if name == "load" else {}
        ranges = converted_ranges(rig.operation.feasible, larger.natural)
        return replace(
            rig,
            slider=converted(rig.slider, larger.natural),
            drive=converted(rig.drive, larger.natural),
            operation=replace(
                converted(rig.operation, larger.natural),
                feasible=ranges,
                **kept,
            ),
            scales=scales
            and replace(
                scales,
                force=scales.si(larger.force, "f_s"),
                stretching=scales.si(larger.stretching, "x_s"),
            ),
        )

    def get(rig: Rig) -> float:
        return (name == "load" and rig.operation.normal_load) or 1.0

    return Parameter(
        name=name,
        unit=unit,
        title=title,
        rescales=True,
        holds=holds,
        get=get,
        set=set_,
    )


LOAD = _unit_of_the_rig("load", "f_s", "normal load or contact strength", 1, 0)
"""Number of contacts, which is proportional to the normal load; measured by the normal
load where it is known, else by the contact strength.
"""
FRICTION = _unit_of_the_rig("friction", "f_s", "level of friction", 1, 1, "delay")
"""Strength of each contact at constant stiffness; its breaking displacement is
proportional to it.
"""
CONTACT_STIFFNESS = _unit_of_the_rig(
    "contact_stiffness",
    "k",
    "stiffness of the contacts (lining)",
    0,
    -1,
    "delay",
)
"""Stiffness of each contact at constant strength; its breaking displacement is
inversely proportional to it.
"""

PARAMETERS: tuple[Parameter, ...] = (
    STIFFNESS,
    VELOCITY,
    MASS,
    DAMPING,
    DELAY,
    STD,
    AGEING,
)
"""The parameters that come with the package."""

UNITS_OF_A_RIG: tuple[Parameter, ...] = (LOAD, FRICTION, CONTACT_STIFFNESS)
"""Units of the rig as parameters: 1 in natural units, each varied alone."""

_OF_BODIES = (
    _parameter_of_part("coupling", "k", "coupling of neighbouring blocks"),
    _parameter_of_part(
        "leaf",
        "k",
        "stiffness of the spring from each block to the drive",
        zero=True,
    ),
    _parameter_of_part(
        "side",
        "k",
        "stiffness of the spring from the first block to the drive",
        zero=True,
    ),
)
_OF_CONTROLLERS = tuple(
    _parameter_of_part(name, unit, f"{kind} gain of the controller", zero=name != "kp")
    for name, unit, kind in (
        ("kp", "k", "proportional"),
        ("ki", "k/time", "integral"),
        ("kd", "f_s time/x_s", "derivative"),
    )
)
_SHIPPED = (*PARAMETERS, *_OF_BODIES, *_OF_CONTROLLERS, *UNITS_OF_A_RIG)

BY_NAME = {parameter.name: parameter for parameter in _SHIPPED}
"""All parameters by name, including those added by `register`."""


def register(parameter: Parameter) -> Parameter:
    """Make a parameter known by its name to `Rig.replace`, `critical` and every
    function that varies parameters.

    Raises `InputError` if the name is that of a parameter that comes with the package.
    """
    if any(parameter.name == known.name for known in _SHIPPED):
        words = "comes with the package; choose another name"
        raise refused("Parameter.name", parameter.name, words)
    BY_NAME[parameter.name] = parameter
    return parameter


def parameter_named(parameter: Parameter | str, place: str = "parameter") -> Parameter:
    """Return the parameter itself, or the one registered by that name.

    Raises `InputError` if there is none; its message begins with `place`.
    """
    if isinstance(parameter, Parameter):
        return parameter
    mode = re.fullmatch(r"damping_(\d+)", str(parameter))
    if mode:
        return damping_of_mode(int(mode[1]))
    try:
        return BY_NAME[parameter]
    except (KeyError, TypeError):
        known = f"must be one of {', '.join(BY_NAME)}, or a Parameter"
        raise refused(place, parameter, known) from None


def converted_ranges(
    ranges: Iterable[tuple[str, float, float]], change: Change
) -> tuple[tuple[str, float, float], ...]:
    """Return ranges of named parameters with `change` applied to both ends."""
    units = {name: parameter_named(name).unit for name, *_ in ranges}
    return tuple(
        (name, change(low, units[name]), change(high, units[name]))
        for name, low, high in ranges
    )

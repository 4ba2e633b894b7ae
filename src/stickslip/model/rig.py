"""The rig: an interface, the slider on it and its drive, with the units of its
numbers.
"""

import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass, field, replace
from numbers import Real
from typing import TYPE_CHECKING, Annotated, Any, Self

from stickslip.answers import Answer
from stickslip.arrays import Range
from stickslip.errors import InputError, instance, number, pair, refused, sequence
from stickslip.model.body import ElasticBody, Mass
from stickslip.model.drive import Drive
from stickslip.model.interface import Interface
from stickslip.model.measured_friction import MeasuredFriction
from stickslip.model.methods import (
    METHODS,
    FromRest,
    MasterEquation,
    Method,
    Output,
    Start,
    check_start,
)
from stickslip.model.parameters import LOAD, PARAMETERS, Parameter, parameter_named
from stickslip.model.quantities import read_number, read_value
from stickslip.model.records import AnyRecord, Number, Part, Record, check, converted
from stickslip.model.units import Scales, in_si, in_words, natural_unit, si_unit

if TYPE_CHECKING:
    import xarray as xr

Ends = tuple[float | str, float | str]
"""Both ends of the range of a parameter: numbers in the rig's own unit, or texts with a
unit.
"""

USUAL_RANGE = 30.0
"""Factor by which a parameter is varied up and down from its value in the rig if no
range is given.
"""
_NATURAL = Scales(force=1.0, stretching=1.0)
_KEYS_OF = {
    "damping": {"damping", "damping_ratio"},
    "delay": {"delay", "v_half"},
    "std": {"thresholds"},
    "load": {"contact_strength", "normal_load"},
    "friction": {"contact_strength", "breaking_displacement"},
    "contact_stiffness": {"breaking_displacement"},
}
"""Keys of a rig file that a parameter sets, where their names differ from its own."""

_Speeds = tuple[
    Annotated[float, Number("x_s/time", above=0, hint="speeds, such as (0.5, 2.0)")],
    ...,
]


@dataclass(frozen=True, kw_only=True)
class Operation(Record):
    """How a rig is used: it does not affect runs, only questions about the rig.

    Ranges must increase, and all numbers are above 0.
    """

    speeds: _Speeds = ()  #: speeds of operation, that of the drive first
    between: _Speeds | None = None  #: a range of speeds, in place of single speeds
    #: normal load, if it is known; the parameter `load` is then this
    normal_load: Annotated[float | None, Number("f_s", above=0)] = None
    #: friction measured at several speeds, from which the growth of thresholds was made
    friction: Annotated[
        MeasuredFriction | None, Part("a MeasuredFriction, or None")
    ] = field(default=None, compare=False)
    #: parameters, each with the range that can be built or set
    feasible: tuple[tuple[str, float, float], ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        words = "a name and two values, such as ('delay', 0.1, 0.5)"
        rows = [sequence("Operation.feasible", row, words) for row in self.feasible]
        object.__setattr__(self, "feasible", tuple(rows))
        ranges: dict[str, Any] = {"between": self.between or (1.0, 2.0)}
        for row in rows:
            if len(row) != 3 or not isinstance(row[0], str):
                raise refused("Operation.feasible", row, f"must be {words}")
            parameter_named(row[0], "Operation.feasible")
            ranges[f"feasible[{row[0]}]"] = row[1:]
        for name, ends in ranges.items():
            place = f"Operation.{name}"
            low, high = (
                number(f"{place}[{i}]", end, above=0)
                for i, end in enumerate(pair(place, ends, "the two ends of a range"))
            )
            if high < low or (high == low and name == "between"):
                raise InputError(
                    f"Operation.{name} = ({low:g}, {high:g}): must increase",
                    f"Operation.{name}",
                )

    def range_of(self, parameter: str) -> Range | None:
        """Return the feasible range of a parameter; None if it is unknown."""
        return {name: (low, high) for name, low, high in self.feasible}.get(parameter)


@dataclass(frozen=True)
class Assumption(Record):
    """A value of a rig that was not measured: the value, and how to measure it, as
    text.
    """

    value: str  # as written in the rig's file; empty if the file does not have it
    how: str
    default: bool = False  # whether the file does not have it and a default was taken
    # the interval in which it may lie, as written in the file, if given
    between: tuple[Any, ...] = ()
    factors: tuple[float, ...] = ()  # both ends of that interval over the value

    @property
    def value_in_words(self) -> str:
        """The value, whether it is a default, and the interval in which it may lie."""
        value = f"{self.value} (default)" if self.default else self.value
        return (
            f"{value}, between {' and '.join(map(str, self.between))}"
            if self.between
            else value
        )

    def __str__(self) -> str:
        return "; ".join(part for part in (self.value_in_words, self.how) if part)


@dataclass(frozen=True)
class Fitted(Record):
    """A value of a rig that was fitted to a measured trace."""

    value: str  # as written in the rig's file
    interval: str  # 90 % interval, as text
    # how well the trace determines it (identified, weak, not identified, at a bound, or
    # assumed) and why
    how: str
    # equally likely values in SI units; the i-th draws of all keys belong together
    draws: tuple[float, ...] = ()

    def __str__(self) -> str:
        return f"{self.value} ({self.interval}); {self.how}"


def _without(keys: set[str], notes: Mapping[str, Any]) -> dict[str, Any]:
    """Return notes on keys of a rig file, less those whose path has one of `keys`."""
    return {path: each for path, each in notes.items() if not keys & {*path.split(".")}}


@dataclass(frozen=True, repr=False)
class Rig(Answer):
    """A slider on an interface, pulled by a drive through a spring: the argument of
    most functions of this package.

    Its records are in natural units. Functions that take a rig take and return numbers
    in the rig's own units: SI if it has `scales`, as a rig from a file has, else
    natural.

    Parameters
    ----------
    interface : Interface
        The contacts.
    slider : Slider, Chain, Sheet or impedance
        The body on the contacts, with its driving spring or springs; a `Chain` or a
        `Sheet` is elastic. For the linear stability of smooth sliding it may be any
        mechanical impedance of `stickslip.stability`.
    drive : Drive
        Motion of the far end of the spring.
    method : Contacts, MasterEquation, Population or QuasiStatic
        How the rig is simulated, unless `simulate` is given another method; likewise
        `start` and `output`.
    start : FromRest, FromSliding or Prestressed
        The state that a run starts from.
    output : Output
        The samples that a run records.
    scales : Scales, optional
        The rig's force, length and time in SI units; None for a rig in natural units.
    operation : Operation
        The speeds it works at, and the ranges in which it could be built, in natural
        units; for `predict`.
    name : str
        Name of the rig.
    assumed : mapping of str to Assumption
        Keys of the rig's file that were not measured, and the defaults in use.
    fitted : mapping of str to Fitted
        Keys of the rig's file that were fitted to a trace, with intervals and draws.
    source : str
        Where the numbers come from.
    given : tuple of str
        Keys that the rig's file gives in place of others, such as
        ``"interface.mu_s"``, so that the rig can be written with them again.

    Examples
    --------
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.2)
    ... )
    >>> rig = ss.Rig(
    ...     interface,
    ...     ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4),
    ...     ss.constant(velocity=1.0),
    ... )
    >>> rig.replace(stiffness=5.0).slider.stiffness
    5.0
    """

    interface: Annotated[Interface, Part("an Interface")]
    slider: Any
    drive: Annotated[Drive, Part("a drive, made with constant() or ramp()")]
    _: KW_ONLY
    method: Method = MasterEquation()
    start: Annotated[Start, Part("FromRest(), FromSliding() or Prestressed(...)")] = (
        FromRest()
    )
    output: Annotated[Output, Part("an Output")] = Output()
    scales: Annotated[Scales | None, Part("Scales(...), or None for natural units")] = (
        None
    )
    operation: Annotated[Operation, Part("an Operation(...)")] = Operation()
    name: str = "rig"
    assumed: Mapping[str, Assumption] = field(default_factory=dict, compare=False)
    fitted: Mapping[str, Fitted] = field(default_factory=dict, compare=False)
    source: str = field(default="", compare=False)
    given: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        check(self)
        known = (
            hasattr(self.slider, "stiffness")
            or callable(self.slider)
            or isinstance(self.slider, ElasticBody | Mass)
        )
        if isinstance(self.slider, type) or not known:
            raise InputError(
                f"Rig.slider = {self.slider!r}: must be a Slider, a Chain or a Sheet, "
                "or an impedance: a function of s"
            )
        instance(
            "Rig.method",
            self.method,
            tuple(METHODS.values()),
            "Contacts(...) or MasterEquation(...)",
        )
        check_start(self.start, self.slider)

    @property
    def natural(self) -> Self:
        """The same rig in natural units, as every solver takes it."""
        return self if self.scales is None else replace(self, scales=None)

    @property
    def velocity(self) -> float:
        """Velocity of the drive at its beginning, in the rig's own units.

        Theory at one velocity holds for the load at which the strength of the contacts
        is given: raises `InputError` if the drive has a load of its own, or a force in
        place of a velocity.
        """
        if self.drive.load:
            raise InputError(
                "Drive.load: is for runs alone; leave it out, and ask at another load "
                "by rig.replace(friction=...), or simulate",
                "Drive.load",
            )
        return self.value("velocity")

    def value(self, parameter: Parameter | str) -> float:
        """Return the value of a parameter, such as ``"stiffness"``, in the rig's own
        units.
        """
        known = parameter_named(parameter)
        return known.get(self) * self.unit(known.unit)

    def unit(self, natural: str) -> float:
        """Size of a natural unit in the rig's own units; the unit is given as
        ``"x_s/time"``, or by its quantity, ``"velocity"``.

        Raises `InputError` if there is no such unit or quantity.
        """
        return (self.scales or _NATURAL).unit(natural)

    def unit_name(self, natural: str) -> str:
        """Name of the rig's own unit for a natural unit or a quantity as in `unit`,
        such as ``"m/s"``.
        """
        return natural_unit(natural) if self.scales is None else si_unit(natural)

    if not TYPE_CHECKING:  # type checkers see only the attributes defined here

        def __getattr__(self, name: str) -> Any:
            verb = not name.startswith("_") and name in dir(sys.modules["stickslip"])
            raise AttributeError(
                f"Rig has no {name!r}"
                + (f"; write stickslip.{name}(rig)" if verb else "")
            )

    def replace(self, **changes: Any) -> "Rig":
        """Return the rig with some of its parts or parameters changed.

        Parameters
        ----------
        **changes
            A field of this record, in natural units as the record holds it, so that
            ``rig.replace(drive=rig.drive) == rig``; see `to_natural`. Or a parameter by
            name, with a text with a unit, or a number for a rig in natural units:
            ``velocity``, ``stiffness``, ``mass``, ``damping``, ``delay``, ``std``,
            ``ageing``.

        Raises
        ------
        InputError
            If there is no such part or parameter, the value is out of bounds, or a
            quantity of a rig in SI units has no unit; see `with_values`.

        Examples
        --------
        >>> rig = ss.read_rig("brake_pad")
        >>> round(rig.replace(velocity="50 mm/s").velocity, 3)
        0.05
        """
        fields = changes.keys() & self.__dataclass_fields__.keys()
        parts = {name: changes.pop(name) for name in fields}
        for name, value in changes.items():
            unit = self.unit_name(parameter_named(name, place="replace").unit)
            if self.scales is not None and unit != "1" and isinstance(value, Real):
                written = f"{name}={f'{value} {unit}'!r}"
                raise InputError(
                    f"replace: {name} = {value}: has no unit; write {written}, or "
                    f"with_values({name}={value}) for a number in {unit}"
                )
        return replace(self, **parts).with_values(**changes)

    def with_values(self, **values: float | str) -> "Rig":
        """Return the rig with some parameters changed; numbers are in the rig's own
        units, as `value` returns them. They no longer count as assumed or fitted.

        Raises `InputError` if there is no such parameter, or the value is out of
        bounds.

        Examples
        --------
        >>> rig = ss.read_rig("brake_pad")
        >>> faster = rig.with_values(velocity=2.0 * rig.value("velocity"))
        >>> round(faster.velocity, 3)
        0.04
        """
        changed = self
        for name, value in values.items():
            known = parameter_named(name, place="replace")
            new = changed.read(name, value, known.unit, above=None, at_least=0)
            keys = _KEYS_OF.get(name, {name})
            changed = replace(
                known.set(changed, new),
                assumed=_without(keys, changed.assumed),
                fitted=_without(keys, changed.fitted),
            )
        return changed

    def to_natural(self, record: AnyRecord) -> AnyRecord:
        """Convert a record from the rig's own units, such as a drive in m/s and s, to
        natural units, in which the rig holds it.

        Examples
        --------
        >>> rig = ss.read_rig("brake_pad")
        >>> slow = rig.to_natural(ss.constant(0.05, duration=2.0))
        >>> round(rig.replace(drive=slow).velocity, 3)
        0.05
        """
        return converted(record, lambda value, unit: value / self.unit(unit))

    def read(self, place: str, value: object, natural: str, **bounds: Any) -> float:
        """Convert a number in the rig's own unit, or a text with a unit, to the natural
        unit; errors name the place.
        """
        unit = self.unit_name(natural)
        if isinstance(value, str) and self.scales is None:
            try:
                value = read_number(value)  # the command line passes numbers as text
            except InputError:
                refusal = (
                    f"{place} = {value!r}: must be a plain number, as the rig is in "
                    "natural units"
                )
                raise InputError(refusal) from None
        return read_value(place, value, unit, f"2 {unit}", **bounds) / self.unit(
            natural
        )

    def around(self, parameter: Parameter) -> Range:
        """Return the range from `USUAL_RANGE` times below to as much above the value in
        the rig, in natural units.
        """
        here = parameter.get(self.natural)
        if here <= 0:
            raise InputError(
                f"between: {parameter.name} is {here:g}, so give a range, such as "
                "(0.1, 10)"
            )
        return here / USUAL_RANGE, here * USUAL_RANGE

    def span(
        self,
        parameter: Parameter,
        between: Ends,
        place: str = "between",
    ) -> Range:
        """Convert the range of a parameter, given as in `Ends`, to its natural unit."""
        first, last = pair(place, between, "two values, such as (0.1, 10)")
        unit = parameter.unit
        low = self.read(f"{place}[0]", first, unit, above=0)
        return low, self.read(f"{place}[1]", last, unit, above=low * self.unit(unit))

    def __str__(self) -> str:
        """The rig as text, in its own units."""
        rows = list[tuple[str, str]]()
        for parameter in PARAMETERS:
            with suppress(InputError):  # the rig does not have this parameter
                value = self.in_units(parameter.get(self.natural), parameter.unit)
                rows.append((parameter.title or parameter.name, value))
        if self.scales is not None:
            if self.operation.normal_load:
                rows.append(("normal load", self.in_units(LOAD.get(self), "force")))
            block = " of a block" * isinstance(self.slider, ElasticBody)
            rows.append((f"contact strength N f_s{block}", self.in_units(1.0, "force")))
            rows.append(("breaking displacement x_s", self.in_units(1.0, "length")))
        rows.append(("thresholds", str(self.interface.thresholds)))
        rows.append(("method", str(self.method)))
        return "\n".join([self.name, *(f"{name:<48}{value}" for name, value in rows)])

    def in_its_units(self, result: "xr.Dataset") -> "xr.Dataset":
        """Convert a result from natural units to the rig's own."""
        return result if self.scales is None else in_si(result, self.scales)

    def in_units(self, value: float, unit: str, digits: int = 4) -> str:
        """Return a natural value as text, in SI units with a prefix or in natural
        units; `unit` is named as in `Rig.unit`.
        """
        return in_words(value, unit, self.scales, digits)

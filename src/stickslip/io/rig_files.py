"""Rig files: a TOML file in SI units (or natural ones) in, records of the model out, and back.

>>> from stickslip.io.rig_files import read_rig
>>> rig = read_rig("pmma_slider")
>>> rig.interface.delay, rig.natural.velocity  # natural units
(Delay(time=0.4), 1.0)
>>> round(rig.scales.si(rig.slider.stiffness, "stiffness"))  # N/m
4000000

Stretchings of the distributions of thresholds are relative to ``interface.breaking_displacement``. How quantities are
written: `stickslip.io.validation`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from stickslip import model
from stickslip.errors import InputError, instance, shown
from stickslip.io.validation import (
    Force,
    Lag,
    Length,
    Mass,
    Part,
    Rate,
    Stiffness,
    Time,
    Velocity,
    parse_toml,
    read_toml,
    validate,
)
from stickslip.model import Contacts, FromRest, FromSliding, MasterEquation, Output
from stickslip.model import distributions as thresholds
from stickslip.model.drive import Drive, constant, ramp
from stickslip.model.rig import Rig
from stickslip.model.units import Quantity, Scales

if TYPE_CHECKING:
    pass


# ---------------------------------------------------------------------------------------------------------------------
# Files
# ---------------------------------------------------------------------------------------------------------------------


EXAMPLES = Path(__file__).parents[1] / "examples"
"""Folder of the rigs that come with the package."""


def examples() -> tuple[str, ...]:
    """Names of the rigs that come with the package."""
    # A sweep is no rig: it names one.
    return tuple(sorted(f.stem for f in EXAMPLES.glob("*.toml") if "[slider]" in f.read_text(encoding="utf-8")))


def example_file(name: str) -> Path:
    """Return the file of a rig or sweep that comes with the package, such as ``"pmma_slider"``.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    file = EXAMPLES / f"{name}.toml"
    if not file.is_file():
        known = ", ".join(sorted(f.stem for f in EXAMPLES.glob("*.toml")))
        raise InputError(f"{name}: no such example; there are {known}")
    return file


def example(name: str) -> Rig:
    """Return a rig that comes with the package, such as ``"brake_pad"``.

    Raises
    ------
    InputError
        If there is none of that name; the message lists them.
    """
    return read_rig(example_file(name))


def read_rig(path: str | os.PathLike[str]) -> Rig:
    """Read a rig from a TOML file.

    The bare name of an example that comes with the package, such as ``"brake_pad"``, is read too where no file is
    called so.

    Raises
    ------
    InputError
        If the file is missing, empty, binary or no TOML, has an unknown key, or a value that cannot be; the message
        names file, key, value and remedy.
    """
    source = Path(path)
    if not source.exists() and source.name == str(path) and source.name in examples():
        source = example_file(source.name)
    return from_document(read_toml(source, "rig file", "`stickslip new pmma_slider`"), source.name)


def from_document(document: Mapping[str, Any], place: str = "rig") -> Rig:
    """Make a rig of the content of a file; `place` begins the message of an error."""
    natural = document.get("units", "SI") == "natural"
    content = validate(_Document, document, place, natural=natural)
    try:
        return content.rig(document)
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


def from_text(text: object, place: str = "rig") -> Rig:
    """Make a rig of the text that `to_toml` wrote; `place` begins the message of an error."""
    instance(place, text, str, "the text of a rig file")
    return from_document(parse_toml(str(text), place, "rig file"), place)


def to_toml(rig: Rig) -> str:
    """Return the rig as the text of a file that `read` takes."""
    import tomli_w

    return tomli_w.dumps(dict(rig.document))


# ---------------------------------------------------------------------------------------------------------------------
# What a file may hold
# ---------------------------------------------------------------------------------------------------------------------


def _in_reach(value: float) -> float:
    if value and not 10.0**-_DECADES <= abs(value) <= 10.0**_DECADES:  # NaN is in no range
        raise ValueError(f"must be 0, or within {_DECADES} decades of 1")
    return value


_DECADES = 15  # beyond, squares and quotients of doubles overflow in the distributions
_Relative = Annotated[float, AfterValidator(_in_reach)]


class _Gaussian(Part):
    distribution: Literal["gaussian"]
    mean: _Relative = 1.0
    std: _Relative

    def make(self) -> thresholds.Distribution:
        return thresholds.Gaussian(mean=self.mean, std=self.std)


class _Uniform(Part):
    distribution: Literal["uniform"]
    low: _Relative
    high: _Relative

    def make(self) -> thresholds.Distribution:
        return thresholds.Uniform(low=self.low, high=self.high)


class _Exponential(Part):
    distribution: Literal["exponential"]
    mean: _Relative = 1.0

    def make(self) -> thresholds.Distribution:
        return thresholds.Exponential(mean=self.mean)


class _Gamma(Part):
    distribution: Literal["gamma"]
    mean: _Relative = 1.0
    std: _Relative

    def make(self) -> thresholds.Distribution:
        return thresholds.Gamma(mean=self.mean, std=self.std)


class _LogNormal(Part):
    distribution: Literal["lognormal"]
    mean: _Relative = 1.0
    std: _Relative

    def make(self) -> thresholds.Distribution:
        return thresholds.LogNormal(mean=self.mean, std=self.std)


class _Weibull(Part):
    distribution: Literal["weibull"]
    scale: _Relative = 1.0
    shape: _Relative

    def make(self) -> thresholds.Distribution:
        return thresholds.Weibull(scale=self.scale, shape=self.shape)


class _Empirical(Part):
    distribution: Literal["empirical"]
    samples: list[_Relative] | None = None
    """Measured values, to be put into a histogram."""
    edges: list[_Relative] | None = None
    """Or the edges of a histogram."""
    weights: list[_Relative] | None = None
    """With ``edges``: the weight of each bin."""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if (self.samples is None) == (self.edges is None or self.weights is None):
            raise ValueError("needs either samples, or edges and weights")
        return self

    def make(self) -> thresholds.Distribution:
        if self.samples is not None:
            return thresholds.Empirical.from_samples(self.samples)
        return thresholds.Empirical(edges=tuple(self.edges or ()), weights=tuple(self.weights or ()))


_AnyDistribution = Annotated[
    _Gaussian | _Uniform | _Exponential | _Gamma | _LogNormal | _Weibull | _Empirical, Discriminator("distribution")
]


class _RandomDelay(Part):
    mean: Lag
    std: Time
    negative: model.NegativeDelay = "clip"
    """What becomes of a draw below 0: set to 0, drawn again, or its sign changed."""


def _kind_of_delay(value: object) -> str:
    return "random" if isinstance(value, (dict, _RandomDelay)) else "never" if value == "never" else "fixed"


_AnyDelay = Annotated[
    Annotated[_RandomDelay, Tag("random")] | Annotated[Literal["never"], Tag("never")] | Annotated[Lag, Tag("fixed")],
    Discriminator(_kind_of_delay),
]


class _Langevin(Part):
    distribution: Literal["langevin"]
    time: Time
    newborn: _Relative = 0.0
    """Threshold of a newborn contact, relative to the mean."""


class _ExponentialGrowth(Part):
    distribution: Literal["exponential"]
    time: Time
    newborn: _Relative = 0.0
    """Threshold of a newborn contact, relative to the mean."""


class _LogarithmicGrowth(Part):
    distribution: Literal["logarithmic"]
    slope: _Relative
    time: Time


_AnyAgeing = Annotated[_Langevin | _ExponentialGrowth | _LogarithmicGrowth, Discriminator("distribution")]


class _Slider(Part):
    mass: Mass
    stiffness: Stiffness
    damping: Rate | None = None
    relative_damping: float | None = None
    """Or ``eta/sqrt(stiffness/mass)``; one of the two must be given."""

    @model_validator(mode="after")
    def _one_damping(self) -> Self:
        if (self.damping is None) == (self.relative_damping is None):
            raise ValueError(
                "needs one of damping (eta of Eq. (11), such as '200 1/s') and relative_damping (eta/Omega)"
            )
        return self


class _Interface(Part):
    contact_strength: Force | None = None
    normal_load: Force | None = None
    friction_coefficient: float | None = None
    breaking_displacement: Length | None = None
    thresholds: _AnyDistribution
    """Distribution of the thresholds, relative to ``breaking_displacement``."""
    initial: _AnyDistribution = _Gaussian(distribution="gaussian", mean=0.0, std=0.01)
    """Distribution of the stretchings at the start, in the same unit."""
    delay: _AnyDelay | None = None
    """Time until a broken contact is attached again; by default none."""
    ageing: _AnyAgeing | None = None
    """How thresholds grow with the age of a contact; by default they do not."""


class _Piece(Part):
    start: Velocity
    end: Velocity
    duration: Time


class _Drive(Part):
    velocity: Velocity | None = None
    distance: Length | None = None
    duration: Time | None = None
    pieces: list[_Piece] | None = None
    """In place of ``velocity``: speeds that change linearly, piece after piece."""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if (self.velocity is None) == (self.pieces is None):
            raise ValueError("needs either velocity, or pieces (each with start, end and duration)")
        if self.pieces is not None and (self.distance is not None or self.duration is not None or not self.pieces):
            raise ValueError("pieces must hold at least one piece, and leave no room for distance or duration")
        if self.distance is not None and self.duration is not None:
            raise ValueError("needs distance or duration, not both")
        return self


class _Simulation(Part):
    method: Literal["contacts", "master equation"] = "contacts"
    contacts: int = 10_000
    """Number of contacts, for the method ``contacts``."""
    seed: int = 1
    """Of the random numbers: the same seed gives the same run."""
    cells: int = 400
    """Resolution of the master equation: cohorts per ``x_s``."""
    start: Literal["relaxed", "sliding"] = "relaxed"
    interval: Time | None = None


_Words = Annotated[str, Field(max_length=2_000)]


class _Document(Part):
    name: Annotated[str, Field(max_length=200)] = "rig"
    units: Literal["SI", "natural"] = "SI"
    """Natural: plain numbers, threshold force, contact stiffness and breaking displacement 1, all per contact."""
    slider: _Slider
    interface: _Interface
    drive: _Drive
    simulation: _Simulation = _Simulation()
    assumed: dict[str, _Words] = Field(default_factory=dict)
    source: _Words = ""
    """Where the numbers come from."""

    def rig(self, document: Mapping[str, Any]) -> Rig:
        scales = self._scales() if self.units == "SI" else None
        measure = scales or Scales(force=1.0, stretching=1.0)

        def natural(value: float, quantity: Quantity) -> float:
            return measure.natural(value, quantity)

        for key in self.assumed:
            self._check_key(key, document)
        mass, stiffness = natural(self.slider.mass, "mass"), natural(self.slider.stiffness, "stiffness")
        model.Slider(stiffness=stiffness, mass=mass, damping=0.0)
        if self.slider.damping is not None:
            damping = natural(self.slider.damping, "rate")
        else:
            if mass == 0:
                raise InputError("slider.relative_damping: needs a mass above 0; give damping instead")
            damping = (self.slider.relative_damping or 0.0) * math.sqrt(stiffness / mass)
        return Rig(
            name=self.name,
            interface=model.Interface(
                thresholds=self.interface.thresholds.make(),
                initial=self.interface.initial.make(),
                delay=self._delay(natural),
                ageing=self._ageing(natural),
            ),
            slider=model.Slider(stiffness=stiffness, mass=mass, damping=damping),
            drive=self._drive(natural),
            method=Contacts(self.simulation.contacts, self.simulation.seed)
            if self.simulation.method == "contacts"
            else MasterEquation(cells=self.simulation.cells),
            start=FromRest() if self.simulation.start == "relaxed" else FromSliding(),
            output=Output(
                interval=None if self.simulation.interval is None else natural(self.simulation.interval, "time")
            ),
            scales=scales,
            assumed=self.assumed,
            document=document,
        )

    def _check_key(self, key: str, document: Mapping[str, Any]) -> None:
        node: Any = document
        for part in key.split("."):
            if not isinstance(node, Mapping) or part not in node:
                raise InputError(f"assumed.{shown(key)}: names no key of this file; write it as 'interface.delay'")
            node = node[part]

    def _scales(self) -> Scales:
        part = self.interface
        by_load = part.normal_load is not None and part.friction_coefficient is not None
        if by_load == (part.contact_strength is not None):
            raise InputError(
                "interface: needs either contact_strength (sum of the threshold forces of all contacts, such as "
                "'768 N'), or normal_load and friction_coefficient"
            )
        if part.breaking_displacement is None:
            raise InputError("interface.breaking_displacement: is missing; give the mean threshold, such as '2 um'")
        force = part.contact_strength if not by_load else (part.normal_load or 0.0) * (part.friction_coefficient or 0.0)
        scales = Scales(force=force or 0.0, stretching=part.breaking_displacement)
        velocities = [abs(v) for v in self._velocities() if v]
        # The unit of time drops out of every result; this one keeps the numbers near 1.
        time = part.breaking_displacement / max(velocities) if velocities else 1.0
        return Scales(force=scales.force, stretching=scales.stretching, time=time)

    def _velocities(self) -> list[float]:
        if self.drive.pieces is None:
            return [self.drive.velocity or 0.0]
        return [v for piece in self.drive.pieces for v in (piece.start, piece.end)]

    def _delay(self, natural: Any) -> model.DelayModel:
        delay = self.interface.delay
        if delay is None:
            return model.Delay(0.0)
        if delay == "never":
            return model.Delay(math.inf)
        if isinstance(delay, _RandomDelay):
            return model.RandomDelay(
                mean=natural(delay.mean, "time"), std=natural(delay.std, "time"), negative=delay.negative
            )
        return model.Delay(natural(delay, "time"))

    def _ageing(self, natural: Any) -> model.Strengthening | None:
        match self.interface.ageing:
            case None:
                return None
            case _Langevin(time=time, newborn=newborn):
                return model.Langevin(rate=_inverse(natural(time, "time")) ** 0.5, newborn=newborn)
            case _ExponentialGrowth(time=time, newborn=newborn):
                return model.ExponentialGrowth(rate=_inverse(natural(time, "time")), newborn=newborn)
            case _LogarithmicGrowth(slope=slope, time=time):
                return model.LogarithmicGrowth(slope=slope, time=natural(time, "time"))

    def _drive(self, natural: Any) -> Drive:
        part = self.drive
        if part.pieces is not None:
            pieces = [
                ramp(natural(p.start, "velocity"), natural(p.end, "velocity"), natural(p.duration, "time"))
                for p in part.pieces
            ]
            drive = pieces[0]
            for piece in pieces[1:]:
                drive = drive.then(piece)
            return drive
        velocity = natural(part.velocity or 0.0, "velocity")
        if part.duration is not None:
            return constant(velocity, natural(part.duration, "time"))
        if velocity == 0:
            raise InputError("drive.velocity: is 0; give a velocity above 0, or a duration")
        distance = 120.0 if part.distance is None else natural(part.distance, "length")
        return constant(velocity, distance / abs(velocity))


def _inverse(time: float) -> float:
    if time <= 0:
        raise InputError("interface.ageing.time: must be above 0")
    return 1.0 / time

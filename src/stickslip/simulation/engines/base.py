"""The protocol of engines, the solvers that advance a state along legs, and their
registry.

To add a solver, write a class with the members of `Engine` and register it, with
`solves`, for the method that selects it.
"""

import copy
import importlib
import math
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol, Self, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array as Array
from stickslip.errors import InputError, shown
from stickslip.kernels.drive import NO_LOAD, Quadratic, Stop
from stickslip.kernels.oscillator import RIGID
from stickslip.kernels.oscillator import Slider as SliderConstants
from stickslip.model import (
    Chain,
    ElasticBody,
    ExponentialGrowth,
    FromRest,
    FromSliding,
    Interface,
    Mass,
    Prestressed,
    QuasiStatic,
    Slider,
    Start,
)
from stickslip.model.activation import Activation
from stickslip.model.ageing import FixedGrowth
from stickslip.model.distribution import check_density
from stickslip.model.drive import ForcePiece, Piece
from stickslip.model.newborn import mean_life
from stickslip.model.rig import Rig
from stickslip.model.structure import Structure
from stickslip.simulation.estimates import Course, Part, oscillation

COLUMNS = (
    "displacement",
    "velocity",
    "friction_force",
    "attached",
    "contact_energy",
    "work",
    "damped_energy",
    "broken_energy",
)
"""Samples of an engine, in this order; an engine that does not compute energies stops
after `MOTION`.
"""
MOTION = COLUMNS[:4]


class Leg(NamedTuple):
    """A part of a run in which the drive follows one rule, up to the time `end` or to
    the first sample at which the condition `stop` holds.

    `times` are those of the remaining samples, `looks` those at which the distribution
    of stretchings is recorded. Recording never changes the motion. The `load` is in the
    form of `kernels.drive.load_at`. For a mass without a spring the "position" of the
    drive is a force.
    """

    drive: Quadratic
    end: float
    times: Array
    stop: Stop
    looks: tuple[float, ...] = ()
    load: Array = NO_LOAD

    @classmethod
    def along(cls, piece: Piece | ForcePiece, begin: float, position: float) -> "Leg":
        """Return the leg along a piece of the drive, without samples."""
        if isinstance(piece, Piece):
            drive = Quadratic(begin, position, piece.start, piece.acceleration)
        else:  # a force in place of a position
            drive = Quadratic(begin, piece.start, piece.rate, 0.0)
        return cls(drive, begin + piece.duration, np.empty(0), Stop())

    def drive_position(self, t: Array) -> Array:
        """Position of the drive at times `t`."""
        since = t - self.drive.start
        return np.asarray(
            self.drive.position
            + since * (self.drive.velocity + 0.5 * self.drive.acceleration * since)
        )


class Stretchings(NamedTuple):
    """Stretchings at one time and the fraction of all contacts at each; with `cells`
    each stretching stands for an interval around it.
    """

    stretching: Array
    fraction: Array
    cells: bool


class Individuals(NamedTuple):
    """Stretching of each contact, in a fixed order; the stretchings of detached
    contacts have no meaning.
    """

    stretching: Array
    attached: NDArray[np.bool_]


class Advance(NamedTuple):
    """Result of an advance on a leg: samples, snapshots of the stretchings, and whether
    the end of the leg is reached.
    """

    rows: Array
    looks: tuple[Stretchings, ...]
    over: bool


@dataclass(frozen=True)
class Beginning:
    """Initial conditions of a run; `slider` is None for rigid motion, and the velocity
    is the drive's first.
    """

    interface: Interface
    slider: Slider | Mass | ElasticBody | Structure | None
    velocity: float
    start: Start = FromRest()
    load: float = 1.0

    def __post_init__(self) -> None:
        start = self.start
        elastic = isinstance(self.slider, ElasticBody)
        of_blocks = (
            isinstance(start, Prestressed)
            or self.at_rest
            or isinstance(self.perturbation, tuple)
        )
        if of_blocks and not elastic:
            raise InputError(
                f"Rig.start = {start!r}: is for an elastic slider, a Chain or a Sheet; "
                "start FromRest()"
            )
        if not self.sliding:
            return
        if isinstance(self.slider, ElasticBody) and self.at_rest > self.slider.size:
            raise InputError(
                (
                    f"FromSliding.at_rest = {self.at_rest}: there are "
                    f"{self.slider.size} "
                    "blocks; give fewer"
                ),
                "FromSliding.at_rest",
            )
        if self.velocity <= 0:
            raise InputError(
                f"FromSliding: the drive starts at velocity {self.velocity:g}: steady "
                "sliding needs one above 0"
            )
        if math.isinf(self.interface.delay.moment(1)):
            raise InputError(
                "FromSliding: contacts that never re-attach have no steady sliding; "
                "start FromRest()"
            )

    @property
    def sliding(self) -> bool:
        """Whether the slider is in steady sliding at the start."""
        return isinstance(self.start, FromSliding)

    @property
    def at_rest(self) -> int:
        """Number of the first blocks of an elastic slider that are at rest while the
        others slide.
        """
        return self.start.at_rest if isinstance(self.start, FromSliding) else 0

    @property
    def perturbation(self) -> float | tuple[float, ...]:
        """Relative excess of the velocity over that of steady sliding, for the slider
        or for each block of an elastic one.
        """
        return self.start.perturbation if isinstance(self.start, FromSliding) else 0.0

    @property
    def slider_velocity(self) -> float:
        """Velocity of a rigid slider at time 0."""
        if self.slider is None:
            return self.velocity
        by = self.perturbation
        return (
            0.0
            if isinstance(by, tuple) or not self.sliding
            else self.velocity * (1.0 + by)
        )

    @property
    def attached(self) -> float:
        """Attached fraction in steady sliding, Eq. (10)."""
        path, _ = mean_life(self.interface)
        return path / (path + self.velocity * self.interface.delay.moment(1))

    def drive_position(self, contact_force: float) -> float:
        """Position of the drive at time 0; a slider that slides starts in balance."""
        if self.slider is None or not self.sliding:
            return 0.0
        if isinstance(self.slider, Structure):
            return self.slider.sliding(self.velocity, contact_force)[1]
        assert not isinstance(self.slider, Mass)  # which starts at rest
        drag = self.slider.mass * self.slider.damping * self.velocity
        if isinstance(self.slider, Slider):
            return (contact_force + drag) / self.slider.stiffness
        drag *= 1.0 - self.at_rest / self.slider.size
        return (contact_force + drag) / float(self.slider.pulled.mean())


class Engine(Protocol):
    """A state of contacts and slider, and a kernel that advances it leg by leg.

    `stickslip.simulation.driver` follows a drive through its legs. Methods that have a
    body here are defaults that most engines keep.
    """

    columns: ClassVar[tuple[str, ...]]
    """Columns of its samples: the first of `COLUMNS`, at least `MOTION`."""
    angle: ClassVar[float]
    """Default interval of samples, in radians of the fastest oscillation of the
    slider.
    """
    mechanisms: ClassVar[frozenset[str]] = frozenset()
    """Names of `Interface.mechanisms` that it supports besides ageing; an interface
    with others is refused beforehand.
    """
    takes_loads: ClassVar[bool] = False
    """Whether it supports a drive with a load, or by a force."""
    smooth: ClassVar[bool] = False
    """Whether thresholds must have a density."""
    piece: ClassVar[float] = 3.5e-4
    """Seconds of computing to begin a piece of the drive, or to take a snapshot."""
    slider: SliderConstants | ElasticBody | Structure

    @staticmethod
    def check(interface: Interface) -> None:  # noqa: ARG004
        """Raise `InputError` for an interface that the engine does not support."""
        return

    @staticmethod
    def cost(rig: Rig, method: Any, course: Course) -> tuple[Part, ...]:  # noqa: ARG004
        """Return the work of a run, by part, without that of samples; by default only
        the work of the slider.
        """
        return oscillation(rig, course.turns)

    def __init__(self, beginning: Beginning, method: Any) -> None: ...

    def here(self) -> tuple[float, float]:
        """Time, and position of the slider."""
        ...

    def stretchings(self) -> Stretchings:
        """Return the current stretchings of the attached contacts."""
        ...

    def contact_force(self) -> float:
        """Return the current mean force of the contacts."""
        x, fraction, _ = self.stretchings()
        return float(np.sum(x * fraction))

    def advance(self, leg: Leg) -> Advance:
        """Advance along a leg, for some 50 ms of computing or to its end; samples at
        the end are included.
        """
        ...

    def marks(self) -> dict[str, Array]:
        """Return events that happen once to each block of an elastic slider, by their
        names in a run.
        """
        return {}

    def copy(self) -> Self:
        """Return an independent engine in the same state."""
        return copy.deepcopy(self)


GROWTH, HEAT = get_args(FixedGrowth), get_args(Activation)
"""Types of growth laws, and of thermal activation."""

E = TypeVar("E", bound=type)


ENGINES: dict[tuple[type, type, type, bool], type[Engine]] = {}
"""Engines by types of method, ageing and thermal activation, and whether the slider is
elastic; `solves` adds to it.
"""


def solves(
    method: type,
    *ageing: type,
    activation: tuple[type, ...] = (type(None),),
    elastic: bool = False,
) -> Callable[[E], E]:
    """Register an engine for a method, for contacts with one of these types of ageing
    and activation, or without.
    """

    def register(engine: E) -> E:
        for kind in ageing or (type(None),):
            for heat in activation:
                ENGINES[method, kind, heat, elastic] = engine
        return engine

    return register


def engine_of(
    interface: Interface,
    method: object,
    slider: object = None,
) -> type[Engine]:
    """Return the engine for a method, an interface and a slider; `InputError` if there
    is none.
    """
    if isinstance(slider, Structure):
        # This engine is in a package above, so it is imported by name: import
        # statements point down.
        return _engine_of_structures(interface, method)
    parts = _parts(interface)
    elastic = isinstance(slider, ElasticBody)
    engine = _engine(type(method), interface, parts, elastic)
    if engine is None:
        raise _refusal(interface, method, slider)
    if getattr(method, "memoryless", False) and (elastic or {*parts} - {"on_arrest"}):
        raise InputError(
            "MasterEquation(memoryless=True): is for a rigid slider on contacts with a "
            "delay and nothing else of their "
            "own; leave it out"
        )
    if engine.smooth:
        check_density(interface.threshold_distribution)
    engine.check(interface)
    return engine


def _engine_of_structures(interface: Interface, method: object) -> type[Engine]:
    runs = importlib.import_module("stickslip.structures.runs")
    found: type[Engine] = runs.engine_for(interface, method)
    return found


def _parts(interface: Interface) -> list[str]:
    """Mechanisms that an engine may not support, ageing and activation first."""
    return sorted(
        interface.mechanisms,
        key=lambda part: (part != "ageing", part != "activation", part),
    )


def _engine(
    method: type,
    interface: Interface,
    parts: Collection[str],
    elastic: bool,
) -> type[Engine] | None:
    """Return the engine that supports an interface reduced to these mechanisms."""
    ageing, breaking = (
        type(getattr(interface, part) if part in parts else None)
        for part in ("ageing", "activation")
    )
    engine = ENGINES.get((method, ageing, breaking, elastic))
    if engine is None or {*parts} - {"ageing"} - engine.mechanisms:
        return None
    return engine


def _takers(interface: Interface, parts: Collection[str], slider: object) -> str:
    """Return advice that names the methods that support these mechanisms, or ""."""
    elastic = isinstance(slider, ElasticBody)
    found = set()
    for method, *_, of_bodies in ENGINES:
        engine = _engine(method, interface, parts, elastic)
        if of_bodies is not elastic or engine is None:
            continue
        if elastic and method is QuasiStatic and not isinstance(slider, Chain):
            continue
        with suppress(InputError):
            if len(parts) == len(interface.mechanisms):
                engine.check(interface)
            found.add(method.__name__)
    return f"use {' or '.join(sorted(found))}" if found else ""


def _refusal(interface: Interface, method: object, slider: object) -> InputError:
    """Return the error that says why no engine fits: the method, the slider, or the
    mechanisms that are not supported together or at all.
    """
    elastic = isinstance(slider, ElasticBody)
    kind = type(method)
    parts = _parts(interface)
    who = kind.__name__
    body = type(slider).__name__ if elastic else "Slider"
    if not _engine(kind, interface, (), elastic):
        return InputError(
            f"method = {shown(method)}: is not for a {body}; "
            f"{_takers(interface, (), slider) or 'there is none'}"
        )
    refused = parts
    for part in reversed(parts):
        fewer = [other for other in refused if other != part]
        if not _engine(kind, interface, fewer, elastic):
            refused = fewer
    fields = ["delay" if part == "on_arrest" else part for part in refused]
    first, *others = [f"{field} = {getattr(interface, field)!r}" for field in fields]
    leave = "leave it out"
    if others:
        who = f"{who} together with {' and '.join(others)}"
        leave = "leave one out"
    elif not _takers(interface, refused, slider):
        none = "no registered solver takes it, see simulation.engines.solves()"
        leave = leave if elastic else f"{none}; {leave}"
        who = f"a {body}" if elastic else who
    return InputError(
        f"Interface.{first}: not available with {who}; "
        f"{_takers(interface, parts, slider) or leave}"
    )


def slider_constants(
    slider: Slider | Mass | ElasticBody | Structure | None,
) -> SliderConstants:
    """Return the constants of a slider for the kernels; None is rigid motion."""
    assert slider is None or isinstance(slider, Slider | Mass)
    if slider is None:
        return RIGID
    stiffness = getattr(slider, "stiffness", 0.0)
    return SliderConstants(stiffness, slider.mass, slider.damping)


def check_newborns(interface: Interface) -> None:
    """Raise `InputError` for newborns without strength, which break as soon as they
    attach.
    """
    if (
        isinstance(interface.ageing, ExponentialGrowth)
        and interface.ageing.newborn == 0
    ):
        which = (
            "MasterEquation" if interface.activation is None else "Interface.activation"
        )
        raise InputError(
            f"ExponentialGrowth.newborn = 0 with {which}: contacts with zero threshold "
            "break as soon as they attach; "
            "give newborn > 0"
        )


REFILLS = 1000  # most refills of random numbers in an advance, which then ends
_IDLE = 1000
"""Most consecutive advances without progress: one may end before a snapshot, at a
sample, or when its random numbers are used up, but not indefinitely.
"""


def advances(engine: Engine, leg: Leg) -> Iterator[Advance]:
    """Advance an engine to the end of a leg; yield its samples and snapshots, part by
    part.

    Raises `RuntimeError` if the engine makes no progress.
    """
    filled = 0
    seen = 0
    idle = 0
    over = False
    while not over:
        before = engine.here()
        passed = engine.advance(
            leg._replace(times=leg.times[filled:], looks=leg.looks[seen:])
        )
        yield passed
        filled += len(passed.rows)
        seen += len(passed.looks)
        over = passed.over
        here = engine.here()
        stood = here == before and not len(passed.rows) and not passed.looks
        idle = idle + 1 if stood else 0
        if idle > _IDLE and not over:
            raise RuntimeError(
                f"{type(engine).__name__}: stands still at t = {here[0]!r} on the way "
                f"to {leg.end!r}: a fault of this package, please report it"
            )


def looks_aside(before: Engine, leg: Leg, until: float) -> tuple[Stretchings, ...]:
    """Return the snapshots of a leg up to a time, taken by a copy of the engine so that
    the run itself need not stop at them.
    """
    seen = []
    for look in leg.looks:
        if look > until:
            break
        aside = before.copy()
        part = leg._replace(end=look, times=np.empty(0), stop=Stop(), looks=())
        for _ in advances(aside, part):
            pass
        seen.append(aside.stretchings())
    return tuple(seen)

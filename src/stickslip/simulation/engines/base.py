"""The protocol of solvers, engines that go on along a leg of the way, and their
registry.

To add a solver, write a class that has what `Engine` asks for and register it, with
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
"""Samples of an engine, in this order; one that does not know the energies stops
after `MOTION`.
"""
MOTION = COLUMNS[:4]


class Leg(NamedTuple):
    """A part of the way on which the drive moves by one rule, up to the time `end` or
    to the first sample with `stop`.

    `times` are those of the samples still wanted, `looks` those at which stretchings
    are. Looking never changes the motion. The `load` is as `kernels.drive.load_at`
    takes it. On a mass without a spring the "position" of the drive is a force.
    """

    drive: Quadratic
    end: float
    times: Array
    stop: Stop
    looks: tuple[float, ...] = ()
    load: Array = NO_LOAD

    @classmethod
    def along(cls, piece: Piece | ForcePiece, begin: float, position: float) -> "Leg":
        """Return the leg on which the drive goes along a piece, without samples."""
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
    """Stretchings at a moment and the fraction of all contacts at each; `cells`:
    each stands for its neighbourhood.
    """

    stretching: Array
    fraction: Array
    cells: bool


class Individuals(NamedTuple):
    """Every contact by itself, in an order that stays; stretchings of detached
    contacts mean nothing.
    """

    stretching: Array
    attached: NDArray[np.bool_]


class Advance(NamedTuple):
    """Result of an advance on a leg: samples, looks, and whether it has come to the
    end.
    """

    rows: Array
    looks: tuple[Stretchings, ...]
    over: bool


@dataclass(frozen=True)
class Beginning:
    """Beginning of a run; no slider is rigid motion, and the velocity is the
    drive's first.
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
                f"Rig.start = {start}: is for an elastic slider, a Chain or a Sheet; "
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
        """Whether the slider is in steady sliding from the beginning."""
        return isinstance(self.start, FromSliding)

    @property
    def at_rest(self) -> int:
        """Number of the first blocks of an elastic slider that stand still while the
        others slide.
        """
        return self.start.at_rest if isinstance(self.start, FromSliding) else 0

    @property
    def perturbation(self) -> float | tuple[float, ...]:
        """By what part the slider is faster than in steady sliding, or each block of
        an elastic one.
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
        """Position of the drive at time 0: a slider that starts sliding starts in
        balance.
        """
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
    """Contacts and a slider on their way: a state, and a kernel that advances it leg by
    leg.

    `stickslip.simulation.driver` joins legs to drives. What has a body here will do for
    most.
    """

    columns: ClassVar[tuple[str, ...]]
    """Columns of its samples: the first of `COLUMNS`, at least `MOTION`."""
    angle: ClassVar[float]
    """Default distance of samples, in radians of the fastest oscillation of the
    slider.
    """
    mechanisms: ClassVar[frozenset[str]] = frozenset()
    """Part of `Interface.mechanisms` that it takes besides ageing; the rest is refused
    before.
    """
    takes_loads: ClassVar[bool] = False
    """Whether it takes a drive with a load, or with a force."""
    smooth: ClassVar[bool] = False
    """Whether thresholds must have a density."""
    piece: ClassVar[float] = 3.5e-4
    """Seconds that it takes to begin a piece of the drive, or a look."""
    slider: SliderConstants | ElasticBody | Structure

    @staticmethod
    def check(interface: Interface) -> None:  # noqa: ARG004
        """Raise `InputError` for what the engine cannot take."""
        return

    @staticmethod
    def cost(rig: Rig, method: Any, course: Course) -> tuple[Part, ...]:  # noqa: ARG004
        """Return the work of a run but for samples, by part: that of the slider,
        where of contacts nothing is known.
        """
        return oscillation(rig, course.turns)

    def __init__(self, beginning: Beginning, method: Any) -> None: ...

    def here(self) -> tuple[float, float]:
        """Time, and position of the slider."""
        ...

    def stretchings(self) -> Stretchings:
        """Stretchings of the attached contacts now."""
        ...

    def contact_force(self) -> float:
        """Force of the contacts now, per contact."""
        x, fraction, _ = self.stretchings()
        return float(np.sum(x * fraction))

    def advance(self, leg: Leg) -> Advance:
        """Go on along a leg, for a while (some 50 ms) or to its end; samples on the
        end are included.
        """
        ...

    def marks(self) -> dict[str, Array]:
        """Return what has happened once to each block of an elastic slider, by the
        name it has in a run.
        """
        return {}

    def copy(self) -> Self:
        """Return an engine in the same state that goes its own way."""
        return copy.deepcopy(self)


GROWTH, HEAT = get_args(FixedGrowth), get_args(Activation)
"""Kinds of growth by a rule, and of thermal activation."""

E = TypeVar("E", bound=type)


ENGINES: dict[tuple[type, type, type, bool], type[Engine]] = {}
"""Engines by kind of method, of ageing, of thermal activation, and whether for
elastic sliders; `solves` adds to it.
"""


def solves(
    method: type,
    *ageing: type,
    activation: tuple[type, ...] = (type(None),),
    elastic: bool = False,
) -> Callable[[E], E]:
    """Register an engine for a method on contacts with one of these kinds of ageing
    and activation, or none.
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
    """Return the engine for a method on an interface, under a slider; `InputError`
    if it cannot be taken.
    """
    if isinstance(slider, Structure):
        # of the room above, which has the element that structures run on: by name, as
        # imports point down
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
    """Mechanisms that an engine may refuse, ageing and activation first."""
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
    """Return the engine for an interface that has only these of its parts."""
    ageing, breaking = (
        type(getattr(interface, part) if part in parts else None)
        for part in ("ageing", "activation")
    )
    engine = ENGINES.get((method, ageing, breaking, elastic))
    if engine is None or {*parts} - {"ageing"} - engine.mechanisms:
        return None
    return engine


def _takers(interface: Interface, parts: Collection[str], slider: object) -> str:
    """Return the methods that take these parts of an interface, in words."""
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
    """Return why there is no engine: the method or the slider, or what cannot be
    taken together, or at all.
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
    first, *others = (
        f"{'delay' if part == 'on_arrest' else part} = "
        f"{getattr(interface, 'delay' if part == 'on_arrest' else part)!r}"
        for part in refused
    )
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
    """Return a slider as the kernels take it; none is rigid motion."""
    assert slider is None or isinstance(slider, Slider | Mass)
    if slider is None:
        return RIGID
    stiffness = getattr(slider, "stiffness", 0.0)
    return SliderConstants(stiffness, slider.mass, slider.damping)


def check_newborns(interface: Interface) -> None:
    """Raise `InputError` for newborns without strength: they break as soon as they
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


REFILLS = 1000  # of draws in an advance, which then ends
_IDLE = 1000
"""Advances in which an engine may stand where it was: one may end before a look, at a
sample, or where its draws are used up, but not without end.
"""


def advances(engine: Engine, leg: Leg) -> Iterator[Advance]:
    """Advance an engine to the end of a leg; yield what it passes, part by part.

    Raises `RuntimeError` if the engine no longer gets on.
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
    """Return the looks that fall before a time: a copy goes there, so that the run
    itself need not stop.
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

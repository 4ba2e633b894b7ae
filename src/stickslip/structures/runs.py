"""The engine of a linear structure on contacts.

Each step solves the structure exactly, and moves the contacts exactly along the path
that the structure predicts.
"""

import math
from typing import Any, Self

import numpy as np
from scipy import linalg

from stickslip.arrays import Array
from stickslip.errors import InputError, refused
from stickslip.kernels import structure_steps as kernel
from stickslip.kernels.drive import LOOK, STOPPED, Piece, Quadratic, Sampling
from stickslip.kernels.element import force_of
from stickslip.kernels.records import blank
from stickslip.loops import bounded
from stickslip.model import Contacts, Interface
from stickslip.model.records import hashable
from stickslip.model.rig import Rig
from stickslip.model.structure import ControlledAxis, LinearSystem, Pull, Structure
from stickslip.simulation.engines.base import (
    COLUMNS,
    Advance,
    Beginning,
    Engine,
    Leg,
    Stretchings,
)
from stickslip.simulation.engines.base import engine_of as engine_of_slider
from stickslip.simulation.estimates import Course, Part
from stickslip.simulation.result import STATE
from stickslip.structures.contacts import draws_of, element_of

# Length of a step, in radians of the fastest motion on attached contacts: the error is
# a 24th of its square, 4e-6.
_STEP = 0.01
RADIAN = 1.0 / _STEP  # number of steps in a radian of the fastest motion
_UPDATE = 20  # fewest steps between two updates of a controller
_ROUNDING = 1e-10  # times within this fraction of a step are equal
_OF_INTEGRAL = 3  # number of states of an axis with an integral
_ADVANCE = 50_000  # steps between two reports of progress
_SECONDS = 1e-6, 1e-9  # time of a step, and additional time for each contact
_CONTACT = 400.0  # bytes of a contact
_ENERGIES = ("spring_force", "kinetic_energy", "spring_energy")
_OF_STRUCTURE = {"work", "damped_energy", "kinetic_energy", "spring_energy"}


def engine_for(interface: Interface, method: object) -> type[Engine]:
    """Return the engine of structures; `InputError` if it does not support the
    interface or the method.
    """
    if not isinstance(method, Contacts):
        raise refused(
            "method",
            method,
            "a structure runs on single contacts; give Contacts(1000) "
            '(simulation.method = "contacts")',
        )
    for part in ("ageing", "activation"):
        if getattr(interface, part) is not None:
            raise InputError(
                f"Interface.{part}: not available with a structure; leave it out, or "
                "use a Slider"
            )
    engine_of_slider(interface, method)
    return SteppedStructure


class SteppedStructure(Engine):
    """Engine of a linear structure on contacts with thresholds of their own.

    A step is a hundredth of a radian of the fastest motion, or the time between two
    samples if that is shorter.
    """

    angle = 0.25

    @staticmethod
    def cost(rig: Rig, method: Any, course: Course) -> tuple[Part, ...]:  # noqa: ARG004
        """Return the estimated work and memory of the steps of a run."""
        natural = rig.natural
        steps = natural.drive.duration / longest_step(natural.slider)
        alone, each = _SECONDS
        seconds = steps * (alone + each * method.count)
        what = f"{steps:.2g} steps of the structure"
        size = _CONTACT * method.count
        return (
            Part("simulation.contacts", method.count, None, 1.0, what, seconds, size),
        )

    def __init__(self, beginning: Beginning, method: Contacts) -> None:
        structure = beginning.slider
        assert isinstance(structure, Structure)
        self.slider = structure
        alone = Beginning(
            beginning.interface,
            None,
            beginning.velocity,
            beginning.start,
        )
        self._element = element_of(alone, method)
        force = force_of(self._element)
        self._system, self._body, self._controller = _parts(structure)
        self._z = np.zeros(len(self._system.A))
        # kept in arrays, which a copy of the engine copies
        self._memory = blank(kernel.CONTROL, 1)
        self._run = blank(kernel.RUN, 1)
        self._leg: tuple[Quadratic, float] | None = None
        if beginning.sliding:
            self._slide(beginning, force)
        self._run[0].force = force
        motion = self._element.motion[0]
        self._run[0].lost_before = motion.lost / self._element.contacts.size
        states = tuple(f"{STATE}{i}" for i in range(self._z.size))
        names = (*COLUMNS, *_ENERGIES, *states)
        if structure.energies is None:
            names = tuple(f"no {n}" if n in _OF_STRUCTURE else n for n in names)
        self.columns = names

    def _slide(self, beginning: Beginning, force: float) -> None:
        """Start in steady sliding, with a perturbation of the velocity."""
        velocity = beginning.velocity
        state, _ = self.slider.sliding(velocity, force)
        faster = beginning.slider_velocity - velocity
        if isinstance(self.slider, ControlledAxis) and self._controller.sample_time:
            held = force + self.slider.mass * self.slider.damping * velocity
            state = np.array([0.0, velocity, held])
            self._memory[0].integral = held
        kick = self._body.kick
        self._z[:] = state + kick * faster / float(self._body.moving @ kick)

    def turned(self, interface: Interface, structure: Structure) -> Self:
        """Return a copy that continues with another structure of the same kind, and
        with contacts that draw from another interface. The integral force of a
        controller is kept.
        """
        before = self.slider
        other = self.copy()
        other.slider = structure
        other._system, other._body, other._controller = _parts(structure)
        draws = draws_of(hashable(interface))
        other._element = other._element._replace(draws=draws)
        integral = self._z.size == _OF_INTEGRAL and not self._controller.sample_time
        if isinstance(before, ControlledAxis) and integral:
            assert isinstance(structure, ControlledAxis)
            # the state is the integral of the error, so the force changes with the gain
            other._z[-1] *= before.ki / structure.ki
        return other

    @property
    def drive_stiffness(self) -> float:
        """Derivative of the pull by the position of the drive."""
        return float(self._body.pull_drive)

    def pull(self, place: float, velocity: float) -> float:
        """Return the force on the structure of a drive at a position and velocity."""
        body = self._body
        pull = Pull(body.pull, body.pull_drive, body.pull_rate)
        return pull.force(self._z, place, velocity)

    def spring_force(self, samples: Array, leg: Leg) -> tuple[Array, Array]:
        """Return the spring force at the samples of a leg, and its time derivative."""
        force = samples[:, self.columns.index("spring_force")]
        return force, np.gradient(force, leg.times)

    @property
    def seconds(self) -> float:
        """Longest time that an advance takes, in seconds."""
        alone, each = _SECONDS
        return _ADVANCE * (alone + each * float(self._element.contacts.size))

    def here(self) -> tuple[float, float]:
        """Return the time, and the position of the contacts."""
        m = self._element.motion[0]
        return float(m.time), float(m.position)

    def contact_force(self) -> float:
        """Return the present force of the contacts, per contact."""
        return float(self._run[0].force)

    def stretchings(self) -> Stretchings:
        """Return the present stretchings of the attached contacts."""
        contacts = self._element.contacts
        held = contacts.until < 0.0
        x = self.here()[1] - contacts.birth[held]
        return Stretchings(x, np.full(x.size, 1.0 / contacts.size), cells=False)

    def advance(self, leg: Leg) -> Advance:
        """Advance by some steps."""
        run = self._run[0]
        if self._leg != (leg.drive, leg.end):
            self._begin(leg)
        columns = len(self.columns)
        sampling = Sampling(leg.times, np.empty((leg.times.size, columns)))
        run.sample = 0.0
        # at large times, the time of the steps has a rounding error
        rounding = 8.0 * np.finfo(float).eps * abs(leg.end)
        if rounding > _ROUNDING * self._way.h:
            earlier = np.minimum(leg.times, leg.end - rounding)
            sampling = sampling._replace(times=earlier)
        seen: list[Stretchings] = []
        looks = (*leg.looks, math.inf)
        room = np.zeros((3, columns))
        last = min(self._steps, int(run.steps) + _ADVANCE)
        why = LOOK
        turns = bounded("looks at a run", len(looks))
        while why == LOOK:
            next(turns)
            why = kernel.advance_structure(
                self._element,
                kernel.Motion(self._z, room, self._run, self._memory),
                self._body,
                self._way,
                self._controller,
                Piece(leg.drive, leg.end, leg.stop, looks[len(seen)]),
                sampling,
                (self._steps, last - int(run.steps)),
            )
            if why == LOOK:
                seen.append(self.stretchings())
        over = why == STOPPED or int(run.steps) >= self._steps
        if over:
            self._leg = None
        if over and why != STOPPED:  # remove the rounding error of the time
            self._element.motion[0].time = leg.end
            self._element.motion[0].carry = 0.0
        return Advance(sampling.samples[: int(run.sample)], tuple(seen), over)

    def _begin(self, leg: Leg) -> None:
        """Start a leg: divide its time into equal steps."""
        now, _ = self.here()
        longest = longest_step(self.slider)
        if leg.times.size > 1:
            longest = min(longest, float(np.min(np.diff(leg.times))))
        steps = math.ceil((leg.end - now) / longest * (1.0 - 1e-12))
        self._steps = max(steps, 1)
        self._way = propagator(self._system, (leg.end - now) / self._steps)
        self._leg = leg.drive, leg.end
        self._run[0].begin = now
        self._run[0].steps = 0.0


def longest_step(structure: Structure) -> float:
    """Return the longest step: a fraction of a radian of the fastest motion on attached
    contacts, and of the time between two updates of a controller.
    """
    system = structure.system
    attached = system.A + np.outer(system.force, system.contact)
    step = _STEP / float(np.max(np.abs(np.linalg.eigvals(attached))))
    every = getattr(structure, "sample_time", 0.0)
    return min(step, every / _UPDATE) if every else step


def propagator(system: LinearSystem, h: float) -> kernel.Propagator:
    """Return the propagator of the state over a step, with its dependence on the
    friction force and on position, velocity and acceleration of the drive.

    Friction force and acceleration are constant within the step.
    """
    A, force, drive, rate, _, _ = system
    n = len(A)
    whole = np.zeros((n + 4, n + 4))
    whole[:n, :n] = A
    whole[:n, n : n + 3] = np.column_stack([force, drive, rate])
    whole[n + 1, n + 2] = 1.0
    whole[n + 2, n + 3] = 1.0
    moved = linalg.expm(whole * h)[:n]
    inputs = (np.ascontiguousarray(moved[:, n + i]) for i in range(4))
    return kernel.Propagator(h, np.ascontiguousarray(moved[:, :n]), *inputs)


def _parts(
    structure: Structure,
) -> tuple[LinearSystem, kernel.Body, kernel.Controller]:
    """Return linear system, body and controller of a structure, in the form that the
    kernel needs; only a sampled controller is separate from the system.
    """
    if isinstance(structure, ControlledAxis) and structure.sample_time > 0.0:
        return _sampled(structure)
    system = structure.system
    spring = float(getattr(structure, "stiffness", 0.0))
    works = kernel.BY_DRIVE if spring > 0.0 else kernel.BY_TRACK
    if isinstance(structure, ControlledAxis):
        works = kernel.BY_CONTROLLER
    body = _body(structure, system, structure.pull, spring, works)
    return system, body, _UNSAMPLED


_UNSAMPLED = kernel.Controller(0.0, 0.0, 0.0, 0.0, 0.0)


def _sampled(
    axis: ControlledAxis,
) -> tuple[LinearSystem, kernel.Body, kernel.Controller]:
    """Return the parts of an axis with a sampled controller: its force is the last
    state, and constant between updates.
    """
    inverse = 1.0 / axis.mass
    nothing = np.zeros(3)
    system = LinearSystem(
        A=np.array([[0.0, 1.0, 0.0], [0.0, -axis.damping, inverse], [0.0, 0.0, 0.0]]),
        force=np.array([0.0, -inverse, 0.0]),
        drive=nothing,
        rate=nothing,
        contact=np.array([1.0, 0.0, 0.0]),
        track=0.0,
    )
    pulled = Pull(np.array([0.0, 0.0, 1.0]), 0.0, 0.0)
    gains = axis.kp, axis.ki, axis.kd, axis.sample_time, axis.encoder_step
    body = _body(axis, system, pulled, 0.0, kernel.BY_CONTROLLER)
    return system, body, kernel.Controller(*gains)


def _body(
    structure: Structure,
    system: LinearSystem,
    pulled: Pull,
    spring: float,
    works: int,
) -> kernel.Body:
    A, force, drive, rate, contact, track = system
    n = len(A)
    forms = [np.zeros((n, n)) for _ in range(3)]
    for form, known in zip(forms, structure.energies or (), strict=False):
        form[: len(known), : len(known)] = known[:n, :n]
    kinetic, elastic, lost = forms
    return kernel.Body(
        contact=contact,
        moving=contact @ A,
        moving_drive=float(contact @ drive),
        moving_rate=float(contact @ rate) + track,
        kick=force,
        pull=pulled.state,
        pull_drive=pulled.drive,
        pull_rate=pulled.rate,
        track=track,
        spring=spring,
        kinetic=kinetic,
        elastic=elastic,
        lost=lost,
        works=works,
    )

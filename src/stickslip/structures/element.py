"""The interface as an element of another simulator."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from stickslip.errors import LARGEST, InputError, instance, number, refused
from stickslip.model import Contacts, FromRest, Interface, Rig
from stickslip.model.methods import DRAWN, Method
from stickslip.simulation.engines.base import Beginning, engine_of

if TYPE_CHECKING:
    from stickslip.structures.contacts import ContactByContact
    from stickslip.structures.engines import DrivenEngine

_FARTHEST = 1e4  # longest step, in x_s, in which each contact breaks this many times


class Reaction(NamedTuple):
    """Response of an interface to a step."""

    force: float
    """Friction force at the end of the step; it resists a positive displacement."""
    impulse: float
    """Integral of the force over the time of the step."""
    stiffness: float
    """Derivative of the force by the displacement, at the end of the step."""


class NextEvent(NamedTuple):
    """Distances of the slider, and time, until the interface changes."""

    ahead: float
    """Distance forward until a contact breaks; infinite if none would."""
    behind: float
    """Distance back until a contact breaks."""
    reattachment: float
    """Time until a contact re-attaches; infinite if none will."""


@dataclass(frozen=True)
class State:
    """State of an element, as `Element.save` returns it; can be pickled and compared.

    It includes the random numbers, so that an element that loads it continues bit for
    bit.
    """

    element: str  #: identifies the elements that can load it: those with equal contacts
    content: Any  #: bytes of the single contacts, or an engine of the method


class Element:
    """The interface as an element of another simulator, which prescribes the motion of
    the slider and gets force, impulse and stiffness.

    For `Contacts` without ageing and activation, a step is exact: the result depends on
    the path of the slider, and not on its division into steps. Other interfaces and
    methods use the engines of runs, which are some 100 times slower, move the slider
    along lines, and have no `next_event`. Numbers are in the rig's own units; for an
    `Interface`, natural and per contact.

    Parameters
    ----------
    rig : Rig or Interface
        The contacts, with the start of the rig: attached at displacement 0, or sliding
        at the rig's velocity. The caller simulates slider and drive.
    method : Contacts, MasterEquation or Population
        Method for the contacts, by default 1,000 single ones.

    Raises
    ------
    InputError
        If the method does not support a part of the interface.

    Notes
    -----
    **Right: couple by the impulse.** The force jumps with each break, so a scheme that
    uses the forces at the ends of steps is of first order. Verlet with the impulse is
    of second order (for a mass on 1,000 contacts, errors 8.9e-6, 1.2e-7 and 1.3e-9
    ``x_s`` at steps of 1e-3, 1e-4 and 1e-5; 7.2e-7 at 1e-5 with the force at the
    end)::

        x += dt * v + 0.5 * dt**2 * (pull - friction) / mass
        friction, impulse, _ = element.step(dt, x, velocity=v)
        before, pull = pull, pull_at(x)
        v += (0.5 * dt * (before + pull) - impulse) / mass

    **Wrong: a callback in** ``scipy.integrate.solve_ivp``. Its trial evaluations would
    move the contacts: errors 3.7e-3, 4.5e-4, 2.2e-3 with `rtol` 1e-3, 1e-4, 1e-6. A
    solver that rejects steps has to `load` before each evaluation, and to step and
    `save` after acceptance: errors 1.1e-3, 2.7e-4, 5.7e-5.

    Examples
    --------
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1)
    ... )
    >>> element = ss.Element(interface, method=ss.Contacts(1000, seed=1))
    >>> before = element.save()
    >>> force, impulse, stiffness = element.step(0.01, displacement=0.5)
    >>> round(force, 2), round(impulse, 4), round(stiffness, 3)
    (0.5, 0.0025, 1.0)
    >>> element.load(before)
    """

    def __init__(self, rig: Rig | Interface, method: Method = Contacts(1000)) -> None:
        instance("Element: rig", rig, Rig | Interface, "a Rig or an Interface")
        if isinstance(rig, Rig):
            interface = rig.interface
            beginning = Beginning(interface, None, rig.natural.velocity, rig.start)
            names = ("length", "time", "force", "stiffness", "energy")
            sizes = [rig.unit(name) for name in names]
        else:
            interface = rig
            beginning = Beginning(interface, None, 0.0, FromRest())
            sizes = [1.0] * 5
        self._length, self._time, self._force, self._stiffness, self._energy = sizes
        self._velocity = self._length / self._time
        self._carrier = _carrier(beginning, method)
        # elements with other seeds can exchange states, which hold the random numbers
        alike = replace(method, seed=0) if isinstance(method, DRAWN) else method
        kind = repr((interface, alike))
        self._kind = hashlib.sha256(kind.encode()).hexdigest()[:16]

    def step(
        self,
        dt: float,
        displacement: float,
        velocity: float | None = None,
    ) -> Reaction:
        """Move the slider to a displacement, and return the response of the interface.

        Parameters
        ----------
        dt : float
            Duration of the step, above 0.
        displacement : float
            Displacement of the slider at the end of the step.
        velocity : float, optional
            Velocity of the slider at the start of the step. With it, the motion within
            the step is a parabola; by default it is a line.

        Raises
        ------
        InputError
            If a number is not finite, the duration is not above 0, or the step is
            longer than 10,000 breaking displacements.
        """
        v = math.nan
        if velocity is not None:
            v = _number("velocity", velocity) / self._velocity
        h = _number("dt", dt) / self._time
        if not h > 0.0:
            number("Element.step: dt", dt, above=0, hint="the duration of the step")
        x = _number("displacement", displacement) / self._length
        way = max(abs(x - self._carrier.here[1]), abs(v * h) if v == v else 0.0)
        if way > _FARTHEST:
            raise refused(
                "Element.step: displacement",
                displacement,
                f"is {way:.3g} breaking displacements away; take shorter steps",
            )
        force, impulse, stiffness = self._carrier.step(h, v, x)
        return Reaction(
            force * self._force,
            impulse * self._force * self._time,
            stiffness * self._stiffness,
        )

    @property
    def time(self) -> float:
        """Time since the start."""
        return self._carrier.here[0] * self._time

    @property
    def displacement(self) -> float:
        """Position of the slider."""
        return self._carrier.here[1] * self._length

    @property
    def force(self) -> float:
        """Present friction force."""
        return self._carrier.force * self._force

    @property
    def stored_energy(self) -> float:
        """Energy presently stored in the contacts."""
        return self._carrier.energies()[0] * self._energy

    @property
    def lost_energy(self) -> float:
        """Energy lost by breaking and by sliding contacts since the start."""
        return self._carrier.energies()[1] * self._energy

    def next_event(self) -> NextEvent:
        """Return how far the slider can move in either direction until a contact
        breaks, and the time until the next one re-attaches.
        """
        ahead, behind, wait = self._carrier.next_event()
        return NextEvent(ahead * self._length, behind * self._length, wait * self._time)

    def save(self) -> State:
        """Return the state, including the random numbers."""
        return State(self._kind, self._carrier.save())

    def load(self, state: State) -> None:
        """Restore a state that `save` returned, of this element or of another one with
        equal contacts; `InputError` for other states.
        """
        instance("Element.load: state", state, State, "a State of Element.save()")
        if state.element != self._kind:
            raise InputError(
                f"Element.load: state.element = {state.element!r}: is of other "
                "contacts or another method; load what an element like this one saved"
            )
        self._carrier.load(state.content)


def _number(name: str, value: object) -> float:
    """Return a finite number, with a fast path for valid floats."""
    if isinstance(value, float) and -LARGEST <= value <= LARGEST:
        return value
    return number(f"Element.step: {name}", value)


def _carrier(beginning: Beginning, method: Method) -> ContactByContact | DrivenEngine:
    """Return the contacts, simulated by a method."""
    # imported here, so that importing `Element` does not load compiled kernels
    from stickslip.structures.contacts import ContactByContact
    from stickslip.structures.engines import DrivenEngine

    interface = beginning.interface
    engine = engine_of(interface, method)
    if isinstance(method, Contacts) and not (interface.ageing or interface.activation):
        return ContactByContact(beginning, method)
    return DrivenEngine(beginning, method, engine)

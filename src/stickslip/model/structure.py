"""Linear structures that hold an interface: modes, matrices, a state space, or an axis
with its controller.

A structure is loaded by the friction force per contact ``F``, which opposes the
sliding, and moved by the drive at ``D``; it gives the position ``X`` of the contacts:

    z' = A z + force F + drive D + rate D',        X = contact z + track D

Runs and theory need nothing else of a structure (`LinearSystem`). Natural units, per
contact.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.errors import InputError
from stickslip.model.body import Damping, MassAbove0, Slider
from stickslip.model.records import Number, Record

# a matrix counts as symmetric, or as without negative eigenvalues, to within this
# fraction of its largest entry
_ROUNDING = 1e-9


class LinearSystem(NamedTuple):
    """``z' = A z + force F + drive D + rate D'``, ``X = contact z + track D``."""

    A: Array
    force: Array
    drive: Array
    rate: Array
    contact: Array
    track: float  # 1 where the drive moves the track under the structure, else 0


class Quadratics(NamedTuple):
    """Energies of a structure, ``z kinetic z / 2`` and, of its springs,
    ``z elastic z / 2``, and the power that it dissipates, ``z lost z``.
    """

    kinetic: Array
    elastic: Array
    lost: Array


class Pull(NamedTuple):
    """The force that pulls a structure, ``state z + drive D + rate V``."""

    state: Array
    drive: float
    rate: float

    def force(self, z: Array, place: float, velocity: float) -> float:
        """Force on a structure in state `z`, at a place and velocity of the drive."""
        return float(self.state @ z + self.drive * place + self.rate * velocity)


@dataclass(frozen=True, kw_only=True)
class Structure(Record):
    """Base of linear structures. Called as a function, a structure returns its
    mechanical impedance at the contacts.

    A structure of the user's own derives from this class and gives its `system`.
    """

    @property
    def system(self) -> LinearSystem:
        """Its equations of motion."""
        raise NotImplementedError

    @property
    def energies(self) -> Quadratics | None:
        """Its energies, where they are known."""
        return None

    @property
    def pull(self) -> Pull:
        """The force of its driving spring or controller; without either, the force that
        would hold the present displacement of the contacts at rest.
        """
        system = self.system
        static = float(self(np.zeros(1))[0].real)
        return Pull(-static * system.contact, static * (1.0 - system.track), 0.0)

    @property
    def parts(self) -> tuple[str, Array]:
        """Name of its parts, and rows that give their displacements from the state."""
        return "", np.empty((0, len(self.system.A)))

    @property
    def passive(self) -> bool:
        """Whether it can only dissipate energy, for a drive at rest."""
        return False

    @property
    def slowest(self) -> Slider:
        """A mass on a spring as slow as the slowest mode: with the static stiffness of
        the structure, and the frequency and decay of that mode.
        """
        roots = np.linalg.eigvals(self.system.A)
        root = roots[np.argmin(np.abs(roots))]
        held = np.array([1e-6j * abs(root)])  # not 0: an integral is infinite there
        stiffness = float(self(held)[0].real)
        return Slider(
            stiffness=stiffness,
            mass=stiffness / abs(root) ** 2,
            damping=2.0 * abs(root.real),
        )

    def sliding(self, velocity: float, force: float) -> tuple[Array, float]:
        """Return the state of steady sliding under a friction force, with the contacts
        at 0, and the position of the drive in it.

        The state drifts as ``z = z0 + r t`` with ``A r + drive V = 0``.
        """
        A, friction, drive, rate, contact, track = self.system
        n = len(A)
        drift = np.linalg.solve(A, -drive * velocity)
        square = np.zeros((n + 1, n + 1))
        square[:n, :n] = A
        square[:n, n] = drive
        square[n, :n] = contact
        square[n, n] = track
        right = np.append(drift - friction * force - rate * velocity, 0.0)
        found = np.linalg.solve(square, right)
        return found[:n], float(found[n])

    def __call__(self, s: NDArray[Any], /) -> NDArray[Any]:
        """Force over displacement for motion as ``exp(s t)``, at each `s` in 1/time;
        infinite where a controller integrates.
        """
        points = np.asarray(s, dtype=complex)
        system = self.system
        shifted = points[..., None, None] * np.eye(len(system.A)) - system.A
        right = np.broadcast_to(
            system.force[:, None].astype(complex), (*points.shape, len(system.A), 1)
        )
        try:
            states = np.linalg.solve(shifted, right)
        except np.linalg.LinAlgError:  # `s` is a natural frequency to the last bit
            return self(points + 1e-15 * np.linalg.norm(system.A))
        receptance = -(system.contact @ states)[..., 0]
        found = np.full(points.shape, complex(np.inf, 0.0))
        np.divide(1.0, receptance, out=found, where=receptance != 0)
        return found


_Masses = tuple[
    Annotated[
        float,
        Number("f_s time^2/x_s", above=0, hint="numbers, one for each mode"),
    ],
    ...,
]
_Stiffnesses = tuple[
    Annotated[float, Number("k", at_least=0, hint="numbers, one for each mode")], ...
]
_Dampings = tuple[
    Annotated[float, Number("1/time", above=0, hint="numbers, one for each mode")], ...
]
_Participations = tuple[Annotated[float, Number(hint="numbers, such as (1.0,)")], ...]
_Spring = Annotated[float, Number("k", at_least=0, hint="K/N")]


_Matrices = tuple[Array, Array, Array]
"""Matrices of mass, damping and stiffness."""


class _SecondOrder(Structure):
    """``M q'' + C q' + K q = drive spring (D - drive q) - contact F``; without the
    driving spring the drive moves the track.
    """

    contact: tuple[float, ...]
    drive: tuple[float, ...]
    stiffness: float

    @property
    def matrices(self) -> _Matrices:
        """Mass, damping and stiffness, without the driving spring."""
        raise NotImplementedError

    @property
    def passive(self) -> bool:
        """Whether it can only dissipate energy."""
        return True

    @cached_property
    def system(self) -> LinearSystem:
        """The equations of motion as a system of first order."""
        mass, damping, stiffness = self.matrices
        n = len(mass)
        spring = self.stiffness
        contact = np.array(self.contact)
        drive = np.array(self.drive)
        held = stiffness + spring * np.outer(drive, drive)
        lower = np.linalg.solve(
            mass, np.column_stack([-held, -damping, -contact, spring * drive])
        )
        upper = np.column_stack([np.zeros((n, n)), np.eye(n), np.zeros((n, 2))])
        rows = np.vstack([upper, lower])
        return LinearSystem(
            A=rows[:, : 2 * n],
            force=rows[:, 2 * n],
            drive=rows[:, 2 * n + 1],
            rate=np.zeros(2 * n),
            contact=np.concatenate([contact, np.zeros(n)]),
            track=float(spring == 0),
        )

    @property
    def energies(self) -> Quadratics:
        """Energies in the state ``(q, q')``, without that of the driving spring."""
        mass, damping, stiffness = self.matrices
        nothing = np.zeros_like(mass)
        return Quadratics(
            kinetic=np.block([[nothing, nothing], [nothing, mass]]),
            elastic=np.block([[stiffness, nothing], [nothing, nothing]]),
            lost=np.block([[nothing, nothing], [nothing, damping]]),
        )

    @property
    def pull(self) -> Pull:
        """The force of its driving spring, if it has one."""
        if not self.stiffness:
            return super().pull
        place = -self.stiffness * np.array(self.drive)
        return Pull(np.append(place, np.zeros(place.size)), self.stiffness, 0.0)


def _first(rows: Array) -> Array:
    """Extend rows that act on coordinates to rows that act on the state, with zeros for
    the velocities.
    """
    return np.hstack([rows, np.zeros_like(rows)])


@dataclass(frozen=True, kw_only=True)
class Modes(_SecondOrder):
    """A structure given by its modes, as listed by a finite-element model or a modal
    test.

    With ``phi_j = contact[j]`` and ``psi_j = drive[j]``, the contacts are at
    ``X = sum_j phi_j q_j`` and the modes move by

        m_j (q_j'' + eta_j q_j') + k_j q_j = psi_j K (D - sum_i psi_i q_i) - phi_j F

    Without a driving spring the structure is held by its own modes, and the drive moves
    the track under it, like the disc under a brake caliper:
    ``X = D + sum_j phi_j q_j``.

    Parameters
    ----------
    masses, stiffnesses, dampings : sequence of float, shape (n,)
        Modal masses and stiffnesses per contact, and ``eta_j > 0`` in 1/time. The
        rigid motion of a free body is a mode of stiffness 0.
    contact : sequence of float, shape (n,)
        Displacement of each mode where the contacts are; by default 1.
    drive : sequence of float, shape (n,)
        Displacement of each mode where the driving spring pulls; by default that at the
        contacts.
    stiffness : float
        The driving spring ``K/N``.

    Raises
    ------
    InputError
        If the numbers of values differ, or nothing holds the structure.

    Examples
    --------
    >>> caliper = ss.model.Modes(
    ...     masses=(1e-4, 2e-4), stiffnesses=(2.0, 30.0), dampings=(40.0, 60.0)
    ... )
    >>> float(caliper(0.0).real)  # both modes yield: 1/(1/2 + 1/30)
    1.875
    """

    masses: _Masses
    stiffnesses: _Stiffnesses
    dampings: _Dampings
    contact: _Participations = ()
    drive: _Participations = ()
    stiffness: _Spring = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        count = len(self.masses)
        contact = self.contact or (1.0,) * count
        object.__setattr__(self, "contact", contact)
        object.__setattr__(self, "drive", self.drive or contact)
        for field in ("masses", "stiffnesses", "dampings", "contact", "drive"):
            if not len(getattr(self, field)) == count > 0:
                raise _wrong(
                    f"Modes.{field}",
                    f"{len(getattr(self, field))} values: must be as many as masses, "
                    "at least one",
                )
        if not any(self.contact):
            raise _wrong(
                "Modes.contact",
                "is 0 in every mode: no mode moves the contacts; give one that does",
            )
        if self.stiffness == 0 and min(self.stiffnesses) == 0:
            raise _wrong(
                "Modes.stiffness",
                "is 0: nothing holds the slider, one of its modes has no stiffness; "
                "give the driving spring",
            )

    @property
    def parts(self) -> tuple[str, Array]:
        """Displacement of the contacts by each mode."""
        return "mode", _first(np.diag(self.contact))

    @property
    def _diagonals(self) -> _Matrices:
        mass = np.array(self.masses)
        return mass, mass * np.array(self.dampings), np.array(self.stiffnesses)

    @property
    def matrices(self) -> _Matrices:
        """Diagonal matrices of mass, damping and stiffness."""
        mass, damping, stiffness = map(np.diag, self._diagonals)
        return mass, damping, stiffness

    def __call__(self, s: NDArray[Any], /) -> NDArray[Any]:
        """Force over displacement at each `s`."""
        if self.drive != self.contact:
            return super().__call__(s)
        s = np.asarray(s, dtype=complex)
        m, loss, k = (np.reshape(a, (-1, *[1] * s.ndim)) for a in self._diagonals)
        weight = np.reshape(np.square(self.contact), m.shape)
        each = s * (m * s + loss) + k
        with np.errstate(divide="ignore", invalid="ignore"):
            together = 1.0 / np.sum(weight / each, axis=0)
        # A mode without resistance at this s: the contacts move without force.
        gives_way = np.any((each == 0) & (weight > 0), axis=0)
        return np.asarray(self.stiffness + np.where(gives_way, 0.0, together))


def _rows(unit: str) -> Any:
    """Return the type of a square matrix of numbers in a unit, given by its rows."""
    hint = "rows of numbers"
    return tuple[tuple[Annotated[float, Number(unit, hint=hint)], ...], ...]


def _check_shape(place: str, value: Any, shape: tuple[int, ...]) -> None:
    """Raise `InputError` unless a vector, or a matrix given by rows, has this shape."""
    if shape[0] == 0:
        raise _wrong(place, "is empty; give at least one row of numbers")
    lengths = [len(row) for row in value] if len(shape) == 2 else []
    if len(value) != shape[0] or any(length != shape[1] for length in lengths):
        wanted = " rows of ".join(map(str, shape))
        raise _wrong(place, f"must be {wanted} numbers, as the others are")


def _wrong(place: str, words: str) -> InputError:
    """Return the error that refuses a field."""
    return InputError(f"{place}: {words}", place)


@dataclass(frozen=True, kw_only=True)
class Matrices(_SecondOrder):
    """A structure given by its matrices, ``M q'' + C q' + K q``, such as those of a
    reduced finite-element model.

    The contacts are at ``X = contact q``, and the driving spring pulls at ``drive q``;
    without a spring the drive moves the track under the structure, see `Modes`.

    Parameters
    ----------
    M, C, K : matrix given by its rows, shape (n, n)
        Mass, damping and stiffness per contact: symmetric, `M` positive definite, `C`
        and `K` without negative eigenvalues.
    contact, drive : sequence of float, shape (n,)
        Displacement of the contacts, and of the point where the spring pulls, per unit
        of each coordinate; `drive` by default equals `contact`.
    stiffness : float
        The driving spring ``K/N``.

    Raises
    ------
    InputError
        If shapes differ, a matrix is not as stated above, or nothing holds the
        structure.

    Examples
    --------
    >>> string = ss.model.Matrices(
    ...     M=((1e-3, 0.0), (0.0, 1e-3)),
    ...     C=((0.1, 0.0), (0.0, 0.1)),
    ...     K=((1.0, -1.0), (-1.0, 1.0)),
    ...     contact=(1.0, 0.0),
    ...     drive=(0.0, 1.0),
    ...     stiffness=1.0,
    ... )
    >>> round(float(string(0.0).real), 12)  # two equal springs in series
    0.5
    """

    M: _rows("f_s time^2/x_s")  # type: ignore[valid-type]
    C: _rows("f_s time/x_s")  # type: ignore[valid-type]
    K: _rows("k")  # type: ignore[valid-type]
    contact: _Participations
    drive: _Participations = ()
    stiffness: _Spring = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "drive", self.drive or self.contact)
        n = len(self.M)
        for field in ("M", "C", "K"):
            _check_shape(f"Matrices.{field}", getattr(self, field), (n, n))
            matrix = np.array(getattr(self, field))
            rounding = _ROUNDING * float(np.max(np.abs(matrix), initial=0.0))
            lowest = float(np.min(np.linalg.eigvalsh(matrix), initial=np.inf))
            if np.max(np.abs(matrix - matrix.T), initial=0.0) > rounding:
                raise _wrong(f"Matrices.{field}", "must be symmetric")
            if lowest < -rounding or (field == "M" and not lowest > rounding):
                least = "above 0" if field == "M" else "0 or above"
                raise _wrong(
                    f"Matrices.{field}",
                    f"has the eigenvalue {lowest:.3g}; they must all be {least}",
                )
        for field in ("contact", "drive"):
            _check_shape(f"Matrices.{field}", getattr(self, field), (n,))
        if not any(self.contact):
            raise _wrong("Matrices.contact", "is 0; give where the contacts are")
        held = np.array(self.K) + self.stiffness * np.outer(self.drive, self.drive)
        if np.linalg.matrix_rank(held, hermitian=True) < n:
            raise _wrong(
                "Matrices.K",
                "nothing holds the structure, a motion of it has no stiffness; give a "
                "driving spring that does",
            )

    @property
    def parts(self) -> tuple[str, Array]:
        """Its coordinates."""
        return "coordinate", _first(np.eye(len(self.M)))

    @property
    def damping(self) -> float:
        """Mean damping rate ``trace C/trace M``."""
        return float(np.trace(self.C) / np.trace(self.M))

    def with_damping(self, damping: float) -> "Matrices":
        """Return the structure with its damping matrix scaled to this mean rate."""
        if not self.damping:
            raise _wrong("Matrices.C", "is 0; give damping before it is varied")
        larger = damping / self.damping * np.array(self.C)
        return replace(self, C=tuple(map(tuple, larger.tolist())))

    @property
    def matrices(self) -> _Matrices:
        """Mass, damping and stiffness."""
        return np.array(self.M), np.array(self.C), np.array(self.K)


@dataclass(frozen=True, kw_only=True)
class StateSpace(Structure):
    """A structure given by its state space, as system identification or a control
    toolbox returns it: ``z' = A z + force F + drive D + rate D'``, ``X = contact z``.

    Parameters
    ----------
    A : matrix given by its rows, shape (n, n)
        System matrix, in 1/time.
    force, drive, rate : sequence of float, shape (n,)
        Inputs: the friction force per contact, which opposes the sliding (so a mass
        has -1/M), the displacement of the drive, and its velocity (by default 0).
    contact : sequence of float, shape (n,)
        Output: the displacement of the contacts.

    Raises
    ------
    InputError
        If shapes differ, or the contacts have no inertia: ``contact force`` must be 0
        and ``contact A force`` below 0.

    Examples
    --------
    >>> oscillator = ss.model.StateSpace(
    ...     A=((0.0, 1.0), (-2e4, -40.0)),
    ...     force=(0.0, -1e4),
    ...     drive=(0.0, 2e4),
    ...     contact=(1.0, 0.0),
    ... )
    >>> round(float(oscillator(0.0).real), 12)
    2.0
    """

    A: _rows("1/time")  # type: ignore[valid-type]
    force: tuple[
        Annotated[float, Number("1/(f_s time)", hint="one for each state")], ...
    ]
    drive: tuple[
        Annotated[float, Number("1/(x_s time)", hint="one for each state")], ...
    ]
    contact: tuple[Annotated[float, Number("x_s", hint="one for each state")], ...]
    rate: tuple[Annotated[float, Number("1/x_s", hint="one for each state")], ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        n = len(self.A)
        object.__setattr__(self, "rate", self.rate or (0.0,) * n)
        _check_shape("StateSpace.A", self.A, (n, n))
        for field in ("force", "drive", "contact", "rate"):
            _check_shape(f"StateSpace.{field}", getattr(self, field), (n,))
        force = np.array(self.force)
        contact = np.array(self.contact)
        at_once = float(contact @ force)
        if abs(at_once) > _ROUNDING * float(np.abs(contact) @ np.abs(force)):
            raise _wrong(
                "StateSpace.contact",
                f"contact force = {at_once:.3g}: a force must not move the contacts at "
                "once; add the inertia that they move",
            )
        if not contact @ np.array(self.A) @ force < 0:
            raise _wrong(
                "StateSpace.force",
                "contact A force must be below 0: the friction force slows the "
                "contacts down (a mass has -1/M)",
            )

    @cached_property
    def system(self) -> LinearSystem:
        """The given equations."""
        return LinearSystem(
            A=np.array(self.A),
            force=np.array(self.force),
            drive=np.array(self.drive),
            rate=np.array(self.rate),
            contact=np.array(self.contact),
            track=0.0,
        )


@dataclass(frozen=True, kw_only=True)
class ControlledAxis(Structure):
    """A mass that a position controller moves: ``M (X'' + eta X') = u - F`` with
    ``u = kp e + ki Int e dt + kd e'``, ``e = D - X``.

    The gains of a cascade of controllers follow from `cascade`.

    Parameters
    ----------
    mass : float
        ``M/N``.
    damping : float
        ``eta`` of the axis itself, in 1/time.
    kp, ki, kd : float
        Gains, per contact.
    sample_time : float
        Time between two updates of the controller; 0 for a continuous one. Its force is
        held in between, and the rate of the error is that since the last update. Linear
        theory includes both, up to about half the frequency of the updates.
    encoder_step : float
        Resolution of the position that the controller measures, in runs; 0 for exact.
    moves : sequence of float
        Moves after which the axis is to stand still, for the answer on hunting; by
        default several are tried.

    Examples
    --------
    >>> axis = ss.model.ControlledAxis(mass=1e-4, kp=2.0, ki=1.0, kd=0.004)
    >>> round(float(axis(1j).imag), 12)
    -0.996
    """

    mass: MassAbove0
    kp: Annotated[float, Number("k", above=0, hint="per contact")]
    ki: Annotated[float, Number("k/time", at_least=0, hint="per contact")] = 0.0
    kd: Annotated[float, Number("f_s time/x_s", at_least=0, hint="per contact")] = 0.0
    damping: Damping = 0.0
    sample_time: Annotated[float, Number("time", at_least=0)] = 0.0
    encoder_step: Annotated[float, Number("x_s", at_least=0)] = 0.0
    moves: tuple[
        Annotated[float, Number("x_s", above=0, hint="moves, such as (2.0, 5.0)")], ...
    ] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.encoder_step > 0.0 and self.sample_time == 0.0:
            raise _wrong(
                "ControlledAxis.encoder_step",
                f"{self.encoder_step:.4g} needs a sample_time: a controller that looks "
                "all the time has no last position; give one",
            )

    @cached_property
    def system(self) -> LinearSystem:
        """The equations of motion; states are position, velocity and, if ``ki`` is not
        0, the integral of the error.
        """
        n = 3 if self.ki else 2
        inverse = 1.0 / self.mass
        p, d, i = inverse * np.array([self.kp, self.kd, self.ki])
        A = np.array([[0.0, 1.0, 0.0], [-p, -d - self.damping, i], [-1.0, 0.0, 0.0]])
        return LinearSystem(
            A=A[:n, :n],
            force=np.array([0.0, -inverse, 0.0])[:n],
            drive=np.array([0.0, p, 1.0])[:n],
            rate=np.array([0.0, d, 0.0])[:n],
            contact=np.array([1.0, 0.0, 0.0])[:n],
            track=0.0,
        )

    @property
    def pull(self) -> Pull:
        """The force of its controller."""
        gains = np.array([-self.kp, -self.kd, self.ki])
        return Pull(gains[: len(self.system.A)], self.kp, self.kd)

    @property
    def energies(self) -> Quadratics:
        """Kinetic energy and dissipation of the axis itself; gains store nothing."""
        at_velocity = np.zeros_like(self.system.A)
        at_velocity[1, 1] = self.mass
        nothing = np.zeros_like(at_velocity)
        return Quadratics(at_velocity, nothing, self.damping * at_velocity)

    def __call__(self, s: NDArray[Any], /) -> NDArray[Any]:
        """Force over displacement at each `s`; infinite at 0 with an integral."""
        points = np.asarray(s, dtype=complex)
        found = np.full(points.shape, complex(np.inf if self.ki else 0.0, 0.0))
        np.divide(self.ki, points, out=found, where=points != 0)
        held = np.ones_like(points)  # mean of the held force over its value at updates
        if self.sample_time:
            passed = points * self.sample_time
            np.divide(-np.expm1(-passed), passed, out=held, where=passed != 0)
        own = self.mass * points * (self.damping + points)
        return np.asarray(found + held * (self.kp + self.kd * points * held) + own)


def cascade(kpp: float, kv: float, kiv: float) -> tuple[float, float, float]:
    """Return ``kp, ki, kd`` of a position loop ``kpp`` around a velocity loop ``kv``
    with the integral gain ``kiv``: ``kd = kv``, ``kp = kv kpp + kiv``,
    ``ki = kiv kpp``.

    >>> cascade(10.0, 2.0, 5.0)
    (25.0, 50.0, 2.0)
    """
    return kv * kpp + kiv, kiv * kpp, kv

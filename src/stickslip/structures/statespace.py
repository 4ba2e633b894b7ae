"""The contacts in steady sliding as a linear system: a rational fit of their dynamic
stiffness by vector fitting (Gustavsen and Semlyen, IEEE Trans. Power Delivery 14, 1052,
1999).

``kappa(s)/s`` is fitted as a strictly proper function, so that ``kappa(0) = 0`` and
``kappa`` is finite at high frequencies. Poles are kept stable. Passivity is not
enforced: ``kappa`` is not passive, which is the cause of stick-slip.
"""

import io
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.answers import Answer
from stickslip.arrays import Array
from stickslip.errors import InputError, instance, number, whole
from stickslip.model.rig import Rig
from stickslip.model.units import engineering
from stickslip.sliding import kinetic_friction, respond
from stickslip.sliding.response import ComplexArray

# Width of the band, in renewal frequencies per pair of poles. It is below 1, as the
# last pair also represents all resonances beyond the band.
_REACH = 0.6
_POINTS = 60  # fewest frequencies for each pair of poles
_ITERATIONS = 30  # most iterations; poles converge within ten
_SETTLED = 1e-9  # change of the poles at convergence, in renewal frequencies
_FEWEST, _MOST = 4, 24


@dataclass(frozen=True, kw_only=True, repr=False)
class StateSpace(Answer):
    """Linear system of the contacts in steady sliding: ``z' = A z + B x``,
    ``F = friction + C z + D x``, with ``x`` the displacement of the slider relative to
    steady motion.

    Its transfer function `stiffness` is the dynamic stiffness of the contacts, with the
    `error` in the band. It holds only at its velocity, and for motions smaller than
    breaking displacements.
    """

    A: Array  #: shape (poles, poles)
    B: Array  #: shape (poles, 1)
    C: Array  #: shape (1, poles)
    D: Array  #: shape (1, 1)
    velocity: float  #: velocity of steady sliding
    friction: float  #: force of steady sliding
    band: tuple[float, float]  #: angular frequencies between which it was fitted
    error: float  #: largest error in the band, over the largest dynamic stiffness there
    units: dict[str, str]  #: units of velocity, friction, band, and stiffness (C and D)

    def stiffness(self, s: ArrayLike) -> ComplexArray:
        """Return force over displacement for motion ``exp(s t)``, with the shape of
        `s`.
        """
        points = np.asarray(s, dtype=complex)
        states = _transfers(self.A, self.B[:, 0], points.ravel()) @ self.C[0]
        return np.reshape(states + self.D[0, 0], points.shape)

    def to_dict(self) -> dict[str, Any]:
        """Return the system as plain numbers and lists, with its text as ``about``."""
        return {"about": str(self)} | super().to_dict()

    def mat(self) -> bytes:
        """Return the content of a MATLAB file of the system."""
        from scipy.io import savemat

        file = io.BytesIO()
        savemat(file, self.to_dict())  # type: ignore[arg-type]  # its stubs know names alone
        return file.getvalue()

    def __str__(self) -> str:
        force, speed, rate = (
            self.units[name] for name in ("friction", "velocity", "band")
        )
        to_hertz = "Hz" if rate == "1/s" else "cycles per time unit"
        top = engineering(self.band[1] / (2.0 * math.pi), to_hertz)
        return (
            f"dynamic stiffness of the contacts at {engineering(self.velocity, speed)}:"
            f" {len(self.A)} poles, up to {top}, error {self.error:.1e} of its peak;\n"
            f"friction {engineering(self.friction, force)}; for small motions about "
            "steady sliding at this speed only; not passive, as the contacts are not"
        )


def state_space(rig: Rig, *, poles: int = 6) -> StateSpace:
    """Return a linear system that fits the dynamic stiffness of the contacts of a rig,
    in the rig's own units.

    Each resonance, at a multiple of the frequency at which contacts are renewed, needs
    a pair of poles. Two pairs cover 1.2 renewal frequencies, three pairs 1.8.

    Parameters
    ----------
    rig : Rig
        A rig, of which only the contacts and the velocity are used.
    poles : int
        Number of poles, even, from 4 to 24.

    Raises
    ------
    InputError
        If there is no steady sliding, if contacts re-attach at once (the dynamic
        stiffness is then 0), or if the number of poles is refused.

    Examples
    --------
    >>> from stickslip.structures import state_space
    >>> system = state_space(ss.read_rig("brake_pad"))
    >>> system.A.shape, system.error < 1e-3
    ((6, 6), True)
    """
    count = whole("poles", poles, at_least=_FEWEST, at_most=_MOST, hint="4, 6, ...")
    if count % 2:
        raise InputError(
            f"poles = {count}: must be even, a pair for each resonance", "poles"
        )
    instance("state_space: rig", rig, Rig, "a Rig")
    interface = rig.interface
    velocity = number("drive.velocity", rig.natural.velocity, above=0)
    response = respond(interface)
    if response.inert:
        raise InputError(
            f"Interface.delay = {interface.delay}: contacts re-attach at once, so their"
            " dynamic stiffness is 0; there is nothing to fit",
            "Interface.delay",
        )
    renewal = 2.0 * math.pi / response.scales(velocity).cycle
    pairs = count // 2
    band = _REACH * pairs
    known = response.frequencies(velocity, band * renewal) / renewal
    even = band * np.arange(1, _POINTS * pairs + 1) / (_POINTS * pairs)
    omega = np.union1d(even, known[(known > even[0]) & (known < band)])
    kappa = response.stiffness(velocity, 1j * omega * renewal)
    A, residues = _fit(1j * omega, kappa / (1j * omega), pairs)
    B = _input(A)
    # A narrow resonance of the fit lies between the frequencies that were fitted.
    poles_at = np.abs(np.linalg.eigvals(A).imag)
    between = omega - 0.5 * np.diff(omega, prepend=0.0)
    checked = np.union1d(between, poles_at[(poles_at > 0.0) & (poles_at < band)])
    there = response.stiffness(velocity, 1j * checked * renewal)
    exact = np.append(kappa, there)
    s = 1j * np.append(omega, checked)
    fitted = s * (_transfers(A, B, s) @ residues)
    error = float(np.abs(fitted - exact).max() / np.abs(exact).max())
    k = rig.unit("stiffness")
    rate = renewal * rig.unit("rate")
    quantities = {"friction": "force", "band": "rate"}
    quantities |= {"velocity": "velocity", "stiffness": "stiffness"}
    return StateSpace(
        A=rate * A,
        B=rate * B[:, None],
        C=k * (residues @ A)[None],
        D=np.array([[k * float(residues @ B)]]),
        velocity=rig.velocity,
        friction=kinetic_friction(interface, velocity) * rig.unit("force"),
        band=(0.0, band * rate),
        error=error,
        units={name: rig.unit_name(each) for name, each in quantities.items()},
    )


def _blocks(poles: ComplexArray) -> Array:
    """Return a real matrix with these eigenvalues: a block for each complex pair, and a
    diagonal element for each real one.
    """
    upper = poles[poles.imag >= 0.0]
    A = np.zeros((poles.size, poles.size))
    i = 0
    for pole in upper[np.argsort(upper.imag)].tolist():
        A[i, i] = pole.real
        if pole.imag > 0.0:
            A[i + 1, i + 1] = pole.real
            A[i, i + 1] = pole.imag
            A[i + 1, i] = -pole.imag
        i += 1 + (pole.imag > 0.0)
    return A


def _input(A: Array) -> Array:
    """Return the input vector of a matrix of blocks: 1 for real poles and for the first
    state of each pair.
    """
    below = np.append(0.0, np.diag(A, -1))
    return np.where(below == 0.0, 1.0, 0.0)


def _transfers(A: Array, B: Array, s: ComplexArray) -> ComplexArray:
    """Return ``(s - A)**-1 B``, shape (s, states)."""
    matrices = s[:, None, None] * np.eye(len(A)) - A
    return np.asarray(np.linalg.solve(matrices, B[None, :, None])[..., 0])


def _least(matrix: ComplexArray, values: ComplexArray) -> Array:
    """Return the real least-squares solution of a complex linear system."""
    both = np.concatenate([matrix.real, matrix.imag])
    size = np.linalg.norm(both, axis=0)
    found = np.linalg.lstsq(both / size, np.concatenate([values.real, values.imag]))
    return np.asarray(found[0] / size)


def _fit(s: ComplexArray, values: ComplexArray, pairs: int) -> tuple[Array, Array]:
    """Fit values at ``s = i y``, in renewal frequencies; return the matrix of the poles
    and the residues.

    Each iteration moves the poles to the zeros of a weight function with the same
    poles, which makes the weighted values smooth, until they agree. Errors are weighted
    as those of ``kappa``.
    """
    weight = np.abs(s) * np.sqrt(np.gradient(np.abs(s)))
    wanted = weight * values
    numbers = np.arange(1, pairs + 1)
    A = _blocks(np.concatenate([(-0.1 + 1j) * numbers, (-0.1 - 1j) * numbers]))
    for _ in range(_ITERATIONS):
        B = _input(A)
        states = weight[:, None] * _transfers(A, B, s)
        both = np.hstack([states, -values[:, None] * states])
        smoothing = _least(both, wanted)[2 * pairs :]
        moved = np.linalg.eigvals(A - np.outer(B, smoothing))
        before, A = A, _blocks(-np.abs(moved.real) + 1j * moved.imag)
        if np.abs(A - before).max() <= _SETTLED:
            break
    states = weight[:, None] * _transfers(A, _input(A), s)
    return A, _least(states, wanted)

"""Mechanical impedances that hold the slider, in place of ``M s^2 + M eta s + K``.

The impedance ``Z(s)`` of a rig is the force per contact, applied where the contacts
act, that moves the slider by ``exp(s t)`` (a dynamic stiffness, force over
displacement). Natural units per contact.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Protocol, runtime_checkable

import numpy as np
from scipy import linalg

from stickslip.arrays import Array, ComplexArray
from stickslip.errors import InputError
from stickslip.model import ElasticBody, Slider
from stickslip.model.records import Number, Record
from stickslip.model.structure import Structure


@runtime_checkable
class Impedance(Protocol):
    """A mechanical impedance: force over displacement at complex `s`, per contact, in
    units of ``k``.

    It must be passive (``Im Z(i w) >= 0`` for ``w > 0``: the rig only dissipates
    energy), analytic for ``Re s >= 0``, real on the real axis, and hold the slider
    (``Z(0) > 0``). A plain function is allowed. The count of unstable modes is
    guaranteed for the records of this module; for a function it depends on sampling.
    """

    def __call__(self, s: ComplexArray, /) -> ComplexArray:
        """Force over displacement at each `s` (in 1/time)."""
        ...


Body = Slider | Impedance
"""A body in the form that the functions of this package take."""


@dataclass(frozen=True, kw_only=True)
class RadiationDamping(Record):
    """A spring, a mass and an elastic half-space that carries waves away:
    ``Z = K + M s^2 + r s``.

    Parameters
    ----------
    stiffness : float
        Stiffness of the loading ``K/N`` (for a fault patch of size L about ``mu A/L``).
    radiation : float
        ``r = A mu / c_s`` per contact for one radiating half-space on a rigid base,
        ``A mu / (2 c_s)`` where both sides radiate: `A` area per contact, `mu` shear
        modulus, `c_s` speed of shear waves; in units of ``k`` times time.
    mass : float
        ``M/N``; zero for a quasi-dynamic fault.
    """

    stiffness: Annotated[float, Number(above=0, hint="K/N")]
    radiation: Annotated[float, Number(at_least=0, hint="A mu/(2 c_s)")]
    mass: Annotated[float, Number(at_least=0, hint="M/N")] = 0.0

    def __call__(self, s: ComplexArray, /) -> ComplexArray:
        """Force over displacement at each `s`."""
        return np.asarray(
            self.stiffness + s * (self.radiation + self.mass * s), dtype=complex
        )


def impedance(body: Body) -> Impedance:
    """Return the rig's impedance.

    Raises `InputError` if the body is neither a slider nor an impedance, or ``Z(0)`` is
    not above 0.
    """
    if isinstance(body, Slider | RadiationDamping | Structure):
        if isinstance(body, Structure) and not body.passive:
            _check_held(body)
        return body
    if isinstance(body, ElasticBody):
        raise InputError(
            f"Rig.slider = {body!r}: elastic sliders have one mode per wavelength; use "
            "modes() or critical_length()"
        )
    if not callable(body):
        raise InputError(
            f"body = {body!r}: must be a Slider or an impedance, such as Modes(...) or "
            "a function of s"
        )
    held = complex(np.asarray(body(np.zeros(1, dtype=complex))).ravel()[0])
    if not (held.real > 0 and abs(held.imag) <= 1e-12 * abs(held.real)):
        raise InputError(
            f"body: Z(0) = {held:g}: must be real and above 0: a spring has to hold "
            "the slider"
        )
    return body


def _check_held(body: Structure) -> None:
    """Raise `InputError` for a body that is unstable when its sliding surface is held
    still, as the count of unstable modes starts from that state.
    """
    held = poles(body)
    size = float(np.max(np.abs(held), initial=0.0))
    if np.any(held.real > 1e-9 * size):
        raise InputError(
            f"body = {body!r}: is unstable by itself with its sliding surface held "
            "still; mend the structure, or its controller, first"
        )


def is_plain(body: Impedance) -> bool:
    """Whether ``Z = K + r s + M s^2``: its real part falls and its loss rises with
    frequency.
    """
    return isinstance(body, Slider | RadiationDamping)


def resonances(body: Impedance) -> Array:
    """Frequencies near which the impedance may change quickly: its peaks and dips, with
    their widths.
    """
    if not isinstance(body, Structure):
        return np.empty(0)
    near = []
    with_spring = np.concatenate([natural_frequencies(body), poles(body)])
    for root in with_spring[with_spring.imag > 0]:
        width = max(abs(root.real), 1e-9 * root.imag)
        near.append(root.imag + width * np.sinh(np.linspace(-5, 5, 81)))
    found = np.concatenate(near) if near else np.empty(0)
    return np.sort(found[found > 0])


def poles(body: Impedance) -> ComplexArray:
    """Poles of the impedance: the modes of the structure with its sliding surface held
    still.

    In these ``contact z = contact z' = 0``, by the force that keeps both at 0.
    """
    if not isinstance(body, Structure):
        return np.empty(0, dtype=complex)
    A, force, _, _, contact, _ = body.system
    velocity = contact @ A
    holding = A - np.outer(force, velocity @ A) / (velocity @ force)
    basis = linalg.null_space(np.stack([_unit(contact), _unit(velocity)]))
    return np.asarray(linalg.eigvals(basis.T @ holding @ basis), dtype=complex)


def _unit(vector: Array) -> Array:
    """Return the vector of length 1 in the same direction."""
    return np.asarray(vector / np.linalg.norm(vector))


def spring_at_contact(body: Impedance) -> float | None:
    """Stiffness of a driving spring that pulls at the contacts, and so adds to the
    impedance; None if it pulls elsewhere.
    """
    if isinstance(body, Structure):
        drive = getattr(body, "drive", None)
        if drive is None or drive != getattr(body, "contact", None):
            return None
    found = getattr(body, "stiffness", None)
    return None if found is None else float(found)


@lru_cache(maxsize=64)
def _roots(*coefficients: float) -> ComplexArray:
    """Roots of a polynomial, cached as they are needed several times."""
    return np.roots(coefficients).astype(complex)


def natural_frequencies(body: Impedance) -> ComplexArray:
    """Zeros of the impedance, where known: the modes of the rig without the
    interface.
    """
    match body:
        case Slider():
            return _roots(body.mass, body.mass * body.damping, body.stiffness)
        case RadiationDamping():
            return _roots(body.mass, body.radiation, body.stiffness)
        case Structure():
            return np.linalg.eigvals(body.system.A).astype(complex)
    return np.empty(0, dtype=complex)

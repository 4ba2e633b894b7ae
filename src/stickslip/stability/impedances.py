"""Holders of the slider: mechanical impedances to stand for ``M s^2 + M eta s + K``.

A rig answers one question: which force per contact, applied where the contacts act,
moves the slider by ``exp(s t)``? That is its impedance ``Z(s)`` (a dynamic stiffness,
force over displacement). Natural units per contact.
"""

from dataclasses import dataclass
from typing import Annotated, Protocol, runtime_checkable

import numpy as np
from scipy import linalg

from stickslip.arrays import Array, ComplexArray
from stickslip.errors import InputError
from stickslip.model import ElasticBody, Slider
from stickslip.model.records import Number, Record


@runtime_checkable
class Impedance(Protocol):
    """A mechanical impedance: force over displacement at complex `s`, per contact, in
    units of ``k``.

    It must be passive (``Im Z(i w) >= 0`` for ``w > 0``: the rig takes energy out and
    puts none in), analytic for ``Re s >= 0``, real on the real axis, and hold the
    slider (``Z(0) > 0``). A plain function will do. The count of unstable modes is
    guaranteed for the records of this module; for a function it rests on sampling.
    """

    def __call__(self, s: ComplexArray, /) -> ComplexArray:
        """Force over displacement at each `s` (in 1/time)."""
        ...


Body = Slider | Impedance
"""A body, as the functions of this package take it."""


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


@dataclass(frozen=True, kw_only=True)
class Modes(Record):
    """An elastic slider given by its modes, as a finite-element model or a modal test
    lists them.

    The modes carry the same force and their displacements add, so receptances add:
    ``G(s) = sum_j 1/(m_j (s^2 + eta_j s) + k_j)`` and ``Z = stiffness + 1/G``.

    Parameters
    ----------
    masses, stiffnesses, dampings : sequence of float, shape (n,)
        Modal masses and stiffnesses per contact, scaled so that the mode's displacement
        at the interface is 1, and ``eta_j > 0`` in 1/time. With the far end of the
        drive held still in the modal analysis, they are all there is and `stiffness`
        is 0. For the modes of the free body a stiffness of 0 is its rigid motion.
    stiffness : float
        A driving spring ``K/N`` that pulls at the interface, beside the modes.
    """

    masses: Annotated[
        tuple[float, ...], Number(above=0, hint="numbers, one for each mode")
    ]
    stiffnesses: Annotated[
        tuple[float, ...], Number(at_least=0, hint="numbers, one for each mode")
    ]
    dampings: Annotated[
        tuple[float, ...], Number(above=0, hint="numbers, one for each mode")
    ]
    stiffness: Annotated[float, Number(at_least=0, hint="K/N")] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in ("masses", "stiffnesses", "dampings"):
            if not len(self.masses) == (count := len(getattr(self, field))) > 0:
                raise InputError(
                    f"Modes.{field}: {count} values: must be as many as masses, at "
                    "least one"
                )
        if self.stiffness == 0 and min(self.stiffnesses) == 0:
            raise InputError(
                "Modes.stiffness = 0: nothing holds the slider, one of its modes has "
                "no stiffness; "
                "give the driving spring"
            )

    def __call__(self, s: ComplexArray, /) -> ComplexArray:
        """Force over displacement at each `s`."""
        s = np.asarray(s, dtype=complex)
        each = (self.masses, self.dampings, self.stiffnesses)
        m, eta, k = (np.reshape(values, (-1, *[1] * s.ndim)) for values in each)
        scale = np.maximum(np.maximum(m, k), 1e-300)
        # 1/G as a product over sums of products: finite where a mode alone would be.
        scaled = (m * s * (s + eta) + k) / scale
        others = [
            np.prod(np.delete(scaled, i, axis=0), axis=0) / scale[i]
            for i in range(len(scale))
        ]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(
                self.stiffness + np.prod(scaled, axis=0) / np.sum(others, axis=0)
            )


def impedance(body: Body) -> Impedance:
    """Return the rig's impedance.

    Raises `InputError` if it is neither, or ``Z(0)`` is not above 0.
    """
    if isinstance(body, Slider | RadiationDamping | Modes):
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


def is_plain(body: Impedance) -> bool:
    """Whether ``Z = K + r s + M s^2``, whose real part falls and whose loss rises
    with frequency.
    """
    return isinstance(body, Slider | RadiationDamping)


def resonances(body: Impedance) -> Array:
    """Frequencies about which the impedance may change quickly: its peaks and dips,
    with their widths.
    """
    if not isinstance(body, Modes):
        return np.empty(0)
    near = []
    with_spring = np.concatenate([natural_frequencies(body), poles(body)])
    for root in with_spring[with_spring.imag > 0]:
        width = max(abs(root.real), 1e-9 * root.imag)
        near.append(root.imag + width * np.sinh(np.linspace(-5, 5, 81)))
    found = np.concatenate(near) if near else np.empty(0)
    return np.sort(found[found > 0])


def poles(body: Impedance) -> ComplexArray:
    """Poles of the impedance, all with ``Re s < 0``: the modes of the slider with
    its sliding surface held still.
    """
    if not isinstance(body, Modes) or len(body.masses) == 1:
        return np.empty(0, dtype=complex)
    return _free_or_held(body, held=True)


def _free_or_held(body: Modes, *, held: bool) -> ComplexArray:
    """Eigenvalues of the modal equations, coupled by the driving spring or by
    ``sum of displacements = 0``.
    """
    n = len(body.masses)
    m = np.array(body.masses)
    k = np.array(body.stiffnesses)
    eta = np.array(body.dampings)
    if held:
        # Coordinates in the plane sum(x) = 0.
        basis = linalg.null_space(np.ones((1, n)))
        mass, drag, stiff = (basis.T @ np.diag(a) @ basis for a in (m, m * eta, k))
    else:
        mass = np.diag(m)
        drag = np.diag(m * eta)
        stiff = np.diag(k) + body.stiffness
    size = mass.shape[0]
    inverse = np.linalg.inv(mass)
    first_order = np.block(
        [[np.zeros((size, size)), np.eye(size)], [-inverse @ stiff, -inverse @ drag]]
    )
    return np.asarray(np.linalg.eigvals(first_order), dtype=complex)


def natural_frequencies(body: Impedance) -> ComplexArray:
    """Zeros of the impedance, where known: the modes of the rig without the
    interface.
    """
    match body:
        case Slider():
            return np.roots(
                [body.mass, body.mass * body.damping, body.stiffness]
            ).astype(complex)
        case RadiationDamping():
            return np.roots([body.mass, body.radiation, body.stiffness]).astype(complex)
        case Modes():
            return _free_or_held(body, held=False)
    return np.empty(0, dtype=complex)

"""Scans of ``Im(Z + kappa)`` along the imaginary axis, dense and long enough to find
every zero.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError
from stickslip.loops import HALVINGS, bounded
from stickslip.model.structure import Structure
from stickslip.sliding.response import (
    SCAN_LIMIT,
    Array,
    ComplexArray,
    Parts,
    Response,
    ResponseScales,
)
from stickslip.stability.impedances import (
    Impedance,
    is_plain,
    natural_frequencies,
    resonances,
)


class SmoothSliding(NamedTuple):
    """Contacts and a body in smooth sliding at a constant velocity."""

    response: Response
    body: Impedance
    velocity: float

    def __str__(self) -> str:
        return f"smooth sliding at velocity {self.velocity:g} x_s/time"

    @property
    def scales(self) -> ResponseScales:
        """Times and frequencies of the response."""
        return self.response.scales(self.velocity)

    @property
    def static_stiffness(self) -> float:
        """Force over displacement of the body at rest, ``Z(0)``."""
        return float(self.body(np.zeros(1, dtype=complex))[0].real)


def loss(z: ComplexArray, parts: Parts) -> Array:
    """Return ``Im(Z + kappa) |denominator|^2``, which has the zeros of
    ``Im(Z + kappa)`` on the axis but not its sharp peaks.
    """
    return np.asarray(
        z.imag * np.abs(parts.denominator) ** 2
        + (parts.numerator * np.conj(parts.denominator)).imag
    )


def scan(sliding: SmoothSliding, softest: float | None) -> tuple[Array, Array]:
    """Return increasing frequencies on the axis and the `loss` there, dense enough to
    find every zero, up to where there are no more.

    With `softest`, the result serves every rig with the same losses and masses and a
    static stiffness of at least `softest`.
    """
    top = doubtful_below(sliding, softest)
    if top == 0.0:
        return np.empty(0), np.empty(0)
    omega, parts = sliding.response.sampled(sliding.velocity, top)
    value = loss(sliding.body(1j * omega), parts)
    more = np.empty(0) if is_plain(sliding.body) else features(sliding.body, omega)
    own = float(np.max(np.abs(natural_frequencies(sliding.body)), initial=0.0))
    # include the frequencies of the rig above those of the contacts
    if math.isinf(top) and own > 0.3 * omega[-1]:
        more = np.union1d(
            more, np.geomspace(omega[-1], 10.0 * own + omega[-1], 120)[1:]
        )
    if not more.size:
        return omega, value
    return merged(
        omega,
        more,
        value,
        loss(
            sliding.body(1j * more), sliding.response.parts(sliding.velocity, 1j * more)
        ),
    )


def merged(
    omega: Array,
    more: Array,
    value: NDArray[Any],
    new: NDArray[Any],
) -> tuple[Array, NDArray[Any]]:
    """Return two samplings as one, in order of frequency."""
    order = np.argsort(np.concatenate([omega, more]), kind="stable")
    return np.concatenate([omega, more])[order], np.concatenate([value, new])[order]


def features(body: Impedance, omega: Array) -> Array:
    """Return frequencies to add to a scan where the phase of the impedance turns
    quickly.
    """
    known = resonances(body)
    added = known[(known > omega[0]) & (known < omega[-1])]
    for _ in range(40):
        grid = np.union1d(omega, added)
        z = body(1j * grid)
        turn = np.abs(np.angle(z[1:] * np.conj(z[:-1])))
        coarse = (turn > 0.3) & (np.diff(grid) > 1e-9 * grid[1:])
        if not coarse.any() or grid.size > SCAN_LIMIT:
            break
        added = np.union1d(added, 0.5 * (grid[1:] + grid[:-1])[coarse])
    return np.setdiff1d(added, omega)


def doubtful_below(sliding: SmoothSliding, softest: float | None) -> float:
    """Return the frequency above which no delay could give neutral modes, by the disc
    that contains kappa for any delay; 0 if none could at any frequency.

    It is infinite if there are no such discs.
    """
    held = None if softest is None else softest - sliding.static_stiffness
    special = np.concatenate(
        [resonances(sliding.body), np.abs(natural_frequencies(sliding.body))]
    )
    top = sliding.scales.fastest
    turns = bounded("doubtful_below", HALVINGS)
    while (discs := sliding.response.discs(sliding.velocity, top)) is not None:
        next(turns)
        omega, centre = merged(discs[0], special, discs[1], np.interp(special, *discs))
        z = sliding.body(1j * omega)
        gains = z.imag < -1e-9 * np.abs(z)  # where the body puts energy in
        if gains.any() and not isinstance(sliding.body, Structure):
            at = float(omega[np.argmin(z.imag / np.abs(z))])
            raise InputError(
                f"body: Im Z(i w) < 0 at w = {at:.4g}: the rig puts energy in; "
                "give one that only takes it out (damping of 0 or above)"
            )
        if held is None:  # kappa lies in a disc through 0
            gains &= np.abs(z) <= 2.0 * np.abs(centre)
        doubtful = np.flatnonzero(gains | ~_clear(z, centre, held))
        if not doubtful.size:
            return 0.0
        if (end := float(omega[min(doubtful[-1] + 2, omega.size - 1)])) <= top:
            return end
        top *= 2
    return math.inf


def _clear(
    z: ComplexArray,
    centre: ComplexArray,
    held: float | None,
) -> NDArray[np.bool_]:
    """Whether no delay could make the mode at each frequency neutral; with `held`, on
    any stiffer spring either.
    """
    radius = np.abs(centre)
    lossy = z.imag >= radius - centre.imag - 1e-14 * radius
    real = z.real + (held or 0.0)
    distance = (
        np.abs(z)
        if held is None
        else np.where(real > 0, np.hypot(real, z.imag), np.abs(z.imag))
    )
    strong = distance > 2 * (1 + 1e-9) * radius
    # |Z| may be small between two frequencies on either side of a resonance
    turning = real[1:] * real[:-1] <= 0
    strong[1:] &= ~turning
    strong[:-1] &= ~turning
    return lossy | strong

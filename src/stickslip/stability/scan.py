"""Scans of ``Im(Z + kappa)`` along the imaginary axis, fine enough and far enough to see every zero."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError
from stickslip.sliding.response import SCAN_LIMIT, Array, ComplexArray, Discs, Response
from stickslip.stability.impedances import Impedance, is_plain, natural_frequencies, resonances


class Scan(NamedTuple):
    """Rising angular frequencies, and a quantity that has the zeros of ``Im(Z + kappa)`` between them."""

    omega: Array
    value: Array


def loss(response: Response, body: Impedance, velocity: float | Array, omega: Array) -> Array:
    """``Im(Z + kappa) |denominator|^2`` on the axis: the zeros of ``Im(Z + kappa)``, without its sharp peaks."""
    numerator, denominator = response.axis_parts(velocity, omega)
    return loss_of(body(1j * omega), numerator, denominator)


def loss_of(z: ComplexArray, numerator: ComplexArray, denominator: ComplexArray) -> Array:
    """`loss` from the impedance and the parts of the response."""
    return np.asarray(z.imag * np.abs(denominator) ** 2 + (numerator * np.conj(denominator)).imag)


def scan(response: Response, body: Impedance, velocity: float, softest: float | None) -> Scan:
    """`loss` along the axis, fine enough to see every zero, up to where there are no more.

    With `softest` given, for every rig with the same losses and masses and a static stiffness of at least that.
    """
    top = 0.0 if response.inert else doubtful_below(response, body, velocity, softest)
    if top == 0.0:
        return Scan(np.empty(0), np.empty(0))
    omega, (numerator, denominator) = response.sampled(velocity, top)
    z = body(1j * omega)
    value = loss_of(z, numerator, denominator)
    more = np.empty(0) if is_plain(body) else features(body, omega)
    own = float(np.max(np.abs(natural_frequencies(body)), initial=0.0))
    if math.isinf(top) and own > 0.3 * omega[-1]:  # the rig has frequencies above those of the contacts
        more = np.union1d(more, np.geomspace(omega[-1], 10.0 * own + omega[-1], 120)[1:])
    return Scan(*merged(omega, more, value, loss(response, body, velocity, more))) if more.size else Scan(omega, value)


def merged(omega: Array, more: Array, value: NDArray[Any], new: NDArray[Any]) -> tuple[Array, NDArray[Any]]:
    """Return two samplings as one, rising in frequency."""
    order = np.argsort(np.concatenate([omega, more]), kind="stable")
    return np.concatenate([omega, more])[order], np.concatenate([value, new])[order]


def features(body: Impedance, omega: Array) -> Array:
    """Frequencies to add to a scan where the impedance turns quickly."""
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


# ---------------------------------------------------------------- how far to scan


def doubtful_below(response: Response, body: Impedance, velocity: float, softest: float | None) -> float:
    """Frequency above which the disc that holds kappa, whatever the delay, rules out neutral modes; 0 for all.

    Infinite if there are no such discs.
    """
    held = None if softest is None else softest - float(body(np.zeros(1, dtype=complex))[0].real)
    special = np.concatenate([resonances(body), np.abs(natural_frequencies(body))])
    top = response.fastest(velocity)
    while True:
        discs = response.discs(velocity, top)
        if discs is None:
            return math.inf
        end, quarter = float(discs.omega[-1]), float(discs.omega[-(discs.omega.size // 4)])
        own = special[special < end]
        omega, centre = merged(discs.omega, own, discs.centre, np.interp(own, discs.omega, discs.centre))
        z = body(1j * omega)
        if np.any(z.imag < -1e-9 * np.abs(z)):
            at = float(omega[np.argmin(z.imag / np.abs(z))])
            raise InputError(
                f"body: Im Z(i w) < 0 at w = {at:.4g}: the rig puts energy in; "
                "give one that only takes it out (damping of 0 or above)"
            )
        clear = _clear(z, centre, held)
        if clear[omega > quarter].all() and _clear_beyond(body, end, special, discs, held):
            break
        top *= 2
    doubtful = np.flatnonzero(~clear)
    return float(omega[min(doubtful[-1] + 2, omega.size - 1)]) if doubtful.size else 0.0


def _clear_beyond(body: Impedance, end: float, special: Array, discs: Discs, held: float | None) -> bool:
    """Whether it stays so beyond the discs: the response only shrinks there, but the rig may have features."""
    worst, deficit = discs.worst, discs.deficit
    if is_plain(body) and body(np.array([1j * end]))[0].imag >= deficit:
        return True
    z = body(1j * np.sort(np.concatenate([end * np.geomspace(1, 1e6, 200), special[special >= end]])))
    # A disc as large as any in the tail, and as far below the upper axis
    disc = complex(math.sqrt(max(deficit * (2 * worst - deficit), 0.0)), worst - deficit)
    return bool(_clear(z, np.full(z.shape, disc), held).all())


def _clear(z: ComplexArray, centre: ComplexArray, held: float | None) -> NDArray[np.bool_]:
    """Whether no delay could make the mode at each frequency neutral (with `held`: nor on any stiffer spring)."""
    radius = np.abs(centre)
    lossy = z.imag >= radius - centre.imag - 1e-14 * radius
    real = z.real + (held or 0.0)
    distance = np.abs(z) if held is None else np.where(real > 0, np.hypot(real, z.imag), np.abs(z.imag))
    strong = distance > 2 * (1 + 1e-9) * radius
    # Between two frequencies on either side of a resonance |Z| may be small.
    turning = real[1:] * real[:-1] <= 0
    strong[1:] &= ~turning
    strong[:-1] &= ~turning
    return np.asarray(lossy | strong)

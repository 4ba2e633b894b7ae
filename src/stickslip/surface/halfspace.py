"""Rough elastic half-spaces pressed together: pressures and tangential stiffness.

The surface is periodic in both directions, so a pressure ``p`` deforms it mode by mode,
``u(q) = 2 p(q) / (E* |q|)``. Contact without adhesion minimises the energy over
pressures between 0 and the hardness, with the given mean. This is done by conjugate
gradients (Polonsky and Keer, Wear 231, 206, 1999; with a hardness: Almqvist et al., J.
Tribol. 129, 2007).
"""

import math

import numpy as np
from scipy import fft
from scipy.sparse import linalg

from stickslip.arrays import Array
from stickslip.errors import InputError, number, numbers, refused
from stickslip.progress import Progress, unheard
from stickslip.words import engineering

_CHANGE = 1e-6  # relative change of the pressures in a step that ends the search
_STEPS = 2000  # most steps; usual are 30 to 100
# relative residual of the displacements: the error of the stiffness is its square
_RESIDUAL = 1e-6


def wave_numbers(shape: tuple[int, ...], spacing: float) -> tuple[Array, Array]:
    """Return the wave numbers of a map along its two axes, in the order of `rfft2`."""
    rows, columns = shape
    along = 2.0 * np.pi * fft.fftfreq(rows, spacing)
    across = 2.0 * np.pi * fft.rfftfreq(columns, spacing)
    return along[:, np.newaxis], across[np.newaxis, :]


def _compliance(shape: tuple[int, ...], spacing: float, modulus: float) -> Array:
    """Return the displacement of each mode per pressure, without the mean."""
    wave = np.hypot(*wave_numbers(shape, spacing))
    wave[0, 0] = np.inf
    return np.asarray(2.0 / (modulus * wave))


def _deformed(compliance: Array, load: Array) -> Array:
    return np.asarray(fft.irfft2(compliance * fft.rfft2(load), s=load.shape))


def _plane(place: str, values: Array) -> Array:
    """Return numbers over a plane as a two-dimensional array, or refuse them."""
    given = np.asarray(values)
    found = numbers(place, given.astype(float) if given.dtype == bool else given)
    if found.ndim != 2:
        raise refused(place, values, "must have two dimensions")
    return found


def _dot(a: Array, b: Array) -> float:
    """Return the scalar product, without `@`, whose threads cost more time than they
    save.
    """
    return float((a * b).sum())


def press(
    height: Array,
    spacing: float,
    pressure: float,
    modulus: float,
    *,
    hardness: float = math.inf,
    progress: Progress = unheard,
) -> Array:
    """Return the pressure at each node of a rough surface against a flat one.

    Parameters
    ----------
    height : array, shape (n, m)
        Heights, in the unit of the spacing; the highest nodes touch first.
    spacing : float
        Distance between nodes, the same along both axes.
    pressure, modulus, hardness : float
        Mean pressure, the contact modulus ``E*`` of both bodies, and the largest
        pressure that they bear, in one unit.
    progress : function
        Called with the fraction done.

    Raises
    ------
    InputError
        If the pressure exceeds the hardness, or the search finds no pressures that
        carry the load.

    Examples
    --------
    >>> wave = 1e-3 * np.cos(2 * np.pi * np.arange(64) / 64) + np.zeros((64, 1))
    >>> pressures = ss.surface.press(wave, 1 / 64, 5e-4, 1.0)
    >>> round(float(pressures.mean()), 9), round(float((pressures > 0).mean()), 2)
    (0.0005, 0.27)
    """
    height = _plane("height", height)
    for place, value in (("spacing", spacing), ("modulus", modulus)):
        number(place, value, above=0)
    pressure = number("pressure", pressure, above=0)
    number("hardness", hardness, above=0, infinite=True)
    if pressure >= hardness:
        raise InputError(
            f"pressure = {engineering(pressure, 'Pa')}: is not below the hardness, "
            f"{engineering(hardness, 'Pa')}, so no surface carries it; lower it"
        )
    compliance = _compliance(height.shape, spacing, modulus)
    load = pressure * height.size
    p = np.full(height.size, pressure)
    residual = np.zeros_like(p)
    field = np.zeros_like(p)
    norm = 0.0
    for _ in range(_STEPS):
        gap = (_deformed(compliance, p.reshape(height.shape)) - height).ravel()
        touching = np.flatnonzero((p > 0.0) & (p < hardness))
        if not touching.size:
            return _bearing(height, load, hardness)
        gap -= gap[touching].mean()
        entering = np.flatnonzero((gap < 0.0) & (p == 0.0))
        leaving = np.flatnonzero((gap > 0.0) & (p >= hardness))
        free = np.concatenate([touching, entering, leaving])
        now = gap[free]
        before, norm = norm, _dot(now, now)
        if norm == 0.0:
            return p.reshape(height.shape)
        # Polak and Ribiere: it restarts by itself where nodes enter or leave contact
        turned = norm - _dot(now, residual[free])
        along = now + (max(turned / before, 0.0) * field[free] if before else 0.0)
        field.fill(0.0)
        residual.fill(0.0)
        field[free] = along
        residual[free] = now
        moved = _deformed(compliance, field.reshape(height.shape)).ravel()[free]
        step = _dot(now, along) / _dot(moved - moved.mean(), along)
        old = p[free]
        p[free] = np.clip(old - step * along, 0.0, hardness)
        if not p.any():
            p[gap.argmin()] = load  # the step has lost all contact: restart at a node
        _scale_to_load(p, load, hardness)
        change = float(np.abs(p[free] - old).sum()) / load
        # also check the load, some of which the hardness may leave uncarried
        if change < _CHANGE and abs(p.sum() / load - 1.0) < _CHANGE:
            return p.reshape(height.shape)
        progress(min(math.log(change) / math.log(_CHANGE), 1.0) if change < 1 else 0.0)
    raise InputError(
        f"pressure = {engineering(pressure, 'Pa')}: no pressures that carry it were "
        f"found in {_STEPS} steps; smooth the map, or take a lower pressure"
    )


def _scale_to_load(p: Array, load: float, hardness: float) -> None:
    """Scale the pressures below the hardness, in place, so that they carry the load."""
    capped = p >= hardness
    borne = hardness * np.count_nonzero(capped) if capped.any() else 0.0
    left = float(p.sum()) - borne
    if left > 0.0 and load > borne:
        p[~capped] *= (load - borne) / left
    else:
        p *= load / float(p.sum())
    np.minimum(p, hardness, out=p)


def _bearing(height: Array, load: float, hardness: float) -> Array:
    """Return pressures at the hardness on the highest nodes (the bearing area), the
    lowest of which carries the rest of the load.
    """
    p = np.zeros(height.size)
    whole, rest = divmod(load / hardness, 1.0)
    order = np.argsort(-height, axis=None, kind="stable")
    p[order[: int(whole)]] = hardness
    p[order[int(whole)]] = rest * hardness
    return p.reshape(height.shape)


def tangential_stiffness(
    contact: Array,
    spacing: float,
    modulus: float,
    poisson: float,
) -> float:
    """Return the stiffness of a contact along the first axis, per area of the map: the
    mean traction for a unit displacement of all nodes in contact.

    Each mode of traction deforms the surface ``(1 - nu qx²/q²)/(1 - nu)`` times as much
    as a mode of pressure (Cerruti); `contact` is above 0 where the surfaces touch.
    """
    inside = _plane("contact", contact) > 0.0
    if not inside.any():
        raise InputError("contact: nothing touches")
    if inside.all():
        raise InputError("contact: the whole map touches, so its stiffness is infinite")
    for place, value in (("spacing", spacing), ("modulus", modulus)):
        number(place, value, above=0)
    number("poisson", poisson, at_least=0, at_most=0.5)
    qx, qy = wave_numbers(inside.shape, spacing)
    wave = np.hypot(qx, qy)
    wave[0, 0] = np.inf
    softer = (1.0 - poisson * (qx / wave) ** 2) / (1.0 - poisson)
    compliance = _compliance(inside.shape, spacing, modulus) * softer
    field = np.zeros(inside.shape)

    def moved(traction: Array) -> Array:
        """Return the displacement of the nodes in contact."""
        field[inside] = traction
        return _deformed(compliance, field)[inside]

    count = np.count_nonzero(inside)
    response = linalg.LinearOperator((count, count), matvec=moved, dtype=float)
    # In exact arithmetic, it needs at most as many steps as unknowns; `cg` allows ten
    # times as many.
    traction, failed = linalg.cg(response, np.ones(count), rtol=_RESIDUAL)
    if failed:
        raise RuntimeError(
            "tangential_stiffness: conjugate gradients do not converge: a fault of "
            "this package, please report it"
        )
    return float(traction.sum()) / inside.size

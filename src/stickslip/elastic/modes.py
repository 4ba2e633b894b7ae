"""Linear stability of an elastic slider in smooth sliding: a mode for each wavelength,
and whether it grows.

All blocks slide alike, so the contacts of each respond with the same dynamic stiffness
``kappa(s)``, and every eigenvector of the springs is a mode:

    M s^2 + M eta s + Lambda_m + (c_b/k_b) lambda_m s + kappa(s) = 0

with ``Lambda_m`` its stiffness and ``lambda_m`` the part of it from the bulk. Each mode
is thus a rigid slider on a spring ``Lambda_m``, with the viscosity of the bulk added to
its damping.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigh_tridiagonal

from stickslip.answers import Answer
from stickslip.arrays import Array
from stickslip.elastic.precursors import elastic_body
from stickslip.elastic.threshold_front import rising
from stickslip.errors import InputError, UndecidedError, whole
from stickslip.model import Chain, ElasticBody, Rig, Sheet, Slider
from stickslip.model.body import coupling_matrix
from stickslip.progress import in_time
from stickslip.simulation.estimates import LARGEST, LONGEST
from stickslip.stability.critical import critical_spring
from stickslip.stability.modes import count_unstable, growth_rate

if TYPE_CHECKING:
    import xarray as xr

# seconds for the root of a mode; where all modes of a chain held at one end are found
# also the seconds, and the bytes, of each block of each mode
_ROOT = 0.01
_SOFTEST = 2e-7
_SHAPE = 8.0
_HALVINGS = 53  # of the range of a wavenumber, to rounding
_SOFTER = 9  # number of waves softer than the critical one that are checked to grow


@dataclass(frozen=True, kw_only=True, repr=False)
class CriticalLength(Answer):
    """Lengths, in blocks, from which on an elastic slider and waves on it lose
    stability.
    """

    #: ``K_c(v)``, below which a mode grows, in the rig's own units; 0 if none does
    stiffness: float
    wavelength: float = math.inf  #: shortest that grows; infinite if none does

    #: Length beyond which a slider that is pulled at one end is unstable, in the
    #: continuum with that end held: a quarter of `wavelength` if it is long,
    #: ``(pi/2) sqrt(k_b/K_c)``.
    length: float = math.inf

    #: The same for the rig's own chain with its side spring: smallest number of blocks
    #: that is unstable, with the viscosity of the bulk to first order; 0 if there is
    #: none, or the chain is not pulled at one end only.
    blocks: int = 0
    #: these as text, in the rig's units if its blocks have a length
    sentence: str

    def __str__(self) -> str:
        return self.sentence


def length_in_words(rig: Rig, blocks: float, digits: int = 4) -> str:
    """Return a length along an elastic slider as text, in the rig's units if its blocks
    have a length, else in blocks.
    """
    spacing = rig.natural.slider.spacing
    if spacing is None:
        return f"{blocks:.{digits}g} block{'s' if blocks != 1 else ''}"
    return rig.in_units(blocks * spacing, "length", digits)


def modes(rig: Rig, *, count: int = 64) -> xr.Dataset:
    """Return the modes of an elastic slider in smooth sliding, softest first, with
    their growth rates.

    Parameters
    ----------
    rig : Rig
        A rig with a `Chain` or a `Sheet`; it slides at the first velocity of the drive.
    count : int
        Largest number of modes; softer modes lose stability first.

    Returns
    -------
    Dataset
        Along `mode`: `stiffness` ``Lambda_m`` and `coupling`, the part of it from the
        bulk; `wavelength` in blocks (infinite if all blocks move alike, NaN if the mode
        does not extend into the bulk; of a sheet, along the drive); `growth` and
        `frequency`, real part and angular frequency of the rightmost root. In the rig's
        own units.

    Raises
    ------
    InputError
        If the slider is rigid, nothing holds it, or there is no steady sliding.

    Notes
    -----
    Exact, except with a side spring and bulk viscosity together: they do not share
    their eigenvectors, and the viscosity of a mode is taken to first order.

    Examples
    --------
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1)
    ... )
    >>> ring = ss.Chain(
    ...     blocks=8, coupling=2.0, mass=1e-4, damping=42.426, leaf=3.0, ends="periodic"
    ... )
    >>> found = ss.elastic.modes(
    ...     ss.Rig(interface, ring, ss.constant(velocity=1.5)), count=2
    ... )
    >>> found.stiffness.values.round(4).tolist(), found.growth.values.round(4).tolist()
    ([3.0, 4.1716], [-0.0538, -0.0957])
    """
    import xarray as xr

    body = elastic_body(rig, "modes")
    count = whole("count", count, at_least=1, hint="number of modes")
    natural = rig.natural
    _check_work(body, count)
    stiffness, coupling, wavelength, each = sliders_of(body, count)
    # Modes of a ring come in pairs of equal stiffness, so cache their roots.
    of = cache(lambda slider: growth_rate(replace(natural, slider=slider)))
    root = np.array([of(slider) for slider in each])
    columns = {
        "stiffness": (stiffness, "k", "stiffness of the mode"),
        "coupling": (coupling, "k", "part of the stiffness that is the bulk's"),
        "wavelength": (wavelength, "blocks", "wavelength"),
        "growth": (root.real, "1/time", "growth rate"),
        "frequency": (root.imag, "1/time", "angular frequency"),
    }
    found = {
        name: ("mode", values, {"long_name": title, "units": unit})
        for name, (values, unit, title) in columns.items()
    }
    return rig.in_its_units(xr.Dataset(found, {"mode": np.arange(len(each))}))


def _check_work(body: ElasticBody, count: int) -> None:
    """Raise `InputError` if the modes would take more than an hour or 4 GB."""
    found = min(count, body.size)
    # all modes of a row that a spring holds at one end are found from its matrix
    searched = found**2 if body.side > 0.0 and found == body.size else 0
    seconds = _ROOT * found + _SOFTEST * searched
    excess = max(seconds / LONGEST, _SHAPE * searched / LARGEST)
    if excess > 1.0:
        raise InputError(
            f"modes: count = {count}: of {body.size} blocks would take about "
            f"{in_time(seconds)} and {_SHAPE * searched / 1e9:.2g} GB; give at most "
            f"{math.floor(found / excess)}, or fewer blocks",
            "count",
        )


def sliders_of(
    body: ElasticBody, count: int
) -> tuple[Array, Array, Array, list[Slider]]:
    """Return stiffness, its part from the bulk, wavelength and equivalent rigid slider
    of the modes, softest first.
    """
    ring = body.ends == "periodic"
    if isinstance(body, Chain | Sheet) and not (ring and body.side > 0):
        row, bulk = _row(
            body.size // body.rows,
            body.coupling,
            body.side,
            ring,
            count,
        )
        shear = body.shear if isinstance(body, Sheet) else 0.0
        beside, _ = _row(body.rows, shear, 0.0, ring, count)
        total = (row[:, None] + beside).ravel()
        chosen = np.argsort(total, kind="stable")[:count]
        stiffness = total[chosen]
        coupling = (bulk[:, None] + beside).ravel()[chosen]
        along = np.repeat(row, beside.size)[chosen]
    elif body.size > 4096:
        raise InputError(
            f"Rig.slider: {body.size} blocks in a network: more than 4096 are not "
            "computed; give fewer"
        )
    else:
        links = coupling_matrix(body).toarray()
        stiffness, shape = np.linalg.eigh(links + np.diag(body.pulled - body.leaf))
        coupling = np.einsum("ij,ik,kj->j", shape, links, shape)[:count]
        along = stiffness = stiffness[:count]
    # sin(q/2) in the bulk; a mode stiffer than any wave is confined to the end with the
    # spring.
    sine = np.sqrt(along / (4.0 * body.coupling))
    with np.errstate(divide="ignore"):
        wavelength = np.where(
            sine > 1,
            np.nan,
            np.pi / np.arcsin(np.minimum(sine, 1.0)),
        )
    stiffness = stiffness + body.leaf
    if not stiffness[0] > 0:
        raise InputError(
            f"Rig.slider = {body!r}: nothing holds the slider, a mode has no "
            "stiffness; give leaf or side springs"
        )
    each = [
        _mode(body, s, c)
        for s, c in zip(stiffness.tolist(), coupling.tolist(), strict=True)
    ]
    return stiffness, coupling, wavelength, each


def critical_length(rig: Rig) -> CriticalLength:
    """Return the shortest wavelength that grows in smooth sliding, and the length from
    which on a slider is unstable.

    The modes that grow are those softer than ``K_c(v)``, the critical spring of the
    rigid slider. Waves of wavenumber `q` have the stiffness ``K + 4 k_b sin^2(q/2)``:
    long waves become unstable first.

    Parameters
    ----------
    rig : Rig
        A rig with a `Chain`; it slides at the first velocity of the drive. Its number
        of blocks does not matter.

    Returns
    -------
    CriticalLength

    Raises
    ------
    InputError
        If the slider is not a chain, or there is no steady sliding.
    UndecidedError
        If no critical spring can be found, or softer ones are stable again, as with
        mass and little damping.

    Examples
    --------
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1)
    ... )
    >>> bar = ss.Chain(blocks=8, coupling=80.0, mass=1e-4, damping=42.426, side=40.0)
    >>> print(
    ...     ss.elastic.critical_length(
    ...         ss.Rig(interface, bar, ss.constant(velocity=1.5))
    ...     )
    ... )
    waves longer than 37.62 blocks grow; pulled at one end, unstable from 8 blocks on
    """
    body = elastic_body(rig, "critical_length")
    if not isinstance(body, Chain):
        raise InputError(
            f"Rig.slider = {body!r}: critical_length needs a Chain; the modes of a "
            "Sheet are in modes()"
        )
    natural = rig.natural

    def lacking(coupling: float) -> float:
        """Stiffness that a wave lacks to be stable, with the viscosity that belongs to
        its stiffness `coupling` of the bulk.
        """
        held = critical_spring(replace(natural, slider=_mode(body, 1.0, coupling)))
        return held - body.leaf - coupling

    reach = lacking(0.0)
    # Viscosity adds damping, which may lower K_c and cannot raise the stiffness needed.
    if body.viscosity > 0 and reach > 0:
        reach = rising(lambda coupling: -lacking(coupling), reach, reach, 2.0)
    stiffness = (body.leaf + reach) * rig.unit("k")
    if reach <= 0:
        sentence = "smooth sliding is stable at every wavelength"
        return CriticalLength(stiffness=stiffness, sentence=sentence)
    stiffest = min(reach, 4.0 * body.coupling)  # the stiffest wave of a chain
    for coupling in stiffest * np.geomspace(1e-3, 0.97, _SOFTER):
        softer = _mode(body, body.leaf + float(coupling), float(coupling))
        if not count_unstable(replace(natural, slider=softer)):
            spring = rig.in_units(softer.stiffness, "stiffness")
            raise UndecidedError(
                f"waves of the stiffness {spring} are stable at this speed, though "
                "stiffer ones grow: no length parts them; see modes()"
            )
    sine = math.sqrt(reach / (4.0 * body.coupling))
    wavelength = math.pi / math.asin(sine) if sine < 1 else 2.0
    sentence = f"waves longer than {length_in_words(rig, wavelength)} grow"
    blocks = 0
    if body.side > 0 and body.leaf == 0 and body.ends == "free":
        # more blocks than cot(q n) = (2 k_b/k_side - 1) tan(q/2) at the critical
        # wavenumber
        half = math.asin(min(sine, 1.0 - 1e-9))
        cotangent = (2.0 * body.coupling / body.side - 1.0) * math.tan(half)
        blocks = 1 + math.floor(math.atan2(1.0, cotangent) / (2.0 * half))
        shortest = length_in_words(rig, blocks)
        sentence += f"; pulled at one end, unstable from {shortest} on"
    length = 0.5 * math.pi * math.sqrt(body.coupling / reach)
    return CriticalLength(
        stiffness=stiffness,
        wavelength=wavelength,
        length=length,
        blocks=blocks,
        sentence=sentence,
    )


def _mode(body: ElasticBody, stiffness: float, coupling: float) -> Slider:
    """Return the rigid slider that is equivalent to a mode."""
    viscous = body.viscosity / body.coupling * coupling
    return Slider(
        stiffness=stiffness,
        mass=body.mass,
        damping=body.damping + viscous / body.mass,
    )


def _row(
    blocks: int,
    coupling: float,
    side: float,
    ring: bool,
    count: int,
) -> tuple[Array, Array]:
    """Stiffness of the softest modes of a row of blocks without leaf springs, and its
    part from the bulk.
    """
    count = min(count, blocks)
    if side == 0:
        number = np.arange(count)
        waves = (number + 1) // 2 if ring and blocks > 2 else 0.5 * number
        bulk = 4.0 * coupling * np.sin(np.pi * waves / blocks) ** 2
        return bulk, bulk
    if count == blocks:
        # the stiffest mode may be confined to the end with the spring
        diagonal = np.full(blocks, 2.0 * coupling)
        diagonal[[0, -1]] = coupling if blocks > 1 else 0.0
        diagonal[0] += side
        stiffness, shape = eigh_tridiagonal(diagonal, np.full(blocks - 1, -coupling))
        return np.asarray(stiffness), np.asarray(stiffness - side * shape[0] ** 2)

    def unbalanced(q: Array) -> Array:
        """Force on the end with the spring, in a wave whose other end is free."""
        return side * np.cos(q * (blocks - 0.5)) - 2.0 * coupling * np.sin(
            q * blocks
        ) * np.sin(0.5 * q)

    # the spring raises the wavenumber of each mode, to less than that of the next one
    low = np.pi * np.arange(count) / blocks
    high = low + np.pi / blocks
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = unbalanced(middle) * (-1.0) ** np.arange(count) > 0
        low = np.where(below, middle, low)
        high = np.where(below, high, middle)
    size = 0.5 * blocks + np.sin(2.0 * blocks * low) / (4.0 * np.sin(low))
    stiffness = 4.0 * coupling * np.sin(0.5 * low) ** 2
    return stiffness, stiffness - side * np.cos(low * (blocks - 0.5)) ** 2 / size

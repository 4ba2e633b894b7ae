"""Statics of an elastic slider: the range of a force, and the length of slip precursors
under a slow side drive.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from stickslip.errors import InputError, instance
from stickslip.model import Chain, ElasticBody, FromRest, Interface, Rig
from stickslip.model.body import coupling_matrix

if TYPE_CHECKING:
    import xarray as xr


def elastic_body(rig: Rig, who: str) -> ElasticBody:
    """Return the body of a rig with an elastic slider, in natural units; `InputError`
    if its slider is rigid.
    """
    instance("rig", rig, Rig, "a Rig(interface, Chain(...), drive)")
    body = rig.natural.slider
    if not isinstance(body, ElasticBody):
        raise InputError(
            f"Rig.slider = {body!r}: {who} needs an elastic slider; give a Chain(...) "
            "or a Sheet(...)"
        )
    return body


def elastic_parts(rig: Rig, who: str) -> tuple[ElasticBody, Interface]:
    """Return the elastic body and the interface; `InputError` if contacts do more than
    break, slide and stay detached.
    """
    body = elastic_body(rig, who)
    interface = rig.natural.interface
    interface.allow(("sliding_force", "on_arrest"), who)
    strength = interface.threshold_distribution.moment(1)
    if interface.sliding_force >= strength:
        raise InputError(
            f"Interface.sliding_force = {interface.sliding_force:g}: must be below the "
            f"mean threshold, {strength:g}, "
            f"for {who}"
        )
    return body, interface


def screening_length(rig: Rig) -> float:
    """Return the distance along an elastic slider over which attached contacts take up
    a force, in blocks.

    It is ``1/arccosh(1 + (k + K)/(2 k_b))`` with leaf springs `K`, which tends to
    ``sqrt(k_b/(k + K))`` where it is long. Below 2 blocks the discrete blocks hold
    fronts back; keep it above.

    Parameters
    ----------
    rig : Rig
        A rig with a `Chain` or a `Sheet` (along its rows).

    Returns
    -------
    float
        Distance over which the displacement of stuck blocks falls by a factor `e`.

    Raises
    ------
    InputError
        If the slider is rigid.

    Examples
    --------
    >>> interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.0))
    >>> bar = ss.Chain(blocks=100, coupling=47.0, mass=1.0, damping=0.1, leaf=0.02)
    >>> round(
    ...     ss.elastic.screening_length(
    ...         ss.Rig(interface, bar, ss.constant(velocity=0.0, duration=1.0))
    ...     ),
    ...     2,
    ... )
    6.79
    """
    body, _ = elastic_parts(rig, "screening_length")
    return 1.0 / math.acosh(1.0 + (1.0 + body.leaf) / (2.0 * body.coupling))


def precursor_force(rig: Rig) -> xr.DataArray:
    """Return the driving force at which slip that starts slowly from one end has
    reached each block of a chain.

    This holds for equal thresholds, no re-attachment, and a slow drive on block 0
    alone. With slip up to block `l`

        F(l) = f_d l + f_s [1 + k_b (1 - rho_(n-l))]

    in units of the strength ``N f_s`` of the contacts of one block, where ``rho_m`` is
    the displacement of the second of `m` stuck blocks over that of the first.
    Precursors grow with the force by ``1/f_d`` blocks for each ``N f_s``; the largest
    force over the number of blocks is the static friction of the slider.

    Parameters
    ----------
    rig : Rig
        A rig with a `Chain` with free ends and a side spring, and without leaf springs.

    Returns
    -------
    DataArray
        The force at each `tip`, the number of blocks that slide before the next one
        breaks loose; per contact of one block, in the rig's own units.

    Raises
    ------
    InputError
        If the chain is pulled in another way, or the thresholds have a standard
        deviation.

    Examples
    --------
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.0),
    ...     delay=ss.Delay(float("inf")),
    ...     sliding_force=0.425,
    ... )
    >>> bar = ss.Chain(blocks=50, coupling=4.0, mass=4.0, damping=0.1, side=4.0)
    >>> force = ss.elastic.precursor_force(
    ...     ss.Rig(interface, bar, ss.constant(velocity=0.0, duration=1.0))
    ... )
    >>> round(float(force.sel(tip=10)), 6), round(float(force.max()) / bar.blocks, 6)
    (6.811553, 0.444328)
    """
    import xarray as xr

    body, interface = elastic_parts(rig, "precursor_force")
    if (
        not isinstance(body, Chain)
        or body.leaf > 0
        or body.side == 0
        or body.ends != "free"
    ):
        raise InputError(
            f"Rig.slider = {body!r}: precursor_force needs a Chain that is pulled at "
            "one end only; give "
            "Chain(side=..., leaf=0.0, ends='free')"
        )
    if not interface.threshold_distribution.single:
        raise InputError(
            f"Interface.thresholds = {interface.thresholds}: precursor_force needs all "
            "thresholds alike; "
            "give them no standard deviation"
        )
    strength = interface.threshold_distribution.moment(1)
    tip = np.arange(body.blocks)
    # Displacements of m stuck blocks are as cosh((m - i - 1/2)/l), i = 0 ... m - 1.
    fall = 1.0 / screening_length(rig)
    stuck = body.blocks - tip
    second = np.exp(-fall) + np.exp(-2.0 * fall * (stuck - 1.0))
    held = 1.0 - second / (1.0 + np.exp(-fall * (2.0 * stuck - 1.0)))
    force = interface.sliding_force * tip + strength * (1.0 + body.coupling * held)
    column = ("tip", force, {"long_name": "driving force", "units": "f_s"})
    tips = {"tip": ("tip", tip, {"long_name": "blocks that slide", "units": "1"})}
    return rig.in_its_units(xr.Dataset({"force": column}, tips))["force"]


def distance_to_the_first_break(rig: Rig) -> float | None:
    """Return the travel of the drive until the first block of a bar breaks loose, where
    precursors start; in natural units.

    Blocks on their contacts are a network of springs, and a block breaks loose when it
    has moved by the mean threshold, which is exact for equal thresholds. None if the
    blocks do not start from rest, thresholds age, or nothing pulls.
    """
    natural = rig.natural
    body = natural.slider
    interface = natural.interface
    if (
        not isinstance(body, Chain)
        or interface.ageing is not None
        or not isinstance(natural.start, FromRest)
    ):
        return None
    net = sparse.csc_array(
        coupling_matrix(body) + sparse.diags_array(1.0 + body.pulled)
    )
    moved = float(spsolve(net, body.pulled).max())
    return interface.threshold_distribution.moment(1) / moved if moved > 0 else None

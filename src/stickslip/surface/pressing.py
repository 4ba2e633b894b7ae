"""Contacts of a map under a load: their positions, areas, forces and stiffnesses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import xarray as xr
from scipy import ndimage

from stickslip.arrays import Array, labels
from stickslip.errors import InputError, instance, sequence, shown
from stickslip.model.quantities import read_value
from stickslip.model.records import Number, Record
from stickslip.progress import part, reporting
from stickslip.surface.halfspace import press, tangential_stiffness
from stickslip.surface.maps import (
    Length,
    as_map,
    correlation_length,
    length_of,
    levelled,
    low_pass,
    mean_waves,
    spacing_of,
)
from stickslip.words import engineering, number, percent

_RESOLUTIONS = 3
MOST_CONTACT = 0.10  # fraction of the area above which contacts are not independent
_MOST_PIXELS = 0.30  # most contacts that may be a single node, as a fraction
_MOST_PIXEL_AREA = 0.02  # and the largest fraction of the contact area in these
FEWEST = 10.0  # fewest effective contacts that form an interface of many contacts
_NODES = 8  # nodes per shortest wave
# fewest correlation lengths along a map that has a typical number of contacts
SPANS = 8.0


@dataclass(frozen=True, kw_only=True)
class Material(Record):
    """A material of both bodies.

    Parameters
    ----------
    young : float
        Young's modulus, in Pa.
    poisson : float
        Poisson's ratio. From 0.2 to 0.4 the stiffness of contacts changes by 4 %.
    hardness : float
        Largest pressure that a contact bears, in Pa; infinite for elastic contacts.
    source : str
        Source of the numbers.

    Examples
    --------
    >>> round(ss.surface.Material(young=3e9).modulus / 1e9, 2)
    1.65
    """

    young: Annotated[float, Number("1", above=0, hint="in Pa")]
    poisson: Annotated[float, Number("1", at_least=0, at_most=0.5)] = 0.3
    hardness: Annotated[float, Number("1", above=0, infinite=True, hint="in Pa")] = (
        math.inf
    )
    source: str = ""

    @property
    def modulus(self) -> float:
        """Contact modulus ``E*`` of two bodies of this material, in Pa."""
        return self.young / (2.0 * (1.0 - self.poisson**2))


MATERIALS = {
    "glass": Material(
        young=70e9,
        hardness=5.5e9,
        source=(
            "Kese, Li and Bergman 2005, Mater. Sci. Eng. A 404, 1: soda-lime glass, E "
            "70 GPa, hardness 5.2 to 5.9 GPa"
        ),
    ),
    "pmma": Material(
        young=3e9, source="Tromborg et al. 2014, arXiv 1402.4700, Table S1: E 3 GPa"
    ),
}
"""Materials with known numbers and their sources."""


def material_named(material: Material | str) -> Material:
    """Return a material, given as a record or by its name in `MATERIALS`."""
    if isinstance(material, str) and material in MATERIALS:
        return MATERIALS[material]
    if isinstance(material, str):
        raise InputError(
            f"material = {shown(material)}: known are {' and '.join(MATERIALS)}; for "
            "others give --young '200 GPa' --poisson 0.3 --hardness '6 GPa', or a "
            "surface.Material(young=..., poisson=..., hardness=...)"
        )
    instance("material", material, Material, "a surface.Material, or the name of one")
    return material


def contacts(
    height: Any,
    spacing: Length | None = None,
    *,
    pressure: float | str,
    material: Material | str,
    shortest: Length | None = None,
    progress: Any = None,
) -> xr.Dataset:
    """Press a rough surface on a flat one and return its contacts.

    The map is levelled, and periodic. It is pressed at three resolutions: as it is, and
    twice smoothed to longer shortest waves, each by a factor of at most 2, and not
    beyond the waves that make most of its heights. Results that depend on the
    resolution are not known from the map.

    Parameters
    ----------
    height : DataArray or array, shape (n, m)
        A map as `read` returns it, or heights in m; for two rough surfaces, their sum.
    spacing : float or str, optional
        Distance between nodes of an array, in m or with a unit.
    pressure : float or str
        Load over the area of the map, in Pa or with a unit.
    material : Material or str
        Material of both bodies, or its name.
    shortest : float or str, optional
        Leave out shorter waves, in m or with a unit.
    progress : bool or function, optional
        True for a bar, or a function that is called with the fraction done.

    Returns
    -------
    Dataset
        Along ``contact``: ``area`` (m²), ``force`` (N), ``stiffness`` (N/m, along the
        plane), ``place_x`` and ``place_y`` (m), and ``resolution_of``, the resolution
        to which each belongs. Along ``resolution``, the finest first: ``shortest`` wave
        (m), the fraction ``contact_area``, ``number``, ``effective_number``
        ``(sum A)²/sum A²``, ``length`` (m), the load over the stiffness of all
        contacts, and ``interaction``, their stiffness over that of independent
        contacts. Also the map and its pressures; the attribute ``note`` holds warnings.

    Raises
    ------
    InputError
        If the map cannot be pressed, contact covers more than 10 % of it, or it does
        not resolve its contacts.

    Examples
    --------
    >>> rough = ss.surface.self_affine(
    ...     rq="1 um", hurst=0.8, roll_off="40 um", cut_off="10 um", nodes=128
    ... )
    >>> found = ss.surface.contacts(rough, pressure="3 MPa", material="pmma")
    >>> [int(count) for count in found["number"]]
    [17, 12, 10]
    """
    body = material_named(material)
    load = read_value("pressure", pressure, "Pa", "2 MPa")
    if not isinstance(height, xr.DataArray):
        if spacing is None:
            raise InputError("spacing: is missing; give it in m, or as '0.5 um'")
        height = as_map(height, length_of("spacing", spacing))
    elif set(height.dims) != {"x", "y"}:
        raise InputError(f"height: has the dimensions {height.dims}; must have x and y")
    elif (unit := height.attrs.get("units")) != "m":
        raise InputError(
            f"height: its attribute units is {shown(unit)}; give heights in m, with "
            "the attribute: height.assign_attrs(units='m')"
        )
    elif not {"x", "y"} <= set(height.coords):
        raise InputError("height: has no coordinates; give it x and y in m")
    steps = np.abs(np.concatenate([np.diff(height[name]) for name in ("x", "y")]))
    checked = as_map(height.transpose("x", "y").to_numpy(), steps)
    surface = levelled(checked.assign_attrs(height.attrs))
    if shortest is not None:
        surface = low_pass(surface, shortest)
    long, finest = mean_waves(surface)
    ratio = min(2.0, math.sqrt(long / finest))
    rows = []
    with reporting(progress, "contacts") as report:
        for k in range(_RESOLUTIONS):
            length = ratio**k * finest
            smooth = _coarser(surface, length) if k else surface
            into = part(report, k / _RESOLUTIONS, (k + 1) / _RESOLUTIONS)
            found = _pressed(smooth, load, body, into, finest=k == 0)
            if k == 0:
                _check(found, spacing_of(surface))
            rows.append(found.assign(shortest=length))
        report(1.0)
    return _joined(surface, rows, load, body)


def _coarser(surface: xr.DataArray, length: float) -> xr.DataArray:
    """Return a map without shorter waves, on as few nodes as the others need."""
    smooth = low_pass(surface, length)
    most = length / (_NODES * spacing_of(surface))
    fits = (s for s in (4, 2) if s <= most and not any(n % s for n in surface.shape))
    step = next(fits, 1)
    return smooth[::step, ::step]


def _pressed(
    surface: xr.DataArray,
    load: float,
    body: Material,
    progress: Any,
    *,
    finest: bool,
) -> xr.Dataset:
    """Return the contacts of a map at one resolution."""
    spacing = spacing_of(surface)
    p = press(
        surface.to_numpy(),
        spacing,
        load,
        body.modulus,
        hardness=body.hardness,
        progress=progress,
    )
    whole_area = p.size * spacing**2
    if finest:
        _check_area(np.count_nonzero(p) / p.size)
    labels, count = _labels(p > 0.0)
    each = np.arange(1, count + 1)
    nodes = np.bincount(labels.ravel(), minlength=count + 1)[1:]
    area = nodes * spacing**2
    force = spacing**2 * np.asarray(ndimage.sum_labels(p, labels, each))
    places = np.array(ndimage.maximum_position(p, labels, each)) * spacing
    stiffness = whole_area * tangential_stiffness(
        p,
        spacing,
        body.modulus,
        body.poisson,
    )
    # stiffness of a disc of the same area, alone on a half-space (Mindlin)
    softer = 2.0 * (1.0 - body.poisson) / (2.0 - body.poisson)
    alone = 2.0 * body.modulus * softer * np.sqrt(area / np.pi)
    interaction = stiffness / alone.sum()
    return xr.Dataset(
        {
            "area": ("contact", area),
            "force": ("contact", force),
            "stiffness": ("contact", interaction * alone),
            "place_x": ("contact", places[:, 0]),
            "place_y": ("contact", places[:, 1]),
            "pressure": (("x", "y"), p),
            "contact_area": area.sum() / whole_area,
            "number": count,
            "effective_number": area.sum() ** 2 / (area**2).sum(),
            "single_nodes": np.count_nonzero(nodes == 1) / count,
            "single_node_area": nodes[nodes == 1].sum() / nodes.sum(),
            "length": load * whole_area / stiffness,
            "interaction": interaction,
        }
    )


def _labels(touching: Any) -> tuple[Any, int]:
    """Number the contacts, connected nodes of a periodic map, from 1; return the labels
    of the nodes and the number of contacts.
    """
    labels, _ = ndimage.label(touching)
    for first, last in ((labels[0], labels[-1]), (labels[:, 0], labels[:, -1])):
        for at in np.flatnonzero(first * last):
            labels[labels == last[at]] = first[at]
    # nodes without contact have the label 0, which comes first
    names, group = np.unique(labels, return_inverse=True)
    return group.reshape(labels.shape), names.size - 1


def _check_area(fraction: float) -> None:
    """Refuse a load under which contacts are not independent; the stiffness of a map in
    contact everywhere is infinite.
    """
    if fraction > MOST_CONTACT:
        raise InputError(
            f"pressure: contact covers {percent(fraction)} of the map; above "
            f"{percent(MOST_CONTACT)} contacts are not independent: lower the pressure"
        )


def _check(found: xr.Dataset, spacing: float) -> None:
    """Refuse a map that does not resolve its contacts."""
    single = float(found["single_nodes"])
    if single > _MOST_PIXELS or float(found["single_node_area"]) > _MOST_PIXEL_AREA:
        raise InputError(
            f"height: {percent(single)} of the contacts are a single node, so the map "
            "does not resolve them: measure it finer, or leave out waves shorter than "
            f"8 nodes: shortest = '{engineering(_NODES * spacing, 'm')}'"
        )


_LABELS = labels(
    """
area | m^2 | area of a contact
force | N | normal force of a contact
stiffness | N/m | stiffness of a contact along the plane
place_x | m | x
place_y | m | y
resolution | 1 | resolution, 0 the finest
pressure | Pa | pressure
shortest | m | shortest wave
contact_area | 1 | fraction of the area in contact
number | 1 | number of contacts
effective_number | 1 | effective number of contacts
single_nodes | 1 | fraction of contacts of a single node
single_node_area | 1 | fraction of the contact area in these
length | m | load over stiffness
interaction | 1 | stiffness over that of contacts alone
"""
)
_EACH = ("area", "force", "stiffness", "place_x", "place_y")


def _joined(
    surface: xr.DataArray,
    rows: list[xr.Dataset],
    load: float,
    body: Material,
) -> xr.Dataset:
    """Return one Dataset of all resolutions, with units and notes."""
    found = xr.concat(
        [row.drop_vars([*_EACH, "pressure"]) for row in rows], "resolution"
    )
    found = found.assign(
        {name: xr.concat([r[name] for r in rows], "contact") for name in _EACH}
    )
    levels = np.repeat(np.arange(len(rows)), [row.sizes["contact"] for row in rows])
    found = found.assign_coords(resolution_of=("contact", levels))
    found = found.assign(height=surface, pressure=rows[0]["pressure"])
    for name, label in _LABELS.items():
        if name in found:
            found[name].attrs.update(label)
    spans = min(surface.shape) * spacing_of(surface) / correlation_length(surface)
    notes = [surface.attrs["note"]]
    if (few := float(found["effective_number"][0])) < FEWEST:
        notes.append(
            f"{number(few, 2)} effective contacts, fewer than the {FEWEST:.0f} of an "
            "interface of many: take a larger map"
        )
    if spans < SPANS:
        notes.append(
            f"the map spans {number(spans, 2)} correlation lengths; a number of "
            f"contacts needs {SPANS:.0f}"
        )
    return found.assign_attrs(
        load=load,
        young=body.young,
        poisson=body.poisson,
        hardness=body.hardness,
        spans=float(spans),
        factor=float(surface.attrs.get("factor", 1.0)),
        rq=float(surface.std()),
        map_area=float(surface.size * spacing_of(surface) ** 2),
        note="; ".join(filter(None, notes)),
    )


def loads(
    height: Any,
    spacing: Length | None = None,
    *,
    pressures: Sequence[float | str],
    material: Material | str,
    progress: Any = None,
) -> xr.Dataset:
    """Return the results of `contacts` along ``resolution`` for several loads, along
    ``load`` (Pa).

    Raises `InputError` as `contacts` does.

    Examples
    --------
    >>> rough = ss.surface.self_affine(
    ...     rq="1 um", hurst=0.8, roll_off="40 um", cut_off="10 um", nodes=128
    ... )
    >>> found = ss.surface.loads(rough, pressures=["2 MPa", "4 MPa"], material="pmma")
    >>> dict(found.sizes)
    {'load': 2, 'resolution': 3}
    """
    rows = []
    pressures = sequence("pressures", pressures, "loads, such as ['2 MPa', '4 MPa']")
    if not pressures:
        raise InputError("pressures: is empty; give at least one load")
    with reporting(progress, "loads") as report:
        for k, pressure in enumerate(pressures):
            into = part(report, k / len(pressures), (k + 1) / len(pressures))
            found = contacts(
                height,
                spacing,
                pressure=pressure,
                material=material,
                progress=into,
            )
            totals = found.drop_dims(["contact", "x", "y"])
            rows.append(totals.assign_coords(load=found.attrs["load"]))
    joined = xr.concat(rows, "load", combine_attrs="drop")
    joined["load"].attrs.update(units="Pa", long_name="load over the area")
    return joined


def level(found: xr.Dataset, resolution: int) -> dict[str, Array]:
    """Return areas, forces and stiffnesses of the contacts at one resolution."""
    here = found["resolution_of"].to_numpy() == resolution
    return {name: found[name].to_numpy()[here] for name in _EACH[:3]}

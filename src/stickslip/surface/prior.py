"""Estimated parameters of an interface from the contacts of a map, with ranges."""

from __future__ import annotations

import copy
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import xarray as xr

from stickslip.answers import Answer
from stickslip.arrays import Array, Range
from stickslip.errors import InputError, dataset, instance, refused
from stickslip.io.rig_files import content_of, from_document, to_document
from stickslip.model import Areas, Empirical, Interface, Rig
from stickslip.model.quantities import read_value
from stickslip.surface.pressing import FEWEST, SPANS, level
from stickslip.words import engineering, number, percent

Which = Literal["renewal", "elastic"]
LENGTHS: tuple[Which, ...] = get_args(Which)
MEASURE = (
    "one slow pull with a velocity step (its first slope gives the elastic length, the "
    "distance over which friction settles after the step the renewal length), and "
    "friction at two speeds, for the delay"
)
# error of a stiffness, as a factor, for a large map and for a small one
_LARGE = 1.15
_SMALL = 3.0
_BINS = 40  # bins of the distribution of areas
_MOST = 10_000  # most contacts: with more, their noise need not be simulated
# keys of a rig file that an estimate replaces
_OURS = (
    "interface.mu_s",
    "interface.mu_k",
    "interface.thresholds",
    "interface.thresholds.std",
    "interface.breaking_displacement",
    "simulation.contacts",
)


def stretchings(
    found: xr.Dataset,
    resolution: int,
    length: Which,
    friction: float,
) -> tuple[Array, Array]:
    """Return the stretching (m) at which each contact at one resolution breaks, and its
    fraction of the stiffness.

    A contact breaks where its force exceeds friction (elastic), or after its diameter
    (renewal).
    """
    area, force, stiffness = level(found, resolution).values()
    elastic = length == "elastic"
    x = friction * force / stiffness if elastic else 2.0 * np.sqrt(area / np.pi)
    return x, stiffness / stiffness.sum()


def births(x: Array, stiffness: Array) -> tuple[float, float]:
    """Return mean and relative standard deviation of the thresholds of newborn
    contacts.

    A map shows the contacts at one instant. A contact that breaks at ``x`` lives as
    long as the slider takes to move by ``x``, so the thresholds of newborn contacts are
    distributed as ``P_c ~ w(x)/x``, where ``w`` is the stiffness of the contacts of the
    map. If ``w`` is log-normal, so is ``P_c``, with the same relative standard
    deviation ``s``, and a mean smaller by ``1 + s^2``. The moments of ``w`` are used
    here, as those of ``w/x`` depend on the smallest contacts, which no map resolves.
    """
    mean = float((stiffness * x).sum())
    square = float((stiffness * x**2).sum())
    spread = square / mean**2
    return mean / spread, float(np.sqrt(spread - 1.0))


@dataclass(frozen=True, kw_only=True, repr=False)
class Estimate(Answer):
    """Parameters of an interface from a map of heights, in SI units: the value at the
    finest resolution, and a range for the other resolutions and the error of one map.
    """

    friction: float  #: assumed coefficient, which scales the elastic length
    pressure: float  #: load over the area of the map
    contact_area: float  #: fraction of the area in contact
    effective_number: float  #: effective number of contacts of the map
    elastic: float  #: breaking displacement of contacts that slip when overloaded
    elastic_between: Range
    renewal: float  #: breaking displacement of contacts that last while they overlap
    renewal_between: Range
    std: Mapping[str, float]  #: relative, of the thresholds, for either length
    std_between: Range
    #: effective number, and number, of contacts per area; None from a small map
    density: Range | None
    note: str

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def lines(self) -> Iterator[str]:
        """Yield the lines of the estimate in words."""
        std, low, high = (
            number(each, 2) for each in (self.std["renewal"], *self.std_between)
        )
        yield (
            f"contact on {percent(self.contact_area)} of the map at "
            f"{engineering(self.pressure, 'Pa')}, {number(self.effective_number, 2)} "
            "effective contacts"
        )
        yield f"{'standard deviation of thresholds':<34}{std} ({low} to {high})"
        rows = (
            ("elastic length", self.elastic, self.elastic_between),
            ("renewal length", self.renewal, self.renewal_between),
        )
        for name, value, between in rows:
            low, high = (engineering(each, "m", 2) for each in between)
            yield f"{name:<34}{engineering(value, 'm', 2)} ({low} to {high})"
        if self.density is not None:
            most = number(1e-6 * self.density[1], 2)
            yield f"{'contacts per mm^2':<34}at most {most}"
        yield (
            f"The elastic length is for a friction coefficient of {self.friction:g}. "
            "A map does not show which length applies."
        )
        yield f"Measure next: {MEASURE}."
        if self.note:
            yield f"note: {self.note}"


def estimate(found: xr.Dataset, *, friction: float = 0.4) -> Estimate:
    """Estimate the parameters of a rig from the contacts of a map.

    Parameters
    ----------
    found : Dataset
        Contacts, as `contacts` returns them.
    friction : float
        Friction coefficient, which a map does not give.

    Raises
    ------
    InputError
        If there are fewer than 10 effective contacts.

    Examples
    --------
    >>> rough = ss.surface.self_affine(
    ...     rq="1 um", hurst=0.8, roll_off="40 um", cut_off="10 um", nodes=256
    ... )
    >>> found = ss.surface.contacts(rough, pressure="3 MPa", material="pmma")
    >>> expected = ss.surface.estimate(found)
    >>> expected.elastic < expected.renewal
    True
    """
    dataset("found", found, "a Dataset of surface.contacts")
    if "effective_number" not in found:
        raise InputError("found: must be a Dataset of surface.contacts")
    mu = read_value("friction", friction, "1", "0.4")
    few = float(found["effective_number"][0])
    if few < FEWEST:
        raise InputError(
            f"height: {number(few, 2)} effective contacts; an interface of many needs "
            f"{FEWEST:.0f} at least: take a larger map, or raise the pressure"
        )
    spans = found.attrs["spans"]
    error = max(_LARGE if spans >= SPANS else _SMALL, found.attrs["factor"])
    levels = range(found.sizes["resolution"])
    means: dict[str, Array] = {}
    stds: dict[str, Array] = {}
    for name in LENGTHS:
        laws = [births(*stretchings(found, level, name, mu)) for level in levels]
        means[name], stds[name] = np.transpose(laws)
    between = {n: (m.min() / error, m.max() * error) for n, m in means.items()}
    every = np.concatenate([*stds.values()])
    area = found.attrs["map_area"]
    density = (
        float(found["effective_number"].min()) / area,
        float(found["number"].max()) / area,
    )
    return Estimate(
        friction=mu,
        pressure=found.attrs["load"],
        contact_area=float(found["contact_area"][0]),
        effective_number=few,
        elastic=float(means["elastic"][0]),
        elastic_between=between["elastic"],
        renewal=float(means["renewal"][0]),
        renewal_between=between["renewal"],
        std={name: float(each[0]) for name, each in stds.items()},
        std_between=(float(every.min()), float(every.max())),
        density=density if spans >= SPANS else None,
        note=found.attrs["note"],
    )


def interface(
    found: xr.Dataset,
    *,
    length: Which = "renewal",
    friction: float = 0.4,
    kept: bool = False,
) -> Interface:
    """Return the interface of the contacts of a map, at its finest resolution, in
    natural units: ``x_s`` is the mean threshold of newborn contacts.

    Parameters
    ----------
    found : Dataset
        Contacts, as `contacts` returns them.
    length : str
        The stretching at which a contact breaks: its diameter, "renewal", or that at
        which its force exceeds friction, "elastic".
    friction : float
        Friction coefficient, for the elastic length.
    kept : bool
        Whether contacts keep their areas when they re-attach, as on a worn track. Then
        the areas of newborn contacts are those of the map, and stretchings grow with
        the square root of the area.

    Raises `InputError` for an unknown length, or too few contacts.

    Examples
    --------
    >>> rough = ss.surface.self_affine(
    ...     rq="1 um", hurst=0.8, roll_off="40 um", cut_off="10 um", nodes=256
    ... )
    >>> found = ss.surface.contacts(rough, pressure="3 MPa", material="pmma")
    >>> round(ss.surface.interface(found).thresholds.moment(1), 2)
    1.0
    """
    _check_length(length)
    instance("kept", kept, bool, "True or False")
    estimate(found, friction=friction)
    if kept:
        area = level(found, 0)["area"]
        return Interface(areas=Areas(_histogram(area / area.mean()), kept=True))
    x, stiffness = stretchings(found, 0, length, friction)
    mean = 1.0 / float((stiffness / x).sum())
    return Interface(thresholds=_histogram(x / mean, stiffness / x))


def _check_length(length: object) -> None:
    if not (isinstance(length, str) and length in LENGTHS):
        raise refused("length", length, f"must be {' or '.join(map(repr, LENGTHS))}")


def _histogram(values: Array, weights: Array | None = None) -> Empirical:
    """Return the histogram of values in logarithmic bins, scaled to keep their mean."""
    mean = np.average(values, weights=weights)
    edges = np.geomspace(0.99 * values.min(), 1.01 * values.max(), _BINS + 1)
    counts, _ = np.histogram(values, bins=edges, weights=weights)
    middle = np.average(0.5 * (edges[1:] + edges[:-1]), weights=counts)
    return Empirical(
        edges=tuple((edges * mean / middle).tolist()), weights=tuple(counts.tolist())
    )


def rig(
    estimate: Estimate,
    machine: Any = "pmma_slider",
    *,
    length: Which | None = None,
    name: str = "",
) -> Rig:
    """Return the rig of a machine with the measured interface. Uncertain values become
    assumptions with a range, from which `predict` computes its uncertainty.

    Parameters
    ----------
    estimate : Estimate
        As `estimate` returns it.
    machine : path, str or Rig
        A rig in SI units, or its file. The breaking displacement and the thresholds of
        its interface are replaced; strength, delay and ageing are kept.
    length : str, optional
        Which length applies, if it is known: "renewal" or "elastic". By default, the
        rig has the renewal length, and a range over both.
    name : str
        Name of the surface.

    Raises `InputError` if the rig is in natural units or cannot be read.

    Examples
    --------
    >>> rough = ss.surface.self_affine(
    ...     rq="1 um", hurst=0.8, roll_off="40 um", cut_off="10 um", nodes=256
    ... )
    >>> found = ss.surface.contacts(rough, pressure="3 MPa", material="pmma")
    >>> made = ss.surface.rig(ss.surface.estimate(found))
    >>> made.assumed["interface.thresholds.std"].between[0] < 0.5
    True
    """
    instance("estimate", estimate, Estimate, "a surface.Estimate")
    instance("name", name, str, "a text")
    known = (str, os.PathLike, Rig)
    instance("machine", machine, known, "a Rig, or the file of one")
    document = (
        to_document(machine)
        if isinstance(machine, Rig)
        else copy.deepcopy(content_of(Path(machine)))
    )
    before = from_document(document)
    if before.scales is None:
        raise InputError(
            "machine: is in natural units; a surface needs one in SI units"
        )
    chosen = LENGTHS[0] if length is None else length
    _check_length(chosen)
    ranges: dict[Any, Range] = {
        None: (estimate.elastic_between[0], estimate.renewal_between[1]),
        "elastic": estimate.elastic_between,
        "renewal": estimate.renewal_between,
    }
    table = document["interface"]
    strength = before.scales.force * getattr(before.slider, "size", 1)
    for key in ("mu_s", "mu_k"):
        table.pop(key, None)
    if "friction" not in table:
        table["contact_strength"] = engineering(strength, "N", 6)
    value = estimate.elastic if chosen == "elastic" else estimate.renewal
    table["breaking_displacement"] = engineering(value, "m", 3)
    std = float(number(estimate.std[chosen], 3))
    table["thresholds"] = {"distribution": "lognormal", "std": std}
    for part in ("assumed", "fitted"):
        marked = document.get(part, {})
        document[part] = {k: v for k, v in marked.items() if k not in _OURS}
    document["assumed"] |= {
        "interface.breaking_displacement": [
            engineering(end, "m", 2) for end in ranges[length]
        ],
        "interface.thresholds.std": [float(number(e, 2)) for e in estimate.std_between],
    }
    _with_contacts(document, before, estimate, strength)
    document["name"] = f"{name or 'surface'}, {before.name}"
    document["source"] = f"interface from a map of heights; measure next: {MEASURE}"
    return from_document(document)


def _with_contacts(
    document: dict[str, Any],
    before: Rig,
    estimate: Estimate,
    strength: float,
) -> None:
    """Set the number of contacts in the content of a file, if the map gives it and it
    is small enough to matter.
    """
    load = before.operation.normal_load
    newtons = before.value("normal_load") if load else strength / estimate.friction
    nominal = newtons / estimate.pressure
    simulation = document.setdefault("simulation", {})
    count = int(getattr(before.method, "count", _MOST))
    if estimate.density is None:
        return
    fewest, most = (min(density * nominal, _MOST) for density in estimate.density)
    if not (simulation.get("method", "contacts") == "contacts" and most < _MOST):
        return
    simulation["contacts"] = max(min(count, int(most)), 1)
    document["assumed"]["simulation.contacts"] = [int(fewest), max(int(most), 2)]

"""The ranges in which both smooth sliding and stick-slip persist: between a fold and a
linear boundary.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import labelled
from stickslip.cycles.branch import carried, first_point
from stickslip.cycles.cycle_run import contacts_of
from stickslip.cycles.edges import TOLERANCE, Edge, Interval, Intervals, ParameterScan
from stickslip.errors import InputError, UndecidedError, instance
from stickslip.model import FromRest
from stickslip.model.parameters import VELOCITY, Parameter, parameter_named
from stickslip.model.rig import Rig
from stickslip.model.structure import Structure
from stickslip.stability import Crossing, Crossings, critical

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, kw_only=True, repr=False)
class BistableRange(Intervals):
    """Ranges of a parameter in which both smooth sliding and stick-slip persist; an
    empty result is also an answer.
    """

    _items = "bands"

    bands: tuple[Interval, ...]  #: in increasing order
    crossings: Crossings  #: the linear boundaries in the range
    contacts: int | None = None  #: number in runs of a structure; None without noise
    notes: tuple[str, ...] = ()  #: places without a band, and why

    def __str__(self) -> str:
        found = f"no bistable band found {self.where}"
        if self.bands:
            followed = (
                f"with the noise of {self.contacts} contacts"
                if self.contacts
                else "without noise: from rest, or of few contacts, it may decay before"
            )
            found = (
                f"{self.where}, both smooth sliding and stick-slip persist "
                f"{' and '.join(map(str, self))}; the cycle is followed {followed}"
            )
        return "\n".join([found, *self.notes])


def bistable_range(
    rig: Rig,
    parameter: Parameter | str = VELOCITY,
    *,
    between: tuple[float, float],
    step: float = 0.15,
    tolerance: float = TOLERANCE,
) -> BistableRange:
    """Find the ranges in which both smooth sliding and stick-slip persist, between the
    cycle's fold and the linear boundary.

    At each value where smooth sliding loses stability (linear) the cycle is started on
    the unstable side and followed to the stable side until it decays. If there is no
    such value, the cycle is searched from rest on a grid of 17 values.

    Parameters
    ----------
    rig : Rig
        The rig; its own value of the parameter does not matter.
    parameter : Parameter or str
    between : (float, float)
        Range searched, in the rig's own units.
    step, tolerance : float
        As in `cycle_branch`.

    Returns
    -------
    BistableRange
        The bands, and the range searched. Where one cycle has a linear boundary,
        others that are apart from any boundary are not searched.

    Raises
    ------
    InputError
        If no cycle can be followed on the rig, or the parameter or the range is
        invalid.

    Examples
    --------
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1)
    ... )
    >>> rig = ss.Rig(
    ...     interface,
    ...     ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4),
    ...     ss.constant(velocity=1.0),
    ... )
    >>> found = ss.bistable_range(
    ...     rig, "velocity", between=(0.6, 1.5), step=0.2, tolerance=0.01
    ... )
    >>> [(band.low.kind, band.high.kind) for band in found], 1.0 in found
    ([('fold', 'linear')], True)
    """
    scan = ParameterScan(
        rig,
        parameter,
        between,
        FromRest(),
        tolerance=tolerance,
        step=step,
    )
    scan.check_work(scan.steps)
    crossings = critical(rig, scan.parameter, between=(scan.low, scan.high))
    found: list[Interval | str] = []
    ends = [scan.low, *(edge.value for edge in crossings.edges), scan.high]
    for i, edge in enumerate(crossings.edges):
        each = _beside(scan, edge, ends[i] if edge.loses_stability else ends[i + 2])
        # a band between two boundaries is found from both
        found += [each] if each not in found else []
    if crossings.unstable_at_ends[0] and not found:
        found = [
            "smooth sliding is unstable in all of the range: only stick-slip persists"
        ]
    elif not found:  # search for a cycle apart from any boundary
        try:
            first = first_point(scan)
            low, high = (
                carried(scan, first, until)[1] for until in (scan.low, scan.high)
            )
            found = [Interval(low=low, high=high)]
        except UndecidedError as reason:
            found = [str(reason)]
    return BistableRange(
        **scan.about,
        bands=tuple(each for each in found if isinstance(each, Interval)),
        crossings=crossings,
        contacts=contacts_of(rig).count if isinstance(rig.slider, Structure) else None,
        notes=tuple(each for each in found if isinstance(each, str)),
    )


def _beside(scan: ParameterScan, edge: Crossing, furthest: float) -> Interval | str:
    """Return the band that extends from a linear boundary towards a value, or why there
    is none.
    """
    downwards = edge.loses_stability  # smooth sliding is stable below
    boundary = (
        f"the linear boundary {scan.parameter.name} = {scan.in_words(edge.value)}"
    )
    first = scan.settled(
        min(max(edge.value * (1.01 if downwards else 0.99), scan.low), scan.high)
    )
    if not first.verdict.has_cycle:
        return f"next to {boundary}: {first.verdict}"
    _, end = carried(scan, first, furthest)
    width = math.log(edge.value / end.value) * (1 if downwards else -1)
    if (
        end.kind == "shrinks to nothing"
        or width <= (4 if end.kind == "undecided" else 1) * scan.tolerance
    ):
        return (
            f"beyond {boundary} the cycle persists to {scan.in_words(end.persists_at)} "
            "at most: no band"
        )
    linear = Edge.of("linear", edge.value)
    if end.kind == "end of range" and furthest not in (scan.low, scan.high):
        end = Edge.of("linear", furthest)
    return (
        Interval(low=end, high=linear) if downwards else Interval(low=linear, high=end)
    )


def bistable_region(
    rig: Rig,
    *,
    over: tuple[str, str],
    edge: xr.Dataset,
    between: tuple[float, float],
    places: int = 7,
    progress: Callable[[float], None] | None = None,
) -> xr.Dataset:
    """Find the ends of the bistable band along one parameter at several values of
    another; takes seconds for each.

    Parameters
    ----------
    rig : Rig
        The rig; its values of the two parameters do not matter.
    over : (str, str)
        Names of two parameters; bands extend along the second.
    edge : xarray.Dataset
        The linear boundary over the two parameters, from
        `stickslip.stability.boundary`; the values of the first are spread over it.
    between : (float, float)
        Range of the second parameter.
    places : int
        Number of values of the first parameter.
    progress : callable, optional
        Called with the completed fraction.

    Returns
    -------
    xarray.Dataset
        Along ``band``: ``band_<first>``, ``band_<second>_low`` and
        ``band_<second>_high``, and ``band_<second>_fold``, the one of the two at which
        stick-slip decays (NaN if that lies beyond the range). Values of the first at
        which no band was found, or a run did not decide, are omitted.

    Examples
    --------
    >>> from stickslip.cycles import bistable_region
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1)
    ... )
    >>> rig = ss.Rig(
    ...     interface,
    ...     ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4),
    ...     ss.constant(velocity=1.0),
    ... )
    >>> ranges = (1.6, 2.4), (0.5, 2.0)
    >>> edge = ss.stability.boundary(
    ...     rig, over=("stiffness", "velocity"), between=ranges
    ... )
    >>> region = bistable_region(
    ...     rig, over=("stiffness", "velocity"), edge=edge, between=ranges[1], places=1
    ... )
    >>> (
    ...     bool((region.band_velocity_low < region.band_velocity_high).all()),
    ...     region.sizes["band"],
    ... )
    (True, 1)
    """
    import xarray as xr

    instance("bistable_region: rig", rig, Rig, "a Rig(interface, slider, drive)")
    instance(
        "bistable_region: edge",
        edge,
        xr.Dataset,
        "the Dataset that stability.boundary() returns",
    )
    across, up = (parameter_named(name) for name in over)
    reached = edge[across.name].to_numpy()
    values = (
        np.geomspace(reached.min(), reached.max(), places + 2)[1:-1]
        if reached.size
        else np.empty(0)
    )
    rows = []
    for i, value in enumerate(values.tolist()):
        if progress is not None:
            progress(i / places)
        here = rig.with_values(**{across.name: value})
        try:
            bands = bistable_range(here, up, between=between, tolerance=0.02)
        except (InputError, UndecidedError):
            continue
        for band in bands:
            fold = next(
                (end.value for end in (band.low, band.high) if end.kind == "fold"),
                math.nan,
            )
            rows.append((value, band.low.value, band.high.value, fold))
    table = np.array(rows).reshape(-1, 4)
    columns = {
        f"band_{across.name}": (across.name, across.unit),
        f"band_{up.name}_low": (f"{up.name}, lower end", up.unit),
        f"band_{up.name}_high": (f"{up.name}, upper end", up.unit),
        f"band_{up.name}_fold": (f"{up.name}, fold", up.unit),
    }
    return xr.Dataset(
        {
            name: labelled(title, "band", values, rig.unit_name(unit))
            for (name, (title, unit)), values in zip(
                columns.items(), table.T, strict=True
            )
        }
    )

"""Theory beside a sweep: the computed boundary of smooth sliding, and the range beyond
it in which stick-slip persists.
"""

import itertools

import numpy as np
import xarray as xr

from stickslip.arrays import Range
from stickslip.cycles import bistable_range, bistable_region
from stickslip.errors import InputError, UndecidedError, dataset
from stickslip.model import Rig
from stickslip.progress import Progress
from stickslip.stability import boundary, critical
from stickslip.sweep.plan import plan_of


def with_theory(
    result: xr.Dataset, *, bistable: bool = False, progress: Progress | None = None
) -> xr.Dataset:
    """Add the computed boundary of smooth sliding to the results of a sweep over one or
    two parameters.

    The result is from `Plan.run`, `sweep` or `open_plan`; other parameters that were
    swept have the value selected in it. With `bistable`, stick-slip is also followed
    from the boundary to where its branch ends, which takes seconds for each of a few
    values of the first parameter (nonlinear; `stickslip.cycles`).

    The result has additional ``edge_<parameter>`` along ``point`` (and ``edge_curve``
    in a plane) and ``band_...`` along ``band``; the attribute ``theory`` names them, or
    gives the reason why there are none.
    """
    dataset("result", result, "the results of a sweep")
    plan = plan_of(result)
    order = plan.parameters if "run" in result.dims else result["regime"].dims
    ranges = {
        str(name): _reach(result[name]) for name in order if name in plan.parameters
    }
    fixed = {
        name: float(result[name])
        for name in plan.parameters
        if name in result and result[name].ndim == 0
    }
    rig = plan.study.rig.with_values(**fixed)
    try:
        if not 1 <= len(ranges) <= 2:
            raise InputError("it is drawn over one parameter or two")
        for name, (low, high) in ranges.items():
            if low == high:
                raise InputError(f"{name} has one value in this sweep")
        found = (
            _on_line(rig, ranges, bistable)
            if len(ranges) == 1
            else _in_plane(rig, ranges, bistable, progress)
        )
    except (InputError, UndecidedError) as reason:
        return result.assign_attrs(theory=f"no linear boundary: {reason}")
    for name, part in itertools.product(ranges, found.variables):
        if f"_{name}" in str(part):
            found[part] = found[part].assign_attrs(result[name].attrs)
    words = "linear stability of smooth sliding" + (
        ", cycles of the master equation" if bistable else ""
    )
    if not found.sizes["point"]:
        words = "no linear boundary in this window"
    return xr.merge(
        [result, found], combine_attrs="override", compat="override"
    ).assign_attrs(theory=words)


def _reach(axis: xr.DataArray) -> Range:
    """Ends of an axis, extended by half a step if it has equal steps, as cells of a map
    are.
    """
    values = np.unique(axis.to_numpy().astype(float))
    if "run" in axis.dims or values.size < 2:
        return float(values[0]), float(values[-1])
    log = axis.attrs.get("spacing") == "log"
    places = np.log(values) if log else values
    ends = 1.5 * places[[0, -1]] - 0.5 * places[[1, -2]]
    low, high = np.exp(ends) if log else ends
    return float(low if low > 0 else values[0]), float(high)


def _in_plane(
    rig: Rig,
    ranges: dict[str, Range],
    bistable: bool,
    progress: Progress | None,
) -> xr.Dataset:
    one, other = ranges
    edge = boundary(
        rig,
        over=(one, other),
        between=(ranges[one], ranges[other]),
        progress=None if bistable else progress,
    )
    names = [one, other, "curve"]
    found = edge[names].rename({name: f"edge_{name}" for name in names})
    if bistable:
        bands = bistable_region(
            rig,
            over=(one, other),
            edge=edge,
            between=ranges[other],
            places=17,
            progress=progress,
        )
        found = found.merge(bands)
    return found.drop_attrs(deep=False)


def _on_line(rig: Rig, ranges: dict[str, Range], bistable: bool) -> xr.Dataset:
    ((parameter, between),) = ranges.items()
    edges = critical(rig, parameter, between=between).edges
    bands = list(bistable_range(rig, parameter, between=between)) if bistable else []
    return xr.Dataset(
        {
            f"edge_{parameter}": ("point", [edge.value for edge in edges]),
            f"band_{parameter}_low": ("band", [band.low.value for band in bands]),
            f"band_{parameter}_high": ("band", [band.high.value for band in bands]),
        }
    )

"""What theory says of a sweep: the computed boundary of smooth sliding, and how far stick-slip persists beyond it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from stickslip.cycles import bistable_range, bistable_region
from stickslip.errors import InputError, UndecidedError
from stickslip.model import Rig
from stickslip.progress import Progress
from stickslip.stability import boundary, critical
from stickslip.sweep.plan import plan_of

if TYPE_CHECKING:
    import xarray as xr


def with_theory(result: xr.Dataset, *, bistable: bool = False, progress: Progress | None = None) -> xr.Dataset:
    """Add the computed boundary of smooth sliding to the results of a sweep over one or two parameters.

    Parameters
    ----------
    result : xarray.Dataset
        From `Plan.run`, `sweep` or `open_plan`; other parameters that were swept are at the value selected.
    bistable : bool
        Whether to follow stick-slip from the boundary to where its branch ends as well, which takes seconds for each of
        a few values of the first parameter (nonlinear; `stickslip.cycles`).
    progress : callable, optional
        Called with the fraction of the work that is done.

    Returns
    -------
    xarray.Dataset
        The same with ``edge_<parameter>`` along ``point`` (and ``edge_curve`` in a plane), ``band_...`` along ``band``;
        the attribute ``theory`` says what is there, or why nothing is.
    """
    import xarray as xr

    plan = plan_of(result)
    order = plan.parameters if "run" in result.dims else result["regime"].dims
    varied = tuple(str(name) for name in order if name in plan.parameters)
    fixed = {name: float(result[name]) for name in plan.parameters if name in result and result[name].ndim == 0}
    rig = plan.study.rig.replace(**fixed)
    if not 1 <= len(varied) <= 2:
        return result.assign_attrs(theory="no linear boundary: it is drawn over one parameter or two")
    ranges = [_reach(result[name]) for name in varied]
    try:
        if any(low <= 0 for low, _ in ranges):
            raise InputError("a parameter starts at 0, which linear theory has no logarithm for")
        found = (
            _in_plane(rig, varied, ranges, bistable, progress or (lambda _fraction: None))
            if len(varied) == 2
            else _on_line(rig, varied[0], ranges[0], bistable)
        )
    except (InputError, UndecidedError) as reason:
        return result.assign_attrs(theory=f"no linear boundary: {reason}")
    for name in varied:
        for part in (f"edge_{name}", f"band_{name}", *(f"band_{name}_{end}" for end in ("low", "high", "fold"))):
            if part in found:
                found[part] = found[part].assign_attrs(result[name].attrs)
    words = "linear stability of smooth sliding" + (", cycles of the master equation" if bistable else "")
    if not found.sizes["point"]:
        words = "no linear boundary in this window"
    return xr.merge([result, found], combine_attrs="override", compat="override").assign_attrs(theory=words)


def _reach(axis: xr.DataArray) -> tuple[float, float]:
    """Ends of an axis, half a step beyond its values where that makes sense: cells reach so far."""
    values = np.unique(axis.to_numpy().astype(float))
    low, high = float(values[0]), float(values[-1])
    if "run" in axis.dims or values.size < 2:
        return low, high
    if axis.attrs.get("spacing") == "log":
        return low * math.sqrt(low / values[1]), high * math.sqrt(high / values[-2])
    below = low - 0.5 * (values[1] - low)
    return (below if below > 0 else low), high + 0.5 * (high - values[-2])


def _in_plane(
    rig: Rig,
    parameters: tuple[str, ...],
    ranges: list[tuple[float, float]],
    bistable: bool,
    progress: Progress,
) -> xr.Dataset:
    over = (parameters[0], parameters[1])
    edge = boundary(rig, over=over, between=(ranges[0], ranges[1]))
    found = edge[[*over, "curve"]].rename({name: f"edge_{name}" for name in (*over, "curve")})
    if bistable:
        bands = bistable_region(rig, over=over, edge=edge, between=ranges[1], places=17, progress=progress)
        found = found.merge(bands)
    return found.drop_attrs(deep=False)


def _on_line(rig: Rig, parameter: str, between: tuple[float, float], bistable: bool) -> xr.Dataset:
    import xarray as xr

    edges = critical(rig, parameter, between=between).edges
    data = {f"edge_{parameter}": ("point", np.array([edge.value for edge in edges], dtype=float))}
    if bistable:
        bands = tuple(bistable_range(rig, parameter, between=between))
        data[f"band_{parameter}_low"] = ("band", np.array([band.low.value for band in bands], dtype=float))
        data[f"band_{parameter}_high"] = ("band", np.array([band.high.value for band in bands], dtype=float))
    return xr.Dataset(data)

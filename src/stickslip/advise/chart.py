"""The stability map around a rig's own point."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from stickslip import stability
from stickslip.errors import number, whole
from stickslip.model.parameters import Parameter, parameter_named
from stickslip.model.rig import Rig
from stickslip.progress import Progress

if TYPE_CHECKING:
    import xarray as xr


def chart(
    rig: Rig,
    over: tuple[str, str],
    around: float,
    points: int,
    progress: Progress | None = None,
    *,
    bistable: bool = False,
) -> xr.Dataset:
    """Map the linear stability of smooth sliding over two parameters around a rig's own point, in the rig's units.

    The window reaches a factor `around` to either side, with half of the points along each parameter for the shading.
    With `bistable`, stick-slip is followed from the boundary to where it decays, along the second parameter, at some
    values of the first, which takes seconds for each.

    Returns
    -------
    xarray.Dataset
        ``growth_rate`` over the two parameters; along ``point`` the boundary with ``curve`` and ``frequency``; scalars
        ``here_<parameter>``; with `bistable`, along ``band`` both ends of the bistable band; the attribute ``summary``
        in words.
    """
    around = number("map: around", around, above=1.0, at_most=1e4)
    points = whole("map: points", points, at_least=4, at_most=2_000)
    report = progress or (lambda _share: None)
    setting = rig.natural
    parameters = [parameter_named(name) for name in over]
    here = [parameter.get(setting) for parameter in parameters]
    for parameter, value in zip(parameters, here, strict=True):
        number(f"map: {parameter.name} of the rig", value, above=0)
    window = tuple(
        (value / around, min(value * around, _widest(parameter)))
        for parameter, value in zip(parameters, here, strict=True)
    )
    grids = tuple(np.geomspace(low, high, max(points // 2, 4)) for low, high in window)
    names = (parameters[0].name, parameters[1].name)
    found = stability.stability_map(rig.natural, over=names, values=(grids[0], grids[1]), growth=True)
    report(0.7)
    edge = stability.boundary(rig.natural, over=names, between=(window[0], window[1])).rename(
        {name: f"edge_{name}" for name in (*names, "frequency")}
    )
    found = found.merge(edge, combine_attrs="override")
    if bistable:
        from stickslip.cycles import bistable_region

        bands = bistable_region(
            rig.natural,
            over=names,
            edge=edge.rename({f"edge_{name}": name for name in names}),
            between=window[1],
            progress=lambda share: report(0.7 + 0.3 * share),
        )
        found = found.merge(bands, combine_attrs="override")
    report(1.0)
    modes = stability.count_unstable(rig.natural)
    for name, value in zip(names, here, strict=True):
        found[f"here_{name}"] = ((), value, dict(found[name].attrs))
    curves = len(set(edge["curve"].to_numpy().tolist()))
    state = f"unstable ({modes} growing modes)" if modes else "stable"
    found.attrs["rig"] = rig.name
    found.attrs["summary"] = (
        f"{rig.name}: smooth sliding is {state} at the rig's own point; "
        + (f"{curves} neutral curve{'s' * (curves > 1)}" if curves else "no boundary")
        + f" within a factor {around:g} of it in {names[0]} and {names[1]}"
    )
    return rig.in_its_units(found)


def _widest(parameter: Parameter) -> float:
    """Largest value that makes sense: a distribution of thresholds wider than half its mean is another distribution."""
    return 0.5 if parameter.name == "std" else math.inf

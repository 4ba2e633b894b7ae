"""The stability map around a rig's own point."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip import stability, words
from stickslip.advise.mitigations import highest
from stickslip.cycles import METHOD, bistable_region
from stickslip.cycles.cycle_run import check_rig
from stickslip.errors import InputError, number, whole
from stickslip.model import FromRest
from stickslip.model.parameters import parameter_named
from stickslip.model.rig import Rig
from stickslip.progress import Progress, heard, part

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
    """Return a map of the linear stability of smooth sliding over two parameters around
    a rig's own point, in the rig's units.

    The window extends by a factor `around` in either direction, with half of `points`
    along each parameter for the growth rate. With `bistable`, stick-slip is followed
    from the boundary to where it decays, along the second parameter, at some values of
    the first, which takes seconds for each.

    Returns
    -------
    xarray.Dataset
        ``growth_rate`` over the two parameters; along ``point`` the boundary with
        ``curve`` and ``frequency``; scalars ``here_<parameter>``; with `bistable`,
        along ``band`` both ends of the bistable band; the attribute ``summary`` in
        words.
    """
    around = number("map: around", around, above=1.0, at_most=1e4)
    points = whole("map: points", points, at_least=4, at_most=2_000)
    report = heard(progress)
    natural = rig.natural
    parameters = [parameter_named(each) for each in over]
    here = [
        number(f"map: {p.name} of the rig", p.get(natural), above=0) for p in parameters
    ]
    if bistable:
        check_rig(natural, FromRest(), METHOD)
        if rig.interface.ageing is not None and rig.interface.activation is not None:
            raise InputError(
                "map: --bistable: with contacts that age and break by heat it takes "
                "hours; leave it out, and call "
                "bistable_range() over the velocity for one value of the other "
                "parameter"
            )
        if units := [p.name for p in parameters if p.rescales]:
            raise InputError(
                f"map: over = {units[0]}: stick-slip is not followed along a unit of "
                "the rig; leave out --bistable"
            )
    ends = [
        (v / around, v * min(around, highest(natural, p)))
        for p, v in zip(parameters, here, strict=True)
    ]
    low, high = (np.geomspace(*each, max(points // 2, 4)) for each in ends)
    found = stability.stability_map(
        natural,
        over=over,
        values=(low, high),
        growth=True,
        progress=part(report, 0.0, 0.5),
    )
    edge = stability.boundary(
        natural,
        over=over,
        between=(ends[0], ends[1]),
        progress=part(report, 0.5, 0.7 if bistable else 1.0),
    )
    one, other = (p.name for p in parameters)
    edges = {name: f"edge_{name}" for name in (one, other, "frequency")}
    found = found.merge(edge.rename(edges), combine_attrs="override")
    if bistable:
        watch = part(report, 0.7, 1.0)
        bands = bistable_region(
            natural, over=over, edge=edge, between=ends[1], progress=watch
        )
        found = found.merge(bands, combine_attrs="override")
    report(1.0)
    for name, value in zip((one, other), here, strict=True):
        found[f"here_{name}"] = ((), value, dict(found[name].attrs))
    modes = stability.count_unstable(natural)
    curves = len(set(edge["curve"].to_numpy().tolist()))
    state = f"unstable ({modes} growing modes)" if modes else "stable"
    boundary = (
        f"{curves} neutral curve{'s' * (curves > 1)}" if curves else "no boundary"
    )
    found.attrs["rig"] = rig.name
    found.attrs["summary"] = (
        f"{rig.name}: smooth sliding is {state} at the rig's own point; {boundary} "
        f"within a factor {words.number(around)} of it in "
        f"{one} and {other}"
    )
    return rig.in_its_units(found)

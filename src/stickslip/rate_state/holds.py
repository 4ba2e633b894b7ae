"""Healing: how much the peaks after holds grow, beside what rate and state says."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stickslip.answers import Answer
from stickslip.errors import InputError, instance

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, kw_only=True, repr=False)
class Healing(Answer):
    """Peaks after holds and their growth, in the units of the run."""

    hold: tuple[float, ...]  #: times of rest, rising
    relaxation: tuple[float, ...]  #: as `slide_hold_slide` gives them, one for each hold
    peak: tuple[float, ...]
    slip_to_peak: tuple[float, ...]
    per_decade: tuple[float, ...]  #: growth of the peak for each factor of ten in the hold, from one hold to the next
    by_rate_and_state: float  #: what rate and state says of long holds: ``b ln 10``
    time_unit: str
    force_unit: str
    length_unit: str

    def __str__(self) -> str:
        F, t, x = self.force_unit, self.time_unit, self.length_unit
        rows = zip(self.hold, self.relaxation, self.peak, self.slip_to_peak, (None, *self.per_decade), strict=True)
        table: list[tuple[str, ...]] = [("hold", "relaxation", "peak", "slip to peak", "per decade"), (t, F, F, x, F)]
        for hold, relaxation, peak, slip, growth in rows:
            said = "" if growth is None else f"{growth:.4g}"
            table.append((f"{hold:.4g}", f"{relaxation:.4g}", f"{peak:.4g}", f"{slip:.3g}", said))
        lines = [f"{row[0]:>12}{row[1]:>12}{row[2]:>12}{row[3]:>14}{row[4]:>14}" for row in table]
        expected = f"b ln 10 = {self.by_rate_and_state:.4g} {F}"
        if not self.per_decade:
            lines.append(f"rate and state says {expected} per decade of hold time; give two holds to compare")
        else:
            lines.append(
                f"healing over the last two holds: {self.per_decade[-1]:.4g} {F} per decade of hold time, "
                f"{self.per_decade[-1] / self.by_rate_and_state:.2f} times what rate and state says ({expected})"
            )
        return "\n".join(lines)


def healing(run: xr.Dataset, b: float) -> Healing:
    """Say how much the peaks of a slide-hold-slide run grow with the time of the hold.

    Parameters
    ----------
    run : Dataset
        Of `slide_hold_slide`.
    b : float
        Evolution effect of rate and state, in the unit of force of the run.

    Raises
    ------
    InputError
        If two holds are the same.
    """
    import xarray as xr

    instance("healing: run", run, xr.Dataset, "a Dataset, as slide_hold_slide() returns it")
    run = run.sortby("hold")
    found = {name: run[name].to_numpy() for name in ("hold", "relaxation", "peak", "slip_to_peak")}
    if np.any(np.diff(found["hold"]) <= 0):
        raise InputError("holds: two are the same; give each once")
    growth = np.diff(found["peak"]) / np.diff(np.log10(found["hold"]))
    time, force, length = (str(run[name].attrs["units"]) for name in ("hold", "peak", "slip_to_peak"))
    return Healing(
        **{name: tuple(values.tolist()) for name, values in found.items()},
        per_decade=tuple(growth.tolist()),
        by_rate_and_state=b * math.log(10.0),
        time_unit=time,
        force_unit=force,
        length_unit=length,
    )

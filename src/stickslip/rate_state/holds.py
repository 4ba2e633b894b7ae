"""Healing: how much the peaks after holds grow, beside what rate and state says."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr

from stickslip.answers import Answer
from stickslip.errors import InputError, instance


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
        columns = zip(self.hold, self.relaxation, self.peak, self.slip_to_peak, (None, *self.per_decade), strict=True)
        rows: list[tuple[str, ...]] = [("hold", "relaxation", "peak", "slip to peak", "per decade"), (t, F, F, x, F)]
        for *values, slip, growth in columns:
            last = "" if growth is None else f"{growth:.4g}"
            rows.append((*(f"{value:.4g}" for value in values), f"{slip:.3g}", last))
        lines = ["".join(f"{cell:>{w}}" for cell, w in zip(row, (12, 12, 12, 14, 14), strict=True)) for row in rows]
        expected = f"b ln 10 = {self.by_rate_and_state:.4g} {F}"
        if not self.per_decade:
            return "\n".join(
                (*lines, f"rate and state says {expected} per decade of hold time; give two holds to compare")
            )
        found = self.per_decade[-1]
        lines.append(
            f"healing over the last two holds: {found:.4g} {F} per decade of hold time, "
            f"{found / self.by_rate_and_state:.2f} times what rate and state says ({expected})"
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
    instance("healing: run", run, xr.Dataset, "a Dataset, as slide_hold_slide() returns it")
    run = run.sortby("hold")
    names = ("hold", "relaxation", "peak", "slip_to_peak")
    hold, relaxation, peak, slip = (run[name].to_numpy() for name in names)
    time, _, force, length = (str(run[name].attrs["units"]) for name in names)
    if np.any(np.diff(hold) <= 0):
        raise InputError("holds: two are the same; give each once")
    return Healing(
        hold=tuple(hold.tolist()),
        relaxation=tuple(relaxation.tolist()),
        peak=tuple(peak.tolist()),
        slip_to_peak=tuple(slip.tolist()),
        per_decade=tuple((np.diff(peak) / np.diff(np.log10(hold))).tolist()),
        by_rate_and_state=b * math.log(10.0),
        time_unit=time,
        force_unit=force,
        length_unit=length,
    )

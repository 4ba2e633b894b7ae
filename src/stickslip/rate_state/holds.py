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
        columns = (self.hold, self.relaxation, self.peak, self.slip_to_peak, (math.nan, *self.per_decade))
        rows = [
            ("hold", "relaxation", "peak", "slip to peak", "per decade"),
            (t, F, F, x, F),
            *([f"{value:.4g}".replace("nan", "") for value in row] for row in zip(*columns, strict=True)),
        ]
        lines = ["".join(f"{cell:>14}" for cell in row) for row in rows]
        expected = f"b ln 10 = {self.by_rate_and_state:.4g} {F}"
        end = f"rate and state says {expected} per decade of hold time; give two holds to compare"
        if self.per_decade:
            last = self.per_decade[-1]
            end = (
                f"healing over the last two holds: {last:.4g} {F} per decade of hold time, "
                f"{last / self.by_rate_and_state:.2f} times what rate and state says ({expected})"
            )
        return "\n".join([*lines, end])


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
    if np.any(np.diff(run["hold"]) <= 0):
        raise InputError("holds: two are the same; give each once")
    return Healing(
        **{name: tuple(run[name].values.tolist()) for name in ("hold", "relaxation", "peak", "slip_to_peak")},
        per_decade=tuple((np.diff(run["peak"]) / np.diff(np.log10(run["hold"]))).tolist()),
        by_rate_and_state=b * math.log(10.0),
        time_unit=run["hold"].attrs["units"],
        force_unit=run["peak"].attrs["units"],
        length_unit=run["slip_to_peak"].attrs["units"],
    )

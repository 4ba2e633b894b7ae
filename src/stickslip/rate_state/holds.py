"""Healing: how much the peaks after holds grow, beside what rate and state says."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stickslip.answers import Answer
from stickslip.errors import InputError

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, kw_only=True, repr=False)
class Healing(Answer):
    """Peaks after holds and their growth, in the units of the run.

    Attributes
    ----------
    hold : tuple of float
        Times of rest, rising.
    relaxation, peak, slip_to_peak : tuple of float
        As `slide_hold_slide` gives them, one for each hold.
    per_decade : tuple of float
        Growth of the peak for each factor of ten in the hold, from one hold to the next.
    by_rate_and_state : float
        What rate and state says of long holds: ``b ln 10``.
    time_unit, force_unit, length_unit : str
    """

    hold: tuple[float, ...]
    relaxation: tuple[float, ...]
    peak: tuple[float, ...]
    slip_to_peak: tuple[float, ...]
    per_decade: tuple[float, ...]
    by_rate_and_state: float
    time_unit: str
    force_unit: str
    length_unit: str

    def __str__(self) -> str:
        units = f"{self.time_unit:>12}" + f"{self.force_unit:>12}" * 2 + f"{self.length_unit:>14}{self.force_unit:>14}"
        lines = [f"{'hold':>12}{'relaxation':>12}{'peak':>12}{'slip to peak':>14}{'per decade':>14}", units]
        rows = zip(self.hold, self.relaxation, self.peak, self.slip_to_peak, ("", *self.per_decade), strict=True)
        for hold, relaxation, peak, slip, growth in rows:
            grown = f"{growth:.4g}" if growth != "" else ""
            lines.append(f"{hold:>12.4g}{relaxation:>12.4g}{peak:>12.4g}{slip:>14.3g}{grown:>14}")
        expected = f"b ln 10 = {self.by_rate_and_state:.4g} {self.force_unit}"
        if self.per_decade:
            last = self.per_decade[-1]
            lines.append(
                f"healing over the last two holds: {last:.4g} {self.force_unit} per decade of hold time, "
                f"{last / self.by_rate_and_state:.2f} times what rate and state says ({expected})"
            )
        else:
            lines.append(f"rate and state says {expected} per decade of hold time; give two holds to compare")
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
    run = run.sortby("hold")
    hold, peak = run["hold"].to_numpy(), run["peak"].to_numpy()
    if np.any(np.diff(hold) <= 0):
        raise InputError("holds: two are the same; give each once")
    growth = np.diff(peak) / np.diff(np.log10(hold))
    return Healing(
        hold=tuple(hold.tolist()),
        relaxation=tuple(run["relaxation"].to_numpy().tolist()),
        peak=tuple(peak.tolist()),
        slip_to_peak=tuple(run["slip_to_peak"].to_numpy().tolist()),
        per_decade=tuple(growth.tolist()),
        by_rate_and_state=b * math.log(10.0),
        time_unit=str(run["hold"].attrs["units"]),
        force_unit=str(run["peak"].attrs["units"]),
        length_unit=str(run["slip_to_peak"].attrs["units"]),
    )

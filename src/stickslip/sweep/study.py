"""The case of a sweep of a rig: its parameters set, run and classified. Workers load this."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args

from stickslip.measure import Regime, regime
from stickslip.measure.verdict import Kind
from stickslip.model import Contacts, FromRest, FromSliding, Interface, Method, Slider, Start
from stickslip.model.drive import constant
from stickslip.model.parameters import parameter_named
from stickslip.model.rig import Rig
from stickslip.model.units import Scales, si_unit
from stickslip.simulation import simulate

KINDS: tuple[str, ...] = get_args(Kind)
"""What a regime can be; its place here is its code in the results."""
FROM_REST, FROM_SLIDING = "from rest", "sliding"
STARTS = (FROM_REST, FROM_SLIDING)
"""How a run can start: at rest with relaxed contacts, or in steady smooth sliding."""
PERTURBATION = 0.02
"""Fraction of the velocity by which the start of the master equation in smooth sliding is perturbed; contacts perturb
themselves."""


@dataclass(frozen=True, kw_only=True)
class Study:
    """What all cases of a sweep share; called with the values of its axes, it runs one.

    Parameters
    ----------
    interface, slider, velocity
        The rig, in natural units; the axes replace what they name.
    method : Contacts or MasterEquation
    start : {"from rest", "sliding"}
    distance, duration, cycles : float
        A run lasts until the drive has gone this far, for this long (natural units), and this many times as far as a
        spring of this stiffness takes for one cycle of loading, ``x_s (1 + k/K)``.
    extensions : int
        How often a run that cannot be classified is made again, twice as long.
    scales : Scales, optional
        From the units of the axes, and to those of the results; none for natural units.
    """

    interface: Interface
    slider: Slider
    velocity: float
    method: Method
    start: str
    distance: float
    duration: float
    cycles: float
    extensions: int
    scales: Scales | None

    def __call__(self, *, seed: int = 0, **values: Any) -> dict[str, float | str]:
        """Run one case; return all of `MEASURES`.

        Parameters
        ----------
        seed : int
            Of the contacts. A seed of the sweep's own making is cut to 53 bits, which a float64 keeps.
        **values
            Of the axes, in their units.
        """
        start, count = values.pop("start", self.start), values.pop("contacts", None)
        seed = seed >> 10 if seed >= 2**53 else seed
        setting = self.at(values)
        assert isinstance(setting.slider, Slider)
        method = self.method
        if isinstance(method, Contacts):
            method = Contacts(method.count if count is None else count, seed)
        distance = max(self.distance, self.cycles * (1.0 + 1.0 / setting.slider.stiffness))
        duration = max(distance / setting.velocity, self.duration)
        for extension in range(self.extensions + 1):
            drive = constant(setting.velocity, duration * 2.0**extension)
            run = simulate(
                Rig(setting.interface, setting.slider, drive), method=method, start=_beginning(start, method), long=True
            )
            seen = regime(run)
            if seen.kind != "undecided":
                break
        return self._measured(seen) | {"travel": self._in_units(drive.duration * setting.velocity, "x_s"), "seed": seed}

    def at(self, values: Mapping[str, float]) -> Rig:
        """Return the rig with its parameters at the values of the axes, in natural units."""
        setting = Rig(self.interface, self.slider, constant(self.velocity))
        for name, value in values.items():
            setting = parameter_named(name).set(setting, value / unit_of(name, self.scales)[0])
        return setting

    def _measured(self, seen: Regime) -> dict[str, float | str]:
        drive = seen.drive_velocity or math.nan
        numbers = {
            "slips": float(seen.cycles),
            "largest_velocity": drive * (math.nan if seen.largest_velocity is None else seen.largest_velocity),
        }
        for name in ("peak_to_peak", "mean_force", "period", "period_variation", "drop", "drop_variation", "trend"):
            numbers[name] = getattr(seen, name)
        inside = {name: self._in_units(value, MEASURES[name][0]) for name, value in numbers.items()}
        return {"regime": seen.kind, "reason": seen.reason} | inside

    def _in_units(self, value: float, unit: str) -> float:
        return value if self.scales is None else value * (si_unit(unit, self.scales) or (1.0, ""))[0]


def _beginning(start: str, method: Method) -> Start:
    if start == FROM_REST:
        return FromRest()
    return FromSliding() if isinstance(method, Contacts) else FromSliding(perturbation=PERTURBATION)


MEASURES: dict[str, tuple[str, str]] = {
    "regime": ("1", "regime of motion"),
    "peak_to_peak": ("f_s", "peak to peak of the spring force, per contact"),
    "mean_force": ("f_s", "mean spring force, per contact"),
    "period": ("time", "mean time from one slip to the next"),
    "period_variation": ("1", "coefficient of variation of the period"),
    "slips": ("1", "complete force drops in the time evaluated"),
    "drop": ("f_s", "mean force drop, per contact"),
    "drop_variation": ("1", "coefficient of variation of the force drops"),
    "largest_velocity": ("x_s/time", "largest velocity of the slider"),
    "trend": ("1", "force drops in the second half of the time evaluated over those in the first"),
    "travel": ("x_s", "distance that the drive went"),
    "reason": ("1", "why the regime was called so"),
    "seed": ("1", "seed of the contacts"),
}
"""What is measured of a case: natural unit, and what it is. All of it is stored."""

USUAL = ("regime", "peak_to_peak", "mean_force", "period", "slips", "largest_velocity", "travel", "reason")
"""What is in the results unless the file says otherwise."""


def unit_of(parameter: str, scales: Scales | None) -> tuple[float, str]:
    """Size and name of the unit in which the values of a parameter are kept: SI if there are scales."""
    unit = parameter_named(parameter).unit
    if parameter == "std":  # relative to the mean threshold, in either system
        return 1.0, "1" if scales else unit
    return (1.0, unit) if scales is None else si_unit(unit, scales) or (1.0, unit)

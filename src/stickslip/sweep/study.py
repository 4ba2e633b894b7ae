"""The case of a sweep of a rig: its parameters are set, and it is run and classified.

Worker processes import this module.
"""

import math
from dataclasses import dataclass, replace
from typing import Any, get_args

from stickslip.measure import regime
from stickslip.measure.kinds import Kind
from stickslip.model import FromRest, FromSliding, Rig, Slider, constant
from stickslip.model.methods import DRAWN
from stickslip.simulation import estimate, simulate

# kinds of regime; the index is the code in the results
KINDS: tuple[str, ...] = get_args(Kind)
FROM_REST, FROM_SLIDING = "from rest", "sliding"
"""Starts of a run: at rest with relaxed contacts, or in steady smooth sliding."""
# fraction of the velocity, where the master equation starts in smooth sliding; single
# contacts need no perturbation
PERTURBATION = 0.02


# results of a case that have the same name in `Regime`
_SAME = (
    "peak_to_peak",
    "mean_force",
    "period",
    "period_variation",
    "drop",
    "drop_variation",
    "trend",
)


@dataclass(frozen=True, kw_only=True)
class Study:
    """Rig and length of the runs of a sweep; called with the values of the axes, it
    runs one case.
    """

    rig: Rig
    distance: float
    duration: float
    cycles: float
    extensions: int
    long: bool = False

    def __call__(self, *, seed: int = 0, **values: Any) -> dict[str, float | str]:
        """Run one case; return all of `MEASURES`, in the rig's own units."""
        seed = seed >> 10 if seed >= 2**53 else seed
        start = values.pop("start", self.start)
        method = self.rig.method
        sliding = FromSliding(perturbation=PERTURBATION)
        if isinstance(method, DRAWN):
            method = replace(
                method, count=values.pop("contacts", method.count), seed=seed
            )
            sliding = FromSliding()
        rig = replace(
            self.rig.with_values(**values),
            method=method,
            start=FromRest() if start == FROM_REST else sliding,
        )
        velocity = rig.natural.velocity
        slider = getattr(rig.slider, "slowest", rig.slider)
        stiffness = (
            slider.stiffness
            if isinstance(slider, Slider)
            else float(slider.pulled.mean())
        )
        distance = max(self.distance, self.cycles * (1.0 + 1.0 / stiffness))
        duration = max(distance / velocity, self.duration)
        for _ in range(self.extensions + 1):
            drive = constant(velocity, duration)
            case = replace(rig, drive=drive)
            if not self.long:
                estimate(case).check(otherwise="allow it by long = true in [run]")
            seen = regime(simulate(case, long=True))
            if seen.kind != "undecided":
                break
            duration *= 2.0
        found: dict[str, float | str] = {"regime": seen.kind, "reason": seen.reason}
        found |= {name: float(getattr(seen, name)) for name in _SAME}
        found["slips"] = float(seen.cycles)
        found["travel"] = drive.duration * velocity * rig.unit("x_s")
        fastest = math.nan if seen.largest_velocity is None else seen.largest_velocity
        found["largest_velocity"] = (seen.drive_velocity or math.nan) * fastest
        if isinstance(method, DRAWN):
            found["seed"] = seed
        return found

    @property
    def start(self) -> str:
        """Start of the runs unless the start is an axis."""
        return FROM_REST if isinstance(self.rig.start, FromRest) else FROM_SLIDING


MEASURES: dict[str, tuple[str, str]] = {
    "regime": ("1", "regime of motion"),
    "peak_to_peak": ("f_s", "peak to peak of the spring force"),
    "mean_force": ("f_s", "mean spring force"),
    "period": ("time", "mean time from one slip to the next"),
    "period_variation": ("1", "coefficient of variation of the period"),
    "slips": ("1", "complete force drops in the time evaluated"),
    "drop": ("f_s", "mean force drop"),
    "drop_variation": ("1", "coefficient of variation of the force drops"),
    "largest_velocity": ("x_s/time", "largest velocity of the slider"),
    "trend": (
        "1",
        "force drops in the second half of the time evaluated over those in the first",
    ),
    "travel": ("x_s", "distance that the drive went"),
    "reason": ("1", "why the regime was called so"),
    "seed": ("1", "seed of the contacts"),
}
"""Results of a case, by name: natural unit and description. All of them are stored."""

USUAL = (
    "regime",
    "peak_to_peak",
    "mean_force",
    "period",
    "slips",
    "largest_velocity",
    "travel",
    "reason",
)
"""Results that are returned unless the file lists others."""

"""What is known of a bench besides its trace, and which quantities that allows to tell, in SI units."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from stickslip.errors import InputError, instance, number
from stickslip.fitting.events import Events
from stickslip.measure.arrays import Array
from stickslip.measure.headings import ratio
from stickslip.model.quantities import read_quantity

_UNITS = {
    "stiffness": ("N/m", "350 N/m"),
    "speed": ("m/s", "0.1 mm/s"),
    "mass": ("kg", "75.6 g"),
    "load": ("N", "20 N"),
}
_USUAL_ERROR = 0.02
"""Relative error of a value that is given without one."""

QUANTITIES: Mapping[str, tuple[str, str, tuple[str, ...]]] = {
    "contact_strength": ("N", "total contact strength N f_s", ()),
    "static_friction": ("N", "mean force before a slip, as measured", ()),
    "sliding_friction": ("N", "force of all contacts while they slide", ()),
    "interface_stiffness": ("N/m", "stiffness of all contacts together, N k", ("stiffness",)),
    "breaking_displacement": ("m", "breaking displacement x_s", ("stiffness",)),
    "speed": ("m/s", "speed of the drive", ("stiffness",)),
    "friction_coefficient": ("1", "mean force before a slip over the load, as measured", ("load",)),
    "frequency": ("Hz", "natural frequency of the slider on its spring, as given", ("stiffness", "mass")),
}
"""Unit and title of each quantity, and what must be known for it."""


@dataclass(frozen=True, kw_only=True)
class Known:
    """Values of a bench that were measured otherwise, with their standard errors, in SI units."""

    stiffness: tuple[float, float] | None = None
    speed: tuple[float, float] | None = None
    mass: tuple[float, float] | None = None
    load: tuple[float, float] | None = None

    @classmethod
    def read(cls, given: Mapping[str, object] | None) -> Known:
        """Read values as users give them: numbers in SI units, texts with a unit, or either with a standard error."""
        instance("known", given if given is not None else {}, Mapping, "a mapping, such as {'stiffness': '350 N/m'}")
        found = {}
        for name, value in (given or {}).items():
            if name not in _UNITS:
                raise InputError(f"known: {name!r}: must be one of {', '.join(_UNITS)}", "known")
            unit, example = _UNITS[name]
            pair = value if isinstance(value, tuple) and len(value) == 2 else (value, None)

            def read(one: object, name: str = name, unit: str = unit, example: str = example) -> float:
                if isinstance(one, str):
                    try:
                        one = read_quantity(one, unit, example)
                    except InputError as error:
                        raise InputError(f"known.{name} = {one!r}: {error}", f"known.{name}") from None
                return number(f"known.{name}", one, above=0, hint=f"in {unit}")

            middle = read(pair[0])
            found[name] = (middle, _USUAL_ERROR * middle if pair[1] is None else read(pair[1]))
        return cls(**found)

    def drawn(self, name: str, count: int) -> Array:
        """So many values of what is known, scattered by its error; the same each time, for what depends on it twice."""
        middle, error = getattr(self, name)
        scatter = np.random.default_rng([list(_UNITS).index(name), count]).standard_normal(count)
        return np.asarray(middle * np.exp(error / middle * scatter))

    def exact(self) -> Known:
        """The same values, taken as exact."""
        return Known(**{name: (middle, 0.0) for name, (middle, _) in self.to_dict().items()})

    def has(self, names: tuple[str, ...]) -> bool:
        """Whether all of these are known."""
        return all(getattr(self, name) is not None for name in names)

    def to_dict(self) -> dict[str, tuple[float, float]]:
        """What is known, with its errors."""
        return {name: value for name in _UNITS if (value := getattr(self, name)) is not None}


class Scale:
    """Units of a trace in SI units."""

    def __init__(self, events: Events, known: Known) -> None:
        if events.force_unit == "1":
            self.force = None if known.load is None else known.load[0]
        else:
            self.force = ratio(events.force_unit, "N") if events.force_unit else 1.0
        self.time = ratio(events.time_unit, "s") if events.time_unit else 1.0

    def of_force(self) -> float:
        """One unit of force, in N."""
        if self.force is None:
            raise InputError("fit: the force has no unit of force; give the load with a coefficient of friction")
        return self.force

    def rate(self, events: Events) -> float:
        """Loading rate in N/s."""
        return events.loading_rate * self.of_force() / (self.time or 1.0)


def rate_error(events: Events) -> float:
    """Relative error of the loading rate: half of what it drifts by from the first third to the last."""
    third = max(len(events.slopes) // 3, 1)
    return abs(float(np.median(events.slopes[-third:]) - np.median(events.slopes[:third]))) / 2.0 / events.loading_rate


def likelihood_of(events: Events, known: Known) -> Callable[[Array], Array] | None:
    """What stiffness and speed say of the stiffness ratio, ``K v = R (1 + K/(N k))``; None if they say nothing.

    Raises
    ------
    InputError
        If the force rises faster than the spring can make it.
    """
    if not known.has(("stiffness", "speed")):
        return None
    assert known.stiffness is not None
    assert known.speed is not None
    loading = Scale(events, known).rate(events)
    product = known.stiffness[0] * known.speed[0]
    error = np.hypot(known.stiffness[1] / known.stiffness[0], known.speed[1] / known.speed[0])
    error = float(np.hypot(error, rate_error(events)))
    if product * (1.0 + 3.0 * error) < loading:
        raise InputError(
            f"known: stiffness times speed is {product:.4g} N/s, but the force rises at {loading:.4g} N/s: the "
            "force cannot rise faster than stiffness times speed; check both"
        )

    def likelihood(values: Array) -> Array:
        away = np.log(product / (loading * (1.0 + values[..., 3]))) / error
        return np.asarray(np.exp(-0.5 * away**2))

    return likelihood


def quantity_of(name: str, values: Array, strength: Array, events: Events, known: Known) -> Array:
    """Draws of a quantity in SI units.

    Raises
    ------
    InputError
        If there is no such quantity, or what is known does not allow for it.
    """
    if name in ("delay", "ageing"):
        raise InputError(
            f"fit: {name}: one speed tells nothing of it but bounds; give the force at several speeds (speeds=) or "
            "after several holds (holds=)"
        )
    if name not in QUANTITIES:
        raise InputError(f"fit: {name!r}: must be one of {', '.join(QUANTITIES)}")
    missing = [need for need in QUANTITIES[name][2] if not known.has((need,))]
    if missing:
        raise InputError(
            f"fit: {name}: a force trace alone does not tell it; give {' and '.join(missing)}, as in "
            f"known={{{', '.join(f'{need!r}: {_UNITS[need][1]!r}' for need in missing)}}}"
        )
    kappa, count = values[:, 3], len(values)
    scale = Scale(events, known)
    of_load = known.drawn("load", count) if known.load is not None else np.ones(count)
    unit = of_load if events.force_unit == "1" else np.full(count, scale.of_force())
    force = strength * unit
    error = float(np.std(events.peaks)) / math.sqrt(len(events))
    before = (events.mean_peak + error * np.random.default_rng([4, count]).standard_normal(count)) * unit
    if name == "friction_coefficient":
        return np.asarray(before / of_load)
    if name == "contact_strength":
        return np.asarray(force)
    if name == "static_friction":
        return np.asarray(before)
    if name == "sliding_friction":
        return np.asarray(force * values[:, 2])
    K = known.drawn("stiffness", count)
    if name == "interface_stiffness":
        return np.asarray(K / kappa)
    if name == "breaking_displacement":
        return np.asarray(force * kappa / K)
    if name == "speed":
        rate = scale.rate(events) * np.exp(
            rate_error(events) * np.random.default_rng([5, count]).standard_normal(count)
        )
        return np.asarray(rate * (1.0 + kappa) / K)
    return np.asarray(np.sqrt(K / known.drawn("mass", count)) / (2.0 * np.pi))

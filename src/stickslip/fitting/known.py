"""What is known of a bench besides its trace, and which quantities that allows to tell, in SI units."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from stickslip.errors import InputError, instance
from stickslip.fitting.events import Events
from stickslip.measure.arrays import Array
from stickslip.measure.headings import ratio
from stickslip.model.quantities import read_value

_UNITS = {
    "stiffness": ("N/m", "350 N/m"),
    "speed": ("m/s", "0.1 mm/s"),
    "mass": ("kg", "75.6 g"),
    "load": ("N", "20 N"),
}
_USUAL_ERROR = 0.02
"""Relative error of a value that is given without one."""
Known = Mapping[str, tuple[float, float]]
"""Values of a bench that were measured otherwise, with their standard errors, in SI units."""


def read_known(given: Mapping[str, object] | None) -> Known:
    """Read values as users give them: numbers in SI units, texts with a unit, or either with a standard error."""
    instance("known", given if given is not None else {}, Mapping, "a mapping, such as {'stiffness': '350 N/m'}")
    found = {}
    for name, value in (given or {}).items():
        if name not in _UNITS:
            raise InputError(f"known: {name!r}: must be one of {', '.join(_UNITS)}", "known")
        pair = value if isinstance(value, tuple) and len(value) == 2 else (value,)
        middle, *error = (read_value(f"known.{name}", one, *_UNITS[name]) for one in pair)
        found[name] = (middle, error[0] if error else _USUAL_ERROR * middle)
    return found


def drawn(known: Known, name: str, count: int) -> Array:
    """So many values of what is known, scattered by its error: the same each time; not numbers where it is not."""
    middle, error = known.get(name, (math.nan, 0.0))
    scatter = np.random.default_rng([list(_UNITS).index(name), count]).standard_normal(count)
    return np.asarray(middle * np.exp(error / middle * scatter))


def newtons(events: Events, known: Known) -> float:
    """One unit of the force of a trace in N; of a coefficient of friction, the load."""
    size = known.get("load", (None,))[0] if events.force_unit == "1" else ratio(events.force_unit or "N", "N")
    if size is None:
        raise InputError("fit: the force has no unit of force; give the load with a coefficient of friction")
    return size


def seconds(events: Events) -> float:
    """One unit of the time of a trace in s."""
    size = ratio(events.time_unit or "s", "s")
    if size is None:
        raise InputError(f"fit: the unit of time {events.time_unit!r} is not known; read the trace with step=")
    return size


def rate_error(events: Events) -> float:
    """Relative error of the loading rate: half of what it drifts by from the first third to the last."""
    first, last = events.thirds
    return abs(last - first) / 2.0 / events.loading_rate


def likelihood_of(events: Events, known: Known) -> Callable[[Array], Array] | None:
    """What stiffness and speed say of the stiffness ratio, ``K v = R (1 + K/(N k))``; None if they say nothing."""
    if not known.keys() >= {"stiffness", "speed"}:
        return None
    (K, of_stiffness), (v, of_speed) = known["stiffness"], known["speed"]
    loading, product = events.loading_rate * newtons(events, known) / seconds(events), K * v
    error = math.hypot(of_stiffness / K, of_speed / v, rate_error(events))
    if product * (1.0 + 3.0 * error) < loading:
        raise InputError(
            f"known: stiffness times speed is {product:.4g} N/s, but the force rises at {loading:.4g} N/s: the "
            "force cannot rise faster than stiffness times speed; check both"
        )

    def likelihood(values: Array) -> Array:
        away = np.log(product / (loading * (1.0 + values[..., 3]))) / error
        return np.asarray(np.exp(-0.5 * away**2))

    return likelihood


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


def in_si(values: Array, strength: Array, events: Events, known: Known) -> dict[str, Array]:
    """Draws of all quantities, each with the errors of what it is made of; only those that what is known tells."""
    count, residual, kappa = len(values), values[:, 2], values[:, 3]

    def scattered(middle: float, error: float, seed: int) -> Array:
        return middle + error * np.random.default_rng([seed, count]).standard_normal(count)

    load, K, mass = (drawn(known, one, count) for one in ("load", "stiffness", "mass"))
    unit = load if events.force_unit == "1" and "load" in known else newtons(events, known)
    force = strength * unit
    peak = scattered(events.mean_peak, float(np.std(events.peaks)) / math.sqrt(len(events)), 4) * unit
    rate = events.loading_rate * unit / seconds(events) * np.exp(scattered(0.0, rate_error(events), 5))
    found = {
        "contact_strength": force,
        "static_friction": peak,
        "sliding_friction": force * residual,
        "interface_stiffness": K / kappa,
        "breaking_displacement": force * kappa / K,
        "speed": rate * (1.0 + kappa) / K,
        "friction_coefficient": peak / load,
        "frequency": np.sqrt(K / mass) / (2.0 * np.pi),
    }
    return {name: np.asarray(draws) for name, draws in found.items() if known.keys() >= {*QUANTITIES[name][2]}}


def refusal(name: str, known: Known) -> InputError:
    """Why a quantity cannot be told, and what would tell it."""
    if name in ("delay", "ageing"):
        return InputError(
            f"fit: {name}: one speed tells nothing of it but bounds; give the force at several speeds (speeds=) or "
            "after several holds (holds=)"
        )
    if name not in QUANTITIES:
        return InputError(f"fit: {name!r}: must be one of {', '.join(QUANTITIES)}")
    missing = [need for need in QUANTITIES[name][2] if need not in known]
    return InputError(
        f"fit: {name}: a force trace alone does not tell it; give {' and '.join(missing)}, as in "
        f"known={{{', '.join(f'{need!r}: {_UNITS[need][1]!r}' for need in missing)}}}"
    )

"""Measurements besides a trace: values of the bench, friction at several speeds and
after holds; the parameters that follow from them.
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from stickslip.arrays import units_of
from stickslip.errors import InputError, instance, sequence
from stickslip.fitting.events import Events
from stickslip.io import files
from stickslip.io.headings import ratio
from stickslip.io.table_files import read_table
from stickslip.measure.trace import Array, Trace, independent
from stickslip.model import Gaussian
from stickslip.model.quantities import read_value
from stickslip.rate_state.fitting import Estimate, least_squares

_UNITS = {
    "stiffness": ("N/m", "350 N/m"),
    "velocity": ("m/s", "0.1 mm/s"),
    "mass": ("kg", "75.6 g"),
    "load": ("N", "20 N"),
}
_USUAL_ERROR = 0.02  # relative error of a value that is given without one
Known = Mapping[str, tuple[float, float]]
"""Values of a bench that were measured otherwise, with their standard errors, in SI
units.
"""
Pairs = tuple[tuple[object, object], ...]
_FEWEST = {"speeds": 4, "holds": 3}
"""One more than the unknowns of the curve, so that an error can be found."""


def read_known(given: Mapping[str, object] | None) -> Known:
    """Read values as users give them: numbers in SI units, texts with a unit, or
    either with a standard error.
    """
    known = {} if given is None else given
    instance("known", known, Mapping, "a mapping, such as {'stiffness': '350 N/m'}")
    found = {}
    for name, value in known.items():
        if name == "speed":
            raise InputError("known: 'speed': is called 'velocity' now", "known")
        if name not in _UNITS:
            raise InputError(
                f"known: {name!r}: must be one of {', '.join(_UNITS)}", "known"
            )
        pair = value if isinstance(value, tuple) and len(value) == 2 else (value,)
        middle, *error = (
            read_value(f"known.{name}", one, *_UNITS[name]) for one in pair
        )
        found[name] = (
            middle,
            error[0] if error else _USUAL_ERROR * middle,
        )
    return found


def measured_velocity(trace: xr.Dataset, slips: int) -> Known:
    """Return the velocity of the drive, by one that was measured beside the force: of
    the drive itself, or of a slider that makes this number of slips; empty where there
    is none.
    """
    if "measured_velocity" not in trace:
        return {}
    size = ratio(units_of(trace["measured_velocity"]), "m/s")
    if size is None:
        return {}
    seen = Trace.of(trace)
    if seen.measured_velocity is not None:
        speed = np.abs(seen.measured_velocity)
        mean = float(speed.mean())
        error = float(speed.std()) / math.sqrt(independent(speed - mean))
    else:
        assert seen.drive is not None
        mean = float(seen.drive.mean())
        # The slider is behind the drive by one slip at most, at either end.
        error = mean / (math.sqrt(6.0) * slips)
    return {"velocity": (size * mean, size * error)}


def drawn(known: Known, name: str, count: int) -> Array:
    """Draws of a known quantity with its error, from a fixed seed;
    not numbers where it is not.
    """
    middle, error = known.get(name, (math.nan, 0.0))
    scatter = np.random.default_rng([list(_UNITS).index(name), count]).standard_normal(
        count
    )
    return middle * np.exp(error / middle * scatter)


def newtons(events: Events, known: Known) -> float:
    """One unit of the force of a trace in N; of a coefficient of friction, the load."""
    size = (
        known.get("load", (None,))[0]
        if events.force_unit == "1"
        else ratio(events.force_unit or "N", "N")
    )
    if size is None:
        raise InputError(
            "fit: the force has no unit of force; give the load with a coefficient of "
            "friction"
        )
    return size


def seconds(events: Events) -> float:
    """One unit of the time of a trace in s."""
    size = ratio(events.time_unit or "s", "s")
    if size is None:
        raise InputError(
            f"fit: the unit of time {events.time_unit!r} is not known; read the trace "
            "with step="
        )
    return size


def likelihood_of(events: Events, known: Known) -> Callable[[Array], Array]:
    """Likelihood of the stiffness ratio by stiffness and speed,
    ``K v = R (1 + K/(N k))``: 1 if they are not known.
    """
    if not known.keys() >= {"stiffness", "velocity"}:
        return lambda values: np.ones(len(values))
    K, of_stiffness = known["stiffness"]
    v, of_speed = known["velocity"]
    loading = events.loading_rate * newtons(events, known) / seconds(events)
    product = K * v
    error = math.hypot(of_stiffness / K, of_speed / v, events.rate_error)
    if product * (1.0 + 3.0 * error) < loading:
        raise InputError(
            f"known: stiffness times velocity is {product:.4g} N/s, but the force "
            f"rises at {loading:.4g} N/s: the "
            "force cannot rise faster than stiffness times velocity; check both"
        )

    def away(values: Array) -> Array:
        return np.log(product / (loading * (1.0 + values[..., 3]))) / error

    return lambda values: np.exp(-0.5 * away(values) ** 2)


QUANTITIES: Mapping[str, tuple[str, str, tuple[str, ...]]] = {
    "contact_strength": ("total contact strength N f_s", "N", ()),
    "static_friction": ("mean force before a slip, as measured", "N", ()),
    "sliding_friction": ("force of all contacts while they slide", "N", ()),
    "interface_stiffness": (
        "stiffness of all contacts together, N k",
        "N/m",
        ("stiffness",),
    ),
    "breaking_displacement": ("breaking displacement x_s", "m", ("stiffness",)),
    "speed": ("speed of the drive", "m/s", ("stiffness",)),
    "friction_coefficient": (
        "mean force before a slip over the load, as measured",
        "1",
        ("load",),
    ),
    "frequency": (
        "natural frequency of the slider on its spring, as given",
        "Hz",
        ("stiffness", "mass"),
    ),
    "delay": ("delay of re-attachment", "s", ("speeds",)),
}
"""Title and unit of each quantity, and the values that must be known for it."""


def in_si(
    values: Array, strength: Array, events: Events, known: Known
) -> dict[str, Array]:
    """Draws of all quantities, each with the errors of its factors; only
    those that follow from known values.
    """
    count = len(values)
    residual = values[:, 2]
    kappa = values[:, 3]

    def scattered(middle: float, error: float, seed: int) -> Array:
        return middle + error * np.random.default_rng([seed, count]).standard_normal(
            count
        )

    load, K, mass = (drawn(known, one, count) for one in ("load", "stiffness", "mass"))
    unit = (
        load if events.force_unit == "1" and "load" in known else newtons(events, known)
    )
    force = strength * unit
    peak = (
        scattered(
            events.mean_peak, float(np.std(events.peaks)) / math.sqrt(len(events)), 4
        )
        * unit
    )
    rate = (
        events.loading_rate
        * unit
        / seconds(events)
        * np.exp(scattered(0.0, events.rate_error, 5))
    )
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
    return {
        name: draws
        for name, draws in found.items()
        if known.keys() >= {*QUANTITIES[name][2]}
    }


def refusal(name: str, known: Known) -> InputError:
    """Why a quantity cannot be determined, and values that would determine it."""
    if name in ("delay", "ageing"):
        return InputError(
            f"fit: {name}: one speed gives bounds only; give the force at several "
            "speeds (speeds=) or "
            "after several holds (holds=)"
        )
    if name not in QUANTITIES:
        return InputError(
            f"fit: {name!r}: must be one of {', '.join(list(QUANTITIES)[:-1])}"
        )
    missing = [need for need in QUANTITIES[name][2] if need not in known]
    return InputError(
        f"fit: {name}: a force trace alone does not give it; give "
        f"{' and '.join(missing)}, as in "
        f"known={{{', '.join(f'{need!r}: {_UNITS[need][1]!r}' for need in missing)}}}"
    )


class Constraint(NamedTuple):
    """Result of readings besides the trace: a number with its error, in words, and
    draws of what follows from it.
    """

    #: in m/s, the speed at which friction halves; or the growth of static friction per
    #: decade of rest
    value: Estimate
    words: str
    #: of the delay, in s, in the order of the draws of the fit
    draws: Array = np.empty(0)


def half_speed_of(speeds: ArrayLike, forces: ArrayLike) -> tuple[Estimate, float]:
    """Half-speed, and misfit over the range, of ``F = stays + falls/(1 + v/v_h)``,
    neither below 0.
    """
    v = np.asarray(speeds)
    F = np.asarray(forces)
    size = float(np.abs(F).max())
    slowest = float(v.min())
    fastest = float(v.max())
    low = np.array([slowest / 80.0, 0.0, 0.0])
    high = np.array([80.0 * fastest, 1e3 * size, size])
    starts = [
        np.array([half, float(np.ptp(F)), float(F.min())])
        for half in np.geomspace(slowest, fastest, 5)
    ]
    found = least_squares(
        lambda one: one[2] + one[1] / (1.0 + v / one[0]),
        F,
        starts,
        low,
        high,
    )
    half, falls, _ = found.estimates()
    if not (falls > 1e-6 * size and slowest / 20.0 < half < 20.0 * fastest):
        raise InputError(
            f"speeds: the force, {F[np.argmin(v)]:.4g} N at {slowest:.3g} m/s and "
            f"{F[np.argmax(v)]:.4g} N at "
            f"{fastest:.3g} m/s, does not show at which speed it halves; measure over "
            "a wider range",
            "speeds",
        )
    return half, found.misfit


def delays_of(values: Array, displacement: Array, speeds: Pairs) -> Constraint:
    """The delay of each draw: mean rupture margin of a newborn contact over the
    half-speed.

    A contact is attached while the slider goes its margin, and detached for the delay:
    the friction that attached contacts add halves where the two take equal times.
    Breaking displacements are in m.
    """
    v, F = _pairs("speeds", speeds, "m/s", "0.1 mm/s")
    half, misfit = half_speed_of(v, F)
    margins = [
        Gaussian(mean=1.0 - residual, std=std).positive()
        for std, residual in values[:, 1:3].tolist()
    ]
    mean = np.array([margin.moment(1) for margin in margins])
    scatter = np.random.default_rng([6, len(mean)]).standard_t(len(F) - 3, len(mean))
    words = (
        f"that of attached contacts halves at {half.words('m/s')}; misfit "
        f"{100 * misfit:.2g} % of the range"
    )
    draws = mean * displacement / half * np.exp(half.error / half * scatter)
    return Constraint(half, f"From friction at several speeds: {words}", draws)


def strengthening_of(holds: Pairs) -> Constraint:
    """Straight line of static friction, over that of the shortest, over the
    logarithm of the time of rest before.
    """
    t, F = _pairs("holds", holds, "s", "10 s")
    (slope, _), covariance = np.polyfit(
        np.log10(t),
        F / F[np.argmin(t)],
        1,
        cov=True,
    )
    growth = Estimate(slope, math.sqrt(covariance[0, 0]))
    # Student's t, 5 % two-sided
    clear = growth > float(stdtrit(len(F) - 2, 0.975)) * growth.error
    words = (
        f"{(growth * 100.0).words('%')} per decade of rest: "
        f"{'contacts age' if clear else 'no ageing is seen'}"
    )
    return Constraint(growth, f"From the holds: static friction changes by {words}")


def _pairs(place: str, given: object, unit: str, example: str) -> tuple[Array, Array]:
    """Pairs of numbers in SI units, or texts with units, of something and a force;
    of the former enough for a curve.
    """
    hint = f"pairs, such as ({example!r}, '12 N')"
    rows = [sequence(place, pair, hint) for pair in sequence(place, given, hint)]
    if any(len(row) != 2 for row in rows):
        raise InputError(f"{place}: must be {hint}", place)
    found = np.array(
        [
            (
                read_value(place, x, unit, example),
                read_value(place, F, "N", "12 N"),
            )
            for x, F in rows
        ]
    )
    if (count := np.unique(found[:, 0]).size) < _FEWEST[place]:
        raise InputError(
            f"{place}: {count} are different; at least {_FEWEST[place]} are needed",
            place,
        )
    return found[:, 0], found[:, 1]


def read_pairs(path: Path | None, unit: str) -> Pairs:
    """Two columns of a table: speeds or times, and forces, in the units of their
    headings, or in SI units.
    """
    if path is None:
        return ()
    raw = files.read(path, "table of two columns", largest=1_000_000)
    try:
        table = read_table(raw)
        sizes = [
            ratio(table.headings[i].unit or si, si) or math.nan
            for i, si in zip(table.numeric, (unit, "N"), strict=False)
        ]
        if len(table.numeric) != 2 or not np.isfinite(sizes).all():
            raise InputError(
                f"needs two columns of numbers, in {unit} and N; there are "
                f"{table.listed()}"
            )
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    x, F = table.read(table.numeric).values()
    rows = np.column_stack([x, F]) * sizes
    return tuple(map(tuple, rows.tolist()))

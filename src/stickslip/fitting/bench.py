"""Measurements besides a trace: values of the bench, friction at several speeds and
after holds; and the parameters that follow from them.
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
_USUAL_ERROR = 0.02  # relative error of a value that is given without an error
Known = Mapping[str, tuple[float, float]]
"""Values of a bench that are known from other measurements, with their standard errors,
in SI units.
"""
Pairs = tuple[tuple[object, object], ...]
_FEWEST = {"speeds": 4, "holds": 3}
"""Fewest pairs: one more than the unknowns of the curve, to have an error."""


def read_known(given: Mapping[str, object] | None) -> Known:
    """Return the known values that a user gives: numbers in SI units, texts with a
    unit, or either with a standard error.
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
    """Return the velocity of the drive from the velocity that a trace holds: of the
    drive itself, or of a slider that makes this number of slips; empty if it holds
    none.
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
        # at either end, the slider is behind the drive by at most one slip
        error = mean / (math.sqrt(6.0) * slips)
    return {"velocity": (size * mean, size * error)}


def drawn(known: Known, name: str, count: int) -> Array:
    """Return draws of a known quantity with its error, from a fixed seed; NaN if it is
    not known.
    """
    middle, error = known.get(name, (math.nan, 0.0))
    scatter = np.random.default_rng([list(_UNITS).index(name), count]).standard_normal(
        count
    )
    return middle * np.exp(error / middle * scatter)


def newtons(events: Events, known: Known) -> float:
    """Return the unit of the force of a trace in N; for a coefficient of friction, the
    load.
    """
    unit = events.force_unit or "N"
    if unit == "1":
        if "load" not in known:
            raise InputError("fit: a coefficient of friction needs the load; give it")
        return known["load"][0]
    size = ratio(unit, "N")
    if size is None:
        raise InputError(
            f"fit: the force is in {unit}, which is no unit of force; give the force "
            f"of one {unit} (--scale, or after the column: force='2:6.5 N')"
        )
    return size


def seconds(events: Events) -> float:
    """Return the unit of the time of a trace in s."""
    size = ratio(events.time_unit or "s", "s")
    if size is None:
        raise InputError(
            f"fit: the unit of time {events.time_unit!r} is not known; read the trace "
            "with step="
        )
    return size


def likelihood_of(events: Events, known: Known) -> Callable[[Array], Array]:
    """Return the likelihood, as a function of the parameters, of the stiffness ratio
    from known stiffness and speed, ``K v = R (1 + K/(N k))``; 1 if they are not known.
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
"""Title and unit of each quantity, and the known values that it needs."""


def in_si(
    values: Array, strength: Array, events: Events, known: Known
) -> dict[str, Array]:
    """Return draws, in SI units, of all quantities that follow from the known values,
    with the errors of these.
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
    """Return the error that explains why a quantity cannot be determined, and which
    values would determine it.
    """
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
    """Result of readings besides the trace: a number with its error, its text, and
    draws of the delay that follows from it.
    """

    #: speed at which friction halves, in m/s; or growth of static friction per decade
    #: of rest
    value: Estimate
    words: str
    #: draws of the delay, in s, in the order of the draws of the fit
    draws: Array = np.empty(0)


def half_speed_of(speeds: ArrayLike, forces: ArrayLike) -> tuple[Estimate, float]:
    """Return half-speed ``v_h``, and misfit over the range, of a fit of
    ``F = stays + falls/(1 + v/v_h)``, where both forces are at least 0.
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
    """Return the delay of each draw: the mean rupture margin of a newborn contact over
    the half-speed.

    A contact is attached while the slider moves by its margin, and detached for the
    delay: the friction of attached contacts halves where the two times are equal.
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
    """Return the growth of static friction, over that after the shortest hold, per
    decade of the hold time, from a straight line.
    """
    t, F = _pairs("holds", holds, "s", "10 s")
    (slope, _), covariance = np.polyfit(
        np.log10(t),
        F / F[np.argmin(t)],
        1,
        cov=True,
    )
    growth = Estimate(slope, math.sqrt(covariance[0, 0]))
    # significant at 5 % by Student's t, two-sided
    clear = growth > float(stdtrit(len(F) - 2, 0.975)) * growth.error
    words = (
        f"{(growth * 100.0).words('%')} per decade of rest: "
        f"{'contacts age' if clear else 'no ageing is seen'}"
    )
    return Constraint(growth, f"From the holds: static friction changes by {words}")


def _pairs(place: str, given: object, unit: str, example: str) -> tuple[Array, Array]:
    """Return pairs of a quantity and a force, given as numbers in SI units or texts
    with units; `InputError` if there are too few for a curve.
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
    """Return the two columns of a table, speeds or times and forces, as pairs in SI
    units.
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

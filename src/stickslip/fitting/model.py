"""The model that is fitted, its prior, and synthetic traces with known parameters.

It is the limit of slow driving of a slider whose broken contacts slide with a residual
force, and re-attach when the slider stops. Six dimensionless parameters describe its
slips; forces are in units of the total contact strength ``N f_s``.
"""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
import xarray as xr

from stickslip.arrays import Range, labelled
from stickslip.errors import InputError, instance, number, pair, refused, whole
from stickslip.measure.trace import Array
from stickslip.model.records import Number, Record

# version of the results of `simulate`: cached tables of other versions are not used
VERSION = 2

# drops below this fraction of the peak are not slips, in traces and in simulations
FLOOR = 0.01

SLIPS = 384  # number of slips of each simulated series in the table

# a simulation is given up after each contact has broken this many times per slip
_PER_SLIP = 3

_SAMPLES_OF_A_SLIP = 0.4  # duration of a slip in a synthetic trace, in samples


class Unknown(NamedTuple):
    """A parameter of the model, with the bounds of all priors, and whether its prior is
    logarithmic.
    """

    key: str
    title: str
    least: float
    most: float
    decades: bool = False


UNKNOWNS = (
    Unknown("contacts", "effective number of contacts N", 2.0, 5000.0, decades=True),
    Unknown(
        "threshold_std",
        "standard deviation of the thresholds, over their mean",
        0.0,
        2.0,
    ),
    Unknown(
        "sliding_force",
        "force of a sliding contact, over its mean threshold",
        0.0,
        0.99,
    ),
    Unknown(
        "stiffness_ratio",
        "stiffness of the driving spring over that of the interface",
        1e-4,
        1e3,
        decades=True,
    ),
    Unknown(
        "damping_ratio", "damping ratio of the slider on the driving spring", 0.0, 0.99
    ),
    Unknown(
        "slip_to_slip_scatter", "scatter of the thresholds from slip to slip", 0.0, 1.0
    ),
)
KEYS = tuple(unknown.key for unknown in UNKNOWNS)
_DECADES = np.array([unknown.decades for unknown in UNKNOWNS])


@dataclass(frozen=True, kw_only=True)
class Prior:
    """Prior of the parameters: each is uniform over its range, two of them in their
    logarithms.

    The parameters are those of `stickslip.fitting.UNKNOWNS`: effective number of
    contacts and ``K/(N k)``, uniform in their logarithms; standard deviation of the
    thresholds and force of a sliding contact, over the mean threshold; damping ratio on
    the driving spring; scatter of the thresholds from slip to slip.
    """

    contacts: Range = (5.0, 500.0)
    threshold_std: Range = (0.02, 0.7)
    sliding_force: Range = (0.0, 0.95)
    stiffness_ratio: Range = (0.002, 3.16)
    damping_ratio: Range = (0.02, 0.98)
    slip_to_slip_scatter: Range = (0.0, 0.3)

    def __post_init__(self) -> None:
        for one in UNKNOWNS:
            place = f"Prior.{one.key}"
            given = getattr(self, one.key)
            hint = "two numbers, the first below the second"
            low, high = (
                number(place, end, at_least=one.least, at_most=one.most)
                for end in pair(place, given, hint)
            )
            if low >= high:
                raise refused(place, given, f"must be {hint}")

    def _ends(self) -> Array:
        """Return the ends of the ranges, as decadic logarithms for two parameters."""
        return _in_decades(np.array([getattr(self, key) for key in KEYS]).T)

    def values(self, part: Array) -> Array:
        """Return the parameters at fractions of their ranges, along the last axis."""
        low, high = self._ends()
        found = np.array(low + (high - low) * part)
        found[..., _DECADES] = 10.0 ** found[..., _DECADES]
        return found

    def parts(self, values: Array) -> Array:
        """Return parameters as fractions of their ranges, along the last axis."""
        low, high = self._ends()
        return np.asarray((_in_decades(values) - low) / (high - low), dtype=float)


def _in_decades(values: Array) -> Array:
    found = np.array(values, dtype=float)
    found[..., _DECADES] = np.log10(found[..., _DECADES])
    return found


def simulate(
    values: Array, count: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Simulate up to `count` slips; return their peaks and troughs, in units of the
    total contact strength. There are fewer if the model hardly slips.
    """
    from stickslip.kernels.arrest import Arrest, slips
    from stickslip.kernels.tournament import tournaments

    contacts = max(round(float(values[0])), 1)
    model = Arrest(contacts, *(float(value) for value in values[1:]))
    peaks = np.empty(count)
    troughs = np.empty(count)
    most = math.ceil(_PER_SLIP * contacts * count)
    queue = tournaments(np.full((1, contacts), np.inf))[0]
    found = slips(model, FLOOR, most, rng, peaks, troughs, queue)
    return peaks[:found], troughs[:found]


@dataclass(frozen=True, kw_only=True)
class Bench(Record):
    """Loading and recording of a synthetic trace."""

    #: total contact strength
    strength: Annotated[float, Number(above=0, hint="in N")] = 15.0
    #: rise of the force between slips
    loading_rate: Annotated[float, Number(above=0, hint="in N/s")] = 0.5
    samples: Annotated[float, Number(above=2)] = 50.0  #: mean number per slip
    #: standard deviation of white noise, over the mean peak
    noise: Annotated[float, Number(at_least=0)] = 0.002


def synthetic_trace(
    *,
    contacts: float = 20.0,
    threshold_std: float = 0.25,
    sliding_force: float = 0.5,
    stiffness_ratio: float = 0.05,
    damping_ratio: float = 0.2,
    slip_to_slip_scatter: float = 0.1,
    slips: int = 150,
    bench: Bench = Bench(),
    seed: int = 0,
) -> xr.Dataset:
    """Return a synthetic trace with known parameters: from rest, sampled, with noise.

    The parameters are those of `Prior`; `slips` is the number of slips. The Dataset
    holds `spring_force` in N along `time` in s. Parameters with which there are hardly
    any slips are refused.

    Examples
    --------
    >>> from stickslip.fitting import pick_events, synthetic_trace
    >>> trace = synthetic_trace(slips=100)
    >>> len(pick_events(trace)) > 80
    True
    """
    truth = (
        contacts,
        threshold_std,
        sliding_force,
        stiffness_ratio,
        damping_ratio,
        slip_to_slip_scatter,
    )
    values = np.array(
        [
            number(one.key, value, at_least=one.least, at_most=one.most)
            for one, value in zip(UNKNOWNS, truth, strict=True)
        ]
    )
    slips = whole("slips", slips, at_least=2, at_most=100_000)
    instance("bench", bench, Bench, "a Bench(...)")
    rng = np.random.default_rng(whole("seed", seed, at_least=0))
    peaks, troughs = simulate(values, slips, rng)
    if peaks.size < slips:
        raise InputError(
            f"only {peaks.size} of {slips} slips: stick-slip is rare here; "
            "take a softer spring"
        )
    strength = bench.strength
    rate = bench.loading_rate
    step = strength * float((peaks[1:] - troughs[:-1]).mean()) / rate / bench.samples
    return sampled(
        strength * peaks,
        strength * troughs,
        rate,
        step,
        bench.noise * strength * float(peaks.mean()),
        rng,
    )


def sampled(
    peaks: Array,
    troughs: Array,
    rate: float,
    step: float,
    noise: float,
    rng: np.random.Generator,
) -> xr.Dataset:
    """Return a sampled sawtooth with these peaks and troughs, and noise, starting at
    zero force; in N and s.
    """
    ends = np.append(0.0, troughs[:-1])
    rises = (peaks - ends) / rate
    falls = np.full(peaks.size, _SAMPLES_OF_A_SLIP * step)
    knots = np.append(0.0, np.column_stack([rises, falls]).cumsum())
    force = np.append(0.0, np.column_stack([peaks, troughs]))
    time = np.arange(0.0, knots[-1], step)
    values = np.interp(time, knots, force) + noise * rng.standard_normal(time.size)
    return xr.Dataset(
        {"spring_force": labelled("force", "time", values, "N")},
        {"time": labelled("time", "time", time, "s")},
        {"source": "synthetic trace"},
    )

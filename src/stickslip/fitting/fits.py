"""`fit`: parameters of the interface behind a measured force trace, with intervals."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray as xr

from stickslip.answers import Answer, plain
from stickslip.errors import InputError, instance, sequence, whole
from stickslip.fitting import bench
from stickslip.fitting.events import Events, check, pick_events
from stickslip.fitting.inference import EDGE, Sample, infer
from stickslip.fitting.model import KEYS, UNKNOWNS, Prior, sampled, simulate
from stickslip.fitting.rigs import rig_of
from stickslip.fitting.series_table import DRAWS, Observation, table
from stickslip.fitting.summary import FITTED, HELD_OUT, NAMES
from stickslip.measure.trace import Array
from stickslip.model.rig import Rig
from stickslip.progress import Progress, reporting
from stickslip.rate_state.fitting import Estimate
from stickslip.words import engineering

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POSTERIOR = 300  # number of draws of a fit
_TITLES = {one.key: (one.title, "1") for one in UNKNOWNS} | {
    key: row[:2] for key, row in bench.QUANTITIES.items()
}
_IDENTIFIED = 0.5  # largest width of an interval, over that of the prior, to identify
_WEAK = 0.7  # largest width of a weak one
# an interval with a larger ratio of its ends, a factor of three either way, does not
# identify an order of magnitude
_WIDE = 10.0
_AT_BOUND = 0.1  # fraction of draws near a bound of the prior ...
_NEAR = 0.02  # ... within this fraction of its range
LOW = 0.02  # statistics with smaller p-values are listed


@dataclass(frozen=True, kw_only=True)
class FittedInterval:
    """Median and 90 % interval of a quantity, and whether the trace determines it."""

    key: str
    title: str
    unit: str
    low: float  #: quantile of 5 %
    median: float  #: quantile of 50 %
    high: float  #: quantile of 95 %

    #: By the width: "identified" below .5, "weak" below .7, else "not identified". A
    #: parameter with a logarithmic prior is at best weak if the ends of its interval
    #: differ by more than a factor of ten. "at a bound" if a tenth of the draws lie
    #: within 2 % of an end of the prior. None for a quantity that is not a parameter of
    #: the model.
    verdict: str | None = None

    #: the three quantiles as fractions of the range of the prior
    parts: tuple[float, ...] | None = None
    #: width of the interval over that of the prior, logarithmic if the prior is
    width: float | None = None

    @classmethod
    def of(cls, key: str, draws: Array, parts: Array | None = None) -> FittedInterval:
        """Make an interval from draws of a quantity; for a parameter, `parts` are the
        draws as fractions of the range of the prior.
        """
        title, unit = _TITLES[key]
        low, median, high = np.quantile(draws, (0.05, 0.5, 0.95)).tolist()
        found = cls(
            key=key,
            title=title,
            unit=unit,
            low=low,
            median=median,
            high=high,
        )
        if parts is None:
            return found
        within = tuple(np.quantile(parts, (0.05, 0.5, 0.95)).tolist())
        width = (within[2] - within[0]) / 0.9
        verdict = "not identified"
        if (
            max(float((parts < _NEAR).mean()), float((parts > 1 - _NEAR).mean()))
            > _AT_BOUND
        ):
            verdict = "at a bound"
        elif width < _IDENTIFIED and not (
            UNKNOWNS[KEYS.index(key)].decades and high > _WIDE * low
        ):
            verdict = "identified"
        elif width < _WEAK:
            verdict = "weak"
        return replace(found, parts=within, width=width, verdict=verdict)

    def __str__(self) -> str:
        for digits in (2, 3, 4):  # until the ends differ
            low, median, high = (
                engineering(value, self.unit, digits)
                for value in (self.low, self.median, self.high)
            )
            if low != high:
                break
        wide = 0.0 < self.low * _WIDE < self.high
        factor = (
            f", to a factor {math.sqrt(self.high / self.low):.2g} either way"
            if wide
            else ""
        )
        return f"{median} ({low} to {high}){factor}"


@dataclass(frozen=True, kw_only=True, repr=False)
class Fit(Answer):
    """The interface behind a trace: draws of its parameters.

    It prints as its short text.
    """

    events: Events  #: the slips that were fitted
    prior: Prior  #: ranges of the parameters
    #: (draws, 6): equally likely parameters, in the order of
    #: `stickslip.fitting.UNKNOWNS`
    values: Array
    strength: Array  #: total contact strength of each draw, in the unit of the force
    predicted: Array  #: (draws, 20): statistics of a simulated series of each draw
    known: bench.Known  #: values known from other measurements
    #: the weighted draws from which `values` were resampled
    sample: Sample
    notes: tuple[str, ...]  #: for the reader
    delays: bench.Constraint | None = None  #: delay, from friction at other speeds
    strengthening: bench.Constraint | None = None  #: ageing, from holds

    def __len__(self) -> int:
        return len(self.values)

    @property
    def parameters(self) -> tuple[FittedInterval, ...]:
        """Intervals of the six parameters of the model, each with its verdict."""
        return tuple(self[key] for key in KEYS)

    @property
    def quantities(self) -> tuple[FittedInterval, ...]:
        """All quantities that follow from known values, in SI units."""
        if self.events.force_unit == "1" and "load" not in self.known:
            return ()
        return tuple(
            FittedInterval.of(key, draws) for key, draws in self._in_si().items()
        )

    def __getitem__(self, key: str) -> FittedInterval:
        """Return the interval of a parameter, or of a quantity in SI units."""
        parts = (
            self.prior.parts(self.values)[:, KEYS.index(key)] if key in KEYS else None
        )
        return FittedInterval.of(key, self.draws(key), parts)

    def draws(self, key: str) -> Array:
        """Return equally likely values of a parameter, or of a quantity in SI units.

        Raises `InputError` if there is none of that name, or if the known values do not
        determine it.
        """
        if key in KEYS:
            return self.values[:, KEYS.index(key)]
        if key not in (found := self._in_si()):
            raise bench.refusal(key, self.known)
        return found[key]

    def _in_si(self) -> dict[str, Array]:
        """Return draws of all quantities that the known values determine."""
        found = bench.in_si(self.values, self.strength, self.events, self.known)
        return found | ({"delay": self.delays.draws} if self.delays else {})

    def series(
        self, row: int, count: int, rng: np.random.Generator
    ) -> tuple[Array, Array]:
        """Simulate a series of slips of one draw; return its peaks and troughs, in the
        unit of the force.
        """
        peaks, troughs = simulate(self.values[row], count, rng)
        return self.strength[row] * peaks, self.strength[row] * troughs

    @property
    def from_the_centre(self) -> list[int]:
        """Indices of the draws, sorted by their distance from the medians."""
        parts = self.prior.parts(self.values)
        found: list[int] = np.argsort(
            ((parts - np.median(parts, axis=0)) ** 2).sum(axis=1)
        ).tolist()
        return found

    def simulated(self, slips: int = 40) -> xr.Dataset:
        """Return a simulated trace of the draw nearest to the medians, with loading
        rate, sampling and noise of the measured one.
        """
        nearest = self.from_the_centre[0]
        events = self.events
        rng = np.random.default_rng(nearest)
        made = sampled(
            *self.series(nearest, slips, rng),
            events.loading_rate,
            events.step,
            events.noise,
            rng,
        )
        made["spring_force"].attrs["units"] = events.force_unit
        made["time"].attrs["units"] = events.time_unit
        return made

    @property
    def test(self) -> pd.DataFrame:
        """Comparison of each statistic of the trace with those of simulated series: its
        distance from their median, in quarters of their 95 % range.

        ``p`` is two-sided; ``low`` and ``high`` are the ends of that range, ``here`` is
        the trace.
        """
        made = self.predicted
        here = self.events.statistics
        least = np.minimum((made >= here).mean(axis=0), (made <= here).mean(axis=0))
        low, middle, high = np.quantile(made, (0.025, 0.5, 0.975), axis=0)
        ends = (np.array([low, high, here]) - middle) / (
            np.maximum(high - low, 1e-12) / 4.0
        )
        p = np.clip(2.0 * least, 1.0 / len(made), 1.0)
        fitted = [name in FITTED for name in NAMES]
        columns = dict(zip(("low", "high", "here"), ends, strict=True))
        return pd.DataFrame(
            {"p": p, "fitted": fitted, **columns}, index=pd.Index(NAMES, name="name")
        )

    @property
    def p_values(self) -> dict[str, float]:
        """Two-sided probability that a statistic of a simulated series is more extreme
        than that of the trace.
        """
        return dict(self.test["p"])

    @property
    def next_experiments(self) -> tuple[str, ...]:
        """Measurements that would determine what this trace does not, with the
        quantities that they give.
        """
        return tuple(self._missing_experiments())

    def _missing_experiments(self) -> Iterator[str]:
        done = {one.key for one in self.parameters if one.verdict == "identified"}
        if not self.delays:
            yield (
                "mean friction at four speeds or more (--speeds): the delay, of which "
                "nothing is known"
            )
        if not self.strengthening:
            yield "static friction after three holds or more (--holds): ageing"
        if "stiffness_ratio" not in done:
            yield (
                "a slow push too small for a slip: the stiffness of the interface, and "
                "with it the stiffness ratio and the breaking displacement"
            )
        if "damping_ratio" not in done:
            yield "a tap on the free slider: the damping ratio"

    def rig(self, *, name: str = "fitted rig") -> Rig:
        """Return the rig of the draw nearest to the medians whose own run reproduces
        the trace; fitted values have their intervals and draws.

        Raises `InputError` if the stiffness, which gives all lengths, is not known, or
        if no draw reproduces the drops and the period of the trace.
        """
        return rig_of(self, name)

    def plot(self) -> Figure:
        """Draw the trace and a simulated one, the test of the statistics, and the
        parameters within their prior.
        """
        from stickslip import plot

        return plot.fitted(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the fit as plain numbers, texts and lists."""
        found: dict[str, Any] = plain(
            {
                "slips": len(self.events),
                "force_unit": self.events.force_unit,
                "parameters": {one.key: one for one in self.parameters},
                "quantities": {one.key: one for one in self.quantities},
                "known": self.known,
                "statistics": dict(zip(NAMES, self.events.statistics, strict=True)),
                "half_speed": self.delays
                and (self.delays.value, self.delays.value.error),
                "ageing": self.strengthening
                and (self.strengthening.value, self.strengthening.value.error),
                "effective_draws": self.sample.effective,
                **{
                    name: getattr(self.sample, name)
                    for name in ("edge", "adjusted", "invalid", "simulations")
                },
                "p_values": self.p_values,
                "notes": self.notes,
            }
        )
        return found

    def __str__(self) -> str:
        parameters = self.parameters
        quantities = self.quantities
        p = self.p_values
        width = max(len(one.title) for one in (*parameters, *quantities))
        wide = max(len(str(one)) for one in parameters)
        in_si = [
            "In SI units:",
            *(f"  {one.title:{width}}  {one!s}" for one in quantities),
        ]
        return "\n".join(
            [
                (
                    f"{self.events}\n\nParameters of the model, medians and 90 % "
                    "intervals:"
                ),
                *(
                    f"  {one.title:{width}}  {one!s:{wide}}  {one.verdict}"
                    for one in parameters
                ),
                *(in_si if quantities else ()),
                f"Series of these draws against the trace: smallest p of {len(FITTED)} "
                "fitted statistics "
                f"{min(p[name] for name in FITTED):.2g}, of {len(HELD_OUT)} others "
                f"{min(p[name] for name in HELD_OUT):.2g}",
                *(more.words for more in (self.delays, self.strengthening) if more),
                *(f"note: {note}" for note in self.notes),
                *(f"next: {words}" for words in self.next_experiments),
            ]
        )


def _notes_on(found: Fit) -> Iterator[str]:
    """Yield notes on the limits of the fit."""
    if not found.sample.adjusted:
        yield (
            "the trace lies at the edge of what the model makes "
            f"({found.sample.edge:.3g} percentile, above {EDGE:g}): the draws were not "
            "moved by a regression, and the intervals are wider than need be"
        )
    for one in found.parameters:
        if one.verdict == "at a bound":
            yield f"{one.title}: at a bound of its prior"
    if surprises := [name for name, p in found.p_values.items() if p < LOW]:
        yield (
            f"the model does not make these of the trace's {len(NAMES)} statistics (p "
            f"< {LOW:g}; by chance {LOW * len(NAMES):.1g} of them): "
            f"{', '.join(surprises)}"
        )
    if found["contacts"].high < 100:
        yield (
            "N is an effective number of independent strength units, inferred from the "
            "scatter; not a count of asperities"
        )


def fit(
    trace: xr.Dataset | Events,
    *,
    known: Mapping[str, object] | None = None,
    prior: Prior = Prior(),
    minimum_drop: float | None = None,
    after: float | None = None,
    speeds: bench.Pairs = (),
    holds: bench.Pairs = (),
    draws: int = DRAWS,
    seed: int = 0,
    progress: Progress | bool | None = None,
) -> Fit:
    """Fit the interface behind a measured stick-slip trace.

    The model is the limit of slow driving with re-attachment on arrest, with six
    dimensionless parameters. Series of slips are simulated over the whole prior,
    sampled and detected like the trace, and those similar to it are kept. The
    simulations are made once, and kept in the user's cache; they take a minute, a fit
    then takes some seconds.

    A trace alone constrains some parameters weakly and others not at all; the fit
    reports which.

    Parameters
    ----------
    trace : Dataset or Events
        A measured force, as `stickslip.read_trace` returns, or its slips.
    known : mapping, optional
        Known values of ``stiffness``, ``velocity``, ``mass``, ``load``: a number in SI
        units, a text such as ``"350 N/m"``, or either with its standard error,
        ``("350 N/m", "10 N/m")``, by default 2 %. By default, the velocity is the mean
        of that which the trace holds, of the drive or of the slider.
    prior : Prior
        Ranges of the parameters.
    minimum_drop, after : float, optional
        Smallest drop that counts as a slip, and a time before which slips are left out.
    speeds : sequence of pairs, optional
        Other speeds with the mean friction there, which give the delay.
    holds : sequence of pairs, optional
        Hold times with the static friction after them, which give ageing.
    draws : int
        Number of simulated series; `stickslip.fitting.table` simulates them beforehand,
        such as on a cluster.
    seed : int
    progress : callable or bool, optional
        A function that receives the fraction of the series that is simulated, or True
        for a bar.

    Raises
    ------
    InputError
        If the trace shows no stick-slip, or is too short; the message has the number
        that decided.

    Examples
    --------
    >>> trace = ss.read_trace("force7.txt", step=0.25)  # doctest: +SKIP
    >>> found = ss.fit(trace, known={"stiffness": "100 N/m"})  # doctest: +SKIP
    >>> found["contact_strength"]  # doctest: +SKIP
    """
    instance(
        "fit: trace",
        trace,
        (xr.Dataset, Events),
        "a Dataset, such as read_trace() returns, or its Events",
    )
    seed = whole("seed", seed, at_least=0)
    events = (
        trace
        if isinstance(trace, Events)
        else pick_events(trace, minimum_drop=minimum_drop, after=after)
    )
    given = bench.read_known(known)
    speeds = sequence("speeds", speeds, "pairs of a speed and a force")
    holds = sequence("holds", holds, "pairs of a time and a force")
    notes = list(check(events))
    if isinstance(trace, xr.Dataset) and "velocity" not in given:
        measured = bench.measured_velocity(trace, len(events))
        given = {**given, **measured}
        notes += [
            f"velocity of the drive, as measured: {Estimate(*pair).words('m/s')}"
            for pair in measured.values()
        ]
    if (stretches := events.stretches) > 1:
        notes.append(
            f"{len(events)} slips are fitted in {stretches} stretches; intervals are "
            "as wide as of one of them"
        )
    likelihood = bench.likelihood_of(events, given)
    observation = Observation.of(events)
    with reporting(progress, "simulating") as report:
        made = table(prior=prior, draws=draws, progress=report)
    sample = infer(
        made, observation, events.statistics, likelihood=likelihood, seed=seed
    )
    even = np.random.default_rng([seed, 4]).choice(
        len(sample.parts), size=POSTERIOR, p=sample.weights
    )
    parts = sample.parts[even]
    seen = [
        observation.simulate_at(prior, parts, seed=seed + 1000 + stretch)
        for stretch in range(stretches)
    ]
    predicted, mean_peak = (np.mean(each, axis=0) for each in zip(*seen, strict=True))
    valid = np.isfinite(mean_peak)
    if valid.sum() < POSTERIOR // 10:
        raise InputError(
            f"fit: only {valid.sum()} of {POSTERIOR} posterior draws reproduce this "
            "kind of trace: the model does not "
            "describe it"
        )
    found = Fit(
        events=events,
        prior=prior,
        values=prior.values(parts[valid]),
        strength=events.mean_peak / mean_peak[valid],
        predicted=predicted[valid],
        known=given,
        sample=sample,
        notes=(),
        strengthening=bench.strengthening_of(holds) if holds else None,
    )
    found = replace(found, notes=(*notes, *_notes_on(found)))
    if not speeds:
        return found
    displacement = found.draws("breaking_displacement")
    return replace(found, delays=bench.delays_of(found.values, displacement, speeds))

"""Fits of known true values: how often a 90 % interval contains the truth, and the fit
of a measured trace.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stickslip import fit, read_trace
from stickslip.errors import InputError
from stickslip.fitting import FITTED, Bench, Fit, Prior, pick_events, synthetic_trace
from stickslip.fitting.inference import infer
from stickslip.fitting.model import KEYS
from stickslip.fitting.series_table import Observation, table
from stickslip.fitting.summary import NAMES
from stickslip.kernels.turning_points import Recording
from stickslip.paper import Claim, Measured
from stickslip.paper.figure import between
from verification.sources import COMPUTING
from verification.study import Study, finding

FORCE7 = Path(__file__).parents[1] / "tests" / "data" / "guldstrand_force7.txt"
_BINS = 10
_SBC = 21.7
"""99 % quantile of chi squared with 9 degrees of freedom."""


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """Fits of many known truths.

    Attributes
    ----------
    inside : (truths, 6) array
        Whether the 90 % interval held the truth.
    ranks : (truths, 6) array
        Part of the draws below it.
    medians, truths : (truths, 6) array
        Parts of the ranges of the prior.
    widths : (truths, 6) array
        Of the 90 % intervals, over that of the prior's range.
    edge : int
        How many lay at the edge of what the model makes.
    refused : Counter
        How many truths were refused a fit, by reason.
    """

    inside: NDArray[np.bool_]
    ranks: NDArray[np.float64]
    medians: NDArray[np.float64]
    truths: NDArray[np.float64]
    widths: NDArray[np.float64]
    edge: int
    refused: Counter[str]

    @property
    def chi2(self) -> NDArray[np.float64]:
        """Return chi squared of the ranks over ten bins, for each parameter."""
        counts = np.stack(
            [
                np.histogram(column, bins=_BINS, range=(0, 1))[0]
                for column in self.ranks.T
            ]
        )
        expected = len(self.ranks) / _BINS
        return np.asarray(((counts - expected) ** 2 / expected).sum(axis=1))

    @property
    def correlations(self) -> NDArray[np.float64]:
        """Return correlations of the medians with the truths, for each parameter."""
        return np.array(
            [
                np.corrcoef(m, t)[0, 1]
                for m, t in zip(self.medians.T, self.truths.T, strict=True)
            ]
        )

    def __str__(self) -> str:
        lines = [
            (
                f"{len(self.inside)} truths, {self.edge} at the edge, pooled coverage "
                f"{self.inside.mean():.3f}"
            )
        ]
        rows = zip(
            KEYS,
            self.inside.mean(axis=0),
            self.widths.mean(axis=0),
            self.correlations,
            self.chi2,
            strict=True,
        )
        lines += [
            f"{k:16} coverage {c:.2f} width {w:.2f} corr {r:.2f} chi2 {x:.1f}"
            for k, c, w, r, x in rows
        ]
        lines += [
            f"refused {count}: {why}" for why, count in self.refused.most_common()
        ]
        return "\n".join(lines)


def coverage_test(
    truths: int = 100,
    *,
    seed: int = 1,
    slips: int = 170,
    report: Callable[[str], None] | None = None,
) -> Coverage:
    """Fit traces of new truths from the prior, at random sampling intervals and noise,
    until a given number of traces is not refused.
    """
    prior = Prior()
    rng = np.random.default_rng(seed)
    refused: Counter[str] = Counter()
    rows: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
    edge = 0
    while len(rows) < truths:
        truth = dict(
            zip(KEYS, prior.values(rng.random(len(KEYS))).tolist(), strict=True)
        )
        samples = float(np.exp(rng.uniform(np.log(24), np.log(100))))
        noise = float(rng.uniform(0.0, 0.006))
        try:
            trace = synthetic_trace(
                **truth,
                slips=slips,
                bench=Bench(samples=samples, noise=noise),
                seed=int(rng.integers(1 << 31)),
            )
            found = fit(trace)
        except InputError as error:
            refused[_reason(error)] += 1
            continue
        edge += not found.sample.adjusted
        rows.append(
            (prior.parts(np.array(list(truth.values()))), prior.parts(found.values))
        )
        if report is not None:
            report(f"{len(rows)} of {truths}")
    return _coverage(rows, edge, refused)


def _reason(error: InputError) -> str:
    """Return a refusal without its numbers."""
    return re.sub(r"[-+]?\d+\.?\d*(e[-+]?\d+)?", "#", str(error))[:70]


def _coverage(
    rows: list[tuple[NDArray[np.float64], NDArray[np.float64]]],
    edge: int,
    refused: Counter[str],
) -> Coverage:
    """Combine truths and draws, both as fractions of the ranges of the prior."""
    at = np.stack([truth for truth, _ in rows])
    low, middle, high = (
        np.stack([np.quantile(d, q, axis=0) for _, d in rows])
        for q in (0.05, 0.5, 0.95)
    )
    return Coverage(
        inside=(low <= at) & (at <= high),
        ranks=np.stack([(draws < truth).mean(axis=0) for truth, draws in rows]),
        medians=middle,
        truths=at,
        widths=high - low,
        edge=edge,
        refused=refused,
    )


IDEAL = Observation(
    slips=167,
    sampling=Recording(slope=3e-3, noise=0.0, resolution=0.0, drop=1e-6, rise=1e-6),
)
"""A recording without noise, sampled so finely that the smallest slip shows."""


def contraction_test(truths: int = 200, *, seed: int = 2) -> Coverage:
    """Infer new truths from ideal recordings of their slips: the most that the
    statistics can give, with no trace refused.

    A trace whose slip count depends on the detection threshold is refused a fit. Most
    of these come from stiff springs, about which the statistics tell most: without them
    the stiffness ratio is less well known.
    """
    made = table()
    rng = np.random.default_rng(seed)
    parts = rng.random((truths, len(KEYS)))
    observed = IDEAL.simulate_at(made.prior, parts, seed=seed)[0]
    seen = IDEAL.sample(made)[0]
    rows = []
    refused = Counter[str]()
    edge = 0
    for part, statistics in zip(parts, observed, strict=True):
        if not np.isfinite(statistics[0]):
            refused["fewer slips"] += 1
            continue
        try:
            sample = infer(made, IDEAL, statistics, seen=seen)
        except InputError as error:
            refused[_reason(error)] += 1
            continue
        edge += not sample.adjusted
        rows.append(
            (
                part,
                sample.parts[
                    rng.choice(len(sample.parts), size=1000, p=sample.weights)
                ],
            )
        )
    return _coverage(rows, edge, refused)


def calibration() -> tuple[Claim, ...]:
    """Check coverage and ranks on new truths."""
    found = coverage_test()
    by = dict(zip(KEYS, found.inside.mean(axis=0).tolist(), strict=True))
    return (
        finding(
            (
                "90 % intervals hold the truth as often as they say, over the "
                "parameters "
                "pooled and in each"
            ),
            between("pooled coverage", float(found.inside.mean()), 0.86, 0.94),
            *(
                between(f"coverage of {key}", value, 0.80, 0.97)
                for key, value in by.items()
            ),
            evidence=str(found),
        ),
        finding(
            "ranks of the truths among the draws are even",
            *(
                between(f"chi squared of {key}", value, 0.0, _SBC)
                for key, value in zip(KEYS, found.chi2.tolist(), strict=True)
            ),
            evidence="ten bins",
        ),
    )


def contraction() -> tuple[Claim, ...]:
    """Check the best possible information in the statistics; over the whole prior it is
    less than the bounds require.

    The bounds were chosen for a prior without series in which contacts break more than
    about 1.2 times per slip: soft springs with large slips, which tell least about the
    number of contacts. For series of at most one break per slip the widths are .20 and
    .35, the correlations .89 and .91.
    """
    found = contraction_test()
    width, corr = (
        dict(zip(KEYS, x.tolist(), strict=True))
        for x in (found.widths.mean(axis=0), found.correlations)
    )
    return (
        finding(
            "slips tell the stiffness ratio and the number of contacts",
            between("width of stiffness_ratio", width["stiffness_ratio"], 0.0, 0.28),
            between("width of contacts", width["contacts"], 0.0, 0.52),
            between(
                "correlation of stiffness_ratio", corr["stiffness_ratio"], 0.95, 1.0
            ),
            between("correlation of contacts", corr["contacts"], 0.75, 1.0),
            evidence=str(found),
        ),
    )


def _overlap(found: Fit, key: str, low: float, high: float) -> Measured:
    """Return the overlap of two intervals over the shorter of the two."""
    one = found[key]
    common = min(one.high, high) - max(one.low, low)
    return between(
        f"overlap of {key}", common / min(one.high - one.low, high - low), 0.0, 1.0
    )


def halves_predicted(
    after: float = 45.0,
) -> tuple[int, dict[str, tuple[float, float, float]]]:
    """Fit the first half of Force7; count the statistics of the second half within the
    central 95 % of the draws' predictions.
    """
    events = pick_events(read_trace(FORCE7, step=0.25), after=after)
    middle = len(events) // 2
    found = fit(events.part(0, middle))
    observed = events.part(middle, 2 * middle).statistics
    low, high = np.quantile(found.predicted, (0.025, 0.975), axis=0)
    rows = {
        name: (float(low[i]), float(observed[i]), float(high[i]))
        for i, name in enumerate(NAMES[: len(FITTED)])
    }
    return sum(a <= x <= b for a, x, b in rows.values()), rows


def measured_trace() -> tuple[Claim, ...]:
    """Fit the trace Force7: intervals, the test of the draws, and the prediction of its
    second half from its first.
    """
    found = fit(read_trace(FORCE7, step=0.25), after=45.0)
    p = found.p_values
    held_out = [p[name] for name in NAMES[len(FITTED) :]]
    count, rows = halves_predicted()
    return (
        finding(
            "intervals of Force7 overlap those of other methods",
            _overlap(found, "contacts", 6, 50),
            _overlap(found, "sliding_force", 0.63, 0.94),
            _overlap(found, "stiffness_ratio", 0.002, 0.035),
            _overlap(found, "slip_to_slip_scatter", 0.06, 0.28),
            evidence=str(found),
        ),
        finding(
            "the draws make the statistics of Force7",
            between(
                "smallest p of the fitted statistics",
                min(p[name] for name in FITTED),
                0.02,
                1.0,
            ),
            between(
                "held-out statistics with p > .02",
                sum(value > 0.02 for value in held_out),
                10,
                11,
            ),
            evidence=str(p),
        ),
        finding(
            "the first half of Force7 predicts the second",
            between("statistics within 95 %", count, 8, 9),
            evidence=str(rows),
        ),
    )


_ROOMS = (*COMPUTING, "fitting")
STUDIES = tuple(
    Study(name=name, group="Fits", title=title, run=run, rooms=_ROOMS)
    for name, title, run in (
        ("fit_coverage", "Coverage of fits on fresh truths", calibration),
        ("fit_contraction", "What slips tell of the parameters", contraction),
        ("fit_force7", "A measured stick-slip trace", measured_trace),
    )
)

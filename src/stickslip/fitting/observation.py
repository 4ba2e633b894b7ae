"""How a trace was recorded and picked, applied to simulated slips: what biases the one biases the others alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.fitting.events import LOST, PLATEAU, Events, least_rise
from stickslip.fitting.summary import NAMES, statistics
from stickslip.fitting.tables import on_all_cores
from stickslip.kernels.turning_points import Sampling, larger, observe
from stickslip.measure.arrays import Array

_AT_A_TIME = 500


@dataclass(frozen=True, kw_only=True)
class Seen:
    """What would have been measured of each of many simulated series; NaN where the trace of it would be refused."""

    statistics: Array
    mean_peak: Array  # as picked

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Which series could have been fitted."""
        return np.isfinite(self.statistics[:, 0])


@dataclass(frozen=True, kw_only=True)
class Observation:
    """How many slips of a trace were seen, and how it was sampled and picked, in units of its mean peak."""

    slips: int
    sampling: Sampling

    @classmethod
    def of(cls, events: Events) -> Observation:
        """Take it from a trace."""
        forces = (events.loading_rate * events.step, events.noise, events.resolution, events.smallest, events.rise)
        return cls(slips=len(events), sampling=Sampling(*(force / events.mean_peak for force in forces)))

    @property
    def slips_needed(self) -> int:
        """How many slips to simulate, as some are too small to be seen."""
        return 2 * self.slips + 10

    def see(
        self, count: NDArray[np.int64], peaks: NDArray[np.floating], troughs: NDArray[np.floating], *, seed: int = 0
    ) -> Seen:
        """Sample and pick many series, on all cores: (series,) counts of slips, (series, slips) peaks and troughs."""

        def look(begin: int) -> tuple[Array, Array]:
            """Pick so many series; statistics and mean peaks as picked, with what the noise adds to a peak."""
            rng, some = np.random.default_rng([seed, begin]), range(begin, min(begin + _AT_A_TIME, len(count)))
            seen = np.empty((len(some), 2, self.slips))
            whole = [self._shows(peaks[i, : count[i]], troughs[i, : count[i]], rng, seen[i - begin]) for i in some]
            found, size = np.full((len(some), len(NAMES)), np.nan), np.full(len(some), np.nan)
            if any(whole):
                P, T = seen[whole, 0], seen[whole, 1]
                found[whole], size[whole] = statistics(P, T), P.mean(axis=-1)
            return found, size

        looked = on_all_cores(look, range(0, len(count), _AT_A_TIME))
        found, size = (np.concatenate(each) for each in zip(*looked, strict=True))
        return Seen(statistics=found, mean_peak=size)

    def _shows(
        self, peaks: NDArray[np.floating], troughs: NDArray[np.floating], rng: np.random.Generator, seen: Array
    ) -> bool:
        """Sample and pick one series, as `seen`: whether as many slips are as in the trace, on a plateau of n(h)."""
        if peaks.size <= self.slips:  # the first begins the trace
            return False
        P, T = peaks.astype(float), troughs.astype(float)
        sampling = Sampling(*(float(P.mean()) * force for force in self.sampling))
        if observe(P, T, sampling, rng, seen) < self.slips:
            return False
        doubled = PLATEAU * sampling.drop
        return larger(seen[0], seen[1], doubled, least_rise(doubled, sampling.noise)) >= (1.0 - LOST) * self.slips

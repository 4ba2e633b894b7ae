"""How a trace was recorded and picked, applied to simulated slips: what biases the one biases the others alike."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.fitting.events import LOST, PLATEAU, Events, least_rise
from stickslip.fitting.summary import NAMES, statistics
from stickslip.measure.arrays import Array

_AT_A_TIME = 500


@dataclass(frozen=True, kw_only=True)
class Seen:
    """What would have been measured of each of many simulated series.

    Attributes
    ----------
    statistics : (series, 20) array
        NaN where fewer slips were seen than in the trace, or their number depends on the smallest drop so much that
        a fit would be refused: what is fitted was not.
    mean_peak : (series,) array
        Mean peak as it was picked, in the unit of the simulation.
    """

    statistics: Array
    mean_peak: Array

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Which series could have been fitted."""
        return np.isfinite(self.statistics[:, 0])


@dataclass(frozen=True, kw_only=True)
class Observation:
    """Sampling and picking of a trace, in units of its mean peak.

    Attributes
    ----------
    slips : int
        How many slips it has.
    slope : float
        Rise of the force from sample to sample between slips.
    noise, resolution, drop, rise : float
        Noise, step of the recording, and smallest drop and rise that count.
    """

    slips: int
    slope: float
    noise: float
    resolution: float
    drop: float
    rise: float

    @classmethod
    def of(cls, events: Events) -> Observation:
        """Take it from a trace."""
        size = events.mean_peak
        return cls(
            slips=len(events),
            slope=events.loading_rate * events.step / size,
            noise=events.noise / size,
            resolution=events.resolution / size,
            drop=events.smallest / size,
            rise=events.rise / size,
        )

    @property
    def slips_needed(self) -> int:
        """How many slips to simulate, as some are too small to be seen."""
        return 2 * self.slips + 10

    def see(
        self, count: NDArray[np.int64], peaks: NDArray[np.floating], troughs: NDArray[np.floating], *, seed: int = 0
    ) -> Seen:
        """Sample and pick many series, on all cores.

        Parameters
        ----------
        count : (series,) array
            How many slips there are of each.
        peaks, troughs : (series, slips) array
        seed : int
            Of the noise.
        """
        begins = range(0, len(count), _AT_A_TIME)
        found, size = np.full((len(count), len(NAMES)), np.nan), np.full(len(count), np.nan)

        def fill(begin: int) -> None:
            part = slice(begin, min(begin + _AT_A_TIME, len(count)))
            found[part], size[part] = self._see(count[part], peaks[part], troughs[part], [seed, begin])

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(fill, begins))
        return Seen(statistics=found, mean_peak=size)

    def _see(
        self,
        count: NDArray[np.int64],
        peaks: NDArray[np.floating],
        troughs: NDArray[np.floating],
        seed: list[int],
    ) -> tuple[Array, Array]:
        from stickslip.kernels.turning_points import Sampling, larger, observe

        rng = np.random.default_rng(seed)
        seen = np.empty((len(count), 2, self.slips))
        size, whole = np.full(len(count), np.nan), np.zeros(len(count), dtype=bool)
        doubled = PLATEAU * self.drop
        rise = least_rise(doubled, self.noise)
        for i, many in enumerate(count.tolist()):
            if many <= self.slips:  # the first begins the trace
                continue
            P, T = peaks[i, :many].astype(float), troughs[i, :many].astype(float)
            size[i] = mean = float(P.mean())
            scaled = (part * mean for part in (self.slope, self.noise, self.resolution, self.drop, self.rise))
            whole[i] = (
                observe(P, T, Sampling(*scaled), rng, seen[i]) == self.slips
                and larger(seen[i, 0], seen[i, 1], doubled * mean, rise * mean) >= (1.0 - LOST) * self.slips
            )
        found = np.full((len(count), len(NAMES)), np.nan)
        if whole.any():
            found[whole] = statistics(seen[whole, 0], seen[whole, 1])
            size[whole] = seen[whole, 0].mean(axis=-1)  # as picked, with what the noise adds to a peak
        return found, size

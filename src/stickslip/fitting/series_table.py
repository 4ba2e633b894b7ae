"""The table of simulated series of slips from which every fit starts, and their
observation as by the bench of a trace.

The table is made once, cached, and resumed after an interrupt. It holds the force
before and after each slip. Sampling and detection of slips are applied when a trace is
fitted, with the settings of that trace, so that one table serves all benches, and both
have the same bias.
"""

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import nullcontext, suppress
from dataclasses import asdict, dataclass
from functools import lru_cache, partial
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import instance, whole
from stickslip.fitting.events import LOST, PLATEAU, Events, least_rise
from stickslip.fitting.model import FLOOR, KEYS, SLIPS, VERSION, Prior, simulate
from stickslip.fitting.summary import unchecked_statistics
from stickslip.io import files
from stickslip.kernels.turning_points import Recording, observe, pick
from stickslip.measure.trace import Array
from stickslip.progress import Progress

DRAWS = 6_000  # default number of draws from the prior
_BLOCK = 250  # draws of a block of the table
_SHARES = 8  # blocks in which `simulate_at` simulates, each with its own random numbers
_AT_A_TIME = 500  # series observed at a time
_TIMED = 20  # draws simulated to measure the time of one
_LARGEST = 1 << 30  # most bytes of a stored block
_FIELDS = ("parts", "count", "peaks", "troughs")
"""Fields of a table that are stored for each block: all except its prior."""
Series = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class SeriesTable:
    """Simulated series of slips, drawn from a prior."""

    prior: Prior
    #: (draws, 6): parameters of each draw, as fractions of their ranges
    parts: Array
    #: number of slips of each draw; small where the model hardly stick-slips
    count: NDArray[np.int64]
    #: (draws, slips): force before each slip, in units of the total contact strength; 0
    #: beyond `count`
    peaks: Series
    troughs: Series  #: force after each slip, of the same shape

    def __len__(self) -> int:
        return len(self.count)


def folder_of(prior: Prior, slips: int, seed: int) -> Path:
    """Return the folder of the table of a prior; its name is a hash of everything that
    decides the content of the table, except its length.
    """
    instance("prior", prior, Prior, "a Prior(...)")
    cache = os.environ.get("STICKSLIP_CACHE")
    place = (
        Path(cache)
        if cache
        else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        / "stickslip"
    )
    key = json.dumps(
        [VERSION, FLOOR, KEYS, asdict(prior), slips, seed, _BLOCK],
        sort_keys=True,
    )
    return place / f"fit-{hashlib.sha256(key.encode()).hexdigest()[:16]}"


def draws_kept(prior: Prior = Prior(), slips: int = SLIPS, seed: int = 0) -> int:
    """Return the number of draws of the table of a prior that are in the cache."""
    return _BLOCK * len(list(folder_of(prior, slips, seed).glob("*.npz")))


def table(
    *,
    prior: Prior = Prior(),
    draws: int = DRAWS,
    slips: int = SLIPS,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> SeriesTable:
    """Return the table of a prior: blocks in the cache are read, and the others are
    simulated and stored there.

    If interrupted, it continues with the next block. The same prior, seed and size give
    the same table, on any number of cores. Blocks are simulated by an `executor`, such
    as ``Client.get_executor()`` of Dask; by default by threads, one per core.
    `progress` receives the fraction done.

    Examples
    --------
    >>> from stickslip.fitting import Prior, table
    >>> small = table(prior=Prior(contacts=(5, 20)), draws=250, slips=40)
    >>> len(small), small.peaks.shape
    (250, (250, 40))
    """
    draws = whole("draws", draws, at_least=100, at_most=1_000_000, hint="of the table")
    slips = whole("slips", slips, at_least=30, at_most=4_096, hint="of each draw")
    seed = whole("seed", seed, at_least=0)
    place = folder_of(prior, slips, seed)
    with suppress(OSError):  # writing a file there raises an error later
        place.mkdir(parents=True, exist_ok=True)
    paths = [place / f"{block}.npz" for block in range(-(-draws // _BLOCK))]
    blocks = {
        i: found for i, path in enumerate(paths) if (found := _read(path, prior, slips))
    }
    if missing := [i for i in range(len(paths)) if i not in blocks]:
        # compile before all threads need the kernels at once
        simulate_block(0, prior, 0, 30, seed)
        one = partial(simulate_block, prior=prior, draws=_BLOCK, slips=slips, seed=seed)
        with (
            nullcontext(executor)
            if executor is not None
            else ThreadPoolExecutor(os.cpu_count()) as pool
        ):
            for i, block in zip(missing, pool.map(one, missing), strict=True):
                blocks[i] = block
                content = BytesIO()
                np.savez(
                    content,
                    allow_pickle=False,
                    **{name: getattr(block, name) for name in _FIELDS},
                )
                files.write(paths[i], content.getvalue())
                if progress is not None:
                    progress(len(blocks) / len(paths))
    return joined([blocks[i] for i in range(len(paths))], draws)


def joined(tables: Sequence[SeriesTable], draws: int | None = None) -> SeriesTable:
    """Return tables of one prior joined into one, cut to a number of draws."""
    made = {
        name: np.concatenate([getattr(one, name) for one in tables])[:draws]
        for name in _FIELDS
    }
    return SeriesTable(prior=tables[0].prior, **made)


def simulate_block(
    block: int, prior: Prior, draws: int, slips: int, seed: int
) -> SeriesTable:
    """Simulate one block of the table; its content depends only on its number and the
    seed.
    """
    rng = np.random.default_rng([seed, block])
    return _simulated(prior, rng.random((draws, len(KEYS))), slips, rng)


@lru_cache(maxsize=1)
def seconds_per_draw() -> float:
    """Return the seconds that one core takes for a draw of the default table, measured
    once.
    """
    simulate_block(0, Prior(), 1, 30, 0)  # compile first
    begun = time.perf_counter()
    simulate_block(0, Prior(), _TIMED, SLIPS, 0)
    return (time.perf_counter() - begun) / _TIMED


def _simulated(
    prior: Prior, parts: Array, slips: int, rng: np.random.Generator
) -> SeriesTable:
    """Return simulated series of slips at given fractions of the ranges of a prior."""
    count = np.zeros(len(parts), dtype=np.int64)
    peaks, troughs = np.zeros((2, len(parts), slips), np.float32)
    for i, values in enumerate(prior.values(parts)):
        P, T = simulate(values, slips, rng)
        count[i] = P.size
        peaks[i, : P.size] = P
        troughs[i, : P.size] = T
    return SeriesTable(
        prior=prior, parts=parts, count=count, peaks=peaks, troughs=troughs
    )


def _read(path: Path, prior: Prior, slips: int) -> SeriesTable | None:
    """Return a stored block; None if it is missing or damaged."""
    try:
        with np.load(
            BytesIO(files.read(path, "table", largest=_LARGEST)), allow_pickle=False
        ) as found:
            block = SeriesTable(prior=prior, **{name: found[name] for name in _FIELDS})
    except Exception:  # a damaged file fails in many ways
        return None
    return block if block.peaks.shape == (_BLOCK, slips) else None


class Observation(NamedTuple):
    """Number of slips of a part of a trace, and the settings of its sampling and slip
    detection, in units of its mean peak.
    """

    slips: int
    sampling: Recording

    @classmethod
    def of(cls, events: Events) -> Self:
        """Return the observation of a trace."""
        rise = least_rise(events.smallest, events.noise)
        forces = (
            events.loading_rate * events.step,
            events.noise,
            events.resolution,
            events.smallest,
            rise,
        )
        return cls(
            len(events) // events.stretches,
            Recording(*(force / events.mean_peak for force in forces)),
        )

    def sample(self, table: SeriesTable, *, seed: int = 0) -> tuple[Array, Array]:
        """Sample all series of a table and detect their slips, on all cores; return
        their statistics (draws, 20) and mean peaks.

        They are NaN where such a trace would be refused, for too few slips or as the
        number of slips depends on the smallest drop.
        """

        def sampled(begin: int) -> tuple[Array, Array]:
            rng = np.random.default_rng([seed, begin])
            some = range(begin, min(begin + _AT_A_TIME, len(table)))
            series = (
                (
                    table.peaks[i, : table.count[i]],
                    table.troughs[i, : table.count[i]],
                )
                for i in some
            )
            P, T = np.stack([self._detected(*each, rng) for each in series], axis=1)
            return unchecked_statistics(P, T), P.mean(axis=-1)

        statistics_of, sizes = zip(
            *_on_all_cores(sampled, range(0, len(table), _AT_A_TIME)), strict=True
        )
        return np.concatenate(statistics_of), np.concatenate(sizes)

    def simulate_at(
        self, prior: Prior, parts: Array, *, seed: int = 0
    ) -> tuple[Array, Array]:
        """Simulate series at given fractions of the ranges of a prior, on all cores,
        and return the results of `sample`.
        """
        blocks = np.array_split(parts, max(1, min(len(parts), _SHARES)))
        slips = 2 * self.slips + 10  # some are too small to be detected

        def one(block: int) -> SeriesTable:
            return _simulated(
                prior,
                blocks[block],
                slips,
                np.random.default_rng([seed, 3, block]),
            )

        return self.sample(joined(_on_all_cores(one, range(len(blocks)))), seed=seed)

    def _detected(
        self, peaks: Series, troughs: Series, rng: np.random.Generator
    ) -> Array:
        """Return peaks and troughs of the slips detected in one sampled series, as many
        as in the trace; NaN if there are fewer, or if their number depends on the
        smallest drop.
        """
        seen = np.empty((2, self.slips))
        if peaks.size > self.slips:  # one more, as the first slip is left out
            P = peaks.astype(float)
            T = troughs.astype(float)
            sampling = Recording(*(float(P.mean()) * force for force in self.sampling))
            found = observe(P, T, sampling, rng, seen)
            doubled = PLATEAU * sampling.drop
            rise = least_rise(doubled, sampling.noise)
            # the force also rises after the last trough
            left = pick(np.append(seen.T, np.inf), doubled, rise)[0].size
            if found == self.slips and left >= (1.0 - LOST) * found:
                return seen
        return np.full_like(seen, np.nan)


def _on_all_cores(function: Callable[[int], Any], of: Iterable[int]) -> list[Any]:
    """Return the results of a function for several numbers, computed by threads; the
    kernels release the global lock.
    """
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(function, of))

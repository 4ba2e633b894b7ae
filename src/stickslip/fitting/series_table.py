"""The table of simulated series of slips that every fit starts from, and how a bench
would have seen them.

Made once, cached, and resumed if interrupted. It holds the force before and after each
slip: how a trace was sampled and picked comes in when it is fitted, so that one table
serves traces of every bench, each biased as its trace is.
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

from stickslip.errors import whole
from stickslip.fitting.events import LOST, PLATEAU, Events, least_rise
from stickslip.fitting.model import FLOOR, KEYS, SLIPS, VERSION, Prior, simulate
from stickslip.fitting.summary import statistics
from stickslip.io import files
from stickslip.kernels.turning_points import Recording, observe, pick
from stickslip.measure.trace import Array
from stickslip.progress import Progress

DRAWS = 6_000  # from the prior, in a table of usual size
_BLOCK = 250  # draws of a block of the table
_SHARES = 8  # parts in which other draws are made, each with random numbers of its own
_AT_A_TIME = 500  # series observed at a time
_TIMED = 20  # draws, to measure what one takes
_LARGEST = 1 << 30
_FIELDS = ("parts", "count", "peaks", "troughs")
"""Fields of a table that are kept of each block: all but its prior."""
Series = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class SeriesTable:
    """Simulated series of slips, drawn from a prior."""

    prior: Prior
    #: (draws, 6): where the parameters of each draw lie in their ranges, 0 to 1
    parts: Array
    #: how many slips there are of each; few where the model hardly stick-slips
    count: NDArray[np.int64]
    #: (draws, slips): force before each slip, in units of the total contact strength; 0
    #: beyond `count`
    peaks: Series
    troughs: Series  #: and after it

    def __len__(self) -> int:
        return len(self.count)


def folder_of(prior: Prior, slips: int, seed: int) -> Path:
    """Return the folder of the table of a prior; its name is a key of all that decides
    its content, but for its length.
    """
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
    """Return the number of draws of the table of a prior that the cache holds."""
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
    """Return the table of a prior: from the cache as far as it is there, the rest
    simulated and kept.

    Cut short, it goes on from where it was. The same prior, seed and size give the same
    table, on any number of cores. Blocks are simulated by an `executor`, such as
    ``Client.get_executor()`` of Dask; by default by threads, one per core. `progress`
    receives the fraction that is there.

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
    with suppress(OSError):  # to write there is refused later
        place.mkdir(parents=True, exist_ok=True)
    paths = [place / f"{block}.npz" for block in range(-(-draws // _BLOCK))]
    blocks = {
        i: found for i, path in enumerate(paths) if (found := _read(path, prior, slips))
    }
    if missing := [i for i in range(len(paths)) if i not in blocks]:
        # compiles, before threads ask for it all at once
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
    """Tables of one prior one after another, as far as a number of draws."""
    made = {
        name: np.concatenate([getattr(one, name) for one in tables])[:draws]
        for name in _FIELDS
    }
    return SeriesTable(prior=tables[0].prior, **made)


def simulate_block(
    block: int, prior: Prior, draws: int, slips: int, seed: int
) -> SeriesTable:
    """Simulate one block of the table; its content depends on its number and on
    the seed alone.
    """
    rng = np.random.default_rng([seed, block])
    return _simulated(prior, rng.random((draws, len(KEYS))), slips, rng)


@lru_cache(maxsize=1)
def seconds_per_draw() -> float:
    """Return the seconds that one core takes for a draw of the usual table, measured
    once.
    """
    simulate_block(0, Prior(), 1, 30, 0)  # compiles
    begun = time.perf_counter()
    simulate_block(0, Prior(), _TIMED, SLIPS, 0)
    return (time.perf_counter() - begun) / _TIMED


def _simulated(
    prior: Prior, parts: Array, slips: int, rng: np.random.Generator
) -> SeriesTable:
    """Series of slips at given parts of the ranges of a prior."""
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
    """Read a stored block; None if it is missing or damaged: it is then simulated
    again.
    """
    try:
        with np.load(
            BytesIO(files.read(path, "table", largest=_LARGEST)), allow_pickle=False
        ) as found:
            block = SeriesTable(prior=prior, **{name: found[name] for name in _FIELDS})
    except Exception:  # a damaged file fails in many ways
        return None
    return block if block.peaks.shape == (_BLOCK, slips) else None


class Observation(NamedTuple):
    """Number of slips of a stretch of a trace, and its sampling and picking, in units
    of its mean peak.
    """

    slips: int
    sampling: Recording

    @classmethod
    def of(cls, events: Events) -> Self:
        """Take it from a trace."""
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

    def see(self, table: SeriesTable, *, seed: int = 0) -> tuple[Array, Array]:
        """Sample and pick many series, on all cores: statistics (draws, 20) and mean
        peaks of what is seen.

        They are NaN where a trace of the series would be refused, of too few slips or
        on no plateau of n(h).
        """

        def look(begin: int) -> tuple[Array, Array]:
            rng = np.random.default_rng([seed, begin])
            some = range(begin, min(begin + _AT_A_TIME, len(table)))
            series = (
                (
                    table.peaks[i, : table.count[i]],
                    table.troughs[i, : table.count[i]],
                )
                for i in some
            )
            P, T = np.stack([self._seen(*each, rng) for each in series], axis=1)
            return statistics(P, T), P.mean(axis=-1)

        statistics_of, sizes = zip(
            *_on_all_cores(look, range(0, len(table), _AT_A_TIME)), strict=True
        )
        return np.concatenate(statistics_of), np.concatenate(sizes)

    def see_at(
        self, prior: Prior, parts: Array, *, seed: int = 0
    ) -> tuple[Array, Array]:
        """Simulate at given parts of the ranges of a prior, on all cores, and see."""
        blocks = np.array_split(parts, max(1, min(len(parts), _SHARES)))
        slips = 2 * self.slips + 10  # some are too small to be seen

        def one(block: int) -> SeriesTable:
            return _simulated(
                prior,
                blocks[block],
                slips,
                np.random.default_rng([seed, 3, block]),
            )

        return self.see(joined(_on_all_cores(one, range(len(blocks)))), seed=seed)

    def _seen(self, peaks: Series, troughs: Series, rng: np.random.Generator) -> Array:
        """One series, sampled and picked: as many slips as in the trace, on a
        plateau of n(h), or NaN.
        """
        seen = np.empty((2, self.slips))
        if peaks.size > self.slips:  # the first begins the trace
            P = peaks.astype(float)
            T = troughs.astype(float)
            sampling = Recording(*(float(P.mean()) * force for force in self.sampling))
            found = observe(P, T, sampling, rng, seen)
            doubled = PLATEAU * sampling.drop
            rise = least_rise(doubled, sampling.noise)
            # the force rises after the last, too
            left = pick(np.append(seen.T, np.inf), doubled, rise)[0].size
            if found == self.slips and left >= (1.0 - LOST) * found:
                return seen
        return np.full_like(seen, np.nan)


def _on_all_cores(function: Callable[[int], Any], of: Iterable[int]) -> list[Any]:
    """Results of a function of numbers, by threads: kernels release the lock."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(function, of))

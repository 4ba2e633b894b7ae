"""The table of simulated series of slips that every fit starts from: made once, kept, and gone on with when cut short.

It holds the force before and after each slip, not statistics of them: how a trace was sampled and picked comes in when
it is fitted, so that one table serves traces of every bench.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed
from contextlib import nullcontext
from dataclasses import asdict, dataclass
from io import BytesIO
from pathlib import Path
from typing import TypeVar
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError, whole
from stickslip.fitting.arrest import FLOOR, KEYS, VERSION, Prior, simulate
from stickslip.io import files
from stickslip.measure.arrays import Array

DRAWS, SLIPS = 20_000, 384
"""Usual size: draws from the prior, and slips of each."""

_BLOCK = 250
_LARGEST = 1 << 30
_FIELDS = ("parts", "count", "peaks", "troughs")
"""Of a table, but for its prior: what is kept of each block."""
Progress = Callable[[float], None]
Series = NDArray[np.float32]
Found = TypeVar("Found")


@dataclass(frozen=True, kw_only=True)
class Table:
    """Simulated series of slips, drawn from a prior."""

    prior: Prior
    parts: Array  #: (draws, 6): where the parameters of each draw lie in their ranges, 0 to 1
    count: NDArray[np.int64]  #: how many slips there are of each; few where the model hardly stick-slips
    peaks: Series  #: (draws, slips): force before each slip, in units of the total contact strength; 0 beyond `count`
    troughs: Series  #: and after it

    def __len__(self) -> int:
        return len(self.count)


def folder_of(prior: Prior, slips: int, seed: int) -> Path:
    """Where the table of a prior is kept; its name is a key of all that decides what it holds, but for its length."""
    cache = os.environ.get("STICKSLIP_CACHE")
    place = Path(cache) if cache else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "stickslip"
    key = json.dumps([VERSION, FLOOR, KEYS, asdict(prior), slips, seed, _BLOCK], sort_keys=True)
    return place / f"fit-{hashlib.sha256(key.encode()).hexdigest()[:16]}"


def draws_kept(prior: Prior, slips: int, seed: int = 0) -> int:
    """How many draws of the table of a prior the cache holds."""
    return _BLOCK * len(list(folder_of(prior, slips, seed).glob("*.npz")))


def table(
    *,
    prior: Prior = Prior(),
    draws: int = DRAWS,
    slips: int = SLIPS,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Table:
    """Return the table of a prior: from the cache as far as it is there, the rest simulated and kept.

    Cut short, it goes on from where it was. The same prior, seed and size give the same table, on any number of cores.

    Parameters
    ----------
    prior : Prior
    draws, slips : int
        Its size. The usual one takes some minutes once.
    seed : int
    executor : Executor, optional
        Where the blocks are simulated, such as ``Client.get_executor()`` of Dask; by default threads, one per core.
    progress : callable, optional
        Is told what part is there.

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
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{place}: cannot be made ({error.strerror}); name another folder in STICKSLIP_CACHE"
        ) from None
    paths = [place / f"{block}.npz" for block in range(-(-draws // _BLOCK))]
    blocks = {block: found for block, path in enumerate(paths) if (found := _read(path, prior, slips))}
    missing = [block for block in range(len(paths)) if block not in blocks]
    if missing:
        simulate_block(prior, 0, 0, 30, seed)  # compiles, before threads ask for it all at once
        with nullcontext(executor) if executor is not None else ThreadPoolExecutor(os.cpu_count()) as pool:
            waiting = {pool.submit(simulate_block, prior, block, _BLOCK, slips, seed): block for block in missing}
            try:
                for future in as_completed(waiting):
                    block = waiting[future]
                    blocks[block] = future.result()
                    content = BytesIO()
                    np.savez(content, allow_pickle=False, **{name: getattr(blocks[block], name) for name in _FIELDS})
                    files.write(paths[block], content.getvalue())
                    if progress is not None:
                        progress(len(blocks) / len(paths))
            finally:
                for future in waiting:
                    future.cancel()
    return joined([blocks[block] for block in range(len(paths))], draws)


def joined(tables: Sequence[Table], draws: int | None = None) -> Table:
    """Tables of one prior one after another, and of them so many draws."""
    made = {name: np.concatenate([getattr(one, name) for one in tables])[:draws] for name in _FIELDS}
    return Table(prior=tables[0].prior, **made)


def on_all_cores(function: Callable[[int], Found], of: Iterable[int]) -> list[Found]:
    """What a function of numbers returns, by threads: kernels let others run."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(function, of))


def simulate_block(prior: Prior, block: int, draws: int, slips: int, seed: int) -> Table:
    """Simulate one block of the table; what it holds depends on its number and on the seed alone."""
    rng = np.random.default_rng([seed, block])
    return simulated(prior, rng.random((draws, len(KEYS))), slips, rng)


def simulated(prior: Prior, parts: Array, slips: int, rng: np.random.Generator) -> Table:
    """Series of slips at given parts of the ranges of a prior."""
    count = np.zeros(len(parts), dtype=np.int64)
    peaks, troughs = np.zeros((2, len(parts), slips), np.float32)
    for i, values in enumerate(prior.values(parts)):
        P, T = simulate(values, slips, rng)
        count[i] = P.size
        peaks[i, : P.size], troughs[i, : P.size] = P, T
    return Table(prior=prior, parts=parts, count=count, peaks=peaks, troughs=troughs)


def _read(path: Path, prior: Prior, slips: int) -> Table | None:
    """A block as it was kept; nothing if it is not there, or damaged, so that it is made again."""
    try:
        with np.load(BytesIO(files.read(path, "table", largest=_LARGEST)), allow_pickle=False) as found:
            block = Table(prior=prior, **{name: found[name] for name in _FIELDS})
    except (InputError, OSError, ValueError, KeyError, EOFError, NotImplementedError, BadZipFile):
        return None
    return block if block.peaks.shape == (_BLOCK, slips) else None

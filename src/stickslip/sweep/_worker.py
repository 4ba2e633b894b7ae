"""What runs in a worker: a few cases, one after the other, their results packed as numbers and arrays.

Imported by every worker process at its start, so nothing slow is loaded here.
"""

from __future__ import annotations

import functools
import importlib.metadata
import multiprocessing
import multiprocessing.connection
import os
import pickle
import signal
import threading
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.sweep._content import AxisValue, cell_seed

Case = Callable[..., Any]
Measure = Callable[[Any], Mapping[str, Any]]


def package_version() -> str:
    """Version of this package; ``unknown`` for a tree that is not installed."""
    try:
        return importlib.metadata.version("stickslip")
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


class CannotLoadError(RuntimeError):
    """A worker cannot load the functions that it was sent."""


class OtherVersionError(RuntimeError):
    """A worker runs another version of this package than the sweep."""

    def __init__(self, there: str, here: str) -> None:
        super().__init__(there, here)
        self.there, self.here = there, here

    def __str__(self) -> str:
        return f"a worker has stickslip {self.there}, but the sweep {self.here}; install the same on both sides"


@dataclass(frozen=True, kw_only=True)
class Job:
    """What is the same for every case of a sweep.

    Parameters
    ----------
    case, measure : callable
        The user's functions.
    seed : int, optional
        Seed of the sweep, if `case` asks for one.
    version : str
        Of this package where the sweep was started; a worker of another one refuses the job.
    """

    case: Case
    measure: Measure
    seed: int | None
    version: str = field(default_factory=package_version)


@dataclass(frozen=True, kw_only=True)
class Packed:
    """One array that a case gave: values, names of its dimensions if it had any, attributes, coordinates."""

    values: NDArray[Any]
    dims: tuple[str, ...] | None = None
    attributes: dict[str, Any] = field(default_factory=dict)
    coordinates: dict[str, NDArray[Any]] = field(default_factory=dict)


Value = float | complex | str | Packed
Outcome = dict[str, Value] | str
"""What a case gave: a value for each name, or the text of its error."""


def run_cells(
    job: Job | bytes,
    cells: Sequence[Mapping[str, AxisValue]],
    seconds: float,
    stopped: Callable[[], bool] | None = None,
) -> tuple[list[Outcome], float]:
    """Run cases until all are done or the time is up; at least one.

    Parameters
    ----------
    job : Job or bytes
        The job, pickled if it came from another process.
    cells : sequence of mappings
        Values of the axes, case by case.
    seconds : float
        After this time no further case is started.
    stopped : callable, optional
        Asked before each further case; true ends the batch.

    Returns
    -------
    list of Outcome
        For as many of the cells as were run, in order.
    float
        Time taken, in seconds.
    """
    begin = time.perf_counter()
    work = _load(job) if isinstance(job, bytes) else job
    outcomes: list[Outcome] = []
    for values in cells:
        if outcomes and (time.perf_counter() - begin > seconds or (stopped is not None and stopped())):
            break
        outcomes.append(run_one(work, values))
    return outcomes, time.perf_counter() - begin


def run_one(job: Job, values: Mapping[str, AxisValue]) -> Outcome:
    """Run one case; an error becomes its text."""
    try:
        if job.seed is None:
            result = job.case(**values)
        else:
            result = job.case(**values, seed=cell_seed(job.seed, values))
        measured = job.measure(result)
        if not isinstance(measured, Mapping):
            raise TypeError(f"measure returned {type(measured).__name__}, not a mapping of names to numbers")
        return {str(name): pack(str(name), value) for name, value in measured.items()}
    except (Exception, SystemExit) as error:
        return _in_words(error)


def pack(name: str, value: object) -> Value:
    """Turn what `measure` returned under a name into a number, a text or a packed array.

    Raises
    ------
    TypeError
        If it is none of these.
    """
    if isinstance(value, str):
        return value
    if isinstance(value, (bool, int, float, np.bool_, np.integer, np.floating)):
        return float(value)
    if isinstance(value, (complex, np.complexfloating)):
        return complex(value)
    dims = getattr(value, "dims", None)
    array = np.asarray(value)
    if array.dtype.kind in "buif":
        array = array.astype(np.float64)
    elif array.dtype.kind == "c":
        array = array.astype(np.complex128)
    else:
        raise TypeError(f"measure returned {value!r} for {name!r}: must be numbers, a small array or a text")
    if dims is None:
        return pack(name, array[()]) if array.ndim == 0 else Packed(values=array)
    labelled: Any = value
    return Packed(
        values=array,
        dims=tuple(str(dim) for dim in dims),
        attributes={str(key): item for key, item in labelled.attrs.items()},
        coordinates={str(dim): np.asarray(labelled[dim]) for dim in dims if dim in labelled.coords},
    )


def nothing() -> None:
    """Show that a worker can start."""


def start_worker() -> None:
    """Prepare a worker process: deaf to Ctrl-C (the parent decides), and gone when its parent is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent.sentinel,), daemon=True).start()


def _follow(sentinel: int) -> None:
    # Without this, workers whose parent was killed wait for work for ever.
    multiprocessing.connection.wait([sentinel])
    os._exit(1)


@functools.lru_cache(maxsize=4)
def _load(job: bytes) -> Job:
    try:
        loaded = pickle.loads(job)
    except Exception as error:
        raise CannotLoadError(f"{type(error).__name__}: {error}") from None
    if not isinstance(loaded, Job):
        raise CannotLoadError(f"a {type(loaded).__name__} came instead of a job")
    if loaded.version != package_version():
        raise OtherVersionError(package_version(), loaded.version)
    return loaded


def _in_words(error: BaseException) -> str:
    last = traceback.extract_tb(error.__traceback__)[-1:]
    place = "".join(f" ({os.path.basename(frame.filename)}:{frame.lineno})" for frame in last)
    return f"{type(error).__name__}: {error}{place}"

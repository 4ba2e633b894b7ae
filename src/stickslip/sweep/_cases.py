"""One case of a sweep: its key, its seed, what it is made of; and what a worker does
with it.

Imported by every worker process at its start, so nothing slow is loaded here.
"""

import functools
import hashlib
import inspect
import json
import os
import pickle
import time
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip import __version__
from stickslip.errors import InputError, instance

AxisValue = float | int | bool | str
Function = Callable[..., Mapping[str, Any]]

# variables of every result of a sweep; no measured name may be one of them
ERROR = "error"
STATUS = "status"
DIED = {
    "error": (
        "WorkerDied: the worker process ended while it ran this case (killed, out "
        "of memory, or a crash)"
    )
}


def case_key(values: Mapping[str, AxisValue]) -> str:
    """A case: the values of its axes as JSON, names in order."""
    return json.dumps(values, sort_keys=True)


def case_seed(seed: int, key: str) -> int:
    """Seed of a case, 63 bits: the same in any sweep with that seed, whatever the
    order, the workers, the other cases.

    The children that ``SeedSequence.spawn`` numbers would change with the axes, hence a
    keyed hash of the content.
    """
    root = (
        np.random.SeedSequence(seed)
        .generate_state(16, np.uint32)
        .astype("<u4")
        .tobytes()
    )
    return (
        int.from_bytes(
            hashlib.blake2b(key.encode(), digest_size=8, key=root).digest(), "little"
        )
        >> 1
    )


def identity_of(
    names: Iterable[str], seed: int, study: str, version: str
) -> dict[str, str]:
    """What must be equal for a finished case to be the same case, part by part: a
    message can say what differs.

    Nothing is guessed of the function, whose code, and all that it reads, may change
    unseen: `study` and `version` stand for it, and are the caller's to change.
    """
    for place, text, example in (
        ("study", study, "beam of two parts"),
        ("version", version, "1"),
    ):
        instance(f"options.{place}", text, str, f"a text, such as {example!r}")
        if not text.strip():
            raise InputError(
                f"options.{place} = {text!r}: a store needs the name and the version "
                f"of its study; give Options({place}={example!r}, ...), and another "
                "version whenever results change"
            )
    return {
        "stickslip version": __version__,
        "names of the axes": ", ".join(sorted(names)),
        "seed": str(seed),
        "study": study,
        "version of the study": version,
    }


def name_of(function: object) -> str:
    """Name of a function, for a person."""
    function = getattr(function, "func", function)  # of functools.partial
    return str(getattr(function, "__qualname__", type(function).__qualname__))


def check_function(function: Any, axes: Iterable[str]) -> bool:
    """Refuse a function that cannot be called with the axes; say whether it takes a
    seed of its own.
    """
    for name in axes:
        check_name("axes", name)
    try:
        signature = inspect.signature(function)
        bound = (*axes, *(getattr(function, "keywords", None) or ()))
        asks_seed = "seed" in signature.parameters and "seed" not in bound
        signature.bind(**dict.fromkeys([*axes, *["seed"] * asks_seed]))
    except (TypeError, ValueError) as error:
        raise InputError(
            f"function = {name_of(function)}: {error}; each axis is a parameter, and "
            "each parameter an axis, or has a "
            "default, or is bound with functools.partial"
        ) from None
    return asks_seed


def check_name(place: str, name: object) -> None:
    """Refuse a name that no variable of a Dataset can have, or that is taken."""
    if not isinstance(name, str) or "/" in name or name in (ERROR, STATUS):
        raise InputError(
            f"{place}: {name!r} is taken, or cannot be a name; use another text, "
            "without '/'"
        )


@dataclass(frozen=True, kw_only=True)
class Job:
    """What is the same for every case of a sweep; `version` is that of the package
    where it was started.
    """

    function: Function
    seed: int | None
    categories: Mapping[str, Sequence[str]]
    version: str = __version__


def run_batch(job: Job | bytes, keys: Sequence[str], seconds: float) -> list[str]:
    """Run cases until all are done or the time is up; at least one."""
    end = time.perf_counter() + seconds
    work = _load(job) if isinstance(job, bytes) else job
    found: list[str] = []
    for key in keys:
        found.append(_run(work, key))
        if time.perf_counter() > end:
            break
    return found


def _run(job: Job, key: str) -> str:
    """Run one case; return ``{"result": {name: value}}`` or ``{"error": text}`` as
    JSON.
    """
    try:
        values = json.loads(key)
        seed = {} if job.seed is None else {"seed": case_seed(job.seed, key)}
        result: Any = job.function(**values, **seed)
        if not isinstance(result, Mapping) or not result:
            raise TypeError(
                f"{name_of(job.function)} returned {result!r}: must be a mapping of "
                "names to numbers"
            )
        packed = {}
        for name, value in result.items():
            check_name("result", name)
            if name not in values:
                packed[name] = _plain(name, value, job.categories.get(name))
            elif value != values[name]:
                raise InputError(f"result: the name {name!r} is taken by an axis")
        return json.dumps({"result": packed})
    except (Exception, SystemExit) as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        said = (
            f"{type(error).__name__}: {error} "
            f"({os.path.basename(frame.filename)}:{frame.lineno})"
        )
        return json.dumps({"error": said})


def _plain(name: str, value: Any, words: Sequence[str] | None) -> float | str | None:
    """A value as JSON can hold it, exactly."""
    found = value.item() if isinstance(value, np.generic) else value
    if words is not None and found is not None and found not in words:
        raise ValueError(f"{name} = {found!r}: must be one of {', '.join(words)}")
    if not isinstance(found, float | int | str | None):
        raise TypeError(
            f"returned {found!r} for {name!r}: must be a number, a text or None"
        )
    return float(found) if isinstance(found, int) else found


@functools.lru_cache(maxsize=4)
def _load(job: bytes) -> Job:
    loaded: Job = pickle.loads(job)
    if loaded.version != __version__:
        raise InputError(
            f"a worker has stickslip {__version__}, but the sweep {loaded.version}; "
            "install the same"
        )
    return loaded

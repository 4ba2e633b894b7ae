"""One case of a sweep: its key, its seed, what it is made of; and what a worker does with it.

Imported by every worker process at its start, so nothing slow is loaded here.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import inspect
import json
import os
import pickle
import re
import textwrap
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from types import CodeType, FunctionType, MethodType
from typing import Any

import numpy as np

from stickslip.errors import InputError

AxisValue = float | int | bool | str
Values = Mapping[str, AxisValue]
Function = Callable[..., Mapping[str, Any]]

ERROR, STATUS = "error", "status"
"""Variables of every result of a sweep; no measured name may be one of them."""
DIED = "WorkerDied: the worker process ended while it ran this case (killed, out of memory, or a crash)"

_NAME = re.compile(r"[^\W\d][^/\x00-\x1f]*")
_in_order = json.JSONEncoder(sort_keys=True).encode


# ---------------------------------------------------------------- what a case is


def case_key(values: Values) -> str:
    """Key of a case: the values of its axes as JSON, names in order."""
    return _in_order(values)


def case_seed(seed: int, values: Values) -> int:
    """Seed of a case, 63 bits: the same in any sweep with that seed, whatever the order, the workers, the other cases.

    The children that ``SeedSequence.spawn`` numbers would change with the axes, hence a keyed hash of the content.
    """
    content = hashlib.blake2b(case_key(values).encode(), digest_size=8, key=_root(seed)).digest()
    return int.from_bytes(content, "little") >> 1


@functools.lru_cache(maxsize=16)
def _root(seed: int) -> bytes:
    return np.random.SeedSequence(seed).generate_state(16, np.uint32).astype("<u4").tobytes()


def package_version() -> str:
    """Version of this package; ``unknown`` for a tree that is not installed."""
    try:
        return importlib.metadata.version("stickslip")
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def identity_of(function: Function, names: Sequence[str], seed: int, fingerprint: object) -> dict[str, str]:
    """What must be equal for a finished case to be the same case, part by part: a message can say what differs.

    Code that the function calls is not followed: the version of this package stands for its own, `fingerprint` for
    everything else.
    """
    return {
        "stickslip version": package_version(),
        "names of the axes": ", ".join(sorted(names)),
        "seed": str(seed),
        "fingerprint": _digest("fingerprint", fingerprint),
        "function": name_of(function),
        "what the function holds": _digest(f"function = {name_of(function)}", _held(function)),
        "source of the function": _hash(_source(function).encode()),
    }


def _held(function: Any) -> list[Any]:
    """What is bound to a function, what it closes over, and its defaults; of an object with a __call__, the object."""
    match function:
        case functools.partial(func=inner, args=args, keywords=keywords):
            return [list(args), keywords, *_held(inner)]
        case MethodType(__self__=owner, __func__=inner):
            return [owner, *_held(inner)]
        case FunctionType(__defaults__=defaults, __kwdefaults__=keywords):
            return [list(inspect.getclosurevars(function).nonlocals.items()), defaults, keywords]
    if hasattr(function, "py_func"):  # compiled by numba
        return _held(function.py_func)
    return [] if inspect.isroutine(function) or isinstance(function, type) else [function]


def _source(function: Any) -> str:
    """The text of a function or of the class of an object; its code where there is no text, or many in a line."""
    for inner in ("func", "__func__", "py_func"):
        function = getattr(function, inner, function)
    if not (inspect.isroutine(function) or isinstance(function, type)):
        function = type(function)
    code = getattr(function, "__code__", None)
    try:
        text = textwrap.dedent(inspect.getsource(code or function))
    except (OSError, TypeError):  # built in, or typed at a prompt
        return "" if code is None else _code(code)
    return text + _code(code) if code is not None and code.co_name == "<lambda>" else text


def _code(code: CodeType) -> str:
    inner = [_code(item) if isinstance(item, CodeType) else repr(item) for item in code.co_consts]
    return code.co_code.hex() + repr([inner, code.co_names])


def name_of(function: object) -> str:
    """Name of a function, for a person."""
    function = getattr(function, "func", function)  # of functools.partial
    return str(getattr(function, "__qualname__", type(function).__qualname__))


def _digest(place: str, value: object) -> str:
    try:
        return _hash(json.dumps(_content(value)).encode())
    except Exception as error:
        raise InputError(
            f"{place}: a value in it cannot be read ({error}), so a finished case could not be told from a changed "
            "one; use numbers, text, arrays or frozen records"
        ) from None


def _content(value: Any) -> Any:
    """What a value is, as JSON can hold it, the same in every process."""
    if isinstance(value, np.generic):
        value = value.item()
    name = f"{type(value).__module__}.{type(value).__qualname__}"
    if value is None or isinstance(value, (bool, int, float, complex, str, bytes)):
        return [name, repr(value)]
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return [name, value.dtype.str, value.shape, _hash(value.tobytes())]
    if isinstance(value, Mapping):
        return [name, sorted((_content(list(item)) for item in value.items()), key=json.dumps)]
    if isinstance(value, (list, tuple)):
        return [name, *map(_content, value)]
    if isinstance(value, (set, frozenset)):
        return [name, *sorted(map(_content, value), key=json.dumps)]
    if is_dataclass(value) and not isinstance(value, type):
        return [name, *(_content(getattr(value, one.name)) for one in fields(value) if one.compare)]
    if inspect.isroutine(value) or isinstance(value, type):
        return [name, name_of(value), _source(value), _content(_held(value))]
    if hasattr(value, "__dict__"):
        return [name, _content(vars(value))]
    raise TypeError(f"a {name}")


def _hash(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def check_function(function: object, axes: Sequence[str]) -> bool:
    """Refuse a function that does not take the axes; say whether it takes a seed of its own."""
    if not callable(function):
        raise InputError(f"function = {function!r}: must be a function of the axes")
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return False
    named = {p.name: p for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)}
    anything = any(p.kind is p.VAR_KEYWORD for p in parameters)
    called = name_of(function)
    for name in axes:
        if name not in named and not anything:
            raise InputError(f"axes: {called} has no parameter {name!r}; it takes {', '.join(named) or 'none'}")
    for name, parameter in named.items():
        if name not in axes and name != "seed" and parameter.default is parameter.empty:
            raise InputError(
                f"function = {called}: its parameter {name!r} is no axis and has no default; add an axis or bind it "
                "with functools.partial"
            )
    return "seed" in named and "seed" not in axes and "seed" not in (getattr(function, "keywords", None) or {})


def check_name(place: str, name: object) -> None:
    """Refuse a name that no variable of a Dataset can have, or that is taken."""
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise InputError(f"{place}: {name!r} cannot be a name; use a text without '/' that starts with a letter")
    if name in (ERROR, STATUS):
        raise InputError(f"{place}: the name {name!r} is taken")


# ---------------------------------------------------------------- in a worker


class CannotLoadError(RuntimeError):
    """A worker cannot run what it was sent; the message says why and what to do."""


@dataclass(frozen=True, kw_only=True)
class Job:
    """What is the same for every case of a sweep."""

    function: Function
    seed: int | None
    categories: Mapping[str, Sequence[str]] = field(default_factory=dict)
    version: str = field(default_factory=package_version)


def run_batch(job: Job | bytes, batch: Sequence[Values], seconds: float) -> tuple[list[str], float]:
    """Run cases until all are done or the time is up; at least one."""
    begin = time.perf_counter()
    work = _load(job) if isinstance(job, bytes) else job
    found: list[str] = []
    for values in batch:
        if found and time.perf_counter() - begin > seconds:
            break
        found.append(run_case(work, values))
    return found, time.perf_counter() - begin


def run_case(job: Job, values: Values) -> str:
    """Run one case; return ``{"result": {name: value}}`` or ``{"error": text}`` as JSON."""
    try:
        seed = {} if job.seed is None else {"seed": case_seed(job.seed, values)}
        result: Any = job.function(**values, **seed)
        if not isinstance(result, Mapping) or not result:
            what = "an empty mapping" if isinstance(result, Mapping) else type(result).__name__
            raise TypeError(f"{name_of(job.function)} returned {what}: must be a mapping of names to numbers")
        packed = {}
        for name, value in result.items():
            check_name("result", name)
            if name not in values:
                packed[name] = _plain(name, value, job.categories.get(name))
            elif value != values[name]:
                raise InputError(f"result: the name {name!r} is taken by an axis")
        return json.dumps({"result": packed})
    except (Exception, SystemExit) as error:
        return failed(_in_words(error))


def failed(error: str) -> str:
    """What came of a case that failed."""
    return json.dumps({"error": error})


def _plain(name: str, value: Any, words: Sequence[str] | None) -> float | bool | str | None:
    """A value as JSON can hold it, exactly."""
    if isinstance(value, np.generic):
        value = value.item()
    if words is not None and value is not None and value not in words:
        raise ValueError(f"{name} = {value!r}: must be one of {', '.join(words)}")
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, (int, float)):
        return float(value)
    raise TypeError(f"returned {value!r} for {name!r}: must be a number, a text or None")


@functools.lru_cache(maxsize=4)
def _load(job: bytes) -> Job:
    try:
        loaded: Job = pickle.loads(job)
    except Exception as error:
        raise CannotLoadError(
            f"function: the workers cannot load it ({type(error).__name__}: {error}); define it in a module that the "
            "workers can import, or use Threads(n)"
        ) from None
    if loaded.version != package_version():
        raise CannotLoadError(
            f"executor: a worker has stickslip {package_version()}, but the sweep {loaded.version}; install the same "
            "on both sides"
        )
    return loaded


def _in_words(error: BaseException) -> str:
    last = traceback.extract_tb(error.__traceback__)[-1:]
    place = "".join(f" ({os.path.basename(frame.filename)}:{frame.lineno})" for frame in last)
    return f"{type(error).__name__}: {error}{place}"

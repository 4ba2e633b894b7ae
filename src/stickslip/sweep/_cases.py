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
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from types import BuiltinFunctionType, CellType, CodeType, FunctionType, ModuleType
from typing import Any, cast

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

    The code of the function itself is part of it. Code that it calls is not followed: the version of this package
    stands for its own, `fingerprint` for everything else.

    Raises
    ------
    InputError
        If the arguments bound to the function, or the fingerprint, have no content that can be read.
    """
    parts = {
        "stickslip version": package_version(),
        "names of the axes": ", ".join(sorted(names)),
        "seed": str(seed),
        "fingerprint": _digest("fingerprint", fingerprint),
    }
    place, inner = f"function = {name_of(function)}", cast("Any", function)
    if isinstance(inner, functools.partial):
        parts["bound arguments"] = _digest(place, [inner.args, inner.keywords])
        inner = inner.func
    if inspect.ismethod(inner):
        parts["the object of the method"] = _digest(place, inner.__self__)
        inner = inner.__func__
    inner = getattr(inner, "py_func", inner)  # compiled by numba
    if not inspect.isroutine(inner) and not isinstance(inner, type):  # an object with a __call__
        parts["the object called"] = _digest(place, inner)
        inner = type(inner)
    parts["function"] = name_of(inner)
    if inspect.isfunction(inner):
        parts["values that the function holds"] = _digest(place, _held(inner))
    return parts | {"source of the function": _hash(_source(inner).encode())}


def _held(function: FunctionType) -> list[Any]:
    """What a function closes over, and its defaults."""
    cells = [cell.cell_contents if _is_filled(cell) else None for cell in function.__closure__ or ()]
    return [cells, function.__defaults__, function.__kwdefaults__]


def _is_filled(cell: CellType) -> bool:
    try:
        cell.cell_contents  # noqa: B018
    except ValueError:
        return False
    return True


def _source(function: Any) -> str:
    code = getattr(function, "__code__", None)
    try:
        text = textwrap.dedent(inspect.getsource(code or function))
    except (OSError, TypeError):  # built in, or typed at a prompt
        return "" if code is None else _code(code)
    return text + _code(code) if code is not None and code.co_name == "<lambda>" else text  # many may be in a line


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


def _content(value: Any, within: tuple[int, ...] = ()) -> Any:
    """What a value is, as JSON can hold it, the same in every process; all that pickle takes, and functions."""
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, (bool, int, float, complex, str, bytes)):
        return [type(value).__qualname__, repr(value)]
    if id(value) in within:
        return ["above", within[::-1].index(id(value))]

    def each(items: Iterable[Any]) -> list[Any]:
        return [_content(item, (*within, id(value))) for item in items]

    value = getattr(value, "py_func", value)
    name = [type(value).__module__, type(value).__qualname__]
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return [*name, value.dtype.str, value.shape, _hash(value.tobytes())]
    if isinstance(value, (type, ModuleType, BuiltinFunctionType)):
        return [*name, getattr(value, "__module__", ""), getattr(value, "__qualname__", value.__name__)]
    if inspect.ismethod(value):
        return [*name, *each([value.__self__, value.__func__])]
    if inspect.isfunction(value):
        return [*name, value.__qualname__, _source(value), each(_held(value))]
    if isinstance(value, (set, frozenset)):
        return [*name, sorted(each(value), key=json.dumps)]
    if isinstance(value, Mapping):
        return [*name, sorted((each(item) for item in value.items()), key=json.dumps)]
    if isinstance(value, (list, tuple)):
        return [*name, each(value)]
    if is_dataclass(value):
        return [*name, each(getattr(value, one.name) for one in fields(value) if one.compare)]
    made = value.__reduce_ex__(4)  # how pickle takes it apart; it raises for what has no content: a lock, a file
    if isinstance(made, str):
        return [*name, made]
    return [*name, each(list(part) if isinstance(part, Iterator) else part for part in made)]


def _hash(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def check_function(function: object, axes: Sequence[str]) -> bool:
    """Refuse a function that does not take the axes; say whether it takes a seed of its own.

    Raises
    ------
    InputError
    """
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
    """Refuse a name that no variable of a Dataset can have, or that is taken.

    Raises
    ------
    InputError
    """
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise InputError(f"{place}: {name!r} cannot be a name; use a text without '/' that starts with a letter")
    if name in (ERROR, STATUS):
        raise InputError(f"{place}: the name {name!r} is taken")


# ---------------------------------------------------------------- in a worker


class CannotLoadError(RuntimeError):
    """A worker cannot load the function that it was sent."""


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
    function : callable
        The user's.
    seed : int, optional
        Seed of the sweep, if the function asks for one.
    version : str
        Of this package where the sweep was started; a worker of another one refuses the job.
    """

    function: Function
    seed: int | None
    version: str = field(default_factory=package_version)


def run_batch(
    job: Job | bytes, batch: Sequence[Values], seconds: float, stopped: Callable[[], bool] | None = None
) -> tuple[list[str], float]:
    """Run cases until all are done or the time is up; at least one.

    Parameters
    ----------
    job : Job or bytes
        The job, pickled if it came from another process.
    batch : sequence of mappings
        Values of the axes, case by case.
    seconds : float
        After this time no further case is started.
    stopped : callable, optional
        Asked before each further case; true ends the batch.

    Returns
    -------
    list of str
        What came of as many of the cases as were run, in order; see `run_case`.
    float
        Time taken, in seconds.
    """
    begin = time.perf_counter()
    work = _load(job) if isinstance(job, bytes) else job
    found: list[str] = []
    for values in batch:
        if found and (time.perf_counter() - begin > seconds or (stopped is not None and stopped())):
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
                packed[name] = _pack(name, value)
            elif value != values[name]:
                raise InputError(f"result: the name {name!r} is taken by an axis")
        return json.dumps({"result": packed})
    except (Exception, SystemExit) as error:
        return failed(_in_words(error))


def failed(error: str) -> str:
    """What came of a case that failed."""
    return json.dumps({"error": error})


def _pack(name: str, value: Any) -> Any:
    """Turn a number, a text, nothing or a small array into what JSON can hold, exactly.

    Raises
    ------
    TypeError
        If it is none of these.
    """
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, (int, float, np.integer, np.floating)):
        return float(value)
    dims, array = getattr(value, "dims", None), np.asarray(value)
    if array.dtype.kind not in "buifc":
        raise TypeError(f"returned {value!r} for {name!r}: must be a number, a text, None or an array of numbers")
    if array.ndim == 0 and array.dtype.kind != "c":
        return bool(array) if array.dtype.kind == "b" else float(array)
    packed: dict[str, Any] = {"shape": array.shape, "real": array.real.astype(float).ravel().tolist()}
    if array.dtype.kind == "c":
        packed["imag"] = array.imag.astype(float).ravel().tolist()
    if dims is not None:
        packed["dims"] = [str(dim) for dim in dims]
        packed["attributes"] = {str(key): plain_attribute(item) for key, item in value.attrs.items()}
        packed["coordinates"] = {str(dim): np.asarray(value[dim]).tolist() for dim in dims if dim in value.coords}
    return packed


def plain_attribute(value: Any) -> Any:
    """Turn an attribute into what both JSON and NetCDF can hold: None and truth values become text."""
    if isinstance(value, (str, int, float)) and not isinstance(value, bool):
        return value
    array = np.asarray(value)
    return array.tolist() if array.dtype.kind in "uifU" else str(value)


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

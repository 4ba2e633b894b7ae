"""A function at every combination of the values of some axes, and what became of it as one labelled Dataset."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import InputError, instance, shown
from stickslip.progress import in_time
from stickslip.sweep._cases import ERROR, STATUS, AxisValue, Function, Values, case_key, check_name
from stickslip.sweep._executors import Workers
from stickslip.sweep._run import Options, Progress, started
from stickslip.sweep._table import Table, writer_of

if TYPE_CHECKING:
    import xarray as xr

NOT_RUN, DONE, FAILED = 0, 1, 2
NO_RESULT = -1
"""Code of a category where a case has no result."""
PROVENANCE = "provenance"

Head = Mapping[str, Any]
"""What a sweep is made of, as it stands in its table: axes or box, attributes, categories, notes."""


def run_cases(
    function: Function,
    axes: Mapping[str, ArrayLike | xr.DataArray],
    *,
    store: str | PathLike[str] | None = None,
    executor: Workers | None = None,
    progress: Callable[[Progress], object] | None = None,
    options: Options = Options(),
) -> xr.Dataset:
    """Run a function at every combination of the values of some axes.

    The results are the same, bit for bit, for any number of workers and any executor.

    Parameters
    ----------
    function : callable
        Called with one keyword for each axis, ``function(stiffness=2.0, velocity=0.1)``; returns a mapping of names to
        numbers (kept as float64), texts, truth values (0 and 1), or None (no value). If it has a parameter ``seed``
        that is no axis, it is handed a seed of its own, made from `Options.seed` and the values of the axes. An axis
        that it ignores makes replicas.
    axes : mapping of name to values
        Numbers, texts or truth values, each value once; an `xarray.DataArray` brings its attributes along.
    store : path, optional
        File where results land as they finish, at least each second; a second start with the same function runs what is
        missing, also with other values on the axes. By default results are kept in memory.
    executor : Threads, Processes or concurrent.futures.Executor, optional
        Where cases run; by default threads, one per core. For Dask: ``client.get_executor()``.
    progress : callable, optional
        Called with a `Progress` at the start and whenever results have been written.
    options : Options
        Seed, attributes, categories and what else.

    Returns
    -------
    xarray.Dataset
        One variable for each measured name, with the axes as dimensions; ``status`` (CF flags: not run, done, failed);
        ``error``, the error of each case that failed, else empty. See `summary` and `failures`.

    Raises
    ------
    InputError
        If an argument cannot be used; if the store holds another sweep, is damaged, is of another version, is being
        written by another process, or cannot be written (what was written is kept); if the workers cannot load the
        function.

    Examples
    --------
    >>> from stickslip.sweep import run_cases, summary
    >>> def area(width, height):
    ...     return {"area": width * height}
    >>> found = run_cases(area, {"width": [1.0, 2.0], "height": [3.0, 4.0]})
    >>> float(found["area"].sel(width=2.0, height=4.0)), str(summary(found))
    (8.0, '4 of 4 cases done')
    """
    instance("axes", axes, Mapping, "a mapping of names to values")
    if len(axes) == 0:
        raise InputError(f"axes = {axes!r}: must map at least one name to its values")
    values = {name: axis_values(name, given) for name, given in axes.items()}
    attributes = {
        name: {**getattr(axes.get(name), "attrs", {}), **options.attributes.get(name, {})}
        for name in dict.fromkeys([*axes, *options.attributes])
    }
    merged = {name: {key: _attribute(value) for key, value in about.items()} for name, about in attributes.items()}
    with started(
        function, {"axes": values}, list(values), math.prod(map(len, values.values())),
        store=store, executor=executor, progress=progress, options=replace(options, attributes=merged),
    ) as runner:  # fmt: skip
        runner.run(combinations(values))
        runner.table.keep_head()
        return grid_dataset(runner.table.head, runner.table.rows())


def open_sweep(store: str | PathLike[str]) -> xr.Dataset:
    """Open the results of a sweep, finished or not, as `run_cases` and `refine` return them."""
    with Table(Path(store)) as table:
        return grid_dataset(table.head, table.rows()) if "axes" in table.head else refined_dataset(table)


@dataclass(frozen=True, kw_only=True)
class Status:
    """How far the sweep of a store is.

    Attributes
    ----------
    summary : Summary
    writer : str or None
        The process that is at it; None if none is.
    rate : float
        Cases per second since the last start; 0 if none has finished since.
    """

    summary: Summary
    writer: str | None
    rate: float

    @property
    def seconds_left(self) -> float | None:
        """Time that the missing cases will take at this rate; None if there is no rate."""
        return None if self.rate == 0 and self.summary.missing else self.summary.missing / max(self.rate, 1e-300)

    def __str__(self) -> str:
        line = str(self.summary)
        if not self.summary.missing:
            return line
        line += f"; {self.writer} is at it" if self.writer else "; nobody is at it: start it again to go on"
        left = self.seconds_left
        return line if left is None else f"{line}; about {in_time(left)} at {self.rate:.3g} cases/s"


def status_of(store: str | PathLike[str]) -> Status:
    """Say how far the sweep of a store is, also while it runs."""
    path = Path(store)
    with Table(path, weigh=False) as table:
        head, writer = table.head, writer_of(path)
        if "axes" in head:
            keys = [case_key(values) for values in combinations(head["axes"])]
        else:
            keys = head.get("cases", list(table.keys))
        known = sum(key in table.keys for key in keys)
        failed = sum(key in table.failed for key in keys)
        is_open = "axes" not in head and "cases" not in head
        total = max(known, head["runs"] * len(combinations(head["each"]))) if is_open else len(keys)
        since = path.stat().st_mtime - head["started"]
        fresh = len(table.keys) - head["found"]
        return Status(
            summary=Summary(total=total, done=known - failed, failed=failed, missing=total - known),
            writer=writer,
            rate=fresh / since if since > 0 else 0.0,
        )


# ---------------------------------------------------------------- what became of the cases


@dataclass(frozen=True, kw_only=True)
class Failure:
    """A case that raised: the values of its axes, and its error."""

    parameters: Mapping[str, AxisValue]
    error: str

    def __str__(self) -> str:
        where = ", ".join(f"{name} = {value!r}" for name, value in self.parameters.items())
        return f"{where}: {self.error}"


@dataclass(frozen=True, kw_only=True)
class Summary:
    """What became of a sweep; as text, its last line."""

    total: int
    done: int
    failed: int
    missing: int

    def __str__(self) -> str:
        line = f"{self.done} of {self.total} cases done"
        if self.failed:
            line += f", {self.failed} failed"
        if self.missing:
            line += f", {self.missing} not run yet"
        return line


def summary(dataset: xr.Dataset) -> Summary:
    """Count what became of the cases of a sweep."""
    status = _status(dataset)
    done, failed = (int(np.count_nonzero(status == code)) for code in (DONE, FAILED))
    return Summary(total=status.size, done=done, failed=failed, missing=status.size - done - failed)


def failures(dataset: xr.Dataset) -> list[Failure]:
    """List the cases that raised, with their parameters and errors."""
    found = []
    for index in np.argwhere(_status(dataset) == FAILED):
        case = dataset.isel(dict(zip(dataset[STATUS].dims, index.tolist(), strict=True)))
        parameters = {str(name): case[name].values.item() for name in dataset[STATUS].coords if case[name].ndim == 0}
        found.append(Failure(parameters=parameters, error=str(case[ERROR].values.item())))
    return found


def _status(dataset: xr.Dataset) -> NDArray[Any]:
    if STATUS not in dataset or ERROR not in dataset:
        raise InputError(f"dataset: has no variables {STATUS} and {ERROR}; must be the result of a sweep")
    return dataset[STATUS].to_numpy()


# ---------------------------------------------------------------- axes


def combinations(axes: Mapping[str, Sequence[AxisValue]]) -> list[Values]:
    """All combinations of the values of some axes, the last one fastest."""
    return [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]


def axis_values(name: str, given: object, table: str = "axes") -> list[AxisValue]:
    """Values of an axis as Python's own numbers, texts or truth values."""
    check_name(table, name)
    place = f"{table}[{name!r}]"
    values = np.asarray(given, dtype=object).tolist()
    if not isinstance(values, list) or not values:
        raise InputError(f"{place} = {shown(given)}: must be a list of values, at least one")
    found = [value.item() if isinstance(value, np.generic) else value for value in values]
    if {_sort_of(value) for value in found} not in ({"number"}, {"text"}, {"truth value"}):
        raise InputError(
            f"{place} = {shown(given)}: must be numbers, texts or truth values, all of one kind; for records, sweep "
            "over their names and look them up in the function"
        )
    array = np.array(found)
    if array.tolist() != found or array.dtype.kind == "O":
        raise InputError(
            f"{place} = {shown(given)}: one axis cannot hold these values without loss: no NaN, no whole numbers "
            "above 2^53 beside fractions"
        )
    if len(set(found)) < len(found):
        twice = next(value for i, value in enumerate(found) if value in found[:i])
        raise InputError(f"{place}: holds {twice!r} twice; for replicas add an axis of their own, such as replica")
    return found


def _sort_of(value: object) -> str:
    if isinstance(value, bool):
        return "truth value"
    return "number" if isinstance(value, (int, float)) else "text" if isinstance(value, str) else ""


# ---------------------------------------------------------------- Datasets


def grid_dataset(head: Head, rows: Iterable[tuple[str, Mapping[str, Any]]]) -> xr.Dataset:
    """Put rows where they stand on the axes of a sweep."""
    import xarray as xr

    axes = head["axes"]
    found: dict[str, Mapping[str, Any] | None] = {case_key(values): None for values in combinations(axes)}
    found.update((key, row) for key, row in rows if key in found)
    data = _variables(head, list(found.values()), {name: len(values) for name, values in axes.items()})
    coordinates = {name: (name, array(values), attributes_of(head, name)) for name, values in axes.items()}
    return xr.Dataset(data, coordinates, _attributes_of_all(head))


def refined_dataset(table: Table) -> xr.Dataset:
    """Put the runs of a refinement in their order; a crossing is two of them, known once all are there."""
    import xarray as xr

    head, label = table.head, table.head["label"]
    whole = "cases" in head and table.keys.issuperset(head["cases"])
    keys, crossings = (head["cases"], head["crossings"]) if whole else (sorted(table.keys), [])
    cases, rows = [json.loads(key) for key in keys], [table.get(key) for key in keys]
    data = _variables(head, rows, {"run": len(rows)})
    for name in head["box"]:
        low, high = (np.array([cases[ends[side]][name] for ends in crossings], dtype=float) for side in (0, 1))
        about = attributes_of(head, name)
        title = about["long_name"]
        data[f"{name}_at"] = ("crossing", (low + high) / 2, about | {"long_name": f"{title}, on the boundary"})
        data[f"{name}_error"] = ("crossing", abs(high - low) / 2, about | {"long_name": f"{title}, uncertainty"})
    for name in head["each"]:
        data[f"{name}_at"] = ("crossing", array([cases[i][name] for i, _ in crossings]), attributes_of(head, name))
    for side, (prefix, where) in enumerate({"from": "on one side", "to": "on the other"}.items()):
        values, about = _column(head, label, [rows[ends[side]]["result"][label] for ends in crossings])
        about["long_name"] += f", {where}"
        data[f"{prefix}_{label}"] = ("crossing", values, about)
    coordinates = {
        name: ("run", array([values[name] for values in cases]), attributes_of(head, name))
        for name in (*head["box"], *head["each"])
    }
    return xr.Dataset(data, coordinates, _attributes_of_all(head))


def _variables(head: Head, rows: Sequence[Mapping[str, Any] | None], sizes: Mapping[str, int]) -> dict[str, Any]:
    """All that cases returned, and what became of them, over the dimensions of the sweep."""
    results = [{} if row is None else row.get("result", {}) for row in rows]
    errors = ["" if row is None else row.get("error", "") for row in rows]
    states = [NOT_RUN if row is None else FAILED if "error" in row else DONE for row in rows]
    names = dict.fromkeys(name for result in results for name in result)
    columns = {name: _column(head, name, [result.get(name) for result in results]) for name in names}
    about = {"long_name": "what became of the case", "units": "1"} | _flags(["not run", "done", "failed"], NOT_RUN)
    columns[STATUS] = np.array(states, dtype=np.int8), about
    title = {"long_name": "error of the case, empty if it went well", "units": "1"}
    columns[ERROR] = np.array(errors, dtype=object), title
    shape = tuple(sizes.values())
    return {name: (tuple(sizes), values.reshape(shape), about) for name, (values, about) in columns.items()}


def _column(head: Head, name: str, values: Sequence[Any]) -> tuple[NDArray[Any], dict[str, Any]]:
    """What cases returned under a name, as an array, and its attributes: codes of words, texts, or numbers."""
    about = attributes_of(head, name)
    if name in head["categories"]:
        words = head["categories"][name]
        code = {word: i for i, word in enumerate(words)}
        codes = np.array([code.get(value, NO_RESULT) for value in values], dtype=np.int8)
        return codes, _flags(["no result", *words], NO_RESULT) | about
    if any(isinstance(value, str) for value in values):
        return np.array(["" if value is None else str(value) for value in values], dtype=object), about
    return np.array([math.nan if value is None else value for value in values], dtype=float), about


def array(values: Sequence[AxisValue]) -> NDArray[Any]:
    """Values of an axis as xarray has them: texts as objects."""
    return np.array(values, dtype=object if values and isinstance(values[0], str) else None)


def attributes_of(head: Head, name: str) -> dict[str, Any]:
    """Attributes of an axis or variable: the user's, and the two that none goes without."""
    given: dict[str, Any] = head["attributes"].get(name, {})
    return {"long_name": name.replace("_", " "), "units": "1"} | given


def _attribute(value: Any) -> Any:
    """Turn an attribute into what both JSON and NetCDF can hold: None and truth values become text."""
    if isinstance(value, (str, int, float)) and not isinstance(value, bool):
        return value
    array = np.asarray(value)
    return array.tolist() if array.dtype.kind in "uifU" else str(value)


def _flags(words: Sequence[str], first: int) -> dict[str, Any]:
    """CF attributes of a variable whose integers, from the first up, stand for words."""
    codes = np.arange(first, first + len(words), dtype=np.int8)
    return {"flag_values": codes, "flag_meanings": " ".join(word.replace(" ", "_") for word in words)}


def _attributes_of_all(head: Head) -> dict[str, str]:
    """Attributes of the Dataset: notes, and what the sweep is made of as JSON."""
    names = ("format", "stickslip", "function", "seed", "box", "each", "label", "runs", "resolution", "together")
    about = {name: head[name] for name in names if name in head}
    if "axes" in head:
        about["axes"] = {name: len(values) for name, values in head["axes"].items()}
    return {**head["notes"], PROVENANCE: json.dumps(about)}

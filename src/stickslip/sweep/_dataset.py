"""A function at every combination of the values of some axes, and what became of it as one labelled Dataset."""

from __future__ import annotations

import itertools
import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import InputError, instance, shown
from stickslip.progress import in_time
from stickslip.sweep._cases import ERROR, STATUS, AxisValue, Function, case_key, check_name
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
"""What a sweep is made of, as it stands in its table: axes or a search, attributes, categories, notes."""


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
    brought = {
        name: {**getattr(given, "attrs", {}), **options.attributes.get(name, {})} for name, given in axes.items()
    }
    cases = math.prod(map(len, values.values()))
    options = replace(options, attributes={**options.attributes, **brought})
    where: Any = {"store": store, "executor": executor, "progress": progress, "options": options}
    with started(function, list(values), cases, {"axes": values}, **where) as runner:
        runner.run(_keys_of(runner.table))
        return dataset_of(runner.table)


def open_sweep(store: str | PathLike[str]) -> xr.Dataset:
    """Open the results of a sweep, finished or not, as `run_cases` and `refine` return them."""
    with Table(Path(store)) as table:
        return dataset_of(table)


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
        head, keys = table.head, _keys_of(table)
        known = [table.has_failed(key) for key in keys if key in table.rows]
        total = len(keys) if "axes" in head or "cases" in head else max(len(keys), head["total"])
        since = path.stat().st_mtime - head["started"]
        return Status(
            summary=Summary(total=total, done=known.count(False), failed=sum(known), missing=total - len(known)),
            writer=writer_of(path),
            rate=(len(table.rows) - head["found"]) / since if since > 0 else 0.0,
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


def combinations(axes: Mapping[str, Sequence[AxisValue]]) -> list[dict[str, AxisValue]]:
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
    if {float if type(value) is int else type(value) for value in found} not in ({float}, {str}, {bool}):
        raise InputError(
            f"{place} = {shown(given)}: must be numbers, texts or truth values, all of one kind; for records, sweep "
            "over their names and look them up in the function"
        )
    if np.array(found).tolist() != found:
        raise InputError(
            f"{place} = {shown(given)}: one axis cannot hold these values without loss: no NaN, no whole numbers "
            "above 2^53 beside fractions"
        )
    if twice := [value for value, count in Counter(found).items() if count > 1]:
        raise InputError(f"{place}: holds {twice[0]!r} twice; for replicas add an axis of their own, such as seed")
    return found


# ---------------------------------------------------------------- Datasets


def _keys_of(table: Table) -> list[str]:
    """The cases of a sweep, in the order of its Dataset; of a search that is not done, those that have been run."""
    if "axes" in table.head:
        return [case_key(values) for values in combinations(table.head["axes"])]
    return list(table.head.get("cases", sorted(table.rows)))


def dataset_of(table: Table) -> xr.Dataset:
    """What came of all cases: over the axes of a grid, or along the ``run`` of a search, with its crossings."""
    import xarray as xr

    head, keys = table.head, _keys_of(table)
    if is_grid := "axes" in head:
        sizes = {name: len(values) for name, values in head["axes"].items()}
        places = {name: ((name,), array(values)) for name, values in head["axes"].items()}
    else:
        keys = [key for key in keys if key in table.rows]
        sizes, cases = {"run": len(keys)}, [json.loads(key) for key in keys]
        names = (*head["search"]["box"], *head["search"]["each"])
        places = {name: (("run",), array([case[name] for case in cases])) for name in names}
    coordinates = {name: (*place, attributes_of(head, name)) for name, place in places.items()}
    rows = [json.loads(table.rows.get(key, "null")) for key in keys]
    columns = {
        name: (tuple(sizes), values.reshape(*sizes.values()), about)
        for name, (values, about) in _columns(head, rows).items()
    }
    provenance = json.dumps(head["about"] | head.get("search", {}) | {"axes": sizes})
    found = xr.Dataset(columns, coordinates, {**head["notes"], PROVENANCE: provenance})
    return found if is_grid else _with_crossings(found, head)


def _with_crossings(found: xr.Dataset, head: Head) -> xr.Dataset:
    """Add the points of the boundary, half way between two runs, with what came of these, once all runs are there."""
    import xarray as xr

    search = head["search"]
    pairs = head["crossings"] if found.sizes["run"] == len(head.get("cases", ())) else []
    sides = np.array(pairs, dtype=int).reshape(-1, 2).T
    low, high = (found.reset_coords().isel(run=xr.DataArray(side, dims="crossing")) for side in sides)
    more = {}
    for name in search["box"]:
        at, error = (low[name] + high[name]) / 2, abs(high[name] - low[name]) / 2
        more[f"{name}_at"] = _titled(at.assign_attrs(low[name].attrs), "on the boundary")
        more[f"{name}_error"] = _titled(error.assign_attrs(low[name].attrs), "uncertainty")
    more |= {f"{name}_at": low[name] for name in search["each"]}
    if (label := search["label"]) in found:
        more[f"from_{label}"] = _titled(low[label], "on one side")
        more[f"to_{label}"] = _titled(high[label], "on the other")
    return found.assign(more)


def _titled(values: xr.DataArray, words: str) -> xr.DataArray:
    return values.assign_attrs(long_name=f"{values.attrs['long_name']}, {words}")


def _columns(head: Head, rows: Sequence[Mapping[str, Any] | None]) -> dict[str, tuple[NDArray[Any], dict[str, Any]]]:
    """All that cases returned, and what became of them: the values of each variable, and its attributes."""
    results = [(row or {}).get("result", {}) for row in rows]
    names = dict.fromkeys(name for result in results for name in result)
    found = {name: _column(head, name, [result.get(name) for result in results]) for name in names}
    states = [NOT_RUN if row is None else FAILED if "error" in row else DONE for row in rows]
    about = {"long_name": "what became of the case", "units": "1"} | _flags(["not run", "done", "failed"], NOT_RUN)
    found[STATUS] = np.array(states, dtype=np.int8), about
    errors = [(row or {}).get("error", "") for row in rows]
    title = {"long_name": "error of the case, empty if it went well", "units": "1"}
    found[ERROR] = np.array(errors, dtype=object), title
    return found


def _column(head: Head, name: str, values: Sequence[Any]) -> tuple[NDArray[Any], dict[str, Any]]:
    """What cases returned under a name, as an array, and its attributes: codes of words, texts, or numbers."""
    about = attributes_of(head, name)
    if words := head["categories"].get(name):
        codes = [words.index(value) if value in words else NO_RESULT for value in values]
        return np.array(codes, dtype=np.int8), _flags(["no result", *words], NO_RESULT) | about
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


def _flags(words: Sequence[str], first: int) -> dict[str, Any]:
    """CF attributes of a variable whose integers, from the first up, stand for words."""
    codes = np.arange(first, first + len(words), dtype=np.int8)
    return {"flag_values": codes, "flag_meanings": " ".join(word.replace(" ", "_") for word in words)}

"""A study at every combination of the values of its axes, and its results as one
labelled Dataset.
"""

import itertools
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from stickslip import __version__
from stickslip.errors import InputError, instance, shown, whole
from stickslip.io.files import FileName
from stickslip.sweep._cases import (
    ERROR,
    STATUS,
    AxisValue,
    NamedStudy,
    case_key,
    check_name,
)
from stickslip.sweep._refine import Refinement, Span, cases_of, search, spans_of
from stickslip.sweep._run import MAX_CASES, Report, Runner, Threads
from stickslip.sweep._table import Store, writer_of

# states of a case; the index is the code in the results
STATES = ("not run", "done", "failed")


def run_study(
    study: NamedStudy,
    axes: Mapping[str, Sequence[AxisValue] | NDArray[Any] | Span],
    *,
    store: FileName | None = None,
    executor: Executor | None = None,
    refinement: Refinement | None = None,
    progress: Report | None = None,
    retry_failed: bool = False,
    max_cases: int = MAX_CASES,
) -> xr.Dataset:
    """Run a study at every combination of the values of some axes.

    The results are the same, bit for bit, for any number of workers and any executor.

    Parameters
    ----------
    study : NamedStudy
        The function that runs a case, and the name and the version of its results.
    axes : mapping of name to values
        Numbers, texts or truth values, each value once. With a `refinement`, two axes
        are a `Span`. An axis that the function ignores makes replicas.
    store : path, optional
        File to which results are written as they finish, at least every second; a
        second start of the same study and version runs the missing cases, also with
        other values on the axes. By default results are kept in memory.
    executor : Threads, Processes or concurrent.futures.Executor, optional
        Where cases run; by default threads, one per core. For Dask:
        ``client.get_executor()``.
    refinement : Refinement, optional
        Search in a plane for the boundaries where a category changes, in place of a
        grid. A second start repeats no run, also with more runs or in another box.
    progress : callable, optional
        Called with a `Progress` at the start and whenever results have been written.
    retry_failed : bool
        Whether cases that failed before are run again.
    max_cases : int
        Number of cases beyond which a sweep is refused before it starts.

    Returns
    -------
    xarray.Dataset
        One variable for each measured name, with the axes as dimensions; ``status`` (CF
        flags: not run, done, failed); ``error``, the error of each case that failed,
        else empty. See `summary` and `failures`. A search has its runs and axes along
        ``run``, and the points of the boundary along ``crossing``: ``<name>_at``, the
        ``<name>_error`` to either side, and the categories ``from_<label>`` and
        ``to_<label>`` on both sides.

    Raises
    ------
    InputError
        If an argument is invalid; if the store holds another sweep, is damaged, is of
        another version, is being written by another process, or cannot be written (what
        was written is kept); if the workers cannot load the function.

    Examples
    --------
    >>> from stickslip.sweep import NamedStudy, run_study, summary
    >>> def area(width, height, seed):
    ...     return {"area": width * height}
    >>> study = NamedStudy(run=area, name="rectangles", version="1")
    >>> found = run_study(study, {"width": [1.0, 2.0], "height": [3.0, 4.0]})
    >>> float(found["area"].sel(width=2.0, height=4.0)), str(summary(found))
    (8.0, '4 of 4 cases done')
    """
    instance("study", study, NamedStudy, "a NamedStudy(run=..., name=..., version=...)")
    instance("axes", axes, Mapping, "a mapping of names to values")
    instance("refinement", refinement, Refinement | None, "a Refinement(...)")
    instance("progress", progress, Callable | None, "a function of a Progress")  # type: ignore[arg-type]
    instance("retry_failed", retry_failed, bool, "True or False")
    whole("max_cases", max_cases, at_least=1)
    if not axes:
        raise InputError("axes: must map at least one name to its values")
    for name in axes:
        check_name("axes", name)
    spans = spans_of(axes, refinement)
    values = {
        name: axis_values(name, given)
        for name, given in axes.items()
        if name not in spans
    }
    total = cases_of(axes, refinement)
    if total > max_cases:
        raise InputError(
            f"axes: {total:g} cases are more than max_cases = {max_cases:g}; take "
            "fewer values, or set max_cases higher (each case takes about 1 kB)"
        )
    head: dict[str, Any] = {
        "axes": values,
        "total": total,
        "about": {
            "stickslip": __version__,
            "study": study.name,
            "seed": study.seed,
        },
        "attributes": study.attributes,
        "categories": study.categories,
        "notes": study.notes,
        "identity": study.identity(axes),
    }
    if refinement is not None:
        box = {name: vars(span) for name, span in spans.items()}
        head["search"] = {"box": box, **vars(refinement)}
    with closing(Store(store, head)) as table:
        if retry_failed:
            table.forget_failed()
        workers = Threads() if executor is None else executor
        runner = Runner(table, study, workers, total, progress)
        if refinement is None:
            runner.run(_keys_of(table))
        else:
            table.write_head(**search(runner, spans, combinations(values), refinement))
        return dataset_of(table)


def open_sweep(store: FileName) -> xr.Dataset:
    """Open the results of a sweep, finished or not, as `run_study` returns them."""
    with closing(Store(store)) as table:
        return dataset_of(table)


@dataclass(frozen=True, kw_only=True)
class Failure:
    """A failed case: the values of its axes, and its error."""

    parameters: Mapping[str, AxisValue]
    error: str

    def __str__(self) -> str:
        where = ", ".join(
            f"{name} = {value!r}" for name, value in self.parameters.items()
        )
        return f"{where}: {self.error}"


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Numbers of cases of a sweep by state; as text, the last line of its progress."""

    total: int
    done: int
    failed: int
    missing: int

    def __str__(self) -> str:
        others = {"failed": self.failed, "not run yet": self.missing}
        return f"{self.done} of {self.total} cases done" + "".join(
            f", {n} {state}" for state, n in others.items() if n
        )


@dataclass(frozen=True, kw_only=True)
class Status:
    """Progress of the sweep in a store."""

    summary: Summary
    writer: str | None  #: the process that runs it, or None

    def __str__(self) -> str:
        at_it = (
            f"running as {self.writer}"
            if self.writer
            else "not running; start it again to continue"
        )
        return f"{self.summary}; {at_it}" if self.summary.missing else str(self.summary)


def status_of(store: FileName) -> Status:
    """Return the numbers of cases of a stored sweep by state, also while it runs."""
    with closing(Store(store)) as table:
        found = summary(dataset_of(table))
        going_on = "search" in table.head and "cases" not in table.head
        total = table.head["total"] if going_on else len(_keys_of(table))
    found = replace(found, total=total, missing=total - found.done - found.failed)
    return Status(summary=found, writer=writer_of(store))


def summary(dataset: xr.Dataset) -> Summary:
    """Count the cases of a sweep by their state."""
    status = _status(dataset).to_numpy()
    missing, done, failed = np.bincount(status.ravel(), minlength=3).tolist()
    return Summary(total=status.size, done=done, failed=failed, missing=missing)


def failures(dataset: xr.Dataset) -> list[Failure]:
    """Return the failed cases, with their parameters and errors."""
    status = _status(dataset)
    cases = dataset[[STATUS, ERROR]].expand_dims("case").to_dataframe().reset_index()
    failed = cases[cases[STATUS] == STATES.index("failed")]
    return [
        Failure(
            parameters={str(name): case[name] for name in status.coords},
            error=case[ERROR],
        )
        for case in failed.to_dict("records")
    ]


def _status(dataset: xr.Dataset) -> xr.DataArray:
    instance("dataset", dataset, xr.Dataset, "the result of a sweep")
    if STATUS not in dataset or ERROR not in dataset:
        raise InputError(
            f"dataset: has no variables {STATUS} and {ERROR}; must be the result of a "
            "sweep"
        )
    return dataset[STATUS]


def combinations(
    axes: Mapping[str, Sequence[AxisValue]],
) -> Iterator[dict[str, AxisValue]]:
    """Return all combinations of the values of the axes, the last axis fastest."""
    return (
        dict(zip(axes, values, strict=True))
        for values in itertools.product(*axes.values())
    )


def axis_values(name: str, given: object) -> list[AxisValue]:
    """Return the values of an axis as Python numbers, texts or truth values."""
    values = np.asarray(given, dtype=object)
    found = [
        one.item() if isinstance(one, np.generic) else one
        for one in (values.tolist() if values.ndim == 1 else [])
    ]
    kinds = {float if type(value) is int else type(value) for value in found}
    if (
        kinds not in ({float}, {str}, {bool})
        or np.array(found).tolist() != found
        or len({*found}) < len(found)
    ):
        raise InputError(
            f"axes[{name!r}] = {shown(given)}: must be a list of numbers, texts or "
            "truth values, each once, all of one "
            "kind, which one axis holds without loss (no NaN); for replicas add an "
            "axis of their own, such as seed"
        )
    return found


def _keys_of(table: Store) -> list[str]:
    """Return the keys of the cases in the order of the Dataset; for an unfinished
    search, of the cases run so far.
    """
    if "search" in table.head:
        return list(table.head.get("cases", sorted(table.rows)))
    return [case_key(values) for values in combinations(table.head["axes"])]


def dataset_of(table: Store) -> xr.Dataset:
    """Return the results of all cases: over the axes of a grid, or along ``run`` for a
    search, with its crossings.
    """
    head = table.head
    axes = head["axes"]
    keys = _keys_of(table)
    dims = {name: name for name in axes}
    is_search = "search" in head
    if is_search:
        keys = [key for key in keys if key in table.rows]
        cases = [json.loads(key) for key in keys]
        names = (*head["search"]["box"], *axes)
        axes = {name: [case[name] for case in cases] for name in names}
        dims = dict.fromkeys(names, "run")
    sizes = {dims[name]: len(values) for name, values in axes.items()}
    rows = [table.row(key) for key in keys]
    results = [row.get("result", {}) for row in rows]
    measured = dict.fromkeys(name for result in results for name in result)
    columns = {name: [result.get(name) for result in results] for name in measured}
    columns[STATUS] = [
        "failed" if "error" in row else "done" if row else "not run" for row in rows
    ]
    columns[ERROR] = [row.get("error", "") for row in rows]
    provenance = json.dumps(head["about"] | head.get("search", {}) | {"axes": sizes})
    found = xr.Dataset(attrs={**head["notes"], "provenance": provenance})
    for name, values in axes.items():
        found.coords[name] = (dims[name], *_column(head, name, values))
    for name, values in columns.items():
        column, about = _column(head, name, values)
        found[name] = (*sizes,), column.reshape(*sizes.values()), about
    return _with_crossings(found, head) if is_search else found


def _with_crossings(found: xr.Dataset, head: Mapping[str, Any]) -> xr.Dataset:
    """Add the points of the boundary, each halfway between two runs, with the results
    of these, if all runs are there.
    """
    search = head["search"]
    is_whole = found.sizes["run"] == len(head.get("cases", ()))
    pairs = np.array(head["crossings"] if is_whole else [], dtype=int).reshape(-1, 2)
    low, high = (
        found.reset_coords().isel(run=xr.DataArray(side, dims="crossing"))
        for side in pairs.T
    )
    more = {f"{name}_at": low[name] for name in head["axes"]}
    if (label := search["label"]) in found:
        more |= {f"from_{label}": low[label], f"to_{label}": high[label]}
    with xr.set_options(keep_attrs=True):  # type: ignore[no-untyped-call]
        for name in search["box"]:
            more[f"{name}_at"] = (low[name] + high[name]) / 2
            more[f"{name}_error"] = error = abs(high[name] - low[name]) / 2
            error.attrs["long_name"] += ", uncertainty"
    return found.assign(more)


def _column(
    head: Mapping[str, Any], name: str, values: Sequence[Any]
) -> tuple[NDArray[Any], dict[str, Any]]:
    """Return the results under a name as an array with its attributes: codes of
    categories, texts, or numbers.
    """
    about = {"long_name": name.replace("_", " "), "units": "1"}
    about |= head["attributes"].get(name, {})
    words = (
        STATES if name == STATUS else ("no result", *head["categories"].get(name, ()))
    )
    if len(words) > 1:
        flags = np.arange(len(words), dtype=np.int8) - (name != STATUS)
        codes = flags[[words.index(value) if value in words else 0 for value in values]]
        meanings = " ".join(word.replace(" ", "_") for word in words)
        return codes, {"flag_values": flags, "flag_meanings": meanings} | about
    is_text = any(isinstance(value, str) for value in values)
    none = "" if is_text else math.nan
    plain = [none if value is None else value for value in values]
    if is_text:
        return np.array([*map(str, plain)], dtype=object), about
    return np.array(plain), about

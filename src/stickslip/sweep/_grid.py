"""Run a function at every combination of the values of some axes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from stickslip.errors import InputError, instance
from stickslip.progress import in_time
from stickslip.sweep import _refine
from stickslip.sweep._cases import Function, case_key, plain_attribute
from stickslip.sweep._executors import Workers
from stickslip.sweep._results import Grid, Summary, axis_values, grid_dataset
from stickslip.sweep._run import Options, Progress, started
from stickslip.sweep._table import Table, writer_of

if TYPE_CHECKING:
    import xarray as xr


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
        numbers, texts, None (no value) or small arrays of numbers, the same names and shapes in every case. An
        `xarray.DataArray` brings dimensions, coordinates and attributes along. Numbers are kept as float64 or
        complex128, truth values as 0 and 1. If it has a parameter ``seed`` that is no axis, it is handed a seed of its
        own, made from `Options.seed` and the values of the axes. An axis that it ignores makes replicas.
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
    grid = Grid({name: axis_values(name, given) for name, given in axes.items()})
    given = options.attributes
    own = {name: dict(getattr(values, "attrs", {})) for name, values in axes.items()}
    merged = {
        name: {key: plain_attribute(value) for key, value in (own.get(name, {}) | dict(given.get(name, {}))).items()}
        for name in dict.fromkeys([*own, *given])
    }
    with started(
        function, {"axes": dict(grid.axes)}, list(grid.axes), len(grid),
        store=store, executor=executor, progress=progress, options=replace(options, attributes=merged),
    ) as runner:  # fmt: skip
        runner.run(grid)
        runner.table.keep_head()
        return grid_dataset(runner.table.head, runner.table.rows())


def open_sweep(store: str | PathLike[str]) -> xr.Dataset:
    """Open the results of a sweep, finished or not, as `run_cases` and `refine` return them.

    Raises
    ------
    InputError
        If there is no store of a sweep, it is damaged, or of another version.
    """
    with Table(Path(store)) as table:
        return grid_dataset(table.head, table.rows()) if "axes" in table.head else _refine.refined(table)


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
    """Say how far the sweep of a store is, also while it runs.

    Raises
    ------
    InputError
        As `open_sweep`.
    """
    path = Path(store)
    with Table(path) as table:
        head, writer = table.head, writer_of(path)
        if "axes" in head:
            keys = [case_key(values) for values in Grid(head["axes"])]
        else:
            keys = head.get("cases", list(table.keys))
        known = sum(key in table.keys for key in keys)
        failed = sum(key in table.failed for key in keys)
        is_open = "axes" not in head and "cases" not in head
        total = max(known, head["runs"] * len(Grid(head["each"]))) if is_open else len(keys)
        since = path.stat().st_mtime - head["started"]
        fresh = len(table.keys) - head["found"]
        return Status(
            summary=Summary(total=total, done=known - failed, failed=failed, missing=total - known),
            writer=writer,
            rate=fresh / since if since > 0 else 0.0,
        )

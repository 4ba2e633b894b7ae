"""Sweeps of a rig: from a file in TOML (rig, parameters to vary, what to measure) to a `Plan`, or from Python.

>>> from stickslip.sweep.plan import read_plan
>>> from stickslip.io.rig_files import example_file
>>> plan = read_plan(example_file("phase_diagram"))
>>> plan.parameters, plan.total
(('stiffness', 'velocity'), 3200)

``plan.run(store="phase.sqlite")`` runs what the store lacks.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError
from stickslip.io import datasets
from stickslip.io import rig_files as rigs
from stickslip.io.validation import read_toml, validate
from stickslip.model import Chain, Rig, Sheet, Slider, parameter_named
from stickslip.model.parameters import BY_NAME
from stickslip.sweep._executors import Workers
from stickslip.sweep._file import OTHERS, Document, axis_names
from stickslip.sweep._grid import open_sweep, run_cases
from stickslip.sweep._refine import Refinement, Span, refine
from stickslip.sweep._results import Failure, failures, summary
from stickslip.sweep._run import Options, Progress, Runs
from stickslip.sweep.study import KINDS, MEASURES, Study

if TYPE_CHECKING:
    import xarray as xr

EXAMPLE = "`stickslip new phase_diagram`"
_RECORDS = "records"
"""Key of a rig that no file describes, in the document of a sweep from Python: its records as JSON."""


# ---------------------------------------------------------------------------------------------------------------------
# The plan
# ---------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """A sweep of a rig.

    Attributes
    ----------
    name : str
    study : Study
        The case.
    axes : mapping
        Values of each axis in the units of the file, SI or natural; with a refinement, its two ends.
    logarithmic : tuple of str
        Axes of equal ratios.
    measures : tuple of str
        What is in the results of each case.
    seed : int
    refinement : Refinement, optional
    max_cases : int
        Cases beyond which the sweep is refused.
    document : mapping
        The content of the file, the rig included, every axis a table.
    """

    name: str
    study: Study
    axes: Mapping[str, NDArray[Any]]
    logarithmic: tuple[str, ...]
    measures: tuple[str, ...]
    seed: int
    refinement: Refinement | None
    max_cases: int
    document: Mapping[str, Any]

    @property
    def parameters(self) -> tuple[str, ...]:
        """Axes that set a parameter of the rig."""
        return tuple(name for name in self.axes if name not in OTHERS)

    @property
    def total(self) -> int:
        """Number of cases (at most, with a refinement)."""
        if self.refinement is not None:
            return self.refinement.runs * len(self.axes.get("start", [""]))
        return math.prod(len(values) for values in self.axes.values())

    def is_same(self, other: Plan) -> bool:
        """Whether another plan has the same cases."""
        names = {"name": ""}
        return {**self.document, **names} == {**other.document, **names}

    def attributes(self) -> dict[str, dict[str, Any]]:
        """Units and names of axes and results."""
        found: dict[str, dict[str, Any]] = {}
        rig = self.study.rig
        whole = rig.scales is not None  # SI: of the whole interface
        for name, (unit, title) in MEASURES.items():
            title = title.replace(", per contact", "") if whole else title
            found[name] = {"units": rig.unit_name(unit), "long_name": title}
        for name in self.axes:
            title, unit = OTHERS[name][1] if name in OTHERS else parameter_named(name).title, "1"
            if name not in OTHERS:
                unit = rig.unit_name(parameter_named(name).unit)
            spacing = "log" if name in self.logarithmic else "linear"
            found[name] = {"units": unit, "long_name": title, "spacing": spacing}
            if not whole and name in ("stiffness", "mass"):
                found[name]["long_name"] += ", per contact"
        return found

    def run(
        self,
        *,
        store: str | os.PathLike[str] | None = None,
        executor: Workers | None = None,
        progress: Callable[[Progress], object] | None = None,
        retry_failed: bool = False,
    ) -> xr.Dataset:
        """Run what is missing of a sweep; see `stickslip.sweep.run_cases` and `stickslip.sweep.refine`.

        Parameters
        ----------
        store : path, optional
            File that keeps all cases.
        executor, progress, retry_failed
            As there.

        Returns
        -------
        xarray.Dataset
            In the units of the file; its attribute ``sweep`` holds the file. ``regime`` is an integer with CF flags.

        Raises
        ------
        InputError
            As there.
        """
        options = Options(
            seed=self.seed,
            attributes=self.attributes(),
            categories={"regime": KINDS},
            notes={"sweep": self.to_toml()},
            retry_failed=retry_failed,
            max_cases=self.max_cases,
        )
        where: Any = {"store": store, "executor": executor, "progress": progress, "options": options}
        if self.refinement is None:
            return self.select(run_cases(self.study, self.axes, **where))
        ends = {name: self.axes[name] for name in self.parameters}
        box = {name: Span(low=float(a), high=float(b), log=name in self.logarithmic) for name, (a, b) in ends.items()}
        each = {"start": [str(start) for start in self.axes.get("start", [self.study.start])]}
        return self.select(refine(self.study, box, "regime", replace(self.refinement, each=each), **where))

    def select(self, found: xr.Dataset) -> xr.Dataset:
        """Of all that is stored of each case, what the file asks for."""
        return found.drop_vars([name for name in MEASURES if name not in (*self.measures, *self.axes)], errors="ignore")

    def to_toml(self) -> str:
        """Return the text of a file that `read_plan` takes."""
        import tomli_w

        return tomli_w.dumps(dict(self.document))


def sweep(
    rig: Rig,
    axes: Mapping[str, Sequence[float | str] | Span],
    *,
    store: str | os.PathLike[str] | None = None,
    executor: Workers | None = None,
    refinement: Refinement | None = None,
    runs: Runs = Runs(),
    progress: Callable[[Progress], object] | None = None,
    retry_failed: bool = False,
) -> xr.Dataset:
    """Run a rig at every combination of the values of some of its parameters; public as ``stickslip.sweep``.

    Parameters
    ----------
    rig : Rig
        Its method and start are those of every case, unless they are an axis.
    axes : mapping of name to values
        Parameters by name, as `Rig.replace` takes them, and ``contacts``, ``seed``, ``start`` (``"from rest"``,
        ``"sliding"``). Numbers in the rig's own units, or texts with a unit; a `Span` for each of two parameters with a
        `refinement`.
    store : path, optional
        File that keeps all cases; a second start runs what is missing.
    executor : Threads, Processes or concurrent.futures.Executor, optional
        Where cases run; by default threads, one per core.
    refinement : Refinement, optional
        Search the boundaries in a plane, in place of a grid.
    runs : Runs
        How long each run lasts and what is measured.
    progress : callable, optional
        Called with a `stickslip.sweep.Progress`.
    retry_failed : bool
        Whether cases that failed in an earlier start are run again.

    Returns
    -------
    xarray.Dataset
        In the rig's own units, with the axes as dimensions. ``regime`` is an integer with CF flags.

    Raises
    ------
    InputError
        As `stickslip.sweep.run_cases`.

    Examples
    --------
    >>> import stickslip as ss
    >>> from stickslip.sweep import Runs
    >>> short = Runs(distance="4 um", cycles=0)
    >>> found = ss.sweep(ss.example("pmma_slider"), {"velocity": ["0.4 mm/s"], "contacts": [20]}, runs=short)
    >>> found["peak_to_peak"].dims, found["velocity"].units
    (('velocity', 'contacts'), 'm/s')
    """
    if not isinstance(rig.slider, Slider | Chain | Sheet):
        raise InputError(
            f"rig.slider = {rig.slider!r}: must be a Slider, Chain or Sheet; an impedance cannot be simulated"
        )
    natural = rig.scales is None
    run: dict[str, Any] = {"cycles": runs.cycles, "extensions": runs.extensions, "max_cases": runs.max_cases}
    for name, length, unit in (("distance", runs.distance, "m"), ("duration", runs.duration, "s")):
        if length is not None:
            run[name] = _written(length, "" if natural else unit)
    # Its records, not the file it may come from: it may have been changed since.
    document: dict[str, Any] = {"name": rig.name, "rig": {_RECORDS: json.dumps(datasets.encode(rig))}, "run": run}
    document["axes"] = {}
    for name, given in axes.items():
        plain = natural or name not in BY_NAME or BY_NAME[name].unit == "1"
        unit = "" if plain else rig.unit_name(BY_NAME[name].unit)
        if isinstance(given, Span):
            ends = {"from": _written(given.low, unit), "to": _written(given.high, unit)}
            document["axes"][name] = ends | {"spacing": "log" if given.log else "linear"}
        else:
            document["axes"][name] = {"values": [_written(value, unit) for value in np.atleast_1d(given).tolist()]}
    if runs.measure is not None:
        document["measure"] = list(runs.measure)
    if refinement is not None:
        document["refine"] = {name: getattr(refinement, name) for name in ("runs", "resolution", "together")}
    plan = _plan(rig, document, "sweep")
    return plan.run(store=store, executor=executor, progress=progress, retry_failed=retry_failed)


def _written(value: Any, unit: str) -> Any:
    """A value as a file would have it."""
    return value if not unit or isinstance(value, str) else f"{float(value)!r} {unit}"


def open_plan(store: str | os.PathLike[str]) -> xr.Dataset:
    """Open the results of a sweep of a rig, finished or not, as `Plan.run` returns them.

    Raises
    ------
    InputError
        As `stickslip.sweep.open_sweep`.
    """
    found = open_sweep(store)
    return plan_of(found).select(found) if "sweep" in found.attrs else found


def plan_of(result: xr.Dataset) -> Plan:
    """Return the plan that a result was made from.

    Raises
    ------
    InputError
        If the result was not made from a rig.
    """
    import tomllib

    if "sweep" not in result.attrs:
        raise InputError("this sweep was not made from a sweep file: what was swept is not known; draw it in Python")
    return from_document(tomllib.loads(result.attrs["sweep"]), "the sweep file in this store")


# ---------------------------------------------------------------------------------------------------------------------
# Files
# ---------------------------------------------------------------------------------------------------------------------


def read_plan(path: str | os.PathLike[str]) -> Plan:
    """Read a sweep file.

    Raises
    ------
    InputError
        If the file, or the rig file that it names, cannot be read, has an unknown key, or a value that cannot be; the
        message names file, key, value and remedy.
    """
    source = Path(path)
    return from_document(read_toml(source, "sweep file", EXAMPLE), source.name, source.parent)


def from_document(document: Mapping[str, Any], place: str = "sweep", directory: Path = Path()) -> Plan:
    """Make a plan of the content of a file; a rig file that it names is looked for in `directory`."""
    document = dict(document)
    if not isinstance(document.get("axes"), dict) or not document["axes"]:
        raise InputError(f"{place}: axes: must be a table [axes] with at least one of {', '.join(axis_names())}")
    rig = _rig_of(document, place, directory)
    held = (
        document["rig"] if isinstance(document["rig"], dict) and _RECORDS in document["rig"] else rigs.to_document(rig)
    )
    return _plan(rig, document | {"rig": held}, place)


def _plan(rig: Rig, document: Mapping[str, Any], place: str) -> Plan:
    # All of them tables: written as TOML, lists would come first, and the order of the axes be lost.
    axes = {name: {"values": axis} if isinstance(axis, list) else axis for name, axis in document["axes"].items()}
    content = validate(Document.of(rig), document, place, natural=rig.scales is None)
    try:
        return Plan(**content.parts(rig, axes), document={**document, "axes": axes})
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


def _rig_of(document: Mapping[str, Any], place: str, directory: Path) -> Rig:
    given = document.get("rig")
    if isinstance(given, str):
        try:
            return rigs.read_rig(directory / given)
        except InputError as error:
            raise InputError(f"{place}: rig: {error}") from None
    if not isinstance(given, dict):
        what = "is missing" if given is None else f"= {given!r}"
        raise InputError(f"{place}: rig {what}: must be the name of a rig file, or a table [rig] with what one holds")
    if _RECORDS in given:
        return _decoded(given[_RECORDS], place)
    speeds = document["axes"].get("velocity")
    if "drive" not in given and speeds:  # the axis sets the speed
        ends = speeds.get("values", [speeds.get("to")]) if isinstance(speeds, dict) else speeds
        given = given | {"drive": {"velocity": ends[-1] if isinstance(ends, list) and ends else ends}}
    return rigs.from_document(given, f"{place}: rig")


def _decoded(text: object, place: str) -> Rig:
    """The rig of a sweep made from Python."""
    try:
        rig = datasets.decode(json.loads(str(text)), datasets.records())
    except ValueError as error:  # InputError is one
        raise InputError(f"{place}: rig.{_RECORDS}: cannot be read ({error})") from None
    if not isinstance(rig, Rig):
        raise InputError(f"{place}: rig.{_RECORDS}: holds no rig")
    return rig


# ---------------------------------------------------------------------------------------------------------------------
# In short
# ---------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Report:
    """What became of a sweep, for a person or a machine.

    Attributes
    ----------
    line : str
        The last line.
    regimes : mapping of str to int
        How many cases each regime has.
    failures : tuple of Failure
    crossings : int or None
        Points found on the boundaries by a refinement.
    """

    line: str
    total: int
    done: int
    failed: int
    missing: int
    regimes: Mapping[str, int]
    failures: tuple[Failure, ...]
    crossings: int | None = None


def report(result: xr.Dataset) -> Report:
    """Count the regimes and the failures of a sweep or a refinement."""
    codes = result["regime"].to_numpy() if "regime" in result else np.empty(0)
    regimes = {kind: int(np.count_nonzero(codes == code)) for code, kind in enumerate(KINDS) if (codes == code).any()}
    counted, crossings = summary(result), result.sizes.get("crossing")
    line = str(counted) + ("" if crossings is None else f"; {crossings} points found where the regime changes")
    return Report(**asdict(counted), line=line, regimes=regimes, failures=tuple(failures(result)), crossings=crossings)

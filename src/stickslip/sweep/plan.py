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
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.errors import InputError, instance, number, sequence, shown, together, whole
from stickslip.io import datasets
from stickslip.io import rig_files as rigs
from stickslip.io.keys import Key, Sign
from stickslip.io.rig_keys import methods_with
from stickslip.io.tables import read_toml, unknown
from stickslip.model import ElasticBody, FromRest, FromSliding, Rig, Slider
from stickslip.model.methods import DRAWN
from stickslip.model.parameters import BY_NAME
from stickslip.simulation import check_method
from stickslip.sweep._dataset import open_sweep, run_cases
from stickslip.sweep._executors import Workers
from stickslip.sweep._refine import Refinement, Span, refine
from stickslip.sweep._run import Options, Progress, Runs, check_size
from stickslip.sweep.study import FROM_REST, FROM_SLIDING, KINDS, MEASURES, USUAL, Study

if TYPE_CHECKING:
    import xarray as xr

SHORTEST = 120.0
"""``x_s`` that a run lasts at least unless something else is asked for: transients last 40 to 100 ``x_s``."""
NOTE = "sweep"
"""Attribute of the results that holds the plan."""
OTHERS = {
    "contacts": "number of contacts",
    "seed": "seed of the contacts",
    "start": "start of the run",
}
"""What can be an axis besides the parameters of a rig."""
_START = Key(FROM_SLIDING, choices=(FROM_REST, FROM_SLIDING))
_SIGNS: tuple[Sign, Sign] = ("above 0", "at least 0")
_SPACING = Key("linear", choices=("linear", "log"))


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A sweep of a rig.

    Attributes
    ----------
    name : str
    study : Study
        The case.
    axes : mapping
        Values of each axis in the units of the rig, SI or natural; with a refinement, a `Span` of two parameters.
    measures : tuple of str
        What is in the results of each case.
    refinement : Refinement, optional
    max_cases : int
        Cases beyond which the sweep is refused.
    """

    name: str
    study: Study
    axes: Mapping[str, Any]
    measures: tuple[str, ...]
    refinement: Refinement | None
    max_cases: int

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

    def attributes(self) -> dict[str, dict[str, Any]]:
        """Units and names of axes and results."""
        found: dict[str, dict[str, Any]] = {}
        rig = self.study.rig
        whole = rig.scales is not None  # SI: of the whole interface
        for name, (unit, title) in MEASURES.items():
            title = title.replace(", per contact", "") if whole else title
            found[name] = {"units": rig.unit_name(unit), "long_name": title}
        for name in self.axes:
            title, unit = (OTHERS[name], "1") if name in OTHERS else (BY_NAME[name].title, BY_NAME[name].unit)
            title += ", per contact" if not whole and name in ("stiffness", "mass") else ""
            spacing = "log" if _is_logarithmic(self.axes[name]) else "linear"
            found[name] = {"units": rig.unit_name(unit), "long_name": title, "spacing": spacing}
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
            In the units of the rig; its attribute ``sweep`` holds the plan as JSON. ``regime`` is an integer
            with CF flags.

        Raises
        ------
        InputError
            As there.
        """
        options = Options(
            seed=getattr(self.study.rig.method, "seed", 0),
            attributes=self.attributes(),
            categories={"regime": KINDS},
            notes={NOTE: self.to_json()},
            retry_failed=retry_failed,
            max_cases=self.max_cases,
        )
        where: Any = {"store": store, "executor": executor, "progress": progress, "options": options}
        if self.refinement is None:
            return self.select(run_cases(self.study, self.axes, **where))
        box = {name: self.axes[name] for name in self.parameters}
        each = {"start": self.axes.get("start", (self.study.start,))}
        return self.select(refine(self.study, box, "regime", replace(self.refinement, each=each), **where))

    def select(self, found: xr.Dataset) -> xr.Dataset:
        """Of all that is stored of each case, what is asked for."""
        return found.drop_vars([name for name in MEASURES if name not in (*self.measures, *self.axes)], errors="ignore")

    def to_json(self) -> str:
        """Return a text that `plan_of` reads again."""
        return json.dumps(datasets.encode(self))


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
    try:
        plan = _plan(rig, axes, runs, refinement, rig.name, from_python=True)
    except InputError as error:
        raise InputError(f"sweep: {error}") from None
    return plan.run(store=store, executor=executor, progress=progress, retry_failed=retry_failed)


def open_plan(store: str | os.PathLike[str]) -> xr.Dataset:
    """Open the results of a sweep of a rig, finished or not, as `Plan.run` returns them."""
    found = open_sweep(store)
    return plan_of(found).select(found) if NOTE in found.attrs else found


def plan_of(result: xr.Dataset) -> Plan:
    """Return the plan that a result was made from."""
    if NOTE not in result.attrs:
        raise InputError("this sweep was not made from a rig: what was swept is not known; draw it in Python")
    kinds = datasets.records() | {kind.__name__: kind for kind in (Plan, Study, Refinement, Span)}
    try:
        found: Plan = datasets.decode(json.loads(str(result.attrs[NOTE])), kinds)
        instance("rig", found.study.rig, Rig, "a rig")
    except (ValueError, AttributeError) as error:  # InputError is a ValueError
        raise InputError(f"the plan of this sweep: cannot be read ({error})") from None
    return found


# ---------------------------------------------------------------- files

_SIMULATED = ("method", "contacts", "rtol", "seed", "start")
"""Keys of ``[run]`` that stand under ``[simulation]`` in a rig file."""
_LASTING = tuple(each.name for each in fields(Runs) if each.name != "measure")


def read_plan(path: str | os.PathLike[str]) -> Plan:
    """Read a sweep file, and the rig file that it may name."""
    source = Path(path)
    return from_document(read_toml(source, "sweep file", "`stickslip new phase_diagram`"), source.name, source.parent)


def from_document(document: Mapping[str, Any], place: str = "sweep", directory: Path = Path()) -> Plan:
    """Make a plan of the content of a file; a rig file that it names is looked for in `directory`."""
    try:
        _check_keys(document, ("name", "rig", "axes", "run", "measure", "refine"), "")
        axes, run = document.get("axes", {}), document.get("run", {})
        _check_keys(axes, (*BY_NAME, *OTHERS), "axes")
        _check_keys(run, (*_SIMULATED, *_LASTING), "run")
        refinement = None
        if "refine" in document:
            _check_keys(document["refine"], ("runs", "resolution", "together"), "refine")
            refinement = Refinement(**document["refine"])
        runs = Runs(measure=document.get("measure"), **{key: run[key] for key in _LASTING if key in run})
        rig = _rig_of(document.get("rig"), run, axes.get("velocity"), directory)
        instance("name", name := document.get("name", "sweep"), str, "a text")
        return _plan(rig, axes, runs, refinement, name)
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


def _rig_of(given: object, run: Mapping[str, Any], speeds: Any, directory: Path) -> Rig:
    """Read the rig of a sweep, to be simulated as ``[run]`` says."""
    place = "rig"
    if isinstance(given, str):
        place = f"rig: {Path(given).name}"
        given = rigs.content_of(directory / given)
    if not isinstance(given, Mapping):
        what = "is missing" if given is None else f"= {given!r}"
        raise InputError(f"rig {what}: must be the name of a rig file, or a table [rig] with what one holds")
    if "drive" not in given and speeds:  # the axis sets the speed
        last = speeds.get("to") if isinstance(speeds, dict) else speeds[-1] if isinstance(speeds, list) else speeds
        given = {**given, "drive": {"velocity": last}}
    own = given.get("simulation", {})
    if isinstance(own, Mapping):
        other = run.get("method")
        left = [key for key in ("contacts", "seed", "rtol") if other and other not in methods_with(key)]
        asked = {key: run[key] for key in _SIMULATED if key in run}
        given = {**given, "simulation": {key: own[key] for key in own if key not in left} | asked}
    try:
        return rigs.from_document(given, place)
    except InputError as error:
        words = re.sub(r"\bsimulation\.(\w+)", lambda key: f"run.{key[1]}" if key[1] in run else key[0], str(error))
        raise InputError(words) from None


# ---------------------------------------------------------------- axes


@dataclass(frozen=True, kw_only=True)
class _AxisReader:
    """Reads the axes of a rig; from Python, plain numbers are in SI units, too."""

    rig: Rig
    most: int
    from_python: bool

    def axis(self, name: str, given: Any) -> Sequence[Any] | Span:
        """Values of a list or of ``{from, to, count, spacing}``; a `Span` where the count is left open."""
        place = f"axes.{name}"
        if isinstance(given, Span):
            return given
        if isinstance(given, Mapping):
            return self._between(name, given, place)
        listed = np.atleast_1d(given).tolist() if self.from_python else given
        if not isinstance(listed, list) or not listed:
            raise InputError(
                f"{place} = {shown(given)}: must be a list of values, at least one, or a table with from, to and count"
            )
        return tuple(self._value(name, value, f"{place}.{i}") for i, value in enumerate(listed))

    def quantity(self, key: Key, value: Any, place: str) -> Any:
        """Read a value in the rig's own units."""
        natural = self.rig.scales is None or (self.from_python and not isinstance(value, str))
        return key.read(value, place, natural=natural)

    def _between(self, name: str, given: Mapping[str, Any], place: str) -> Sequence[Any] | Span:
        _check_keys(given, ("from", "to", "count", "spacing"), place)
        for key in ("count",) if name == "seed" else ("from", "to"):
            if key not in given:
                raise InputError(f"{place}.{key}: is missing")
        count = whole(f"{place}.count", given.get("count", 2), at_least=1 if name == "seed" else 2)
        check_size(count, self.most)
        low, high = (self._value(name, given.get(key, 1), f"{place}.{key}") for key in ("from", "to"))
        if name == "seed":
            return tuple(range(low, low + count))
        if isinstance(low, str) or high <= low:
            raise InputError(f"{place}: to = {given['to']} must be above from = {given['from']}")
        log = _SPACING.read(given.get("spacing", "linear"), f"{place}.spacing", natural=True) == "log"
        if log and low <= 0:
            raise InputError(f"{place}: from = {given['from']} must be above 0 for spacing = 'log'")
        if "count" not in given:
            return Span(low=low, high=high, log=log)
        values = (np.geomspace if log else np.linspace)(low, high, count)
        return tuple((np.unique(np.rint(values).astype(int)) if name == "contacts" else values).tolist())

    def _value(self, name: str, value: Any, place: str) -> Any:
        if name == "start":
            return _START.read(value, place, natural=True)
        if name in OTHERS:
            return whole(place, value, at_least=1 if name == "contacts" else 0, at_most=2**53 - 1)
        unit, sign = BY_NAME[name].unit, _SIGNS[BY_NAME[name].zero]
        key = Key(1.0) if unit == "1" else Key(f"2 {self.rig.unit_name(unit)}", unit=unit, sign=sign)
        return self.quantity(key, value, place)


def _check_keys(content: object, known: Iterable[str], place: str) -> None:
    """Refuse what is no table, and all keys of a table that are unknown."""
    known = tuple(known)
    if not isinstance(content, Mapping):
        raise InputError(f"{place} = {shown(content)}: must be a table, as in [{place}]")
    path = f"{place}." if place else ""
    if strange := [str(key) for key in content if key not in known]:
        raise InputError(together(f"{path}{key[:60]}: unknown key; {unknown(key, known)}" for key in strange))


def _is_logarithmic(axis: Sequence[Any] | Span) -> bool:
    """Whether an axis is one of equal ratios, by its values if it is a list."""
    if isinstance(axis, Span):
        return axis.log
    if len(axis) < 3 or isinstance(axis[0], str) or min(axis) <= 0:
        return False
    steps, ratios = np.diff(np.sort(axis)), np.diff(np.log(np.sort(axis)))
    return bool(np.ptp(ratios) / ratios.mean() < np.ptp(steps) / steps.mean())


# ---------------------------------------------------------------- what can be planned


def _plan(
    rig: Rig,
    axes: Mapping[str, Any],
    runs: Runs,
    refinement: Refinement | None,
    name: str,
    *,
    from_python: bool = False,
) -> Plan:
    """Make a plan of a rig with its method and start."""
    _check_keys(axes, (*BY_NAME, *OTHERS), "axes")  # parameters registered since then included
    most = whole("run.max_cases", runs.max_cases, at_least=1)
    reader = _AxisReader(rig=rig, most=most, from_python=from_python)
    values = {each: reader.axis(each, given) for each, given in axes.items()}
    _check(rig, values, refinement)
    lasting = {"distance": SHORTEST, "duration": 0.0}  # in natural units
    for key, unit in (("distance", "x_s"), ("duration", "time")):
        if (value := getattr(runs, key)) is not None:
            read = reader.quantity(Key(f"2 {rig.unit_name(unit)}", unit=unit, sign="above 0"), value, f"run.{key}")
            lasting[key] = float(read) / rig.unit(unit)
    study = Study(
        rig=replace(rig, name="", assumed={}, source=""),
        cycles=number("run.cycles", runs.cycles, at_least=0),
        extensions=whole("run.extensions", runs.extensions, at_least=0, at_most=10),
        **lasting,
    )
    measure = [str(one) for one in sequence("measure", runs.measure or USUAL, "a list of names")]
    for one in measure:
        if one not in MEASURES:
            raise InputError(f"measure: {one!r} is not measured in a sweep; {unknown(one, MEASURES)}")
    measures = tuple(each for each in MEASURES if each in ("regime", "seed", *measure))
    return Plan(name=name, study=study, axes=values, measures=measures, refinement=refinement, max_cases=most)


def _check(rig: Rig, axes: Mapping[str, Any], refinement: Refinement | None) -> None:
    """Refuse a rig that cannot be run along these axes, and axes that are none of a search."""
    instance("rig.slider", rig.slider, Slider | ElasticBody, "a Slider, Chain or Sheet: an impedance has no motion")
    for name in ("seed", "contacts"):
        if name in axes and not isinstance(rig.method, DRAWN):
            raise InputError(f"axes.{name}: changes nothing where no contacts are drawn; use method = 'contacts'")
    if not isinstance(rig.start, FromRest | FromSliding):
        raise InputError("rig.simulation.start: each run of a sweep starts 'from rest' or 'sliding'")
    if len(rig.drive.pieces) > 1 or rig.drive.pieces[0].start != rig.drive.pieces[0].end:
        raise InputError("rig.drive.pieces: each run of a sweep holds one velocity; give drive.velocity")
    check_method(rig.interface, rig.method, rig.slider)
    if rig.slider.mass == 0 and "mass" not in axes:
        raise InputError("rig.slider.mass = 0: a run needs a mass above 0")
    parameters = [name for name in axes if name in BY_NAME]
    for name in parameters:
        rig.value(name)  # it has one
    number("rig.drive.velocity", rig.velocity, above=0)
    spans = [name for name in axes if isinstance(axes[name], Span)]
    if refinement is None and spans:
        raise InputError(f"axes.{spans[0]}.count: is missing, the number of values from one end to the other")
    if refinement is not None and (len(spans) != 2 or {*axes} - {*spans, "start"}):
        raise InputError(
            "axes: [refine] searches the plane of two parameters: give from, to and spacing of two, without count, and "
            "at most start beside them"
        )

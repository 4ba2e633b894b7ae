"""Sweeps of a rig, made from a TOML file (rig, parameters to vary, results) as a
`Plan`, or from Python.

>>> from stickslip.sweep.plan import read_plan
>>> from stickslip.io.rig_files import example_file
>>> plan = read_plan(example_file("phase_diagram"))
>>> plan.parameters, plan.total
(('stiffness', 'velocity'), 3200)

``plan.run(store="phase.sqlite")`` runs what the store lacks.
"""

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from stickslip.errors import (
    InputError,
    instance,
    number,
    sequence,
    shown,
    together,
    whole,
)
from stickslip.io import datasets
from stickslip.io import rig_files as rigs
from stickslip.io.files import FileName, as_path
from stickslip.io.keys import Key
from stickslip.io.rig_keys import methods_with
from stickslip.io.tables import Tables, at, unknown
from stickslip.model import ElasticBody, FromRest, FromSliding, Rig, Slider
from stickslip.model.methods import DRAWN
from stickslip.model.parameters import BY_NAME
from stickslip.model.structure import Structure
from stickslip.simulation import check_method
from stickslip.sweep._cases import NamedStudy
from stickslip.sweep._dataset import open_sweep, run_study
from stickslip.sweep._refine import Refinement, Span, cases_of, spans_of
from stickslip.sweep._run import Report, Runs
from stickslip.sweep.study import FROM_REST, FROM_SLIDING, KINDS, MEASURES, USUAL, Study

# least travel of a run in x_s, by default: transients last 40 to 100 x_s
SHORTEST = 120.0
NOTE = "sweep"  # attribute of the results that holds the plan
PER_CONTACT = ("peak_to_peak", "mean_force", "drop", "stiffness", "mass")
"""Results and parameters per contact in natural units, and for the whole interface in
SI units.
"""
OTHERS = {
    "contacts": "number of contacts",
    "seed": "seed of the contacts",
    "start": "start of the run",
}
"""Axes that are not parameters of a rig."""
_START = Key(FROM_SLIDING, choices=(FROM_REST, FROM_SLIDING))
_SPACING = Key("linear", choices=("linear", "log"))


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A sweep of a rig."""

    name: str
    study: Study  #: runs one case
    #: values in the units of the rig; with a refinement, two parameters have a `Span`
    axes: Mapping[str, Any]
    logarithmic: tuple[str, ...]  #: axes of equal ratios
    measures: tuple[str, ...]  #: names of the results of each case
    refinement: Refinement | None
    max_cases: int  #: cases beyond which the sweep is refused

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the axes that are parameters of the rig."""
        return tuple(name for name in self.axes if name not in OTHERS)

    @property
    def total(self) -> int:
        """Number of cases; with a refinement, the largest number."""
        return cases_of(self.axes, self.refinement)

    def attributes(self) -> Mapping[str, Mapping[str, Any]]:
        """Units and names of axes and results."""
        rig = self.study.rig
        named = MEASURES | {name: ("1", title) for name, title in OTHERS.items()}
        for name in self.parameters:
            named[name] = (BY_NAME[name].unit, BY_NAME[name].title)
        found = {}
        for name, (unit, title) in named.items():
            if rig.scales is None and name in PER_CONTACT:
                title += ", per contact"
            found[name] = {"units": rig.unit_name(unit), "long_name": title}
        for name in self.axes:
            found[name]["spacing"] = "log" if name in self.logarithmic else "linear"
        return found

    def run(
        self,
        *,
        store: FileName | None = None,
        executor: Executor | None = None,
        progress: Report | None = None,
        retry_failed: bool = False,
    ) -> xr.Dataset:
        """Run the missing cases of a sweep; arguments, errors and result are those of
        `sweep`.

        The attribute ``sweep`` of the results holds the plan as JSON.
        """
        study = NamedStudy(
            run=self.study,
            name="sweep of a rig",
            # all that a case of a rig depends on, besides the version of this package
            version=json.dumps(datasets.encode(replace(self.study, long=False))),
            seed=getattr(self.study.rig.method, "seed", 0),
            attributes=self.attributes(),
            categories={"regime": KINDS},
            notes={NOTE: json.dumps(datasets.encode(self))},
        )
        axes = dict(self.axes)
        if self.refinement is not None:
            axes = {"start": (self.study.start,), **axes}
        found = run_study(
            study,
            axes,
            store=store,
            executor=executor,
            refinement=self.refinement,
            progress=progress,
            retry_failed=retry_failed,
            max_cases=self.max_cases,
        )
        return self.select(found)

    def select(self, found: xr.Dataset) -> xr.Dataset:
        """Return the selected results, of all that are stored."""
        left = MEASURES.keys() - {*self.measures, *self.axes}
        return found.drop_vars(left, errors="ignore")


def sweep(
    rig: Rig,
    axes: Mapping[str, Sequence[float | str] | Span],
    *,
    store: FileName | None = None,
    executor: Executor | None = None,
    refinement: Refinement | None = None,
    runs: Runs = Runs(),
    progress: Report | None = None,
    retry_failed: bool = False,
) -> xr.Dataset:
    """Run a rig at every combination of the values of some of its parameters; public as
    ``stickslip.sweep``.

    Parameters
    ----------
    rig : Rig
        The rig; its method and start are those of every case, unless they are an axis.
    axes : mapping of name to values
        Parameters by name, as in `Rig.replace`, and ``contacts``, ``seed``, ``start``
        (``"from rest"``, ``"sliding"``). Numbers in the rig's own units, or texts with
        a unit; with a `refinement`, two parameters have a `Span`.
    store : path, optional
        File that keeps all cases; a second start runs the missing ones.
    executor : Threads, Processes or concurrent.futures.Executor, optional
        Where cases run; by default threads, one per core.
    refinement : Refinement, optional
        Search for the boundaries in a plane, in place of a grid.
    runs : Runs
        Length of each run, and names of the results.
    progress : callable, optional
        Called with a `stickslip.sweep.Progress`.
    retry_failed : bool
        Whether cases that failed before are run again.

    Returns
    -------
    xarray.Dataset
        In the rig's own units, with the axes as dimensions. ``regime`` is an integer
        with CF flags.

    Raises
    ------
    InputError
        As `stickslip.sweep.run_study`.

    Examples
    --------
    >>> from stickslip.sweep import Runs
    >>> short = Runs(distance="4 um", cycles=0)
    >>> found = ss.sweep(
    ...     ss.example("pmma_slider"),
    ...     {"velocity": ["0.4 mm/s"], "contacts": [20]},
    ...     runs=short,
    ... )
    >>> found["peak_to_peak"].dims, found["velocity"].units
    (('velocity', 'contacts'), 'm/s')
    """
    instance("sweep: rig", rig, Rig, "a Rig(interface, slider, drive)")
    instance("sweep: runs", runs, Runs, "a sweep.Runs(...)")
    plan = _plan(rig, axes, runs, refinement, rig.name, from_python=True)
    return plan.run(
        store=store, executor=executor, progress=progress, retry_failed=retry_failed
    )


def open_plan(store: FileName) -> xr.Dataset:
    """Open the results of a sweep of a rig, finished or not, as `Plan.run` returns
    them.
    """
    found = open_sweep(store)
    return plan_of(found).select(found) if NOTE in found.attrs else found


def plan_of(result: xr.Dataset) -> Plan:
    """Return the plan that made a result."""
    if NOTE not in result.attrs:
        raise InputError(
            "this sweep was not made from a rig: what was swept is not known; draw it "
            "in Python"
        )
    kinds = datasets.records() | {
        kind.__name__: kind for kind in (Plan, Study, Refinement, Span)
    }
    try:
        found: Plan = datasets.decode(json.loads(str(result.attrs[NOTE])), kinds)
        instance("rig", found.study.rig, Rig, "a rig")
    except (ValueError, AttributeError) as error:  # InputError is a ValueError
        raise InputError(f"the plan of this sweep: cannot be read ({error})") from None
    return found


_SIMULATED = ("method", "contacts", "rtol", "seed", "start")
"""Keys of ``[run]`` that are under ``[simulation]`` in a rig file."""
_LASTING = tuple(each.name for each in fields(Runs) if each.name != "measure")


def read_plan(path: FileName) -> Plan:
    """Read a sweep file or the example of that name, and the rig file that it names, if
    any.
    """
    source = as_path(path)
    return from_document(
        rigs.content_of(source, "sweep file", "`stickslip new phase_diagram`"),
        source.name,
        source.parent,
    )


def from_document(
    document: Mapping[str, Any], place: str = "sweep", directory: Path = Path()
) -> Plan:
    """Make a plan from the content of a file; a rig file that it names is searched in
    `directory`.
    """
    try:
        _check_keys(document, ("name", "rig", "axes", "run", "measure", "refine"), "")
        axes, run, refine = (document.get(key, {}) for key in ("axes", "run", "refine"))
        _check_keys(axes, (*BY_NAME, *OTHERS), "axes")
        _check_keys(run, (*_SIMULATED, *_LASTING), "run")
        _check_keys(refine, ("runs", "resolution"), "refine")
        refinement = Refinement(**refine) if "refine" in document else None
        runs = Runs(
            measure=document.get("measure"),
            **{key: run[key] for key in _LASTING if key in run},
        )
        rig = _rig_of(document.get("rig"), run, axes.get("velocity"), directory)
        instance("name", name := document.get("name", "sweep"), str, "a text")
        return _plan(rig, axes, runs, refinement, name)
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


def _rig_of(given: object, run: Mapping[str, Any], speeds: Any, directory: Path) -> Rig:
    """Read the rig of a sweep, with its simulation changed by the table ``[run]``."""
    place = "rig"
    if isinstance(given, str):
        place = f"rig: {Path(given).name}"
        given = rigs.content_of(directory / given)
    if not isinstance(given, Mapping):
        raise InputError(
            f"rig = {shown(given)}: must be the name of a rig file, or a table [rig] "
            "with what one holds"
        )
    if "drive" not in given and speeds:  # the axis sets the speed
        last = speeds
        if isinstance(speeds, dict):
            last = speeds.get("to")
        elif isinstance(speeds, list):
            last = speeds[-1]
        given = {**given, "drive": {"velocity": last}}
    own = given.get("simulation", {})
    if isinstance(own, Mapping):
        asked = {key: run[key] for key in _SIMULATED if key in run}
        # keys of the rig's own method that the method of the sweep does not have
        left = [
            key
            for key in ("contacts", "seed", "rtol")
            if "method" in run and run["method"] not in methods_with(key)
        ]
        kept = {key: value for key, value in own.items() if key not in left}
        given = {**given, "simulation": kept | asked}
    try:
        return rigs.from_document(given, place)
    except InputError as error:
        words = re.sub(
            r"\bsimulation\.(\w+)",
            lambda key: f"run.{key[1]}" if key[1] in run else key[0],
            str(error),
        )
        raise InputError(words) from None


def _axis(
    name: str, given: Any, read: Callable[..., float], most: int
) -> tuple[Any, ...] | Span:
    """Return the values of a list or of ``{from, to, count, spacing}``; a `Span` if the
    count is missing.
    """
    place = f"axes.{name}"

    def value(given: object, place: str) -> Any:
        return _on_axis(name, given, place, read)

    if isinstance(given, Span):
        value(given.low, f"{place}.from")
        return given
    if isinstance(given, Mapping) and name != "start":
        return _spaced(name, given, value, most)
    listed = sequence(
        place, given, "a list of values, or a table with from, to and count"
    )
    return tuple(value(each, f"{place}.{i}") for i, each in enumerate(listed))


def _on_axis(name: str, given: object, place: str, read: Callable[..., float]) -> Any:
    """Read one value of an axis."""
    if name == "start":
        return _START.read(given, place, natural=True)
    if name in OTHERS:
        return whole(place, given, at_least=name == "contacts", at_most=2**53 - 1)
    parameter = BY_NAME[name]
    sign = "at least 0" if parameter.zero else "above 0"
    return read(given, place, parameter.unit, sign=sign)


def _spaced(
    name: str, given: Mapping[str, Any], value: Callable[[object, str], Any], most: int
) -> tuple[Any, ...] | Span:
    """Return the values of a table ``{from, to, count, spacing}``; a `Span` if the
    count is missing.
    """
    place = f"axes.{name}"
    _check_keys(given, ("from", "to", "count", "spacing"), place)
    for key in ("count",) if name == "seed" else ("from", "to"):
        if key not in given:
            raise InputError(f"{place}.{key}: is missing")
    count = whole(f"{place}.count", given.get("count", 2), at_least=1, at_most=most)
    low, high = (value(given.get(key, 1), f"{place}.{key}") for key in ("from", "to"))
    if name == "seed":
        return tuple(range(low, low + count))
    spacing = given.get("spacing", "linear")
    log = _SPACING.read(spacing, f"{place}.spacing", natural=True) == "log"
    with at(place, {"low": "from", "high": "to"}):
        span = Span(low=low, high=high, log=log)
    if "count" not in given:
        return span
    values = np.geomspace(low, high, count) if log else np.linspace(low, high, count)
    if name == "contacts":
        values = np.unique(np.rint(values)).astype(int)
    return tuple(values.tolist())


def _is_logarithmic(given: Any, values: Any) -> bool:
    """Whether an axis has equal ratios: as given, or for a list, by its values."""
    if isinstance(given, Span):
        return given.log
    if isinstance(given, Mapping):
        return given.get("spacing") == "log"
    if len(values) < 3 or isinstance(values[0], str) or min(values) <= 0:
        return False
    steps = np.diff(np.sort(values))
    ratios = np.diff(np.log(np.sort(values)))
    return bool(np.ptp(ratios) * steps.mean() < np.ptp(steps) * ratios.mean())


def _check_keys(content: object, known: Iterable[str], place: str) -> None:
    """Raise `InputError` if it is not a table, or has unknown keys."""
    tables = Tables(natural=True)
    tables.table(content, dict.fromkeys(known, Key({})), place)
    if tables.mistakes:
        raise InputError(together(map(str, tables.mistakes)))


def _plan(
    rig: Rig,
    axes: Mapping[str, Any],
    runs: Runs,
    refinement: Refinement | None,
    name: str,
    *,
    from_python: bool = False,
) -> Plan:
    """Make a plan from a rig with its method and start; plain numbers from Python are
    in the rig's own units, also in SI.
    """

    def read(value: object, place: str, unit: str, sign: Any = "above 0") -> float:
        """Return a quantity in the rig's own units."""
        natural = rig.scales is None or (from_python and not isinstance(value, str))
        key = (
            Key(1.0)
            if unit == "1"
            else Key(f"2 {rig.unit_name(unit)}", unit=unit, sign=sign)
        )
        return float(key.read(value, place, natural=natural))

    # includes parameters registered by the user
    _check_keys(axes, (*BY_NAME, *OTHERS), "axes")
    most = runs.max_cases
    values = {each: _axis(each, given, read, most) for each, given in axes.items()}
    _check(rig, values, refinement)
    distance = SHORTEST  # in natural units, as is the duration
    if runs.distance is not None:
        distance = read(runs.distance, "run.distance", "x_s") / rig.unit("x_s")
    duration = 0.0
    if runs.duration is not None:
        duration = read(runs.duration, "run.duration", "time") / rig.unit("time")
    study = Study(
        rig=replace(rig, name="", assumed={}, fitted={}, source=""),
        cycles=runs.cycles,
        extensions=runs.extensions,
        long=runs.long,
        distance=distance,
        duration=duration,
    )
    wanted = USUAL if runs.measure is None else runs.measure
    measure = sequence("measure", wanted, "a list of names")
    for one in measure:
        name_of = one if isinstance(one, str) else shown(one)
        if name_of not in MEASURES:
            near = unknown(name_of, MEASURES)
            raise InputError(f"measure: {name_of!r} is not measured in a sweep; {near}")
    return Plan(
        name=name,
        study=study,
        axes=values,
        logarithmic=tuple(
            each for each, given in axes.items() if _is_logarithmic(given, values[each])
        ),
        measures=tuple(
            each for each in MEASURES if each in ("regime", "seed", *measure)
        ),
        refinement=refinement,
        max_cases=most,
    )


def _check(rig: Rig, axes: Mapping[str, Any], refinement: Refinement | None) -> None:
    """Raise `InputError` for a rig that cannot be run along these axes, and for axes
    that do not fit the search.
    """
    instance(
        "rig.slider",
        rig.slider,
        Slider | ElasticBody | Structure,
        "a Slider, Chain, Sheet or structure: an impedance has no motion",
    )
    instance(
        "rig.simulation.start",
        rig.start,
        FromRest | FromSliding,
        "'from rest' or 'sliding' in a sweep",
    )
    number("rig.drive.velocity", rig.velocity, above=0)
    first, *others = rig.drive.pieces
    if others or first.start != first.end:
        raise InputError(
            "rig.drive.pieces: each run of a sweep holds one velocity; give "
            "drive.velocity"
        )
    check_method(rig.interface, rig.method, rig.slider)
    if getattr(rig.slider, "mass", 1.0) == 0 and "mass" not in axes:
        raise InputError("rig.slider.mass = 0: a run needs a mass above 0")
    for name in axes:
        if name in BY_NAME:
            rig.value(name)  # raises if it has none
        elif name != "start" and not isinstance(rig.method, DRAWN):
            raise InputError(
                f"axes.{name}: changes nothing where no contacts are drawn; use method "
                "= 'contacts'"
            )
    spans = spans_of(axes, refinement)
    searched = {*spans} & {*BY_NAME}
    if spans and (strange := {*axes} - {*searched, "start"}):
        raise InputError(
            f"axes.{strange.pop()}: [refine] takes start alone beside two parameters "
            "of the rig"
        )

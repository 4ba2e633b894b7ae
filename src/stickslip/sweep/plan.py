"""Sweeps of a rig: from a file in TOML (rig, parameters to vary, what to measure) to a `Plan`, or from Python.

>>> from stickslip.sweep.plan import read_plan
>>> from stickslip.io.rig_files import example
>>> plan = read_plan(example("phase_diagram"))
>>> plan.parameters, plan.total
(('stiffness', 'velocity'), 3200)

``plan.run(store="phase.sqlite")`` runs what the store lacks.
"""

from __future__ import annotations

import functools
import math
import operator
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag, create_model

from stickslip.cycles import bistable_range, bistable_region
from stickslip.errors import InputError, UndecidedError, number, whole
from stickslip.io import rig_files as rigs
from stickslip.io.validation import Lag, Length, Mass, Part, Rate, Stiffness, Time, quantity, read_toml, validate
from stickslip.model import Contacts, FromRest, MasterEquation, Method, Slider, constant
from stickslip.model.parameters import parameter_named
from stickslip.model.rig import Rig
from stickslip.model.units import Scales, si_unit
from stickslip.simulation import check_method
from stickslip.stability import PARAMETERS, boundary, critical
from stickslip.sweep._executors import Workers
from stickslip.sweep._grid import open_sweep, run_cases
from stickslip.sweep._refine import Span, refine
from stickslip.sweep._results import Failure, failures, summary
from stickslip.sweep._run import MAX_CASES, Progress, check_size
from stickslip.sweep.study import FROM_REST, FROM_SLIDING, KINDS, MEASURES, USUAL, Study, unit_of

if TYPE_CHECKING:
    import xarray as xr

EXAMPLE = "`stickslip new phase_diagram`"
SHORTEST, CYCLES = 120.0, 30.0
"""``x_s`` and cycles that a run lasts unless the file says otherwise: transients last 40 to 100 ``x_s``."""


# ---------------------------------------------------------------------------------------------------------------------
# The plan
# ---------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Refinement:
    """How the boundaries in a plane are searched for, in place of a grid; see `stickslip.sweep.refine`."""

    runs: int
    resolution: float


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
        return tuple(name for name in self.axes if name in _PARAMETERS)

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
        scales = self.study.scales
        for name, (unit, title) in MEASURES.items():
            known = None if scales is None else si_unit(unit, scales)
            if known is not None:
                unit, title = known[1], title.replace(", per contact", "")
            found[name] = {"units": unit, "long_name": title}
        for name in self.axes:
            title, unit = _AXES[name][1], "1"
            if name in _PARAMETERS:
                unit = unit_of(name, scales)[1]
            spacing = "log" if name in self.logarithmic else "linear"
            found[name] = {"units": unit, "long_name": title, "spacing": spacing}
            if scales is None and name in ("stiffness", "mass"):
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
        options: Any = {
            "store": store,
            "executor": executor,
            "seed": self.seed,
            "progress": progress,
            "attributes": self.attributes(),
            "categories": {"regime": KINDS},
            "notes": {"sweep": self.to_toml()},
            "retry_failed": retry_failed,
            "max_cases": self.max_cases,
        }
        if self.refinement is None:
            return self.select(run_cases(self.study, self.axes, **options))
        ends = {name: self.axes[name] for name in self.parameters}
        box = {name: Span(low=float(a), high=float(b), log=name in self.logarithmic) for name, (a, b) in ends.items()}
        each = {"start": [str(start) for start in self.axes.get("start", [self.study.start])]}
        return self.select(refine(self.study, box, "regime", each=each, **asdict(self.refinement), **options))

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
    distance: float | str | None = None,
    duration: float | str | None = None,
    cycles: float = CYCLES,
    extensions: int = 1,
    measure: Sequence[str] | None = None,
    progress: Callable[[Progress], object] | None = None,
    retry_failed: bool = False,
    max_cases: int = MAX_CASES,
) -> xr.Dataset:
    """Run a rig at every combination of the values of some of its parameters; public as ``stickslip.sweep``.

    Parameters
    ----------
    rig : Rig
        Its method and start are those of every case, unless they are an axis.
    axes : mapping of name to values
        ``stiffness``, ``velocity``, ``mass``, ``damping``, ``delay``, ``std``, ``contacts``, ``seed``, ``start``
        (``"from rest"``, ``"sliding"``). Numbers in the rig's own units, or texts with a unit; a `Span` for each of two
        parameters with a `refinement`.
    store : path, optional
        File that keeps all cases; a second start runs what is missing.
    executor : Threads, Processes or concurrent.futures.Executor, optional
        Where cases run; by default threads, one per core.
    refinement : Refinement, optional
        Search the boundaries in a plane, in place of a grid.
    distance, duration, cycles : float or str
        A run lasts until the drive has gone `distance`, for `duration`, and through `cycles` cycles of loading.
    extensions : int
        How often a run that cannot be classified is made again, twice as long.
    measure : sequence of str, optional
        What is in the results; see `stickslip.sweep.study.MEASURES`.
    progress, retry_failed, max_cases
        As for `stickslip.sweep.run_cases`.

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
    >>> import stickslip.sweep
    >>> from stickslip.io.rig_files import example, read
    >>> rig = read(example("pmma_slider"))
    >>> found = stickslip.sweep(rig, {"velocity": ["0.4 mm/s"], "contacts": [20]}, distance="4 um", cycles=0)
    >>> found["peak_to_peak"].dims, found["velocity"].units
    (('velocity', 'contacts'), 'm/s')
    """
    scales = rig.scales
    run: dict[str, Any] = {"cycles": cycles, "extensions": extensions, "max_cases": max_cases}
    for name, length, unit in (("distance", distance, "m"), ("duration", duration, "s")):
        if length is not None:
            run[name] = _written(length, "" if scales is None else unit)
    document: dict[str, Any] = {"name": rig.name, "rig": rigs.to_document(rig), "run": run, "axes": {}}
    for name, given in axes.items():
        unit = unit_of(name, scales)[1] if scales is not None and name in _PARAMETERS and name != "std" else ""
        if isinstance(given, Span):
            ends = {"from": _written(given.low, unit), "to": _written(given.high, unit)}
            document["axes"][name] = ends | {"spacing": "log" if given.log else "linear"}
        else:
            document["axes"][name] = {"values": [_written(value, unit) for value in np.atleast_1d(given).tolist()]}
    if measure is not None:
        document["measure"] = list(measure)
    if refinement is not None:
        document["refine"] = asdict(refinement)
    plan = from_document(document)
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
        raise InputError(f"{place}: axes: must be a table [axes] with at least one of {', '.join(_AXES)}")
    rig = _rig_of(document, place, directory)
    # All of them tables: written as TOML, lists would come first, and the order of the axes be lost.
    axes = {name: {"values": axis} if isinstance(axis, list) else axis for name, axis in document["axes"].items()}
    content = validate(_Document, document, place, natural=rig.scales is None)
    try:
        return content.plan(rig, document | {"axes": axes, "rig": rigs.to_document(rig)})
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
    speeds = document["axes"].get("velocity")
    if "drive" not in given and speeds:  # the axis sets the speed
        ends = speeds.get("values", [speeds.get("to")]) if isinstance(speeds, dict) else speeds
        given = given | {"drive": {"velocity": ends[-1] if isinstance(ends, list) and ends else ends}}
    return rigs.from_document(given, f"{place}: rig")


# ---------------------------------------------------------------------------------------------------------------------
# What a file may hold
# ---------------------------------------------------------------------------------------------------------------------

_Speed = Annotated[float, quantity("m/s", "0.4 mm/s")]
_Count = Annotated[int, Field(ge=1)]
_Seed = Annotated[int, Field(ge=0, lt=2**53)]
_Start = Literal["from rest", "sliding"]

_PARAMETERS: tuple[str, ...] = tuple(parameter.name for parameter in PARAMETERS)
_AXES: dict[str, tuple[Any, str]] = {
    "stiffness": (Stiffness, "stiffness of the driving spring"),
    "velocity": (_Speed, "velocity of the drive"),
    "mass": (Mass, "mass of the slider"),
    "damping": (Rate, "damping eta"),
    "delay": (Lag, "delay of re-attachment"),
    "std": (float, "standard deviation of the thresholds"),
    "contacts": (_Count, "number of contacts"),
    "seed": (_Seed, "seed of the contacts"),
    "start": (_Start, "start of the run"),
}
"""What can be an axis: how a value is read, and what it is."""


def _form(value: object) -> str:
    """Which way of writing an axis this is."""
    if isinstance(value, dict):
        return "as table" if "values" in value else "as range"
    return "as range" if isinstance(value, Part) else "as list"


def _axis(name: str) -> Any:
    """Ways to write an axis: a list of values, or its ends, their number and spacing."""
    element: Any = _AXES[name][0]
    listed: Any = list.__class_getitem__(element)
    forms = [("as list", listed), ("as table", create_model("Values", __base__=Part, values=(listed, ...)))]
    ends: dict[str, Any] = {"from": (element, ...), "to": (element, ...), "count": (_Count | None, None)}
    ends["spacing"] = (Literal["linear", "log"], "linear")
    if name == "seed":
        ends = {"from": (element, 1), "count": (_Count, ...)}
    forms.append(("as range", create_model("Range", __base__=Part, **ends)))
    tagged: list[Any] = [Annotated[form, Tag(tag)] for tag, form in forms]
    union: Any = functools.reduce(operator.or_, tagged)
    return Annotated[union, Discriminator(_form)]


_OF_AXES: dict[str, Any] = {name: (_axis(name) | None, None) for name in _AXES}
_Axes: Any = create_model("_Axes", __base__=Part, **_OF_AXES)


class _Run(Part):
    method: Literal["contacts", "master equation"] | None = None
    contacts: int | None = None
    cells: int | None = None
    seed: int | None = None
    start: _Start | None = None
    distance: Length | None = None
    duration: Time | None = None
    cycles: float = CYCLES
    extensions: int = 1
    max_cases: _Count = MAX_CASES


class _Refine(Part):
    runs: int = 160
    resolution: float = 1 / 40


class _Document(Part):
    name: str = "sweep"
    rig: Any
    axes: _Axes
    run: _Run = _Run()
    measure: list[str] | None = None
    refine: _Refine | None = None

    def plan(self, rig: Rig, document: Mapping[str, Any]) -> Plan:
        given = {name: getattr(self.axes, name) for name in document["axes"]}
        study = self._study(rig, given)
        if self.refine is None:
            check_size(math.prod(_size(axis) for axis in given.values()), self.run.max_cases)
        axes = {name: _values(name, axis, ends_only=self.refine is not None) for name, axis in given.items()}
        logarithmic = tuple(name for name, axis in given.items() if _is_logarithmic(axis))
        refinement = None
        if self.refine is not None:
            refinement = Refinement(
                runs=whole("refine.runs", self.refine.runs, at_least=16),
                resolution=number("refine.resolution", self.refine.resolution, above=0, below=1),
            )
            self._check_refinement(given)
        seed = study.method.seed if isinstance(study.method, Contacts) else 0
        return Plan(
            name=self.name,
            study=replace(study, method=replace(study.method, seed=0)) if isinstance(study.method, Contacts) else study,
            axes=axes,
            logarithmic=logarithmic,
            measures=self._measures(own_seed="seed" not in given and isinstance(study.method, Contacts)),
            seed=seed,
            refinement=refinement,
            max_cases=self.run.max_cases,
            document=document,
        )

    def _study(self, rig: Rig, axes: Mapping[str, Any]) -> Study:
        natural = _natural(rig.scales)
        method = self._method(rig.method)
        if isinstance(method, MasterEquation):
            for name in ("seed", "contacts"):
                if name in axes:
                    raise InputError(f"axes.{name}: changes nothing with the master equation; use method = 'contacts'")
        if len(rig.drive.pieces) > 1 or rig.drive.pieces[0].start != rig.drive.pieces[0].end:
            raise InputError("rig.drive.pieces: each run of a sweep holds one velocity; give drive.velocity")
        check_method(rig.interface, method)
        if rig.slider.mass == 0 and "mass" not in axes:
            raise InputError("rig.slider.mass = 0: a run needs a mass above 0")
        for name in axes:
            if name in _PARAMETERS:
                parameter_named(name).get(rig.natural)
        return Study(
            interface=rig.interface,
            slider=rig.slider,
            velocity=number("rig.drive.velocity", rig.velocity, above=0),
            method=method,
            start=self.run.start or (FROM_REST if isinstance(rig.start, FromRest) else FROM_SLIDING),
            distance=SHORTEST if self.run.distance is None else natural(self.run.distance, "x_s"),
            cycles=number("run.cycles", self.run.cycles, at_least=0),
            duration=0.0 if self.run.duration is None else natural(self.run.duration, "time"),
            extensions=whole("run.extensions", self.run.extensions, at_least=0, at_most=10),
            scales=rig.scales,
        )

    def _method(self, given: Method) -> Method:
        run = self.run
        kind = run.method or ("contacts" if isinstance(given, Contacts) else "master equation")
        if kind == "contacts":
            if run.cells is not None:
                raise InputError("run.cells: belongs to method = 'master equation'")
            usual = given if isinstance(given, Contacts) else Contacts()
            return Contacts(
                usual.count if run.contacts is None else run.contacts, usual.seed if run.seed is None else run.seed
            )
        for key in ("contacts", "seed"):
            if getattr(run, key) is not None:
                raise InputError(f"run.{key}: belongs to method = 'contacts'")
        usual_cells = given.cells if isinstance(given, MasterEquation) else MasterEquation().cells
        return MasterEquation(cells=usual_cells if run.cells is None else run.cells)

    def _measures(self, *, own_seed: bool) -> tuple[str, ...]:
        names = list(USUAL if self.measure is None else self.measure)
        for name in names:
            if name not in MEASURES:
                import difflib

                near = difflib.get_close_matches(name, MEASURES, n=1, cutoff=0.5)
                remedy = f"did you mean {near[0]!r}?" if near else f"known here: {', '.join(MEASURES)}"
                raise InputError(f"measure: {name!r} is nothing that can be measured; {remedy}")
        always = ["regime", *(["seed"] if own_seed else [])]
        return tuple(dict.fromkeys([*always, *(name for name in names if name != "seed")]))

    def _check_refinement(self, given: Mapping[str, Any]) -> None:
        parameters = [name for name in given if name in _PARAMETERS]
        others = [name for name in given if name not in _PARAMETERS and name != "start"]
        if len(parameters) != 2 or others:
            raise InputError(
                f"axes: [refine] searches the plane of two parameters, for each start; this file has {', '.join(given)}"
            )
        for name in parameters:
            if not hasattr(given[name], "to"):
                raise InputError(f"axes.{name}: [refine] chooses the values itself; give from, to and spacing")


def _natural(scales: Scales | None) -> Callable[[float, str], float]:
    def natural(value: float, unit: str) -> float:
        return value if scales is None else value / (si_unit(unit, scales) or (1.0, ""))[0]

    return natural


def _is_logarithmic(axis: Any) -> bool:
    """Whether an axis is of equal ratios: as the file says, or as a list of values suggests."""
    if hasattr(axis, "spacing"):
        return bool(axis.spacing == "log")
    values = axis if isinstance(axis, list) else getattr(axis, "values", [])
    if len(values) < 3 or isinstance(values[0], str) or min(values) <= 0:
        return False
    steps, ratios = np.diff(np.sort(values)), np.diff(np.log(np.sort(values)))
    return bool(np.ptp(ratios) / ratios.mean() < np.ptp(steps) / steps.mean())


def _size(axis: Any) -> int:
    """Number of values of an axis, before they are made."""
    if isinstance(axis, list) or hasattr(axis, "values"):
        return len(axis if isinstance(axis, list) else axis.values)
    return axis.count or 1


def _values(name: str, axis: Any, *, ends_only: bool) -> NDArray[Any]:
    """Values of an axis as the file gives them."""
    if isinstance(axis, list) or hasattr(axis, "values"):
        values = axis if isinstance(axis, list) else axis.values
        if not values:
            raise InputError(f"axes.{name}: holds no value")
        if len(set(values)) < len(values):
            raise InputError(f"axes.{name}: holds a value twice; for replicas add an axis seed = {{ count = 10 }}")
        return np.array(values, dtype=object if isinstance(values[0], str) else None)
    low = getattr(axis, "from")
    if name == "seed":
        return np.arange(low, low + axis.count)
    if axis.to <= low:
        raise InputError(f"axes.{name}: to = {axis.to:g} must be above from = {low:g}")
    if axis.spacing == "log" and low <= 0:
        raise InputError(f"axes.{name}: from = {low:g} must be above 0 for spacing = 'log'")
    if ends_only:
        return np.array([low, axis.to], dtype=float)
    if axis.count is None or axis.count < 2:
        raise InputError(f"axes.{name}: needs a count of at least 2, the number of values from one end to the other")
    space = np.geomspace if axis.spacing == "log" else np.linspace
    values = space(low, axis.to, axis.count)
    return np.unique(np.rint(values).astype(int)) if isinstance(low, int) and name == "contacts" else values


# ---------------------------------------------------------------------------------------------------------------------
# What theory says
# ---------------------------------------------------------------------------------------------------------------------


def with_theory(
    result: xr.Dataset, *, bistable: bool = False, progress: Callable[[float], None] | None = None
) -> xr.Dataset:
    """Add the computed boundary of smooth sliding to the results of a sweep over one or two parameters.

    Parameters
    ----------
    result : xarray.Dataset
        From `Plan.run`, `sweep` or `open_plan`; other parameters that were swept are at the value selected.
    bistable : bool
        Whether to follow stick-slip from the boundary to where its branch ends as well, which takes seconds for each of
        a few values of the first parameter (nonlinear; `stickslip.cycles`).
    progress : callable, optional
        Called with the fraction of the work that is done.

    Returns
    -------
    xarray.Dataset
        The same with ``edge_<parameter>`` along ``point`` (and ``edge_curve`` in a plane), ``band_...`` along ``band``;
        the attribute ``theory`` says what is there, or why nothing is.
    """
    import xarray as xr

    plan = plan_of(result)
    order = plan.parameters if "run" in result.dims else result["regime"].dims
    varied = tuple(str(name) for name in order if name in plan.parameters)
    fixed = {name: float(result[name]) for name in plan.parameters if name in result and result[name].ndim == 0}
    setting = plan.study.at(fixed)
    if not 1 <= len(varied) <= 2:
        return result.assign_attrs(theory="no linear boundary: it is drawn over one parameter or two")
    sizes = [unit_of(name, plan.study.scales)[0] for name in varied]
    ranges = [_reach(result[name], size) for name, size in zip(varied, sizes, strict=True)]
    try:
        if any(low <= 0 for low, _ in ranges):
            raise InputError("a parameter starts at 0, which linear theory has no logarithm for")
        found = (
            _theory_in_plane(setting, varied, ranges, bistable, progress or (lambda _fraction: None))
            if len(varied) == 2
            else _theory_on_line(setting, varied[0], ranges[0], bistable)
        )
    except (InputError, UndecidedError) as reason:
        return result.assign_attrs(theory=f"no linear boundary: {reason}")
    for name, size in zip(varied, sizes, strict=True):
        for part in (f"edge_{name}", f"band_{name}", *(f"band_{name}_{end}" for end in ("low", "high", "fold"))):
            if part in found:
                found[part] = found[part].copy(data=found[part].to_numpy() * size).assign_attrs(result[name].attrs)
    words = "linear stability of smooth sliding" + (", cycles of the master equation" if bistable else "")
    if not found.sizes["point"]:
        words = "no linear boundary in this window"
    return xr.merge([result, found], combine_attrs="override", compat="override").assign_attrs(theory=words)


def _reach(axis: xr.DataArray, size: float) -> tuple[float, float]:
    """Ends of an axis in natural units, half a step beyond its values where that makes sense: cells reach so far."""
    values = np.unique(axis.to_numpy().astype(float)) / size
    low, high = float(values[0]), float(values[-1])
    if "run" in axis.dims or values.size < 2:
        return low, high
    if axis.attrs.get("spacing") == "log":
        return low * math.sqrt(low / values[1]), high * math.sqrt(high / values[-2])
    below = low - 0.5 * (values[1] - low)
    return (below if below > 0 else low), high + 0.5 * (high - values[-2])


def _theory_in_plane(
    setting: Rig,
    parameters: tuple[str, ...],
    ranges: list[tuple[float, float]],
    bistable: bool,
    progress: Callable[[float], None],
) -> xr.Dataset:
    interface, slider, velocity = setting.interface, setting.slider, setting.velocity
    over = (parameters[0], parameters[1])
    edge = boundary(Rig(interface, slider, constant(velocity)), over=over, between=(ranges[0], ranges[1]))
    # Where another mode grows beside the neutral one, nothing changes for smooth sliding.
    edge = edge.isel(point=edge["other_unstable"].to_numpy() == 0)
    found = edge[[*over, "curve"]].rename({name: f"edge_{name}" for name in (*over, "curve")})
    if bistable:
        assert isinstance(slider, Slider)
        bands = bistable_region(
            Rig(interface, slider, constant(velocity)),
            over=over,
            edge=edge,
            between=ranges[1],
            places=17,
            progress=progress,
        )
        found = found.merge(bands)
    return found.drop_attrs(deep=False)


def _theory_on_line(setting: Rig, parameter: str, between: tuple[float, float], bistable: bool) -> xr.Dataset:
    import xarray as xr

    interface, slider, velocity = setting.interface, setting.slider, setting.velocity
    edges = critical(Rig(interface, slider, constant(velocity)), parameter, between=between).edges
    data = {f"edge_{parameter}": ("point", np.array([edge.value for edge in edges], dtype=float))}
    if bistable:
        assert isinstance(slider, Slider)
        bands = tuple(bistable_range(Rig(interface, slider, constant(velocity)), parameter, between=between))
        data[f"band_{parameter}_low"] = ("band", np.array([band.low.value for band in bands], dtype=float))
        data[f"band_{parameter}_high"] = ("band", np.array([band.high.value for band in bands], dtype=float))
    return xr.Dataset(data)


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

"""The door for sweep files: a rig, the knobs to turn and what to look at, in TOML; a `Plan` out.

>>> from stickslip.sweep.plan import read_plan
>>> from stickslip.rig import example
>>> plan = read_plan(example("phase_diagram"))
>>> plan.knobs, plan.total
(('stiffness', 'velocity'), 3200)

``plan.run(store="phase.zarr")`` runs what the store lacks.
"""

from __future__ import annotations

import functools
import math
import operator
import os
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag, create_model

from stickslip import rig as rigs
from stickslip.cycles import bistable_band, bistable_region
from stickslip.door import Lag, Length, Mass, Part, Rate, Stiffness, Time, quantity, read_toml, validate
from stickslip.errors import InputError, UndecidedError, number, whole
from stickslip.model import Slider
from stickslip.simulate import Contacts, MasterEquation, Method, Relaxed, check_method
from stickslip.stability import KNOBS, Setting, boundary, critical
from stickslip.stability.knobs import knob_named
from stickslip.store import load, save
from stickslip.sweep._pools import Processes, Threads
from stickslip.sweep._refine import Span, refine
from stickslip.sweep._run import Failure, Progress, Summary, failures, summary, sweep
from stickslip.sweep.study import KINDS, MEASURES, USUAL, Chosen, RegimeOf, Study, unit_of
from stickslip.units import Scales, si_unit

if TYPE_CHECKING:
    import xarray as xr

EXAMPLE = "`stickslip new phase_diagram`"
SHORTEST, CYCLES = 120.0, 30.0
"""``x_s`` and cycles that a run lasts unless the file says otherwise: transients last 40 to 100 ``x_s``."""
REFINED = "refined.nc"


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
    """A sweep as a file describes it.

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
        What is recorded of each case.
    seed : int
    refinement : Refinement, optional
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
    document: Mapping[str, Any]

    @property
    def knobs(self) -> tuple[str, ...]:
        """Axes that turn a knob of the rig."""
        return tuple(name for name in self.axes if name in _KNOBS)

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
        found["regime_code"] |= {
            "flag_values": list(range(len(KINDS))),
            "flag_meanings": " ".join(kind.replace(" ", "_") for kind in KINDS),
        }
        for name in self.axes:
            title, unit = _AXES[name][1], "1"
            if name in _KNOBS:
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
        executor: Threads | Processes | Executor | None = None,
        progress: Callable[[Progress], object] | None = None,
        retry_failed: bool = False,
    ) -> xr.Dataset:
        """Run what is missing of a sweep; see `stickslip.sweep.sweep` and `stickslip.sweep.refine`.

        Parameters
        ----------
        store : path, optional
            Directory; a refinement keeps a file for each start there, and its result.
        executor, progress, retry_failed
            As there.

        Returns
        -------
        xarray.Dataset
            In the units of the file; its attribute ``sweep`` holds the file.

        Raises
        ------
        InputError
            As there.
        """
        if self.refinement is not None:
            if retry_failed:
                raise InputError("retry_failed: a refinement keeps failed runs as they are; delete its store")
            return self._refine(None if store is None else Path(store), executor, progress)
        return sweep(
            self.study,
            self.axes,
            Chosen(names=self.measures),
            executor=executor,
            store=store,
            seed=self.seed,
            progress=progress,
            attributes=self.attributes(),
            notes={"sweep": self.to_toml()},
            retry_failed=retry_failed,
        )

    def to_toml(self) -> str:
        """Return the text of a file that `read_plan` takes."""
        import tomli_w

        return tomli_w.dumps(dict(self.document))

    def _refine(
        self,
        store: Path | None,
        executor: Threads | Processes | Executor | None,
        progress: Callable[[Progress], object] | None,
    ) -> xr.Dataset:
        import xarray as xr

        assert self.refinement is not None
        box = {
            name: Span(low=float(self.axes[name][0]), high=float(self.axes[name][-1]), log=name in self.logarithmic)
            for name in self.knobs
        }
        if store is not None:
            _make_directory(store)
        starts = [str(start) for start in self.axes.get("start", [self.study.start])]
        parts: list[xr.Dataset] = []
        for start in starts:
            part = refine(
                replace(self.study, start=start),
                box,
                RegimeOf(),
                runs=self.refinement.runs,
                resolution=self.refinement.resolution,
                executor=executor,
                store=None if store is None else store / f"{start}.jsonl",
                seed=self.seed,
                progress=None if progress is None else functools.partial(_of_all, progress, len(parts), len(starts)),
            )
            part["start"] = ("run", np.full(part.sizes["run"], start, dtype=object), _about("start of the run"))
            part["start_at"] = ("crossing", np.full(part.sizes["crossing"], start, dtype=object), _about("start"))
            parts.append(part.reset_coords())
        made = [xr.concat([part[names] for part in parts], dim) for dim, names in _by_dimension(parts[0]).items()]
        result = xr.merge(made, combine_attrs="drop")
        notes = self.attributes()
        for name in box:
            for suffix in ("", "_at", "_error"):
                result[name + suffix].attrs |= notes[name]
        result.attrs = {"sweep": self.to_toml(), "provenance": parts[0].attrs["provenance"]}
        if store is not None:
            save(result, store / REFINED)
        return result


def _about(title: str) -> dict[str, str]:
    return {"units": "text", "long_name": title}


def _of_all(progress: Callable[[Progress], object], part: int, parts: int, of_part: Progress) -> None:
    """Report one of several searches as a share of all."""
    before = part * of_part.total
    progress(replace(of_part, total=parts * of_part.total, finished=before + of_part.finished))


def _by_dimension(data: xr.Dataset) -> dict[str, list[str]]:
    return {dim: [str(name) for name in data.data_vars if data[name].dims == (dim,)] for dim in ("run", "crossing")}


def _make_directory(store: Path) -> None:
    if store.is_dir() and (store / "zarr.json").exists():
        raise InputError(f"store = {str(store)!r}: holds a sweep over a grid, no refinement; choose another store")
    try:
        store.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = "is a file" if isinstance(error, FileExistsError) else f"cannot be made ({error.strerror})"
        raise InputError(f"store = {str(store)!r}: {reason}; choose another place") from None


def is_refined(store: Path) -> bool:
    """Whether a directory holds the result of a refinement."""
    return (store / REFINED).is_file()


def open_refined(store: Path) -> xr.Dataset:
    """Read the result of a refinement."""
    return load(store / REFINED)


def plan_of(result: xr.Dataset) -> Plan:
    """Return the plan that a result was made from.

    Raises
    ------
    InputError
        If the result was not made from a sweep file.
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
        return content.plan(rig, document | {"axes": axes, "rig": dict(rig.document)})
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


def _rig_of(document: Mapping[str, Any], place: str, directory: Path) -> rigs.Rig:
    given = document.get("rig")
    if isinstance(given, str):
        try:
            return rigs.read(directory / given)
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

_KNOBS: tuple[str, ...] = tuple(knob.name for knob in KNOBS)
_AXES: dict[str, tuple[Any, str]] = {
    "stiffness": (Stiffness, "stiffness of the driving spring"),
    "velocity": (_Speed, "velocity of the drive"),
    "mass": (Mass, "mass of the slider"),
    "damping": (Rate, "damping eta"),
    "delay": (Lag, "delay of re-attachment"),
    "spread": (float, "spread of the thresholds"),
    "contacts": (_Count, "number of contacts"),
    "seed": (_Seed, "seed of the contacts"),
    "start": (Literal["cold", "smooth"], "start of the run"),
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
    tagged = [Annotated.__class_getitem__((form, Tag(tag))) for tag, form in forms]  # type: ignore[attr-defined]
    return Annotated.__class_getitem__((functools.reduce(operator.or_, tagged), Discriminator(_form)))  # type: ignore[attr-defined]


_OF_AXES: dict[str, Any] = {name: (_axis(name) | None, None) for name in _AXES}
_Axes: Any = create_model("_Axes", __base__=Part, **_OF_AXES)


class _Run(Part):
    method: Literal["contacts", "master equation"] | None = None
    contacts: int | None = None
    cells: int | None = None
    seed: int | None = None
    start: Literal["cold", "smooth"] | None = None
    distance: Length | None = None
    duration: Time | None = None
    cycles: float = CYCLES
    extensions: int = 1


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

    def plan(self, rig: rigs.Rig, document: Mapping[str, Any]) -> Plan:
        given = {name: getattr(self.axes, name) for name in document["axes"]}
        study = self._study(rig, given)
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
            document=document,
        )

    def _study(self, rig: rigs.Rig, axes: Mapping[str, Any]) -> Study:
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
            if name in _KNOBS:
                knob_named(name).get(Setting(interface=rig.interface, rig=rig.slider, velocity=rig.velocity))
        cold = isinstance(rig.start, Relaxed)
        return Study(
            interface=rig.interface,
            slider=rig.slider,
            velocity=number("rig.drive.velocity", rig.velocity, above=0),
            method=method,
            start=self.run.start or ("cold" if cold else "smooth"),
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
        if self.refine is not None and self.measure is not None:
            raise InputError("measure: [refine] records the regime alone; leave it out")
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
        knobs = [name for name in given if name in _KNOBS]
        others = [name for name in given if name not in _KNOBS and name != "start"]
        if len(knobs) != 2 or others:
            raise InputError(
                f"axes: [refine] searches the plane of two knobs, for each start; this file has {', '.join(given)}"
            )
        for name in knobs:
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
    """Add the computed boundary of smooth sliding to the results of a sweep over one or two knobs.

    Parameters
    ----------
    result : xarray.Dataset
        From `Plan.run` or `stickslip.sweep.open_sweep`; knobs that were swept, too, are at the value selected.
    bistable : bool
        Whether to follow stick-slip from the boundary to where it dies as well, which takes seconds for each of a few
        values of the first knob (nonlinear; `stickslip.cycles`).
    progress : callable, optional
        Called with the share of the work that is done.

    Returns
    -------
    xarray.Dataset
        The same with ``edge_<knob>`` along ``point`` (and ``edge_curve`` in a plane), ``band_...`` along ``band``; the
        attribute ``theory`` says what is there, or why nothing is.
    """
    import xarray as xr

    plan = plan_of(result)
    order = result["regime"].dims if "regime" in result else plan.knobs
    turned = tuple(str(name) for name in order if name in plan.knobs)
    fixed = {name: float(result[name]) for name in plan.knobs if name in result and result[name].ndim == 0}
    setting = plan.study.at(fixed)
    if not 1 <= len(turned) <= 2:
        return result.assign_attrs(theory="no linear boundary: it is drawn over one knob or two")
    sizes = [unit_of(name, plan.study.scales)[0] for name in turned]
    ranges = [_reach(result[name], size) for name, size in zip(turned, sizes, strict=True)]
    try:
        if any(low <= 0 for low, _ in ranges):
            raise InputError("a knob starts at 0, which linear theory has no logarithm for")
        found = (
            _theory_in_plane(setting, turned, ranges, bistable, progress or (lambda _share: None))
            if len(turned) == 2
            else _theory_on_line(setting, turned[0], ranges[0], bistable)
        )
    except (InputError, UndecidedError) as reason:
        return result.assign_attrs(theory=f"no linear boundary: {reason}")
    for name, size in zip(turned, sizes, strict=True):
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
    setting: Setting,
    knobs: tuple[str, ...],
    ranges: list[tuple[float, float]],
    bistable: bool,
    progress: Callable[[float], None],
) -> xr.Dataset:
    interface, slider, velocity = setting.interface, setting.rig, setting.velocity
    over = (knobs[0], knobs[1])
    edge = boundary(interface, slider, velocity, over=over, within=(ranges[0], ranges[1]))
    # Where another mode grows beside the neutral one, nothing changes for smooth sliding.
    edge = edge.isel(point=edge["other_unstable"].to_numpy() == 0)
    found = edge[[*over, "curve"]].rename({name: f"edge_{name}" for name in (*over, "curve")})
    if bistable:
        assert isinstance(slider, Slider)
        bands = bistable_region(
            interface, slider, velocity, over=over, edge=edge, between=ranges[1], places=17, progress=progress
        )
        found = found.merge(bands)
    return found.drop_attrs(deep=False)


def _theory_on_line(setting: Setting, knob: str, between: tuple[float, float], bistable: bool) -> xr.Dataset:
    import xarray as xr

    interface, slider, velocity = setting.interface, setting.rig, setting.velocity
    edges = critical(knob, interface, slider, velocity, between=between).edges
    data = {f"edge_{knob}": ("point", np.array([edge.value for edge in edges], dtype=float))}
    if bistable:
        assert isinstance(slider, Slider)
        bands = tuple(bistable_band(interface, slider, velocity, knob, between=between))
        data[f"band_{knob}_low"] = ("band", np.array([band.low.value for band in bands], dtype=float))
        data[f"band_{knob}_high"] = ("band", np.array([band.high.value for band in bands], dtype=float))
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
    refined = "label" in result
    kinds = result["label" if refined else "regime"].to_numpy() if refined or "regime" in result else np.empty(0)
    regimes = {kind: int(np.count_nonzero(kinds == kind)) for kind in KINDS if (kinds == kind).any()}
    if not refined:
        counted = summary(result)
        return Report(**asdict(counted), line=str(counted), regimes=regimes, failures=tuple(failures(result)))
    errors, knobs = result["error"].to_numpy(), plan_of(result).knobs
    failed = tuple(
        Failure(
            parameters={name: float(result[name][i]) for name in knobs} | {"start": str(result["start"].values[i])},
            error=str(errors[i]),
        )
        for i in np.flatnonzero(errors != "")
    )
    counted = Summary(total=errors.size, done=errors.size - len(failed), failed=len(failed), missing=0)
    crossings = result.sizes["crossing"]
    line = f"{counted}; {crossings} points found where the regime changes"
    return Report(**asdict(counted), line=line, regimes=regimes, failures=failed, crossings=crossings)

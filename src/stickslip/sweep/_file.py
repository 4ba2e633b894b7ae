"""What a sweep file may hold, and what becomes of it: the study, the values of each axis, what is measured."""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag, create_model

from stickslip.errors import InputError, number, whole
from stickslip.io.validation import Length, Part, Time, quantity
from stickslip.model import (
    Contacts,
    FromRest,
    FromSliding,
    MasterEquation,
    Method,
    Population,
    Rig,
    Start,
)
from stickslip.model.methods import DRAWN
from stickslip.model.parameters import BY_NAME
from stickslip.model.units import engineering
from stickslip.simulation import check_method
from stickslip.sweep._refine import Refinement
from stickslip.sweep._run import CYCLES, MAX_CASES, check_size
from stickslip.sweep.study import FROM_REST, FROM_SLIDING, MEASURES, USUAL, Study

SHORTEST = 120.0
"""``x_s`` that a run lasts at least unless the file says otherwise: transients last 40 to 100 ``x_s``."""

_Count = Annotated[int, Field(ge=1)]
_Seed = Annotated[int, Field(ge=0, lt=2**53)]
_Start = Literal["from rest", "sliding"]

OTHERS: dict[str, tuple[Any, str]] = {
    "contacts": (_Count, "number of contacts"),
    "seed": (_Seed, "seed of the contacts"),
    "start": (_Start, "start of the run"),
}
"""What can be an axis besides the parameters of a rig: how a value is read, and what it is."""


def axis_names() -> tuple[str, ...]:
    """Return all that can be an axis."""
    return (*BY_NAME, *OTHERS)


def _element(rig: Rig, name: str) -> Any:
    """How a value of an axis is read."""
    if name in OTHERS:
        return OTHERS[name][0]
    if BY_NAME[name].unit == "1":
        return float
    unit = rig.unit_name(BY_NAME[name].unit)
    try:
        example = engineering(rig.value(name), unit, 3)
    except InputError:  # the rig has none: the plan will say so
        example = f"1 {unit}"
    return Annotated[float, quantity(unit, example, "at least 0" if BY_NAME[name].zero else "above 0")]


def _form(value: object) -> str:
    """Which way of writing an axis this is."""
    if isinstance(value, dict):
        return "as table" if "values" in value else "as range"
    return "as range" if isinstance(value, Part) else "as list"


def _axis(rig: Rig, name: str) -> Any:
    """Ways to write an axis: a list of values, or its ends, their number and spacing."""
    element = _element(rig, name)
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


class _Run(Part):
    method: Literal["contacts", "population", "master equation"] | None = None
    contacts: int | None = None
    rtol: float | None = None
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
    together: int = 8


class Document(Part):
    """A sweep file, validated."""

    name: str = "sweep"
    rig: Any
    axes: Any
    run: _Run = _Run()
    measure: list[str] | None = None
    refine: _Refine | None = None

    @staticmethod
    def of(rig: Rig) -> type[Document]:
        """Return the model of a file that sweeps this rig: its axes are the parameters that are known by now."""
        axes: dict[str, Any] = {name: (_axis(rig, name) | None, None) for name in axis_names()}
        return create_model("Document", __base__=Document, axes=(create_model("Axes", __base__=Part, **axes), ...))

    def parts(self, rig: Rig, names: Iterable[str]) -> dict[str, Any]:
        """Return the fields of a `stickslip.sweep.plan.Plan`; `names` are the axes in their order."""
        given = {name: getattr(self.axes, name) for name in names}
        study = self._study(rig, given)
        if self.refine is None:
            check_size(math.prod(_size(axis) for axis in given.values()), self.run.max_cases)
        axes = {name: _values(name, axis, ends_only=self.refine is not None) for name, axis in given.items()}
        logarithmic = tuple(name for name, axis in given.items() if _is_logarithmic(axis))
        refinement = None if self.refine is None else Refinement(**self.refine.model_dump())
        if refinement is not None:
            self._check_refinement(given)
        method = study.rig.method
        seed = method.seed if isinstance(method, DRAWN) else 0
        if isinstance(method, DRAWN):
            study = replace(study, rig=study.rig.replace(method=replace(method, seed=0)))
        return {
            "name": self.name,
            "study": study,
            "axes": axes,
            "logarithmic": logarithmic,
            "measures": self._measures(own_seed="seed" not in given and isinstance(method, DRAWN)),
            "seed": seed,
            "refinement": refinement,
            "max_cases": self.run.max_cases,
        }

    def _study(self, rig: Rig, axes: Mapping[str, Any]) -> Study:
        method = self._method(rig.method)
        if isinstance(method, MasterEquation):
            for name in ("seed", "contacts"):
                if name in axes:
                    raise InputError(f"axes.{name}: changes nothing with the master equation; use method = 'contacts'")
        if len(rig.drive.pieces) > 1 or rig.drive.pieces[0].start != rig.drive.pieces[0].end:
            raise InputError("rig.drive.pieces: each run of a sweep holds one velocity; give drive.velocity")
        check_method(rig.interface, method, rig.slider)
        if rig.slider.mass == 0 and "mass" not in axes:
            raise InputError("rig.slider.mass = 0: a run needs a mass above 0")
        for name in axes:
            if name in BY_NAME:
                rig.value(name)  # it has one
        number("rig.drive.velocity", rig.velocity, above=0)
        starts: dict[str | None, Start] = {None: rig.start, FROM_REST: FromRest(), FROM_SLIDING: FromSliding()}
        run = self.run
        return Study(
            rig=replace(rig, method=method, start=starts[run.start], name="", assumed={}, source=""),
            distance=SHORTEST if run.distance is None else run.distance / rig.unit("x_s"),
            duration=0.0 if run.duration is None else run.duration / rig.unit("time"),
            cycles=number("run.cycles", run.cycles, at_least=0),
            extensions=whole("run.extensions", run.extensions, at_least=0, at_most=10),
        )

    def _method(self, given: Method) -> Method:
        run = self.run
        kinds: dict[str, type[Method]] = {"contacts": Contacts, "population": Population}
        made = kinds.get(run.method or "", type(given)) if run.method != "master equation" else MasterEquation
        if issubclass(made, DRAWN):
            if run.rtol is not None and made is not Population:
                raise InputError("run.rtol: belongs to method = 'master equation'")
            usual = given if isinstance(given, DRAWN) else Contacts()
            chosen = given if type(given) is made else made(usual.count, usual.seed)
            asked: dict[str, Any] = {"count": run.contacts, "seed": run.seed, "rtol": run.rtol}
            return replace(chosen, **{name: value for name, value in asked.items() if value is not None})
        for key in ("contacts", "seed"):
            if getattr(run, key) is not None:
                raise InputError(f"run.{key}: belongs to method = 'contacts'")
        if run.method is None and run.rtol is None:
            return given
        master = given if isinstance(given, MasterEquation) else MasterEquation()
        return master if run.rtol is None else replace(master, rtol=run.rtol)

    def _measures(self, *, own_seed: bool) -> tuple[str, ...]:
        names = list(USUAL if self.measure is None else self.measure)
        for name in names:
            if name not in MEASURES:
                import difflib

                near = difflib.get_close_matches(name, MEASURES, n=1, cutoff=0.5)
                remedy = f"did you mean {near[0]!r}?" if near else f"known here: {', '.join(MEASURES)}"
                raise InputError(f"measure: {name!r} is not measured in a sweep; {remedy}")
        always = ["regime", *(["seed"] if own_seed else [])]
        return tuple(dict.fromkeys([*always, *(name for name in names if name != "seed")]))

    def _check_refinement(self, given: Mapping[str, Any]) -> None:
        parameters = [name for name in given if name in BY_NAME]
        others = [name for name in given if name not in BY_NAME and name != "start"]
        if len(parameters) != 2 or others:
            raise InputError(
                f"axes: [refine] searches the plane of two parameters, for each start; this file has {', '.join(given)}"
            )
        for name in parameters:
            if not hasattr(given[name], "to"):
                raise InputError(f"axes.{name}: [refine] chooses the values itself; give from, to and spacing")


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

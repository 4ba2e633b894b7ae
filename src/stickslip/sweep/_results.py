"""From the rows of a table to one labelled Dataset."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError, shown
from stickslip.sweep._cases import ERROR, STATUS, AxisValue, Values, case_key, check_name

if TYPE_CHECKING:
    import xarray as xr

NOT_RUN, DONE, FAILED = 0, 1, 2
NO_RESULT = -1
"""Code of a category where a case has no result."""
PROVENANCE = "provenance"

Head = Mapping[str, Any]
"""What a sweep is made of, as it stands in its table: identity, axes or box, attributes, categories, notes."""


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


# ---------------------------------------------------------------- grids


class Grid(Sequence[Values]):
    """All combinations of the values of some axes, in C order.

    Parameters
    ----------
    axes : mapping
        Values of each axis: Python's own numbers, texts or truth values.
    """

    def __init__(self, axes: Mapping[str, Sequence[AxisValue]]) -> None:
        self.axes = axes
        self.shape = tuple(len(values) for values in axes.values())

    def __len__(self) -> int:
        return math.prod(self.shape)

    @overload
    def __getitem__(self, cell: int) -> Values: ...
    @overload
    def __getitem__(self, cell: slice) -> Sequence[Values]: ...
    def __getitem__(self, cell: int | slice) -> Values | Sequence[Values]:
        """Return the values of the axes at a cell."""
        if isinstance(cell, slice):
            return [self[i] for i in range(*cell.indices(len(self)))]
        if not 0 <= cell < len(self):
            raise IndexError(cell)
        chosen = {}
        for name in reversed(list(self.axes)):
            cell, i = divmod(cell, len(self.axes[name]))
            chosen[name] = self.axes[name][i]
        return {name: chosen[name] for name in self.axes}


def axis_values(name: str, given: object, table: str = "axes") -> list[AxisValue]:
    """Values of an axis as Python's own numbers, texts or truth values.

    Raises
    ------
    InputError
    """
    check_name(table, name)
    place = f"{table}[{name!r}]"
    if isinstance(given, str) or not (hasattr(given, "__array__") or isinstance(given, Sequence)):
        raise InputError(f"{place} = {shown(given)}: must be a list of values, at least one")
    values: Any = list(given) if isinstance(given, Sequence) else np.asarray(given).tolist()
    if not isinstance(values, list) or not values or any(isinstance(value, (list, tuple)) for value in values):
        raise InputError(f"{place} = {shown(given)}: must be a list of values, at least one")
    found = [value.item() if isinstance(value, np.generic) else value for value in values]
    kinds = {_sort_of(value) for value in found}
    if kinds not in ({"number"}, {"text"}, {"truth value"}):
        raise InputError(
            f"{place} = {shown(given)}: must be numbers, texts or truth values, all of one kind; for records, sweep "
            "over their names and look them up in the function"
        )
    if kinds == {"number"}:
        if any(math.isnan(value) for value in found):
            raise InputError(f"{place}: must not hold NaN")
        for value in found:  # the axis of the result is of int64, or of float64
            if isinstance(value, int) and not (-(2**63) <= value < 2**63):
                raise InputError(f"{place}: {shown(value)} is no whole number of 64 bits; pass it as a text")
            if any(isinstance(other, float) for other in found) and float(value) != value:
                raise InputError(f"{place}: {value} beside fractions would lose digits; pass whole numbers alone")
    first: dict[AxisValue, AxisValue] = {}
    for value in found:
        if value in first:
            both = "" if repr(value) == repr(first[value]) else f" ({first[value]!r} and {value!r} are equal)"
            raise InputError(
                f"{place}: holds a value twice{both}; for replicas add an axis of their own, such as replica"
            )
        first[value] = value
    return found


def _sort_of(value: object) -> str:
    if isinstance(value, bool):
        return "truth value"
    return "number" if isinstance(value, (int, float)) else "text" if isinstance(value, str) else ""


def grid_dataset(head: Head, rows: Iterable[tuple[str, Mapping[str, Any]]]) -> xr.Dataset:
    """Put rows where they stand on the axes of a sweep."""
    import xarray as xr

    grid = Grid(head["axes"])
    place = {case_key(values): i for i, values in enumerate(grid)}
    columns = Columns(head, len(grid), reserved=tuple(grid.axes))
    for key, row in rows:
        if key in place:
            columns.put(place[key], row)
    data = columns.variables(tuple(grid.axes), grid.shape)
    axes = {name: (name, _array(values), attributes_of(head, name)) for name, values in grid.axes.items()}
    return xr.Dataset(data, axes | columns.coordinates, attributes_of_all(head))


def _array(values: Sequence[AxisValue]) -> NDArray[Any]:
    return np.array(values, dtype=object if isinstance(values[0], str) else None)


def attributes_of(head: Head, name: str, own: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Attributes of an axis or variable: the user's, its own, and the two that none goes without."""
    given: dict[str, Any] = head["attributes"].get(name, {})
    return {"long_name": name.replace("_", " "), "units": "1"} | dict(own or {}) | given


def flags(words: Sequence[str], first: int) -> dict[str, Any]:
    """CF attributes of a variable whose integers, from the first up, stand for words."""
    codes = np.arange(first, first + len(words), dtype=np.int8)
    return {"flag_values": codes, "flag_meanings": " ".join(word.replace(" ", "_") for word in words)}


def flags_of(head: Head, name: str) -> dict[str, Any]:
    """Flags of a variable, if it is a category."""
    return flags(["no result", *head["categories"][name]], NO_RESULT) if name in head["categories"] else {}


def attributes_of_all(head: Head) -> dict[str, str]:
    """Attributes of the Dataset: notes, and what the sweep is made of as JSON."""
    about = {name: head[name] for name in ("format", "stickslip", "function", "seed", "identity")}
    about |= {name: head[name] for name in ("box", "each", "label", "runs", "resolution", "together") if name in head}
    if "axes" in head:
        about["axes"] = {name: len(values) for name, values in head["axes"].items()}
    return {**head["notes"], PROVENANCE: json.dumps(about)}


# ---------------------------------------------------------------- columns


@dataclass(kw_only=True)
class _Column:
    """What is known of a measured name, and its values, one for each case."""

    kind: str
    values: NDArray[Any]
    dims: tuple[str, ...] = ()
    attributes: dict[str, Any] = field(default_factory=dict)


class Columns:
    """Arrays that are filled case by case; the first case with a result says what there is.

    Parameters
    ----------
    head : mapping
    size : int
        Number of cases.
    reserved : tuple of str
        Names of dimensions that belong to the sweep.
    """

    def __init__(self, head: Head, size: int, reserved: tuple[str, ...]) -> None:
        self._head, self._size, self._reserved = head, size, reserved
        self._status = np.full(size, NOT_RUN, dtype=np.int8)
        self._error = np.full(size, "", dtype=object)
        self._names: list[str] = []
        self._columns: dict[str, _Column] = {}
        self._sizes: dict[str, int] = {}
        self._coordinates: dict[str, list[Any]] = {}
        self._codes = {name: {word: i for i, word in enumerate(words)} for name, words in head["categories"].items()}

    def put(self, i: int, row: Mapping[str, Any]) -> None:
        """Note what came of a case."""
        error = row.get("error")
        if error is None:
            try:
                for name, (column, value) in self._fitted(row["result"]).items():
                    self._columns[name] = column
                    column.values[i] = value
            except ValueError as complaint:
                error = f"ValueError: {complaint}"
        self._status[i] = DONE if error is None else FAILED
        self._error[i] = error or ""

    def variables(self, dims: tuple[str, ...], shape: tuple[int, ...]) -> dict[str, Any]:
        """All variables over the dimensions of the sweep."""
        head = self._head
        made: dict[str, Any] = {}
        for name in self._names:
            column = self._columns.get(name)
            if column is None:  # nothing but None
                column = _Column(kind="number", values=np.full(self._size, math.nan))
            own = column.attributes | flags_of(head, name)
            values = column.values.reshape(shape + column.values.shape[1:])
            made[name] = ((*dims, *column.dims), values, attributes_of(head, name, own))
        about = {"long_name": "what became of the case", "units": "1"} | flags(["not run", "done", "failed"], NOT_RUN)
        made[STATUS] = (dims, self._status.reshape(shape), about)
        title = {"long_name": "error of the case, empty if it went well", "units": "1"}
        made[ERROR] = (dims, self._error.reshape(shape), title)
        return made

    @property
    def coordinates(self) -> dict[str, Any]:
        """Coordinates along the dimensions that cases brought along."""
        return {
            dim: (dim, _array(values), {"long_name": dim, "units": "1"}) for dim, values in self._coordinates.items()
        }

    def _fitted(self, result: Mapping[str, Any]) -> dict[str, tuple[_Column, Any]]:
        """Values of a case with the column of each; a `ValueError` says what does not fit the others."""
        if self._names and set(self._names) != result.keys():
            raise ValueError(
                f"returned {sorted(result)}, but another case {sorted(self._names)}: must be the same names"
            )
        found = {}
        for name, value in result.items():
            if value is None:
                continue
            kind = _kind(value, name in self._codes)
            column = self._columns.get(name) or self._new(name, kind, value)
            if kind != column.kind and {kind, column.kind} != {"number", "complex"}:
                raise ValueError(f"{name} is a {kind}, but in another case a {column.kind}: must be the same")
            if column.kind == "number" and kind == "complex":
                column.values = column.values.astype(complex)
                column.kind = kind
            found[name] = column, self._decoded(name, value, column)
        self._names = list(result)
        return found

    def _decoded(self, name: str, value: Any, column: _Column) -> Any:
        if name in self._codes:
            if value not in self._codes[name]:
                raise ValueError(f"{name} = {value!r}: must be one of {', '.join(self._codes[name])}")
            return self._codes[name][value]
        if not isinstance(value, dict):
            return value
        shape = tuple(value["shape"])
        if shape != column.values.shape[1:]:
            raise ValueError(f"{name} has the shape {shape}, but in another case {column.values.shape[1:]}")
        for dim, along in value.get("coordinates", {}).items():
            if self._coordinates.setdefault(dim, along) != along:
                raise ValueError(f"{name} has other values along {dim!r} than another case")
        array = np.array(value["real"], dtype=float)
        if "imag" in value:
            array = array + 1j * np.array(value["imag"], dtype=float)
        return array.reshape(shape)

    def _new(self, name: str, kind: str, value: Any) -> _Column:
        if kind == "text":
            return _Column(kind=kind, values=np.full(self._size, "", dtype=object))
        if kind == "category":
            return _Column(kind=kind, values=np.full(self._size, NO_RESULT, dtype=np.int8))
        shape = tuple(value["shape"]) if isinstance(value, dict) else ()
        dims = tuple(value["dims"] if isinstance(value, dict) and "dims" in value else _numbered(name, shape))
        for dim, size in zip(dims, shape, strict=True):
            if dim in self._reserved or self._sizes.setdefault(dim, size) != size:
                raise ValueError(f"the dimension {dim!r} of {name} is taken or of another size elsewhere")
        empty = complex(math.nan, 0.0) if kind == "complex" else math.nan
        own = value.get("attributes", {}) if isinstance(value, dict) else {}
        return _Column(kind=kind, values=np.full((self._size, *shape), empty), dims=dims, attributes=own)


def _numbered(name: str, shape: tuple[int, ...]) -> list[str]:
    return [f"{name}_{i}" for i in range(len(shape))]


def _kind(value: Any, category: bool) -> str:
    if category:
        return "category"
    if isinstance(value, str):
        return "text"
    return "complex" if isinstance(value, dict) and "imag" in value else "number"

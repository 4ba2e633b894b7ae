"""Where results land: a grid of cells cut into blocks, in memory or in a zarr store that plain xarray opens.

Layout of a store, a directory::

    zarr.json       the group: lists all arrays (one that it does not list does not count); its attribute
                    ``provenance`` is JSON: format, version, what the sweep is made of; its others are notes
    <axis>/         values of one axis
    <measured>/     one array per measured name, dimensions = axes, then its own; NaN where there is nothing
    error/          text of the error of a case that failed, empty for all others
    case_key/       content key of a finished case, 0 for a case that has not run

One chunk holds one block of cells. Every chunk is replaced as a whole (written beside, then renamed), the
chunk of ``case_key`` after all others of its block: a cell counts as finished only when everything of it is
on the disk. A file ``<store>.lock`` beside the directory names the process that writes.
"""

from __future__ import annotations

import errno
import fcntl
import itertools
import json
import math
import os
import shutil
import socket
import threading
import uuid
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError
from stickslip.sweep._content import AxisValue, axis_encodings, cell_key, identity_digest
from stickslip.sweep._worker import Outcome, Packed, Value, package_version

if TYPE_CHECKING:
    import xarray as xr

FORMAT = "stickslip-sweep"
VERSION = 1
ERROR = "error"
KEY = "case_key"
PROVENANCE = "provenance"
LARGEST_BLOCK = 2500
BLOCKS = 4
RECENT, RECENT_BYTES = 64, 2**20

_HELD: set[Path] = set()
_HELD_GUARD = threading.Lock()

_OWN = {
    ERROR: {"long_name": "error of the case, empty if it went well", "units": "text"},
    KEY: {"long_name": "content key of a finished case, 0 if it has not run", "units": "1"},
}


@dataclass(frozen=True, kw_only=True)
class Grid:
    """The cells of a sweep, numbered in C order, and how they are cut into blocks of neighbours.

    Parameters
    ----------
    axes : mapping
        Values of each axis.
    attributes : mapping
        Attributes (``units``, ``long_name``) by name of axis or variable.
    block_shape : tuple of int
        Cells of a block along each axis: 1, ..., 1, any, full, ..., full; hence a block is a run of cells.
    """

    axes: Mapping[str, NDArray[Any]]
    attributes: Mapping[str, Mapping[str, Any]]
    block_shape: tuple[int, ...]

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each axis."""
        return tuple(len(values) for values in self.axes.values())

    @cached_property
    def size(self) -> int:
        """Number of cells."""
        return math.prod(self.shape)

    @cached_property
    def _lists(self) -> dict[str, list[AxisValue]]:
        # What a case is handed: Python's own numbers and texts.
        return {name: [_python(value) for value in values] for name, values in self.axes.items()}

    def values(self, cell: int) -> dict[str, AxisValue]:
        """Return the values of the axes at a cell."""
        index = []
        for size in reversed(self.shape):
            cell, i = divmod(cell, size)
            index.append(i)
        return {name: values[i] for (name, values), i in zip(self._lists.items(), reversed(index), strict=True)}

    def attributes_of(self, name: str, own: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Attributes of an axis or variable: the user's, its own, and the two that none goes without."""
        merged = {"long_name": name.replace("_", " "), "units": "natural units"} | dict(own or {})
        merged |= self.attributes.get(name, {})
        return {str(key): _jsonable(value) for key, value in merged.items()}

    @cached_property
    def _cut(self) -> tuple[int, int, int]:
        """Axis along which blocks follow each other, blocks along it, and cells behind one step of it."""
        axis = next((i for i, size in enumerate(self.block_shape) if size > 1), len(self.shape) - 1)
        return axis, -(-self.shape[axis] // self.block_shape[axis]), math.prod(self.shape[axis + 1 :])

    def block(self, cell: int) -> int:
        """Return the number of the block that holds a cell."""
        axis, count, behind = self._cut
        row = cell // behind
        return row // self.shape[axis] * count + row % self.shape[axis] // self.block_shape[axis]

    def block_cells(self, block: int) -> range:
        """Return the cells of a block."""
        axis, count, behind = self._cut
        outer, inner = divmod(block, count)
        first = inner * self.block_shape[axis]
        last = min(first + self.block_shape[axis], self.shape[axis])
        start = outer * self.shape[axis]
        return range((start + first) * behind, (start + last) * behind)

    def region(self, block: int) -> tuple[slice, ...]:
        """Return where a block lies along each axis."""
        cells = self.block_cells(block)
        first, last = (np.unravel_index(cell, self.shape) for cell in (cells[0], cells[-1]))
        return tuple(slice(int(low), int(high) + 1) for low, high in zip(first, last, strict=True))

    def keys(self, identity: Mapping[str, str]) -> NDArray[np.uint64]:
        """Content keys of all cells, in order."""
        head = identity_digest(identity)
        encodings = axis_encodings(self._lists)
        names = list(self.axes)
        order = [names.index(name) for name in encodings]
        columns = [encodings[name] for name in self.axes]
        contents = (b"".join([parts[i] for i in order]) for parts in itertools.product(*columns))
        return np.fromiter((cell_key(head, content) for content in contents), np.uint64, self.size)


def block_shape(shape: Sequence[int], cells: int | None) -> tuple[int, ...]:
    """Cut a grid into blocks of at most so many cells; by default 4 blocks, more if they had above 2500 cells."""
    size = math.prod(shape)
    wanted = min(LARGEST_BLOCK, -(-size // BLOCKS)) if cells is None else cells
    result: list[int] = []
    for length in reversed(shape):
        count = max(1, min(length, wanted))
        count = -(-length // -(-length // count))  # the same number of blocks, of even size
        result.append(count)
        wanted = wanted // count if count == length else 1
    return tuple(reversed(result))


@dataclass(frozen=True, kw_only=True)
class Variable:
    """What is known of a measured name before its values: type, own dimensions, attributes, coordinates."""

    dtype: str
    dims: tuple[str, ...] = ()
    shape: tuple[int, ...] = ()
    attributes: dict[str, Any] = field(default_factory=dict)
    coordinates: dict[str, NDArray[Any]] = field(default_factory=dict)

    @property
    def empty(self) -> float | str | int:
        """What stands where there is no result."""
        return "" if self.dtype == "str" else (0 if self.dtype == "uint64" else math.nan)


class Sink(Protocol):
    """Where results go: `Memory` or `Store`."""

    grid: Grid
    template: dict[str, Variable]

    def read(self, name: str, region: tuple[slice, ...]) -> NDArray[Any]:
        """Read a block of an array."""
        ...

    def write(self, name: str, region: tuple[slice, ...], values: NDArray[Any]) -> None:
        """Replace a block of an array."""
        ...

    def create(self, template: Mapping[str, Variable]) -> None:
        """Make an array for each measured name."""
        ...

    def dataset(self) -> xr.Dataset:
        """Return what has landed."""
        ...


class Memory:
    """Results in memory."""

    def __init__(self, grid: Grid, attrs: Mapping[str, str]) -> None:
        self.grid = grid
        self.template: dict[str, Variable] = {}
        self._attrs = dict(attrs)
        self._arrays: dict[str, NDArray[Any]] = {}
        for name, variable in _own_variables().items():
            self._arrays[name] = _blank(variable, grid.shape)

    def read(self, name: str, region: tuple[slice, ...]) -> NDArray[Any]:
        """Read a block of an array."""
        return self._arrays[name][region].copy()

    def write(self, name: str, region: tuple[slice, ...], values: NDArray[Any]) -> None:
        """Replace a block of an array."""
        self._arrays[name][region] = values

    def create(self, template: Mapping[str, Variable]) -> None:
        """Make an array for each measured name."""
        for name, variable in template.items():
            self._arrays[name] = _blank(variable, (*self.grid.shape, *variable.shape))
        self.template = dict(template)

    def dataset(self) -> xr.Dataset:
        """Return what has landed."""
        import xarray as xr

        data, coordinates = {}, {}
        for name, values in self.grid.axes.items():
            coordinates[name] = ((name,), _as_read(values), self.grid.attributes_of(name))
        for name, variable in (self.template | _own_variables()).items():
            dims = (*self.grid.axes, *variable.dims)
            data[name] = (dims, _as_read(self._arrays[name]), variable.attributes)
            for dim, values in variable.coordinates.items():
                coordinates[dim] = ((dim,), _as_read(values), self.grid.attributes_of(dim))
        return xr.Dataset(data, coordinates, self._attrs)


class Store:
    """Results in a zarr store; made by `open_store`."""

    def __init__(self, path: Path, grid: Grid, group: Any) -> None:
        self.path = path
        self.grid = grid
        self._group = group
        self._arrays = dict(group.arrays())
        self._recent: dict[tuple[str, tuple[tuple[int | None, int | None], ...]], NDArray[Any]] = {}
        self.template = {
            name: _variable_of(array, len(grid.axes))
            for name, array in self._arrays.items()
            if name not in (ERROR, KEY)
            and array.metadata.dimension_names[: len(grid.axes)] == tuple(grid.axes)
            and name not in array.metadata.dimension_names
        }
        for variable in self.template.values():
            for dim in variable.dims:
                if dim in self._arrays:
                    variable.coordinates[dim] = _as_read(self._arrays[dim][:])

    def read(self, name: str, region: tuple[slice, ...]) -> NDArray[Any]:
        """Read a block of an array, from memory if it was written lately: there is no other writer."""
        recent = self._recent.pop((name, _corners(region)), None)
        return np.array(self._arrays[name][region]) if recent is None else recent

    def write(self, name: str, region: tuple[slice, ...], values: NDArray[Any]) -> None:
        """Replace a block of an array."""
        with writing(self.path):
            self._arrays[name][region] = values
        if values.nbytes <= RECENT_BYTES:
            self._recent[name, _corners(region)] = values
            while len(self._recent) > RECENT:
                del self._recent[next(iter(self._recent))]

    def create(self, template: Mapping[str, Variable]) -> None:
        """Make an array for each measured name; they count once the group, written last, lists them all."""
        with writing(self.path):
            for name, variable in template.items():
                for dim, values in variable.coordinates.items():
                    _add_coordinate(self._group, dim, values, self.grid.attributes_of(dim))
                _add_array(self._group, self.grid, name, variable)
            _consolidate(self.path)
        self._group, _ = read_group(self.path)
        self._arrays = dict(self._group.arrays())
        self.template = dict(template)

    def dataset(self) -> xr.Dataset:
        """Return what has landed."""
        return open_dataset(self.path)


def describe(outcome: Mapping[str, Value], grid: Grid) -> dict[str, Variable]:
    """Learn names, types and dimensions from the first case that went well.

    Raises
    ------
    InputError
        If a name is taken, or two arrays disagree on a dimension.
    """
    if not outcome:
        raise InputError("measure: returned an empty mapping; name at least one number")
    template: dict[str, Variable] = {}
    sizes: dict[str, int] = {}
    coordinates: dict[str, NDArray[Any]] = {}
    for name, value in outcome.items():
        taken = {*grid.axes, ERROR, KEY}
        check_name("measure", name)
        if name in taken:
            raise InputError(f"measure: returned the name {name!r}, which is taken ({', '.join(sorted(taken))})")
        packed = value if isinstance(value, Packed) else Packed(values=np.asarray(value), dims=())
        dims = packed.dims
        if dims is None:
            dims = (
                tuple(f"{name}_{i}" for i in range(packed.values.ndim))
                if packed.values.ndim > 1
                else (f"{name}_index",)
            )
        for dim, size in zip(dims, packed.values.shape, strict=True):
            check_name("measure", dim)
            if dim in taken or dim in outcome or sizes.setdefault(dim, size) != size:
                raise InputError(f"measure: the dimension {dim!r} of {name!r} is taken or of another size elsewhere")
        for dim, values in packed.coordinates.items():
            if not np.array_equal(coordinates.setdefault(dim, values), values):
                raise InputError(f"measure: two arrays have different values along {dim!r}")
        template[name] = Variable(
            dtype=_kind(value),
            dims=dims,
            shape=packed.values.shape,
            attributes=grid.attributes_of(name, packed.attributes),
            coordinates=dict(packed.coordinates),
        )
    return template


def mismatches(template: Mapping[str, Variable], results: Mapping[int, Outcome]) -> list[tuple[int, str]]:
    """Say which results differ from the first, and how."""
    # Numbers and texts are told by their type; what was found right once need not be looked at again.
    right: set[tuple[tuple[str, type], ...]] = set()
    found = []
    for cell, outcome in results.items():
        if isinstance(outcome, str):
            continue
        looks = tuple(zip(outcome, map(type, outcome.values()), strict=True))
        if looks in right:
            continue
        complaint = mismatch(template, outcome)
        if complaint is not None:
            found.append((cell, complaint))
        elif not any(kind is Packed for _, kind in looks):
            right.add(looks)
    return found


def mismatch(template: Mapping[str, Variable], outcome: Mapping[str, Value]) -> str | None:
    """Say how a result differs from the first in names, types or shapes; None if it does not."""
    if template.keys() != outcome.keys():
        return f"measure returned {sorted(outcome)}, but {sorted(template)} in the first case"
    for name, value in outcome.items():
        variable = template[name]
        if (_kind(value), variable.dtype) not in _FITS:
            return f"measure returned {_kind(value)} for {name!r}, but {variable.dtype} in the first case"
        shape = value.values.shape if isinstance(value, Packed) else ()
        if shape != variable.shape:
            return f"measure returned shape {shape} for {name!r}, but {variable.shape} in the first case"
        if isinstance(value, Packed):
            for dim, values in value.coordinates.items():
                if dim in variable.coordinates and not np.array_equal(variable.coordinates[dim], _as_read(values)):
                    return f"measure returned other values along {dim!r} than in the first case"
    return None


def land(sink: Sink, keys: NDArray[np.uint64], results: Mapping[int, Outcome]) -> None:
    """Write results block by block: what was measured, errors, last the keys that declare them finished."""
    grid = sink.grid
    blocks: dict[int, list[int]] = {}
    for cell in results:
        blocks.setdefault(grid.block(cell), []).append(cell)
    for block, cells in blocks.items():
        region, all_cells = grid.region(block), grid.block_cells(block)
        places = np.unravel_index(np.asarray(cells) - all_cells[0], tuple(r.stop - r.start for r in region))
        for name, variable in (sink.template | _own_variables()).items():  # the keys come last
            where = (*region, *(slice(None) for _ in variable.shape))
            extent = (*(r.stop - r.start for r in region), *variable.shape)
            whole = len(cells) == len(all_cells)
            values = _blank(variable, extent) if whole else sink.read(name, where)
            column = [_entry(name, results[cell], variable, int(keys[cell])) for cell in cells]
            if variable.dtype == "str":
                for place, text in zip(zip(*places, strict=True), column, strict=True):
                    if text or not whole:
                        values[place] = text
            else:
                values[places] = np.asarray(column, dtype=variable.dtype)  # keys beyond 2**63 are no floats
            sink.write(name, where, values)


def new_store(path: Path, grid: Grid, attrs: Mapping[str, str]) -> None:
    """Make an empty store, all of it or nothing."""
    zarr = import_zarr()
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}")
        try:
            group = zarr.create_group(draft, zarr_format=3, attributes=dict(attrs))
            for name, values in grid.axes.items():
                _add_coordinate(group, name, values, grid.attributes_of(name))
            for name, variable in _own_variables().items():
                _add_array(group, grid, name, variable)
            _consolidate(draft)
            draft.rename(path)
        except BaseException:
            shutil.rmtree(draft, ignore_errors=True)
            raise


def read_group(path: Path) -> tuple[Any, dict[str, Any]]:
    """Open a store and return its group and provenance.

    Raises
    ------
    InputError
        If there is none, or it is of another kind or version.
    """
    zarr = import_zarr()
    remedy = "choose another store"
    if not path.exists():
        raise InputError(f"store = {str(path)!r}: there is no such directory")
    if not path.is_dir():
        raise InputError(f"store = {str(path)!r}: is a file, not the directory of a sweep; {remedy}")
    try:
        group = zarr.open_group(path, mode="r+", zarr_format=3, use_consolidated=True)
        provenance = json.loads(group.attrs[PROVENANCE])
        form, version = provenance["format"], provenance["format_version"]
    except OSError as error:
        if isinstance(error, FileNotFoundError):
            raise InputError(f"store = {str(path)!r}: is not the store of a sweep; {remedy}") from None
        raise InputError(f"store = {str(path)!r}: cannot be read ({error.strerror or error})") from None
    except Exception:
        raise InputError(f"store = {str(path)!r}: is not the store of a sweep; {remedy}") from None
    if form != FORMAT or version != VERSION:
        raise InputError(
            f"store = {str(path)!r}: has the format {form} {version}, but this is stickslip "
            f"{package_version()}, which reads {FORMAT} {VERSION}; {remedy}, or use the version that wrote it"
        )
    return group, cast("dict[str, Any]", provenance)


def check_identity(path: Path, there: Mapping[str, str], here: Mapping[str, str]) -> None:
    """Refuse a store whose sweep is another one, and name what differs."""
    differing = sorted(part for part in {*there, *here} if there.get(part) != here.get(part))
    if differing:
        shown = ", ".join(differing[:4]) + (" and more" if len(differing) > 4 else "")
        raise InputError(
            f"store = {str(path)!r}: holds another sweep; what differs: {shown}. Choose another store, or "
            "delete this one to start afresh"
        )


def open_dataset(path: Path) -> xr.Dataset:
    """Open the results lazily with plain xarray."""
    import xarray as xr

    dataset = xr.open_zarr(path, chunks=None, decode_times=False, decode_timedelta=False, consolidated=True)
    for name in dataset.variables:
        if dataset[name].dtype.kind in "OT":
            dataset[name] = dataset[name].copy(data=_as_read(dataset[name].values))
    result: xr.Dataset = dataset.drop_encoding()
    return result


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the lock of a store; a lock whose process is gone is taken over.

    Raises
    ------
    InputError
        If another process, or another sweep of this one, holds it.
    """
    lock = path.with_name(path.name + ".lock").absolute()
    with _HELD_GUARD:
        if lock in _HELD:
            raise InputError(f"store = {str(path)!r}: another sweep of this process is writing it; choose another")
        _HELD.add(lock)
    try:
        with writing(path):
            lock.parent.mkdir(parents=True, exist_ok=True)
            handle = _acquire(path, lock)
        try:
            yield
        finally:
            with suppress(OSError):
                lock.unlink()  # still locked: nobody else can have taken it
            os.close(handle)
    finally:
        with _HELD_GUARD:
            _HELD.discard(lock)


def sweep_up(path: Path) -> None:
    """Remove what a killed writer left half written."""
    for leftover in (*path.rglob("*.partial"), *path.parent.glob(f".{path.name}.????????")):
        if leftover.is_dir():
            shutil.rmtree(leftover, ignore_errors=True)
        else:
            with suppress(OSError):
                leftover.unlink()


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Say in one line why a store cannot be written.

    Raises
    ------
    InputError
        In place of an `OSError`.
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
        remedy = "free some space and start again" if full else "make it writable or choose another place"
        raise InputError(
            f"store = {str(path)!r}: cannot be written ({reason}); what was written is kept: {remedy}"
        ) from error


def import_zarr() -> Any:
    """Import zarr, or say in one line how to get it."""
    try:
        import zarr
    except ImportError:
        raise InputError(
            "a sweep with a store needs the zarr package, version 3: pip install stickslip[sweep]"
        ) from None
    if int(zarr.__version__.split(".")[0]) < 3:
        raise InputError(f"zarr {zarr.__version__} is too old for a store, 3 is needed: pip install stickslip[sweep]")
    return zarr


def check_name(place: str, name: object) -> None:
    """Refuse a name that cannot stand in a store."""
    if not isinstance(name, str) or not name or "/" in name or name.startswith((".", "__")) or name == "zarr.json":
        raise InputError(f"{place}: {name!r} cannot be a name; use a text without '/' that starts with a letter")


# ---------------------------------------------------------------- parts

_FITS = {
    ("float64", "float64"),
    ("float64", "complex128"),
    ("complex128", "complex128"),
    ("str", "str"),
}


def _kind(value: Value) -> str:
    if isinstance(value, float):
        return "float64"
    if isinstance(value, str):
        return "str"
    return (
        "complex128"
        if np.asarray(value.values if isinstance(value, Packed) else value).dtype.kind == "c"
        else "float64"
    )


def _corners(region: tuple[slice, ...]) -> tuple[tuple[int | None, int | None], ...]:
    return tuple((part.start, part.stop) for part in region)


def _entry(name: str, outcome: Outcome, variable: Variable, key: int) -> Any:
    """What one case puts into one array."""
    if name == KEY:
        return key
    if name == ERROR:
        return outcome if isinstance(outcome, str) else ""
    if isinstance(outcome, str):
        return np.full(variable.shape, math.nan) if variable.dtype != "str" else ""
    value = outcome[name]
    return value.values if isinstance(value, Packed) else value


def _own_variables() -> dict[str, Variable]:
    return {
        ERROR: Variable(dtype="str", attributes=_OWN[ERROR]),
        KEY: Variable(dtype="uint64", attributes=_OWN[KEY]),
    }


def _blank(variable: Variable, shape: tuple[int, ...]) -> NDArray[Any]:
    dtype = object if variable.dtype == "str" else variable.dtype
    return np.full(shape, variable.empty, dtype=dtype)


def _as_read(values: NDArray[Any]) -> NDArray[Any]:
    """Texts as Python's own, whatever the way they were kept; all else as it is."""
    values = np.asarray(values)
    return values.astype(object) if values.dtype.kind in "OTU" else values


def _python(value: Any) -> AxisValue:
    return cast(AxisValue, value.item() if isinstance(value, np.generic) else value)


def _jsonable(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value if isinstance(value, (str, int, float, bool, list)) else str(value)


def _add_array(group: Any, grid: Grid, name: str, variable: Variable) -> None:
    group.create_array(
        name,
        shape=(*grid.shape, *variable.shape),
        chunks=(*grid.block_shape, *(max(1, n) for n in variable.shape)),
        dtype=variable.dtype,
        fill_value=variable.empty,
        dimension_names=(*grid.axes, *variable.dims),
        attributes=variable.attributes,
        overwrite=True,
    )


def _add_coordinate(group: Any, name: str, values: NDArray[Any], attributes: dict[str, Any]) -> None:
    text = values.dtype.kind in "OTU"
    array = group.create_array(
        name,
        shape=values.shape,
        chunks=(max(1, len(values)),),
        dtype="str" if text else values.dtype,
        dimension_names=(name,),
        attributes=attributes,
        overwrite=True,
    )
    array[:] = values.astype(object) if text else values


def _consolidate(path: Path) -> None:
    zarr = import_zarr()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # "not part of the specification": xarray reads it, and asks for it
        zarr.consolidate_metadata(path, zarr_format=3)


def _variable_of(array: Any, axes: int) -> Variable:
    text = str(array.dtype).startswith("StringDType") or array.dtype.kind in "OTU"
    return Variable(
        dtype="str" if text else str(array.dtype),
        dims=tuple(array.metadata.dimension_names[axes:]),
        shape=tuple(array.shape[axes:]),
        attributes=dict(array.attrs),
    )


def _acquire(path: Path, lock: Path) -> int:
    while True:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            _claim(path, lock, handle)
            if _same_file(handle, lock):
                owner = {"pid": os.getpid(), "host": socket.gethostname()}
                os.ftruncate(handle, 0)
                os.pwrite(handle, json.dumps(owner).encode(), 0)
                return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)  # it was removed between opening and locking


def _claim(path: Path, lock: Path, handle: int) -> None:
    """Lock the file, unless a living process has it."""
    try:
        # Record locks end with their process, are not inherited by its children and work between hosts over
        # NFS.
        fcntl.lockf(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        known = True
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EAGAIN):
            raise InputError(_taken(path, _owner(handle))) from None
        known = False  # a file system without locks: the words in the file must do
    owner = _owner(handle)
    if owner is None or (owner["host"] == socket.gethostname() and (known or not _alive(owner["pid"]))):
        return
    raise InputError(f"{_taken(path, owner)}; if that process is gone, remove {lock}")


def _taken(path: Path, owner: dict[str, Any] | None) -> str:
    who = f" (process {owner['pid']} on {owner['host']})" if owner else ""
    return f"store = {str(path)!r}: another sweep{who} is writing it; wait for it or choose another store"


def _owner(handle: int) -> dict[str, Any] | None:
    try:
        owner = json.loads(os.pread(handle, 4096, 0))
        return {"pid": int(owner["pid"]), "host": str(owner["host"])}
    except (ValueError, KeyError, TypeError):
        return None


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def _same_file(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), os.stat(path))
    except FileNotFoundError:
        return False

"""Conversion of Datasets to files and back, and of records to plain data and back.

A result carries its ``provenance`` as an attribute, one JSON string with all that is
needed to repeat the run.
"""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip import __version__, model
from stickslip.arrays import units_of
from stickslip.errors import InputError, dataset
from stickslip.io import files
from stickslip.model.activation import ACTIVATIONS
from stickslip.model.ageing import AGEING_MODELS
from stickslip.model.body import BODIES
from stickslip.model.delays import DELAYS
from stickslip.model.distribution import Positive
from stickslip.model.distributions import DISTRIBUTIONS
from stickslip.model.methods import METHODS

if TYPE_CHECKING:
    import xarray as xr

LARGEST_RUN = 8_000_000_000  # most bytes of a run, in a file and in memory

_HDF5 = "NetCDF 4"
_CDF = "NetCDF 3"
_CDF5 = "CDF-5"
_MARKS = {
    b"\x89HDF\r\n\x1a\n": _HDF5,
    b"CDF\x01": _CDF,
    b"CDF\x02": _CDF,  # with 64-bit offsets
    b"CDF\x05": _CDF5,
}

Plain = Any
"""Values of JSON: None, bool, int, float, str, list, dict."""


def records() -> dict[str, type]:
    """Return the record classes of `stickslip.model`, and those registered by a user,
    by name, for `decode`.
    """
    ours = {
        name: kind
        for name, kind in vars(model).items()
        if isinstance(kind, type) and is_dataclass(kind)
    }
    # the first holds functions, the others are base classes
    del ours["Parameter"], ours["ElasticBody"], ours["Structure"]
    # the SteadyState of a user's distribution may hold one
    ours[Positive.__name__] = Positive
    tables = (DISTRIBUTIONS, DELAYS, AGEING_MODELS, ACTIVATIONS, METHODS, BODIES)
    return {_name_of(kind): kind for table in tables for kind in table.values()} | ours


def _name_of(kind: type) -> str:
    """Return the name of a record class in a file: that of the class, with its module
    if it is a user's own.
    """
    is_ours = kind.__module__.partition(".")[0] == __name__.partition(".")[0]
    return kind.__name__ if is_ours else f"{kind.__module__}.{kind.__qualname__}"


_INFINITIES = ("inf", "-inf")
"""Infinities as JSON holds them, which has no number for them."""


def encode(value: object) -> Plain:
    """Convert a record, a plain value, or a tuple or mapping of these, to plain data
    for JSON.

    A record becomes a mapping with its class name under ``"class"``; infinities become
    strings, and a text that reads like one of these a mapping of the class ``"text"``.
    """
    if is_dataclass(value) and not isinstance(value, type):
        names = [
            field.name
            for field in fields(value)
            # a field that does not change the result is written only if it is True
            if field.init and (field.compare or getattr(value, field.name) is True)
        ]
        return {
            "class": _name_of(type(value)),
            **{name: encode(getattr(value, name)) for name in names},
        }
    if isinstance(value, Mapping):
        return {str(key): encode(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [encode(item) for item in value]
    if isinstance(value, float) and math.isinf(value):
        return str(float(value))
    if isinstance(value, str) and value in _INFINITIES:
        return {"class": "text", "value": value}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise InputError(
        f"{value!r} cannot be written to a file; use a record, a number, a string or a "
        "tuple of these"
    )


def decode(plain: Plain, kinds: Mapping[str, type]) -> Any:
    """Convert the result of `encode` back to records of the classes in `kinds`."""
    if isinstance(plain, dict):
        if plain.get("class") == "text":
            return plain.get("value", "")
        content = {
            key: decode(item, kinds) for key, item in plain.items() if key != "class"
        }
        if "class" not in plain:
            return content
        name = plain["class"]
        kind = kinds.get(name) if isinstance(name, str) else None
        if kind is None:
            raise InputError(
                f"provenance names the record {name!r}, which this version does not "
                "have"
            )
        try:
            return kind(**content)
        # a field is missing, or unknown to this version
        except TypeError as error:
            raise InputError(
                f"provenance of {name} is of another version ({error}); make the run "
                "again"
            ) from None
    if isinstance(plain, list):
        return tuple(decode(item, kinds) for item in plain)
    if plain in _INFINITIES:
        return float(plain)
    return plain


def provenance(call: str, arguments: Mapping[str, object]) -> str:
    """Return the JSON string with the call that made a result, its arguments and the
    version.
    """
    return json.dumps(
        {"stickslip": __version__, "call": call, "arguments": encode(arguments)},
        sort_keys=True,
    )


def read_provenance(data: xr.Dataset) -> dict[str, Any]:
    """Return the provenance of a result as plain data."""
    text = getattr(data, "attrs", {}).get("provenance")
    if not isinstance(text, str):
        raise InputError(
            "this file has no provenance: it is not a run made by stickslip; analyse "
            "it with `measure`"
        )
    try:
        content = json.loads(text)
        if isinstance(content["call"], str) and isinstance(content["arguments"], dict):
            return dict(content)
    except (ValueError, KeyError, TypeError, RecursionError):
        pass
    raise InputError("the provenance in this file is damaged; make the run again")


def save(data: xr.Dataset, path: files.FileName) -> Path:
    """Write a Dataset as NetCDF, completely or not at all.

    Raises
    ------
    InputError
        If the file cannot be written, or has the suffix of another kind.
    """
    files.check_suffix(path, "a Dataset", ".nc")
    dataset("save: data", data, "a Dataset, as simulate() returns it")
    # Only numbers with a dimension can be compressed.
    encoding = {
        name: {"zlib": True, "complevel": 1}
        for name, values in data.variables.items()
        if values.ndim > 0 and values.dtype.kind in "fiub"
    }
    # Convert it in memory first: on a full disk, HDF5 prints its own messages and
    # crashes.
    return files.write(path, data.to_netcdf(engine="h5netcdf", encoding=encoding))


def as_csv(catalogue: xr.Dataset) -> str:
    """Return a Dataset of one dimension as CSV; the first line has names and units."""
    names = {
        name: f"{name} [{units_of(catalogue[name])}]" for name in catalogue.data_vars
    }
    table = catalogue.to_dataframe()[list(names)].rename(columns=names)
    # ten digits, as further digits of a difference of times are rounding errors
    text: str = table.to_csv(
        index=False,
        lineterminator="\r\n",
        na_rep="nan",
        float_format=lambda v: str(float(f"{v:.10g}")),
    )
    return text


def load(path: files.FileName) -> xr.Dataset:
    """Read a Dataset that `save` wrote into memory.

    Raises
    ------
    InputError
        If there is no such file or it is not NetCDF.
    """
    import xarray as xr

    files.size(path, "run", largest=LARGEST_RUN)
    source = Path(path)
    kind = _kind_of(source)
    if kind is None:
        raise InputError(
            f"{source}: is not a NetCDF file; a run is made with `stickslip simulate "
            "RIG -o run.nc`"
        )
    if kind == _CDF5:
        raise InputError(
            f"{source}: is a NetCDF file of the kind CDF-5, which is not read here; "
            "make it one of NetCDF 4: nccopy -k nc4 OLD NEW"
        )
    try:
        # Times are not decoded: they are numbers, and a damaged file may have any unit.
        with xr.open_dataset(**_opened(source, kind), decode_times=False) as data:
            if not data.variables:
                raise ValueError("it holds no variable")
            if data.nbytes > LARGEST_RUN:
                raise ValueError(
                    f"it unfolds to {data.nbytes / 1e9:.3g} GB, more than "
                    f"{LARGEST_RUN / 1e9:g}"
                )
            for attrs in (
                data.attrs,
                *(data[name].attrs for name in data.variables),
            ):
                # fails if the text of a damaged file is not valid Unicode
                "".join(map(str, [*attrs, *attrs.values()])).encode()
            return data.load()
    except Exception as error:  # a damaged file fails in many ways
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
    raise InputError(
        f"{source}: cannot be read as NetCDF ({why}); the file may be damaged"
    )


def _opened(source: Path, kind: str) -> dict[str, Any]:
    """Return the arguments with which xarray opens a file: its source and reader."""
    if kind == _CDF:
        # from memory, as scipy would map the file, and warn when it is closed
        return {"filename_or_obj": io.BytesIO(source.read_bytes()), "engine": "scipy"}
    import h5py

    # check first: h5netcdf prints its own traceback for a file that fails in these
    with h5py.File(source, mode="r") as file:
        file.attrs.get("_nc3_strict")
    # without a choice for unnamed dimensions, h5netcdf warns of its default
    return {
        "filename_or_obj": source,
        "engine": "h5netcdf",
        "phony_dims": "access",
    }


def is_run(path: files.FileName) -> bool:
    """Whether a file starts like a NetCDF file of any version, and is not one of HDF5
    that lacks the force of a run.
    """
    kind = _kind_of(Path(path))
    if kind == _HDF5:
        import h5py

        with suppress(OSError), h5py.File(path, mode="r") as file:
            return "spring_force" in file
    return kind is not None


def _kind_of(source: Path) -> str | None:
    """Return the kind of a NetCDF file, from its first bytes."""
    begin = files.begin(source, 8)
    kinds = (kind for mark, kind in _MARKS.items() if begin.startswith(mark))
    return next(kinds, None)

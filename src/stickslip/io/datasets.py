"""Datasets to files and back, records to plain data and back.

A result carries, as one JSON string in its attribute ``provenance``, all that is needed
to make it again.
"""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip import __version__, model
from stickslip.arrays import units_of
from stickslip.errors import InputError, instance
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

LARGEST_RUN = 8_000_000_000  # bytes that a run may have, as a file and in memory

_CDF = "NetCDF 3"
_CDF5 = "CDF-5"
_MARKS = {
    b"\x89HDF\r\n\x1a\n": "NetCDF 4",
    b"CDF\x01": _CDF,
    b"CDF\x02": _CDF,  # the same with 64-bit offsets
    b"CDF\x05": _CDF5,
}

Plain = Any
"""Values of JSON: None, bool, int, float, str, list, dict."""


def records() -> dict[str, type]:
    """Return the records of `stickslip.model`, and those registered by a user, by
    name, for `decode`.
    """
    ours = {
        name: kind
        for name, kind in vars(model).items()
        if isinstance(kind, type) and is_dataclass(kind)
    }
    # the first holds functions, the others are bases
    del ours["Parameter"], ours["ElasticBody"], ours["Structure"]
    # a SteadyState of a guest's distribution may hold one
    ours[Positive.__name__] = Positive
    tables = (DISTRIBUTIONS, DELAYS, AGEING_MODELS, ACTIVATIONS, METHODS, BODIES)
    return {_name_of(kind): kind for table in tables for kind in table.values()} | ours


def _name_of(kind: type) -> str:
    """Name of a record in a file: that of its class, with its module where it is not
    ours.
    """
    is_ours = kind.__module__.partition(".")[0] == __name__.partition(".")[0]
    return kind.__name__ if is_ours else f"{kind.__module__}.{kind.__qualname__}"


_INFINITIES = ("inf", "-inf")
"""Infinities as JSON holds them, which has no number for them."""


def encode(value: object) -> Plain:
    """Turn a record, or a tuple, mapping or plain value of records, into what JSON can
    hold.

    A record becomes a mapping with its class name under ``"class"``; infinities become
    strings, and a text that reads like one of these a mapping of the class ``"text"``.
    """
    if is_dataclass(value) and not isinstance(value, type):
        names = [
            field.name
            for field in fields(value)
            # a field that changes no number is kept where it is not as usual
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
    """Turn the result of `encode` back into records of the kinds listed."""
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
        # a field that is missing, or unknown to this version
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
    """Write a Dataset as NetCDF, whole or not at all.

    Raises
    ------
    InputError
        If the place cannot be written.
    """
    import xarray as xr

    instance("save: data", data, xr.Dataset, "a Dataset, as simulate() returns it")
    # Only numbers with a dimension can be compressed.
    encoding = {
        name: {"zlib": True, "complevel": 1}
        for name, values in data.variables.items()
        if values.ndim > 0 and values.dtype.kind in "fiub"
    }
    # In memory first: where a disk is full, HDF5 spills its own messages and then
    # crashes.
    return files.write(path, data.to_netcdf(engine="h5netcdf", encoding=encoding))


def as_csv(catalogue: xr.Dataset) -> str:
    """Return a Dataset of one dimension as a table of text, names with units first."""
    names = {
        name: f"{name} [{units_of(catalogue[name])}]" for name in catalogue.data_vars
    }
    table = catalogue.to_dataframe()[list(names)].rename(columns=names)
    # Ten digits: the others of a difference of times are rounding.
    text: str = table.to_csv(
        index=False,
        lineterminator="\r\n",
        na_rep="nan",
        float_format=lambda v: str(float(f"{v:.10g}")),
    )
    return text


def load(path: files.FileName) -> xr.Dataset:
    """Read a Dataset that `save` wrote, into memory.

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
        # A time is a number here; its unit may be anything in a damaged file.
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
                # may stand for no letter
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
        # from memory: scipy would map the file, and warn when it is closed
        return {"filename_or_obj": io.BytesIO(source.read_bytes()), "engine": "scipy"}
    import h5py

    # h5netcdf prints a traceback of its own over a file that fails in either of these
    with h5py.File(source, mode="r") as file:
        file.attrs.get("_nc3_strict")
    # named for dimensions without a name, else h5netcdf warns of its default
    return {
        "filename_or_obj": source,
        "engine": "h5netcdf",
        "phony_dims": "access",
    }


def is_netcdf(path: files.FileName) -> bool:
    """Whether a file begins as NetCDF files do, of any version."""
    return _kind_of(Path(path)) is not None


def _kind_of(source: Path) -> str | None:
    """Return the kind of a NetCDF file, from its first bytes."""
    begin = files.begin(source, 8)
    kinds = (kind for mark, kind in _MARKS.items() if begin.startswith(mark))
    return next(kinds, None)

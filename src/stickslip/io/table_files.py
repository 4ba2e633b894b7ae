"""Reading a table of numbers from a file: text, spreadsheet, or binary."""

import csv
import io
import zipfile
import zlib
from collections.abc import Mapping
from contextlib import suppress
from statistics import mode
from typing import Any

import numpy as np

from stickslip.errors import InputError, shortened
from stickslip.io.headings import Heading, with_coefficients
from stickslip.io.table_text import (
    FEWEST_READINGS,
    MOST_COLUMNS,
    Table,
    read_text,
    step_stated,
)
from stickslip.model.quantities import unit_size

_ZIP = b"PK\x03\x04"
DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError)
"""Errors of an archive that is damaged, or locked by a password."""
_HEAD_OF_ZIP = 100  # bytes that hold the name of its first file
_LARGEST = 100_000_000  # bytes of an unpacked file
_EXPORTED = {
    b"\x89HDF": "HDF5, as NetCDF is: open a run with load(), write columns as .csv",
    b"MATLAB 7.3": "MATLAB 7.3: save(file, '-v7') writes a .mat that can be read",
    b"CDF": "NetCDF: a run is opened with load(); write other columns as .csv",
    b"\xd0\xcf\x11\xe0": "an old Excel file (.xls): save it as .xlsx or .csv",
    b"PAR1": "Parquet: pandas.read_parquet(file).to_csv(...)",
    b"\x1f\x8b": "packed by gzip: unpack it first",
    b"SQLite format 3": "an SQLite database: export the table as .csv",
    b"{": "JSON: write the columns as .csv",
    b"[{": "JSON: write the columns as .csv",
    b"[[": "JSON: write the columns as .csv",
    b"<": "HTML or XML: export the table as .csv",
    b"%PDF": "a PDF: export the table as .csv",
    b"\x89PNG": "a picture: export the table as .csv",
    b"\xff\xd8\xff": "a picture: export the table as .csv",
    b"\x80\x04": "a pickle of Python: write the columns as .csv or .npy",
}
"""Kinds of file that cannot be read, by their first bytes, and how to export them."""


def read_table(
    raw: bytes, delimiter: str | None = None, decimal: str | None = None
) -> Table:
    """Find out how a file is laid out; `InputError` if it is no table."""
    raw = _unpacked(raw) if raw.startswith(_ZIP) else raw
    for magic, export in _EXPORTED.items():
        if raw.startswith(magic):
            raise InputError(f"is {export}")
    read = next((read for magic, read in _READERS if raw.startswith(magic)), None)
    if read is None:
        return read_text(raw, delimiter, decimal)
    if delimiter or decimal:
        raise InputError("is no text: leave out its delimiter and decimal sign")
    try:
        return read(raw)
    except InputError:
        raise
    # libraries raise errors of zip, XML and struct, and their own
    except Exception as error:
        remedy = (
            "`pip install 'stickslip[traces]'` to read .xlsx and .tdms, "
            "or export it as text"
        )
        raise InputError(f"cannot be read ({error}); {remedy}") from None


def _unpacked(raw: bytes) -> bytes:
    """The only file that a zip archive holds; what is no such archive, or is one that
    has a reader, stays as it is.
    """
    with suppress(*DAMAGED), zipfile.ZipFile(io.BytesIO(raw)) as archive:
        files = [
            file
            for file in archive.infolist()
            if not (file.is_dir() or file.filename.startswith("__MACOSX"))
        ]
        names = [file.filename for file in files]
        if "[Content_Types].xml" in names or names[0].endswith(".npy"):
            return raw
        if len(files) > 1 or files[0].file_size > _LARGEST:
            raise InputError(
                f"is packed by zip: {shortened(', '.join(names))}; unpack it first, or "
                "export the table as .csv"
            )
        return archive.read(files[0])
    return raw


def _of_zip(raw: bytes) -> Table:
    """An archive of arrays of numpy, or a spreadsheet."""
    return _of_numpy(raw) if b".npy" in raw[:_HEAD_OF_ZIP] else _of_spreadsheet(raw)


def _of_numpy(raw: bytes) -> Table:
    """An array of numpy, its fields or its columns, or several arrays."""
    values = np.load(io.BytesIO(raw), allow_pickle=False)
    if isinstance(values, np.lib.npyio.NpzFile):
        return _of_arrays(values)
    if values.dtype.names:
        return _of_named({name: values[name] for name in values.dtype.names})
    return _of_named(_columns_of("", np.squeeze(values)))


def _of_sound(raw: bytes) -> Table:
    """Return the table of the channels of a .wav file, with its sampling interval."""
    from scipy.io import wavfile

    rate, values = wavfile.read(io.BytesIO(raw))
    table = _of_named(_columns_of("channel", values))
    counts = [Heading(name, "counts") for name, _ in table.headings]
    return table._replace(headings=counts, step=1.0 / rate)


def _of_matlab(raw: bytes) -> Table:
    """Return the table of the variables of a .mat file: fields of structs by their own
    names, matrices by columns.
    """
    from scipy.io import loadmat

    file: Any = io.BytesIO(raw)
    held = loadmat(file, squeeze_me=True, struct_as_record=False)
    for name, value in [*held.items()]:
        if hasattr(value, "_fieldnames"):
            held |= vars(held.pop(name))
    return _of_arrays(held)


def _of_arrays(held: Mapping[str, Any]) -> Table:
    """The columns of named arrays, and the step that a number among them states."""
    named = dict[str, Any]()
    for name, values in held.items():
        if not name.startswith("_") and isinstance(values, np.ndarray):
            named |= _columns_of(name, values)
    numbers = (f"{name} = {held[name]}" for name in held if np.ndim(held[name]) == 0)
    return _of_named(named)._replace(step=step_stated(numbers))


def _columns_of(name: str, values: Any) -> dict[str, Any]:
    """Return the columns of an array, named by its name and, if there are several,
    their numbers.
    """
    if values.ndim != 2:
        return {name: values} if values.ndim == 1 else {}
    along = max(values, values.T, key=len)
    return {f"{name} {k}".strip(): column for k, column in enumerate(along.T, 1)}


def _of_named(
    named: Mapping[str, Any],
    kind: str = "variable",
    read: str = "what has {} numbers",
    headings: Mapping[str, Heading] | None = None,
) -> Table:
    """Named columns of numbers or dates, those of the length that most of them have;
    their headings, if these are not their names.
    """
    long = {
        name: np.array(_since_first(values), dtype=float)
        for name, values in named.items()
        if values.dtype.kind in "fiuM" and values.size >= FEWEST_READINGS
    }
    if not long:
        raise InputError(
            f"holds no column of numbers with at least {FEWEST_READINGS} of them"
        )
    length = mode(map(len, long.values()))
    kept = [name for name in long if long[name].size == length]
    if len(kept) > MOST_COLUMNS:
        raise InputError(
            f"has {len(kept)} columns of numbers; 1 to {MOST_COLUMNS} are read"
        )
    known = headings or {name: Heading.read(name) for name in kept}
    shown = [Heading() if name.isdigit() else known[name] for name in kept]
    for i, name in enumerate(kept):
        if named[name].dtype.kind == "M":
            shown[i] = shown[i]._replace(unit="s")
    left = [name for name in long if name not in kept]
    return Table(
        with_coefficients(shown),
        [*range(len(kept))],
        lambda places: {i: long[kept[i]].copy() for i in places},
        np.arange(1, length + 1),
        "sample {}".format,
        notes=_left_out(read.format(length), kind, left),
    )


def _since_first(values: Any) -> Any:
    """Dates in s since the first of them; numbers as they are."""
    if values.dtype.kind != "M":
        return values
    return (values - values[0]) / np.timedelta64(1, "s")


def _of_spreadsheet(raw: bytes) -> Table:
    """Return the table in the sheet with the most numbers of an .xlsx file, read as
    text separated by tabs.
    """
    import pandas as pd

    sheets = pd.read_excel(
        io.BytesIO(raw), sheet_name=None, header=None, engine="openpyxl"
    )
    numbers = {
        name: sheet.apply(pd.to_numeric, errors="coerce").count()
        for name, sheet in sheets.items()
    }
    chosen = max(sheets, key=lambda name: numbers[name].sum())
    left = [
        repr(name)
        for name, counts in numbers.items()
        if name != chosen and counts.max() >= FEWEST_READINGS
    ]
    plain = sheets[chosen].replace(r"[\t\r\n\"]", " ", regex=True)
    text = plain.to_csv(sep="\t", header=False, index=False, quoting=csv.QUOTE_NONE)
    found = read_text(text.encode(), "\t")
    return found._replace(notes=_left_out(f"sheet {chosen!r}", "sheet", left))


def _left_out(read: str, kind: str, left: list[str]) -> tuple[str, ...]:
    """Return a note of the tables that were not read, if there are any."""
    if not left:
        return ()
    named = ", ".join(left[:5]) + (f" and {len(left) - 5} more" * (len(left) > 5))
    many = f"{len(left)} other {kind}{'s' * (len(left) > 1)}"
    return (f"read was {read}; {many} with numbers left out: {named}",)


def _of_tdms(raw: bytes) -> Table:
    """Return the table of the channels of numbers of equal length in a TDMS file."""
    import nptdms

    file = nptdms.TdmsFile.read(io.BytesIO(raw))
    channels = {
        f"{one.group_name}/{one.name}": one
        for group in file.groups()
        for one in group.channels()
    }
    named = {path: one[:] for path, one in channels.items()}
    headings = {path: _heading_of_channel(one) for path, one in channels.items()}
    read = "the channels of {} readings"
    table = _of_named(named, "channel", read, headings)
    steps = {
        _step_of(one.properties)
        for path, one in channels.items()
        if len(named[path]) == table.rows.size
    } - {0.0}
    return table._replace(step=steps.pop() if len(steps) == 1 else None)


def _heading_of_channel(channel: Any) -> Heading:
    """Name and unit of a channel of a TDMS file."""
    name, unit = Heading.read(channel.name)
    properties = channel.properties
    told = properties.get("unit_string") or properties.get("NI_UnitDescription")
    return Heading(name, str(told or unit))


def _step_of(properties: Mapping[str, Any]) -> float:
    """Return the sampling interval of a channel of a TDMS file in s; 0 if it has none,
    as in a spectrum, whose interval is in 1/s.
    """
    step = float(properties.get("wf_increment") or 0.0)
    size = unit_size(str(properties.get("wf_xunit_string") or "s").strip())
    return step * size[0] if size and size[1] == {"s": 1} else 0.0


_READERS = (
    (b"TDSm", _of_tdms),
    (_ZIP, _of_zip),
    (b"\x93NUMPY", _of_numpy),
    (b"MATLAB 5.0", _of_matlab),
    (b"RIFF", _of_sound),
)
"""Readers of files, by their first bytes."""

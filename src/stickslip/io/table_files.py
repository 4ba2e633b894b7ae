"""Reading of tables of numbers from files: texts, spreadsheets, and binary files."""

import csv
import io
import re
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

_ZIP = b"PK\x03\x04"
DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError)
"""Errors of an archive that is damaged, or locked by a password."""
_HEAD_OF_ZIP = 100  # bytes of an archive that hold the name of its first file
_LARGEST = 100_000_000  # bytes of an unpacked file
_SAVED = "in Python, save it: pandas.read_{}(file).to_csv('trace.csv', index=False)"
_EXPORTED = {
    rb"CDF": "NetCDF: a run is opened with load(); write other columns as .csv",
    rb"\xd0\xcf\x11\xe0": "an old Excel file (.xls): save it as .xlsx or .csv",
    rb"PAR1": f"Parquet: {_SAVED.format('parquet')}",
    rb"ARROW1": f"Feather: {_SAVED.format('feather')}",
    rb"\x1f\x8b": "packed by gzip: unpack it first",
    rb"SQLite format 3": "an SQLite database: export the table as .csv",
    # objects, one a line, or arrays of values, which a title in brackets is not
    rb"(?:\xef\xbb\xbf)?\s*\{[^\n]*\}\s*\n\s*\{": (
        "JSON, one object a line: "
        + _SAVED.format("json").replace("(file)", "(file, lines=True)")
    ),
    rb"(?:\xef\xbb\xbf)?\s*(?:\{|\[\s*[\[{\"])": f"JSON: {_SAVED.format('json')}",
    rb"(?:\xef\xbb\xbf)?\s*<": "HTML or XML: export the table as .csv",
    rb"%PDF": "a PDF: export the table as .csv",
    rb"\x89PNG|\xff\xd8\xff": "a picture: export the table as .csv",
    rb"\x80[\x02-\x05]": "a pickle of Python: write the columns as .csv or .npy",
    rb"\d{6}[DRQM] ": "miniSEED: in Python, obspy.read(file).write('trace', 'TSPAIR')",
}
"""Kinds of file that cannot be read, by patterns of their first bytes, and how to
export them.
"""


def read_table(
    raw: bytes, delimiter: str | None = None, decimal: str | None = None
) -> Table:
    """Return the table in the bytes of a file; raises `InputError` if it holds none."""
    if raw.startswith(_ZIP):
        raw = _unpacked(raw)
    for magic, export in _EXPORTED.items():
        if re.match(magic, raw):
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
        remedy = "it may be damaged"
        if isinstance(error, ImportError):
            remedy = "`pip install 'stickslip[traces]'` to read .xlsx and .tdms"
        message = f"cannot be read ({error}); {remedy}, or export it as text"
        raise InputError(message) from None


def _unpacked(raw: bytes) -> bytes:
    """Return the only file in a zip archive; or return the archive itself if it is
    damaged, a spreadsheet, or an archive of arrays, for which there are readers.
    """
    with suppress(*DAMAGED), zipfile.ZipFile(io.BytesIO(raw)) as archive:
        names = [
            name
            for name in archive.namelist()
            if not name.endswith("/") and not name.startswith("__MACOSX")
        ]
        first = names[0] if names else ""
        if "[Content_Types].xml" in names or first.endswith(".npy"):
            return raw
        if len(names) != 1 or archive.getinfo(first).file_size > _LARGEST:
            raise InputError(
                f"is packed by zip: {shortened(', '.join(names))}; unpack it first, or "
                "export the table as .csv"
            )
        return archive.read(first)
    return raw


def _of_zip(raw: bytes) -> Table:
    """Return the table in an archive of arrays of numpy, or in a spreadsheet."""
    return _of_numpy(raw) if b".npy" in raw[:_HEAD_OF_ZIP] else _of_spreadsheet(raw)


def _of_numpy(raw: bytes) -> Table:
    """Return the table of the fields or columns of an array, or of several arrays."""
    values = np.load(io.BytesIO(raw), allow_pickle=False)
    if isinstance(values, np.lib.npyio.NpzFile):
        return _of_arrays(values)
    return _of_arrays({"": np.squeeze(values)})


def _of_sound(raw: bytes) -> Table:
    """Return the table of the channels of a .wav file, with its sampling interval."""
    from scipy.io import wavfile

    rate, values = wavfile.read(io.BytesIO(raw))
    table = _of_arrays({"channel": values})
    counts = [Heading(name, "counts") for name, _ in table.headings]
    notes = ("the samples of a sound are taken for a force", *table.notes)
    return table._replace(headings=counts, step=1.0 / rate, notes=notes)


def _of_matlab(raw: bytes) -> Table:
    """Return the table of the variables of a .mat file; fields of structs are variables
    with their own names.
    """
    from scipy.io import loadmat

    file: Any = io.BytesIO(raw)
    held = loadmat(file, squeeze_me=True, struct_as_record=False)
    for name, value in [*held.items()]:
        if hasattr(value, "_fieldnames"):
            held |= vars(held.pop(name))
    return _of_arrays(held)


def _of_hdf5(raw: bytes) -> Table:
    """Return the table of the arrays in an HDF5 file, such as a .mat file of MATLAB
    7.3; those of a group have their own names, unless several have the same.
    """
    import h5py

    held = dict[str, Any]()

    def keep(path: str, node: Any) -> None:
        if not isinstance(node, h5py.Dataset) or path.startswith("#"):
            return  # MATLAB's own groups begin with #
        if node.nbytes > _LARGEST:
            raise InputError(f"holds {path} of more than {_LARGEST / 1e6:g} MB")
        name = path.rpartition("/")[2]
        unit = node.attrs.get("units", node.attrs.get("unit", ""))
        unit = unit.decode() if isinstance(unit, bytes) else str(unit)
        title = path if name in held else name
        held[f"{title} ({unit})" if unit else title] = np.squeeze(node[()])

    with h5py.File(io.BytesIO(raw)) as file:
        if "spring_force" in file:
            raise InputError("is a run: open it with load()")
        file.visititems(keep)
    return _of_arrays(held)


def _of_arrays(held: Mapping[str, Any]) -> Table:
    """Return the table of the columns of named arrays, with the sampling interval that
    a single number among them gives. Columns of a matrix are numbered; fields of a
    structured array have their own names.
    """
    named = dict[str, Any]()
    numbers = []
    for name, values in held.items():
        if name.startswith("_"):  # the header of a .mat file
            continue
        dimensions = np.ndim(values)
        if dimensions == 0:
            numbers.append(f"{name} = {values}")
        elif dimensions == 1 and values.dtype.names:
            named |= {field: values[field] for field in values.dtype.names}
        elif dimensions == 1:
            named[name] = values
        elif dimensions == 2:
            along = max(values, values.T, key=len)
            for k, column in enumerate(along.T, 1):
                named[f"{name} {k}".strip()] = column
    return _of_named(named)._replace(step=step_stated(numbers))


def _of_named(
    named: Mapping[str, Any],
    kind: str = "variable",
    headings: Mapping[str, Heading] | None = None,
) -> Table:
    """Return the table of the named columns of numbers or dates that have the most
    frequent length. By default their headings are their names.
    """
    long = {
        name: np.array(_since_first(values), dtype=float)
        for name, values in named.items()
        if values.dtype.kind in "fiuM" and values.size >= FEWEST_READINGS
    }
    if not long:
        raise InputError(f"holds no column of at least {FEWEST_READINGS} numbers")
    length = mode(map(len, long.values()))
    kept = [name for name in long if long[name].size == length]
    if len(kept) > MOST_COLUMNS:
        raise InputError(
            f"has {len(kept)} columns of numbers; 1 to {MOST_COLUMNS} are read"
        )
    shown = []
    for name in kept:
        plain = "" if name.isdigit() else name
        heading = headings[name] if headings else Heading.read(plain)
        is_date = named[name].dtype.kind == "M"
        shown.append(heading._replace(unit="s") if is_date else heading)
    left = [name for name in long if name not in kept]
    return Table(
        with_coefficients(shown),
        [*range(len(kept))],
        lambda places: {i: long[kept[i]].copy() for i in places},
        np.arange(1, length + 1),
        "sample {}".format,
        notes=_left_out(f"were the {kind}s of {length} numbers", kind, left),
    )


def _since_first(values: Any) -> Any:
    """Return dates as seconds since the first one, and numbers unchanged."""
    if values.dtype.kind != "M":
        return values
    return (values - values[0]) / np.timedelta64(1, "s")


def _of_spreadsheet(raw: bytes) -> Table:
    """Return the table in the sheet with the most numbers of an .xlsx file, which is
    read as a text separated by tabs.
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
    return found._replace(notes=_left_out(f"was sheet {chosen!r}", "sheet", left))


def _left_out(read: str, kind: str, left: list[str]) -> tuple[str, ...]:
    """Return a note of the sheets or columns that were left out, if there are any."""
    if not left:
        return ()
    many = f"{len(left)} other {kind}{'s' * (len(left) > 1)}"
    named = shortened(", ".join(left))
    return (f"read {read}; {many} with numbers left out: {named}",)


def _of_tdms(raw: bytes) -> Table:
    """Return the table of the channels of numbers in a TDMS file."""
    import nptdms

    file = nptdms.TdmsFile.read(io.BytesIO(raw))
    channels = [channel for group in file.groups() for channel in group.channels()]
    named = dict[str, Any]()
    headings = {}
    for channel in channels:
        name = f"{channel.group_name}/{channel.name}"
        named[name] = channel[:]
        headings[name] = _heading_of_channel(channel)
    table = _of_named(named, "channel", headings)
    steps = []
    for channel in channels:
        step = channel.properties.get("wf_increment")
        unit = channel.properties.get("wf_xunit_string") or "s"  # 1/s in a spectrum
        if len(channel) == table.rows.size:
            steps.append(f"step = {step} {unit}")
    return table._replace(step=step_stated(steps))


def _heading_of_channel(channel: Any) -> Heading:
    """Return name and unit of a channel of a TDMS file."""
    heading = Heading.read(channel.name)
    for key in ("unit_string", "NI_UnitDescription"):
        if unit := channel.properties.get(key):
            return heading._replace(unit=str(unit))
    return heading


_READERS = (
    (b"TDSm", _of_tdms),
    (_ZIP, _of_zip),
    (b"\x93NUMPY", _of_numpy),
    (b"MATLAB 5.0", _of_matlab),
    (b"MATLAB 7.3", _of_hdf5),
    (b"\x89HDF", _of_hdf5),
    (b"RIFF", _of_sound),
)
"""Readers of files, by their first bytes."""

"""Reading a table of numbers from a file: text, spreadsheet, or binary."""

import csv
import io
from collections.abc import Mapping
from statistics import mode
from typing import Any

import numpy as np

from stickslip.errors import InputError
from stickslip.measure.headings import Heading, with_coefficients
from stickslip.measure.tables import MOST_COLUMNS, Table, read_text
from stickslip.measure.trace import FEWEST_READINGS
from stickslip.model.quantities import unit_size

_EXPORTED = {
    b"\x89HDF": "HDF5, as NetCDF is: open a run with load(), write columns as .csv",
    b"MATLAB 7.3": "MATLAB 7.3: save(file, '-v7') writes a .mat that can be read",
    b"CDF": "NetCDF: a run is opened with load(); write other columns as .csv",
    b"\xd0\xcf\x11\xe0": "an old Excel file (.xls): save it as .xlsx or .csv",
    b"PAR1": "Parquet: pandas.read_parquet(file).to_csv(...)",
    b"\x1f\x8b": "packed by gzip: unpack it first",
    b"SQLite format 3": "an SQLite database: export the table as .csv",
    b"{": "JSON: write the columns as .csv",
    b"%PDF": "a PDF: export the table as .csv",
    b"\x89PNG": "a picture: export the table as .csv",
    b"\xff\xd8\xff": "a picture: export the table as .csv",
    b"\x80\x04": "a pickle of Python: write the columns as .csv or .npy",
}
"""Kinds of file that cannot be read, by their first bytes, and how to export them."""


def read_table(
    raw: bytes, delimiter: str | None = None, decimal: str | None = None
) -> Table:
    """Return the table in the bytes of a file; `InputError` if there is none."""
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


def _of_numpy(raw: bytes) -> Table:
    """Return the table of a numpy array: its fields, or its columns."""
    values = np.load(io.BytesIO(raw), allow_pickle=False)
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
    named = dict[str, Any]()
    for name, values in held.items():
        if not name.startswith("_") and isinstance(values, np.ndarray):
            named |= _columns_of(name, values)
    return _of_named(named)


def _columns_of(name: str, values: Any) -> dict[str, Any]:
    """Return the columns of an array, named by its name and, if there are several,
    their numbers.
    """
    if values.ndim != 2:
        return {name: values} if values.ndim == 1 else {}
    along = max(values, values.T, key=len)
    return {f"{name} {k}".strip(): column for k, column in enumerate(along.T, 1)}


def _of_named(
    named: Mapping[str, Any], kind: str = "variable", read: str = "what has {} numbers"
) -> Table:
    """Return the table of named columns of numbers: of those with the most frequent
    length.
    """
    long = {
        name: np.array(values, dtype=float)
        for name, values in named.items()
        if values.dtype.kind in "fiu" and values.size >= FEWEST_READINGS
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
    headings = [Heading("" if name.isdigit() else name) for name in kept]
    left = [name for name in long if name not in kept]
    return Table(
        with_coefficients(headings),
        [*range(len(kept))],
        lambda places: {i: long[kept[i]].copy() for i in places},
        np.arange(1, length + 1),
        "sample {}".format,
        notes=_left_out(read.format(length), kind, left),
    )


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
    found = read_text(text.encode(), "\t", ".")
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
    table = _of_named(named, "channel", "the channels of {} readings")
    headings = []
    steps = set()
    for path, _ in table.headings:
        properties = channels[path].properties
        name, unit = Heading.read(channels[path].name)
        unit = (
            properties.get("unit_string")
            or properties.get("NI_UnitDescription")
            or unit
        )
        headings.append(Heading(name, str(unit)))
        steps.add(_step_of(properties))
    steps.discard(0.0)
    step = steps.pop() if len(steps) == 1 else None
    return table._replace(headings=with_coefficients(headings), step=step)


def _step_of(properties: Mapping[str, Any]) -> float:
    """Return the sampling interval of a channel of a TDMS file in s; 0 if it has none,
    as in a spectrum, whose interval is in 1/s.
    """
    step = float(properties.get("wf_increment") or 0.0)
    size = unit_size(str(properties.get("wf_xunit_string") or "s").strip())
    return step * size[0] if size and size[1] == {"s": 1} else 0.0


_READERS = (
    (b"TDSm", _of_tdms),
    (b"PK\x03\x04", _of_spreadsheet),
    (b"\x93NUMPY", _of_numpy),
    (b"MATLAB 5.0", _of_matlab),
    (b"RIFF", _of_sound),
)
"""Readers of files, by their first bytes."""

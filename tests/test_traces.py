"""Reading force traces: tables of all instruments, and refusals in one line."""

import datetime as dt
import gzip
import re
import subprocess
import sys
import time
import zipfile

import h5py
import numpy as np
import pandas as pd
import pytest
import xarray as xr

from stickslip import cli
from stickslip.errors import InputError
from stickslip.measure import read_trace, regime
from stickslip.measure.trace_reader import LARGEST_FILE

FORCES = np.round(5.0 + np.abs(np.mod(np.arange(60) * 0.37, 3.0)), 2)


def written(tmp_path, text, name="trace.csv"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def rows(form, forces=FORCES, changes=None):
    """Lines of a table, some of them others: an f-string of the time t, the force f."""
    line = compile(f"f{form!r}", "rows", "eval")
    known = [{"t": 0.25 * i, "f": force} for i, force in enumerate(forces)]
    made = [eval(line, globals(), each) for each in known]
    for i, row in (changes or {}).items():
        made[i] = row
    return "\n".join([*made, ""])


def in_parts(form, head=""):
    """Lines of a table in two parts, the second below a head of its own."""
    lines = rows(form).splitlines(keepends=True)
    head = head or "\n" + LABVIEW.split("***\t\n\t\n")[1]
    return "".join([*lines[:30], head, *lines[30:]])


def commas(form):
    """Lines of a table with decimal commas."""
    return rows(form).translate(COMMA)


def night(t):
    """A time around midnight."""
    return dt.datetime(2024, 2, 29, 23, 59, 55) + dt.timedelta(seconds=t)


COMMA = str.maketrans(".", ",")
NUMBERS = rows("{f}")
TIMES_OF_SAW = np.round(0.01 * np.arange(600), 2)
PAIRS, SEMICOLONS = (rows(f"{{t}}{mark}{{f}}") for mark in ",;")
TIMES = 0.25 * np.arange(FORCES.size)
KN = {"units": ("s", "kN")}
MILLI = {"units": ("ms", "mN")}
THOUSANDS = {"units": ("s", "mN"), "size": 1e3}
STEP = {"step": 1.0}
ZEROS = 60_000 * "0"
LATE = {3: "x,1", 10: "1,1"}
ASKS_FORCE = r"is the force\? .*--force .* force= .* 1 't', 2 'position'"
ASKS_TIME = "which column is the time.*--time .* time=.*--step.* step="
NO_COLUMN = r"no such column.* 1 'a' \(no numbers"
UNREADABLE = ["NaN N1", "inf", "1e999", "1.2.3"]
UNREADABLE += ["1" + 400 * "0", "1," * 9_000]
GERMAN = (
    "Prüfung;Reibung 7\nDatum;01.02.2024\nNormalkraft;1920 "
    "N\n\nZeit;Kraft;Weg;Normalkraft\ns;N;mm;N\n"
) + commas("{t:.2f};{f:.2f};{2 * t:.2f};20,00")
LABVIEW = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
    "Decimal_Separator\t.\nMulti_Headings\tNo\nX_Columns\t{columns}\n"
    "Time_Pref\tRelative\nOperator\tN. N.\nDate\t2024/02/01\nTime\t12:00:00\n"
    "***End_of_Header***\t\n\t\nChannels\t1\t\nSamples\t60\t\nDate\t2024/02/01\t\n"
    "Y_Unit_Label\tkN\t\nX_Dimension\tTime\t\nX0\t0.0000000000000000E+0\t\n"
    "Delta_X\t0.250000\t\n***End_of_Header***\t\t\nX_Value\tForce\tComment\n"
)
BARE_LABVIEW = (
    "LabVIEW Measurement\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\t\n"
    "Channels\t1\nY_Unit_Label\tNewtons\nX0\t0.0\nDelta_X\t0.25\n***End_of_Header***\t\n"
)
CATMAN = """Zeit 1 - Standardmessrate|Kraft|Weg\nms|mN|mm\nSR=4 Hz|SR=4 Hz|SR=4 Hz
T0=1.2.24 12:00|T0=1.2.24 12:00|T0=1.2.24 12:00\nS9M|MX4 CH 1|MX4 CH 2\n"""
NEWTONS = {"units": ("s", "Newtons")}
HEADS = """t (ms);F (mN) | t/ms;F/mN | time_ms;force_mN | Zeit in ms;Kraft in mN
timeMs;frictionForcemN | Time <ms>;Force {mN} | Time (in ms);Force [mN] (raw) | ms;mN
[ms] Time;Force - mN | Time (ms) Run #1;Force (mN) Run #1 | uptime_ms;tau.mN
时间（ms）;摩擦力（mN）"""


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (NUMBERS, {"step": 0.25}),
        (rows("{f} N1 "), {"step": 0.25}),
        (commas("{f}"), {"step": 0.25, "decimal": ","}),
        (commas("{f:.2f} N"), {"step": 0.25, "decimal": ","}),
        ("force\n#\n" + NUMBERS, {"step": 0.25}),
        ("Force (N)\n\n" + NUMBERS, {"step": 0.25}),
        ("time [s], Force [N]\n" + rows("{t}, {f}"), {}),
        ("t F\n" + rows("  {t}   {f}  "), {}),
        ("t F\n" + commas("{t} {f}"), {}),
        ("# t F_d\n" + rows("{t:.6e} {f:.6e}"), {}),
        (PAIRS, {"time": 1, "force": 2}),
        (PAIRS, {"force": 2, "step": 0.25}),
        ("x,a,b\n" + rows("{9 - f},{f},{t}"), {"force": "a", "time": "B"}),
        ('"t","spring_force","what"\n' + rows('"{t}","{f}","pull, slow"'), {}),
        ("date,t,F_d\n" + rows("2020-01-02,{t},{f}"), {}),
        (rows("{t}|{f}"), {"delimiter": "|", "time": 1, "force": 2}),
        ("t;F_d\n" + commas("{t};{f}"), {"delimiter": ";"}),
        ("t;F_d\n" + commas("{t:g};{f:.2e}"), {"delimiter": ";", "decimal": ","}),
        ('"Time (s)","Force (N)"\n' + commas('"{t:.2f}|{f}"').replace("|", '","'), {}),
        ("\ufeff" + NUMBERS.replace("\n", "\r\n"), {"step": 0.25}),
        (NUMBERS + "End of file\n", {"step": 0.25, "rows": FORCES.size + 1}),
        ("t,F_d\n" + PAIRS, {"step": 0.25}),
        *((GERMAN.encode(code), {}) for code in ("latin-1", "utf-8-sig", "utf-16-le")),
        (GERMAN.replace("\n", "\r\n").encode("cp1252"), {}),
        ("Zeit [hh:mm:ss];Kraft (N)\n" + commas("10:07:{t:06.3f};{f}"), {}),
        ("when\tforce [N]\n" + rows("{night(t)}\t{f}"), {"time": 1}),
        ("time force\n" + rows("{night(t):%H:%M:%S.%f} {f}"), {}),
        ("Time (s)  Force (N)\n" + rows("{t}  {f}"), {}),
        ("# time (s), force (N)\n" + rows("{t} {f}"), {}),
        ("ts,date,F,T\ns,,N,°C\n" + rows("{t},2024-02-01,{f},21.5"), {}),
        ("Time;Force\ns;N\n\n" + rows("{t};{f}\n"), {}),
        (rows("{t} s\t{f} N"), {}),
        *(
            ("t;F (mN)\n" + rows("{t};{1e3 * f:,.2f}").replace(",", mark), THOUSANDS)
            for mark in ",'\u202f"
        ),
        ("t,F\n" + PAIRS.replace("\n1.0,", "\n# paused\n1.0,"), {}),
        # Fortran, DOS
        ("Load cell (N)\n" + rows("{f / 10:.6f}D+01") + "\x1a", {"step": "250 ms"}),
        *((f"{head}\n{SEMICOLONS}", MILLI) for head in re.split(r" \| |\n", HEADS)),
        (("t (s);F (µN)\n" + SEMICOLONS).encode("latin-1"), {"units": ("s", "µN")}),
        ("Time,Channel A\n(s),(kN)\n\n" + PAIRS, KN),
        ("t (ms);F (mN)\n" + rows("{t};{f};"), MILLI),
        ('"t\n(ms)";"F\n(mN)"\n' + SEMICOLONS, MILLI),
        ("\tt [ms]\tF [mN]\n" + rows("\t{t}\t{f}"), MILLI),
        ("; t(ms) F(mN)\n" + rows("{t} {f}"), MILLI),
        ("Peak;COF\n7.1;0.3\n\nt (ms);F (mN)\n" + SEMICOLONS, MILLI),
        (CATMAN + rows("{t}|{f}|{t}"), MILLI),
        ("Reading;F [N];t [s]\n" + rows("{int(4 * t)};{f};{t}"), {}),
        ("Name,b\nSampling rate: 4 Hz\nForce (N)\n" + NUMBERS, {}),
        ("Interval,0.25\nVertical Units,kN\nLabel,\nTIME,CH1\n" + PAIRS, KN),
        (LABVIEW.format(columns="One") + in_parts("{t:.6f}\t{f:.6f}\t"), KN),
        (LABVIEW.format(columns="No") + in_parts("\t{f:.6f}\t"), KN),
        ("t,F\ns,kN\n" + in_parts("{t},{f}", "t,F\ns,kN\n"), KN),
        ("Time (s),Extension (mm),Load (kN)\n" + rows("{t},{t},{f}"), KN),
        ("Time  Load cell\n" + rows("{t} ms {f} kN"), {"units": ("ms", "kN")}),
        ("t;Friction coefficient (kN)\n" + SEMICOLONS, KN),
        ("t;Friction coefficient (V)\n" + SEMICOLONS, {"units": ("s", "V")}),
        ("t,COF (%)\n" + rows("{t},{100 * f}"), {"units": ("s", "1")}),
        (LABVIEW.format(columns="One") + rows("{t:.6f}\t{f:.6f}\t"), KN),
        (LABVIEW.format(columns="No") + rows("\t{f:.6f}\t"), KN),
        *(
            (BARE_LABVIEW + names + rows("{t:.6f}\t{f:.6f}"), NEWTONS)
            for names in ("X_Value\tUntitled\tComment\n", "X_Value\tForce\n", "")
        ),
    ],
)
def test_tables_of_every_usual_form_are_read(tmp_path, text, options):
    options = {"units": ("s", "N"), "rows": FORCES.size} | options
    units = options.pop("units")
    count = options.pop("rows")
    forces = options.pop("size", 1.0) * FORCES
    data = read_trace(written(tmp_path, text), **options)
    np.testing.assert_allclose(data["spring_force"], forces, rtol=1e-15)
    np.testing.assert_allclose(data["time"], TIMES)
    assert data.attrs["rows"] == count
    assert not data["filled"].any()
    assert (data["time"].attrs["units"], data["spring_force"].attrs["units"]) == units


@pytest.mark.parametrize(
    ("form", "row"),
    [
        *(("{f}", word) for word in UNREADABLE),
        ("{t};{f} N", "5;99.0 broken"),
        ("{t};{f} N", "5;7.0 mm"),
        ("{t};{f} N", "5;700 mN"),
        ("{t};{f}", "5;7 mN"),
        # where commas are decimal 1.234 may be 1234
        ("{f'{t};{f}'.translate(COMMA)}", "5,00;5.330"),
    ],
)
def test_a_few_unreadable_rows_are_filled_and_reported(tmp_path, form, row):
    options = {"time": 1, "force": 2} if ";" in row else {"step": 0.25}
    data = read_trace(written(tmp_path, rows(form, changes={20: row})), **options)
    assert data.sizes["time"] == data.attrs["rows"] == FORCES.size
    between = 0.5 * (FORCES[19] + FORCES[21])
    assert float(data["spring_force"][20]) == pytest.approx(between)
    others = np.arange(FORCES.size) != 20
    np.testing.assert_array_equal(data["spring_force"][others], FORCES[others])
    assert list(np.flatnonzero(data["filled"])) == [20]
    text = "1 of 60 rows could not be read; the force there is interpolated in time "
    assert f"{text}(line 21: '{row[:57]}" in data.note
    changes = {i: row.replace("5", f"{0.25 * i}", 1) for i in range(20, 40, 3)}
    many = written(tmp_path, rows(form, changes=changes))
    message = "7 of 60 rows cannot be read, first line 21: .* in the unit of the others"
    with pytest.raises(InputError, match=message):
        read_trace(many, **options)


def test_unreadable_rows_with_times_leave_a_gap_in_time(tmp_path):
    """A comment is no row, though a force follows in it."""
    changes = {10: "2.5,x", 30: "??", 31: "7.75,8,5", 40: "# paused,7\n10.0,7.0"}
    data = read_trace(written(tmp_path, "t,F_d\n" + rows("{t},{f}", changes=changes)))
    assert data.sizes["time"] == FORCES.size - 2  # the times of two rows are not known
    assert not {7.5, 7.75} & {*data["time"].values}
    assert bool(data["filled"].sel(time=2.5))
    assert "3 of 60 rows" in data.attrs["note"]


@pytest.mark.parametrize("none", ["", "N/A", "---", "OL", "#DIV/0!"])
def test_rows_without_a_reading_are_a_gap(tmp_path, none):
    """Short ones are interpolated; in half of the rows or more, they are left out."""
    forces = np.concatenate([FORCES, FORCES])
    for blank, left, filled in (
        ([*range(5, 120, 10)], 120, 12),
        ([*range(40, 60)], 100, 0),
        ([*range(1, 120, 2)], 60, 0),
    )[: 2 if none[-2:] in ("OL", "0!") else 3]:
        changes = {i: f"{0.25 * i},{none}" for i in blank}
        text = "t (s),F (N)\n" + rows("{t},{f}", forces, changes)
        data = read_trace(written(tmp_path, text))
        assert (data.sizes["time"], int(data["filled"].sum())) == (left, filled)
        assert f"{len(blank)} of 120 rows" in data.attrs["note"]


@pytest.mark.parametrize("last", ["1", "14.75,5.5", "x", "14.75,5.5\nend"])
def test_a_last_row_that_is_cut_off_or_repeated_is_left_out(tmp_path, last):
    data = read_trace(written(tmp_path, "t (s),F (N)\n" + PAIRS + last))
    np.testing.assert_array_equal(data["spring_force"], FORCES)
    assert f"line 62: '{last[:9]}'" in data.attrs["note"]


MAGIC = {b"PAR1": "Parquet: .*read_parquet", b'[\n {"t":': "JSON: .*read_json"}
UNCLEAR = """F x 1000 (N)=mult,F (N) /10=div,1e3*F (N)=mult,forceMN=mN or MN,\
F (10^3 N)=number,Load cell (500 N)=number,F (mn)=mN or MN,ln(F) (N)=a function"""


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        (NUMBERS, {}, "step="),
        ("t (s),F\n" + PAIRS, {"step": 0.1}, "rises by 250 ms instead; leave out the"),
        ("t (s),F\n" + PAIRS, {"load": "20"}, "a value needs its unit, as in '20 N'"),
        (NUMBERS, {"step": 0.0}, "step = 0"),
        *((NUMBERS, STEP | {name: "x;"}, name) for name in ("delimiter", "decimal")),
        ("t,F_d\n" + PAIRS, {"force": "f_c"}, "there are 1 't', 2 'F_d'"),
        ("t,F_d\n" + PAIRS, {"force": 0}, "counted from 1"),
        ("t,F_d\n" + PAIRS, {"force": 1, "time": 1}, "both force and time"),
        ("t,F_d\n" + PAIRS, {"step": 0.1, "time": "time"}, "leave one out"),
        (PAIRS, {"step": 0.1}, "which column is the force"),
        (rows("{int(t)},{int(f)}"), {"step": 0.1}, "decimal comma"),
        (rows("{f} N/m"), {"step": 0.1}, "column 1 holds numbers in 'N/m'"),
        *((text, STEP, "is empty, or holds blanks and c") for text in ("", " \n\n")),
        ("to be\nor not\nto be\n", STEP, "no column of numbers"),
        ("1\n2\n3\n", STEP, "3 readings are too few"),
        (NUMBERS + "x\n1\ny\n2\nz\n3\nu\n4\n", STEP, "4 of 68 rows .*, first line 61"),
        ("t,F\ns,N\n" + in_parts("{t},{f}", "s,mN\n"), {}, "line 33: .* in mN, no"),
        ("t,F_d\n" + rows("{int(t)},{f}"), {}, "line 3: time 0 is that .* 59 rows"),
        ("t,F_d\n" + rows("{-t},{f}"), {}, "line 3: time -0.25 does not come after"),
        ("t,F\n" + rows("{t},{f}", changes=LATE), {}, "line 12: time 1 does not come"),
        ("1.0\n\x00\x01\x02\n" + NUMBERS, STEP, "binary"),
        ("a,F_d\n" + rows("x,{f}"), STEP | {"force": "a"}, NO_COLUMN),
        ("time force\n" + rows("{t} {f} N kg"), {}, "'N kg'; write one known unit"),
        ("time;force\n" + rows("{t};1 {200 + f:.3f}"), {}, "no numbers such as 1234.5"),
        ("t;F\n" + rows("{t:g};{1e3 * f:,.0f}"), {}, "'[5-7],[0-9]*' may hold thou"),
        ("time,force\n" + commas("{t},{f}"), {}, "4 columns, or fewer with decimal"),
        ("t,position\n" + PAIRS, {}, ASKS_FORCE),
        ("t (s),z (mm)\n" + PAIRS, {}, r"which column is the force.*2 'z \(mm\)'"),
        ("t,F,F\n" + rows("{t},{f},{f}"), {}, "which column is the force"),
        ("a,F\n" + rows("{np.sin(t)},{f}"), {}, ASKS_TIME),
        ("t,F\n" + rows('{t},"{f}'), {}, "line"),
        ("t (s);F (s)\n" + rows("{t};{f} N"), {}, "numbers in 'N' below .* 's'"),
        (rows("{t}" + ",{f}" * 1500), {}, "1501 columns, more than 1000"),
        (NUMBERS + f"1{ZEROS}x\n2{ZEROS}x\n3x3\n4x4\n", STEP, "4 of 64 rows"),
        (1000 * "pulled, slowly\n" + 4000 * "0.25,1.5\n", {}, "begins by line 1000"),
        (b"\x89HDF\r\n" + bytes(100), {}, "cannot be read .*signature not found"),
        (b"CDF\x01" + bytes(100), {}, "NetCDF"),
        *((head, {}, f"is {kind}") for head, kind in MAGIC.items()),
        *(
            (f"t;{head}\n" + SEMICOLONS, {}, f"{why}.*2:mN")
            for head, why in re.findall("([^,]+)=([^,]+)", UNCLEAR)
        ),
        (b"\x93NUMPY" + bytes(9), {"delimiter": ";"}, "is no text: leave out its"),
        (NUMBERS.replace("\n", "foo\n"), STEP, "no column of numbers"),
        ("Load cell (N)\n" + NUMBERS, STEP | {"load": "7"}, "no such column"),
        ("F (N)\n" + NUMBERS, STEP | {"load": "-7 N"}, "load = '?-7"),
        ("F (N)\n" + NUMBERS, STEP | {"load": "7 s"}, "load = '7 s'"),
    ],
)
def test_what_could_be_misread_is_refused_in_one_line(tmp_path, text, options, message):
    path = written(tmp_path, text)
    begin = time.process_time()
    with pytest.raises(InputError, match=message) as caught:
        read_trace(path, **options)
    assert time.process_time() - begin < 1.0
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


def test_a_table_that_is_packed_is_read_as_the_one_that_is_not(tmp_path):
    whole = written(tmp_path, NUMBERS)
    packed = tmp_path / "packed.csv.gz"
    packed.write_bytes(gzip.compress(whole.read_bytes()))
    xr.testing.assert_equal(read_trace(packed, step=1.0), read_trace(whole, step=1.0))
    for damaged in (packed.read_bytes()[:-12], packed.read_bytes()[:12] + b"\xff" * 40):
        packed.write_bytes(damaged)
        with pytest.raises(InputError, match=r"packed\.csv\.gz: cannot be read"):
            read_trace(packed, step=1.0)
    packed.write_bytes(gzip.compress(bytes(LARGEST_FILE + 1)))
    with pytest.raises(InputError, match="unpacks to more than"):
        read_trace(packed, step=1.0)


def test_several_columns_are_told_by_their_names(tmp_path):
    data = read_trace(written(tmp_path, GERMAN))
    np.testing.assert_allclose(data["measured_displacement"], 2 * TIMES)
    assert data["measured_displacement"].attrs["units"] == "mm"
    np.testing.assert_allclose(data["load"], 20.0)
    np.testing.assert_allclose(data["mu"], FORCES / 20.0)
    assert data["mu"].attrs == {"units": "1", "long_name": "coefficient of friction"}
    names = {"force": "Kraft", "time": "zeit", "load": "Normalkraft", "displacement": 3}
    by_name = read_trace(tmp_path / "trace.csv", **names)
    np.testing.assert_array_equal(by_name["spring_force"], data["spring_force"])
    other = read_trace(tmp_path / "trace.csv", force="Kraft (N)", load="0.04 kN")
    np.testing.assert_allclose(other["mu"], FORCES / 40.0)
    pressed = read_trace(written(tmp_path, GERMAN.replace("20,00\n", "-20,00\n")))
    np.testing.assert_allclose(pressed["mu"], FORCES / 20.0)


BARE = "Time(s)\tDispl(microns)\tFriction\tNormal_stress(MPa)\n"
COEFFICIENT = "coefficient of friction"
NAMES = "t,COF;time,Friction coefficient;t,µ;Zeit,Reibwert;Time(s),Friction (-)"
COEFFICIENTS = [f"{head}\n" + rows("{t},{f / 10:.4f}") for head in NAMES.split(";")]
MICRONS = {"measured_displacement": "microns", "load": "MPa"}
ASSUMED = "no unit of the force: N assumed.*no unit of the time: s assumed"
SINCE_1970 = "timestamp,F (N)\n" + rows("{1.7e12 + 1e3 * t:.0f},{f}")


@pytest.mark.parametrize(
    ("text", "force", "others", "note"),
    [
        *((text, COEFFICIENT, {}, "^(?!.*N assumed)") for text in COEFFICIENTS),
        # A bare column of friction beside columns with units.
        (BARE + rows("{t}\t{3 * t}\t{f / 10:.4f}\t19.97"), COEFFICIENT, MICRONS, ""),
        ("t,F\n" + PAIRS, "force", {}, ASSUMED),
        ("t (s),F (N)\n" + PAIRS, "force", {}, "^$"),
        (SINCE_1970, "force", {}, "^the times are taken for ms since 1970$"),
    ],
)
def test_units_that_are_not_named_are_assumed(tmp_path, text, force, others, note):
    path = written(tmp_path, text)
    data = read_trace(path)
    flipped = read_trace(path, flip=True)
    unit = "N" if force == "force" else "1"
    assert data["spring_force"].attrs == {"units": unit, "long_name": force}
    more = {*data.data_vars} - {"spring_force", "filled"}
    assert {name: data[name].attrs["units"] for name in more} == others
    assert re.search(note, data.attrs["note"])
    np.testing.assert_array_equal(flipped["spring_force"], -data["spring_force"])
    assert flipped.attrs["flipped"] == 1


def write_book(path, sheets):
    """Write a spreadsheet: the rows of each sheet by its name."""
    book = pytest.importorskip("openpyxl").Workbook()
    for name, lines in sheets.items():
        sheet = book.create_sheet(name)
        for row in lines:
            sheet.append([*row])
    book.save(path)


def test_a_spreadsheet_is_read(tmp_path):
    head = [("Bench", "7"), ("Date", dt.date(2024, 2, 1)), ()]
    head += [("Time", "Force", "Remark"), ("ms", "kN", None)]
    numbers = [*zip((1e3 * TIMES).tolist(), FORCES.tolist(), strict=True)]
    sheets = {"notes": [("see the second sheet",)], "data": head + numbers}
    write_book(tmp_path / "bench.xlsx", sheets)
    data = read_trace(tmp_path / "bench.xlsx")
    np.testing.assert_array_equal(data["spring_force"], FORCES)
    np.testing.assert_allclose(data["time"], 1e3 * TIMES)
    assert data["time"].attrs["units"] == "ms"
    assert data["spring_force"].attrs["units"] == "kN"
    texts = [[f"{each}".translate(COMMA) for each in row] for row in numbers]
    write_book(tmp_path / "texts.xlsx", {"data": head + texts})
    xr.testing.assert_equal(read_trace(tmp_path / "texts.xlsx"), data)


def write_tdms(path, channels):
    """Write channels by name: their readings and properties."""
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as writer:
        for name, each in channels.items():
            writer.write_segment([nptdms.ChannelObject("Run 1", name, *each)])


def test_a_tdms_file_is_read(tmp_path):
    waveform = {"wf_increment": 0.25, "wf_start_offset": 0.0}
    channels = {
        "Clock": (np.datetime64("2026-04-25") + (1e6 * TIMES).astype("m8[us]"), None),
        "Friction force": (FORCES, {"unit_string": "mN"}),
        "Temperature": (FORCES, waveform | {"unit_string": "°C"}),
        "Remarks": (["pulled"] * FORCES.size, None),
        "Spare": (np.array([]), None),
    }
    write_tdms(tmp_path / "bench.tdms", channels)
    data = read_trace(tmp_path / "bench.tdms")
    np.testing.assert_array_equal(data["spring_force"], FORCES)
    np.testing.assert_allclose(data["time"], TIMES)
    assert data["spring_force"].attrs["units"] == "mN"


def test_sheets_and_channels_left_out_are_noted(tmp_path):
    numbers = [*zip(TIMES.tolist(), FORCES.tolist(), strict=True)]
    head = [("Time (s)", "Force (N)")]
    sheets = {"Run 1": head + numbers, "Run 2": head + numbers[:-5]}
    write_book(tmp_path / "runs.xlsx", sheets | {"Notes": [("bench", 7)]})
    data = read_trace(tmp_path / "runs.xlsx")
    np.testing.assert_array_equal(data["spring_force"], FORCES)
    note = "read was sheet 'Run 1'; 1 other sheet with numbers left out: 'Run 2'"
    assert data.attrs["note"] == note
    channels = {
        name: (forces, {"unit_string": unit, "wf_increment": 0.25})
        for name, forces, unit in (
            ("Force", FORCES, "N"),
            ("Force B", FORCES[:-5], "N"),
            ("Room", FORCES, "K"),
        )
    }
    write_tdms(tmp_path / "runs.tdms", channels)
    note = read_trace(tmp_path / "runs.tdms").attrs["note"]
    assert "1 other channel with numbers left out: Run 1/Force B" in note
    text = "Peak;COF\n7.1;0.3\n\nt (s);F (N)\n" + in_parts("{t};{f}", "t (s);F (N)\n")
    note = read_trace(written(tmp_path, text)).attrs["note"]
    assert note.startswith(
        "rows of numbers above the table, left out: 1; lines that rep"
    )


UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "": 1.0, "Hz": None}


@pytest.mark.parametrize(("unit", "second"), UNITS.items())
def test_the_interval_of_a_waveform_has_the_unit_that_it_names(tmp_path, unit, second):
    waveform = {"wf_increment": 0.25, "wf_xunit_string": unit, "unit_string": "N"}
    write_tdms(tmp_path / "bench.tdms", {"Force": (FORCES, waveform)})
    if second is None:
        with pytest.raises(InputError, match=r"give the step"):
            read_trace(tmp_path / "bench.tdms")
        return
    data = read_trace(tmp_path / "bench.tdms")
    np.testing.assert_allclose(data["time"], second * TIMES)
    assert data["time"].attrs["units"] == "s"


@pytest.mark.parametrize(
    ("name", "start", "module"),
    [("a.xlsx", b"PK\x03\x04", "openpyxl"), ("a.tdms", b"TDSm", "nptdms")],
)
def test_a_reader_that_is_missing_is_named(tmp_path, monkeypatch, name, start, module):
    (tmp_path / name).write_bytes(start + bytes(100))
    if name.endswith("tdms"):
        pytest.importorskip(module)
    with pytest.raises(InputError, match=r"a\.(xlsx|tdms): cannot be read .*damaged"):
        read_trace(tmp_path / name)
    monkeypatch.setitem(sys.modules, module, None)
    message = rf"(?i){module}.*pip install 'stickslip\[traces\]'"
    with pytest.raises(InputError, match=message) as caught:
        read_trace(tmp_path / name)
    assert "\n" not in str(caught.value)


MEASURED = """
import sys, time
from pathlib import Path
from stickslip.cli import main

def memory():
    status = Path("/proc/self/status").read_text().split()
    return 1024 * int(status[status.index("VmHWM:") + 1])

times = [time.process_time()]
for rows in ("tenth", "tenth", "all"):  # the first time with all imports
    before = memory()
    main(["measure", f"{sys.argv[1]}/{rows}.csv", *sys.argv[2:]])
    times.append(time.process_time())
print((times[3] - times[2]) / (times[2] - times[1]), memory() - before)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="peak memory is read from /proc")
@pytest.mark.parametrize("columns", [1, 2])
def test_five_million_rows_take_time_and_memory_in_proportion(tmp_path, columns):
    """At most twice ten times what a tenth of the rows takes, which caches may hold."""
    rng = np.random.default_rng(1)
    t = 1e-4 * np.arange(5_000_000)
    force = 5 + 2 * (t % 1.5) + rng.normal(0, 0.05, t.size)
    made = pd.DataFrame({"t": t, "F": force}).iloc[:, -columns:]
    plain = {"sep": ";", "header": False, "index": False, "float_format": "%.4f"}
    made[: t.size // 10].to_csv(tmp_path / "tenth.csv", **plain)
    made.to_csv(tmp_path / "all.csv", **plain)
    options = ["--step", "1e-4"] if columns == 1 else ["--time", "1", "--force", "2"]
    call = [sys.executable, "-c", MEASURED, str(tmp_path), *options]
    done = subprocess.run(call, check=True, capture_output=True, text=True)
    assert done.stdout.count("stick-slip: ") == 3
    longer, more = map(float, done.stdout.splitlines()[-1].split())
    assert longer <= 20.0
    assert more <= 800e6


WAVE = 2.0 + np.arange(4000) * 0.01 % 1.0


@pytest.mark.parametrize("value", [-9999.0, 40.0])
def test_a_value_that_stands_for_none_is_no_force(tmp_path, value):
    at = np.array([0, 1, *range(7, 3990, 40), 3998, 3999])  # however often it comes
    forces = WAVE.copy()
    forces[at] = value
    file = written(tmp_path, "force (N)\n" + rows("{f:.4f}", forces))
    data = read_trace(file, step=0.01)
    # nothing beyond the ends
    assert data.sizes["time"] == 3996
    assert np.flatnonzero(data["filled"]).tolist() == (at[2:-2] - 2).tolist()
    assert f"{at.size} of 4000 rows could not be read" in data.attrs["note"]
    forces[::50] = value * np.linspace(1.0, 2.0, forces[::50].size)
    file = written(tmp_path, "force (N)\n" + rows("{f:.4f}", forces))
    with pytest.raises(InputError, match=r"first line \d+: .* not far outside the re"):
        read_trace(file, step=0.01)


@pytest.mark.parametrize(("length", "size"), [(5, -3.0), (3, -3.0), (80, 2.0)])
def test_a_force_that_moves_is_no_fault_however_far_and_seldom(tmp_path, length, size):
    forces = np.random.default_rng(1).normal(5.0, 0.01, 6000).round(4)
    for begin in range(100, 6000, 60 * length):
        forces[begin : begin + length] += size
    file = written(tmp_path, "force (N)\n" + rows("{f:.4f}", forces))
    data = read_trace(file, step=0.01)
    np.testing.assert_allclose(data["spring_force"], forces)
    assert "rows" not in data.attrs["note"]


SAW = 5.0 + 2.0 * (2.0 * TIMES_OF_SAW % 1.0)


def table(head, *columns):
    lines = (",".join(map(str, row)) for row in zip(*columns, strict=True))
    return "\n".join([head, *lines, ""])


CHOSEN = r"""
t (s),Torque (N m),WOB (kN) | tFL | force: column 2 .Torque. .N m.; load:\x20
t (s),Moment (NM),n (1/min) | tFv | column 2 .Moment. .N m.; velocity:\x20
Time,DAQ.Fz (N),DAQ.Fx (N),DAQ.COF () | tLFm | column 3 .DAQ.Fx. .N.; load
time (s),friction coefficient mu | tm | column 2 .friction coefficient mu.;
Time,Analog 1; ms,Torque | tF | time: column 1 .Time. .ms.; force: .*Torque
Channel name,"Force"; Unit,"V" | tF | time: column 1; force: column 2 .*V
time,force; -----,----- | tF | time: column 1 .time.; force: column 2 .for
"unit","N","g"; "Time(sec)","Fn","Fx" | tLF | column 3 .Fx. .g.; load:\x20
t,temperature of friction pad (degC),F (N) | tLF | force: column 3\x20
 | tF | time: column 1; force: column 2; 600 readings, one every 10 ms
Timestamp,Elapsed (s),F (N) | ttF | time: column 1 .Timestamp.; force: column 3\x20
t (s),Preload (N),Load (N) | tLF | force: column 3 .Load. .N.; 600
Time 1 - default sample rate (s),Ft/Fn | tF | column 1 .*; force: column 2 .Ft/Fn.;
"""


@pytest.mark.parametrize(
    ("head", "columns", "read"), re.findall(r"^(.*) \| (\w+) \| (.*)$", CHOSEN, re.M)
)
def test_columns_are_chosen_by_names_units_and_numbers(tmp_path, head, columns, read):
    values = {"t": TIMES_OF_SAW, "F": SAW, "L": 20.0 + 0.1 * np.sin(SAW), "m": SAW / 20}
    values["v"] = 3.0 + 0.1 * np.cos(SAW)
    head = head.replace("; ", "\n")
    scale = 1000.0 if "ms," in head else 1.0
    others = (values[key] for key in columns[1:])
    file = written(tmp_path, table(head, scale * TIMES_OF_SAW, *others))
    data = read_trace(file)
    assert re.search(read, data.attrs["read"])
    wanted = values[columns[1]] if "F" not in columns else SAW
    assert data["spring_force"].values == pytest.approx(wanted)
    assert regime(data) == "stick-slip"


def test_which_of_two_columns_is_asked_once_beside_a_table_of_all(tmp_path, capsys):
    path = written(tmp_path, table("t (s),CH1 (g),CH2 (g)", TIMES_OF_SAW, SAW, 3 * SAW))
    assert cli.main(["measure", str(path)]) == 2
    asked, *shown = capsys.readouterr().err.splitlines()
    assert "which column is the force? Name it (--force 2 or --force 3" in asked
    assert [line.split()[0] for line in shown] == ["column", "1", "2", "3"]
    assert shown[1].endswith("rises evenly")
    assert cli.main(["measure", str(path), "--force", "CH2"]) == 0
    told = capsys.readouterr().out
    assert "mean ± standard deviation" in told
    assert 'read: time: column 1 "t" (s); force: column 3 "CH2" (g); 600' in told
    assert "g of the force is read as gf, a weight" in told


def test_tests_one_after_another_are_judged_each_by_itself(tmp_path):
    smooth = 6.0 + 0.01 * np.random.default_rng(0).normal(size=SAW.size)
    columns = np.tile(TIMES_OF_SAW, 2), np.append(SAW, smooth)
    data = read_trace(written(tmp_path, table("t (s),F (N)", *columns)))
    assert "the clock restarts at line 602: 2 tests" in data.attrs["note"]
    seen = regime(data)
    assert [each.kind for each in seen.segments] == ["stick-slip", "smooth sliding"]
    assert seen.is_in_turn
    assert str(seen).startswith("stick-slip until")
    # and the steps of a column of their numbers, where the clock goes on
    steps = np.repeat([1, 2], SAW.size)
    clock = 0.01 * np.arange(2 * SAW.size)
    head = "Step,t (s),F (N)"
    again = read_trace(written(tmp_path, table(head, steps, clock, columns[1])))
    assert again["part"].attrs["units"] == "1"
    kinds = [each.kind for each in regime(again).segments]
    assert kinds == ["stick-slip", "smooth sliding"]


@pytest.mark.parametrize(("offset", "half"), [(0.0, 3.0), (148.0, 7.5), (-40.0, 2.0)])
def test_a_friction_loop_has_a_half_width_and_an_offset(offset, half):
    t = np.arange(0.0, 64.0, 0.01)
    way = np.where(t // 4 % 2, -1.0, 1.0)
    noise = np.random.default_rng(0).normal(0.0, 0.02 * half, t.size)
    lag = 1.0 - 2.0 * np.exp(-(t % 4) / 0.1)
    seen = regime(pd.Series(offset + half * way * lag + noise, index=t))
    # the means of the middle halves of the strokes, each of 200 readings
    assert seen.half_width == pytest.approx(half, abs=0.005 * half)
    assert seen.offset == pytest.approx(offset, abs=0.005 * half)
    assert len(seen.segments) == 16
    assert str(seen).splitlines()[1].startswith("friction loop: ±")


def test_arrays_of_numpy_matlab_and_sound_are_tables_too(tmp_path):
    from scipy import io as matlab

    t = TIMES_OF_SAW
    np.save(tmp_path / "a.npy", np.column_stack([t, SAW]))
    matlab.savemat(tmp_path / "a.mat", {"t": t, "Ft": SAW, "rate": 100.0})
    matlab.savemat(tmp_path / "b.mat", {"run": {"time": t, "friction": SAW}})
    in_units = {"time_ms": 1e3 * t, "force_kN": 1e-3 * SAW}
    matlab.savemat(tmp_path / "c.mat", in_units)
    np.savez(tmp_path / "c.npz", force_kN=1e-3 * SAW, Fs=100.0)
    with zipfile.ZipFile(tmp_path / "c.zip", "w") as archive:
        archive.writestr("c.csv", table("t_ms,F_kN", *in_units.values()))
    with h5py.File(tmp_path / "c.h5", "w") as file:
        file["bench/time (ms)"] = 1e3 * t
        file["bench/force"] = 1e-3 * SAW
        file["bench/force"].attrs["units"] = "kN"
    records = np.rec.fromarrays([t, SAW], names="time,force")
    with h5py.File(tmp_path / "d.mat", "w", userblock_size=512) as file:
        file["table"] = records
        file["#refs#/force"] = t
    with (tmp_path / "d.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(512))
    files = "a.npy", "a.mat", "b.mat", "c.mat", "c.npz", "c.zip", "c.h5", "d.mat"
    for name in files:
        found = read_trace(tmp_path / name)
        force, times = found["spring_force"], found["time"]
        assert (force.attrs["units"] == "kN") == (name[0] == "c")
        size = {"N": 1.0, "kN": 1e3}[force.attrs["units"]]
        assert size * force.values == pytest.approx(SAW)
        assert times.values == pytest.approx({"s": t, "ms": 1e3 * t}[times.units])
    with zipfile.ZipFile(tmp_path / "c.zip", "a") as archive:
        archive.writestr("notes.txt", "bench 7")
    with pytest.raises(InputError, match=r"zip: c\.csv, notes\.txt; unpack it first"):
        read_trace(tmp_path / "c.zip")
    counts = np.round(1000.0 * SAW).astype(np.int16)
    matlab.wavfile.write(tmp_path / "a.wav", 100, counts)
    found = read_trace(tmp_path / "a.wav", force=":1 mN/counts")
    assert found["spring_force"].values == pytest.approx(counts)
    assert found["spring_force"].attrs["units"] == "mN"
    assert found.attrs["note"].startswith("the samples of a sound are taken for a f")
    assert found["time"].values == pytest.approx(t)
    found.to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    with pytest.raises(InputError, match=r"is a run: open it with load\(\)"):
        read_trace(tmp_path / "a.nc")


@pytest.mark.parametrize(
    ("options", "force", "unit"),
    [
        ({"force": "2:mN"}, SAW, "mN"),
        ({"force": "2:V:2.5 N/V"}, 2.5 * SAW, "N"),
        ({"force": "2:mV:2.5 N/V"}, 0.0025 * SAW, "N"),
        ({"force": ":3e0 mN"}, 3.0 * SAW, "mN"),
    ],
)
def test_a_unit_and_a_scale_may_be_given(tmp_path, options, force, unit):
    data = read_trace(written(tmp_path, table("t,F", TIMES_OF_SAW, SAW)), **options)
    assert data["spring_force"].values == pytest.approx(force)
    assert data["spring_force"].attrs["units"] == unit

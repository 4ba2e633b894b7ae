"""Reading force traces: every table that instruments write, and what is refused in one line."""

import datetime as dt
import json
import math
import subprocess
import sys
import time

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import InputError
from stickslip.measure import read_trace

FORCES = np.round(5.0 + np.abs(np.mod(np.arange(60) * 0.37, 3.0)), 2)


def written(tmp_path, text, name="trace.csv"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def rows(form, forces=FORCES):
    return "\n".join(form(0.25 * i, f) for i, f in enumerate(forces)) + "\n"


COMMA = str.maketrans(".", ",")


TIMES = 0.25 * np.arange(FORCES.size)
GERMAN = "Prüfung;Reibung 7\nDatum;01.02.2024\nNormalkraft;1920 N\n\nZeit;Kraft;Weg;Normalkraft\ns;N;mm;N\n" + "".join(
    f"{t:.2f};{f:.2f};{2 * t:.2f};20,00\n".replace(".", ",") for t, f in zip(TIMES, FORCES, strict=True)
)
LABVIEW = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
    "Multi_Headings\tNo\nX_Columns\t{columns}\nTime_Pref\tRelative\nOperator\tN. N.\nDate\t2024/02/01\n"
    "Time\t12:00:00\n***End_of_Header***\t\n\t\nChannels\t1\t\nSamples\t60\t\nDate\t2024/02/01\t\n"
    "Y_Unit_Label\tkN\t\nX_Dimension\tTime\t\nX0\t0.0000000000000000E+0\t\nDelta_X\t0.250000\t\n"
    "***End_of_Header***\t\t\nX_Value\tForce\tComment\n"
)


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (rows(lambda _, f: f"{f}"), {"step": 0.25}),
        (rows(lambda _, f: f"{f} N1 "), {"step": 0.25}),
        (rows(lambda _, f: f"{f}".translate(COMMA)), {"step": 0.25, "decimal": ","}),
        (rows(lambda _, f: f"{f:.2f} N".translate(COMMA)), {"step": 0.25, "decimal": ","}),
        ("force\n" + rows(lambda _, f: f"{f}"), {"step": 0.25}),
        ("Force (N)\n\n" + rows(lambda _, f: f"{f}"), {"step": 0.25}),
        ("t,F_d\n" + rows(lambda t, f: f"{t},{f}"), {}),
        ("time [s], Force [N]\n" + rows(lambda t, f: f"{t}, {f}"), {}),
        ("Zeit (s);Kraft (N)\n" + rows(lambda t, f: f"{t};{f}".translate(COMMA)), {}),
        ("t F\n" + rows(lambda t, f: f"  {t}   {f}  "), {}),
        ("t F\n" + rows(lambda t, f: f"{t} {f}".translate(COMMA)), {}),
        ("# t F_d\n" + rows(lambda t, f: f"{t:.6e} {f:.6e}"), {}),
        (rows(lambda t, f: f"{t},{f}"), {"time": 1, "force": 2}),
        (rows(lambda t, f: f"{t},{f}"), {"force": 2, "step": 0.25}),
        ("x,a,b\n" + rows(lambda t, f: f"{9 - f},{f},{t}"), {"force": "a", "time": "B"}),
        ('"t","spring_force","what"\n' + rows(lambda t, f: f'"{t}","{f}","pull, slow"'), {}),
        ("date,t,F_d\n" + rows(lambda t, f: f"2020-01-02,{t},{f}"), {}),
        ("Instrument: X7\nOperator: N. N.\n\nt;F_d\n" + rows(lambda t, f: f"{t};{f}"), {}),
        (rows(lambda t, f: f"{t}|{f}"), {"delimiter": "|", "time": 1, "force": 2}),
        ("t;F_d\n" + rows(lambda t, f: f"{t};{f}".translate(COMMA)), {"delimiter": ";"}),
        ("t;F_d\n" + rows(lambda t, f: f"{t:g};{f:.2e}".translate(COMMA)), {"delimiter": ";", "decimal": ","}),
        ('"Time (s)","Force (N)"\n' + rows(lambda t, f: f'"{t:.2f}|{f}"'.translate(COMMA).replace("|", '","')), {}),
        (rows(lambda _, f: f"{f}").replace("\n", "\r\n"), {"step": 0.25}),
        ("\ufeff" + rows(lambda _, f: f"{f}"), {"step": 0.25}),
        (rows(lambda _, f: f"{f}") + "End of file\n", {"step": 0.25}),
        ("t,F_d\n" + rows(lambda t, f: f"{t},{f}"), {"step": 0.25}),
        (GERMAN.encode("latin-1"), {}),
        (GERMAN.encode("utf-8-sig"), {}),
        (GERMAN.encode("utf-16-le"), {}),
        (GERMAN.replace("\n", "\r\n").encode("cp1252"), {}),
        ("Time,Force\ns,N\n" + rows(lambda t, f: f"{t},{f}"), {}),
        ("s,N\n" + rows(lambda t, f: f"{t},{f}"), {}),
        ("Time (s)  Force (N)\n" + rows(lambda t, f: f"{t}  {f}"), {}),
        ("# time (s), force (N)\n" + rows(lambda t, f: f"{t} {f}"), {}),
        ("ts,date,F,T\ns,,N,°C\n" + rows(lambda t, f: f"{t},2024-02-01,{f},21.5"), {}),
        ("Time;Force\ns;N\n\n" + rows(lambda t, f: f"{t};{f}\n"), {}),
        (rows(lambda t, f: f"{t} s\t{f} N"), {}),
        ("t,F\n" + rows(lambda t, f: f"{t},{f}").replace("\n1.0,", "\n# paused\n1.0,"), {}),
    ],
)
def test_tables_of_every_usual_form_are_read(tmp_path, text, options):
    data = read_trace(written(tmp_path, text), **options)
    np.testing.assert_array_equal(data["spring_force"], FORCES)
    np.testing.assert_allclose(data["time"], TIMES)
    assert (data["time"].attrs["units"], data["spring_force"].attrs["units"]) == ("s", "N")
    assert not data["filled"].any()


@pytest.mark.parametrize(
    ("text", "units"),
    [
        ("t (ms);F (mN)\n" + rows(lambda t, f: f"{t};{f}"), ("ms", "mN")),
        (("t (s);F (µN)\n" + rows(lambda t, f: f"{t};{f}")).encode("latin-1"), ("s", "µN")),
        ("Time,Channel A\n(s),(kN)\n\n" + rows(lambda t, f: f"{t},{f}"), ("s", "kN")),
        ("Time / s;Force / mN\n" + rows(lambda t, f: f"{t};{f}"), ("s", "mN")),
        ("time_s,force_kN\n" + rows(lambda t, f: f"{t},{f}"), ("s", "kN")),
        (LABVIEW.format(columns="One") + rows(lambda t, f: f"{t:.6f}\t{f:.6f}\t"), ("s", "kN")),
        (LABVIEW.format(columns="No") + rows(lambda _, f: f"\t{f:.6f}\t"), ("s", "kN")),
    ],
)
def test_units_are_kept(tmp_path, text, units):
    data = read_trace(written(tmp_path, text))
    np.testing.assert_array_equal(data["spring_force"], FORCES)
    assert (data["time"].attrs["units"], data["spring_force"].attrs["units"]) == units
    assert data.attrs["rows"] == FORCES.size


def test_the_comment_that_labview_names_but_does_not_write_is_no_column(tmp_path):
    """With two numbers to a row below three names, the times were taken for the force."""
    head = "LabVIEW Measurement\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\t\nChannels\t1\n"
    head += "Y_Unit_Label\tNewtons\nX0\t0.0\nDelta_X\t0.25\n***End_of_Header***\t\n"
    for names in ("X_Value\tUntitled\tComment\n", "X_Value\tForce\n", ""):
        trace = read_trace(written(tmp_path, head + names + rows(lambda t, f: f"{t:.6f}\t{f:.6f}"), "bench.lvm"))
        assert trace["spring_force"].to_numpy() == pytest.approx(FORCES)
        assert trace["time"].to_numpy() == pytest.approx(0.25 * np.arange(FORCES.size))
        assert trace["spring_force"].attrs["units"] == "Newtons"


@pytest.mark.parametrize(
    "word", ["NaN N1", "inf", "---", "1e999", "1" + 400 * "0", "overload", "True", "1.2.3", "1," * 9_000]
)
def test_a_few_unreadable_rows_are_filled_and_reported(tmp_path, word):
    lines = [f"{f}" for f in FORCES]
    lines[20] = word
    data = read_trace(written(tmp_path, "\n".join(lines)), step=0.25)
    assert data.sizes["time"] == FORCES.size
    assert float(data["spring_force"][20]) == pytest.approx(0.5 * (FORCES[19] + FORCES[21]))
    assert list(np.flatnonzero(data["filled"])) == [20]
    assert json.loads(data.attrs["unreadable"]) == [{"line": 21, "text": word}]
    assert "line 21" in data.attrs["note"]


def test_unreadable_rows_with_times_leave_a_gap_in_time(tmp_path):
    lines = [f"{0.25 * i},{f}" for i, f in enumerate(FORCES)]
    lines[10], lines[30] = "2.5,", "??"
    data = read_trace(written(tmp_path, "t,F_d\n" + "\n".join(lines)))
    assert data.sizes["time"] == FORCES.size - 1  # the time of row 30 is not known
    assert 7.5 not in data["time"].values
    assert bool(data["filled"].sel(time=2.5))
    assert "2 of 60 rows" in data.attrs["note"]


NUMBERS = rows(lambda _, f: f"{f}")
TWO = "t,F_d\n" + rows(lambda t, f: f"{t},{f}")


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        (NUMBERS, {}, "step="),
        (NUMBERS, {"step": 0.0}, "step = 0"),
        (NUMBERS, {"step": math.nan}, "step = nan"),
        (NUMBERS, {"step": 0.25, "force": 2}, "no such column"),
        (NUMBERS, {"step": 0.25, "delimiter": ";;"}, "delimiter"),
        (NUMBERS, {"step": 0.25, "decimal": "x"}, "decimal"),
        (TWO, {"force": "F_c"}, "did you mean 'F_d'"),
        (TWO, {"force": 0}, "counted from 1"),
        (TWO, {"force": 1, "time": 1}, "both force and time"),
        (TWO, {"step": 0.1, "time": "time"}, "leave one out"),
        (rows(lambda t, f: f"{t},{f}"), {"step": 0.1}, "which column is the force"),
        (rows(lambda t, f: f"{int(t)},{int(f)}"), {"step": 0.1}, "decimal comma"),
        (rows(lambda _, f: f"{f} N/m"), {"step": 0.1}, "column 1 holds numbers in 'N/m'"),
        ("", {"step": 1.0}, "empty"),
        (" \n\n", {"step": 1.0}, "blanks and comments only"),
        ("# nothing\n# here\n", {"step": 1.0}, "blanks and comments only"),
        ("to be\nor not\nto be\n", {"step": 1.0}, "no column of numbers"),
        ("1\n2\n3\n", {"step": 1.0}, "3 readings are too few"),
        (NUMBERS + "x\n1\ny\n2\nz\n3\nu\n4\n", {"step": 1.0}, "4 of 68 rows cannot be read, first line 61"),
        ("t,F_d\n" + rows(lambda t, f: f"{-t},{f}"), {}, "line 3: time -0.25 does not come after -0;"),
        ("t,F_d\n" + rows(lambda _, f: f"1,{f}"), {}, "times must rise"),
        (
            "t,F_d\n" + "".join(f"{ {3: 'x', 10: 1.0}.get(i, 0.25 * i) },{i % 7}\n" for i in range(60)),
            {},
            "line 12: time 1 does not come after 2.25;",
        ),
        ("1.0\n\x00\x01\x02\n" + NUMBERS, {"step": 1.0}, "binary"),
        (
            "a,F_d\n" + rows(lambda _, f: f"x,{f}"),
            {"force": "a", "step": 1.0},
            r"no such column of numbers.* 1 'a' \(no numbers",
        ),
        (
            "time force\n" + rows(lambda t, f: f"{t} {f} N m"),
            {},
            "column 2 holds numbers in 'N m'; write one known unit",
        ),
        ("time;force\n" + rows(lambda t, f: f"{t};1 {200 + f:.3f}"), {}, r"2 'force' \(no numbers such as 1234.5\)"),
        (
            "time,force\n" + rows(lambda t, _: f"{t:.2f},{5 + t % 2:.3f}".replace(".", ",")),
            {},
            "may hold 4 columns, or fewer with decimal commas",
        ),
    ],
)
def test_files_that_are_no_trace_are_refused_in_one_line(tmp_path, text, options, message):
    path = written(tmp_path, text)
    with pytest.raises(ss.InputError, match=message) as caught:
        read_trace(path, **options)
    assert "\n" not in str(caught.value)


def test_paths_that_are_no_file_are_refused(tmp_path, monkeypatch):
    with pytest.raises(ss.InputError, match="no such file"):
        read_trace(tmp_path / "none.csv", step=1.0)
    with pytest.raises(ss.InputError, match="is a directory, not a force trace"):
        read_trace(tmp_path, step=1.0)
    for start, message in ((b"\x89HDF\r\n", "HDF5"), (b"CDF\x01", "NetCDF"), (b"PK\x03\x04", "spreadsheet")):
        (tmp_path / "wrong").write_bytes(start + bytes(100))
        with pytest.raises(ss.InputError, match=message):
            read_trace(tmp_path / "wrong", step=1.0)
    monkeypatch.setattr("stickslip.measure.readings.LARGEST_FILE", 100)
    with pytest.raises(ss.InputError, match="MB"):
        read_trace(written(tmp_path, NUMBERS), step=1.0)


def test_several_columns_are_told_by_their_names(tmp_path):
    data = read_trace(written(tmp_path, GERMAN))
    np.testing.assert_allclose(data["measured_displacement"], 2 * TIMES)
    assert data["measured_displacement"].attrs["units"] == "mm"
    np.testing.assert_allclose(data["load"], 20.0)
    np.testing.assert_allclose(data["mu"], FORCES / 20.0)
    assert data["mu"].attrs == {"units": "1", "long_name": "coefficient of friction"}
    by_name = read_trace(tmp_path / "trace.csv", force="Kraft", time="zeit", load="Normalkraft", displacement=3)
    np.testing.assert_array_equal(by_name["spring_force"], data["spring_force"])
    other = read_trace(tmp_path / "trace.csv", force="Kraft (N)", load="0.04 kN")
    np.testing.assert_allclose(other["mu"], FORCES / 40.0)
    with pytest.raises(ss.InputError, match="load = '-3 N'"):
        read_trace(tmp_path / "trace.csv", load="-3 N")


@pytest.mark.parametrize(
    "head",
    ["t,COF", "time,Friction coefficient", "t,µ", "Zeit,Reibwert", "Time(s),Friction (-)"],
)
def test_a_coefficient_of_friction_is_no_force(tmp_path, head):
    data = read_trace(written(tmp_path, head + "\n" + rows(lambda t, f: f"{t},{f / 10:.4f}")))
    assert data["spring_force"].attrs == {"units": "1", "long_name": "coefficient of friction"}
    assert "N assumed" not in data.attrs["note"]


def test_a_bare_friction_column_beside_units_is_a_coefficient(tmp_path):
    head = "Time(s)\tDispl(microns)\tFriction\tNormal_stress(MPa)\n"
    data = read_trace(written(tmp_path, head + rows(lambda t, f: f"{t}\t{3 * t}\t{f / 10:.4f}\t19.97")))
    assert data["spring_force"].attrs["long_name"] == "coefficient of friction"
    assert data["measured_displacement"].attrs["units"] == "microns"
    assert data["load"].attrs["units"] == "MPa"
    assert "mu" not in data


def test_units_that_are_not_named_are_told_as_assumed(tmp_path):
    data = read_trace(written(tmp_path, "t,F\n" + rows(lambda t, f: f"{t},{f}")))
    assert "no unit of the force: N assumed" in data.attrs["note"]
    assert "no unit of the time: s assumed" in data.attrs["note"]
    named = read_trace(written(tmp_path, "t (s),F (N)\n" + rows(lambda t, f: f"{t},{f}")))
    assert named.attrs["note"] == ""


def test_numbers_below_more_text_than_is_looked_at_are_told_of(tmp_path):
    with pytest.raises(ss.InputError, match="no column of numbers that begins by line 1000"):
        read_trace(written(tmp_path, 1000 * "pulled, slowly\n" + 4000 * "0.25,1.5\n"))


@pytest.mark.parametrize(("unit", "cell"), [(" N", "99.0 broken"), (" N", "7.0 mm"), (" N", "700 mN"), ("", "7 mN")])
def test_a_cell_in_another_unit_is_no_force(tmp_path, unit, cell):
    lines = [f"{0.25 * i};{f}{unit}" for i, f in enumerate(FORCES)]
    lines[7] = f"1.75;{cell}"
    data = read_trace(written(tmp_path, "t;F\n" + "\n".join(lines)))
    assert (
        f"1 of 60 rows could not be read; the force there is interpolated in time (line 9: '1.75;{cell}')" in data.note
    )
    np.testing.assert_array_equal(np.delete(data["spring_force"], 7), np.delete(FORCES, 7))
    assert FORCES.min() < float(data["spring_force"][7]) < FORCES.max()
    lines[20:30] = [lines[7].replace("1.75", f"{0.25 * i}") for i in range(20, 30)]
    with pytest.raises(
        ss.InputError, match=f"11 of 60 rows cannot be read, first line 9: '1.75;{cell}'.* in the unit of"
    ):
        read_trace(written(tmp_path, "t;F\n" + "\n".join(lines)))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "t,position\n" + rows(lambda t, f: f"{t},{f}"),
            r"which column is the force\? .*--force .* force= .* 1 't', 2 'position'",
        ),
        ("t (s),z (mm)\n" + rows(lambda t, f: f"{t},{f}"), r"which column is the force.*2 'z \(mm\)'"),
        ("t,T (°C)\n" + rows(lambda t, f: f"{t},{f}"), "which column is the force"),
        ("t,F,F\n" + rows(lambda t, f: f"{t},{f},{f}"), "which column is the force"),
        ("a,F\n" + rows(lambda t, f: f"{t},{f}"), "which column is the time.*--time .* time=.*--step .* step="),
        (
            "Time,Force (N)\n" + rows(lambda t, f: f"10:00:{t:06.3f},{f}"),
            r"which column is the time.*--step.* 1 'Time' \(no numbers",
        ),
        ("t,F\n" + rows(lambda t, f: f'{t},"{f}'), "line"),
        ("t (s);F (s)\n" + rows(lambda t, f: f"{t};{f} N"), "column 2 holds numbers in 'N' below the heading 's'"),
        (rows(lambda t, f: f"{t}" + f",{f}" * 1500), "1501 columns, more than 1000"),
        ("F\n" + NUMBERS + "1" * 60_000 + "x\n" + "2" * 60_000 + "x\n3x3\n4x4\n", "4 of 64 rows cannot be read"),
    ],
)
def test_what_could_be_misread_is_refused(tmp_path, text, message):
    path = written(tmp_path, text)
    begin = time.process_time()
    with pytest.raises(ss.InputError, match=message) as caught:
        read_trace(path, **({"step": 1.0} if text.startswith("F\n") else {}))
    assert time.process_time() - begin < 1.0
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


def test_a_spreadsheet_is_read(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["see the second sheet"])
    sheet = book.create_sheet("data")
    head = [["Bench", "7"], ["Date", dt.date(2024, 2, 1)], [], ["Time", "Force", "Remark"], ["ms", "kN", None]]
    for row in head:
        sheet.append(row)
    for t, f in zip(TIMES, FORCES, strict=True):
        sheet.append([1e3 * float(t), float(f), None])
    book.save(tmp_path / "bench.xlsx")
    data = read_trace(tmp_path / "bench.xlsx")
    np.testing.assert_array_equal(data["spring_force"], FORCES)
    np.testing.assert_allclose(data["time"], 1e3 * TIMES)
    assert (data["time"].attrs["units"], data["spring_force"].attrs["units"]) == ("ms", "kN")


def test_a_tdms_file_is_read(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    waveform = {"wf_increment": 0.25, "wf_start_offset": 0.0}
    with nptdms.TdmsWriter(tmp_path / "bench.tdms") as writer:
        writer.write_segment([
            nptdms.ChannelObject("Run 1", "Friction force", FORCES, properties=waveform | {"unit_string": "mN"}),
            nptdms.ChannelObject("Run 1", "Temperature", FORCES, properties=waveform | {"unit_string": "°C"}),
            nptdms.ChannelObject("Run 1", "Remarks", ["pulled"] * FORCES.size),
            nptdms.ChannelObject("Run 1", "Spare", np.array([])),
        ])  # fmt: skip
    data = read_trace(tmp_path / "bench.tdms")
    np.testing.assert_array_equal(data["spring_force"], FORCES)
    np.testing.assert_allclose(data["time"], TIMES)
    assert data["spring_force"].attrs["units"] == "mN"


@pytest.mark.parametrize(
    ("name", "start", "module"), [("a.xlsx", b"PK\x03\x04", "openpyxl"), ("a.tdms", b"TDSm", "nptdms")]
)
def test_a_reader_that_is_missing_is_named(tmp_path, monkeypatch, name, start, module):
    (tmp_path / name).write_bytes(start + bytes(100))
    if name.endswith("tdms"):
        pytest.importorskip(module)
    with pytest.raises(ss.InputError, match=r"a\.(xlsx|tdms): is no (spreadsheet|TDMS file) that can be read|install"):
        read_trace(tmp_path / name)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ss.InputError, match=rf"(?i)pip install {module}") as caught:
        read_trace(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_a_force_may_be_flipped(tmp_path):
    path = written(tmp_path, "t,F\n" + rows(lambda t, f: f"{t},{f}"))
    data = read_trace(path, flip=True)
    np.testing.assert_array_equal(data["spring_force"], -FORCES)
    assert data.attrs["flipped"] == 1


MEASURED = """
import sys, time
from pathlib import Path
from stickslip.cli import main
code = main(sys.argv[1:])
status = Path("/proc/self/status").read_text().split()
print("CPU", time.process_time(), "peak", status[status.index("VmHWM:") + 1], "code", code)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="peak memory is read from /proc")
@pytest.mark.parametrize("columns", [1, 2])
def test_five_million_rows_take_seconds_and_little_memory(tmp_path, columns):
    rng, path = np.random.default_rng(1), tmp_path / "long.csv"
    with path.open("w") as file:
        for part in range(50):
            t = 1e-4 * (np.arange(100_000) + part * 100_000)
            force = 5 + 2 * (t % 1.5) + rng.normal(0, 0.05, t.size)
            rows = zip(t, force, strict=True)
            file.writelines(f"{f:.3f}\n" if columns == 1 else f"{a:.4f};{f:.3f}\n" for a, f in rows)
    options = ["--step", "1e-4"] if columns == 1 else ["--time", "1", "--force", "2"]
    call = [sys.executable, "-c", MEASURED, "measure", str(path), *options]
    lines = subprocess.run(call, check=True, capture_output=True, text=True).stdout.splitlines()
    assert lines[0].startswith("stick-slip")
    _, cpu, _, peak, _, code = lines[-1].split()
    assert code == "0"
    assert float(cpu) <= 4.0
    assert int(peak) <= 600_000  # kB


def test_a_load_without_a_unit_is_a_column(tmp_path):
    """And one column needs no mark between columns."""
    place = tmp_path / "one.csv"
    place.write_text("Load cell (N)\n" + "\n".join(f"{5 + 0.1 * math.sin(k / 5):.4f}" for k in range(300)) + "\n")
    assert read_trace(place, step=0.01).spring_force.attrs["units"] == "N"
    for load, words in (("7", "no such column"), ("-7 N", "must be a force above 0"), ("7 s", "must be a force")):
        with pytest.raises(InputError, match=words):
            read_trace(place, step=0.01, load=load)


WAVE = 2.0 + np.arange(4000) * 0.01 % 1.0


def two(forces, *, at=None, more=""):
    text = "".join(f"{0.01 * i:.2f},{f:.4f}{more if i == at else ''}\n" for i, f in enumerate(forces))
    return "time (s),force (N)\n" + text


@pytest.mark.parametrize("value", [-9999.0, 40.0])
def test_a_value_that_stands_for_none_is_no_force(tmp_path, value):
    at = np.arange(7, 4000, 150)
    forces = WAVE.copy()
    forces[at] = value
    data = read_trace(written(tmp_path, two(forces)))
    assert np.flatnonzero(data["filled"]).tolist() == at.tolist()
    assert "could not be read" in data.attrs["note"]
    forces[::50] = value
    with pytest.raises(InputError, match=r"first line \d+: .* not far outside the rest"):
        read_trace(written(tmp_path, two(forces)))


def test_a_row_of_a_number_too_many_and_the_end_of_a_file_of_dos(tmp_path):
    data = read_trace(written(tmp_path, two(WAVE, at=50, more=",5") + "\x1a"))
    assert data.sizes["time"] == 3999
    assert "line 52" in data.attrs["note"]


def test_a_number_with_the_other_decimal_sign_is_none_and_a_comment_no_row(tmp_path):
    """Where commas are decimal 1.234 may be 1234; the force column of a comment is no force."""
    lines = rows(lambda t, f: f"{t};{f}".translate(COMMA)).splitlines()
    lines[9] = "2,25;5.330"
    data = read_trace(written(tmp_path, "\n".join(["t;F", *lines[:20], "# paused;7,00", *lines[20:]])))
    assert np.flatnonzero(data["filled"]).tolist() == [9]
    assert data.attrs["rows"] == FORCES.size


def test_exponents_of_fortran_and_cells_in_no_unit(tmp_path):
    column = "".join(f"{f:.6f}D+01\n" for f in WAVE)
    np.testing.assert_allclose(read_trace(written(tmp_path, column), step=0.01)["spring_force"], 10.0 * WAVE)
    for end in ("foo", "E+", " N/m"):
        with pytest.raises(InputError, match=r"found no column of numbers|holds numbers in 'N/m'"):
            read_trace(written(tmp_path, column.replace("D+01", end)), step=0.01)

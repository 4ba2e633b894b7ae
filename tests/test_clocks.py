"""Dates, times of day and file names are not read as decimal numbers."""

import datetime as dt

import numpy as np
import pytest

from stickslip.errors import InputError
from stickslip.measure import read_trace

_BEGIN = dt.datetime(2026, 4, 25, 11, 59, 50)
_FORCES = 5.0 + np.arange(40) % 7 / 16
_FORMS = {
    "%d.%m.%Y %H:%M:%S": "",
    "%d.%m.%y %H:%M:%S.%f": "",
    "%Y-%m-%dT%H:%M:%S": "+02:00",
    "%Y/%m/%d %H:%M:%S": "Z",
    "%Y-%m-%d %H:%M:%S,%f": " -0530",
    "%m/%d/%Y %I:%M:%S %p": "",
    "%d/%m/%Y %H:%M:%S": "",
    "%d-%b-%Y %H:%M:%S": "",
    "%b %d, %Y %I:%M:%S.%f %p": "",
    "%H:%M:%S:000": "",
    "%I:%M:%S %p": "",
    "%M:%S.%f": "",
    "run0.dat;%H:%M:%S": "",
}


def _table(tmp_path, stamps, mark, comma):
    shown = [f"{force:.4f}" for force in _FORCES]
    if comma:
        shown = [each.replace(".", ",") for each in shown]
    lines = [f"{a}{mark}{b}" for a, b in zip(stamps, shown, strict=True)]
    path = tmp_path / "bench.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("comma", [False, True])
@pytest.mark.parametrize("form", _FORMS)
def test_a_clock_of_any_form_gives_seconds_beside_decimals_of_any_sign(
    tmp_path, form, comma
):
    stamps = [
        (_BEGIN + dt.timedelta(seconds=i)).strftime(form) + _FORMS[form]
        for i in range(_FORCES.size)
    ]
    trace = read_trace(_table(tmp_path, stamps, ";", comma))
    assert np.allclose(trace["spring_force"], _FORCES)
    assert np.allclose(trace["time"], np.arange(_FORCES.size), atol=1e-4)


@pytest.mark.parametrize("before", ["run0.dat", "a.b;c.d", "25.04.2026"])
def test_a_point_in_a_text_does_not_hide_a_decimal_comma(tmp_path, before):
    stamps = [before] * _FORCES.size
    trace = read_trace(_table(tmp_path, stamps, ";", True), step="1 s")
    assert np.allclose(trace["spring_force"], _FORCES)
    with pytest.raises(InputError, match="decimal commas; write decimal points"):
        read_trace(_table(tmp_path, stamps, ",", True), step="1 s")


def test_the_offset_decides_the_order_across_a_change_of_the_clock(tmp_path):
    utc = [
        dt.datetime(2026, 10, 25, 0, 59, 40, tzinfo=dt.UTC) + dt.timedelta(seconds=i)
        for i in range(_FORCES.size)
    ]
    local = [t + dt.timedelta(hours=2 if t.hour < 1 else 1) for t in utc]
    shown = [f"{t:%Y-%m-%d %H:%M:%S}" for t in local]
    offsets = [f"+0{2 if t.hour < 1 else 1}:00" for t in utc]
    told = [a + b for a, b in zip(shown, offsets, strict=True)]
    trace = read_trace(_table(tmp_path, told, ";", False))
    assert np.allclose(np.diff(trace["time"]), 1.0)
    with pytest.raises(InputError, match="with their offset from UTC") as refused:
        read_trace(_table(tmp_path, shown, ";", False))
    assert "sort" not in str(refused.value)


@pytest.mark.parametrize("day", [46000.123, 740316.1])
def test_days_of_a_spreadsheet_are_seconds(tmp_path, day):
    stamps = [f"{day + i / 86_400:.10f}" for i in range(_FORCES.size)]
    trace = read_trace(_table(tmp_path, stamps, ";", False))
    assert np.allclose(trace["time"], np.arange(_FORCES.size), atol=1e-4)
    assert "taken for days" in trace.attrs["note"]


@pytest.mark.parametrize("unit", ["$x^$", "$\\frac$", "a$b$c", "$", "$k$", "$N_1"])
def test_a_unit_of_a_file_is_drawn_as_text_and_never_as_a_formula(unit):
    from matplotlib.cbook import is_math_text

    from stickslip import plot

    drawn = plot.unit_text(unit)
    assert not is_math_text(drawn)
    assert drawn.replace(r"\$", "$") == unit

"""The package never changes state that a process has once, not even for a moment:
threads of the user would see it, and state restored in another order stays changed.
"""

import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr

import stickslip as ss
from stickslip.errors import InputError

TIMES = np.linspace(0.0, 1.0, 50)


def state():
    system = sys.unraisablehook, sys.excepthook, sys.stdout, sys.stderr
    warned = id(warnings.filters), [*warnings.filters], warnings.showwarning
    return (*system, *warned, dict(mpl.rcParams))


def run(folder):
    data = xr.Dataset(
        {"spring_force": ("time", np.sin(TIMES), {"units": "N"})},
        coords={"time": ("time", TIMES, {"units": "s"})},
    )
    return ss.save(data, folder / "run.nc")


def loaded(folder):
    place = run(folder)
    return lambda: ss.load(place)


def cut_short(folder):
    place = run(folder)
    place.write_bytes(place.read_bytes()[:2000])
    return lambda: ss.load(place)


def of_old_kind(folder):
    place = folder / "old.nc"
    xr.Dataset({"force": ("time", TIMES)}).to_netcdf(place, engine="scipy")
    return lambda: ss.load(place)


def with_texts(folder):
    place = folder / "table.csv"
    rows = [f"{time},{np.sin(time)}" for time in np.linspace(0.0, 9.0, 3000)]
    rows[2000] = "6.0,overload"
    place.write_text("\n".join(["time [s],force [N]", *rows]))
    return lambda: ss.read_trace(place)


CALLS = [loaded, cut_short, of_old_kind, with_texts]


@pytest.mark.parametrize("made", CALLS)
def test_what_a_process_has_once_is_the_same_within_and_after(made, tmp_path):
    call = made(tmp_path)
    seen = []

    def watched(_i):
        with suppress(InputError):
            call()

    watched(0)  # libraries imported now may set their own state, once
    before = state()

    def traced(frame, event, _arg):
        # at every call below: what another thread might see
        if event == "call" and frame.f_globals.get("__name__", "").startswith(
            ("stickslip", "xarray.backends", "pandas.io.parsers")
        ):
            seen.append((sys.unraisablehook, id(warnings.filters)))

    sys.setprofile(traced)
    try:
        watched(0)
    finally:
        sys.setprofile(None)
    assert len(seen) > 5
    assert set(seen) == {(before[0], before[4])}
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(watched, range(24)))
    assert state() == before


@pytest.mark.parametrize("kind", ["NETCDF3_CLASSIC", "NETCDF3_64BIT"])
def test_a_netcdf_file_of_the_old_kinds_is_read(kind, tmp_path):
    attributes = {"units": "N", "long_name": "force of the spring"}
    data = xr.Dataset(
        {"force": ("time", np.cos(TIMES), attributes)},
        coords={"time": ("time", TIMES, {"units": "s"})},
        attrs={"made_by": "a bench"},
    )
    data.to_netcdf(tmp_path / "old.nc", engine="scipy", format=kind)
    read = ss.load(tmp_path / "old.nc")
    assert read.identical(data)
    whole = (tmp_path / "old.nc").read_bytes()
    for size in (4, 8, 40, len(whole) // 2):
        (tmp_path / "old.nc").write_bytes(whole[:size])
        with pytest.raises(InputError, match="cannot be read as NetCDF"):
            ss.load(tmp_path / "old.nc")


def test_a_netcdf_file_that_is_not_read_is_named_with_the_remedy(tmp_path):
    (tmp_path / "new.nc").write_bytes(b"CDF\x05" + bytes(100))
    with pytest.raises(InputError, match=r"CDF-5.*nccopy -k nc4"):
        ss.load(tmp_path / "new.nc")

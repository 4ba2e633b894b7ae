"""Files and provenance: whole or not at all, and every record comes back as it was."""

import json
import math
import os
import signal
import stat
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from stickslip import model
from stickslip.errors import InputError
from stickslip.io import datasets as store
from stickslip.io.datasets import records
from stickslip.model import distributions as thresholds
from stickslip.model import drive, units
from stickslip.paper import cases

LAWS_INSIDE = thresholds.SteadyState(thresholds=thresholds.Gamma(mean=1.0, std=0.5))
CASES = [
    thresholds.Gaussian(mean=1.0, std=0.1),
    thresholds.Gaussian(mean=1.0, std=0.1, lower=0.0),
    thresholds.Uniform(low=0.1, high=1 / 3),
    thresholds.Exponential(mean=0.8),
    LAWS_INSIDE,
    thresholds.LogNormal(mean=1.0, std=0.5),
    thresholds.Weibull(scale=1.1, shape=2.5),
    thresholds.Empirical(edges=(0.1, 0.3, 0.7, 2.0), weights=(1, 1, 5)),
    model.Delay(math.inf),
    model.RandomDelay(mean=0.2, std=0.12, negative="redraw"),
    model.Langevin(rate=1.5),
    model.ExponentialGrowth(rate=2.0, newborn=0.1),
    model.LogarithmicGrowth(slope=0.05, time=1e-3),
    model.OnArrest(),
    model.Bell(width=0.01, attempts=1e6),
    model.Parabolic(temperature=0.01, attempts=1e6),
    model.Barrier(height=100.0, attempts=1e6, power=2.0, kramers=True),
    model.Interface(
        thresholds=LAWS_INSIDE.thresholds,
        delay=model.OnArrest(),
        temperature=model.Bell(width=0.01, attempts=1e6),
        sliding_force=0.3,
        newborn=thresholds.Uniform(low=0.0, high=0.2),
        track_scatter=0.1,
    ),
    model.Interface(thresholds=LAWS_INSIDE.thresholds, initial=LAWS_INSIDE, ageing=model.Langevin(rate=1)),
    model.Slider(stiffness=2.0, mass=1e-4, damping=200.0),
    model.Operation(speeds=(0.5, 1.0), between=(0.1, 2.0), feasible=(("mass", 1e-5, 1e-3),)),
    model.Rig(
        cases.FIG5.interface, cases.FIG5.slider, drive.constant(1.0), scales=units.Scales(force=1.0, stretching=2.0)
    ),
    cases.FIG5.interface,
    drive.constant(0.1, 2).then(drive.ramp(1, -2, 3)).until(drive.Travel(0.1)),
    drive.constant(0.1, 2).until(drive.ForceAbove(0.1)).then(drive.constant(0.1, 2).until(drive.ForceBelow(-0.1))),
    units.Scales(force=768.0, stretching=1e-6, time=0.01),
]
KINDS = records()
CASES += [
    KINDS["Positive"](whole=thresholds.Gaussian(mean=1.0, std=1.0)),
    KINDS["Contacts"](123, seed=2**100 + 1),
    KINDS["MasterEquation"](rtol=1e-3, memoryless=True),
    KINDS["PaperClosure"](cells=200),
    KINDS["Population"](10**9, seed=5, rtol=1e-3),
    KINDS["Output"](interval=0.1, snapshots=(0.3, 1 / 7), bins=7),
    KINDS["Output"](),
    KINDS["FromRest"](),
    KINDS["FromSliding"](perturbation=-1e-3),
    KINDS["FromSliding"](perturbation=(0.1, -0.1)),
    KINDS["QuasiStatic"](50, seed=3),
    KINDS["Prestressed"](stretching=0.6),
    KINDS["Prestressed"](stretching=(0.6, 0.3), push=3.0, pushed_blocks=2),
    KINDS["Chain"](blocks=9, coupling=4.0, mass=1.0, damping=0.1, side=4.0, ends="periodic"),
    KINDS["Sheet"](along=4, across=3, coupling=4.0, shear=1.5, mass=1.0, damping=0.1, leaf=0.2),
]


def named(value, found):
    """Names of all records within a record."""
    if isinstance(value, dict):
        found |= {value["class"]} if "class" in value else set()
        for item in value.values():
            named(item, found)
    elif isinstance(value, list):
        for item in value:
            named(item, found)
    return found


def test_the_cases_below_name_every_record():
    assert named(store.encode(CASES), set()) == set(KINDS)


@pytest.mark.parametrize("record", CASES, ids=lambda record: type(record).__name__)
def test_every_record_comes_back_from_json(record):
    text = json.dumps(store.encode(record), allow_nan=False)
    again = store.decode(json.loads(text), KINDS)
    assert again == record
    assert type(again) is type(record)
    assert store.content_hash(again) == store.content_hash(record)


FLOATS = st.floats(-1e6, 1e6)


@given(st.lists(st.tuples(FLOATS, FLOATS, st.floats(1e-6, 1e6)), min_size=1, max_size=4))
def test_numbers_come_back_to_the_last_bit(parts):
    whole = drive.Drive(tuple(drive.Piece(start=a, end=b, duration=d) for a, b, d in parts))
    assert store.decode(json.loads(json.dumps(store.encode(whole))), KINDS) == whole


def test_plain_values_and_containers():
    value = {"a": (1, 2.5, None, True, "word"), "b": {"c": [math.inf, -math.inf]}}
    assert store.encode(value) == {"a": [1, 2.5, None, True, "word"], "b": {"c": ["inf", "-inf"]}}
    decoded = store.decode(store.encode(value), KINDS)
    assert decoded == {"a": (1, 2.5, None, True, "word"), "b": {"c": (math.inf, -math.inf)}}


def test_an_argument_may_be_called_record():
    arguments = {"record": KINDS["Output"](bins=3), "kind": 1}
    assert store.decode(store.encode(arguments), KINDS) == arguments


@pytest.mark.parametrize("value", [object(), {1, 2}, 2j, np.zeros(2), print, model.Delay])
def test_what_is_no_data_is_refused(value):
    with pytest.raises(InputError, match="cannot be written to a file; use a record"):
        store.encode(value)


# ------------------------------------------------------------------------------------------------ content hash


def test_equal_records_have_equal_hashes():
    assert store.content_hash(model.Delay(1)) == store.content_hash(model.Delay(1.0))
    assert store.content_hash(drive.constant(-0.0, 1)) == store.content_hash(drive.constant(0.0, 1))
    hashes = [store.content_hash(case) for case in CASES]
    assert len(set(hashes)) == len(CASES)
    assert all(len(digest) == 64 for digest in hashes)


def test_every_field_counts():
    base = model.Slider(stiffness=2.0, mass=1e-4, damping=200.0)
    others = [
        model.Slider(stiffness=math.nextafter(2.0, 3), mass=1e-4, damping=200.0),
        model.Slider(stiffness=2.0, mass=1.0001e-4, damping=200.0),
        model.Slider(stiffness=2.0, mass=1e-4, damping=0.0),
    ]
    assert len({store.content_hash(case) for case in [base, *others]}) == 4


def test_the_hash_is_the_same_in_every_process():
    code = (
        "from stickslip.io import datasets as store; from stickslip.paper import cases; "
        "print(store.content_hash(cases.FIG8.interface))"
    )
    answers = {
        subprocess.run(
            [sys.executable, "-c", code],
            env=os.environ | {"PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        for seed in ("1", "2")
    }
    assert answers == {store.content_hash(cases.FIG8.interface)}


# ------------------------------------------------------------------------------------------------ files


@pytest.fixture
def result() -> xr.Dataset:
    return xr.Dataset(
        {
            "spring_force": ("time", np.random.default_rng(0).normal(size=500), {"units": "f_s", "long_name": "force"}),
            "stretching_density": (("snapshot", "x"), np.arange(6.0).reshape(2, 3)),
            "count": ((), 3),
            "name": ((), "a word"),
            "kinds": ("snapshot", np.array(["one", "two"], dtype=object)),
        },
        {"time": ("time", 0.1 * np.arange(500)), "x": ("x", [0.1, 0.2, 0.3])},
        {"provenance": store.provenance("simulate", {"slider": CASES[14]})},
    )


def test_a_dataset_comes_back_bit_for_bit(result, tmp_path):
    path = store.save(result, tmp_path / "run.nc")
    assert path == tmp_path / "run.nc"
    again = store.load(path)
    xr.testing.assert_identical(again, result)
    assert again["spring_force"].dtype == np.float64
    assert again["count"].dtype.kind == "i"
    assert store.is_netcdf(path)
    assert os.listdir(tmp_path) == ["run.nc"]


def test_a_path_may_be_a_string_and_the_file_may_be_gone_after_loading(result, tmp_path):
    path = store.save(result, str(tmp_path / "run.nc"))
    again = store.load(str(path))
    path.unlink()
    xr.testing.assert_identical(again, result)


def test_saving_replaces_a_file(result, tmp_path):
    path = store.save(result, tmp_path / "run.nc")
    before = path.read_bytes()
    with path.open("rb") as reader:
        store.save(result.isel(time=slice(0, 10)), path)
        # Moved into place, not written over: who has the old file open reads on in it.
        assert reader.read() == before
    assert store.load(path).sizes["time"] == 10


def test_permissions_follow_the_umask(result, tmp_path):
    before = os.umask(0o027)
    try:
        path = store.save(result, tmp_path / "run.nc")
        assert os.umask(0o027) == 0o027  # saving does not touch it: other threads write files, too
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


class Interrupted(BaseException):
    """Stands for Ctrl-C."""


@pytest.mark.parametrize("failure", [OSError(28, "No space left on device"), Interrupted(), ValueError("odd")])
def test_a_failed_write_leaves_the_old_file_and_nothing_else(result, tmp_path, monkeypatch, failure):
    path = store.save(result, tmp_path / "run.nc")
    before = path.read_bytes()

    def fail(_):
        raise failure

    monkeypatch.setattr(os, "fsync", fail)
    expected = InputError if isinstance(failure, OSError) else type(failure)
    with pytest.raises(expected) as caught:
        store.save(result, path)
    if isinstance(failure, OSError):
        assert str(caught.value).startswith(f"{path}: cannot be written (No space left on device); nothing was lost")
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["run.nc"]


def test_a_killed_write_leaves_nothing_under_the_final_name(tmp_path):
    code = f"""
import os, signal
import xarray as xr
from stickslip.io import datasets as store

os.fsync = lambda _: os.kill(os.getpid(), signal.SIGKILL)
store.save(xr.Dataset(), {str(tmp_path / "run.nc")!r})
"""
    done = subprocess.run([sys.executable, "-c", code], check=False)
    assert done.returncode == -signal.SIGKILL
    assert not (tmp_path / "run.nc").exists()
    assert [name.startswith(".stickslip-") for name in os.listdir(tmp_path)] == [True]
    store.save(xr.Dataset(), tmp_path / "run.nc")
    assert os.listdir(tmp_path) == ["run.nc"]


def hdf5(place: Path) -> None:
    import h5py

    with h5py.File(place, "w") as file:
        file["numbers"] = np.arange(3)


def cut_short(place: Path) -> None:
    whole = place.with_name("whole.nc")
    store.save(xr.Dataset({"a": ("time", np.random.default_rng(0).normal(size=5000))}), whole)
    place.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda _: None, "no such file"),
        (lambda place: place.mkdir(), "is a directory, not a run"),
        (lambda place: place.write_bytes(b""), "is not a NetCDF file; a run is made with `stickslip simulate"),
        (lambda place: place.write_bytes(b"\x89HD"), "is not a NetCDF file"),
        (lambda place: place.write_bytes(os.urandom(4096)), "is not a NetCDF file"),
        (lambda place: place.write_text("t,F\n0,1\n"), "is not a NetCDF file"),
        (lambda place: place.write_bytes(b"CDF\x01" + bytes(100)), "is not a NetCDF file"),
        (
            lambda place: place.write_bytes(b"\x89HDF\r\n\x1a\n" + os.urandom(4096)),
            "cannot be read as NetCDF .*damaged",
        ),
        (lambda place: place.write_bytes(b"\x89HDF\r\n\x1a\n"), "cannot be read as NetCDF .*damaged"),
        (cut_short, "cannot be read as NetCDF .*damaged"),
    ],
    ids=["missing", "directory", "empty", "short", "noise", "text", "classic", "noise-hdf5", "signature", "cut"],
)
def test_files_that_cannot_be_read(make, message, tmp_path, capfd):
    place = tmp_path / "run.nc"
    make(place)
    with pytest.raises(InputError, match=message) as caught:
        store.load(place)
    assert str(caught.value).startswith(f"{place}: ")
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_a_name_that_no_file_can_have(result):
    for act in (lambda: store.load("a\0b.nc"), lambda: store.save(result, "a\0b.nc")):
        with pytest.raises(InputError, match=r"cannot be (read|written) \(.*null"):
            act()


def test_hdf5_of_others_is_read_but_has_no_provenance(tmp_path):
    hdf5(tmp_path / "other.h5")
    with pytest.raises(InputError, match=r"no provenance: .*analyse it with `measure`"):
        store.read_provenance(xr.Dataset(attrs={"provenance": 3}))
    with pytest.raises(InputError, match=r"(no provenance|cannot be read as NetCDF)"):
        store.read_provenance(store.load(tmp_path / "other.h5"))


@pytest.mark.parametrize("name", ["nowhere/run.nc", "file/run.nc", ".", "x" * 300 + ".nc"])
def test_places_that_cannot_be_written(name, result, tmp_path):
    (tmp_path / "file").write_text("a file, not a directory")
    with pytest.raises(
        InputError, match=r"(cannot be written .*another place|is a directory; give|no directory .*make)"
    ):
        store.save(result, tmp_path / name)
    assert os.listdir(tmp_path) == ["file"]


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_directory_without_permission(result, tmp_path):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(InputError, match=r"cannot be written \(.* is read-only\)"):
            store.save(result, tmp_path / "run.nc")
    finally:
        tmp_path.chmod(0o700)


# ------------------------------------------------------------------------------------------------ provenance


def test_provenance_names_call_arguments_and_version(result):
    content = store.read_provenance(result)
    assert content["call"] == "simulate"
    assert content["stickslip"]
    assert store.decode(content["arguments"], KINDS) == {"slider": CASES[14]}


@pytest.mark.parametrize(
    "text",
    ["", "not JSON", "[1, 2]", "3", "null", "{}", '{"call": "simulate"}', '{"call": 3, "arguments": {}}',
     '{"call": "simulate", "arguments": 3}', '"call arguments"'],
)  # fmt: skip
def test_damaged_provenance(text):
    with pytest.raises(InputError, match="provenance in this file is damaged; make the run again"):
        store.read_provenance(xr.Dataset(attrs={"provenance": text}))


@pytest.mark.parametrize(
    ("plain", "message"),
    [
        ({"class": "Sliderr", "mass": 1}, "names the record 'Sliderr', which this version does not have"),
        ({"class": ["Slider"]}, r"names the record \['Slider'\], which this version does not have"),
        ({"class": "Delay", "time": 1, "colour": 2}, "of Delay has the field 'colour', unknown to this version"),
        ({"class": "Slider", "mass": 1}, "of Slider lacks a field; make the run again"),
        ({"class": "Slider", "mass": -1, "stiffness": 1, "damping": 1}, r"Slider\.mass = -1: must be"),
        ({"class": "Interface", "thresholds": 3}, r"Interface\.thresholds = 3: must be a distribution"),
    ],
)
def test_records_that_cannot_be_made_again(plain, message):
    with pytest.raises(InputError, match=message):
        store.decode(plain, KINDS)


def test_numbers_along_a_dimension_are_compressed(tmp_path):
    import h5py

    data = xr.Dataset({"force": ("time", np.zeros(10_000)), "one": 1.0})
    store.save(data, tmp_path / "run.nc")
    with h5py.File(tmp_path / "run.nc") as file:
        assert file["force"].compression == "gzip"
        assert file["one"].compression is None


def test_a_record_of_a_guest_does_not_replace_one_of_ours_of_the_same_name(monkeypatch):
    @dataclass(frozen=True)
    class Weibull:
        scale: float

    @dataclass(frozen=True)
    class Other:
        time: float

    Other.__name__ = "Weibull"
    monkeypatch.setitem(store.DISTRIBUTIONS, "a guest's", Weibull)
    monkeypatch.setitem(store.DELAYS, "another's", Other)
    for one in (thresholds.Weibull(scale=1.0, shape=8.0), Weibull(2.0), Other(3.0)):
        assert store.decode(store.encode(one), store.records()) == one

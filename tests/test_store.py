"""Files and provenance: whole or not at all, and every record comes back as it was."""

import json
import math
import os
import pickle
from dataclasses import FrozenInstanceError, dataclass, replace
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
    KINDS["Population"](10**9, seed=5, rtol=1e-3),
    KINDS["Output"](interval=0.1, snapshots=(0.3, 1 / 7), bins=7),
    KINDS["Output"](),
    KINDS["FromRest"](),
    KINDS["Renewal"](64),
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
def test_every_record_is_a_value_and_comes_back_from_json(record):
    assert replace(record) == record == pickle.loads(pickle.dumps(record))
    assert hash(replace(record)) == hash(record)
    with pytest.raises(FrozenInstanceError):
        record.colour = 1.0
    text = json.dumps(store.encode(record), allow_nan=False)
    again = store.decode(json.loads(text), KINDS)
    assert again == record
    assert type(again) is type(record)


FLOATS = st.floats(-1e6, 1e6)


@given(st.lists(st.tuples(FLOATS, FLOATS, st.floats(1e-6, 1e6)), min_size=1, max_size=4))
def test_numbers_come_back_to_the_last_bit(parts):
    whole = drive.Drive(tuple(drive.Piece(start=a, end=b, duration=d) for a, b, d in parts))
    assert store.decode(json.loads(json.dumps(store.encode(whole))), KINDS) == whole


@pytest.mark.parametrize("value", [object(), {1, 2}, 2j, np.zeros(2), print, model.Delay])
def test_what_is_no_data_is_refused(value):
    with pytest.raises(InputError, match="cannot be written to a file; use a record"):
        store.encode(value)


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

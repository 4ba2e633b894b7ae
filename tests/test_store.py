"""Files and provenance: complete or absent, and every record is read back unchanged."""

import json
import math
import os
import pickle
from contextlib import suppress
from dataclasses import FrozenInstanceError, dataclass, fields, replace

import numpy as np
import pytest
import xarray as xr

import stickslip as ss
from stickslip.errors import InputError
from stickslip.io import datasets as store
from stickslip.io.datasets import records
from stickslip.paper import cases

KINDS = records()
STEADY = KINDS["SteadyState"](thresholds=ss.Gamma(mean=1.0, std=0.5))
BELL = ss.Bell(width=0.01, attempts=1e6)
HELD = {"delay": ss.OnArrest(), "sliding_force": 0.3, "slip_to_slip_scatter": 0.1}
BODY = {"coupling": 4.0, "mass": 1.0, "damping": 0.1}
LEGS = ss.constant(0.1, 2), ss.constant(0.1, 2).until(KINDS["ForceBelow"](-0.1))
AGED = ss.Interface(thresholds=STEADY.thresholds, ageing=ss.Langevin(rate=1))
RANGES = {"speeds": (0.5, 1.0), "between": (0.1, 2.0)}
CASES = [
    ss.Gaussian(mean=1.0, std=0.1, lower=0.0),
    ss.Uniform(low=0.1, high=1 / 3),
    ss.Exponential(mean=0.8),
    STEADY,
    ss.LogNormal(mean=1.0, std=0.5),
    ss.Weibull(scale=1.1, shape=2.5),
    ss.Empirical(edges=(0.1, 0.3, 0.7, 2.0), weights=(1, 1, 5)),
    KINDS["Assumption"](value="3 kg", how="weigh it", factors=(0.5, 2.0)),
    KINDS["Positive"](whole=ss.Gaussian(mean=1.0, std=1.0)),
    ss.Delay(math.inf),
    ss.RandomDelay(mean=0.2, std=0.12, negative="redraw"),
    ss.Langevin(rate=1.5),
    ss.ExponentialGrowth(rate=2.0, newborn=0.1),
    ss.LogarithmicGrowth(slope=0.05, time=1e-3),
    KINDS["TabulatedGrowth"](ages=(0.1, 1.0), strengths=(0.5, 1.0)),
    KINDS["Parabolic"](temperature=0.01, attempts=1e6),
    ss.Barrier(height=100.0, attempts=1e6, power=2.0, kramers=True),
    ss.Interface(
        thresholds=STEADY.thresholds,
        activation=BELL,
        newborn=ss.Uniform(low=0.0, high=0.2),
        **HELD,
    ),
    replace(AGED, initial=STEADY),
    ss.Interface(areas=ss.model.Areas(STEADY.thresholds, kept=True)),
    ss.Slider(stiffness=2.0, mass=1e-4, damping=200.0),
    KINDS["Chain"](blocks=9, side=4.0, ends="periodic", **BODY),
    KINDS["Sheet"](along=4, across=3, shear=1.5, leaf=0.2, **BODY),
    KINDS["Modes"](masses=(1.0, 0.5), stiffnesses=(2.0, 3.0), dampings=(0.1, 0.2)),
    KINDS["Matrices"](M=((1.0,),), C=((0.1,),), K=((2.0,),), contact=(1.0,)),
    KINDS["StateSpace"](
        A=((0.0, 1.0), (-2.0, -0.1)),
        force=(0.0, -1.0),
        drive=(0.0, 2.0),
        contact=(1.0, 0.0),
    ),
    KINDS["ControlledAxis"](mass=1e-4, kp=2.0, ki=1.0, kd=0.004, sample_time=1e-3),
    KINDS["Operation"](feasible=(("mass", 1e-5, 1e-3),), **RANGES),
    ss.Rig(
        *(cases.FIG5.interface, cases.FIG5.slider, ss.constant(1.0)),
        scales=KINDS["Scales"](force=768.0, stretching=2e-6),
        name="-inf",  # a text that JSON also has for a number
    ),
    ss.constant(0.1, 2).then(ss.ramp(1, -2, 3)).until(KINDS["Travel"](0.1)),
    LEGS[0].until(KINDS["ForceAbove"](0.1)).then(LEGS[1]),
    ss.constant(0.1, 2).under([(0.5, 1.0), (1 / 3 + 1, 2.0)]),
    ss.model.pull(0.0, 0.6, duration=1 / 3),
    KINDS["Mass"](mass=1e-4, damping=0.1),
    ss.Contacts(123, seed=2**100 + 1),
    ss.MasterEquation(rtol=1e-3, memoryless=True),
    ss.Population(10**9, seed=5, rtol=1e-3),
    ss.QuasiStatic(50, seed=3),
    KINDS["Renewal"](64),
    ss.Output(interval=0.1, snapshots=(0.3, 1 / 7), bins=7),
    ss.FromRest(),
    ss.FromSliding(perturbation=(0.1, -0.1)),
    ss.Prestressed(stretching=(0.6, 0.3), push=3.0, pushed_blocks=2),
]


def named(value, found):
    """Return the names of all records within a record."""
    if isinstance(value, dict):
        found |= {value["class"]} if "class" in value else set()
        for item in value.values():
            named(item, found)
    elif isinstance(value, list):
        for item in value:
            named(item, found)
    return found


def test_the_cases_below_name_every_record():
    assert named(store.encode(CASES), set()) == {*KINDS, "text"}


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


WRONG = None, True, "x", b"x", 1j, math.nan, 1.0, (), [], {1: 2}, (1.0,), (("a", 1.0),)
WRONG += (("a", 1.0, "x"),), np.array(1.0), np.zeros(2), object(), float


@pytest.mark.parametrize("record", CASES, ids=lambda record: type(record).__name__)
@pytest.mark.parametrize("value", WRONG)
def test_a_field_of_a_wrong_kind_is_refused_by_its_name(record, value):
    for field in fields(record):
        with suppress(InputError):
            hash(replace(record, **{field.name: value}))


@pytest.mark.parametrize("value", [{1, 2}, 2j, np.zeros(2), ss.Delay])
def test_what_is_no_data_is_refused(value):
    with pytest.raises(InputError, match="cannot be written to a file; use a record"):
        store.encode(value)


# -------------------------------------------------------------------------------- files


@pytest.fixture
def result() -> xr.Dataset:
    force = np.random.default_rng(0).normal(size=500)
    variables = {
        "spring_force": ("time", force, {"units": "f_s", "long_name": "force"}),
        "stretching_density": (("snapshot", "x"), np.arange(6.0).reshape(2, 3)),
        "count": ((), 3),
        "name": ((), "a word"),
        "kinds": ("snapshot", np.array(["one", "two"], dtype=object)),
    }
    axes = {"time": ("time", 0.1 * np.arange(500)), "x": ("x", [0.1, 0.2, 0.3])}
    made = store.provenance("simulate", {"slider": STEADY})
    return xr.Dataset(variables, axes, {"provenance": made})


def test_a_dataset_comes_back_bit_for_bit(result, tmp_path):
    path = store.save(result, tmp_path / "run.nc")
    assert path == tmp_path / "run.nc"
    again = store.load(path)
    xr.testing.assert_identical(again, result)
    assert again["spring_force"].dtype == np.float64
    assert again["count"].dtype.kind == "i"
    assert store.is_run(path)
    assert os.listdir(tmp_path) == ["run.nc"]


FAILURES = OSError(28, "No space left on device"), KeyboardInterrupt()


@pytest.mark.parametrize("failure", FAILURES)
def test_a_failed_write_leaves_the_old_file(result, tmp_path, monkeypatch, failure):
    """The folder holds the old file and nothing else."""
    path = store.save(result, tmp_path / "run.nc")
    before = path.read_bytes()

    def fail(_):
        raise failure

    monkeypatch.setattr(os, "fsync", fail)
    message = r"cannot be written \(No space left on device\).*; nothing was lost$"
    refused = pytest.raises(InputError, match=message)
    with refused if isinstance(failure, OSError) else pytest.raises(KeyboardInterrupt):
        store.save(result, path)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["run.nc"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is not a NetCDF file; a run is made with `stickslip simulate"),
        (b"CDF\x03" + bytes(100), "is not a NetCDF file"),
        (b"CDF\x01" + bytes(100), r"cannot be read as NetCDF \(it holds no variable"),
        (b"CDF\x05" + bytes(100), "is a NetCDF file of the kind CDF-5"),
        (b"\x89HDF\r\n\x1a\n", "cannot be read as NetCDF .*damaged"),
    ],
)
def test_files_that_cannot_be_read(content, message, tmp_path, capfd):
    place = tmp_path / "run.nc"
    place.write_bytes(content)
    with pytest.raises(InputError, match=f"^{place}: {message}"):
        store.load(place)
    assert capfd.readouterr() == ("", "")


# --------------------------------------------------------------------------- provenance


def test_provenance_names_call_arguments_and_version(result):
    content = store.read_provenance(result)
    assert content["call"] == "simulate"
    assert content["stickslip"]
    assert store.decode(content["arguments"], KINDS) == {"slider": STEADY}


GONE = "which this version does not have"
OTHER = "is of another version"
HEAVY = {"class": "Slider", "mass": -1, "stiffness": 1, "damping": 1}
TINTED = {"class": "Delay", "time": 1, "colour": 2}


@pytest.mark.parametrize(
    ("plain", "message"),
    [
        ({"class": "Sliderr", "mass": 1}, f"names the record 'Sliderr', {GONE}"),
        ({"class": ["Slider"]}, rf"names the record \['Slider'\], {GONE}"),
        (TINTED, f"of Delay {OTHER} .*'colour'.*; make the run again"),
        ({"class": "Slider", "mass": 1}, f"of Slider {OTHER} .*; make the run again"),
        (HEAVY, r"Slider\.mass = -1: must be"),
        ({"class": "Interface", "thresholds": 3}, r"thresholds = 3: must be a distrib"),
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
    for one in (ss.Weibull(scale=1.0, shape=8.0), Weibull(2.0), Other(3.0)):
        assert store.decode(store.encode(one), store.records()) == one

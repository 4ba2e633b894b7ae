"""Files of runs that are damaged, or were made by other programs: a refusal of one
line, and no output from the libraries that read them.
"""

import json

import h5py
import numpy as np
import pytest
from refusals import refused
from test_cli import SMALL

import stickslip as ss
from stickslip import cli


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    (folder / "rig.toml").write_text(SMALL.replace("distance = 40.0", "distance = 4.0"))
    command = "simulate", folder / "rig.toml", "-o", folder / "run.nc"
    assert cli.main([*map(str, command)]) == 0
    return folder / "run.nc"


@pytest.fixture
def check(capfd):
    """Run a command on a damaged run: it works, or refuses the run in one line."""

    def run(*arguments, code=None):
        capfd.readouterr()
        got = cli.main([str(argument) for argument in arguments])
        out, err = capfd.readouterr()
        assert got in (0, 2) if code is None else got == code
        if got == 2:
            assert out == ""
            assert err.count("\n") == 1
            assert len(err) <= 401
        else:
            assert err == ""
        return err

    return run


def changed(whole, place, **attributes):
    run = ss.load(whole)
    run.attrs |= attributes
    run.to_netcdf(place, engine="h5netcdf")
    return place


@pytest.mark.parametrize(
    "text", ["x = ", 3, "x = " + "[" * 2000, [1.0, 2.0]], ids=lambda t: str(t)[:9]
)
def test_a_damaged_rig(whole, tmp_path, check, text):
    place = changed(whole, tmp_path / "run.nc", rig=text)
    check("measure", place, code=0)  # the rig is taken from the provenance
    check("plot", place, tmp_path / "out.png", code=0)


def arguments(change):
    def make(text):
        content = json.loads(text)
        change(content["arguments"])
        return json.dumps(content)

    return make


def deep(levels):
    return lambda _: (
        '{"stickslip": "0", "call": "simulate", "arguments": {"interface": '
        + "[" * levels
        + "]" * levels
        + "}}"
    )


@pytest.mark.parametrize(
    "damage",
    [
        lambda _: 3,
        lambda _: "",
        deep(500),
        deep(900),
        deep(100_000),
        lambda _: (
            '{"call": "simulate", "arguments": {"interface": ' + "9" * 5000 + "}}"
        ),
        arguments(lambda a: a.pop("rig")),
        arguments(lambda a: a.update(extra=3)),
        arguments(lambda a: a["rig"].update(slider=3)),
        arguments(lambda a: a["rig"].update(start=None)),
        arguments(lambda a: a["rig"]["drive"].update(pieces=3)),
        arguments(lambda a: a["rig"]["drive"].update(pieces=[3])),
        arguments(lambda a: a["rig"]["output"].update(snapshots=3)),
        arguments(lambda a: a["rig"]["method"].update(seed="x")),
        arguments(
            lambda a: a["rig"]["interface"].update(
                thresholds={"class": "Empirical", "edges": 3, "weights": None}
            )
        ),
        arguments(
            lambda a: a["rig"]["interface"].update(
                delay={"class": "Scales", "force": 1}
            )
        ),
    ],
)
def test_damaged_provenance(whole, tmp_path, check, damage):
    text = damage(ss.load(whole).attrs["provenance"])
    check("rerun", changed(whole, tmp_path / "run.nc", provenance=text), code=2)


def texts(run):
    return ("time", np.array(["a"] * run.sizes["time"], dtype=object), {"units": "1"})


def with_attributes(run, name, **attributes):
    """Return the run with other attributes of a variable or coordinate."""
    run[name].attrs.update(attributes)
    return run


KINDS = ("phase", "energy")
DAMAGED = (
    lambda run: run.assign(spring_force=texts(run)),
    lambda run: run.assign(velocity=texts(run)),
    "no numbers",
    lambda run: run.assign(spring_force=1e300 * run.spring_force),
    "between 1e-30 and 1e+30",
    lambda run: run.assign(spring_force=np.nan * run.spring_force),
    lambda run: run.assign_coords(time=np.nan * run.time),
    "not finite",
    lambda run: run.assign(spring_force=run.spring_force.expand_dims(q=2)),
    "along time",
    lambda run: with_attributes(run, "time", units="seconds since 1900-01-01"),
    lambda run: with_attributes(run, "time", units="x since y"),
    lambda run: with_attributes(run, "spring_force", long_name="$\frac{", units="$x_"),
    lambda run: with_attributes(run, "spring_force", long_name=3, units=[1.0, 2.0]),
    lambda run: run.assign(spring_force=0 * run.spring_force),
    lambda run: run.isel(time=slice(0)),
    "-",
)


@refused(*DAMAGED)
@pytest.mark.parametrize(
    "kind", ["overview", *(pytest.param(k, marks=pytest.mark.slow) for k in KINDS)]
)
def test_damaged_variables(whole, tmp_path, check, call, message, kind):
    place = tmp_path / "run.nc"
    call(ss.load(whole)).to_netcdf(place, engine="h5netcdf")
    if message == "-":
        check("measure", place)
    else:
        assert message in check("measure", place, code=2)
    check("plot", place, tmp_path / "out.png", "--kind", kind)


def test_hdf5_of_others(tmp_path, check):
    with h5py.File(tmp_path / "run.nc", "w") as file:
        file["spring_force"] = np.arange(100.0)
        file["time"] = np.arange(100.0)
    check("measure", tmp_path / "run.nc")
    # a few bytes that decompress to eight terabytes
    with h5py.File(tmp_path / "huge.nc", "w") as file:
        file.create_dataset("spring_force", (10**12,), chunks=(10**6,), dtype="f8")
    assert "8e+03 GB, more than 8" in check("measure", tmp_path / "huge.nc", code=2)


def test_a_whole_run_passes(whole, tmp_path, check):
    check("measure", whole, code=0)
    check("rerun", whole, "-o", tmp_path / "again.nc", code=0)
    assert ss.load(whole).identical(ss.load(tmp_path / "again.nc"))

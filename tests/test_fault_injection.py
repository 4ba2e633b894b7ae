"""Every system call that writes fails once: the first, then the second, until none
does. The file is then the old one or the new one, and one line says what happened.
"""

import contextlib
import errno
import itertools
import json
import shutil

import numpy as np
import pytest
import xarray as xr
from faults import ERRORS, failing, failing_sqlite, sqlite_files

import stickslip as ss
from stickslip import cli
from stickslip.io import files, rig_files
from stickslip.plot import film
from stickslip.sweep._table import Store

RIG = ss.Rig(
    ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.2)),
    ss.Slider(stiffness=2.0, mass=1e-2, damping=4.0),
    ss.constant(1.0, duration=0.1),
    method=ss.Contacts(20, seed=1),
)
MOST = 200  # most calls of a test
# cases of the store at the start, and of the whole sweep
OLD = 2
ALL = 4


def _runs(state):
    return xr.Dataset({"x": ("t", np.full(1000, float(state)))}, attrs={"s": state})


def _save(place, state):
    ss.save(_runs(state), place)


def _page(place, state):
    files.write(place, f"<html>{state}{'.' * 9999}</html>".encode())


def _whole(place):
    """Return which state a complete file holds; None if there is no file."""
    if not place.exists():
        return None
    if place.suffix == ".html":
        state = int(place.read_bytes()[6:7])
        assert place.read_bytes() == f"<html>{state}{'.' * 9999}</html>".encode()
    else:
        run = ss.load(place)
        state = int(run.attrs["s"])
        assert run.identical(_runs(state))
    return state


@pytest.mark.parametrize("code", ERRORS, ids=errno.errorcode.get)
@pytest.mark.parametrize("old", [None, 1], ids=["new", "replaced"])
@pytest.mark.parametrize(
    ("name", "write"), [("run.nc", _save), ("page.html", _page)], ids=["run", "page"]
)
def test_a_file_is_the_old_one_or_the_new_one(tmp_path, name, write, old, code):
    place = tmp_path / name
    for nth in range(1, MOST):
        place.unlink(missing_ok=True)
        if old is not None:
            write(place, old)
        with failing(nth, code) as faults:
            try:
                write(place, 2)
                said = None
            except ss.InputError as error:
                said = str(error)
        if said is None:
            assert _whole(place) == 2
        else:
            assert "\n" not in said
            assert said.startswith(f"{place}: cannot be written (")
            assert said.endswith("; nothing was lost")
            assert _whole(place) == old
        if faults.calls[nth - 1 : nth] != ["unlink"]:
            assert {*tmp_path.iterdir()} <= {place}, faults.calls
        for left in {*tmp_path.iterdir()} - {place}:
            left.unlink()
        if not faults.failed:
            break
    assert not faults.failed
    assert nth > 5


def _sweep(place, new):
    """Open a store, which may exist, add cases, and close it."""
    table = Store(place, {"identity": {"rig": "a"}})
    try:
        for n in new:
            table.add(f"case {n}", json.dumps({"n": n, "more": "." * 3000}))
            if n == ALL - 2:
                table.commit()
        table.commit()
    finally:
        table.close()


def _cases(place):
    table = Store(place)
    try:
        for key, row in table.rows.items():
            assert key == f"case {json.loads(row)['n']}"
        return {*table.rows}
    finally:
        table.close()


def _check_store(folder, place, faults, said, begun):
    """Check that all cases or the committed ones are there, and the sweep goes on."""
    old = {f"case {n}" for n in range(OLD)}
    every = {f"case {n}" for n in range(ALL)}
    commits = [{f"case {n}" for n in range(ALL - 1)}, every]
    if said is None:
        assert _cases(place) == every
    else:
        assert "\n" not in said
        assert said.startswith(f"store = {str(place)!r}: cannot be written (")
        if begun:
            assert _cases(place) in [old, *commits], faults.calls
    _sweep(place, range(ALL))
    assert _cases(place) == every
    assert {*folder.iterdir()} == {place}


@pytest.mark.skipif(sqlite_files() is None, reason="sqlite is part of Python here")
@pytest.mark.parametrize("code", ERRORS, ids=errno.errorcode.get)
@pytest.mark.parametrize("begun", [False, True], ids=["new", "begun"])
@pytest.mark.parametrize(
    "fail", [failing, failing_sqlite], ids=["of the lock", "of sqlite"]
)
def test_a_store_keeps_every_commit(tmp_path, fail, begun, code):
    # made once: a disk may take 10 ms for each commit
    before = tmp_path / "before.sweep"
    _sweep(before, range(OLD))
    for nth in itertools.count(1):
        folder = tmp_path / str(nth)
        folder.mkdir()
        place = folder / "cases.sweep"
        if begun:
            shutil.copy(before, place)
        with fail(nth, code) as faults:
            try:
                _sweep(place, range(OLD if begun else 0, ALL))
                said = None
            except ss.InputError as error:
                said = str(error)
        _check_store(folder, place, faults, said, begun)
        if not faults.failed or nth == MOST:
            break
    assert not faults.failed
    assert nth > (15 if fail is failing_sqlite else 4)


@pytest.mark.parametrize("code", ERRORS, ids=errno.errorcode.get)
def test_the_command_line_says_it_in_one_line(tmp_path, capsys, code):
    """It exits with 2 if there is no output, whatever failed."""
    place = tmp_path / "run.nc"
    rig = tmp_path / "rig.toml"
    rig.write_text(rig_files.to_toml(RIG))
    for nth in range(1, MOST):
        with contextlib.suppress(FileNotFoundError):
            place.unlink()
        with failing(nth, code) as faults:
            result = cli.main(["simulate", str(rig), "-o", str(place)])
        error = capsys.readouterr().err
        assert place.exists() == (result == 0)
        assert result in (0, 2)
        assert error.count("\n") == (result == 2), error
        if not faults.failed:
            break
    assert not faults.failed


def test_a_film_is_written_as_any_other_file(tmp_path, monkeypatch):
    monkeypatch.setattr(film, "_FRAMES", 2)
    moving = ss.plot.contacts(ss.simulate(RIG))
    refused = pytest.raises(ss.InputError, match=r"film\.gif: cannot be written")
    with failing(1, errno.ENOSPC), refused:
        ss.plot.save(moving, tmp_path / "film.gif")
    assert not [*tmp_path.iterdir()]

"""Compiled code of kernels: cached, but never used once what a kernel calls differs."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

import stickslip.kernels

HERE = Path(stickslip.kernels.__file__).parent
HOW = ("jit", "bare", "inlined")
CALLEE = """
from ._jit import bare, inlined, jit

@jit
def by_jit(x):
    return {factor} * x

@bare
def by_bare(x):
    return {factor} * x

@inlined
def by_inlined(x):
    return {factor} * x
"""
CALLER = "from ._jit import jit\nfrom . import callee\n" + "".join(
    f"\nby_{how} = callee.by_{how}\n\n@jit\ndef product_{how}(x):\n"
    f"    return by_{how}(x)\n"
    for how in HOW
)
RUN = """
import json
from kernels import _jit, caller
before = _jit.compiled_before()
products = [caller.product_jit, caller.product_bare, caller.product_inlined]
print(json.dumps([
    [product(2.0) for product in products],
    [sum(product.stats.cache_hits.values()) for product in products],
    str(_jit._PLACE),
    before,
]))
"""


@pytest.fixture
def house(tmp_path):
    """A copy of the kernels, with two more in files of their own."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(HERE, tmp_path / "kernels", ignore=ignored)
    write(tmp_path)
    return tmp_path


def write(house, factor=2.0):
    (house / "kernels" / "callee.py").write_text(CALLEE.format(factor=factor))
    (house / "kernels" / "caller.py").write_text(CALLER)


def run(house, **environment):
    """Return what the callers give for 2, how often each came from the cache, its
    folder.
    """
    kept = dict(os.environ)
    kept.pop("NUMBA_CACHE_DIR", None)
    how = {"capture_output": True, "text": True, "check": True}
    command = [sys.executable, "-c", RUN]
    done = subprocess.run(command, cwd=house, env=kept | environment, **how)
    return json.loads(done.stdout)


@pytest.mark.slow
def test_only_what_a_change_in_another_file_concerns_is_compiled_again(house):
    assert run(house)[:2] == [[4.0] * 3, [0] * 3]
    assert run(house)[:2] == [[4.0] * 3, [1] * 3]
    write(house, 6.0)
    assert run(house)[:2] == [[12.0] * 3, [0] * 3]
    write(house, 2.0)
    assert run(house)[:2] == [[4.0] * 3, [1] * 3]  # as on the first branch


@pytest.mark.slow
def test_the_first_use_is_told_from_later_ones(house):
    assert [run(house)[3] for _ in range(2)] == [False, True]
    code = "from stickslip.console import working\nwith working('x'): pass"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(house / "empty")}
    how = {"capture_output": True, "text": True, "check": True}
    done = subprocess.run([sys.executable, "-c", code], env=environment, **how)
    assert "first use: the solvers are compiled" in done.stderr


@pytest.mark.slow
def test_old_machine_code_is_swept_up(house):
    folders = []
    for factor in (1.0, 2.0, 3.0, 4.0):
        write(house, factor)
        folders.append(Path(run(house)[2]))
    assert [folder.exists() for folder in folders] == [False, True, True, True]
    assert all(folder.parent == house / "kernels" / "__pycache__" for folder in folders)


@pytest.mark.slow
def test_kernels_in_a_folder_that_cannot_be_written_are_kept_for_the_user(house):
    # a file: no folder can be made there, not even by root
    (house / "kernels" / "__pycache__").write_text("")
    user = {"XDG_CACHE_HOME": str(house / "user"), "PYTHONDONTWRITEBYTECODE": "1"}
    assert Path(run(house, **user)[2]).parent == house / "user" / "numba"
    assert run(house, **user)[:2] == [[4.0] * 3, [1] * 3]
    (house / "user" / "numba").rename(house / "moved")
    (house / "user" / "numba").write_text("")
    temporary = house / "temporary"
    temporary.mkdir()
    place = run(house, **user, TMPDIR=str(temporary))[2]
    assert Path(place).parent.parent == temporary


@pytest.mark.slow
def test_a_cache_of_the_users_choice_is_used(house):
    folder = Path(run(house, NUMBA_CACHE_DIR=str(house / "chosen"))[2])
    assert folder.parent == house / "chosen"


@pytest.mark.takes(6)  # five interpreters start
def test_files_of_machine_code_that_were_cut_are_compiled_anew(house):
    place = Path(run(house)[2])
    # the index of one function, and the code of another, cut to nothing and in the
    # middle
    for kept in (0, 40):
        names = (f"caller.product_{name}" for name in ("jit*.nbi", "bare*.nbc"))
        cut = [file for name in names for file in place.rglob(name)]
        assert {file.suffix for file in cut} == {".nbi", ".nbc"}
        for file in cut:
            file.write_bytes(file.read_bytes()[:kept])
        assert run(house)[:2] == [[4.0] * 3, [0, 0, 1]]
        assert run(house)[:2] == [[4.0] * 3, [1] * 3]


@pytest.mark.slow
def test_without_a_home_machine_code_is_kept_among_temporary_files(house, tmp_path):
    here = tmp_path / "elsewhere"
    temporary = tmp_path / "tmp"
    here.mkdir()
    temporary.mkdir()
    (house / "kernels" / "__pycache__").touch()  # no folder can be made there
    environment = os.environ | {
        "HOME": "/proc/nowhere",
        "TMPDIR": str(temporary),
        "PYTHONPATH": str(house),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    environment.pop("NUMBA_CACHE_DIR", None)
    environment.pop("XDG_CACHE_HOME", None)

    def used():
        how = {"capture_output": True, "text": True, "check": True}
        command = [sys.executable, "-c", RUN]
        return subprocess.run(command, cwd=here, env=environment, **how)

    first = used()
    second = used()
    place = Path(json.loads(first.stdout)[2])
    assert place.parent.parent == temporary
    assert place.parent.stat().st_mode & 0o777 == 0o700
    assert "NUMBA_CACHE_DIR" in first.stderr
    assert json.loads(second.stdout)[:2] == [[4.0] * 3, [1] * 3]
    assert second.stderr == ""
    assert not list(here.iterdir())
    place.parent.chmod(0o755)  # all may read it, but its code is not trusted
    assert json.loads(used().stdout)[2] == "None"


@pytest.mark.parametrize(
    "cache", ["~/.cache", "cache"], ids=["no home", "a relative one"]
)
def test_the_folder_of_a_user_without_a_home_is_not_taken(monkeypatch, tmp_path, cache):
    from stickslip.kernels import _jit

    class Folders:
        user_cache_dir = cache

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(_jit, "_folders", lambda *_, **__: Folders)
    monkeypatch.setattr(_jit, "__file__", "/proc/nowhere/_jit.py")
    monkeypatch.setattr(_jit._numba.config, "CACHE_DIR", "")
    place = _jit._place()
    assert place.is_absolute()
    assert place.parents[1] == tmp_path / "tmp"
    assert [found.name for found in tmp_path.iterdir()] == ["tmp"]

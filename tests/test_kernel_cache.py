"""Machine code of kernels: it is kept, and never outlives a change to what a kernel
calls in another file.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import stickslip.kernels

HERE = Path(stickslip.kernels.__file__).parent
CALLEE = "from ._jit import {how}\n\n@{how}\ndef factor(x):\n    return {factor} * x\n"
CALLER = (
    "from ._jit import jit\nfrom .callee import factor\n\n@jit\ndef product(x):\n "
    "   return factor(x)\n"
)
RUN = """
import json
from kernels import _jit, caller
before = _jit.compiled_before()
print(json.dumps([caller.product(2.0), sum(caller.product.stats.cache_hits.values()), str(_jit._PLACE), before]))
"""  # noqa: E501


@pytest.fixture
def house(tmp_path):
    """A copy of the kernels, with two more that lie in files of their own."""
    shutil.copytree(
        HERE, tmp_path / "kernels", ignore=shutil.ignore_patterns("__pycache__")
    )
    write(tmp_path)
    return tmp_path


def write(house, factor=2.0, how="jit"):
    (house / "kernels" / "callee.py").write_text(CALLEE.format(how=how, factor=factor))
    (house / "kernels" / "caller.py").write_text(CALLER)


def run(house, **environment):
    """What the caller gives for 2, how often it came from the cache, and where that
    is.
    """
    kept = {
        name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"
    }
    done = subprocess.run(
        [sys.executable, "-c", RUN],
        cwd=house,
        env=kept | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


@pytest.mark.takes(5)  # four interpreters start, as below
@pytest.mark.parametrize("how", ["jit", "bare", "inlined"])
def test_a_change_in_another_file_is_seen_and_what_did_not_change_is_not_compiled_again(
    house, how
):
    write(house, how=how)
    assert run(house)[:2] == [4.0, 0]
    assert run(house)[:2] == [4.0, 1]
    write(house, 6.0, how)
    assert run(house)[:2] == [12.0, 0]
    write(house, 2.0, how)
    assert run(house)[:2] == [4.0, 1]  # back on the other branch


def test_the_first_use_is_told_from_later_ones(house):
    assert [run(house)[3] for _ in range(2)] == [False, True]
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            "from stickslip.console import working\nwith working('x'): pass",
        ],
        env=os.environ | {"NUMBA_CACHE_DIR": str(house / "empty")},
        capture_output=True,
        text=True,
        check=True,
    )
    assert "first use: the solvers are compiled" in done.stderr


@pytest.mark.takes(5)
def test_old_machine_code_is_swept_up(house):
    folders = []
    for factor in (1.0, 2.0, 3.0, 4.0):
        write(house, factor)
        folders.append(Path(run(house)[2]))
    assert [folder.exists() for folder in folders] == [False, True, True, True]
    assert all(folder.parent == house / "kernels" / "__pycache__" for folder in folders)


def test_kernels_in_a_folder_that_cannot_be_written_are_kept_for_the_user(house):
    # a file: no folder can be made there, not even by root
    (house / "kernels" / "__pycache__").write_text("")
    user = {"XDG_CACHE_HOME": str(house / "user"), "PYTHONDONTWRITEBYTECODE": "1"}
    assert Path(run(house, **user)[2]).parent == house / "user" / "numba"
    assert run(house, **user)[:2] == [4.0, 1]
    (house / "user" / "numba").rename(house / "moved")
    (house / "user" / "numba").write_text("")
    assert run(house, **user) == [4.0, 0, "None", False]  # nowhere: compiled each time


def test_a_cache_of_the_users_choice_is_used(house):
    folder = Path(run(house, NUMBA_CACHE_DIR=str(house / "chosen"))[2])
    assert folder.parent == house / "chosen"

"""The targets of the Makefile in a fresh clone."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="no make here")


def made(*arguments: str) -> str:
    """Return what make prints; it must succeed."""
    environment = {
        name: os.environ[name] for name in ("HOME", "PATH") if name in os.environ
    }
    done = subprocess.run(
        ["make", "--no-print-directory", "-C", str(ROOT), *arguments],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def targets() -> list[str]:
    found = re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    return found[1].split()


def test_help_names_every_target():
    named = re.findall(r"^make (\w+) ", made("help"), re.MULTILINE)
    parts_of_test = {"warm", "unit"}
    assert sorted({"help", *named, *parts_of_test}) == sorted(targets())


@pytest.mark.parametrize(
    "target", ["demo", "lint", "docs", "bench", "pictures", "elsewhere"]
)
def test_a_target_begins_with_its_own_environment(target, tmp_path):
    """Nothing else has been made before in a fresh clone."""
    planned = made("--dry-run", target, f"VENV={tmp_path / 'venv'}").splitlines()
    installs = [i for i, line in enumerate(planned) if "pip install" in line]
    uses = [i for i, line in enumerate(planned) if f"{tmp_path}/venv/bin/" in line]
    assert installs
    assert installs[0] <= uses[0]


def test_the_test_files_that_targets_name_are_there():
    text = (ROOT / "Makefile").read_text()
    lowest = re.search(r"^LOWEST_TESTS := (.*)$", text, re.MULTILINE)[1].split()
    named = {f"tests/test_{name}.py" for name in lowest}
    named |= set(re.findall(r"tests/\w+\.py", text))
    assert [name for name in sorted(named) if not (ROOT / name).is_file()] == []

"""What `import stickslip` provides, and what it leaves alone."""

import ast
import importlib
import importlib.util
import inspect
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import stickslip as ss

ROOT = Path(__file__).parents[1]
HEAVY = "numba", "xarray", "matplotlib", "pandas", "h5py", "h5netcdf"
HEAVY += "rich", "scipy.stats"


def said_and_loaded(code: str) -> set[str]:
    """Return the words that a program prints, and the modules loaded at its end."""
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys\nprint(*sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
    )
    return set(done.stdout.split())


RECORDS = """
import stickslip as ss
rig = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.RandomDelay(mean=0.2, std=0.12))
ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4), ss.ramp(0.1, 3.0, duration=200), ss.Contacts(100)
ss.model.Scales(force=1, stretching=1), ss.kinetic_friction(rig, velocity=1.0)
"""  # noqa: E501
VERDICT = """
from stickslip import cli
cli.main(["predict", "precision_stage", "--fast"])
"""
HELP = "from stickslip import cli\ntry: cli.main(['--help'])\nexcept SystemExit: pass"


@pytest.mark.parametrize(
    "code", ["import stickslip", RECORDS, HELP], ids=["import", "records", "help"]
)
def test_what_is_quick_loads_nothing_heavy(code):
    said = said_and_loaded(code)
    # which prints it
    assert not said & set(HEAVY) - ({"rich"} if code is HELP else set())
    assert "predict" in said or code is not HELP


def test_a_verdict_makes_no_tables():
    said = said_and_loaded(VERDICT)
    assert not said & {"xarray", "pandas", "matplotlib", "h5netcdf", "stickslip.paper"}


def test_every_public_name_is_there_and_says_what_it_is():
    assert len(ss.__all__) == len(set(ss.__all__))
    assert ss.__all__ == sorted(ss.__all__)
    assert len(dir(ss)) <= 66  # a contract: other names stay in their rooms
    for name in ss.__all__:
        assert name in dir(ss)
        assert getattr(ss, name).__doc__, name


def test_the_version_is_stated_once():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    others = [ROOT / "CITATION.cff", ROOT / "README.md", ROOT / "docs" / "conf.py"]
    # no compiled code of kernels, whose file names contain .py too
    others += [*(ROOT / "src").rglob("*.py"), *(ROOT / "src").rglob("*.pyi")]
    stated = re.compile(rf"\b{re.escape(project['version'])}\b".encode())
    assert [str(file) for file in others if stated.search(file.read_bytes())] == []


def test_a_name_that_does_not_exist():
    with pytest.raises(AttributeError, match="No stickslip attribute stick"):
        _ = ss.stick


def test_the_room_of_the_sweeps_takes_what_its_function_takes():
    from stickslip.sweep.plan import sweep

    room = inspect.signature(ss.sweep).parameters.values()
    function = inspect.signature(sweep).parameters.values()
    assert [(one.name, one.kind, one.default) for one in room] == [
        (one.name, one.kind, one.default) for one in function
    ]


def public_names(module):
    """Public names of a room; of a module without a list, all names."""
    listed = getattr(module, "__all__", None)
    return set(listed if listed is not None else vars(module))


def names_used(file):
    """Yield each name that a file imports from our modules, with the module."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    known = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            known |= {each.asname or each.name: each.name for each in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module.startswith("stickslip"):
            for each in node.names:
                yield node.module, each.name
                known[each.asname or each.name] = f"{node.module}.{each.name}"
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            yield known.get(node.value.id, ""), node.attr


def is_public(module, name):
    """Return whether a module lists a name, or the name is a module itself (the
    contract in pyproject.toml covers these); true of classes.
    """
    try:
        listed = public_names(importlib.import_module(module))
        return name in listed or bool(importlib.util.find_spec(f"{module}.{name}"))
    except ModuleNotFoundError:
        return True


@pytest.mark.parametrize("room", ["explorer", "paper"])
def test_explorer_and_paper_use_public_names_only(room):
    internal = set()
    for file in (ROOT / "src" / "stickslip" / room).glob("*.py"):
        for module, name in names_used(file):
            is_foreign = module.startswith("stickslip") and room not in module
            if is_foreign and (name.startswith("_") or not is_public(module, name)):
                internal.add(f"{file.name}: {module}.{name}")
    assert internal == set()


def test_an_internal_name_is_no_public_one():
    assert not is_public("stickslip.measure", "Heading")
    assert is_public("stickslip.measure", "regime")


def test_only_the_tests_of_kernels_use_kernels():
    using = re.compile(r"^\s*(from|import) stickslip(\.| import )kernels", re.MULTILINE)
    tests = (ROOT / "tests").glob("test_*.py")
    assert [file.name for file in tests if using.search(file.read_text())] == []

"""The documentation: complete, true to the code, and built without a network.

Code blocks in the pages are run by the root conftest.py; the other checks are here.
"""

import json
import pkgutil
import re
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import bench_table
import headless
import pytest

import stickslip as ss
from stickslip.cli import app
from stickslip.io import rig_keys
from stickslip.model import Areas
from stickslip.model.activation import ACTIVATIONS
from stickslip.model.ageing import AGEING_MODELS
from stickslip.model.delays import RandomDelay
from stickslip.model.distributions import DISTRIBUTIONS
from stickslip.paper.figure import claim_from, near

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
TABLES = (
    *rig_keys.TABLES.values(),
    *rig_keys.STRUCTURES.values(),
    rig_keys.PIECE,
    rig_keys.keys_of(RandomDelay),
    rig_keys.START,
)
"""Tables of a rig file with a fixed set of keys."""
PAGES = [page for page in sorted(DOCS.rglob("*.md")) if "_build" not in page.parts]


@pytest.fixture(scope="module")
def house():
    """The module that makes parts of the pages from the code."""
    pytest.importorskip("sphinx")
    sys.path.insert(0, str(DOCS / "_ext"))
    try:
        yield import_module("house")
    finally:
        sys.path.remove(str(DOCS / "_ext"))


def found(dotted):
    """Return whether a dotted name exists, also as a field without a default."""
    try:
        pkgutil.resolve_name(dotted)
    except (ImportError, AttributeError):
        owner, _, field = dotted.rpartition(".")
        if not ("." in owner and found(owner)):
            return False
        return field in getattr(pkgutil.resolve_name(owner), "__annotations__", {})
    return True


def test_every_public_name_is_in_the_reference():
    text = "\n".join(page.read_text() for page in (DOCS / "reference").glob("*.md"))
    directive = r"^\.\. auto(?:function|class|data):: stickslip\.(\w+)$"
    named = re.findall(directive, text, re.MULTILINE)
    # Rooms are not functions: each has its own page. A room that can be called is both.
    rooms = {name for name in ss.__all__ if isinstance(getattr(ss, name), ModuleType)}
    assert sorted({*named, *rooms}) == ss.__all__


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
def test_names_that_a_page_points_at_exist(page):
    text = page.read_text()
    role = r"\{(?:func|class|meth|attr|mod|data)\}`(?:[^`<]*<)?~?([\w.]+)>?`"
    roles = re.findall(role, text)
    directives = re.findall(r"^\.\. auto\w+:: ([\w.]+)$", text, re.MULTILINE)
    missing = [name for name in (*roles, *directives) if not found(name)]
    assert not missing


@pytest.mark.parametrize("number", range(1, 19))
def test_every_equation_of_the_paper_is_in_the_theory_once(number):
    """It has a label, so that other pages can refer to it."""
    text = "\n".join(page.read_text() for page in (DOCS / "theory").glob("*.md"))
    assert text.count(rf"\tag{{{number}}}") == 1
    label = rf"^\(eq-{number}\)=\n\n\\begin\{{equation\*\}}"
    assert re.search(label, text, re.MULTILINE)


TESTS_ONLY = "hypothesis", "httpx", "mypy", "playwright", "pytest", "pytest_benchmark"
TESTS_ONLY += ("sybil",)
"""Packages that `make docs` lacks: the extra `docs` does not include them."""


@pytest.mark.parametrize(
    "part", ["commands", "rig_keys", "mechanisms", "claims", "made_by", "stale_report"]
)
def test_pages_are_made_without_the_packages_of_the_tests(house, monkeypatch, part):
    for name, module in list(sys.modules.items()):
        file = Path(getattr(module, "__file__", None) or "/")
        if file.parent in (ROOT / "tests", ROOT / "tools", ROOT / "verification"):
            monkeypatch.delitem(sys.modules, name)
    for package in TESTS_ONLY:
        monkeypatch.setitem(sys.modules, package, None)
    assert isinstance(getattr(house, part)(), str)


def test_every_command_comes_with_its_options(house):
    text = house.commands()
    found = re.findall(r"^## stickslip (\w+)$", text, re.MULTILINE)
    assert found == [name for name in app if name[0] != "-"]
    drop = "Smallest drop that counts as a slip: '5 mN', or in N"
    assert f"`--minimum-drop STR`: {drop}" in text


def test_every_key_of_a_rig_file_has_a_meaning_and_an_example(house):
    """The page says which value a missing key has."""
    text = house.rig_keys()
    rows = re.findall(r"^\| `.*$", text, re.MULTILINE)
    kinds = (DISTRIBUTIONS, {"areas": Areas}, AGEING_MODELS, ACTIVATIONS)
    records = [rig_keys.keys_of(record) for kind in kinds for record in kind.values()]
    assert len(rows) == sum(map(len, (rig_keys.TOP, *TABLES, *records))) >= 60
    for row in rows:
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:-1]]
        assert len(cells) == 5
        assert all(cells), f"an empty cell: {row}"
    for table in TABLES:
        for name, key in table.items():
            # `friction_points` reads a list of points as a whole
            whole = key.is_table or name == "friction"
            assert whole or key.read(key.example, name, natural=False)


def report_of(folder, studies):
    """Write a report of the verification into a folder."""
    file = folder / "report.json"
    file.write_text(json.dumps({"made_by": "version 1.0", "studies": studies}))
    return file


def test_claims_become_a_table_for_each_group(house, tmp_path):
    measured = near("K*", 2.98913, 2.989, 0.003, "k")
    how = {"printed": False, "evidence": "Eq. (8)", "exact": "2.989 k"}
    claim = claim_from(6, "K* = 3.59 | N", measured, **how).plain()
    finding = claim | {"lines": [str(measured)]}
    failed = claim | {"lines": [], "ok": False, "number": None}
    groups = (("fig3", "Claims", finding), ("ratio", "Closed forms", failed))
    studies = [{"study": s, "group": g, "findings": [f]} for s, g, f in groups]
    text = house.claims(report_of(tmp_path, studies))
    assert "### Closed forms" in text
    assert r"| fig3 | not reproduced | Claim 6: K\* = 3.59 \| N" in text
    assert r"K\* = 2.98913 k (2.989 ± 0.003)" in text
    assert "| ratio | **FAILED** |" in text
    assert "make verify" in house.claims(tmp_path / "none.json")


PROMISES = ("fast", 0.1, 0), ("fast", 0.5, 1), ("cost", 4, 0), ("cost", 6, 1)


@pytest.mark.parametrize(("role", "least", "code"), PROMISES)
def test_a_promise_that_is_not_kept_fails_the_benchmarks(tmp_path, role, least, code):
    runs = []
    for each, seconds in (("plain", 1.0), (role, least)):
        info = {"role": each, "what": "runs", "promised": 5}
        run = {"group": "a", "extra_info": info, "stats": {"min": seconds}}
        runs.append(run)
    record = tmp_path / "record.json"
    page = tmp_path / "page.md"
    info = {"machine_info": {"cpu": {}, "python_version": "3.11"}}
    info["datetime"] = "2026-01-01T00:00:00+00:00"
    record.write_text(json.dumps({"benchmarks": runs, **info}))
    page.write_text(f"<!-- {role}:begin --><!-- {role}:end -->")
    assert bench_table.main([str(record), str(page)]) == code
    assert ("not met" in page.read_text()) == bool(code)


SIGNS = {"README.md": 1.0, "docs/howto/what-it-costs.md": -1.0}


@pytest.mark.parametrize(("page", "sign"), SIGNS.items())
def test_no_row_of_a_table_hides_a_promise_that_is_not_kept(page, sign):
    row = r"\| ([\d.e+]+) \| at (?:least|most) ([\d.]+)(.*)\|\n"
    rows = re.findall(row, (ROOT / page).read_text())
    assert len(rows) > 5
    for ratio, promised, said in rows:
        is_short = sign * float(ratio) < sign * float(promised)
        assert is_short == ("not met" in said)


def test_a_report_of_other_sources_is_stale(house, monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(ROOT))
    sources = import_module("verification.sources")
    studies = {"gamma": ["kernels"], "fits": ["kernels", "fitting"]}
    made = [
        {"study": s, "rooms": rooms, "sources": sources.fingerprint(rooms)}
        for s, rooms in studies.items()
    ]
    report = report_of(tmp_path, made)
    assert house.made_by(report) == "Made by version 1.0."
    package = tmp_path / "src" / "stickslip"
    ignored = shutil.ignore_patterns("__pycache__", "static")
    shutil.copytree(ROOT / "src" / "stickslip", package, ignore=ignored)
    monkeypatch.setattr(sources, "ROOT", tmp_path)
    assert house.stale_report(report) == ""  # from the same sources, wherever they are
    changes = (
        ("plot/runs.py", ""),
        ("fitting/model.py", ": fits."),
        ("kernels/panels.py", ": gamma, fits."),
    )
    for file, stale in changes:
        text = (package / file).read_text()
        (package / file).write_text(text + "# neither layout nor words compute\n")
        before = house.stale_report(report)
        (package / file).write_text(text + "changed = True\n")
        assert stale in house.stale_report(report)
        assert bool(stale) == (before != house.stale_report(report))
        assert bool(stale) == bool(house.stale_report(report))
    assert "`make verify`" in house.made_by(report)


LINKS = r"<link rel=\"(?:canonical|index|search|next|prev|author)\"[^>]*>"
"""Links of a page that it does not load."""


def loads(page):
    """Return what a page loads: scripts, pictures, styles."""
    text = re.sub(LINKS, "", page.read_text(encoding="utf-8"))
    kinds = "link|script|img|iframe|source|audio|video|embed|object|input"
    tags = re.findall(rf"<(?:{kinds})\b[^>]*>", text)
    found = re.findall(r"\b(?:href|src|data|srcset)=\"([^\"]*)\"", " ".join(tags))
    return found + re.findall(r"style=\"[^\"]*url\(['\"]?([^'\")]+)", text)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The pages, built as `make docs` does."""
    pytest.importorskip("sphinx")
    out = tmp_path_factory.mktemp("html")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going"]
    command += ["-b", "html", "-d", out / "doctrees"]
    # links to the report, which needs `make verify`
    command += ["-D", "suppress_warnings=house.stale"]
    command += [DOCS, out / "pages"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not done.stderr, done.stderr
    return out / "pages"


def is_foreign(address):
    return re.match(r"(?:[a-z]+:)?//", address.strip(), re.IGNORECASE) is not None


@pytest.mark.slow
def test_pages_load_nothing_from_another_host(built):
    pages = sorted(built.rglob("*.html"))
    assert len(pages) > 25
    for page in pages:
        assert any("house.css" in load for load in loads(page)), page
        assert not [load for load in loads(page) if is_foreign(load)], page
    for style in built.rglob("*.css"):
        text = style.read_text(encoding="utf-8")
        asked = re.findall(r"url\(\s*['\"]?([^'\")\s]+)", text)
        asked += re.findall(r"@import\s+['\"]([^'\"]+)", text)
        assert not [address for address in asked if is_foreign(address)], style


@pytest.mark.slow
def test_every_public_name_can_be_linked_to(built):
    pages = built.rglob("reference/*.html")
    texts = [page.read_text(encoding="utf-8") for page in pages]
    anchors = set(re.findall(r' id="([^"]+)"', "\n".join(texts)))
    for name in ss.__all__:
        assert {f"stickslip.{name}", f"module-stickslip.{name}"} & anchors, name


SHOWN = "theory/stability", "theory/ageing", "start", "reference/rig-file"


@pytest.mark.slow
def test_maths_is_set_offline_and_nothing_is_wider_than_a_phone(built):
    if headless.CHROMIUM is None:
        pytest.skip(headless.WHY_NOT)
    asked = []
    with headless.browser() as browser:
        for width in (1280, 390):
            size = {"width": width, "height": 900}
            view = browser.new_context(viewport=size, offline=True).new_page()
            view.on("request", lambda request: asked.append(request.url))
            for name in (*SHOWN, "howto/predict"):
                view.goto((built / f"{name}.html").as_uri())
                view.wait_for_function(
                    "window.MathJax?.startup?.promise !== undefined || "
                    "!document.querySelector('.math')"
                )
                view.evaluate("window.MathJax?.startup?.promise")
                formulas = view.locator(".math").count()
                assert view.locator(".math mjx-container").count() == formulas, name
                assert view.locator("mjx-merror, [data-mjx-error]").count() == 0, name
                wide = view.evaluate("document.documentElement.scrollWidth")
                assert wide <= width, (name, width)
    assert asked
    assert not [url for url in asked if not url.startswith(("file:", "data:"))]

"""The verification programme itself: what it does with studies that hold, fail or break, on cheap studies."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from stickslip.paper import Claim
from stickslip.paper.figure import at_most

ROOT = Path(__file__).parents[1]


def verify(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "verification", *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )


def test_one_part_gives_a_report_for_machines_and_one_for_people(tmp_path):
    done = verify("gamma", "energy", "--report", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert "2 of 2 studies came out as settled" in done.stdout
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["ok"]
    assert [study["study"] for study in report["studies"]] == ["gamma", "energy"]
    gamma = report["studies"][0]["findings"][0]
    assert gamma["ok"]
    assert all(number["low"] is None or number["low"] <= number["value"] for number in gamma["measured"])
    page = (tmp_path / "report.html").read_text()
    assert "Every study came out as settled" in page
    assert gamma["statement"] in page
    assert "http" not in page  # it asks nobody for anything


def test_studies_are_listed_and_a_misspelt_one_is_named():
    listed = verify("--list")
    assert listed.returncode == 0
    for name in ("fig4", "uniform", "linear", "cohorts-order"):
        assert any(line.startswith(f"{name} ") for line in listed.stdout.splitlines())
    wrong = verify("fig99")
    assert wrong.returncode == 2
    assert wrong.stderr.startswith("verification: fig99: no such study; there are fig1, ")
    assert "Traceback" not in wrong.stderr


@pytest.fixture
def programme(monkeypatch):
    """The programme's modules, importable as from the root of the repository."""
    monkeypatch.syspath_prepend(str(ROOT))
    import verification.programme
    import verification.report

    return verification


def held(value):
    claim = Claim(
        number=None, statement="small", verdict="reproduced", evidence="none",
        measured=(at_most("size", value, 1.0),),
    )  # fmt: skip
    return lambda: (claim,)


def test_a_number_out_of_its_band_and_a_study_that_raises_are_findings(programme, monkeypatch, tmp_path):
    def broken():
        raise RuntimeError("no convergence")

    for name, run in {"good": held(0.5), "bad": held(2.0), "broken": broken, "empty": lambda: ()}.items():
        study = programme.Study(name=name, group="Mine", title=name, run=run)
        monkeypatch.setitem(programme.STUDIES, name, study)
    names = ("good", "bad", "broken", "empty")
    outcomes = [programme.programme.run_one(name) for name in names]
    assert [outcome.ok for outcome in outcomes] == [True, False, False, False]
    assert "no convergence" in outcomes[2].failure
    report = programme.report.Report(outcomes=outcomes)
    assert not report.ok
    _, page = report.save(tmp_path / "deep" / "folder")
    text = page.read_text()
    assert "Some studies did not come out as settled" in text
    assert "NOT MET" in text
    assert "RuntimeError: no convergence" in text

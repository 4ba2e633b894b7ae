"""The verification programme, on cheap studies that hold, fail or break."""

import json
import sys
from pathlib import Path

import pytest

from stickslip.paper.figure import at_most, claim_from

ROOT = Path(__file__).parents[1]


@pytest.fixture
def programme(monkeypatch):
    """The programme, importable as from the root of the repository."""
    monkeypatch.syspath_prepend(str(ROOT))
    import verification.__main__

    return verification


@pytest.fixture
def verify(programme, monkeypatch, capsys):
    """Run its command line; return the exit code and what it says."""

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["verification", *words])
        return programme.__main__.main(), *capsys.readouterr()

    return run


@pytest.mark.slow
def test_one_part_gives_a_report_for_machines_and_one_for_people(verify, tmp_path):
    code, out, err = verify(
        "gamma", "energy", "--workers", "1", "--report", str(tmp_path)
    )
    assert code == 0, err
    assert "2 of 2 studies in the report came out as settled" in out
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["ok"]
    assert report["made_by"].startswith("version ")
    assert [study["study"] for study in report["studies"]] == ["gamma", "energy"]
    gamma = report["studies"][0]["findings"][0]
    assert gamma["ok"]
    assert all(
        number["low"] is None or number["low"] <= number["value"]
        for number in gamma["measured"]
    )
    page = (tmp_path / "report.html").read_text()
    assert "Every study came out as settled" in page
    assert gamma["statement"] in page
    assert "http" not in page  # it asks nobody for anything


@pytest.mark.slow
def test_only_what_is_stale_runs_again_and_the_rest_of_the_report_stays(
    verify, tmp_path
):
    def again():
        _, out, err = verify(
            "gamma", "ratio", "--stale", "--workers", "1", "--report", str(tmp_path)
        )
        assert "2 of 2 studies in the report came out as settled" in out, err
        return [line.split()[1] for line in out.splitlines() if line.startswith("ok ")]

    assert again() == ["gamma", "ratio"]
    report = json.loads((tmp_path / "report.json").read_text())
    report["studies"][0]["sources"] = "others"
    (tmp_path / "report.json").write_text(json.dumps(report))
    assert again() == ["gamma"]
    assert (
        json.loads((tmp_path / "report.json").read_text())["studies"][1]
        == report["studies"][1]
    )


def test_studies_are_listed_and_a_misspelt_one_is_named(verify):
    code, out, _ = verify("--list")
    assert code == 0
    assert {"fig4", "uniform", "linear", "cohorts-order"} <= {
        line.split()[0] for line in out.splitlines()
    }
    code, _, err = verify("fig99")
    assert code == 2
    assert err.startswith("verification: fig99: no such study; there are fig1, ")
    assert err.count("\n") == 1


def held(value):
    return lambda: (
        claim_from(
            None, "small", at_most("size", value, 1.0), printed=True, evidence="none"
        ),
    )


def test_a_number_out_of_its_band_and_a_study_that_raises_are_findings(
    programme, monkeypatch, tmp_path
):
    def broken():
        raise RuntimeError("no convergence")

    for name, run in {
        "good": held(0.5),
        "bad": held(2.0),
        "broken": broken,
        "empty": lambda: (),
    }.items():
        study = programme.Study(name=name, group="Mine", title=name, run=run)
        monkeypatch.setitem(programme.STUDIES, name, study)
    names = ("good", "bad", "broken", "empty")
    outcomes = [programme.programme.run_one(name) for name in names]
    assert [outcome.ok for outcome in outcomes] == [True, False, False, False]
    assert "no convergence" in outcomes[2].failure
    report, page = programme.report.save(
        {o.study: o.plain() for o in outcomes}, tmp_path / "deep" / "folder"
    )
    assert not json.loads(report.read_text())["ok"]
    text = page.read_text()
    assert "Some studies did not come out as settled" in text
    assert "NOT MET" in text
    assert "RuntimeError: no convergence" in text

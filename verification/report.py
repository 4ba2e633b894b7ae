"""One report of all studies, as JSON and as HTML; it holds the last run of each."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import stickslip
from stickslip.io import files
from stickslip.paper import Claim
from verification import STUDIES
from verification.sources import fingerprint

Studies = dict[str, dict[str, Any]]
"""The studies as stored in JSON, by name."""

_TEMPLATE = Path(__file__).with_name("template.html")


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The findings of the study of this name, when it ran, and how long it took in s.

    `failure` is the reason why it could not be finished.
    """

    study: str
    findings: tuple[Claim, ...]
    seconds: float
    failure: str = ""
    when: str = field(
        default_factory=lambda: datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    )

    @property
    def ok(self) -> bool:
        """Return whether it was finished and all findings have reference verdicts."""
        return (
            not self.failure
            and bool(self.findings)
            and all(claim.ok for claim in self.findings)
        )

    def plain(self) -> dict[str, Any]:
        """Return a value converted to types that JSON has."""
        study = STUDIES[self.study]
        return {
            "study": study.name,
            "group": study.group,
            "title": study.title,
            "ok": self.ok,
            "seconds": round(self.seconds, 1),
            "when": self.when,
            "rooms": study.rooms,
            "sources": fingerprint(study.rooms),
            "stickslip": stickslip.__version__,
            "python": platform.python_version(),
            "failure": self.failure,
            "findings": [
                {**claim.plain(), "lines": [str(m) for m in claim.measured]}
                for claim in self.findings
            ],
        }


def read(folder: Path) -> Studies:
    """Return the studies of the report in a folder that still exist; none if there is
    no report.
    """
    file = folder / "report.json"
    studies = (
        json.loads(file.read_text(encoding="utf-8"))["studies"] if file.exists() else []
    )
    return {study["study"]: study for study in studies if study["study"] in STUDIES}


def stale(studies: Studies) -> list[str]:
    """Return the names of the studies that the report lacks, or made with other
    sources.
    """
    return [
        name
        for name, study in STUDIES.items()
        if studies.get(name, {}).get("sources") != fingerprint(study.rooms)
    ]


def save(studies: Mapping[str, Mapping[str, Any]], folder: Path) -> tuple[Path, Path]:
    """Write ``report.json`` and ``report.html``, the studies in the order of the
    programme.
    """
    from jinja2 import Environment

    folder.mkdir(parents=True, exist_ok=True)
    page = Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True
    ).from_string(_TEMPLATE.read_text())
    kept = [studies[name] for name in STUDIES if name in studies]
    report = {
        "ok": all(study["ok"] for study in kept),
        "made_by": _made_by(kept),
        "studies": kept,
    }
    texts = {
        "report.json": json.dumps(report, indent=1) + "\n",
        "report.html": page.render(report),
    }
    for name, text in texts.items():
        files.write(folder / name, text.encode())
    first, second = (folder / name for name in texts)
    return first, second


def _made_by(kept: Sequence[Mapping[str, Any]]) -> str:
    """Return which versions made a report, and when the last study ended."""
    version, python = (
        " and ".join(dict.fromkeys(each[name] for each in kept))
        for name in ("stickslip", "python")
    )
    return (
        f"version {version}, Python {python}, "
        f"{max((each['when'] for each in kept), default='never')}"
    )

"""One report of all studies: JSON for machines, HTML for people."""

from __future__ import annotations

import json
import platform
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import stickslip
from stickslip.io import files
from stickslip.paper import Claim
from verification import STUDIES
from verification.sources import fingerprint

_TEMPLATE = Path(__file__).with_name("template.html")


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What the study of this name found, and how long it took in s; `failure` where it could not be finished."""

    study: str
    findings: tuple[Claim, ...]
    seconds: float
    failure: str = ""

    @property
    def ok(self) -> bool:
        """Whether it was finished and every finding came out as settled."""
        return not self.failure and bool(self.findings) and all(claim.ok for claim in self.findings)

    def plain(self) -> dict[str, Any]:
        """Return what JSON can hold."""
        return {
            "study": self.study,
            "group": STUDIES[self.study].group,
            "title": STUDIES[self.study].title,
            "ok": self.ok,
            "seconds": round(self.seconds, 1),
            "failure": self.failure,
            "findings": [{**claim.plain(), "lines": [str(m) for m in claim.measured]} for claim in self.findings],
        }


@dataclass(frozen=True, kw_only=True)
class Report:
    """All outcomes of one run of the programme."""

    outcomes: Sequence[Outcome]
    version: str = stickslip.__version__
    sources: str = field(default_factory=fingerprint)
    python: str = platform.python_version()
    when: str = field(default_factory=lambda: datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"))

    @property
    def ok(self) -> bool:
        """Whether every study is."""
        return all(outcome.ok for outcome in self.outcomes)

    def plain(self) -> dict[str, Any]:
        """Return what JSON can hold."""
        return {
            "stickslip": self.version,
            "sources": self.sources,
            "python": self.python,
            "when": self.when,
            "ok": self.ok,
            "studies": [outcome.plain() for outcome in self.outcomes],
        }

    def save(self, folder: Path) -> tuple[Path, Path]:
        """Write ``report.json`` and ``report.html``."""
        from jinja2 import Environment

        folder.mkdir(parents=True, exist_ok=True)
        page = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(_TEMPLATE.read_text())
        texts = {
            "report.json": json.dumps(self.plain(), indent=1) + "\n",
            "report.html": page.render(self.plain()),
        }
        for name, text in texts.items():
            files.write(folder / name, text.encode())
        first, second = (folder / name for name in texts)
        return first, second

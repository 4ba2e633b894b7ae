"""What a study is: a question, and a function that answers it with claims."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from stickslip.paper import Claim, Measured


@dataclass(frozen=True, kw_only=True)
class Study:
    """A part of the programme.

    Attributes
    ----------
    name : str
        How the command line calls it.
    group : str
        The chapter of the report.
    title : str
    run : callable
        Measures, and returns the findings.
    """

    name: str
    group: str
    title: str
    run: Callable[[], tuple[Claim, ...]]


def finding(statement: str, *measured: Measured, evidence: str) -> Claim:
    """Return a statement of ours, which holds if every number lies in its band."""
    return Claim(
        number=None,
        statement=statement,
        verdict="reproduced" if all(m.ok for m in measured) else "not reproduced",
        settled="reproduced",
        measured=measured,
        evidence=evidence,
    )

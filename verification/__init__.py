"""The verification programme: the paper's claims, closed forms, solvers against each
other, and orders of convergence.

Each study is a function that computes values and returns claims with bands; `python -m
verification` runs all studies, or those named, and writes one report. Bands come from
theory or from reference numbers, never from the results.
"""

from __future__ import annotations

from verification import (
    advice,
    closed_forms,
    convergence,
    figures,
    fits,
    noise,
    solvers,
)
from verification.study import Study

STUDIES: dict[str, Study] = {
    study.name: study
    for study in (
        *figures.STUDIES,
        *closed_forms.STUDIES,
        *solvers.STUDIES,
        *noise.STUDIES,
        *convergence.STUDIES,
        *fits.STUDIES,
        *advice.STUDIES,
    )
}
"""The studies by name, in the order of the report."""

__all__ = ["STUDIES", "Study"]

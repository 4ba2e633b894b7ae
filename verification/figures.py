"""The paper's claims, figure by figure, with all points and contacts.

"Not reproduced" is a verdict like any other: the claim passes if the stated exact value
is met instead.
"""

from __future__ import annotations

from tempfile import TemporaryDirectory

from stickslip.paper import FIGURES, Claim, Figure, reproduce
from verification.study import Study


def _study(figure: Figure) -> Study:
    def run() -> tuple[Claim, ...]:
        with TemporaryDirectory() as folder:
            return reproduce(figure, folder).claims

    return Study(
        name=figure.name, group="The paper's claims", title=figure.title, run=run
    )


STUDIES = tuple(_study(figure) for figure in FIGURES.values())

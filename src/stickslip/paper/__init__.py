"""The figures of the paper: data, picture, and the claims that the data must satisfy,
with verdicts.

>>> from stickslip.paper import FIGURES
>>> figure = FIGURES["fig2"]
>>> data = figure.compute(quick=True)
>>> picture = figure.draw(data)
>>> all(claim.ok for claim in figure.check(data))
True
"""

from stickslip.errors import InputError
from stickslip.paper import ageing, delay, instability, ramps
from stickslip.paper.cases import CASES, PaperCase
from stickslip.paper.figure import (
    Claim,
    Figure,
    Format,
    Measured,
    Reproduction,
    Verdict,
    places,
    reproduce,
)

__all__ = [
    "CASES",
    "FIGURES",
    "Claim",
    "Figure",
    "Format",
    "Measured",
    "PaperCase",
    "Reproduction",
    "Verdict",
    "figures_named",
    "places",
    "reproduce",
]

_FIGURES = [
    figure for room in (instability, delay, ageing, ramps) for figure in room.FIGURES
]
FIGURES = {
    figure.name: figure
    for figure in sorted(_FIGURES, key=lambda figure: int(figure.name[3:]))
}
"""The figures by name, from ``"fig1"``, in the order of the paper."""


def figures_named(name: str) -> tuple[Figure, ...]:
    """Return one figure, or all for ``"all"``; `InputError` if there is none."""
    if name == "all":
        return tuple(FIGURES.values())
    if name not in FIGURES:
        raise InputError(
            f"{name}: no such figure; there are {', '.join(FIGURES)}, or all"
        )
    return (FIGURES[name],)

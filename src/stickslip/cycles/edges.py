"""The scan along a parameter, its points, and the edges found between them."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Self

import numpy as np

from stickslip.answers import Answer
from stickslip.cycles.cycle_run import METHOD, CycleRun, check_rig, work_of_run
from stickslip.cycles.oscillation_verdict import Verdict, settle
from stickslip.errors import InputError, number
from stickslip.loops import bounded
from stickslip.model import Start
from stickslip.model.parameters import Parameter, parameter_named
from stickslip.model.rig import Ends, Rig
from stickslip.progress import in_time
from stickslip.simulation.estimates import LONGEST, announce
from stickslip.stability.critical import Along

EdgeKind = Literal[
    "decay", "fold", "linear", "shrinks to nothing", "end of range", "undecided"
]

# relative width of a bracket: runs closer to a fold stay long near the cycle that has
# just ceased to exist
TOLERANCE = 3e-3


@dataclass(frozen=True, kw_only=True, repr=False)
class Edge(Answer):
    """An end of an interval of a parameter."""

    #: for an edge that runs have bracketed, the geometric mean of the bracket
    value: float

    #: *Decay*: beyond it an oscillation from the start decays (nonlinear). *Fold*: the
    #: branch of the cycle ends there at a finite amplitude (nonlinear). *Linear*:
    #: smooth sliding loses stability there. *Shrinks to nothing*: the cycle does, where
    #: smooth sliding regains stability. *End of range*: the edge lies outside the range
    #: searched. *Undecided*: runs beyond it do not decide.
    kind: EdgeKind

    #: value on the far side at which a run decays; `value` if runs do not decide
    decays_at: float
    persists_at: float  #: value on the near side at which a run persists

    @classmethod
    def of(
        cls,
        kind: EdgeKind,
        decays_at: float,
        persists_at: float | None = None,
    ) -> Self:
        """Return an edge at one value, or bracketed by runs at two values."""
        persists_at = decays_at if persists_at is None else persists_at
        return cls(
            value=math.sqrt(decays_at * persists_at),
            kind=kind,
            decays_at=decays_at,
            persists_at=persists_at,
        )

    @property
    def error(self) -> float:
        """Half the width of the bracket."""
        return 0.5 * abs(self.decays_at - self.persists_at)

    def __str__(self) -> str:
        if self.kind == "decay":
            return f"{self.value:.4g} (± {self.error:.1g})"
        return f"{self.value:.5g} ({_KINDS.get(self.kind, self.kind)})"


_KINDS = {
    "fold": "stick-slip decays: fold",
    "linear": "smooth sliding loses stability: linear",
    "end of range": "end of the range searched",
}


@dataclass(frozen=True, kw_only=True, repr=False)
class Interval(Answer):
    """An interval of a parameter with the kinds of its ends."""

    low: Edge
    high: Edge

    def __contains__(self, value: float) -> bool:
        return self.low.value <= value <= self.high.value

    def __str__(self) -> str:
        return f"from {self.low} to {self.high}"


@dataclass(frozen=True, kw_only=True, repr=False)
class Intervals(Along[Interval]):
    """Intervals found along a parameter, in the rig's own units; iterating yields
    them.
    """

    def __contains__(self, value: float) -> bool:
        return any(value in interval for interval in self)


class CyclePoint(NamedTuple):
    """The settled state of a run, at one value of a parameter."""

    value: float
    verdict: Verdict
    run: CycleRun


class ParameterScan:
    """A range of a parameter, in the rig's own units, searched with runs from one start
    to a tolerance.

    Raises `InputError` if no cycle can be followed on the rig, or the parameter or the
    range is invalid.
    """

    def __init__(
        self,
        rig: Rig,
        parameter: Parameter | str,
        between: Ends,
        start: Start,
        *,
        tolerance: float,
        step: float = 0.5,
    ) -> None:
        check_rig(rig, start, METHOD)
        self.rig = rig
        self.parameter = parameter_named(parameter)
        self.start = start
        self.size = rig.unit(self.parameter.unit)
        self.unit = rig.unit_name(self.parameter.unit)
        self.low, self.high = (
            end * self.size for end in rig.span(self.parameter, between)
        )
        self.tolerance = number("tolerance", tolerance, above=0, below=1)
        self.step = number("step", step, above=0, below=1)

    @property
    def steps(self) -> int:
        """Number of steps over the range."""
        return math.ceil(math.log(self.high / self.low) / self.step)

    @property
    def about(self) -> dict[str, Any]:
        """The parameter, its unit and the range, as fields of an answer."""
        return {
            "parameter": self.parameter.name,
            "unit": self.unit,
            "searched": (self.low, self.high),
        }

    def check_work(self, runs: int) -> None:
        """Announce a search of this many runs if it takes more than a minute; raise
        `InputError` if it takes more than an hour.
        """
        low, high = (
            work_of_run(self.parameter.set(self.rig, end / self.size), self.start)
            for end in (self.low, self.high)
        )
        # mean over values in equal ratios, for a time that is a power of the value
        each = np.geomspace(low.seconds, high.seconds, 100).mean()
        seconds = runs * float(each)
        longest = max(low, high, key=lambda work: work.seconds).longest
        what = f"{runs} runs, the longest of {longest.what}"
        ends = f"from {self.in_words(self.low)} to {self.in_words(self.high)}"
        name = f"{self.parameter.name} {ends}"
        if seconds > LONGEST:
            raise InputError(
                f"{name}: {what}, would take about {in_time(seconds)}; give a part of "
                "the range, or look less closely"
            )
        announce(name, seconds, what)

    def grid(self, count: int) -> list[float]:
        """Return values over the range, in equal ratios."""
        values: list[float] = np.geomspace(self.low, self.high, count).tolist()
        return values

    def settled(self, value: float, after: CycleRun | None = None) -> CyclePoint:
        """Run until the amplitude settles, from the start or another value's run."""
        rig = self.parameter.set(self.rig, value / self.size)
        run = (
            CycleRun.begin(rig, self.start, METHOD)
            if after is None
            else after.turned(rig)
        )
        return CyclePoint(value, *settle(run))

    def in_words(self, *values: float) -> str:
        """Return values of the parameter as text."""
        return ", ".join(
            self.rig.in_units(value / self.size, self.parameter.unit)
            for value in values
        )


_HALVINGS = 64  # 53 for the bits of a number, and 10 for the range of its logarithm


def halved(
    probe: Callable[[float], bool | None],
    fails_at: float,
    holds_at: float,
    tolerance: float,
) -> tuple[float, float]:
    """Bisect between a value at which a test fails and one at which it holds, to a
    width of the logarithm.

    It stops early if `probe` does not decide, and returns None.
    """
    turns = bounded("halved", _HALVINGS)
    while abs(math.log(fails_at / holds_at)) > tolerance:
        next(turns)
        middle = math.sqrt(fails_at * holds_at)
        answer = probe(middle)
        if answer is None:
            break
        fails_at, holds_at = (fails_at, middle) if answer else (middle, holds_at)
    return fails_at, holds_at

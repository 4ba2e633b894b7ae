"""How a rig is simulated: the method, what is recorded, and the state that a run starts from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from stickslip.errors import instance, number, sequence, whole

if TYPE_CHECKING:
    from stickslip.model.units import Scales


@dataclass(frozen=True)
class Contacts:
    """Method: `count` contacts, event by event, exact for their number.

    Parameters
    ----------
    count : int
        Number of contacts ``N``.
    seed : int
        The same seed gives the same run, bit for bit, whatever is recorded. (With thresholds that age, other times
        of recording may be other steps, and give another run of the same distribution.)
    """

    count: int = 10_000
    seed: int = 0

    def __post_init__(self) -> None:
        # 1e8 contacts take some 15 GB.
        count = whole("Contacts.count", self.count, at_least=1, at_most=100_000_000, hint="number of contacts N")
        object.__setattr__(self, "count", count)
        object.__setattr__(self, "seed", whole("Contacts.seed", self.seed, at_least=0, at_most=2**128))


@dataclass(frozen=True, kw_only=True)
class MasterEquation:
    """Method: the master equation, Eqs. (1)-(4), on cohorts: the limit of infinitely many contacts.

    Parameters
    ----------
    cells : int
        Resolution: cohorts per ``x_s`` of motion. The error falls as ``cells**-2``. With thresholds that age it is
        the kinetic equation that is solved, with a sixteenth as many cohorts, and ``cells/40`` cells of the gap per
        standard deviation, in steps of at most ``4/cells`` times ``rate**-2`` and ``x_s``; the error falls as
        ``cells**-2``, too (400: 0.1 % of the steady force up to ``velocity = rate**2``, peaks to 0.5 %).
    memoryless : bool
        Use the paper's approximation, Eq. (10), for the detached contacts in place of the true delay. It has no
        memory and gives an oscillation of its own; for comparison only.
    """

    cells: int = 400
    memoryless: bool = False

    def __post_init__(self) -> None:
        cells = whole("MasterEquation.cells", self.cells, at_least=10, at_most=100_000, hint="cohorts per x_s")
        object.__setattr__(self, "cells", cells)
        instance("MasterEquation.memoryless", self.memoryless, bool, "True or False")


@dataclass(frozen=True, kw_only=True)
class PaperClosure:
    """Method: the paper's own equations for ageing thresholds, Eqs. (1)-(3) with (18); for comparison only.

    They keep one distribution of thresholds for all contacts, whatever their stretching: the correlation between age
    and stretching is lost. Against `Contacts` and `MasterEquation` the force of smooth sliding is 23 % too large at
    ``v = .01 rate**2``, 9 % too small at .5 and 28 % too small at 1 (standard deviation .1). For `Langevin` ageing
    without delay.

    Parameters
    ----------
    cells : int
        Resolution: cohorts per ``x_s`` of motion are a quarter of it, cells of threshold per standard deviation a
        fiftieth. The error falls as ``1/cells``.
    """

    cells: int = 400

    def __post_init__(self) -> None:
        cells = whole("PaperClosure.cells", self.cells, at_least=10, at_most=100_000, hint="four times the cohorts")
        object.__setattr__(self, "cells", cells)


Method = Contacts | MasterEquation | PaperClosure


@dataclass(frozen=True, kw_only=True)
class Output:
    """What to record.

    Parameters
    ----------
    interval : float, optional
        Time between samples; by default some fine fraction of the run that resolves the oscillation of the slider.
    snapshots : tuple of float
        Times at which to record the distribution of stretchings ``Q(x)``.
    bins : int
        Bins of a snapshot.
    """

    interval: float | None = None
    snapshots: tuple[float, ...] = ()
    bins: int = 200

    def __post_init__(self) -> None:
        if self.interval is not None:
            object.__setattr__(self, "interval", number("Output.interval", self.interval, above=0))
        looks = sequence("Output.snapshots", self.snapshots, "times, such as (1.0, 2.5)")
        times = tuple(number(f"Output.snapshots[{i}]", t, at_least=0) for i, t in enumerate(looks))
        object.__setattr__(self, "snapshots", tuple(sorted(times)))
        object.__setattr__(self, "bins", whole("Output.bins", self.bins, at_least=1, at_most=100_000))

    def scaled(self, scales: Scales) -> Output:
        """Return an output whose times are in SI units as one in natural units."""
        time = scales.size("time")
        interval = None if self.interval is None else self.interval / time
        return Output(interval=interval, snapshots=tuple(t / time for t in self.snapshots), bins=self.bins)


@dataclass(frozen=True)
class FromRest:
    """Start: slider at rest, spring unstretched, contacts with the interface's initial distribution."""


@dataclass(frozen=True, kw_only=True)
class FromSliding:
    """Start: steady smooth sliding at the drive's first velocity, contacts detached as they then are on average.

    Parameters
    ----------
    perturbation : float
        Added to the slider's velocity, as a fraction of it: whether it decays or grows tells the stability.
    """

    perturbation: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "perturbation", number("FromSliding.perturbation", self.perturbation))


Start = FromRest | FromSliding

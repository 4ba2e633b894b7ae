"""How a rig is simulated: the method, the recorded output, and the initial state."""

from dataclasses import dataclass, field
from typing import Annotated

from stickslip.errors import InputError, refused
from stickslip.model.body import ElasticBody
from stickslip.model.records import Number, Record, registry

Seed = Annotated[int, Number(at_least=0, at_most=2**128)]

METHODS, register = registry("method")
"""The methods that rig files can name; ``@register("contacts")`` gives a class its
name there.
"""


@register("contacts")
@dataclass(frozen=True)
class Contacts(Record):
    """Method: `count` contacts, event by event, exact for their number.

    Parameters
    ----------
    count : int
        Number of contacts ``N``; with an elastic slider, of each block.
    seed : int
        The same seed gives the same run, bit for bit, whatever is recorded. (With
        thresholds that age, other recording times may change the time steps, and give
        another run of the same distribution.)
    """

    # 1e8 contacts take some 15 GB.
    count: Annotated[
        int, Number(at_least=1, at_most=100_000_000, hint="number of contacts N")
    ] = 10_000
    seed: Seed = 0


@register("master equation")
@dataclass(frozen=True, kw_only=True)
class MasterEquation(Record):
    """Method: the master equation, Eqs. (1)-(4), the limit of infinitely many contacts,
    solved to a given error.

    Parameters
    ----------
    rtol : float
        Error of the forces, in ``f_s`` per contact: root mean square over several
        cycles, within a factor of 10. It sets the time steps, and is the relative error
        of the work of the drive. With thresholds that age by `Langevin` the kinetic
        equation is solved instead, at a resolution whose error in the steady force is
        ten times `rtol`, up to ``velocity = rate**2``
        (default: 0.1 %, peaks to 0.5 %).
    memoryless : bool
        Use the paper's approximation, Eq. (10), for the detached contacts in place of
        the true delay. It has no memory and gives an oscillation that the true delay
        does not have; for comparison only.
    """

    rtol: Annotated[
        float, Number(at_least=1e-10, at_most=0.1, hint="error of the force")
    ] = 1e-4
    memoryless: bool = False


@register("population")
@dataclass(frozen=True)
class Population(Record):
    """Method: any number of contacts, counted by cohorts, at a cost that does not
    depend on their number.

    Contacts that attached together form a cohort, and the number of them that break is
    drawn from a binomial distribution, by the distribution of thresholds. Mean,
    variance, spectrum and cycles are those of `Contacts`, to the tolerance; single
    contacts are not tracked.

    Parameters
    ----------
    count : int
        Number of contacts ``N``; with an elastic slider, of each block.
    seed : int
        The same seed gives the same run, bit for bit, whatever is recorded. (Where a
        piece of the drive ends on a condition, other times of recording may give
        another run of the same distribution.)
    rtol : float
        Error of the mean motion, as for `MasterEquation`. At most a fraction
        ``.02 sqrt(rtol/1e-4)`` of the contacts breaks in a step. Fluctuations faster
        than a few steps are too weak: while the slider moves .1 ``x_s``, by 7 % at
        1e-4 and by a third of that at 1e-5.

    Examples
    --------
    >>> interface = ss.Interface(
    ...     thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1)
    ... )
    >>> slider = ss.Slider(stiffness=2.0, mass=1e-4, damping=200.0)
    >>> run = ss.simulate(
    ...     ss.Rig(interface, slider, ss.constant(1.0, duration=1.0)),
    ...     method=ss.Population(1_000_000),
    ... )
    >>> float(run.attached[0])
    1.0
    """

    # Beyond this number the survival of thresholds, a double, does not resolve a single
    # contact.
    count: Annotated[
        int, Number(at_least=1, at_most=1_000_000_000, hint="number of contacts N")
    ] = 1_000_000
    seed: Seed = 0
    rtol: Annotated[
        float, Number(at_least=1e-6, at_most=0.1, hint="error of the force")
    ] = 1e-4


@register("quasi-static")
@dataclass(frozen=True)
class QuasiStatic(Record):
    """Method: `count` contacts on each block of an elastic slider, event by event, in
    balance at all times.

    There is no inertia or damping: between events the body moves only with the drive,
    and a slip is an instantaneous cascade of breaks. This is accurate where the drive
    is much slower than everything else, and hundreds of times faster there.

    Parameters
    ----------
    count : int
        Number of contacts of each block.
    seed : int
        The same seed gives the same run, bit for bit, and the same contacts as
        `Contacts`.
    """

    count: Annotated[
        int,
        Number(at_least=1, at_most=100_000_000, hint="number of contacts of a block"),
    ] = 100
    seed: Seed = 0


@dataclass(frozen=True)
class Renewal(Record):
    """Method of `rigid_slide`: the master equation as a renewal equation, solved by
    fast convolution.

    `points` is the number of intervals of the grid of positions; the error falls as
    ``points**-6`` for smooth distributions.
    """

    points: Annotated[int, Number(at_least=8, at_most=10_000_000)] = 4096


# the methods with a number of contacts and a seed
DRAWN = (Contacts, Population, QuasiStatic)

Method = Contacts | MasterEquation | Population | QuasiStatic


@dataclass(frozen=True, kw_only=True)
class Output(Record):
    """Samples and snapshots that a run records.

    Parameters
    ----------
    interval : float, optional
        Time between samples; by default some fine fraction of the run that resolves the
        oscillation of the slider.
    snapshots : tuple of float
        Times at which the distribution of stretchings ``Q(x)`` is recorded.
    bins : int
        Number of bins of a snapshot.
    state : bool
        Whether the run keeps its final state, from which another run can continue:
        ``simulate(rig, start=run)``. It changes no number of the run.
    """

    interval: Annotated[float | None, Number("time", above=0)] = None
    snapshots: tuple[
        Annotated[float, Number("time", at_least=0, hint="times, such as (1.0, 2.5)")],
        ...,
    ] = ()
    bins: Annotated[int, Number(at_least=1, at_most=100_000)] = 200
    state: bool = field(default=False, compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "snapshots", tuple(sorted(self.snapshots)))


Profile = Annotated[
    float | tuple[float, ...], Number(hint="a number, or one for each block")
]


@dataclass(frozen=True)
class FromRest:
    """Start: slider at rest, spring unstretched, contacts with the interface's initial
    distribution.
    """

    def __str__(self) -> str:
        return "rest"


@dataclass(frozen=True, kw_only=True)
class FromSliding(Record):
    """Start: steady smooth sliding at the drive's first velocity, with the mean number
    of detached contacts of that state.

    Parameters
    ----------
    perturbation : float or tuple of float
        Added to the slider's velocity, as a fraction of it; whether it decays or grows
        shows the stability. For an elastic slider a number for all blocks, or one for
        each.
    at_rest : int
        For an elastic slider, number of first blocks that are at rest instead, in
        balance, their contacts with the interface's initial distribution: stick-slip
        and smooth sliding side by side.
    """

    perturbation: Profile = 0.0
    at_rest: Annotated[int, Number(at_least=0, hint="number of blocks")] = 0

    def __str__(self) -> str:
        given = self.perturbation
        largest = max(map(abs, given if isinstance(given, tuple) else (given,)))
        perturbed = f" at a velocity perturbed by {100 * largest:.3g} %"
        blocks = f", the first {self.at_rest} blocks at rest"
        return f"smooth sliding{perturbed * (largest > 0)}{blocks * (self.at_rest > 0)}"


@dataclass(frozen=True, kw_only=True)
class Prestressed(Record):
    """Start: an elastic slider at rest on stretched contacts, in balance, and a push
    that starts its motion.

    All contacts of a block have the same stretching, whatever the interface's initial
    distribution. Driving springs balance them with the drive at 0; a block without one
    is balanced by a constant force.

    Parameters
    ----------
    stretching : float or tuple of float
        Stretching of the contacts, in ``x_s``: one for all blocks, or one for each.
    push : float
        Additional constant force on each pushed block, in ``f_s`` per contact.
    pushed_blocks : int
        Number of blocks that are pushed, from the first on; in a `Sheet`, of each row.

    Examples
    --------
    >>> ss.Prestressed(stretching=0.6, push=3.0, pushed_blocks=3).push
    3.0
    """

    stretching: Profile
    push: Annotated[
        float, Number("f_s", hint="force on each pushed block, per contact")
    ] = 0.0
    pushed_blocks: Annotated[
        int, Number(at_least=1, hint="number of pushed blocks")
    ] = 1


Start = FromRest | FromSliding | Prestressed


def check_start(start: object, body: object) -> None:
    """Raise `InputError` if a `Prestressed` start does not fit the number of blocks of
    an elastic body.
    """
    if not (isinstance(start, Prestressed) and isinstance(body, ElasticBody)):
        return
    profile = start.stretching
    if isinstance(profile, tuple) and len(profile) != body.size:
        raise InputError(
            f"Prestressed.stretching: has {len(profile)} numbers for {body.size} "
            "blocks; give one, or one for each",
            "Prestressed.stretching",
        )
    along = body.size // body.rows
    if start.pushed_blocks > along:
        most = f"must be at most {along}, all there are"
        raise refused("Prestressed.pushed_blocks", start.pushed_blocks, most)

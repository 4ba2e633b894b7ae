"""Thresholds that age by Langevin, Eqs. (13)-(17): N contacts, and their kinetic
equation.
"""

import math
from typing import ClassVar, Protocol

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import InputError
from stickslip.kernels import time_steps
from stickslip.kernels.drive import Quadratic, Stop, drive_at, holds
from stickslip.kernels.langevin import Langevin as Constants
from stickslip.kernels.langevin_contacts import SLEEP, advance_contacts, awake
from stickslip.kernels.langevin_density import (
    Cohorts,
    advance_density,
    cell_widths,
    density_nodes,
)
from stickslip.kernels.oscillator import is_rigid
from stickslip.model import Contacts, Delay, Interface, Langevin, MasterEquation
from stickslip.model.distributions import SteadyState
from stickslip.model.newborn import stretching_nodes
from stickslip.model.rig import Rig
from stickslip.simulation.engines.base import (
    HEAT,
    MOTION,
    Advance,
    Beginning,
    Engine,
    Individuals,
    Leg,
    Stretchings,
    advances,
    looks_aside,
    slider_constants,
    solves,
)
from stickslip.simulation.engines.start import (
    first_contacts,
    generators,
    lifetimes_in,
)
from stickslip.simulation.estimates import (
    Course,
    Part,
    breaking,
    oscillation,
    travel_of,
)
from stickslip.sliding.langevin import ageing_constants
from stickslip.sliding.lifetimes import hazard_of

# largest step of N contacts in units of ``1/rate**2``, and of the slider in mean
# breaking displacements
_STEP = 0.02
# Largest step of a free slider in units of the contacts' memory, as it responds to the
# force of the step before. At 0.12 the force fluctuates as in the limit of small steps,
# to some 5 %; the kinetic equation is solved to second order and allows longer steps.
_OF_MEMORY = 0.12
_OF_MEMORY_DENSITY = 0.25
_TAKEN, _ASLEEP, _LOOK, _HOT = 5e-7, 1.7e-9, 3e-8, (9e-6, 8e-6)
"""Seconds of a step, of a sleeping contact in it, and of checking a contact; with
thermal activation those of an ageing time, and of a break.
"""
_CONTACT = 150.0  # bytes of a contact
# delays drawn, from which contacts choose; one suffices if all are equal
_POOL = 65_536
# seconds of the cohorts per ageing time or mean threshold, for an error of 1e-4; the
# method is of second order
_AGED = 9.6e-3
_CELL = 3.5e-8  # seconds of a cell of a cohort in a step; the smaller estimate counts
# steps of a contact in an advance; with thermal activation each has many sub-steps
_BUDGET = 500_000
_HOT_BUDGET = 25_000


def _memory(constants: Constants, speed: float) -> float:
    """Return the memory of contacts at a sliding speed: the relaxation time of their
    margins at the boundary, plus the life of a newborn.

    It is infinite where the slider is too slow to make them all break.
    """
    square = constants.rate**2
    fall = speed - square * constants.mean
    if fall <= 0.0:
        return math.inf
    noise = 2.0 * square * constants.std**2
    return noise / fall**2 + constants.newborn / fall


def _longest(constants: Constants, part: float, *speeds: float) -> float:
    """Return the largest step of a free slider, a fraction `part` of the contacts'
    memory, on a piece of the drive with these speeds at its ends.

    The memory is that at the speed of the drive, as a faster slider slips and does not
    slide smoothly.
    """
    return part * _memory(constants, max(abs(speed) for speed in speeds))


def _remembered(rig: Rig, part: float) -> float:
    """Return the least number of steps of a run that the contacts' memory requires."""
    constants = ageing_constants(rig.natural.interface)
    return sum(
        piece.duration / _longest(constants, part, piece.start, piece.end)
        for piece in rig.natural.drive.pieces
    )


def _cohorts(rig: Rig, step: float) -> float:
    """Return the mean number of cohorts of the density over a run: in each step, the
    number of steps of the slider in the life of a contact.
    """
    constants = ageing_constants(rig.natural.interface)
    steps = 0.0
    cohorts = 0.0
    for piece in rig.natural.drive.pieces:
        speed = max(abs(piece.start), abs(piece.end))
        memory = _memory(constants, speed)
        reach = min(speed * memory / constants.mean, 1.0) if memory < math.inf else 1.0
        free = piece.duration / (_OF_MEMORY_DENSITY * memory)
        taken = max(free, travel_of(piece) / (step * constants.mean))
        steps += taken
        cohorts += taken * (1.0 + reach / step)
    return cohorts / steps if steps else 1.0


class Steps(Engine, Protocol):
    """An engine that advances in time steps, and samples no energies."""

    columns: ClassVar[tuple[str, ...]] = MOTION
    # that of its steps: finer samples would show no more
    angle: ClassVar[float] = 0.35

    _constants: Constants
    state: Array  # time, position of the slider, and more that the kernel keeps there
    longest: float  # largest time step
    reach: float  # largest displacement of the slider in a step
    remembered: float  # largest step of a free slider over the contacts' memory
    budget: int  # steps in an advance: some 50 ms

    def take(self, course: time_steps.Course) -> Array:
        """Follow a course, and return the samples of `stickslip.kernels.time_steps`."""
        ...

    def here(self) -> tuple[float, float]:
        """Time, and position of the slider."""
        return float(self.state[0]), float(self.state[1])

    def advance(self, leg: Leg) -> Advance:
        """Advance by several steps, at most to the one that would pass a snapshot."""
        times = np.minimum(leg.times, leg.end)
        wanted = times.size
        if wanted == 0 or times[-1] < leg.end:
            times = np.append(times, leg.end)
        before = self.here()[0]
        longest = self.longest
        if not is_rigid(self.slider):
            speeds = (drive_at(leg.drive, t)[1] for t in (leg.drive.start, leg.end))
            longest = min(longest, _longest(self._constants, self.remembered, *speeds))
        look = leg.looks[0] if leg.looks else math.inf
        course = time_steps.Course(
            leg.drive,
            self.slider,
            times,
            longest,
            self.reach,
            leg.stop,
            look,
            self.budget,
        )
        samples = self.take(course)[:wanted]
        now = self.here()[0]
        stopped = len(samples) > 0 and holds(leg.stop, samples[-1, 0], samples[-1, 2])
        over = stopped or now >= leg.end
        # A course without a step is just before its snapshot.
        seen = looks_aside(self, leg, look if now == before and not over else now)
        return Advance(samples[:, [0, 1, 3, 4]], seen, over)

    def settle(self, beginning: Beginning) -> None:
        """Set the slider to its start; where it slides, first drive it rigidly, without
        samples, up to time and position 0.
        """
        if beginning.sliding:
            self.slider = slider_constants(None)
            leg = Leg(
                Quadratic(*self.here(), beginning.velocity, 0.0),
                0.0,
                np.empty(0),
                Stop(),
            )
            for _ in advances(self, leg):
                pass
            self.state[:2] = 0.0
        self.state[2] = beginning.slider_velocity
        self.slider = slider_constants(beginning.slider)


def _start(beginning: Beginning, rate: float) -> float:
    """Return the time at which rigid sliding must begin to be steady at time 0: several
    lifetimes and ageing times before.
    """
    if not beginning.sliding:
        return 0.0
    velocity = beginning.velocity
    delay = beginning.interface.delay.moment(1)
    return (
        -5.0 * (beginning.interface.threshold_distribution.moment(1) / velocity + delay)
        - 5.0 / rate**2
    )


def _settling(rig: Rig) -> float:
    """Return the time of rigid sliding before a run begins."""
    assert isinstance(rig.interface.ageing, Langevin)
    case = rig.natural
    beginning = Beginning(case.interface, case.slider, case.velocity, case.start)
    return -_start(beginning, rig.interface.ageing.rate)


def _way_settled(rig: Rig) -> float:
    """Return the distance of rigid sliding before a run begins, in mean thresholds."""
    mean = rig.natural.interface.threshold_distribution.moment(1)
    return abs(rig.natural.velocity) * _settling(rig) / mean


def _cost(
    rig: Rig,
    course: Course,
    aged: float,
    part: Part,
) -> tuple[Part, ...]:
    """Return the work of a run, by part; an ageing time costs `aged` seconds, at rest
    as well as in motion.
    """
    assert isinstance(rig.interface.ageing, Langevin)
    rate = rig.interface.ageing.rate
    ages = (rig.drive.duration + _settling(rig)) * rate**2
    ageing = Part(
        "interface.ageing.time",
        rate**-2,
        "time",
        -1.0,
        f"{ages:.2g} times of ageing",
        aged * ages,
    )
    return *oscillation(rig, course.rung), part, ageing


@solves(Contacts, Langevin)
@solves(Contacts, Langevin, activation=HEAT)
class LangevinContacts(Steps):
    """N contacts in small steps, with exact times of breaking:
    `stickslip.kernels.langevin_contacts`.
    """

    mechanisms = frozenset({"activation"})
    remembered = _OF_MEMORY

    def __init__(self, beginning: Beginning, method: Contacts) -> None:
        initial, self._rng, delays = generators(method.seed)
        self._constants = ageing_constants(beginning.interface)
        self._hazard = hazard_of(beginning.interface.activation)
        cold = beginning.interface.activation is None
        self.budget = max((_BUDGET if cold else _HOT_BUDGET) // method.count, 1)
        self.longest = _STEP / self._constants.rate**2
        self.reach = _STEP * self._constants.mean
        delay = beginning.interface.delay
        self._delays = delay.sample(delays, 1 if isinstance(delay, Delay) else _POOL)
        x, threshold, pending = first_contacts(beginning, method.count, initial)
        start = _start(beginning, self._constants.rate)
        attach = np.append(
            np.full(method.count - pending.size, -math.inf), pending + start
        )
        self.state = np.array([start, beginning.velocity * start, 0.0, 0.0])
        self._contacts = awake(x, threshold, attach, self.state[0], self.state[1])
        self.settle(beginning)

    @staticmethod
    def check(interface: Interface) -> None:
        """Raise `InputError` for thresholds that cannot age by `Langevin`."""
        ageing_constants(interface)

    @staticmethod
    def cost(rig: Rig, method: Contacts, course: Course) -> tuple[Part, ...]:
        """Return the work of a run, by part."""
        count = method.count
        thresholds = rig.interface.threshold_distribution
        remembered = _remembered(rig, _OF_MEMORY)
        if rig.interface.activation is not None:
            broken = breaking(
                count,
                lifetimes_in(rig, course)[0],
                _HOT[1],
                _CONTACT,
                " by thermal activation",
                _HOT[0] * _STEP * count * remembered,
            )
            return _cost(rig, course, _HOT[0] * count, broken)
        # In a step of a moving slider all contacts are checked; in a step of ageing
        # only those with margins too small for sleep, if margins are uniform up to the
        # mean. A larger margin sleeps for a time proportional to its square, which
        # doubles the number of checks.
        moved = max((course.distance + course.shaken) / _STEP, remembered)
        moved += _way_settled(rig) / _STEP
        step = _TAKEN + count * _ASLEEP
        awake = (
            math.sqrt(2.0 * _STEP / SLEEP)
            * thresholds.standard_deviation()
            / thresholds.moment(1)
        )
        seconds = (step + count * _LOOK) * moved
        what = f"{moved:.2g} steps of {count:.2g} contacts"
        looks = Part(
            "simulation.contacts",
            count,
            None,
            1.0,
            what,
            seconds,
            _CONTACT * count,
        )
        return _cost(
            rig,
            course,
            (step + count * _LOOK * min(2.0 * awake, 1.0)) / _STEP,
            looks,
        )

    def stretchings(self) -> Stretchings:
        """Return the current stretchings of the attached contacts."""
        x, held = self.individuals()
        return Stretchings(
            x[held],
            np.full(np.count_nonzero(held), 1.0 / x.size),
            cells=False,
        )

    def individuals(self) -> Individuals:
        """Return the current stretching of each contact."""
        return Individuals(
            self._contacts.stretching + self.state[1],
            self._contacts.attach <= self.state[0],
        )

    def take(self, course: time_steps.Course) -> Array:
        """Follow a course, and return the samples."""
        model = self._constants, self._hazard, self._delays
        try:
            return advance_contacts(
                self.state,
                self._contacts,
                course,
                *model,
                self._rng,
            )
        except RuntimeError as error:  # a contact breaks endlessly
            raise InputError(str(error)) from None


@solves(MasterEquation, Langevin)
class LangevinDensity(Steps):
    """The kinetic equation on cohorts: `stickslip.kernels.langevin_density`."""

    remembered = _OF_MEMORY_DENSITY

    def __init__(self, beginning: Beginning, method: MasterEquation) -> None:
        self._constants = ageing_constants(beginning.interface)
        cells = _cells_of_density(method.rtol)
        step = 4.0 / cells
        self.longest = step / self._constants.rate**2
        self.reach = step * self._constants.mean
        # each step takes about cells^2 cells of the density
        self.budget = math.ceil(8e7 / cells**2)
        self._nodes = density_nodes(self._constants, cells / 40.0)
        cohorts = _first_cohorts(beginning, self._nodes, 4.0 * self.reach)
        count = cohorts[0].size
        room = math.ceil(self._nodes[-1] / self.reach) + 3
        self._cohorts = Cohorts(
            *(np.append(part, np.zeros((room, *part.shape[1:])), 0) for part in cohorts)
        )
        start = _start(beginning, self._constants.rate)
        self.state = np.array(
            [start, beginning.velocity * start, 0.0, 0.0, count, 0.0, 0.0, 0.0]
        )
        self._cohorts.place[:] += self.state[1]
        self.settle(beginning)
        self.state[6:] = 0.0

    @staticmethod
    def check(interface: Interface) -> None:
        """Raise `InputError` for thresholds that cannot age by `Langevin`, and for a
        delay.
        """
        ageing_constants(interface)
        if interface.delay.moment(1) > 0:
            raise InputError(
                f"Interface.delay = {interface.delay}: not available with "
                "MasterEquation together with "
                f"ageing = {interface.ageing}; use Contacts"
            )

    @staticmethod
    def cost(rig: Rig, method: MasterEquation, course: Course) -> tuple[Part, ...]:
        """Return the work of a run, by part."""
        settled = _way_settled(rig)
        aged = _AGED * 1e-4 / method.rtol
        step = 4.0 / _cells_of_density(method.rtol)
        # Steps of a ringing slider are longer, and theory does not count its slips.
        steps = (course.distance + course.shaken) / step
        remembered = _remembered(rig, _OF_MEMORY_DENSITY)
        taken = max(steps, remembered) + settled / step
        constants = ageing_constants(rig.natural.interface)
        cells = density_nodes(constants, _cells_of_density(method.rtol) / 40.0).size
        each = _CELL * cells * (_cohorts(rig, step) + 0.5)
        # Steps by displacement vary as the root of rtol, steps by memory do not.
        part = Part(
            "simulation.rtol",
            method.rtol,
            None,
            -1.0 if steps > remembered else -0.5,
            f"{taken:.2g} steps of cohorts",
            min(aged * step, each) * taken,
        )
        return _cost(rig, course, aged, part)

    def stretchings(self) -> Stretchings:
        """Return the current mean stretchings of the cohorts."""
        fraction = self._cohorts.mass.sum(axis=1)
        kept = fraction > 0.0
        place = (
            self._cohorts.place[kept]
            + self._cohorts.moment[kept].sum(axis=1) / fraction[kept]
        )
        return Stretchings(self.state[1] - place, fraction[kept], cells=True)

    def take(self, course: time_steps.Course) -> Array:
        """Follow a course, and return the samples."""
        return advance_density(
            self.state,
            self._cohorts,
            self._nodes,
            course,
            self._constants,
        )


def _cells_of_density(rtol: float) -> float:
    """Return the number of cells for an error `rtol` of a run, by second order.

    The largest step is 4/cells, in units of ``1/rate**2`` for time and of mean
    thresholds for the slider.
    """
    return 400.0 * math.sqrt(1e-4 / rtol)


def _first_cohorts(
    beginning: Beginning,
    margins: Array,
    width: float,
) -> tuple[Array, Array, Array]:
    """Return cohorts of contacts whose stretchings differ by no more than `width`, with
    the slider at 0.

    They are given by the places where they attached, the fraction of contacts by cohort
    and rupture margin, and its first moment about these places.
    """
    distribution = beginning.interface.threshold_distribution
    initial = (
        SteadyState(thresholds=distribution)
        if beginning.sliding
        else beginning.interface.initial
    )
    x, fraction = stretching_nodes(initial, distribution)
    kept = fraction > 1e-12
    x = x[kept]
    fraction = fraction[kept]
    mass = distribution.density(margins + np.abs(x)[:, None]) * cell_widths(margins)
    mass[:, 0] = 0.0  # no contact is on its boundary
    mass *= (fraction / mass.sum(axis=1) / fraction.sum())[:, None]
    # Contacts stretched backward and forward go into different cohorts: as the slider
    # moves, the margins of the former widen and those of the latter narrow.
    _, into = np.unique(np.floor(x / width), return_inverse=True)
    place = -np.bincount(into, fraction * x) / np.bincount(into, fraction)
    together, moment = np.zeros((2, place.size, margins.size))
    np.add.at(together, into, mass)
    np.add.at(moment, into, mass * (-x - place[into])[:, None])
    return place, together, moment

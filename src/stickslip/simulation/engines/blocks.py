"""Elastic sliders: N contacts on each block, breaks located inside the steps: `stickslip.kernels.blocks`."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import InputError
from stickslip.kernels import block_cohorts, blocks, leapfrog, quasistatic
from stickslip.kernels.blocks import Draws
from stickslip.kernels.cohort_store import ALIVE, PLACE, Delays, longer
from stickslip.kernels.drive import DELAYS_USED_UP, LOOK, NO_HISTORY, NO_ROOM, PAUSED, THRESHOLDS_USED_UP, UNSOLVED
from stickslip.kernels.leapfrog import Motion, Piece, Sampling, at_rest
from stickslip.kernels.network import Network, fastest, stiffest_dashpot
from stickslip.model import (
    Chain,
    Contacts,
    Delay,
    ElasticBody,
    FromRest,
    Interface,
    MasterEquation,
    Prestressed,
    QuasiStatic,
)
from stickslip.model.distribution import check_density
from stickslip.model.rig import Rig
from stickslip.simulation.cost import Course, Part
from stickslip.simulation.engines.base import Advance, Beginning, Engine, Leg, Stretchings, looks_aside, solves
from stickslip.simulation.engines.beginnings import first_contacts, initial_nodes, survival_of

Array = NDArray[np.float64]

SCALARS = (
    "spring_force",
    "work",
    "kinetic_energy",
    "spring_energy",
    "bulk_energy",
    "contact_energy",
    "damped_energy",
    "viscous_energy",
    "broken_energy",
)
"""What samples of an elastic slider begin with, summed over its blocks."""
FIELDS = ("displacement", "velocity", "friction_force", "attached", "broken")
"""What they go on with, each for all blocks."""

MOST_CONTACTS = 100_000_000
"""Of all blocks: some 6 GB."""
ANGLE = 0.05
"""Longest step, in radians of the body's fastest oscillation: speeds of fronts to 1e-4."""
_DASHPOT = 0.2
"""Longest step against the fastest decay in the dashpots."""
_POOL = 256
"""Random numbers drawn at once for a block. The same seed gives another run with another length."""
_MOST_HISTORY = 2e8
"""Steps of a block in the longest delay: 1.6 GB."""
_STEP, _STEP_OF_COHORT, _BREAK, _BALANCE = 1.5e-8, 3e-9, 2.4e-7, 4e-8
"""Seconds a step of a block takes where nothing breaks, and of each of its cohorts; a break; and a block at each break
in balance."""
_CONTACT = 64.0
"""Bytes of a contact."""
_COHORTS = 400
"""Cohorts of a block, about."""
_SAMPLE = 2e-8, 120.0
"""Seconds and bytes a sample of a block takes."""
_BUDGET = 2_000_000
"""Events, or eight steps of a block each, in an advance: some 50 to 200 ms."""


def balanced(beginning: Beginning) -> tuple[Array, Array, Array]:
    """Constant forces on the blocks: all of them, and those that no driving spring carries; and the prestress."""
    body, start = beginning.slider, beginning.start
    assert isinstance(body, ElasticBody)
    if not isinstance(start, Prestressed):
        if not body.pulled.any():
            raise nothing_pulls(body)
        return np.zeros(body.size), np.zeros(body.size), np.zeros(body.size)
    stretching = per_block("Prestressed.stretching", start.stretching, body)
    distribution = beginning.interface.threshold_distribution
    beyond = distribution.survival(np.abs(stretching)) < 1e-9
    if beyond.any():
        raise InputError(
            f"Prestressed.stretching: {stretching[beyond][0]:g} on block {int(np.argmax(beyond))} is not below the "
            f"thresholds ({distribution}); give less"
        )
    along = body.size // body.rows
    if start.pushed_blocks > along:
        raise InputError(f"Prestressed.pushed_blocks = {start.pushed_blocks}: must be at most {along}, all there are")
    push = np.where(np.arange(body.size) % along < start.pushed_blocks, start.push, 0.0)
    return stretching + push, push + np.where(body.pulled > 0, 0.0, stretching), stretching


def per_block(place: str, value: float | tuple[float, ...], body: ElasticBody) -> Array:
    """One number for all blocks, or one for each, as one for each."""
    if isinstance(value, tuple) and len(value) != body.size:
        raise InputError(f"{place}: has {len(value)} numbers for {body.size} blocks; give one, or one for each")
    return np.array(np.broadcast_to(np.asarray(value, dtype=float), body.size))


def network_of(body: ElasticBody, load: Array, push: Array) -> Network:
    """Return a body as the kernels take it."""
    pairs, stiffness = body.links
    ends = np.concatenate([pairs, pairs[:, ::-1]])
    order = np.argsort(ends[:, 0], kind="stable")
    first, second, stiff = ends[order, 0], ends[order, 1], np.tile(stiffness, 2)[order]
    place = np.arange(first.size) - np.searchsorted(first, first)
    most = int(place.max(initial=0)) + 1
    neighbour = np.repeat(np.arange(body.size, dtype=np.int32)[:, None], most, axis=1)
    spring = np.zeros((body.size, most))
    neighbour[first, place], spring[first, place] = second, stiff
    return Network(neighbour, spring, body.pulled, load, push, body.mass, body.damping, body.viscosity / body.coupling)


def settled(beginning: Beginning, friction: Array) -> Array:
    """Displacements of the blocks at the start, in balance with their friction if they slide, else 0."""
    from scipy import sparse
    from scipy.sparse.linalg import spsolve

    body = beginning.slider
    assert isinstance(body, ElasticBody)
    if not beginning.sliding:
        return np.zeros(body.size)
    force = friction + body.mass * body.damping * beginning.velocity * slides(beginning, body)
    pairs, stiffness = body.links
    rows, columns = np.concatenate([pairs, pairs[:, ::-1]]).T
    coupling = sparse.coo_array((np.tile(stiffness, 2), (rows, columns)), shape=(body.size, body.size)).tocsc()
    held = sparse.diags_array(body.pulled + coupling.sum(axis=0)) - coupling
    drive = float(force.sum() / body.pulled.sum())
    return np.asarray(spsolve(held.tocsc(), body.pulled * drive - force)).reshape(body.size)


def nothing_pulls(body: ElasticBody) -> InputError:
    """Say that no spring holds a body."""
    name = type(body).__name__
    return InputError(f"{name}.leaf = 0 and {name}.side = 0: nothing pulls it; give one, or start Prestressed(...)")


def first_velocities(beginning: Beginning, body: ElasticBody) -> Array:
    """Velocities of the blocks at the start."""
    if not beginning.sliding:
        return np.zeros(body.size)
    perturbation = per_block("FromSliding.perturbation", getattr(beginning.start, "perturbation", 0.0), body)
    return np.asarray(beginning.velocity * (1.0 + perturbation) * slides(beginning, body))


def slides(beginning: Beginning, body: ElasticBody) -> NDArray[np.bool_]:
    """Whether each block slides at the start."""
    return np.full(body.size, beginning.sliding) & (np.arange(body.size) >= beginning.at_rest)


def longest_step(network: Network) -> float:
    """Longest step of a body's motion."""
    rate = stiffest_dashpot(network)
    return min(ANGLE / fastest(network), _DASHPOT / rate if rate > 0 else math.inf)


def check_size(body: ElasticBody, count: int) -> None:
    """Raise `InputError` for more contacts than can be held."""
    if body.size * count > MOST_CONTACTS:
        raise InputError(
            f"Contacts.count = {count}: {body.size} blocks would have {body.size * count:.2g} contacts; "
            f"give at most {MOST_CONTACTS // body.size} ({MOST_CONTACTS:.0e} in all)",
            "Contacts.count",
        )


class Streams:
    """Random numbers of each block, which do not depend on how many blocks there are."""

    def __init__(self, interface: Interface, seed: int, blocks: int) -> None:
        self._distribution, self._delay, self._seed = interface.threshold_distribution, interface.delay, seed
        self._generators: dict[tuple[int, int], np.random.Generator] = {}
        fixed = self._delay.time if isinstance(self._delay, Delay) else math.nan
        delays = np.empty((blocks, _POOL if math.isnan(fixed) else 0))
        self.draws = Draws(np.empty((blocks, _POOL)), delays, fixed)

    def of(self, block: int, kind: int) -> np.random.Generator:
        """One of a block's streams: of initial stretchings, of thresholds, and of delays."""
        known = self._generators.get((block, kind))
        if known is None:
            # What SeedSequence(seed).spawn(blocks)[block].spawn(3)[kind] is, without the others.
            seed = np.random.SeedSequence(self._seed, spawn_key=(block, kind))
            known = np.random.Generator(np.random.PCG64(seed))
            if kind:
                self._generators[block, kind] = known
        return known

    def refill_thresholds(self, block: int) -> None:
        """Draw thresholds for a block."""
        self.draws.thresholds[block] = self._distribution.sample(self.of(block, 1), _POOL)

    def refill_delays(self, block: int) -> None:
        """Draw delays for a block."""
        self.draws.delays[block] = self._delay.sample(self.of(block, 2), _POOL)


def contacts_of(beginning: Beginning, streams: Streams, count: int, prestress: Array) -> tuple[Array, Array, Array]:
    """Stretchings, thresholds and times of re-attachment of the contacts of all blocks, shape (blocks, count) each."""
    body = beginning.slider
    assert isinstance(body, ElasticBody)
    x, threshold = np.empty((2, body.size, count))
    waiting = np.full((body.size, count), np.inf)
    distribution = beginning.interface.threshold_distribution
    still = replace(beginning, start=FromRest())
    for j in range(body.size):
        rng = streams.of(j, 0)
        if isinstance(beginning.start, Prestressed):
            x[j] = prestress[j]
            threshold[j] = distribution.sample_beyond(rng, np.abs(x[j]))
        else:
            x[j], threshold[j], pending = first_contacts(still if j < beginning.at_rest else beginning, count, rng)
            waiting[j, count - pending.size :] = pending
    return x, threshold, waiting


class ElasticEngine(Engine):
    """What engines of elastic sliders share: their motion, whatever the contacts are."""

    angle = 0.1
    mechanisms = frozenset({"sliding_force"})
    slider: ElasticBody
    _network: Network
    _motion: Motion
    _sliding: float

    @staticmethod
    def cost(rig: Rig, method: Contacts | MasterEquation | QuasiStatic, course: Course) -> tuple[Part, ...]:
        """Return the work of a run, by part: of steps, unless in balance all the time, of breaks and of samples."""
        body, balanced = rig.slider, isinstance(method, QuasiStatic)
        assert isinstance(body, ElasticBody)
        count, steps, stiff = getattr(method, "count", _COHORTS), 0.0, False
        if not balanced:
            network = network_of(body, np.zeros(body.size), np.zeros(body.size))
            step = longest_step(network)
            stiff = step < longest_step(network._replace(lag=0.0))  # dashpots ask for shorter steps than springs
            steps = body.size * rig.drive.duration / step
        what = "cohorts" if isinstance(method, MasterEquation) else "contacts"
        name = "viscosity" if stiff else "mass"
        moving = Part(
            key=f"slider.{name}", value=getattr(body, name), quantity=name, power=1.0 if stiff else -0.5,
            what=f"{steps:.2g} steps of blocks", block_steps=steps,
            seconds=steps * (_STEP if what == "contacts" else _STEP_OF_COHORT * count),
        )  # fmt: skip
        breaks, each = body.size * count * max(course.lives, 1.0), _BALANCE * body.size if balanced else _BREAK
        breaking = Part(
            key=f"simulation.{what}", value=count, quantity=None, power=1.0,
            what=f"about {breaks:.2g} breaks of {body.size * count:.2g} {what}",
            seconds=each * breaks, bytes=_CONTACT * body.size * count,
        )  # fmt: skip
        if (interval := rig.output.interval) is None:
            return moving, breaking
        samples = rig.drive.duration / interval * body.size
        sampling = Part(
            key="simulation.interval", value=interval, quantity="time", power=-1.0,
            what=f"{samples:.2g} samples of blocks", seconds=_SAMPLE[0] * samples, bytes=_SAMPLE[1] * samples,
        )  # fmt: skip
        return moving, breaking, sampling

    @property
    def columns(self) -> tuple[str, ...]:  # type: ignore[override]
        """Sums over blocks, then fields of all blocks."""
        return SCALARS + tuple(name for name in FIELDS for _ in range(self.slider.size))

    def here(self) -> tuple[float, float]:
        """Time, and mean displacement of the blocks."""
        return float(self._motion.now.time), float(self._motion.blocks.X.mean())

    def contact_force(self) -> float:
        """Mean friction force of the blocks now, per contact."""
        blocks = self._motion.blocks
        element = np.clip(blocks.X - blocks.anchor, -self._sliding, self._sliding)
        return float(np.mean(blocks.held * blocks.X - blocks.births + (1.0 - blocks.held) * element))

    def marks(self) -> dict[str, Array]:
        """Return when each block first broke, at which spring force, was half detached; and its preload."""
        blocks = self._motion.blocks
        return {
            "first_break": blocks.first_break.copy(),
            "first_break_force": blocks.first_force.copy(),
            "half_detached": blocks.half_detached.copy(),
            "preload": self._network.load - self._network.push,
        }

    @abstractmethod
    def _move(self, piece: Piece, sampling: Sampling) -> int:
        """Go on, and say why it ends."""

    def longest_step(self) -> float:
        """Longest step in time."""
        return longest_step(self._network)

    def advance(self, leg: Leg) -> Advance:
        """Go on by some steps."""
        sampling = leapfrog.Sampling(leg.times, np.empty((leg.times.size, self._motion.rows.shape[1])))
        self._motion.now.sampled = 0
        look = leg.looks[0] if leg.looks else math.inf
        why = self._move(leapfrog.Piece(leg.drive, leg.end, leg.stop, self.longest_step(), look), sampling)
        rows = sampling.samples[: self._motion.now.sampled]
        # The next step passes the look; or it is where all ends.
        seen = looks_aside(self, leg, look if why == LOOK else self.here()[0])
        return Advance(rows, seen, over=why not in (PAUSED, LOOK))


@solves(Contacts, elastic=True)
@solves(QuasiStatic, elastic=True)
class BlocksOfContacts(ElasticEngine):
    """Blocks with N contacts each, fed with random numbers block by block.

    With inertia in steps of time, breaks located inside them: `stickslip.kernels.blocks`; or in balance all the time,
    from event to event: `stickslip.kernels.quasistatic`.
    """

    def __init__(self, beginning: Beginning, method: Contacts | QuasiStatic) -> None:
        body, self._balanced = beginning.slider, isinstance(method, QuasiStatic)
        assert isinstance(body, ElasticBody)
        if self._balanced and not isinstance(body, Chain):
            raise InputError("QuasiStatic: is for a Chain; use Contacts")
        if self._balanced and not body.pulled.any():
            raise InputError(
                "Chain.leaf = 0 and Chain.side = 0: nothing holds it in balance; give one, or use Contacts"
            )
        self.slider = body
        check_size(body, method.count)
        load, push, prestress = balanced(beginning)
        self._network = network_of(body, load, push)
        self._sliding = beginning.interface.sliding_force
        self._streams = Streams(beginning.interface, method.seed, body.size)
        x, threshold, waiting = contacts_of(beginning, self._streams, method.count, prestress)
        anchored = np.where(slides(beginning, body), self._sliding, prestress)
        element = np.clip(anchored, -self._sliding, self._sliding)
        X = settled(beginning, np.where(threshold > 0, x, element[:, None]).mean(axis=1))
        V = first_velocities(beginning, body)
        self._state = blocks.make_state(X[:, None] - x, threshold, waiting, X, V, self._sliding, anchored)
        self._motion = self._state.motion
        self._state.contacts.next_threshold[:] = self._streams.draws.thresholds.shape[1]
        self._state.contacts.next_delay[:] = self._streams.draws.delays.shape[1]
        if self._balanced:
            self._network = self._network._replace(mass=0.0)  # creep has a velocity, but no kinetic energy
            self._room = np.zeros((7, body.size))

    def stretchings(self) -> Stretchings:
        """Stretchings of the attached contacts of all blocks now."""
        contacts = self._state.contacts
        x = (self._motion.blocks.X[:, None] - contacts.birth)[contacts.threshold > 0]
        return Stretchings(x, np.full(x.size, 1.0 / contacts.birth.size), cells=False)

    def longest_step(self) -> float:
        """Longest step in time; in balance any will do."""
        return math.inf if self._balanced else super().longest_step()

    def _advance(self, piece: Piece, sampling: Sampling) -> int:
        """Go on as far as the random numbers last."""
        state, network, draws = self._state, self._network, self._streams.draws
        if not self._balanced:
            return blocks.advance(state, network, piece, sampling, draws, self._sliding, _BUDGET)
        why = quasistatic.advance(state, network, piece, sampling, draws, self._sliding, _BUDGET, self._room)
        if why == UNSOLVED:
            raise InputError(
                f"QuasiStatic: which of the detached contacts slide is not found at t = {self.here()[0]:g}; use "
                "Contacts, or Interface.sliding_force = 0"
            )
        return why

    def _move(self, piece: Piece, sampling: Sampling) -> int:
        contacts = self._state.contacts
        while True:
            why = self._advance(piece, sampling)
            block = int(self._motion.now.block)
            if why == THRESHOLDS_USED_UP:
                self._streams.refill_thresholds(block)
                contacts.next_threshold[block] = 0
            elif why == DELAYS_USED_UP:
                self._streams.refill_delays(block)
                contacts.next_delay[block] = 0
            else:
                return why


@solves(MasterEquation, elastic=True)
class BlocksOfCohorts(ElasticEngine):
    """Blocks with infinitely many contacts each, in cohorts: `stickslip.kernels.block_cohorts`."""

    def __init__(self, beginning: Beginning, method: MasterEquation) -> None:
        body, interface = beginning.slider, beginning.interface
        assert isinstance(body, ElasticBody)
        self.slider, self._sliding = body, interface.sliding_force
        if beginning.at_rest:
            raise InputError(
                f"FromSliding.at_rest = {beginning.at_rest}: not available with MasterEquation; use Contacts"
            )
        load, push, prestress = balanced(beginning)
        self._network = network_of(body, load, push)
        table = survival_of(interface.threshold_distribution)
        self._cells = 400.0 * math.sqrt(1e-4 / method.rtol)
        past_rate = 0.0
        if beginning.sliding:
            x, fraction = block_cohorts.smooth_sliding(table, self._cells, beginning.attached)
            past_rate = beginning.attached * beginning.velocity / interface.threshold_distribution.moment(1)
        elif isinstance(beginning.start, Prestressed):
            x, fraction = np.zeros(1), np.ones(1)
        else:
            x, fraction = initial_nodes(interface)
        x = prestress[:, None] + x
        self._case = block_cohorts.Case(table, Delays(*interface.delay.quadrature()), self._sliding, 0.5 / self._cells)
        anchored = np.full(body.size, self._sliding) if beginning.sliding else prestress
        element = np.clip(anchored, -self._sliding, self._sliding)
        X = settled(beginning, (x * fraction).sum(axis=1) + (1.0 - fraction.sum()) * element)
        steps = float(self._case.delays.time.max(initial=0.0)) / self.longest_step()
        if steps * body.size > _MOST_HISTORY:
            raise InputError(
                f"Interface.delay: {steps:.2g} steps in the longest delay, for {body.size} blocks; use Contacts(...), "
                "or make the delay shorter or the blocks heavier"
            )
        self._motion = at_rest(X, first_velocities(beginning, body), self._sliding, anchored)
        room, fractions = int(2.0 * self._cells * table.top) + x.shape[1] + 64, np.broadcast_to(fraction, x.shape)
        self._state = block_cohorts.make_state(
            self._motion, X[:, None] - x, fractions, self._case, past_rate, room, int(1.05 * steps) + 64
        )

    @staticmethod
    def check(interface: Interface, method: MasterEquation) -> None:
        """Raise `InputError` for thresholds without a density, and for the paper's approximation."""
        check_density(interface.threshold_distribution)
        if method.memoryless:
            raise InputError("MasterEquation.memoryless: is for a rigid slider; leave it out")

    def longest_step(self) -> float:
        """Longest step in time; finer cohorts come with finer steps."""
        return longest_step(self._network) * min(1.0, 400.0 / self._cells)

    def stretchings(self) -> Stretchings:
        """Stretchings of the cohorts of all blocks now."""
        cohort = self._state.cohorts.cohort
        alive = cohort[:, ALIVE] * (np.arange(cohort.shape[2]) < self._state.cohorts.used[:, :1])
        x = self._motion.blocks.X[:, None] - cohort[:, PLACE]
        return Stretchings(x[alive > 0], alive[alive > 0] / self.slider.size, cells=True)

    def _move(self, piece: Piece, sampling: Sampling) -> int:
        while True:
            why = block_cohorts.advance(self._state, self._network, piece, sampling, self._case, 50 * _BUDGET)
            if why == NO_ROOM:
                self._state = block_cohorts.with_room(self._state)
            elif why == NO_HISTORY:
                cohorts = self._state.cohorts
                self._state = self._state._replace(cohorts=cohorts._replace(history=longer(cohorts.history)))
            else:
                return why

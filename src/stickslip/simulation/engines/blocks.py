"""Elastic sliders with N contacts on each block, breaks located inside the time steps:
`stickslip.kernels.blocks`.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from stickslip.errors import InputError
from stickslip.kernels import blocks, drive, quasistatic
from stickslip.kernels.blocks import BlockDraws
from stickslip.kernels.drive import Piece, Sampling
from stickslip.kernels.leapfrog import (
    OF_BLOCKS,
    SUMS,
    Network,
    fastest,
    stiffest_dashpot,
)
from stickslip.model import (
    Chain,
    Contacts,
    Delay,
    ElasticBody,
    FromRest,
    Interface,
    Prestressed,
    QuasiStatic,
    Slider,
)
from stickslip.model.body import coupling_matrix
from stickslip.model.newborn import thresholds_beyond
from stickslip.model.records import hashable
from stickslip.model.rig import Rig
from stickslip.simulation.engines.base import (
    REFILLS,
    Advance,
    Array,
    Beginning,
    Engine,
    Leg,
    Stretchings,
    looks_aside,
    solves,
)
from stickslip.simulation.engines.contacts import tried
from stickslip.simulation.engines.start import (
    drawing,
    first_contacts,
    lifetimes_in,
    track_factor,
)
from stickslip.simulation.estimates import LARGEST, Course, Part, breaking, contacts_of

# longest step, in radians of the body's fastest oscillation; it gives the speeds of
# fronts to 1e-4
ANGLE = 0.05
_DASHPOT = 0.2  # longest step times the fastest decay rate of the dashpots
# random numbers drawn at once for a block; with another length the same seed gives
# another run
_POOL = 256
# Seconds of a step, and of a block in it without a break; of a break; and of a block at
# each break in balance.
_ALL, _STEP = 3e-7, 2e-8
_BREAK = 7e-7
_BEGIN = 1.5e-4  # seconds to start a block
_BALANCE = 4e-8
_WORTH_A_TRIAL = 0.02  # seconds above which breaks are counted in a trial run
_CONTACT = 64.0  # bytes of a contact
_BLOCK = 250.0  # bytes of a block, including its springs to others
# work in an advance, some 50 to 200 ms; an event, or eight steps of a block, is one
_BUDGET = 2_000_000


def _lives_as_one(rig: Rig, body: ElasticBody, by_theory: float) -> float:
    """Number of breaks of a contact in a run, from a trial in which all blocks are one
    rigid slider; `by_theory` where the trial does not show it.
    """
    slider = Slider(
        stiffness=float(body.pulled.mean()), mass=body.mass, damping=body.damping
    )
    method = rig.method
    assert isinstance(method, Contacts | QuasiStatic)
    alone = Contacts(method.count * body.size, seed=method.seed)
    lives, _ = tried(hashable(Rig(rig.interface, slider, rig.drive, method=alone)))
    return lives if math.isfinite(lives) else by_theory


def balanced(
    beginning: Beginning, *, always: bool = False
) -> tuple[Array, Array, Array]:
    """Return the constant forces on the blocks, the part of them that driving springs
    do not carry, and the stretching of the prestress.

    Raises `InputError` if no spring holds the body, unless the start is a prestress;
    with `always`, also then.
    """
    body = beginning.slider
    start = beginning.start
    assert isinstance(body, ElasticBody)
    if not body.pulled.any() and (always or not isinstance(start, Prestressed)):
        name = type(body).__name__
        instead = "use Contacts" if always else "start Prestressed(...)"
        raise InputError(
            f"{name}.leaf = 0 and {name}.side = 0: nothing pulls it; give one, or "
            f"{instead}"
        )
    if not isinstance(start, Prestressed):
        return np.zeros(body.size), np.zeros(body.size), np.zeros(body.size)
    stretching = per_block("Prestressed.stretching", start.stretching, body)
    distribution = beginning.interface.threshold_distribution
    beyond = distribution.survival(np.abs(stretching)) < 1e-9
    if beyond.any():
        raise InputError(
            f"Prestressed.stretching: {stretching[beyond][0]:g} on block "
            f"{int(np.argmax(beyond))} is not below the "
            f"thresholds ({distribution}); give less"
        )
    along = body.size // body.rows
    push = np.where(np.arange(body.size) % along < start.pushed_blocks, start.push, 0.0)
    return (
        stretching + push,
        push + np.where(body.pulled > 0, 0.0, stretching),
        stretching,
    )


def check_body(rig: Rig) -> None:
    """Raise `InputError` for more blocks than memory holds, or for a prestress beyond
    the thresholds of a rig's contacts.
    """
    case = rig.natural
    body = case.slider
    if not isinstance(body, ElasticBody):
        return
    if (room := _BLOCK * body.size) > LARGEST:
        raise InputError(
            f"slider.blocks = {body.size:.4g}: would take about {room / 1e9:.2g} GB; "
            f"give at most {LARGEST / _BLOCK:.2g}",
            "slider.blocks",
        )
    if isinstance(case.start, Prestressed):
        balanced(Beginning(case.interface, body, case.velocity, case.start))


def per_block(place: str, value: float | tuple[float, ...], body: ElasticBody) -> Array:
    """Expand a number for all blocks, or one for each, to one for each."""
    if isinstance(value, tuple) and len(value) != body.size:
        raise InputError(
            f"{place}: has {len(value)} numbers for {body.size} blocks; give one, or "
            "one for each"
        )
    return np.array(np.broadcast_to(np.asarray(value, dtype=float), body.size))


@lru_cache(maxsize=1)
def _neighbours(body: ElasticBody) -> tuple[NDArray[np.int32], Array]:
    """Neighbours of each block, itself where it has fewer, and the springs to them."""
    pairs, stiffness = body.links
    ends = np.concatenate([pairs, pairs[:, ::-1]])
    order = np.argsort(ends[:, 0], kind="stable")
    first, second = ends[order].T
    place = np.arange(first.size) - np.searchsorted(first, first)
    most = int(place.max(initial=0)) + 1
    neighbour = np.repeat(np.arange(body.size, dtype=np.int32)[:, None], most, axis=1)
    spring = np.zeros((body.size, most))
    neighbour[first, place] = second
    spring[first, place] = np.tile(stiffness, 2)[order]
    return neighbour, spring


def network_of(body: ElasticBody, load: Array, push: Array) -> Network:
    """Return the constants of a body for the kernels."""
    return Network(
        *_neighbours(hashable(body)),
        body.pulled,
        load,
        push,
        body.mass,
        body.damping,
        body.viscosity / body.coupling,
    )


def longest_step(network: Network) -> float:
    """Longest time step for the motion of a body."""
    rate = stiffest_dashpot(network)
    return min(ANGLE / fastest(network), _DASHPOT / rate if rate > 0 else math.inf)


class Streams:
    """Streams of random numbers of each block, independent of the number of blocks."""

    def __init__(self, interface: Interface, seed: int, blocks: int) -> None:
        delay = interface.delay
        self._seed = seed
        fixed = delay.time if isinstance(delay, Delay) else math.nan
        thresholds = np.empty((blocks, _POOL))
        delays = np.empty((blocks, _POOL if math.isnan(fixed) else 0))
        self.draws = BlockDraws(
            thresholds,
            delays,
            fixed,
            np.ones(blocks),
            interface.slip_to_slip_scatter > 0.0,
        )
        self._pools: dict[
            int, tuple[Array, Callable[[np.random.Generator, int], Array | float]]
        ] = {
            1: (thresholds, interface.threshold_distribution.sample),
            2: (delays, delay.sample),
            3: (self.draws.factor, lambda rng, _: track_factor(interface, rng)),
        }
        self._generators: dict[tuple[int, int], np.random.Generator] = {}

    def of(self, block: int, kind: int) -> np.random.Generator:
        """Begin one of a block's streams: of initial stretchings (0), thresholds (1),
        delays (2) or tracks (3).
        """
        # the same as SeedSequence(seed).spawn(blocks)[block].spawn(3)[kind], without
        # spawning the others
        return np.random.default_rng(
            np.random.SeedSequence(self._seed, spawn_key=(block, kind))
        )

    def refill(self, block: int, kind: int) -> None:
        """Draw thresholds (1) or delays (2) for a block, or its next track (3)."""
        if (block, kind) not in self._generators:
            self._generators[block, kind] = self.of(block, kind)
        pool, sample = self._pools[kind]
        pool[block] = sample(self._generators[block, kind], _POOL)


def drawn_contacts(
    beginning: Beginning,
    streams: Streams,
    count: int,
    prestress: Array,
) -> tuple[Array, Array, Array]:
    """Draw stretchings, thresholds and times of re-attachment of the contacts of all
    blocks, each of shape (blocks, count).
    """
    body = beginning.slider
    assert isinstance(body, ElasticBody)
    x, threshold = np.empty((2, body.size, count))
    waiting = np.full((body.size, count), np.inf)
    distribution = beginning.interface.threshold_distribution
    still = replace(beginning, start=FromRest())
    for j in range(body.size):
        rng = streams.of(j, 0)
        if streams.draws.tracks:
            streams.refill(j, 3)
        factor = float(streams.draws.factor[j])
        if isinstance(beginning.start, Prestressed):
            x[j] = prestress[j]
            threshold[j] = thresholds_beyond(distribution, rng, x[j], factor)
        else:
            sliding = still if j < beginning.at_rest else beginning
            x[j], threshold[j], pending = first_contacts(sliding, count, rng, factor)
            waiting[j, count - pending.size :] = pending
    return x, threshold, waiting


def start_of(
    beginning: Beginning,
    body: ElasticBody,
    friction: Array,
    slides: NDArray[np.bool_],
) -> tuple[Array, Array]:
    """Return displacements and velocities of the blocks at the start, in balance with
    their friction if they slide.
    """
    if not beginning.sliding:
        return np.zeros(body.size), np.zeros(body.size)
    force = friction + body.mass * body.damping * beginning.velocity * slides
    held = sparse.diags_array(body.pulled) + coupling_matrix(body)
    driven = float(force.sum() / body.pulled.sum())
    X = np.asarray(spsolve(held.tocsc(), body.pulled * driven - force)).reshape(
        body.size
    )
    perturbation = per_block("FromSliding.perturbation", beginning.perturbation, body)
    return X, beginning.velocity * (1.0 + perturbation) * slides


@solves(Contacts, elastic=True)
@solves(QuasiStatic, elastic=True)
class BlocksOfContacts(Engine):
    """Blocks with N contacts each, supplied with random numbers block by block.

    Either with inertia, in time steps with breaks located inside them
    (`stickslip.kernels.blocks`), or in balance at all times, from event to event
    (`stickslip.kernels.quasistatic`).
    """

    angle = 0.1
    piece = 4.5e-4
    mechanisms = frozenset({"sliding_force", "slip_to_slip_scatter"})
    slider: ElasticBody

    def __init__(self, beginning: Beginning, method: Contacts | QuasiStatic) -> None:
        body = beginning.slider
        assert isinstance(body, ElasticBody)
        self._balanced = isinstance(method, QuasiStatic)
        if self._balanced and not isinstance(body, Chain):
            raise InputError("QuasiStatic: is for a Chain; use Contacts")
        self.slider = body
        self._sliding = beginning.interface.sliding_force
        load, push, prestress = balanced(beginning, always=self._balanced)
        self._network = network_of(body, load, push)
        self._longest = longest_step(self._network)
        slides = np.full(body.size, beginning.sliding) & (
            np.arange(body.size) >= beginning.at_rest
        )
        anchored = np.where(slides, self._sliding, prestress)
        element = np.clip(anchored, -self._sliding, self._sliding)
        self._streams = Streams(beginning.interface, method.seed, body.size)
        x, threshold, waiting = drawn_contacts(
            beginning,
            self._streams,
            method.count,
            prestress,
        )
        friction = np.where(threshold > 0, x, element[:, None]).mean(axis=1)
        X, V = start_of(beginning, body, friction, slides)
        self._state = blocks.make_state(
            X[:, None] - x,
            threshold,
            waiting,
            X,
            V,
            self._sliding,
            anchored,
        )
        self._motion = self._state.motion
        self._state.contacts.next_threshold[:] = self._streams.draws.thresholds.shape[1]
        self._state.contacts.next_delay[:] = self._streams.draws.delays.shape[1]
        if self._balanced:
            # the velocity of creep carries no kinetic energy
            self._network = self._network._replace(mass=0.0)
            self._longest = math.inf
            self._room = np.zeros((7, body.size))

    @staticmethod
    def cost(
        rig: Rig,
        method: Contacts | QuasiStatic,
        course: Course,
    ) -> tuple[Part, ...]:
        """Return the work of a run, by part: of time steps, unless it is always in
        balance, and of breaks.
        """
        body = rig.slider
        balanced = isinstance(method, QuasiStatic)
        assert isinstance(body, ElasticBody)
        room = _BLOCK * body.size + _CONTACT * contacts_of(rig)
        if room > LARGEST:  # the arrays for counting the steps would be as large
            blocks = Part(
                "slider.blocks",
                body.size,
                None,
                1.0,
                f"{body.size:.2g} blocks and their contacts",
                0.0,
                room,
            )
            return (blocks,)
        steps = 0.0
        stiff = False
        if not balanced:
            network = network_of(body, np.empty(0), np.empty(0))
            step = longest_step(network)
            # whether dashpots require shorter steps than springs
            stiff = step < longest_step(network._replace(lag=0.0))
            steps = rig.drive.duration / step
        count = body.size * method.count
        each = _BALANCE * body.size if balanced else _BREAK
        # The prestress may break each contact once, however little the drive moves.
        lives = max(
            lifetimes_in(rig, course)[0], float(isinstance(rig.start, Prestressed))
        )
        if each * count * lives > _WORTH_A_TRIAL and isinstance(rig.start, FromRest):
            lives = _lives_as_one(rig, body, lives)
        drawn = drawing(rig, method.count, body.size) + _BEGIN * body.size
        contacts = breaking(count, lives, each, _CONTACT, more=drawn)._replace(
            value=method.count
        )
        name, power = ("viscosity", 1.0) if stiff else ("mass", -0.5)
        words = f"{steps * body.size:.2g} steps of blocks"
        seconds = steps * (_ALL + _STEP * body.size)
        moving = Part(
            f"slider.{name}",
            getattr(body, name),
            name,
            power,
            words,
            seconds,
        )
        return moving, contacts

    @property
    def columns(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the samples: sums over blocks, then fields of all blocks."""
        return SUMS + tuple(name for name in OF_BLOCKS for _ in range(self.slider.size))

    def here(self) -> tuple[float, float]:
        """Time, and mean displacement of the blocks."""
        return float(self._motion.now.time), float(self._motion.blocks.X.mean())

    def contact_force(self) -> float:
        """Return the current mean friction force of the blocks, per contact."""
        blocks = self._motion.blocks
        element = np.clip(blocks.X - blocks.anchor, -self._sliding, self._sliding)
        return float(
            np.mean(
                blocks.held * blocks.X - blocks.origins + (1.0 - blocks.held) * element
            )
        )

    def marks(self) -> dict[str, Array]:
        """Return the time and spring force of each block's first break, the time at
        which half of its contacts were detached, and its preload.
        """
        blocks = self._motion.blocks
        return {
            "first_break": blocks.first_break.copy(),
            "first_break_force": blocks.first_force.copy(),
            "half_detached": blocks.half_detached.copy(),
            "preload": self._network.load - self._network.push,
        }

    def advance(self, leg: Leg) -> Advance:
        """Advance by several steps or events."""
        sampling = Sampling(
            leg.times, np.empty((leg.times.size, self._motion.rows.shape[1]))
        )
        self._motion.now.sampled = 0
        look = leg.looks[0] if leg.looks else math.inf
        piece = Piece(leg.drive, leg.end, leg.stop, look, self._longest)
        for _ in range(REFILLS):
            why = self._move(piece, sampling)
            if not self._provide(why):
                break
        else:
            why = drive.PAUSED
        rows = sampling.samples[: self._motion.now.sampled]
        # The next step would pass the snapshot, or the leg ends here.
        seen = looks_aside(self, leg, look if why == drive.LOOK else self.here()[0])
        on_the_way = drive.PAUSED, drive.LOOK, drive.STANDS_STILL
        return Advance(rows, seen, over=why not in on_the_way)

    def stretchings(self) -> Stretchings:
        """Return the current stretchings of the attached contacts of all blocks."""
        contacts = self._state.contacts
        x = (self._motion.blocks.X[:, None] - contacts.birth)[contacts.threshold > 0]
        return Stretchings(x, np.full(x.size, 1.0 / contacts.birth.size), cells=False)

    def _move(self, piece: Piece, sampling: Sampling) -> int:
        """Call the kernel, and return the reason why it stopped."""
        given = (
            self._state,
            self._network,
            piece,
            sampling,
            self._streams.draws,
            self._sliding,
            _BUDGET,
        )
        if self._balanced:
            return quasistatic.advance_quasistatic(*given, self._room)
        return blocks.advance_blocks(*given)

    def _provide(self, why: int) -> bool:
        """Refill the random numbers that the kernel has used up; return whether it
        stopped for that reason.
        """
        contacts = self._state.contacts
        block = int(self._motion.now.block)
        if why == drive.UNSOLVED:
            raise InputError(
                "QuasiStatic: which of the detached contacts slide is not found at t "
                f"= {self.here()[0]:g}; use "
                "Contacts, or Interface.sliding_force = 0"
            )
        kinds = drive.THRESHOLDS_USED_UP, drive.DELAYS_USED_UP, drive.ARRESTED
        if why in kinds:
            self._streams.refill(block, kinds.index(why) + 1)
            if why != drive.ARRESTED:  # what has been drawn is still to be used
                (contacts.next_threshold if why == kinds[0] else contacts.next_delay)[
                    block
                ] = 0
        return why in kinds

"""The interface as an element: it takes the motion of the slider, and returns force,
impulse and stiffness.

For a kernel that integrates its own structure, the loop calls

``step(state: ElementState, dt: float, velocity: float, displacement: float)
-> tuple[float, float, float]``

It moves the slider from its position to the `displacement` in the time `dt` above 0: at
constant speed if the `velocity` is NaN, else on the parabola that begins with that
velocity. It returns the force at the end, its integral over the step and its derivative
by the displacement, all in natural units and per contact, and changes the state in
place. A copy of ``state.memory`` saves the state. ``state.motion[0].position`` is the
position of the slider, ``next_break`` the distance to the next break.

Under a given motion contacts are independent, and each is carried through a step
exactly. Its random numbers are keyed by the seed, its number and the number of its
life, so that they depend only on the motion of the slider, not on its division into
steps. Each block of contacts knows how far the slider can move until one of them
breaks, and when the next re-attaches; a block without events is carried as a whole. A
step is cut where the slider reverses.

Detached contacts that carry a force share one stretching: elastic up to the sliding
force, and plastic beyond.
"""

import math
from typing import NamedTuple

import numpy as np

from ._jit import bare, inlined
from .keyed_draws import Quantiles, quantile, uniform
from .records import Floats, Record, record
from .survival import SurvivalTable, value_at

CONTACT = record("birth threshold until life")
"""A contact: the position at which it attached unstretched, its threshold, the time of
its re-attachment (below 0 while it is attached), and the number of its lives so far.
"""
BLOCK = record("stiffness origins squares free ahead behind until")
"""Sums over a block: stiffness, stiffness times place and times its square, of attached
contacts; number of detached ones; positions of the next break, ahead and behind; time
of the next re-attachment.
"""
MOTION = record(
    "time carry position direction slid impulse lost low_key high_key",
    "breaks breaks_at_arrest track factor",
)
"""Motion of the slider: `time` and `carry` are the time in two parts; `slid` is the
common stretching of the detached contacts; `lost` is the energy lost in breaks, summed
over all contacts.
"""
SIZE = 32  # number of contacts of a block

THRESHOLD, NEWBORN, DELAY, TRACK = range(4)  # kinds of draws


class Draws(NamedTuple):
    """Distributions that contacts draw from, and mechanisms of the interface.

    If `delay` is NaN, delays are drawn from the quantiles. `beyond` is the survival of
    thresholds (of areas, if contacts differ in these), which stretched newborns need.
    """

    quantiles: Quantiles
    beyond: SurvivalTable
    delay: float
    sliding_force: float
    stretched: bool
    on_arrest: bool
    tracks: bool
    areas: bool
    kept: bool


class _Sums(NamedTuple):
    """Sums over some contacts, as in the record of a block."""

    stiffness: float
    origins: float
    squares: float
    free: float
    ahead: float
    behind: float
    until: float


_NONE = _Sums(0.0, 0.0, 0.0, 0.0, math.inf, -math.inf, math.inf)


class ElementState(NamedTuple):
    """State of an element: all numbers are in `memory`, of which the records are views;
    `sums` are those over all blocks.
    """

    memory: Floats
    motion: Record
    sums: Record
    blocks: Record
    contacts: Record
    draws: Draws


class _Path(NamedTuple):
    """A part of a step in which the slider does not reverse, from `x` with velocity `v`
    to `end` in a time `h`.

    `side` is the sign of the motion, 0 at rest; detached contacts have the common
    stretching `y`, and slide from the time `yields` on, infinite if they do not.
    """

    x: float
    v: float
    a: float
    h: float
    end: float
    side: float
    y: float
    yields: float


def make_element(
    birth: Floats,
    threshold: Floats,
    until: Floats,
    key: tuple[int, int],
    draws: Draws,
    factor: float = 1.0,
    slid: float = 0.0,
) -> ElementState:
    """Return an element at position 0 and time 0."""
    state = arranged(birth.size, draws)
    for name, values in (("birth", birth), ("threshold", threshold), ("until", until)):
        state.contacts[name] = values
    m = state.motion[0]
    m.direction = 1.0
    m.low_key, m.high_key = key
    m.factor = factor
    m.slid = slid
    renew(state)
    return state


def arranged(count: int, draws: Draws) -> ElementState:
    """Return an empty state for a number of contacts."""
    blocks = -(-count // SIZE)
    kinds = (MOTION, 1), (BLOCK, 1), (BLOCK, blocks), (CONTACT, count)
    sizes = [size * kind.itemsize // 8 for kind, size in kinds]
    memory = np.zeros(sum(sizes))
    parts = np.split(memory, np.cumsum(sizes)[:-1])
    motion, sums, of_blocks, contacts = (
        part.view(kind).view(np.recarray)
        for part, (kind, _) in zip(parts, kinds, strict=True)
    )
    return ElementState(memory, motion, sums, of_blocks, contacts, draws)


@inlined
def _stiffness(draws: Draws, threshold: float) -> float:
    """Stiffness of a contact."""
    return threshold if draws.areas else 1.0


@inlined
def _way(path: _Path, t: float) -> float:
    """Displacement of the slider since the beginning of the path."""
    return t * (path.v + 0.5 * path.a * t)


@inlined
def _area(path: _Path, t: float) -> float:
    """Integral of the displacement over time."""
    return t * t * (0.5 * path.v + path.a * t / 6.0)


@inlined
def _when(path: _Path, way: float) -> float:
    """Time at which the slider has moved by `way` in its direction."""
    if way <= 0.0:
        return 0.0
    v = max(path.side * path.v, 0.0)
    root = math.sqrt(max(v * v + 2.0 * path.side * path.a * way, 0.0))
    return min(2.0 * way / (v + root), path.h) if v + root > 0.0 else path.h


@inlined
def _slid(path: _Path, t: float) -> float:
    """Common stretching of the detached contacts."""
    y = path.y + _way(path, min(t, path.yields))
    return float(y)


@inlined
def _free_impulse(path: _Path, t: float) -> float:
    """Integral of the force of a detached contact over time."""
    until = min(t, path.yields)
    return float(
        path.y * until + _area(path, until) + (t - until) * _slid(path, path.h)
    )


@inlined
def _loss(path: _Path, t: float) -> float:
    """Energy that a detached contact has lost by sliding."""
    until = min(t, path.yields)
    return float((_way(path, t) - _way(path, until)) * _slid(path, path.h))


@inlined
def _draw(
    m: Record,
    kind: int,
    slot: int,
    life: int,
) -> float:
    """Return the uniform random number of a contact in one of its lives."""
    key = int(m.low_key), int(m.high_key)
    return uniform(key, (slot, (4 * life + kind) & 0xFFFFFFFF))


@bare
def _attach(
    state: ElementState,
    slot: int,
    place: float,
    heading: float,
) -> float:
    """Attach a contact at a position of the slider; return its stretching."""
    m = state.motion[0]
    draws = state.draws
    contact = state.contacts[slot]
    contact.life += 1.0
    life = int(contact.life)
    contact.until = -1.0
    x = 0.0
    if draws.stretched:
        x = quantile(draws.quantiles, NEWBORN, _draw(m, NEWBORN, slot, life))
    contact.birth = place - heading * x
    if not draws.kept:
        p = _draw(m, THRESHOLD, slot, life)
        bound = abs(x)
        if draws.areas:
            bound *= bound
        if draws.stretched:
            p *= value_at(draws.beyond, bound / m.factor)
        drawn = m.factor * quantile(draws.quantiles, THRESHOLD, p)
        drawn = max(drawn, bound)
        contact.threshold = math.sqrt(drawn) if draws.areas else drawn
    return float(heading * x)


@inlined
def _delay(state: ElementState, slot: int) -> float:
    """Draw the time that a broken contact stays detached."""
    draws = state.draws
    if not math.isnan(draws.delay):
        return draws.delay
    p = _draw(state.motion[0], DELAY, slot, int(state.contacts[slot].life))
    return max(quantile(draws.quantiles, DELAY, p), 0.0)


@inlined
def _wait(m: Record, until: float) -> float:
    """Time from now until a moment."""
    return float(max((until - m.time) - m.carry, 0.0))


@bare
def _live(state: ElementState, slot: int, path: _Path) -> None:
    """Carry a contact through all its events on a path."""
    m = state.motion[0]
    contact = state.contacts[slot]
    here = 0.0
    held = contact.until < 0.0
    wait = 0.0 if held else _wait(m, contact.until)
    # ends: each turn is a break or a re-attachment further on the path
    while True:
        if held:
            k = _stiffness(state.draws, contact.threshold)
            way = path.side * (contact.birth - path.x) + contact.threshold
            last = path.side * (
                contact.birth + path.side * contact.threshold - path.end
            )
            breaks = path.side != 0.0 and last <= 0.0
            until = max(_when(path, way), here) if breaks else path.h
            m.impulse += k * (
                (path.x - contact.birth) * (until - here)
                + _area(path, until)
                - _area(path, here)
            )
            if not breaks:
                return
            y = _slid(path, until)
            m.lost += 0.5 * (k * contact.threshold**2 - y * y)
            m.breaks += 1.0
            wait = until + _delay(state, slot)
        else:
            until = min(wait, path.h)
            attaches = wait <= path.h
            m.impulse += _free_impulse(path, until) - _free_impulse(path, here)
            m.lost += _loss(path, until) - _loss(path, here)
            if not attaches:
                contact.until = (m.time + wait) + m.carry
                return
            heading = path.side if path.side != 0.0 else m.direction
            x = _attach(state, slot, path.x + _way(path, until), heading)
            y = _slid(path, until)
            k = _stiffness(state.draws, contact.threshold)
            m.lost += 0.5 * (y * y - k * x * x)
        here = until
        held = not held


@inlined
def _counted(sums: _Sums, draws: Draws, contact: Record) -> _Sums:
    """Return sums that include one more contact."""
    if contact.until >= 0.0:
        until = min(sums.until, contact.until)
        return _Sums(
            sums.stiffness,
            sums.origins,
            sums.squares,
            sums.free + 1.0,
            sums.ahead,
            sums.behind,
            until,
        )
    k = _stiffness(draws, contact.threshold)
    birth = contact.birth
    return _Sums(
        sums.stiffness + k,
        sums.origins + k * birth,
        sums.squares + k * birth * birth,
        sums.free,
        min(sums.ahead, birth + contact.threshold),
        max(sums.behind, birth - contact.threshold),
        sums.until,
    )


@inlined
def _joined(sums: _Sums, more: Record) -> _Sums:
    """Return the sums over both sets of contacts."""
    return _Sums(
        sums.stiffness + more.stiffness,
        sums.origins + more.origins,
        sums.squares + more.squares,
        sums.free + more.free,
        min(sums.ahead, more.ahead),
        max(sums.behind, more.behind),
        min(sums.until, more.until),
    )


@inlined
def _note(record: Record, sums: _Sums) -> None:
    """Store sums in a record."""
    record.stiffness = sums.stiffness
    record.origins = sums.origins
    record.squares = sums.squares
    record.free = sums.free
    record.ahead = sums.ahead
    record.behind = sums.behind
    record.until = sums.until


@bare
def renew(state: ElementState) -> None:
    """Compute all sums again."""
    total = _NONE
    for b in range(state.blocks.size):
        sums = _NONE
        for slot in range(SIZE * b, min(SIZE * (b + 1), state.contacts.size)):
            sums = _counted(sums, state.draws, state.contacts[slot])
        _note(state.blocks[b], sums)
        total = _joined(total, state.blocks[b])
    _note(state.sums[0], total)


@inlined
def _happens(m: Record, sums: Record, path: _Path) -> bool:
    """Whether one of the contacts in these sums breaks or re-attaches on a path."""
    if path.side > 0.0 and path.end >= sums.ahead:
        return True
    if path.side < 0.0 and path.end <= sums.behind:
        return True
    return _wait(m, sums.until) <= path.h


@inlined
def _pass(m: Record, sums: Record | _Sums, path: _Path) -> None:
    """Carry contacts without events along a path."""
    m.impulse += sums.stiffness * (path.x * path.h + _area(path, path.h))
    m.impulse -= sums.origins * path.h
    m.impulse += sums.free * _free_impulse(path, path.h)
    m.lost += sums.free * _loss(path, path.h)


@inlined
def _events(state: ElementState, path: _Path) -> None:
    """Carry all contacts along a path: those with events one by one, the others
    together.

    Sums are local variables until they are complete, as each addition to a record would
    wait for the previous one.
    """
    m = state.motion[0]
    draws = state.draws
    carried = _NONE
    total = _NONE
    for b in range(state.blocks.size):
        block = state.blocks[b]
        if not _happens(m, block, path):
            carried = _joined(carried, block)
            total = _joined(total, block)
            continue
        first = SIZE * b
        last = min(first + SIZE, state.contacts.size)
        sums = _NONE
        touched = 0
        for slot in range(first, last):
            contact = state.contacts[slot]
            if contact.until < 0.0:
                reach = contact.birth + path.side * contact.threshold
                happens = path.side * (reach - path.end) <= 0.0 and path.side != 0.0
            else:
                happens = _wait(m, contact.until) <= path.h
            if happens:
                touched |= 1 << (slot - first)
            else:
                sums = _counted(sums, draws, contact)
        _note(block, sums)
        carried = _joined(carried, block)
        for i in range(last - first):
            if touched >> i & 1:
                _live(state, first + i, path)
                sums = _counted(sums, draws, state.contacts[first + i])
        _note(block, sums)
        total = _joined(total, block)
    _pass(m, carried, path)
    _note(state.sums[0], total)


@inlined
def _arrests(state: ElementState) -> None:
    """Handle a stop of the slider: after a break, draw a new track and re-attach."""
    m = state.motion[0]
    draws = state.draws
    if m.breaks == m.breaks_at_arrest:
        return
    m.breaks_at_arrest = m.breaks
    if draws.tracks:
        m.track += 1.0
        p = _draw(m, TRACK, 0xFFFFFFFF, int(m.track))
        m.factor = quantile(draws.quantiles, TRACK, p)
    if not draws.on_arrest:
        return
    for slot in range(state.contacts.size):
        if state.contacts[slot].until >= 0.0:
            x = _attach(state, slot, m.position, m.direction)
            k = _stiffness(draws, state.contacts[slot].threshold)
            m.lost += 0.5 * (m.slid * m.slid - k * x * x)
    renew(state)


@inlined
def _go(
    state: ElementState,
    v: float,
    a: float,
    h: float,
    end: float,
) -> float:
    """Move the slider along a part of a step in which it does not reverse; return the
    time at which detached contacts begin to slide, infinite if they do not.
    """
    m = state.motion[0]
    draws = state.draws
    side = 1.0 if end > m.position else -1.0 if end < m.position else 0.0
    if side != m.direction:
        _arrests(state)
        if side != 0.0:
            m.direction = side
    path = _Path(
        m.position,
        v,
        a,
        h,
        end,
        side,
        m.slid,
        math.inf,
    )
    # without a sliding force they yield immediately, and stay unstretched
    left = draws.sliding_force - side * m.slid
    if side != 0.0 and side * (end - m.position) >= left:
        yields = _when(path, left)
        path = _Path(m.position, v, a, h, end, side, m.slid, yields)
    if _happens(m, state.sums[0], path):
        _events(state, path)
    else:
        _pass(m, state.sums[0], path)
    m.slid += end - m.position
    m.slid = min(max(m.slid, -draws.sliding_force), draws.sliding_force)
    m.position = end
    # compensated sum: the error does not grow with the number of steps
    more = h + m.carry
    time = m.time + more
    m.carry = more - (time - m.time)
    m.time = time
    return path.yields


@inlined
def force_of(state: ElementState) -> float:
    """Return the current friction force, per contact."""
    m = state.motion[0]
    sums = state.sums[0]
    force = sums.stiffness * m.position - sums.origins + sums.free * m.slid
    return float(force / state.contacts.size)


@inlined
def energy_of(state: ElementState) -> float:
    """Return the energy stored in contacts, per contact."""
    m = state.motion[0]
    sums = state.sums[0]
    stretched = sums.stiffness * m.position - 2.0 * sums.origins
    energy = stretched * m.position + sums.squares + sums.free * m.slid * m.slid
    return float(0.5 * energy / state.contacts.size)


@inlined
def next_break(state: ElementState) -> tuple[float, float]:
    """Distances that the slider can move ahead, and back, until a contact breaks."""
    position = state.motion[0].position
    sums = state.sums[0]
    return max(sums.ahead - position, 0.0), max(position - sums.behind, 0.0)


@inlined
def next_attachment(state: ElementState) -> float:
    """Time until the next contact re-attaches; infinite if none does."""
    return _wait(state.motion[0], state.sums[0].until)


@bare
def step(
    state: ElementState,
    dt: float,
    velocity: float,
    displacement: float,
) -> tuple[float, float, float]:
    """Move the slider; return force, impulse and stiffness, see the docstring of this
    module.
    """
    m = state.motion[0]
    m.impulse = 0.0
    way = displacement - m.position
    v = way / dt
    a = 0.0
    h = dt
    if not math.isnan(velocity):
        a = 2.0 * (v - velocity) / dt
        v = velocity
        turn = -v / a if a != 0.0 else -1.0
        if 0.0 < turn < dt:
            _go(
                state,
                v,
                a,
                turn,
                m.position + 0.5 * v * turn,
            )
            v = 0.0
            h = dt - turn
    yields = _go(state, v, a, h, displacement)
    stiffness = state.sums[0].stiffness
    if state.draws.sliding_force > 0.0 and yields == math.inf:
        stiffness += state.sums[0].free
    N = state.contacts.size
    return force_of(state), m.impulse / N, stiffness / N

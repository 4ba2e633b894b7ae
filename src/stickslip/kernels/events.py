"""N contacts under a slider, event by event: no time step and no loop over contacts.

Between two events the slider is a damped oscillator of known stiffness (the spring and
the attached contacts), pulled by a known drive: its motion is known in closed form
(`flight`). The next event is the earliest of these: the slider reaches the nearest
breaking position, ahead (``birth position + threshold``) or behind
(``birth position - threshold``); a detached contact re-attaches; the piece of the drive
ends.

Breaking positions and times of re-attachment wait in bucket queues (`event_queue`),
whose cost does not grow with the number of contacts. The force needs two running sums,
however many contacts there are. Samples are computed from the closed form inside the
interval where they fall, so that sampling never changes the motion.

With temperature, with thresholds that grow, and with different contact areas, contacts
break by `thinning`: the queues then hold the sides of boxes, and proposals wait in a
tournament of their times. With Bell's rate alone, one box serves all contacts, that of
`shared_clock`.

Detached contacts that carry a force slide together: one element, elastic with the
contacts' stiffness up to that force and plastic beyond, follows the slider for all of
them. It yields where the slider passes one of two positions, and is elastic again once
the slider reverses: two more kinds of events, and the friction does not jump.

Symbols as in the paper, Eq. (11), per contact: ``K``, ``M``, ``eta``, slider position
``X``, drive position ``D``.
"""

import math
from typing import NamedTuple

import numpy as np

from . import event_motion as motion
from . import shared_clock
from ._jit import bare, inlined
from .drive import (
    ARRESTED,
    DRAWS_USED_UP,
    FINISHED,
    LOOK,
    NO_LOAD,
    PAUSED,
    STOPPED,
    Piece,
    Quadratic,
    Sampling,
    load_at,
)
from .event_motion import Constants, FlightLeg
from .event_queue import (
    MOVED,
    Queue,
    clear,
    drop,
    first_place,
    first_slot,
    make_queue,
    peek,
    pop,
    push,
    used,
    wide,
)
from .flight import (
    NEAR,
    NEAREST,
    Flight,
    at,
    first_crossing,
    first_turn,
    heading,
    out_of_reach,
    soon,
)
from .hazard import rate
from .oscillator import Slider
from .records import Counts, Floats, Record, Records
from .shared_clock import Clock, is_shared
from .thinning import (
    YOUTH,
    Rule,
    box_of,
    can_hold,
    grows_from_nothing,
    is_met,
    threshold_now,
)
from .tournament import enter, smallest, tournaments, winner

# When a contact attached; how far its box reaches; the largest rate there (0: nothing
# is proposed before the box ends; below 0: the contact breaks when its box ends); its
# place in the queue ahead.
BOX = np.dtype(
    [("since", float), ("reach", float), ("most", float), ("place", np.int64)]
)

_NEED = 4  # most variates that one event may use
_ULPS = 4.0 * 2.0**-52
_TRIES = 64  # most thresholds drawn for a newborn that cannot hold


class ContactDraws(NamedTuple):
    """Random numbers in the order of use: thresholds of contacts that attach, and
    delays of contacts that break.

    `fixed_delay` is the delay of all contacts: infinite if none re-attaches, NaN to
    draw from `delays`. Contacts attach with the `stretchings` along the motion, or
    unstretched if there are none. With `on_arrest` they attach when the slider first
    stops after a break, and with `tracks`, `advance_events` returns then. `variates`,
    between 0 and 1, decide when contacts in boxes break. Thresholds and stretchings
    must be multiplied by the `load` at the time.
    """

    thresholds: Floats
    delays: Floats
    fixed_delay: float
    stretchings: Floats = np.empty(0)
    on_arrest: bool = False
    tracks: bool = False
    variates: Floats = np.empty(0)
    load: Floats = NO_LOAD


class ContactsState(NamedTuple):
    """State of the engine: contacts, queues, motion.

    The fields of attached contacts are stored in ``ahead``, keyed by
    ``birth + threshold``, so that contacts that break in turn lie side by side in
    memory. Its slots are the contacts' numbers; `other` is the place in ``behind``,
    which is keyed by ``threshold - birth`` and whose slots are the places in ``ahead``.
    ``waiting`` holds the detached contacts, keyed by time. A slider that moves on, or
    back by less than a threshold, breaks no contact behind: until one comes near, a
    bound replaces the queue ``behind``, which is then filled and kept for a while.
    """

    size: int
    ahead: Queue
    behind: Queue
    waiting: Queue
    motion: Record
    cuts: Floats


class Boxes(NamedTuple):
    """Further state of contacts that break by a `Rule`.

    ``of`` holds one box per contact, ``times`` a tournament of the times of their next
    proposals and ends of boxes. With a `Rule`, the threshold stored of a contact is its
    strength; ``own`` are the strengths of contacts that keep them when they re-attach;
    if it is empty they draw new ones. ``stiffest`` bounds the total stiffness that the
    contacts may reach, over their number. With a shared clock contacts have no boxes of
    their own: all reach up to their thresholds.
    """

    rule: Rule
    of: Records
    times: Floats
    own: Floats
    stiffest: float
    clock: Clock


def make_state(
    birth: Floats,
    threshold: Floats,
    pending: Floats,
    reached: Floats,
    scale_time: float,
    motion: Record,
    boxes: float = 1.0,
) -> ContactsState:
    """Return the state of an interface at time 0.

    `birth` are the positions at which the contacts are not stretched; the last
    ``len(pending)`` contacts are detached until these times, which may be infinite.
    `reached` are stretchings at which contacts break, and `boxes` the mean number of
    boxes of a life (see `thinning`): both set the width of a bin, as `scale_time`, a
    typical delay, does for times.
    """
    N = birth.size
    attached = N - pending.size
    # Bins so wide that in smooth sliding a dozen contacts break, or leave their boxes,
    # in each.
    reach = 2.0 * float(reached.max())
    width = 12.0 * (float(reached.mean()) or 1.0) / (N * boxes)
    bins = _power_of_two(reach / width, N / 4)
    time_width = 16.0 * scale_time / N if 0 < scale_time < math.inf else 1.0
    state = ContactsState(
        size=N,
        ahead=make_queue(N, bins, width),
        behind=make_queue(N, bins, width),
        waiting=make_queue(N, _power_of_two(N / 8, N), time_width),
        motion=motion,
        cuts=np.zeros(16),
    )
    motion[0].attached = attached
    clear(state.ahead, motion[0].position)
    ending = np.flatnonzero(np.isfinite(pending))
    _fill(
        state,
        birth[:attached],
        threshold,
        attached + ending,
        pending[ending],
    )
    _look_again(state, None)
    return state


def boxed(
    state: ContactsState,
    rule: Rule,
    since: Floats,
    own: Floats,
) -> Boxes:
    """Return boxes for contacts that attached at the times `since`: empty ones, which
    the first advance draws.
    """
    N = state.size
    m = state.motion[0]
    held = attached_places(state)
    contacts = state.ahead.entries
    slots = contacts["slot"][held]
    of = np.zeros(N, BOX)
    times = np.full((1, N), np.inf)
    # A growing threshold may hold a contact that is stretched beyond its strength.
    stretched = np.abs(m.position - contacts["birth"][held])
    of["since"] = since
    of["reach"][slots] = np.maximum(contacts["threshold"][held], stretched)
    if not (shared := is_shared(rule)):
        times[0, slots] = m.time
    boxes = Boxes(
        rule,
        of,
        tournaments(times)[0],
        own,
        1.0,
        shared_clock.make_clock(N if shared else 0),
    )
    _look_again(state, boxes)
    # Only a rare draw of the strongest contacts makes them twice as stiff as now.
    return (
        boxes._replace(stiffest=2.0 * m.stiffness / max(m.attached, 1))
        if rule.as_stiff
        else boxes
    )


@bare
def _fill(
    state: ContactsState,
    birth: Floats,
    threshold: Floats,
    detached: Counts,
    until: Floats,
) -> None:
    """Enter attached contacts into the queue ahead, and detached ones into the queue of
    waiting contacts.

    A contact whose threshold has grown may be stretched beyond its strength.
    """
    for slot in range(birth.size):
        reach = max(threshold[slot], abs(state.motion[0].position - birth[slot]))
        place = push(state.ahead, reach + birth[slot], slot)
        state.ahead.entries[place]["birth"] = birth[slot]
        state.ahead.entries[place]["threshold"] = threshold[slot]
    for i in range(detached.size):
        push(state.waiting, until[i], detached[i])


def force_of(state: ContactsState) -> float:
    """Return the force of the contacts, per contact."""
    return float(motion.contact_force(state.motion[0], float(state.size)))


def attached_places(state: ContactsState) -> Counts:
    """Return the places of the attached contacts in ``ahead``."""
    return np.flatnonzero(state.ahead.entries["key"][: used(state.ahead)] < np.inf)


def attached_contacts(state: ContactsState) -> Records:
    """Return the attached contacts: number (`slot`), birth position and threshold of
    each.
    """
    return np.asarray(state.ahead.entries[attached_places(state)])


def waiting_contacts(state: ContactsState) -> Records:
    """Return the contacts that will re-attach: number (`slot`) and time (`key`)."""
    entries = state.waiting.entries[: used(state.waiting)]
    return np.asarray(entries[entries["key"] < np.inf])


def _power_of_two(wanted: float, most: float) -> int:
    return 1 << max(
        4, min(math.ceil(math.log2(max(wanted, 1.0))), math.ceil(math.log2(most + 1)))
    )


@inlined
def _reach(state: ContactsState, place: int, boxes: Boxes | None) -> float:
    """Return the largest stretching up to which the contact at a place needs no
    attention: the reach of its box, or its threshold.
    """
    if boxes is None:
        return float(state.ahead.entries[place]["threshold"])
    return float(boxes.of[state.ahead.entries[place]["slot"]]["reach"])


@inlined
def _first_behind(state: ContactsState) -> float:
    """Return minus the slider position at which the next contact behind may break or
    leave its box.
    """
    m = state.motion[0]
    return peek(state.behind) if m.keeps_behind else float(m.least)


@bare
def _keep_behind(state: ContactsState, boxes: Boxes | None) -> None:
    """Fill the queue of the contacts behind, and keep it up to date from now on."""
    contacts = state.ahead.entries
    clear(state.behind, -state.motion[0].position)
    for place in range(used(state.ahead)):
        if contacts[place]["key"] < np.inf:
            contacts[place]["other"] = push(
                state.behind,
                _reach(state, place, boxes) - contacts[place]["birth"],
                place,
            )
    state.motion[0].keeps_behind = 1


@bare
def _look_again(state: ContactsState, boxes: Boxes | None) -> None:
    """Recompute the sums of the stretchings about the present position, so that
    rounding does not accumulate, and the places, which may have changed.
    """
    m = state.motion[0]
    contacts = state.ahead.entries
    m.reference = m.position
    m.least = np.inf
    m.origins = m.squares = m.stiffness = 0.0
    for place in range(used(state.ahead)):
        if contacts[place]["key"] < np.inf:
            m.least = min(
                m.least, _reach(state, place, boxes) - contacts[place]["birth"]
            )
            y = contacts[place]["birth"] - m.reference
            k = 1.0
            if boxes is not None:
                boxes.of[contacts[place]["slot"]]["place"] = place
                if boxes.rule.as_stiff:
                    k = contacts[place]["threshold"]
            m.origins += k * y
            m.squares += k * y * y
            m.stiffness += k
    m.attachments = m.keeps_behind = 0
    state.ahead.counts[MOVED] = state.behind.counts[MOVED] = 0


@inlined
def _hold(
    state: ContactsState,
    slot: int,
    birth: float,
    threshold: float,
    draws: ContactDraws,
    boxes: Boxes | None,
) -> None:
    """Enter an attached contact into the queues: at its threshold, or at the edge of
    its next box.
    """
    m = state.motion[0]
    contacts = state.ahead.entries
    reach = threshold
    if boxes is not None:
        if is_shared(boxes.rule):
            for side in range(2):
                rest = threshold + (1 - 2 * side) * birth
                shared_clock.propose(
                    boxes.clock,
                    side,
                    slot,
                    rest,
                    state.size,
                    boxes.rule,
                    m,
                    draws.variates,
                )
            boxes.of[slot]["reach"] = threshold
        else:
            reach = _enclose(
                m,
                slot,
                birth,
                threshold,
                draws,
                boxes.rule,
                boxes.of,
                boxes.times,
                state.size,
            )
    place = push(state.ahead, reach + birth, slot)
    contacts[place]["birth"] = birth
    contacts[place]["threshold"] = threshold
    if boxes is not None:
        boxes.of[slot]["place"] = place
    m.least = min(m.least, reach - birth)
    if m.keeps_behind:
        contacts[place]["other"] = push(state.behind, reach - birth, place)
    if (
        m.attachments > 2 * state.size + 64
        or state.ahead.counts[MOVED]
        or state.behind.counts[MOVED]
    ):
        _look_again(state, boxes)


@inlined
def _drop(state: ContactsState, place: int) -> None:
    """Remove the contact at a place from the queues; its fields can still be read."""
    if state.motion[0].keeps_behind:
        drop(state.behind, wide(state.ahead.entries[place]["other"]))
    drop(state.ahead, place)


@inlined
def _variate(m: Record, draws: ContactDraws) -> float:
    m.variates_used += 1
    return float(draws.variates[m.variates_used - 1])


@inlined
def _rounding(m: Record) -> float:
    """Return the rounding error of a stretching far from the origin, and of a threshold
    that has grown for a long time.
    """
    return float(_ULPS * (abs(m.position) + abs(m.velocity) * m.time))


@bare
def _enclose(
    m: Record,
    slot: int,
    birth: float,
    strength: float,
    draws: ContactDraws,
    rule: Rule,
    of: Records,
    times: Floats,
    N: int,
) -> float:
    """Draw the next box of a contact; return how far it reaches."""
    own = of[slot]
    box = box_of(
        rule,
        m.position - birth,
        strength,
        m.time - own["since"],
        m.velocity,
        _rounding(m),
    )
    wait = box.time
    own["reach"] = box.reach
    own["most"] = 0.0
    if box.time == 0.0:
        own["most"] = -1.0
    elif box.most > 0.0:
        proposal = -math.log(1.0 - _variate(m, draws)) / box.most
        if proposal < box.time:
            wait = proposal
            own["most"] = box.most
    enter(times, N, slot, m.time + wait)
    return box.reach


@inlined
def _breaks(
    state: ContactsState,
    place: int,
    draws: ContactDraws,
    boxes: Boxes,
) -> bool:
    """Return whether a contact breaks that leaves its box or whose time has come."""
    m = state.motion[0]
    contact = state.ahead.entries[place]
    own = boxes.of[contact["slot"]]
    x = m.position - contact["birth"]
    strength = contact["threshold"]
    threshold = threshold_now(boxes.rule, strength, m.time - own["since"])
    if boxes.times[contact["slot"] - state.size] <= m.time and own["most"] != 0.0:
        return bool(
            own["most"] < 0.0
            or _variate(m, draws) * own["most"] < rate(boxes.rule.hazard, x, threshold)
        )
    return is_met(x, threshold, strength, _rounding(m))


@inlined
def _forget(state: ContactsState, slot: int, boxes: Boxes) -> None:
    """Clear the time of a contact's next proposal."""
    if is_shared(boxes.rule):
        shared_clock.forget(boxes.clock, slot, state.size)
    else:
        enter(boxes.times, state.size, slot, np.inf)


@inlined
def _attach(
    state: ContactsState,
    slot: int,
    draws: ContactDraws,
    boxes: Boxes | None,
    c: Constants,
) -> None:
    """Attach a contact at the position of the slider, with the next threshold and its
    stretching at birth.
    """
    m = state.motion[0]
    i = m.thresholds_used
    load = load_at(draws.load, m.time)
    threshold = load * draws.thresholds[i]
    k = 1.0
    if boxes is not None:
        if boxes.own.size:
            threshold = boxes.own[slot]
        elif grows_from_nothing(boxes.rule.growth) and draws.fixed_delay == 0.0:
            # A contact that cannot hold would re-attach again and again at this moment:
            # draw thresholds until one holds, or give up and try later.
            while (
                not can_hold(boxes.rule, threshold, m.velocity)
                and i < m.thresholds_used + _TRIES - 1
            ):
                i += 1
                threshold = load * draws.thresholds[i]
            if not can_hold(boxes.rule, threshold, m.velocity):
                m.thresholds_used = i + 1
                _forget(state, slot, boxes)
                push(state.waiting, m.time + YOUTH / boxes.rule.growth.first, slot)
                return
        if boxes.rule.as_stiff:
            k = threshold
    m.thresholds_used = i + 1
    birth = m.position
    if draws.stretchings.size:
        birth -= m.direction * load * draws.stretchings[i]
    motion.count_in(m, birth, k, c)
    m.attachments += 1
    if boxes is not None:
        boxes.of[slot]["since"] = m.time
    _hold(state, slot, birth, threshold, draws, boxes)


@inlined
def _break(
    state: ContactsState,
    place: int,
    draws: ContactDraws,
    boxes: Boxes | None,
    c: Constants,
) -> None:
    """Break the contact at a place; without delay it re-attaches at once."""
    m = state.motion[0]
    contact = state.ahead.entries[place]
    k = 1.0
    slot = wide(contact["slot"])
    if boxes is not None and boxes.rule.as_stiff:
        k = contact["threshold"]
    motion.count_out(m, contact["birth"], k, c)
    _drop(state, place)
    delay = draws.fixed_delay
    if math.isnan(delay):
        delay = draws.delays[m.delays_used]
        m.delays_used += 1
    if delay == 0.0:
        _attach(state, slot, draws, boxes, c)
        return
    if boxes is not None:
        _forget(state, slot, boxes)
    until = m.time + delay
    if draws.on_arrest:  # all at once, from where the slider stops
        until = m.time
    if until < np.inf:
        push(state.waiting, until, slot)


@bare
def _leave(
    state: ContactsState,
    place: int,
    draws: ContactDraws,
    boxes: Boxes,
    c: Constants,
) -> None:
    """Break a contact that leaves its box or whose time has come, or draw a new box."""
    if is_shared(boxes.rule) or _breaks(state, place, draws, boxes):
        _break(state, place, draws, boxes, c)
        return
    contact = state.ahead.entries[place]
    slot = wide(contact["slot"])
    birth = contact["birth"]
    strength = contact["threshold"]
    _drop(state, place)
    _hold(state, slot, birth, strength, draws, boxes)


@inlined
def _strike(
    state: ContactsState,
    side: int,
    draws: ContactDraws,
    boxes: Boxes,
    c: Constants,
) -> None:
    """Break the contact that the clock ahead (0) or behind (1) proposes, or draw the
    time of its next proposal.
    """
    m = state.motion[0]
    slot = winner(boxes.clock.readings[side], state.size)
    place = boxes.of[slot]["place"]
    birth = state.ahead.entries[place]["birth"]
    threshold = state.ahead.entries[place]["threshold"]
    if _variate(m, draws) < shared_clock.chance(
        boxes.clock,
        side,
        boxes.rule,
        m.position,
        m.position - birth,
    ):
        _break(state, place, draws, boxes, c)
    else:
        rest = threshold + (1 - 2 * side) * birth
        shared_clock.propose(
            boxes.clock,
            side,
            slot,
            rest,
            state.size,
            boxes.rule,
            m,
            draws.variates,
        )


@inlined
def _pass(
    state: ContactsState,
    side: int,
    draws: ContactDraws,
    boxes: Boxes | None,
    c: Constants,
) -> None:
    """Move the slider to the first position ahead or behind, and handle the event."""
    place = first_place(state.ahead) if side == 1 else first_slot(state.behind)
    state.motion[0].position = state.ahead.entries[place]["birth"] + side * _reach(
        state,
        place,
        boxes,
    )
    if boxes is None:
        _break(state, place, draws, boxes, c)
    else:
        _leave(state, place, draws, boxes, c)


class _Edges(NamedTuple):
    """Positions `ahead` and `behind` at which the element of the detached contacts
    yields.

    With `watch`, the flight also ends where the slider reverses. It ends at `low` and
    `high` as well, where the rates of the shared clocks change.
    """

    ahead: float
    behind: float
    watch: bool
    low: float
    high: float


@inlined
def _edges(
    m: Record,
    watch: bool,
    boxes: Boxes | None,
    c: Constants,
) -> _Edges:
    """Return the positions at which the element of the detached contacts yields; they
    are infinite while it does.
    """
    ahead = np.inf
    behind = -np.inf
    low = -np.inf
    high = np.inf
    if boxes is not None:
        low = boxes.clock.window[0].low
        high = boxes.clock.window[0].high
    if c.f_d == 0.0:
        return _Edges(ahead, behind, watch, low, high)
    if m.slides == 0:
        ahead = m.anchor + c.f_d if m.slid != 1 else np.inf
        behind = m.anchor - c.f_d if m.slid != -1 else -np.inf
    return _Edges(
        ahead,
        behind,
        watch or m.slides != 0 or m.slid != 0,
        low,
        high,
    )


@inlined
def _holds_again(m: Record) -> None:
    """Make the element of the detached contacts elastic again."""
    m.anchor = m.position - m.slides * m.sliding_force
    m.slides, m.slid = 0, m.slides


@inlined
def _element_turns(m: Record, flight: Flight, c: Constants) -> bool:
    """Return whether the element stops yielding, or yields again, at the start of a
    flight.
    """
    onwards = heading(flight)
    if m.slides != 0 and onwards * m.slides < 0.0:
        _holds_again(m)
        return True
    if (c.rigid or c.massless) and abs(m.position - m.anchor) < (1.0 - 1e-12) * c.f_d:
        m.slid = 0  # these flights do not report that the slider has reversed
    if m.slid != 0 and onwards * m.slid > 0.0:
        m.slides = m.slid
        m.slid = 0
        return True
    return False


@inlined
def _yields(
    m: Record,
    edges: _Edges,
    side: int,
    first: float,
) -> bool:
    """Return whether the element yields before the slider reaches the contact of key
    `first`; if so, it yields from here on.
    """
    limit = edges.ahead if side == 1 else edges.behind
    if not side * limit < first:
        return False
    m.position = limit
    m.slides = side
    m.slid = 0
    return True


@bare
def _leaps(
    state: ContactsState,
    drive: Quadratic,
    ahead: float,
    draws: ContactDraws,
    boxes: Boxes,
    c: Constants,
) -> bool:
    """Move a slider without mass towards its equilibrium; return whether an event
    interrupts it.
    """
    m = state.motion[0]
    goal = motion.balance(m, drive, c)
    if m.slides * (goal - m.position) < 0.0:
        _holds_again(m)
        return True
    edges = _edges(m, draws.on_arrest or draws.tracks, boxes, c)
    behind = _first_behind(state)
    side = int(goal > min(ahead, edges.ahead)) - int(goal < max(-behind, edges.behind))
    if side == 0:
        motion.leap(m, goal, c)
        return False
    if side == -1 and not m.keeps_behind:
        _keep_behind(state, boxes)
        return True
    first = ahead if side == 1 else behind
    motion.leap(m, side * min(first, edges.ahead if side == 1 else -edges.behind), c)
    if not _yields(m, edges, side, first):
        _pass(state, side, draws, boxes, c)
    return True


@inlined
def _begin(
    m: Record,
    drive: Quadratic,
    arrests: bool,
    boxes: Boxes | None,
    c: Constants,
) -> tuple[FlightLeg, _Edges]:
    """Return the motion from here until the next event, and the edges that end it."""
    leg = motion.set_out(m, drive, c)
    if c.f_d > 0.0 and _element_turns(m, leg.motion, c):
        leg = motion.set_out(m, drive, c)
    if c.rigid or c.massless:
        m.velocity = leg.motion.v
    return leg, _edges(m, arrests and m.breaks > m.breaks_at_arrest, boxes, c)


_TURN = 2  # the flight ends where the slider reverses


@inlined
def _next_event(
    state: ContactsState,
    leg: FlightLeg,
    edges: _Edges,
    ahead: float,
    most: float,
) -> tuple[float, float, float, int]:
    """Find the duration of the flight, at most `most`; displacement and velocity at its
    end; and what ends it.

    1 or -1: a contact ahead or behind breaks, or the element of the detached contacts
    yields there; `_TURN`: the slider reverses; 0: the flight reaches its limit, or the
    end of the interval that was searched.
    """
    v = leg.motion.v
    if leg.motion.w2 == 0.0:  # the expansion bounds the flight of a free mass
        most = min(most, leg.motion.near * (NEAREST / NEAR))
    to_ahead = max(min(ahead, edges.ahead, edges.high) - leg.X, 0.0)
    h = 0.0
    y = 0.0
    u = v
    side = 1
    applies = to_ahead == 0.0
    if not applies and v > 0.0:
        h, y, u, side, applies = soon(leg.motion, to_ahead, most)
    if not applies:
        # The contacts behind are examined only here: while the slider moves on, none of
        # them can break.
        to_behind = max(
            min(_first_behind(state), -edges.behind, -edges.low) + leg.X, 0.0
        )
        h = 0.0
        y = 0.0
        u = v
        side = 1
        applies = to_behind == 0.0
        if not applies and v < 0.0:
            h, y, u, side, applies = soon(leg.motion, -to_behind, most)
        side = -side
        if not applies:
            h = (
                0.0
                if edges.watch
                else out_of_reach(leg.motion, to_ahead, to_behind, most)
            )
            side = 0
            if h == 0.0:
                h, side = first_crossing(
                    leg.motion,
                    to_ahead,
                    to_behind,
                    most,
                    state.cuts,
                )
            turn = first_turn(leg.motion, h, state.cuts) if edges.watch else np.inf
            if turn <= h:
                h = turn
                side = _TURN
            y, u = at(leg.motion, h)
            if side == _TURN:
                u = 0.0
    return h, y, u, side


@inlined
def _crosses(
    m: Record,
    edges: _Edges,
    side: int,
    first: float,
    boxes: Boxes | None,
) -> bool:
    """Return whether the slider reaches an edge of the window before a contact or the
    element yields.
    """
    edge = edges.high if side == 1 else edges.low
    if not (
        side * edge < first
        and side * edge < side * (edges.ahead if side == 1 else edges.behind)
    ):
        return False
    m.position = edge
    if boxes is not None:
        # rounding may put a slider without mass back into the window
        boxes.clock.window[0].until = -np.inf
    return True


@inlined
def _stops(m: Record) -> bool:
    """Record that the slider reverses; return whether this stop follows a break."""
    last = m.breaks_at_arrest
    m.slid = 0
    m.breaks_at_arrest = m.breaks
    return bool(m.breaks > last)


@inlined
def _due(state: ContactsState, boxes: Boxes) -> tuple[float, int]:
    """Return the time of the next proposal and its clock: a shared one (0 or 1), a
    contact's own (-1), or the end of the window (-2).
    """
    if not is_shared(boxes.rule):
        return smallest(boxes.times), -1
    clock = boxes.clock
    due, by = shared_clock.strikes(clock, boxes.rule, state.motion[0].time)
    until = clock.window[0].until
    return (until, -2) if until < due else (due, by)


@inlined
def _happens(
    state: ContactsState,
    by: int,
    draws: ContactDraws,
    boxes: Boxes,
    c: Constants,
) -> None:
    """Handle the proposal that is due: of a shared clock, of a contact's own (-1), or
    the end of the window (-2).
    """
    if by >= 0:
        _strike(state, by, draws, boxes, c)
    elif by == -1:
        place = boxes.of[winner(boxes.times, state.size)]["place"]
        _leave(state, place, draws, boxes, c)


@inlined
def _winds(
    state: ContactsState,
    ahead: float,
    draws: ContactDraws,
    boxes: Boxes,
) -> bool:
    """Wind the shared clocks if they need it; return False if too few variates are
    left.
    """
    m = state.motion[0]
    if shared_clock.runs_evenly(boxes.clock, m):
        return True
    behind = _first_behind(state)
    return shared_clock.wind(
        boxes.clock,
        boxes.rule,
        m,
        state.ahead,
        ahead,
        behind,
        draws.variates,
    )


@inlined
def _next_attachment(state: ContactsState, on_arrest: bool) -> float:
    """Return when the next detached contact attaches; with `on_arrest`, once the slider
    has stopped.
    """
    m = state.motion[0]
    attachment = peek(state.waiting)
    if not on_arrest:
        return attachment
    return np.inf if m.breaks > m.breaks_at_arrest else max(attachment, m.time)


@inlined
def short_of(
    m: Record,
    draws: ContactDraws,
    boxes: Boxes | None,
) -> tuple[bool, bool, bool]:
    """Return whether too few thresholds, delays or variates are left for any next
    event.
    """
    thresholds = 1
    variates = False
    if boxes is not None:
        variates = (
            m.variates_used + _NEED + boxes.clock.window[0].wanted > draws.variates.size
        )
        if grows_from_nothing(boxes.rule.growth):
            thresholds = _TRIES
    delays = math.isnan(draws.fixed_delay) and m.delays_used >= draws.delays.size
    return m.thresholds_used + thresholds > draws.thresholds.size, delays, variates


@bare
def advance_events(
    state: ContactsState,
    slider: Slider,
    piece: Piece,
    sampling: Sampling,
    draws: ContactDraws,
    budget: int,
    boxes: Boxes | None = None,
) -> int:
    """Advance the state, event by event, until there is a reason to stop, or for about
    `budget` events.

    The motion records how many samples are filled and how many draws are used. numba
    compiles a version with boxes and one without, so that contacts without boxes do not
    pay for them. A slider without mass needs boxes: under fixed thresholds it would
    slip at infinite speed.
    """
    m = state.motion[0]
    acceleration = piece.drive.acceleration
    stiffest = 1.0
    if boxes is not None:
        stiffest = boxes.stiffest
    c = motion.constants(slider, m.sliding_force, float(state.size), stiffest)
    to_go = budget
    # ends: each turn takes one of the budget
    while True:
        thresholds, delays, variates = short_of(m, draws, boxes)
        if thresholds or delays or variates:
            return DRAWS_USED_UP
        if to_go <= 0:
            return PAUSED
        to_go -= 1
        ahead = peek(state.ahead)
        if boxes is not None:
            if c.massless and _leaps(state, piece.drive, ahead, draws, boxes, c):
                continue
            if not _winds(state, ahead, draws, boxes):
                return DRAWS_USED_UP
        leg, edges = _begin(m, piece.drive, draws.on_arrest or draws.tracks, boxes, c)
        attachment = _next_attachment(state, draws.on_arrest)
        due = np.inf
        by = 0
        if boxes is not None:
            due, by = _due(state, boxes)
        limit = min(min(attachment, due), piece.end)
        most = max(limit - leg.t, 0.0)
        h, y, u, side = _next_event(state, leg, edges, ahead, most)
        if side == -1 and not m.keeps_behind and -edges.low >= m.least:
            _keep_behind(state, boxes)
            continue
        ends_at = limit if side == 0 and h == most else leg.t + h

        if ends_at > piece.look and leg.t <= piece.look:
            m.looked = leg.X + at(leg.motion, piece.look - leg.t)[0]
            return LOOK
        if motion.sample_until(m, piece, sampling, leg, min(ends_at, piece.end), c):
            return STOPPED
        motion.fly(m, leg, h, y, u, acceleration, c)
        m.time = ends_at
        if side == _TURN:
            if _stops(m) and draws.tracks:
                return ARRESTED
        elif side != 0:
            first = ahead if side == 1 else _first_behind(state)
            if not (
                _crosses(m, edges, side, first, boxes) or _yields(m, edges, side, first)
            ):
                _pass(state, side, draws, boxes, c)
        elif ends_at == attachment:
            slot = first_slot(state.waiting)
            pop(state.waiting)
            _attach(state, slot, draws, boxes, c)
        elif boxes is not None and ends_at == due:
            _happens(state, by, draws, boxes, c)
        elif ends_at >= piece.end:
            return FINISHED

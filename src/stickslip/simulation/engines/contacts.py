"""N contacts, event by event, exact for their number: `stickslip.kernels.events`.

Contacts that break before a fixed threshold, or after it has grown, follow the rule of
`stickslip.kernels.thinning`.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import InputError
from stickslip.kernels import events as kernel
from stickslip.kernels.drive import (
    ARRESTED,
    DRAWS_USED_UP,
    LOOK,
    PAUSED,
    Piece,
    Sampling,
)
from stickslip.kernels.event_motion import make_motion
from stickslip.kernels.events import force_of, short_of
from stickslip.model import (
    Bell,
    Contacts,
    Delay,
    ExponentialGrowth,
    Interface,
    OnArrest,
    Slider,
    TabulatedGrowth,
)
from stickslip.model.records import hashable
from stickslip.model.rig import Rig
from stickslip.simulation.engines.base import (
    COLUMNS,
    GROWTH,
    HEAT,
    REFILLS,
    Advance,
    Beginning,
    Engine,
    Individuals,
    Leg,
    Stretchings,
    advances,
    check_newborns,
    slider_constants,
    solves,
)
from stickslip.simulation.engines.start import (
    drawing,
    drawn_lives,
    first_contacts,
    generators,
    lifetimes_in,
    lifetimes_of,
    lives_met,
    newborns,
    quantile,
    rule_of,
    track_factor,
)
from stickslip.simulation.estimates import (
    Course,
    Part,
    breaking,
    oscillation,
    shortened,
    travel_of,
)

# random numbers drawn at once; with another length the same seed gives another run
_BLOCK = 16_384
_EVENTS = 400_000  # events in an advance: some 50 ms
# Seconds to begin and end a run; of an event; of a break by the shared clock; and of
# each further box of a contact that has its own boxes.
_RUN, _EVENT, _CLOCKED_BREAK, _BOX = 2e-3, 1.8e-7, 6e-7, 2e-7
# number of contacts for which an event takes twice as long, as no cache holds them, and
# the largest such factor
_CACHED, _UNCACHED = 1.5e5, 2.0
# events of a break and its re-attachment, with a delay and without
_APART, _AT_ONCE = 2.0, 1.0
# Flights that end without a break, per radian, as the search for their end does: for a
# slider that rings, plus a number proportional to the damping ratio, up to a ratio of
# 1.
_FLIGHTS, _DAMPED_FLIGHTS = 1.0, 5.0
_FLIGHT = 9e-7  # seconds of such a flight
# damping ratio for which a search takes twice as long, and the largest such factor
_OVERDAMPED, _SLOWEST = 9.0, 9.0
# Seconds above which breaks are counted in a trial; it takes one in _PART of the
# contacts, at least _FEWEST and at most _MOST.
_WORTH_A_TRIAL = 0.006
_PART, _FEWEST, _MOST = 100, 20, 200
# Events of a trial, at least and at most, or this fraction of those expected in the
# whole run; the transient is over after the fraction _BEGUN of the trial.
_LEAST_TRIED, _MOST_TRIED, _SHARE = 20_000, 500_000, 0.03
_BEGUN = 0.4
_LOOK = 1000  # events between two checks of a trial
# seconds to compute a window of the shared clock; about four make up its width
_WINDOW = 2e-7
_CONTACT = 150.0  # bytes of a contact
# fraction of a run's time; shorter turning times are lost in the rounding of time
_FINEST_TURN = 1e-13
# lifetimes drawn for each contact that keeps its strength, which are similar
_LIVES = 16


class Attachments(NamedTuple):
    """Future of each contact: the position of the slider at which it was attached
    unstretched, its threshold, the time of re-attachment (below 0 while attached), and
    the common factor of future thresholds.
    """

    birth: Array
    threshold: Array
    until: Array
    factor: float


@solves(Contacts)
@solves(Contacts, type(None), *GROWTH, activation=HEAT)
@solves(Contacts, *GROWTH)
class EventByEvent(Engine):
    """Contacts whose next event is always known, supplied with random numbers in blocks
    of a fixed length.
    """

    columns = COLUMNS
    angle = 0.1
    takes_loads = True
    events: int = _EVENTS
    """Events in an advance."""
    mechanisms = frozenset(
        {
            "sliding_force",
            "newborn",
            "slip_to_slip_scatter",
            "on_arrest",
            "activation",
            "areas",
        }
    )

    def __init__(self, beginning: Beginning, method: Contacts) -> None:
        interface = beginning.interface
        self._delay = beginning.interface.delay
        self._interface = interface
        (
            self._initial,
            self._thresholds,
            self._delays,
            self._newborns,
            self._tracks,
            self._chances,
        ) = generators(method.seed, 6)
        self._factor = track_factor(interface, self._tracks)
        self.slider = slider_constants(beginning.slider)
        self._rule = rule_of(interface)
        # All lengths of contacts are proportional to the load.
        load = beginning.load
        unloaded = replace(beginning, velocity=beginning.velocity / load)
        x, strength, pending, since = self._first(unloaded, method.count)
        x *= load
        strength *= load
        slides = int(beginning.sliding and interface.sliding_force > 0)
        motion = make_motion(
            0.0,
            beginning.slider_velocity,
            interface.sliding_force,
            slides,
        )
        path = strength[:4096] if strength.size else np.ones(1)
        boxes = 1.0
        # contacts that grow from a small strength break before they reach the full one
        if interface.ageing is not None:
            _, path, lived = drawn_lives(interface, beginning.velocity)
            # with thermal activation most boxes are left before their side is reached
            if interface.activation is None:
                boxes = max(lived / path.size, 1.0)
        self._state = kernel.make_state(
            -x,
            strength,
            pending,
            path,
            self._delay.moment(1),
            motion,
            boxes,
        )
        self._boxes = None
        if self._rule is not None:
            own = strength if interface.keeps_areas else np.empty(0)
            self._boxes = kernel.boxed(self._state, self._rule, since, own)
            self._stiffest = self._boxes.stiffest / math.sqrt(self._factor)
        fixed = (
            self._delay.moment(1)
            if isinstance(self._delay, Delay | OnArrest)
            else math.nan
        )
        happens = isinstance(self._delay, OnArrest), interface.slip_to_slip_scatter > 0
        self._draws = self._with_thresholds(
            kernel.ContactDraws(
                np.empty(0),
                np.empty(0),
                fixed,
                np.empty(0),
                *happens,
            )
        )

    @staticmethod
    def check(interface: Interface) -> None:
        """Raise `InputError` for contacts that could break and re-attach endlessly at
        one moment.
        """
        if interface.activation is not None:
            check_newborns(interface)
        if interface.newborn is None:
            return
        if isinstance(interface.ageing, ExponentialGrowth):
            held = interface.newborn.survival(
                [-interface.ageing.newborn, interface.ageing.newborn]
            )
            if (lost := 1.0 - float(held[0] - held[1])) > 1e-3:
                raise InputError(
                    f"Interface.newborn = {interface.newborn}: {100 * lost:.3g} % of "
                    "the contacts would re-attach "
                    f"beyond ExponentialGrowth.newborn = {interface.ageing.newborn:g}; "
                    "narrow it",
                    "Interface.newborn",
                )
        if interface.delay.moment(1) == 0 and (
            interface.slip_to_slip_scatter > 0 or interface.keeps_areas
        ):
            raise InputError(
                f"Interface.delay = {interface.delay}: must be above 0 with newborn "
                "stretchings that a weak track or a "
                "small site does not hold",
                "Interface.delay",
            )

    @staticmethod
    def cost(rig: Rig, method: Contacts, course: Course) -> tuple[Part, ...]:
        """Return the work of a run, by part: of breaks, and of turning points while the
        slider rings.
        """
        interface = rig.interface
        count = method.count
        how = " by thermal activation" if interface.activation is not None else ""
        lives, boxes = lifetimes_in(rig, course)
        each = _EVENT * min(1.0 + count / _CACHED, _UNCACHED)
        plain = _APART if interface.delay.moment(1) > 0.0 else _AT_ONCE
        breaks = count * lives
        events = plain * breaks
        damping = rig.slider.damping if isinstance(rig.slider, Slider) else 0.0
        ratio = damping * rig.drive.duration / (2.0 * course.turns or math.inf)
        each *= min(1.0 + ratio / _OVERDAMPED, _SLOWEST)
        # Once the ringing has decayed, turning points cost nothing, unless rounding
        # hides them or detached contacts stick again there.
        hidden = course.turns * _FINEST_TURN > 1.0
        turns_again = interface.sliding_force > 0.0 or hidden
        radians = course.turns if turns_again else course.rung
        ringing = oscillation(rig, radians)
        has_fixed_thresholds = rule_of(interface) is None and not rig.drive.load
        estimate = each * events + sum(part.seconds for part in ringing)
        if (
            has_fixed_thresholds
            and isinstance(rig.slider, Slider)
            and estimate > _WORTH_A_TRIAL
        ):
            most = int(min(max(_SHARE * events, _LEAST_TRIED), _MOST_TRIED))
            found, further = tried(hashable(rig.natural), most)
            lives = min(found, lives)
            breaks = count * lives
            events = plain * breaks
            each_turn = _FLIGHTS + _DAMPED_FLIGHTS * min(ratio, 1.0)
            flights = min(further * max(breaks, 1.0), each_turn * course.turns)
            if not hidden:
                ringing = oscillation(rig, radians, _FLIGHT * flights)
        more = _RUN + _BOX * count * boxes
        if isinstance(interface.activation, Bell) and interface.ageing is None:
            travel = interface.threshold_distribution.moment(1) * (
                course.distance + course.shaken
            )
            each = _CLOCKED_BREAK
            events = breaks
            more = _WINDOW * 4.0 * travel / interface.activation.width
        more += drawing(rig, count)
        if interface.newborn is not None:
            more += quantile(interface) * max(breaks, _BLOCK)
        each *= events / max(breaks, 1.0)
        return *ringing, breaking(
            count,
            lives,
            each,
            _CONTACT,
            how,
            more,
        )

    def _first(
        self, beginning: Beginning, count: int
    ) -> tuple[Array, Array, Array, Array]:
        """Draw stretchings and strengths of all contacts (detached ones last), the
        times at which these re-attach, and those at which the others attached.

        Detached contacts that keep their strengths have them as well.
        """
        rng = self._initial
        interface = self._interface
        velocity = beginning.velocity
        keeps = interface.keeps_areas
        if self._rule is None or not beginning.sliding:
            # Growth towards a limit has reached it; growth without a limit begins.
            ended = isinstance(interface.ageing, ExponentialGrowth | TabulatedGrowth)
            since = np.full(count, -math.inf if ended else 0.0)
            return *first_contacts(beginning, count, rng, self._factor), since
        drawn = count if keeps else 4 * count + 1000
        start, strength = newborns(interface, drawn, self._factor, rng, rng)
        if not keeps:
            reached, _ = lifetimes_of(self._rule, start, strength, velocity, rng)
            x, strength, pending, moved = lives_met(
                beginning,
                count,
                rng,
                start,
                strength,
                reached,
            )
            return x, strength, pending, -moved / velocity
        # Each contact is found somewhere in one of its lifetimes and the delay after
        # it, with a probability proportional to their length.
        every = np.repeat(start, _LIVES), np.repeat(strength, _LIVES)
        reached, _ = lifetimes_of(self._rule, *every, velocity, rng)
        path = reached.reshape(count, _LIVES) - start[:, None]
        length = path + velocity * self._delay.sample(rng, path.size).reshape(
            path.shape
        )
        met = np.argmax(
            rng.random((count, 1)) * length.sum(axis=1, keepdims=True)
            < np.cumsum(length, axis=1),
            axis=1,
        )
        path, length = (
            np.take_along_axis(one, met[:, None], axis=1)[:, 0]
            for one in (path, length)
        )
        moved = length * rng.random(count)
        order = np.argsort(moved >= path, kind="stable")  # attached contacts first
        held = np.count_nonzero(moved < path)
        moved = moved[order]
        pending = (length[order] - moved)[held:] / velocity
        return (start[order] + moved), strength[order], pending, -moved / velocity

    def _with_thresholds(self, draws: kernel.ContactDraws) -> kernel.ContactDraws:
        """Return the draws with new thresholds for contacts that attach; fewer where an
        arrest soon replaces them.
        """
        count = (
            min(_BLOCK, max(2 * self._state.size, 64))
            if self._interface.slip_to_slip_scatter
            else _BLOCK
        )
        x, threshold = newborns(
            self._interface,
            count,
            self._factor,
            self._newborns,
            self._thresholds,
        )
        self._state.motion[0].thresholds_used = 0
        return draws._replace(
            thresholds=threshold,
            stretchings=x if self._interface.newborn else np.empty(0),
        )

    def _refill(self) -> None:
        """Draw the random numbers that are used up."""
        m = self._state.motion[0]
        draws = self._draws
        thresholds, delays, variates = short_of(m, draws, self._boxes)
        if thresholds:
            draws = self._with_thresholds(draws)
        if delays:
            draws = draws._replace(delays=self._delay.sample(self._delays, _BLOCK))
            m.delays_used = 0
        if variates:
            wanted = (
                int(self._boxes.clock.window[0].wanted)
                if self._boxes is not None
                else 0
            )
            draws = draws._replace(variates=self._chances.random(_BLOCK + wanted))
            m.variates_used = 0
        self._draws = draws

    def here(self) -> tuple[float, float]:
        """Time, and position of the slider."""
        m = self._state.motion[0]
        return float(m.time), float(m.position)

    def contact_force(self) -> float:
        """Return the current mean force of the contacts."""
        return force_of(self._state)

    def stretchings(self, X: float | None = None) -> Stretchings:
        """Return the stretchings of the attached contacts, with the slider at `X` or at
        its present position.
        """
        x = (self.here()[1] if X is None else X) - kernel.attached_contacts(
            self._state
        )["birth"]
        return Stretchings(x, np.full(x.size, 1.0 / self._state.size), cells=False)

    def attachments(self) -> Attachments:
        """Return the future of every contact."""
        count = self._state.size
        found = Attachments(
            np.zeros(count),
            np.zeros(count),
            np.full(count, math.inf),
            self._factor,
        )
        contacts = kernel.attached_contacts(self._state)
        held = contacts["slot"]
        found.birth[held] = contacts["birth"]
        found.threshold[held] = contacts["threshold"]
        found.until[held] = -1.0
        waiting = kernel.waiting_contacts(self._state)
        found.until[waiting["slot"]] = waiting["key"]
        if self._boxes is not None and self._boxes.own.size:
            found.threshold[:] = self._boxes.own
        return found

    def individuals(self) -> Individuals:
        """Return the current stretching of each contact."""
        stretching = np.zeros(self._state.size)
        attached = np.zeros(self._state.size, dtype=bool)
        contacts = kernel.attached_contacts(self._state)
        stretching[contacts["slot"]] = self.here()[1] - contacts["birth"]
        attached[contacts["slot"]] = True
        return Individuals(stretching, attached)

    def _arrest(self) -> None:
        """Draw the factor of a new track, as the slider has stopped after a break."""
        before = self._factor
        self._factor = track_factor(self._interface, self._tracks)
        self._draws = self._with_thresholds(self._draws)
        # contacts on a strong track are stiffer as well
        if self._boxes is not None and self._interface.areas:
            self._boxes.own[:] *= math.sqrt(self._factor / before)
            stiffest = max(
                self._boxes.stiffest, self._stiffest * math.sqrt(self._factor)
            )
            self._boxes = self._boxes._replace(stiffest=stiffest)

    def advance(self, leg: Leg) -> Advance:
        """Advance by several events."""
        m = self._state.motion[0]
        self._draws = self._draws._replace(load=leg.load)
        sampling = Sampling(leg.times, np.empty((leg.times.size, len(COLUMNS))))
        seen: list[Stretchings] = []
        m.sample = 0
        last = m.events + self.events
        looks = (*leg.looks, math.inf)
        for _ in range(REFILLS):
            piece = Piece(leg.drive, leg.end, leg.stop, looks[len(seen)])
            left = last - m.events
            why = kernel.advance_events(
                self._state,
                self.slider,
                piece,
                sampling,
                self._draws,
                left,
                self._boxes,
            )
            if why == DRAWS_USED_UP:
                self._refill()
            elif why == ARRESTED:
                self._arrest()
            # the kernel stops before the flight that passes the snapshot, and does not
            # cut the flight in two
            elif why == LOOK:
                seen.append(self.stretchings(m.looked))
            else:
                break
        else:
            why = PAUSED
        # snapshots at the very end of the leg
        reached = np.searchsorted(leg.looks, m.time, side="right")
        seen += [self.stretchings() for _ in range(len(seen), int(reached))]
        return Advance(sampling.samples[: m.sample], tuple(seen), over=why != PAUSED)


@lru_cache(maxsize=256)
def tried(rig: Rig, most: int = _LEAST_TRIED) -> tuple[float, float]:
    """Return the number of breaks of a contact in a run, and the number of flights of
    the slider that end without an event per break, from a trial with few contacts.

    The trial lasts at most `most` events; both are infinite if no contact breaks in its
    later part. No formula gives how far a slider slips past contacts that are still
    detached.
    """
    method = rig.method
    assert isinstance(method, Contacts)
    few = min(max(method.count // _PART, _FEWEST), _MOST, method.count)
    beginning = Beginning(rig.interface, rig.slider, rig.velocity, rig.start)
    engine = EventByEvent(beginning, Contacts(few, seed=method.seed))
    engine.events = _LOOK
    looks = np.transpose([*_looks_of(engine, beginning, rig, most)])
    travel, breaks, events = looks
    whole = sum(map(travel_of, rig.drive.pieces))
    begun = np.searchsorted(travel, _BEGUN * travel[-1])
    rest = max(whole - travel[-1], 0.0) / max(travel[-1] - travel[begun], 1e-300)
    ended = travel[-1] > (1.0 - 1e-9) * whole
    if breaks[-1] == breaks[begun] and not ended:
        return math.inf, math.inf
    plain = _APART if rig.interface.delay.moment(1) > 0.0 else _AT_ONCE
    further = max(events[-1] / max(breaks[-1], 1) - plain, 0.0)
    more = rest * (breaks[-1] - breaks[begun])
    return float((breaks[-1] + more) / few), float(further)


def _looks_of(
    engine: EventByEvent, beginning: Beginning, rig: Rig, most: int
) -> Iterator[tuple[float, int, int]]:
    """Follow the drive of a rig for at most `most` events; yield the distance of the
    drive, and the numbers of breaks and events so far.
    """
    position = beginning.drive_position(engine.contact_force())
    motion = engine._state.motion[0]
    past = 0.0
    yield 0.0, 0, 0
    for piece in map(shortened, rig.drive.pieces):
        begin, _ = engine.here()
        leg = Leg.along(piece, begin, position)
        for _ in advances(engine, leg):
            time, _ = engine.here()
            part = past + travel_of(piece) * (time - begin) / piece.duration
            yield part, int(motion.breaks), int(motion.events)
            if motion.events > most:
                return
        past += travel_of(piece)
        position = float(leg.drive_position(np.asarray(leg.end)))

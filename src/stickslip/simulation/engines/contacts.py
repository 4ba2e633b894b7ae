"""N contacts, event by event, exact for their number: `stickslip.kernels.events`.

Whatever makes contacts break before a fixed threshold, or after it has grown, is the
rule of `stickslip.kernels.thinning`.
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
    way_of,
)

# random numbers drawn at once; the same seed gives another run with another length
_BLOCK = 16_384
_EVENTS = 400_000  # events in an advance: some 50 ms
# Seconds that a run takes to begin and to end; an event; a break by the shared clock;
# and another box of a contact that is in boxes of its own.
_RUN, _EVENT, _CLOCKED_BREAK, _BOX = 2e-3, 1.8e-7, 6e-7, 2e-7
# an event takes twice as long of so many contacts, which no cache holds, up to so much
_CACHED, _UNCACHED = 1.5e5, 2.0
# events of a break and the attachment after it, and where that is the same event
_APART, _AT_ONCE = 2.0, 1.0
# Flights that end without a break, in a radian, as the search for its end does: of a
# slider that rings, and more the more it is damped, up to a damping ratio of 1.
_FLIGHTS, _DAMPED_FLIGHTS = 1.0, 5.0
_FLIGHT = 9e-7  # seconds of such a flight
# Searches take once more for each such damping ratio, up to so many times.
_OVERDAMPED, _SLOWEST = 9.0, 9.0
# Seconds from which on lives are counted in a trial, of one of so many of the contacts,
# of so many at least and at most.
_WORTH_A_TRIAL = 0.006
_PART, _FEWEST, _MOST = 100, 20, 200
# It goes on for so many events, at least and at most, or this part of those that theory
# has in the whole run; its beginning is past after that part of the trial.
_LEAST_TRIED, _MOST_TRIED, _SHARE = 20_000, 500_000, 0.03
_BEGUN = 0.4
_LOOK = 1000  # events between two looks at a trial
# seconds that it takes to lay a window of the shared clock, some four on its width
_WINDOW = 2e-7
_CONTACT = 150.0  # bytes of a contact
# of a run's time; shorter turns of the slider are lost in the rounding of time
_FINEST_TURN = 1e-13
# the same for each contact that keeps its strength: its lifetimes are much alike
_LIVES = 16


class Attachments(NamedTuple):
    """Of each contact where it was attached unstretched, its threshold, and when it
    re-attaches: below 0 while it is attached; and the factor of thresholds to come.
    """

    birth: Array
    threshold: Array
    until: Array
    factor: float


@solves(Contacts)
@solves(Contacts, type(None), *GROWTH, activation=HEAT)
@solves(Contacts, *GROWTH)
class EventByEvent(Engine):
    """Contacts whose next event is always known; fed with random numbers in blocks
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
        # All lengths that contacts have are in proportion to the load.
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
        # contacts that grow from little do not get as far as their strengths
        if interface.ageing is not None:
            _, path, lived = drawn_lives(interface, beginning.velocity)
            # by heat most boxes are left before the contact is at their side
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
        """Raise `InputError` for contacts that could break and re-attach for ever at
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
        """Return the work of a run, by part: of breaks, and of turns while the
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
        # Once it rings no more, turns cost nothing, unless rounding hides them or
        # detached contacts hold again there.
        hidden = course.turns * _FINEST_TURN > 1.0
        turns_again = interface.sliding_force > 0.0 or hidden
        radians = course.turns if turns_again else course.rung
        ringing = oscillation(rig, radians)
        plainly = rule_of(interface) is None and not rig.drive.load
        plainly = plainly and isinstance(rig.slider, Slider)
        told = each * events + sum(part.seconds for part in ringing)
        if plainly and told > _WORTH_A_TRIAL:
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
            way = interface.threshold_distribution.moment(1) * (
                course.distance + course.shaken
            )
            each = _CLOCKED_BREAK
            events = breaks
            more = _WINDOW * 4.0 * way / interface.activation.width
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
        """Draw stretchings and strengths of all contacts (detached last), when these
        re-attach, and when those did.

        Detached contacts that keep their strengths have them, too.
        """
        rng = self._initial
        interface = self._interface
        velocity = beginning.velocity
        keeps = interface.keeps_areas
        if self._rule is None or not beginning.sliding:
            # Growth towards a strength has come to its end; growth without end begins.
            ended = isinstance(interface.ageing, ExponentialGrowth | TabulatedGrowth)
            since = np.full(count, -math.inf if ended else 0.0)
            return *first_contacts(beginning, count, rng, self._factor), since
        drawn = count if keeps else 4 * count + 1000
        start, strength = newborns(interface, drawn, self._factor, rng, rng)
        if not keeps:
            reached, _ = lifetimes_of(self._rule, start, strength, velocity, rng)
            x, strength, pending, gone = lives_met(
                beginning,
                count,
                rng,
                start,
                strength,
                reached,
            )
            return x, strength, pending, -gone / velocity
        # Each is met somewhere in one of its own lifetimes and the time after it, the
        # long ones more often.
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
        gone = length * rng.random(count)
        order = np.argsort(gone >= path, kind="stable")  # the attached first
        held = np.count_nonzero(gone < path)
        gone = gone[order]
        pending = (length[order] - gone)[held:] / velocity
        return (start[order] + gone), strength[order], pending, -gone / velocity

    def _with_thresholds(self, draws: kernel.ContactDraws) -> kernel.ContactDraws:
        """Return the draws with new thresholds of contacts that attach; fewer where
        they are soon out of date.
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
        """Draw what is used up."""
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
        """Force of the contacts now, per contact."""
        return force_of(self._state)

    def stretchings(self, X: float | None = None) -> Stretchings:
        """Stretchings of the attached contacts now, with the slider at `X` or where
        it is.
        """
        x = (self.here()[1] if X is None else X) - kernel.attached_contacts(
            self._state
        )["birth"]
        return Stretchings(x, np.full(x.size, 1.0 / self._state.size), cells=False)

    def attachments(self) -> Attachments:
        """Return what is to come of every contact."""
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
        """Every contact by itself, now."""
        stretching = np.zeros(self._state.size)
        attached = np.zeros(self._state.size, dtype=bool)
        contacts = kernel.attached_contacts(self._state)
        stretching[contacts["slot"]] = self.here()[1] - contacts["birth"]
        attached[contacts["slot"]] = True
        return Individuals(stretching, attached)

    def _arrest(self) -> None:
        """The slider has stopped after a break: contacts attach to another track."""
        before = self._factor
        self._factor = track_factor(self._interface, self._tracks)
        self._draws = self._with_thresholds(self._draws)
        # those of a strong track are stiffer, too
        if self._boxes is not None and self._interface.areas:
            self._boxes.own[:] *= math.sqrt(self._factor / before)
            stiffest = max(
                self._boxes.stiffest, self._stiffest * math.sqrt(self._factor)
            )
            self._boxes = self._boxes._replace(stiffest=stiffest)

    def advance(self, leg: Leg) -> Advance:
        """Go on by some events."""
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
            # before the flight that passes it, so that none is cut in two
            elif why == LOOK:
                seen.append(self.stretchings(m.looked))
            else:
                break
        else:
            why = PAUSED
        # at the very end
        reached = np.searchsorted(leg.looks, m.time, side="right")
        seen += [self.stretchings() for _ in range(len(seen), int(reached))]
        return Advance(sampling.samples[: m.sample], tuple(seen), over=why != PAUSED)


@lru_cache(maxsize=256)
def tried(rig: Rig, most: int = _LEAST_TRIED) -> tuple[float, float]:
    """How often a contact breaks in a run, and how many flights of the slider end
    without a break or an attachment for each that does break, as in a trial with few
    contacts for at `most` so many events; infinite where it has shown no break of late.

    No formula says how far a slider slips past contacts that are still detached.
    """
    method = rig.method
    assert isinstance(method, Contacts)
    few = min(max(method.count // _PART, _FEWEST), _MOST, method.count)
    beginning = Beginning(rig.interface, rig.slider, rig.velocity, rig.start)
    engine = EventByEvent(beginning, Contacts(few, seed=method.seed))
    engine.events = _LOOK
    looks = np.transpose([*_looks_of(engine, beginning, rig, most)])
    way, breaks, events = looks
    whole = sum(map(way_of, rig.drive.pieces))
    begun = np.searchsorted(way, _BEGUN * way[-1])
    rest = max(whole - way[-1], 0.0) / max(way[-1] - way[begun], 1e-300)
    ended = way[-1] > (1.0 - 1e-9) * whole
    if breaks[-1] == breaks[begun] and not ended:
        return math.inf, math.inf
    plain = _APART if rig.interface.delay.moment(1) > 0.0 else _AT_ONCE
    further = max(events[-1] / max(breaks[-1], 1) - plain, 0.0)
    more = rest * (breaks[-1] - breaks[begun])
    return float((breaks[-1] + more) / few), float(further)


def _looks_of(
    engine: EventByEvent, beginning: Beginning, rig: Rig, most: int
) -> Iterator[tuple[float, int, int]]:
    """Go along the drive of a rig for at `most` so many events; yield how far the drive
    has come, and the breaks and events up to there.
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
            part = past + way_of(piece) * (time - begin) / piece.duration
            yield part, int(motion.breaks), int(motion.events)
            if motion.events > most:
                return
        past += way_of(piece)
        position = float(leg.drive_position(np.asarray(leg.end)))

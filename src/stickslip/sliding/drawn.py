"""The linear response and the noise of contacts that draw, with each life, how they
pull: stretched or larger ones.

While it holds such a contact pulls with ``f = a + b x`` at the distance ``x`` from its
attachment: newborns stretched by ``a``, or contacts of the area ``b**2``. Without
ageing and temperature a life depends on it alone, so that

    kappa(s) = (1 - E) [f_d (1 - P^) - q <Int f exp(-q x) dx>]/[(<l> + v <tau>) (1 - E
    P^)]

per contact, as of equal contacts; `l` is the distance to the break and ``P^`` its
transform. Integrals over a life are sums over panels, with what is left of the
contacts, and of their `a`, `b`, ``a f`` and ``b f``, at their nodes.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from stickslip.errors import InputError
from stickslip.model import Delay, Interface
from stickslip.model.distribution import Distribution, nodes_between
from stickslip.model.newborn import stretching_nodes
from stickslip.sliding.response import (
    STEP,
    Array,
    ComplexArray,
    Fluctuations,
    Parts,
    Response,
    ResponseScales,
    Unperturbed,
    along_logarithm,
)

# wave number, over one over the standard deviation, up to which anything of a life is
# remembered
_FINEST = 25.0
# longest life over the standard deviation: seconds to compute, once for an interface
_NARROWEST = 150.0
_NODES = 16  # of a panel
_PHASE = 10.0  # that a wave may turn on one
_TABULATED = 4  # numbers of a life at a wave
# steps of frequencies; of those at which lives are known from a table
_FEW = 8_000
_MOST = 16 * _FEW
_TABLE = 1e-6  # relative error of their table, below that of a scan


class Lives(NamedTuple):
    """Fractions of contacts left after a distance: of their number, and of their `f`,
    `a`, `b`, ``a f`` and ``b f``.
    """

    held: Array
    """At nodes, times the weights of these, shape (n, 6)."""
    newborn: Array
    """Of newborns, and its slope in the distance, shape (2, 6)."""
    x: Array
    """Nodes, shape (n,)."""
    highest: float
    """Wave number that the nodes resolve; a faster perturbation finds newborns
    alone.
    """
    unbroken: int
    """Panels at the beginning in which none of stretched newborns breaks."""


@lru_cache(maxsize=32)
def lives_of(interface: Interface) -> Lives:
    """Return the lives of contacts that draw their areas, or their stretchings at
    birth.
    """
    thresholds = interface.threshold_distribution
    newborn = interface.newborn
    largest = float(thresholds.inverse_survival(1e-8))
    knots = np.array(thresholds.knots)
    if newborn is None:
        # by quadrature, of roots as well
        beyond: Any = partial(Distribution.partial_moment, thresholds)
        std = math.sqrt(thresholds.moment(1) - float(beyond(0.0, 0.5)) ** 2)
        end = math.sqrt(largest)
        breaks = np.sqrt(knots[knots > 0])

        def left(x: Array) -> list[Array]:
            number, b, square = (beyond(x * x, 0.5 * order) for order in range(3))
            return [
                number,
                x * b,
                0.0 * x,
                b,
                0.0 * x,
                x * square,
            ]
    else:
        born, part = stretching_nodes(newborn, thresholds)
        std = math.hypot(thresholds.standard_deviation(), newborn.standard_deviation())
        end = largest - float(born.min())
        breaks = np.empty(0)

        def left(x: Array) -> list[Array]:
            reached = np.maximum(x[:, None] + born, np.abs(born))
            holds = (
                part * thresholds.survival(reached) / thresholds.survival(np.abs(born))
            )
            number, a, square = (holds @ born**order for order in range(3))
            return [
                number,
                a + x * number,
                a,
                number,
                square + x * a,
                a + x * number,
            ]

    highest = _FINEST / std
    if end > _NARROWEST * std:
        raise InputError(
            f"Interface.thresholds = {thresholds}: the linear response of contacts "
            "that draw areas or stretchings "
            f"is resolved for a scatter of 1/{_NARROWEST:g} of the largest and more; "
            "give more, or simulate",
            "Interface.thresholds",
        )
    even = np.linspace(0.0, end, math.ceil(end * highest / _PHASE) + 1)
    edges = np.union1d(even, breaks[breaks < end])
    x, weight = (each.ravel() for each in nodes_between(edges[:-1], edges[1:], _NODES))
    begin = np.stack(left(np.array([0.0, step := 1e-6 * std])), axis=1)
    newborn_too = np.stack([begin[0], (begin[1] - begin[0]) / step])
    held = np.stack(left(x), axis=1)
    breaks_from = int(np.argmax(held[:, 0] < held[0, 0] * (1.0 - 1e-15)))
    unbroken = breaks_from // _NODES if newborn is not None else 0
    return Lives(weight[:, None] * held, newborn_too, x, highest, unbroken)


def _transforms(lives: Lives, q: ComplexArray | Array) -> ComplexArray:
    """Sums of ``exp(-q x)`` over the nodes, shape (q.size, 6); of waves that turn
    often where none breaks and forces rise evenly, by the integral of that.
    """
    first = _NODES * lives.unbroken
    end = float(lives.x[first - 1] + lives.x[0]) if first else 0.0
    fast = np.abs(q) * end > _PHASE
    found = np.empty((q.size, 6), dtype=complex)
    found[~fast] = _summed(lives, q[~fast])
    late = lives._replace(x=lives.x[first:], held=lives.held[first:])
    turns = q[fast, None]
    gone = np.exp(-turns * end)
    even = (1.0 - gone) / turns
    constant, slope = lives.newborn
    found[fast] = even * constant + (even - end * gone) / turns * slope
    found[fast] += _summed(late, q[fast])
    return found


def _summed(lives: Lives, q: ComplexArray | Array) -> ComplexArray:
    """Sums of ``exp(-q x)`` over the nodes, shape (q.size, 6)."""
    parts = np.array_split(q, q.size // 128 + 1)  # no more in memory at once
    panels = lives.x.reshape(-1, _NODES)
    starts = panels[:, 0]
    offsets = panels - starts[:, None]
    if np.ptp(offsets, axis=0).max() > 1e-12 * lives.x[-1]:  # cut at knots
        return np.concatenate(
            [np.exp(-np.multiply.outer(part, lives.x)) @ lives.held for part in parts]
        )
    # panels alike: exp(-q x) is a product of the panel and of the node in it
    held = lives.held.reshape(starts.size, -1).astype(complex)
    sums = []
    for part in parts:
        before = np.exp(-np.multiply.outer(part, starts))
        # without the threads of a matrix product, which wait for one another
        of_nodes = np.einsum("qp,pk->qk", before, held)
        inside = np.exp(-np.multiply.outer(part, offsets[0]))
        each = of_nodes.reshape(*inside.shape, lives.held.shape[1])
        sums.append((inside[..., None] * each).sum(axis=1))
    return np.concatenate(sums)


def response_of_areas(interface: Interface) -> "DrawnResponse":
    """Return the linear response of contacts that draw their areas; of others raises
    `InputError`.
    """
    who = "the linear response of areas"
    interface.allow(interface.mechanisms - {"activation"}, who)
    areas = interface.areas
    if areas is None or areas.kept or areas.distribution.single:
        raise InputError(
            f"Interface.areas = {areas!r}: not available with {who} that "
            "contacts keep, or that are all "
            "alike: they are slow to forget how they started; simulate with Contacts",
            "Interface.areas",
        )
    return DrawnResponse(interface)


@dataclass(frozen=True)
class DrawnResponse(Response):
    """The linear response of contacts that draw their areas, or their stretchings at
    birth.
    """

    interface: Interface

    accuracy: ClassVar[float] = 1e-5
    has_denominator: ClassVar[bool] = True

    @property
    def inert(self) -> bool:
        """Whether contacts come back at once."""
        return self.interface.delay.moment(1) == 0

    @cached_property
    def _alone(self) -> Interface:
        """Contacts that come back at once: their lives are the same."""
        return replace(self.interface, delay=Delay(0.0))

    def fluctuations(self, velocity: float, s: ComplexArray) -> Fluctuations:
        return self._of_lives(velocity, s, self._life(s / velocity))

    def parts(self, velocity: float | Array, s: ComplexArray) -> Parts:
        if self.inert:
            return super().parts(velocity, s)
        speed, points = np.broadcast_arrays(
            np.asarray(velocity, dtype=float), np.asarray(s, dtype=complex)
        )
        here = points != 0
        found = np.zeros((2, *points.shape), dtype=complex)
        life = self._life(points[here] / speed[here])
        found[:, here] = life.broken, life.whole
        broken, whole = found
        return self._parts_of_lives(speed, points, broken, whole, life.rest)

    def sampled(self, velocity: float, top: float) -> tuple[Array, Parts]:
        del top  # known to where it turns no more
        omega = self._followed(velocity, _MOST)
        life = self._tabulated(velocity, omega)
        return omega, self._parts_of_lives(
            velocity, 1j * omega, life.broken, life.whole, life.rest
        )

    def along_axis(self, velocity: float, omega: Array) -> Fluctuations:
        life = self._tabulated(velocity, omega)
        return self._of_lives(velocity, 1j * omega, life)

    def _tabulated(self, velocity: float, omega: Array) -> Unperturbed:
        """Lives along the axis."""
        # Only the delays follow the time: lives are the same waves at all speeds, so
        # that a table does for all. Without it a look takes up to 3 s, not .4.
        y = omega / velocity
        table = _life_table(DrawnResponse(self._alone))
        low, high = np.exp(table.x[[0, -1]])
        inside = (y >= low) & (y <= high)
        known = np.empty((_TABULATED, y.size), dtype=complex)
        known[:, inside] = table(np.log(y[inside]))
        *rows, rest = self._life(1j * y[~inside])
        known[:, ~inside] = rows
        broken, until, whole, each = known
        return Unperturbed(broken, until, whole, each.real, rest)

    def _parts_of_lives(
        self,
        velocity: float | Array,
        s: ComplexArray,
        broken: ComplexArray,
        whole: ComplexArray,
        rest: float,
    ) -> Parts:
        """Parts of kappa of contacts with such lives."""
        delay = self.interface.delay
        missing = np.asarray(delay.absence(s))
        given_up = self.interface.sliding_force * broken - s / velocity * whole
        path = rest + velocity * delay.moment(1)
        return Parts(missing * given_up / path, missing + (1.0 - missing) * broken)

    def _of_lives(
        self, velocity: float, s: ComplexArray, life: Unperturbed
    ) -> Fluctuations:
        """Response and motion of contacts with such lives."""
        delay = self.interface.delay
        force = self.interface.sliding_force
        q = s / velocity
        missing = np.asarray(delay.absence(s))
        away = velocity * delay.moment(1)
        parts = self._parts_of_lives(velocity, s, life.broken, life.whole, life.rest)
        noise = life.noise(q, missing, away, force) / velocity
        return Fluctuations(parts.kappa, noise)

    def _life(self, q: ComplexArray) -> Unperturbed:
        lives = lives_of(self._alone)
        size = np.abs(q)
        held = lives.held
        newborn = lives.newborn
        found = np.empty((q.size, 6), dtype=complex)
        fast = size > lives.highest
        found[~fast] = _transforms(lives, q[~fast])
        found[fast] = newborn[0] / q[fast, None] + newborn[1] / q[fast, None] ** 2
        survival, whole, a_left, b_left, a_pull, b_pull = found.T
        rest, _, _, b, _, b_sum = held.sum(axis=0).tolist()
        each = 2.0 * ((b_sum - b_pull.real) / size**2 - a_pull.imag / size)
        return Unperturbed(
            q * survival,
            a_left + (b - b_left) / q,
            whole,
            each,
            rest,
        )

    def tabulated(self, y: Array) -> ComplexArray:
        """All of a life that depends on the wave number, shape (4, y.size)."""
        *rows, _ = self._life(1j * y)
        return np.stack(rows)

    def frequencies(self, velocity: float, top: float) -> Array:
        del top
        return self._followed(velocity, _FEW)

    def _followed(self, velocity: float, most: int) -> Array:
        """Frequencies that follow contacts and their delays, in no more steps."""
        lives = lives_of(self._alone)
        step = max(
            STEP / (lives.x[-1] + velocity * self.interface.delay.longest),
            lives.highest / most,
        )
        slow = np.geomspace(1e-4 * step, step, 60, endpoint=False)
        fast = np.geomspace(lives.highest, 1e3 * lives.highest, 90 * most // _FEW)
        return np.asarray(
            velocity
            * np.concatenate(
                [slow, np.arange(step, lives.highest - 0.5 * step, step), fast]
            )
        )

    def scales(self, velocity: float) -> ResponseScales:
        cycle = float(
            lives_of(self._alone).held[:, 0].sum()
        ) / velocity + self.interface.delay.moment(1)
        return ResponseScales(
            cycle,
            cycle,
            cycle,
            fastest=math.inf,
            leftmost=-8.0 / cycle,
        )


@lru_cache(maxsize=32)
def _life_table(response: DrawnResponse) -> "CubicSpline[np.complex128]":
    """Return the lives over the logarithm of the wave number.

    Of slower waves the noise is a small difference of what is tabulated.
    """
    lives = lives_of(response.interface)
    step = STEP / float(lives.x[-1])
    y = np.arange(0.5 * step, lives.highest, step)
    _, table = along_logarithm(lambda u: response.tabulated(np.exp(u)), y, _TABLE)
    return table

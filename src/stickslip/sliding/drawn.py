"""The linear response and the noise of contacts that draw, for each life, their area or
the stretching at which they attach.

While attached, such a contact pulls with ``f = a + b x`` at the distance ``x`` from its
attachment: newborns are stretched by ``a``, contacts of the area ``b**2`` have the
stiffness ``b``. Without ageing and thermal activation a life depends on this distance
alone, so that

    kappa(s) = (1 - E) [f_d (1 - P^) - q <Int f exp(-q x) dx>]
               / [(<l> + v <tau>) (1 - E P^)]

per contact, as for equal contacts; `l` is the distance to the break and ``P^`` its
transform. Integrals over a life are sums over panels, with the remaining contacts, and
the sums of their `a`, `b`, ``a f`` and ``b f``, at the nodes.
"""

import math
from functools import lru_cache, partial
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from stickslip.errors import InputError
from stickslip.model import Interface
from stickslip.model.distribution import Distribution, nodes_between
from stickslip.model.newborn import stretching_nodes
from stickslip.sliding.response import (
    STEP,
    Array,
    ComplexArray,
    Parts,
    Unperturbed,
    along_logarithm,
)
from stickslip.sliding.tabulated import FEW_STEPS, TabulatedResponse

# wave number times the standard deviation, beyond which a life leaves no memory
_FINEST = 25.0
# longest life over the standard deviation; it takes seconds, once for an interface
_NARROWEST = 150.0
_NODES = 16  # nodes of a panel
_PHASE = 10.0  # largest phase (rad) of a wave over a panel
_TABLE = 1e-6  # relative error of the table of lives, below that of a scan


class Lives(NamedTuple):
    """Fractions of contacts that remain at a distance: of their number, and of their
    `f`, `a`, `b`, ``a f`` and ``b f``.
    """

    held: Array
    """Fractions at nodes, times the weights of these, shape (n, 6)."""
    newborn: Array
    """Fractions at distance 0, and their derivatives by distance, shape (2, 6)."""
    x: Array
    """Nodes, shape (n,)."""
    highest: float
    """Wave number that the nodes resolve; the response at higher ones depends on
    newborns alone.
    """
    unbroken: int
    """Number of first panels in which no stretched newborn breaks."""


@lru_cache(maxsize=32)
def lives_of(interface: Interface) -> Lives:
    """Return the lives of contacts that draw their areas, or their stretchings at
    attachment.
    """
    thresholds = interface.threshold_distribution
    newborn = interface.newborn
    largest = float(thresholds.inverse_survival(1e-8))
    knots = np.array(thresholds.knots)
    if newborn is None:
        # by quadrature, which also allows fractional orders
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
    """Sums of ``exp(-q x)`` over the nodes, shape (q.size, 6).

    Until the first contact breaks the force rises linearly, and short waves are
    integrated there in closed form.
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
    parts = np.array_split(q, q.size // 128 + 1)  # to bound the memory
    panels = lives.x.reshape(-1, _NODES)
    starts = panels[:, 0]
    offsets = panels - starts[:, None]
    if np.ptp(offsets, axis=0).max() > 1e-12 * lives.x[-1]:  # cut at knots
        return np.concatenate(
            [np.exp(-np.multiply.outer(part, lives.x)) @ lives.held for part in parts]
        )
    # equal panels: exp(-q x) is a product of one factor of the panel and one of the
    # node
    held = lives.held.reshape(starts.size, -1).astype(complex)
    sums = []
    for part in parts:
        before = np.exp(-np.multiply.outer(part, starts))
        # einsum, as the threads of a matrix product would wait for one another
        of_nodes = np.einsum("qp,pk->qk", before, held)
        inside = np.exp(-np.multiply.outer(part, offsets[0]))
        each = of_nodes.reshape(*inside.shape, lives.held.shape[1])
        sums.append((inside[..., None] * each).sum(axis=1))
    return np.concatenate(sums)


def response_of_areas(interface: Interface) -> "DrawnResponse":
    """Return the linear response of contacts that draw their areas; raises `InputError`
    for others.
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


class DrawnResponse(TabulatedResponse):
    """The linear response of contacts that draw their areas, or their stretchings at
    attachment.
    """

    accuracy: ClassVar[float] = 1e-5

    @property
    def inert(self) -> bool:
        """Whether contacts re-attach at once."""
        return self.interface.delay.moment(1) == 0

    @property
    def _lives(self) -> Lives:
        return lives_of(self.without_delay.interface)

    def mean_distance(self, velocity: float) -> float:
        del velocity
        return float(self._lives.held[:, 0].sum())

    def life_table(self, velocity: float) -> "CubicSpline[np.complex128]":
        # Without ageing and thermal activation lives do not depend on the speed.
        # Without this table a scan takes up to 3 s instead of .4 s.
        del velocity
        return _life_table(self)

    def life_of(
        self, velocity: float, q: ComplexArray, transforms: ComplexArray
    ) -> Unperturbed:
        del q
        broken, until, whole, each = transforms
        return Unperturbed(
            broken, until, whole, each.real, self.mean_distance(velocity)
        )

    def parts_of(
        self,
        velocity: float,
        q: ComplexArray,
        missing: ComplexArray,
        transforms: ComplexArray,
    ) -> Parts:
        broken, _, whole, _ = transforms
        given_up = self.interface.sliding_force * broken - q * whole
        away = velocity * self.interface.delay.moment(1)
        path = self.mean_distance(velocity) + away
        return Parts(missing * given_up / path, missing + (1.0 - missing) * broken)

    def transforms(self, velocity: float, q: ComplexArray) -> ComplexArray:
        del velocity
        lives = self._lives
        size = np.abs(q)
        held = lives.held
        newborn = lives.newborn
        found = np.empty((q.size, 6), dtype=complex)
        fast = size > lives.highest
        found[~fast] = _transforms(lives, q[~fast])
        found[fast] = newborn[0] / q[fast, None] + newborn[1] / q[fast, None] ** 2
        survival, whole, a_left, b_left, a_pull, b_pull = found.T
        _, _, _, b, _, b_sum = held.sum(axis=0).tolist()
        each = 2.0 * ((b_sum - b_pull.real) / size**2 - a_pull.imag / size)
        return np.stack([q * survival, a_left + (b - b_left) / q, whole, each])

    def wave_numbers(self, away: float, most: int) -> Array:
        lives = self._lives
        top = lives.highest
        step = max(STEP / (lives.x[-1] + away), top / most)
        slow = np.geomspace(1e-4 * step, step, 60, endpoint=False)
        fast = np.geomspace(top, 1e3 * top, 90 * most // FEW_STEPS)
        return np.concatenate([slow, np.arange(step, top - 0.5 * step, step), fast])


@lru_cache(maxsize=32)
def _life_table(response: DrawnResponse) -> "CubicSpline[np.complex128]":
    """Return the transforms of a life over the logarithm of the wave number.

    It has no slower waves, for which the noise is a small difference of its entries.
    """
    lives = lives_of(response.interface)
    step = STEP / float(lives.x[-1])
    y = np.arange(0.5 * step, lives.highest, step)

    def at(u: Array) -> ComplexArray:
        return response.transforms(1.0, 1j * np.exp(u))

    return along_logarithm(at, y, _TABLE)[1]

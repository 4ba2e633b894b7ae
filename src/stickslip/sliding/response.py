"""The linear response of steady sliding, whatever the contacts.

A slider in smooth sliding is perturbed a little, ``exp(s t)``; the contacts answer with
their dynamic stiffness ``kappa(s)``, per contact, in units of ``k``. Nothing here knows
what holds the slider: with a rig the response makes the modes of `stickslip.stability`.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from stickslip.arrays import Array as Array
from stickslip.arrays import ComplexArray as ComplexArray
from stickslip.errors import InputError
from stickslip.loops import bounded

SCAN_LIMIT = 1 << 21  # largest number of frequencies in a scan
# Of a spline: steps between its first points, a fourth of a turn in all; and its
# largest relative error: no result needs less
_APART = 8
_LOST = 1e-5
# phase (rad) that the fastest part of a response may turn between neighbours of a scan;
# a full turn is 6.3
STEP = 0.2


class MeanLifetimes(NamedTuple):
    """Mean distance slid in the lifetimes of contacts, work against it, their slopes in
    ln v, and the kinds' weights.

    Each of the shape (kinds,): contacts of one kind share their attachments.
    """

    distance: Array
    work: Array
    longer: Array
    more: Array
    weight: Array


class Parts(NamedTuple):
    """Numerator and denominator of ``kappa``, both without poles; the denominator
    tends to 1 for fast perturbations.
    """

    numerator: ComplexArray
    denominator: ComplexArray

    @property
    def kappa(self) -> ComplexArray:
        """Their ratio."""
        return np.asarray(self.numerator / self.denominator)


class Fluctuations(NamedTuple):
    """Response of the contacts in steady sliding, and the motion of each of them by
    itself, at some frequencies.
    """

    kappa: ComplexArray
    noise: Array
    """Two-sided spectrum of the force of one contact; no number where it is not
    known.
    """


class ResponseScales(NamedTuple):
    """Times and frequencies of a response at one speed."""

    cycle: float  #: mean time between two attachments of a contact
    pace: float  #: time by which growth and decay are measured
    memory: float  #: longest time over which the response remembers
    fastest: float  #: frequency beyond which kappa turns no more by itself, or infinite
    #: real part left of which no mode is looked for: ``exp(-s t)`` makes the response
    #: overflow
    leftmost: float


class Response(ABC):
    """The linear response of the contacts of an interface in steady sliding.

    A model of contacts gives `kappa` or `fluctuations`, `frequencies`, `scales` and its
    `accuracy`.
    """

    #: of kappa, per contact: a mode nearer to neutral than that is undecided
    accuracy: ClassVar[float]
    #: whether its parts are a numerator and a denominator, which are 0 at 0, both
    has_denominator: ClassVar[bool] = False
    #: whether it can be followed left of the axis, so that roots there can be counted
    certain: ClassVar[bool] = False

    @property
    def inert(self) -> bool:
        """Whether ``kappa = 0`` at every `s`."""
        return False

    @property
    def origin(self) -> int:
        """Order of the common zero of numerator and denominator at ``s = 0``."""
        return int(self.has_denominator and not self.inert)

    @abstractmethod
    def frequencies(self, velocity: float, top: float) -> Array:
        """Rising angular frequencies that follow every turn of kappa, up to `top`,
        or to where it turns no more.
        """

    @abstractmethod
    def scales(self, velocity: float) -> ResponseScales:
        """Times and frequencies at a speed."""

    def terms(self, velocity: float) -> float:
        """Number of terms of the sums that follow kappa at a speed; 0 where they are
        few.
        """
        del velocity
        return 0.0

    def kappa(self, velocity: float, s: ComplexArray) -> ComplexArray:
        """``kappa(s)`` at one speed and many `s` that are not 0, also off the axis;
        not finite where it overflows.
        """
        return self.fluctuations(velocity, s).kappa

    def fluctuations(self, velocity: float, s: ComplexArray) -> Fluctuations:
        """Response of the contacts and their motion by themselves, at `s` on the
        imaginary axis that are not 0.
        """
        return Fluctuations(self.kappa(velocity, s), np.full(np.shape(s), np.nan))

    def along_axis(self, velocity: float, omega: Array) -> Fluctuations:
        """`fluctuations` at many frequencies, as exact as a scan needs them."""
        return self.fluctuations(velocity, 1j * omega)

    def parts(self, velocity: float | Array, s: ComplexArray) -> Parts:
        """Numerator and denominator of ``kappa(s)``, which is 0 at 0; here ``kappa``
        and 1.
        """
        speed, points = np.broadcast_arrays(
            np.asarray(velocity, dtype=float), np.asarray(s, dtype=complex)
        )
        found = np.zeros((2, *points.shape), dtype=complex)
        found[1] = not self.origin
        for v in np.unique(speed).tolist():
            here = (speed == v) & (points != 0)
            found[:, here] = self.parts_at(v, points[here])
        return Parts(*found)

    def parts_at(self, velocity: float, s: ComplexArray) -> Parts:
        """`parts` at one speed and `s` that are not 0."""
        kappa = self.kappa(velocity, s)
        return Parts(kappa, np.ones_like(kappa))

    def discs(self, velocity: float, top: float) -> tuple[Array, ComplexArray] | None:
        """Frequencies up to `top` and far beyond, and centres of discs through 0
        that hold kappa whatever the delay.
        """
        del velocity, top
        return None

    def sampled(self, velocity: float, top: float) -> tuple[Array, Parts]:
        """Return frequencies that follow every turn of kappa, up to `top` at least,
        and its parts there.
        """
        del top  # known to where it turns no more
        omega, table = whole_axis(self, velocity)
        kappa = table(np.log(omega))[0]
        return omega, Parts(kappa, np.ones_like(kappa))

    def stiffness(self, velocity: ArrayLike, s: ArrayLike) -> ComplexArray:
        """``kappa(s)``, at 0 as well; `velocity` and `s` broadcast.

        Raises `InputError` if `s` lies where the response does not exist.
        """
        points = np.asarray(s, dtype=complex)
        speed = np.asarray(velocity, dtype=float)
        furthest = float(np.min(points.real, initial=0.0))
        with np.errstate(over="ignore", invalid="ignore"):
            numerator, denominator = self.parts(speed, points)
            kappa = np.zeros(
                np.broadcast_shapes(numerator.shape, denominator.shape), dtype=complex
            )
            np.divide(numerator, denominator, out=kappa, where=denominator != 0)
        known = (
            not self.certain
            or furthest == 0
            or furthest > self.scales(float(np.min(speed))).leftmost
        )
        if not (known and np.all(np.isfinite(kappa))):
            raise InputError(
                f"s = {furthest:g}: too far left of the imaginary axis: the "
                "distribution of thresholds has no "
                "transform there, or exp(-s x/v) overflows; stay nearer 0"
            )
        return kappa


@lru_cache(maxsize=64)
def whole_axis(
    response: Response, velocity: float
) -> tuple[Array, "CubicSpline[np.complex128]"]:
    """Frequencies that follow all turns and peaks, and `Fluctuations` over their
    logarithm; unknown noise is 0.
    """
    omega = response.frequencies(velocity, math.inf)

    def at(some: Array) -> ComplexArray:
        return np.asarray(
            np.nan_to_num(np.stack(response.along_axis(velocity, np.exp(some))))
        )

    most = max(response.accuracy, _LOST)
    u, table = along_logarithm(at, omega, most, response.accuracy)
    return np.exp(np.union1d(u, table.x)), table


def along_logarithm(
    at: Callable[[Array], ComplexArray], omega: Array, most: float, least: float = 0.0
) -> tuple[Array, "CubicSpline[np.complex128]"]:
    """Logarithms of frequencies that follow a function, and the function over them as
    a spline, within `most` of its values, or `least` where these are rounding.

    Where contacts break together, life after life, they answer within less than a
    step: up to a sixteenth of it.
    """
    u = np.unique(
        np.interp(
            np.arange(16 * omega.size - 15) / 16.0,
            np.arange(omega.size),
            np.log(omega),
        ).round(9)
    )
    return u[::16], splined(at, u, 16 * _APART, most, least)


def splined(
    at: Callable[[Array], ComplexArray],
    u: Array,
    apart: int,
    most: float,
    least: float = 0.0,
) -> "CubicSpline[np.complex128]":
    """A function, along its last axis, as a spline through some of the points `u`.

    It begins with every `apart`-th point and checks the spline halfway between them.
    Where it misses a value by more than the fraction `most`, points on both sides are
    added, until it misses none.
    """
    known = np.append(np.arange(0, u.size - 1, apart), u.size - 1)
    found = at(u[known])
    new = np.setdiff1d((known[1:] + known[:-1]) // 2, known)
    turns = bounded("splined", u.size.bit_length() + 1)  # places between are halved
    while new.size:
        next(turns)
        more = at(u[new])
        missed = np.any(
            np.abs(CubicSpline(u[known], found, axis=-1)(u[new]) - more)
            > np.maximum(most * np.abs(more), least),
            axis=0,
        )
        known, order = np.unique(np.append(known, new), return_index=True)
        found = np.append(found, more, axis=-1)[:, order]
        place = np.searchsorted(known, new[missed])
        new = np.setdiff1d(
            np.append(known[place - 1] + known[place], known[place] + known[place + 1])
            // 2,
            known,
        )
    return CubicSpline(u[known], found, axis=-1)


class Unperturbed(NamedTuple):
    """Transforms of a life in steady sliding, of length `l` in the distance ``x``, at
    wave numbers ``q = i y``.

    ``1 - <exp(-q l)>``; of the force ``f``, with ``G = Int f exp(-q x) dx`` over the
    life, ``<conj(G) exp(-q l)>``, ``<G>`` and ``<|G|^2>``; and ``<l>``.
    """

    broken: ComplexArray
    until: ComplexArray
    whole: ComplexArray
    each: Array
    rest: float

    def noise(
        self,
        q: ComplexArray,
        missing: ComplexArray,
        away: float,
        force: float,
    ) -> Array:
        """Two-sided spectrum of the force of a contact at ``q = i y != 0``, along
        ``x``: a renewal process.

        ``1 - E`` is `missing`, the mean delay `away` in ``x``, and `force` that of a
        detached contact. With ``G`` and ``l`` those of a life and the delay after it,
        ``S = (<|G|^2> + 2 Re(<conj(G) exp(-q l)> <G>/<1 - exp(-q l)>))/<l>``.
        """
        broken, until, whole, each, rest = self
        # E, and G of the delay
        back = 1.0 - missing
        pulled = force * missing / q
        each = (
            each
            + 2.0 * (until * pulled).real
            + 2.0 * force**2 * missing.real / np.abs(q) ** 2
        )
        after = (
            (until * back + pulled)
            * (whole + (1.0 - broken) * pulled)
            / (missing + back * broken)
        )
        return np.asarray((each + 2.0 * after.real) / (rest + away))


def stretched(
    q: ComplexArray,
    lost: ComplexArray,
    work: ComplexArray,
    rest: float,
    done: float,
) -> Unperturbed:
    """A life in which the force is ``x``, from what the survival loses,
    ``M_0 - S^``, and ``W``; ``M_0, M_1`` at 0.
    """
    return Unperturbed(
        q * (rest - lost),
        lost / q,
        work,
        2.0 * (done - work.real) / np.abs(q) ** 2,
        rest,
    )


def perturbed(
    transforms: Iterable[ComplexArray],
    q: ComplexArray,
    missing: ComplexArray,
    rest: float,
    away: float,
    force: float,
) -> Parts:
    """Parts of kappa at ``q != 0``: ``1 - E`` is `missing`, the mean life `rest` and
    the mean delay `away`, in ``x``.

    Transforms of a life under a perturbation ``exp(q x)`` of what moves by ``x``: what
    the survival loses, ``M_0 - S^``; ``W``, the transform of ``x`` times it; and what
    the perturbation breaks, ``L`` and, with the stretching, ``Y``; see
    `stickslip.sliding.activated`.
    """
    lost, work, breaks, yields = transforms
    back = 1.0 - missing
    held = rest - lost
    denominator = missing + back * q * held
    given_up = (lost - yields + force * breaks) * denominator
    taken_up = q * back * breaks * (work - force * held)
    return Parts((given_up + taken_up) / (rest + away), denominator)

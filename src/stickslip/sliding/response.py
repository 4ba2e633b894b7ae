"""The linear response of steady sliding, for any contacts.

A slider in smooth sliding is perturbed by a small ``exp(s t)``; the contacts respond
with their dynamic stiffness ``kappa(s)``, per contact, in units of ``k``. It does not
depend on what holds the slider: with a rig it gives the modes of `stickslip.stability`.
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
# Of a spline: steps between its first points, at most a quarter turn together; and its
# largest relative error, as no result needs a smaller one.
_APART = 8
_LOST = 1e-5
# largest phase (rad) that the fastest part of a response turns between neighbouring
# points of a scan; a full turn is 6.3
STEP = 0.2


class MeanLifetimes(NamedTuple):
    """Mean distance slid in the lifetimes of contacts and the work in it, the
    derivatives of both by ln v, and the weights of the kinds of contacts.

    Each has the shape (kinds,): contacts of one kind share their attachments.
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
        """Ratio of numerator and denominator."""
        return np.asarray(self.numerator / self.denominator)


class Fluctuations(NamedTuple):
    """Response of the contacts in steady sliding, and the noise of each contact, at
    some frequencies.
    """

    kappa: ComplexArray
    noise: Array
    """Two-sided spectrum of the force of one contact; NaN where it is not known."""


class ResponseScales(NamedTuple):
    """Times and frequencies of a response at one speed."""

    cycle: float  #: mean time between two attachments of a contact
    pace: float  #: unit of time for growth and decay
    memory: float  #: longest time over which the response has memory
    fastest: float  #: frequency above which kappa has constant phase; or infinite
    #: real part to the left of which modes are not searched, as ``exp(-s t)`` makes the
    #: response overflow
    leftmost: float


class Response(ABC):
    """The linear response of the contacts of an interface in steady sliding.

    A model of contacts defines `kappa` or `fluctuations`, `frequencies`, `scales` and
    its `accuracy`.
    """

    #: error of kappa, per contact: a mode closer to neutral than this is undecided
    accuracy: ClassVar[float]
    #: whether its parts are a numerator and a denominator that are both 0 at 0
    has_denominator: ClassVar[bool] = False
    #: whether it is known to the left of the axis, so that roots there can be counted
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
        """Increasing angular frequencies that resolve the phase of kappa, up to `top`
        or to where it is constant.
        """

    @abstractmethod
    def scales(self, velocity: float) -> ResponseScales:
        """Times and frequencies at a speed."""

    def terms(self, velocity: float) -> float:
        """Number of terms in the sums that give kappa at a speed; 0 if they are few."""
        del velocity
        return 0.0

    def kappa(self, velocity: float, s: ComplexArray) -> ComplexArray:
        """``kappa(s)`` at one speed and many `s` other than 0, also off the axis; not
        finite where it overflows.
        """
        return self.fluctuations(velocity, s).kappa

    def fluctuations(self, velocity: float, s: ComplexArray) -> Fluctuations:
        """Response of the contacts and their noise, at `s` other than 0 on the
        imaginary axis.
        """
        return Fluctuations(self.kappa(velocity, s), np.full(np.shape(s), np.nan))

    def along_axis(self, velocity: float, omega: Array) -> Fluctuations:
        """Return `fluctuations` at many frequencies, to the accuracy that a scan
        needs.
        """
        return self.fluctuations(velocity, 1j * omega)

    def parts(self, velocity: float | Array, s: ComplexArray) -> Parts:
        """Numerator and denominator of ``kappa(s)``, which is 0 at 0; by default
        ``kappa`` and 1.
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
        """Return `parts` at one speed and `s` other than 0."""
        kappa = self.kappa(velocity, s)
        return Parts(kappa, np.ones_like(kappa))

    def discs(self, velocity: float, top: float) -> tuple[Array, ComplexArray] | None:
        """Frequencies up to `top` and far beyond, and centres of discs through 0 that
        contain kappa for any delay.
        """
        del velocity, top
        return None

    def sampled(self, velocity: float, top: float) -> tuple[Array, Parts]:
        """Return frequencies that resolve the phase of kappa, at least up to `top`, and
        its parts there.
        """
        del top  # the frequencies extend to where the phase is constant
        omega, table = whole_axis(self, velocity)
        kappa = table(np.log(omega))[0]
        return omega, Parts(kappa, np.ones_like(kappa))

    def stiffness(self, velocity: ArrayLike, s: ArrayLike) -> ComplexArray:
        """Return ``kappa(s)``, at 0 as well; `velocity` and `s` broadcast.

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
    """Frequencies that resolve all turns and peaks, and a spline of `Fluctuations` over
    their logarithm; unknown noise is 0.
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
    """Return logarithms of frequencies that resolve a function, and a spline of the
    function over them.

    Its error is at most `most` of a value, or `least` where values are rounding. Where
    contacts break together, life after life, the response changes within less than a
    step of the frequencies: the spline resolves a sixteenth of it.
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
    """Return a spline, along the last axis, of a function through some of the points
    `u`.

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

    These are ``1 - <exp(-q l)>``; then, with ``G = Int f exp(-q x) dx`` of the force
    ``f`` over the life, ``<conj(G) exp(-q l)>``, ``<G>`` and ``<|G|^2>``; and ``<l>``.
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
        ``x``: that of a renewal process.

        `missing` is ``1 - E``, `away` the mean delay in ``x``, and `force` that of a
        detached contact. With ``G`` and ``l`` of a life with the delay after it,
        ``S = (<|G|^2> + 2 Re(<conj(G) exp(-q l)> <G>/<1 - exp(-q l)>))/<l>``.
        """
        broken, until, whole, each, rest = self
        # E, and G of the delay alone
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
    """Return the transforms of a life in which the force is ``x``.

    `lost` is the decrease of the survival's transform, ``M_0 - S^``, and `work` is
    ``W``; ``M_0`` and ``M_1``, the values at 0, are `rest` and `done`.
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
    """Return the parts of kappa at ``q != 0``; `missing` is ``1 - E``, `rest` the mean
    life and `away` the mean delay, in ``x``.

    The transforms are those of a life under a perturbation ``exp(q x)`` of the slider:
    ``M_0 - S^``, the decrease of the survival's transform; ``W``, the transform of
    ``x`` times the survival; and ``L`` and ``Y``, the contacts and the stretching that
    the perturbation breaks; see `stickslip.sliding.activated`.
    """
    lost, work, breaks, yields = transforms
    back = 1.0 - missing
    held = rest - lost
    denominator = missing + back * q * held
    given_up = (lost - yields + force * breaks) * denominator
    taken_up = q * back * breaks * (work - force * held)
    return Parts((given_up + taken_up) / (rest + away), denominator)

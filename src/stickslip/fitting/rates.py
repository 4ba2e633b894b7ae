"""What more than one trace tells: the delay by the friction at several speeds, ageing by holds of several lengths."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from stickslip.answers import Answer
from stickslip.errors import InputError, number, sequence
from stickslip.measure.arrays import Array
from stickslip.model.quantities import read_quantity
from stickslip.model.units import engineering

if TYPE_CHECKING:
    from stickslip.fitting.fits import Fit

_FEWEST_SPEEDS, _FEWEST_HOLDS = 4, 3
"""One more than the unknowns of the curve: else nothing is left to tell an error by."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Delays(Answer):
    """The delay of re-attachment that the friction at several speeds tells.

    Attributes
    ----------
    draws : array
        In s, in the order of the draws of the fit.
    half_speed : float
        Speed in m/s at which the friction of the attached contacts has halved.
    misfit : float
        Root mean square of what is left of the forces, over their range.
    """

    draws: Array
    half_speed: float
    misfit: float

    def to_dict(self) -> dict[str, Any]:
        """As plain numbers."""
        low, median, high = (float(value) for value in np.quantile(self.draws, (0.05, 0.5, 0.95)))
        return {"low": low, "median": median, "high": high, "half_speed": self.half_speed, "misfit": self.misfit}

    def __str__(self) -> str:
        found = self.to_dict()
        low, median, high = (engineering(found[name], "s", 2) for name in ("low", "median", "high"))
        return (
            f"From friction at several speeds: re-attachment delay {median} ({low} to {high}): the friction of "
            f"attached contacts halves at {engineering(self.half_speed, 'm/s', 3)}; misfit {100 * self.misfit:.2g} % "
            "of the range"
        )


@dataclass(frozen=True, kw_only=True, repr=False)
class Strengthening(Answer):
    """How static friction grows with the time of rest.

    Attributes
    ----------
    per_decade, error : float
        Growth per decade of the time, over the static friction at the shortest hold, and its standard error.
    freedom : int
        Degrees of freedom of the error: holds less two.
    """

    per_decade: float
    error: float
    freedom: int

    def to_dict(self) -> dict[str, Any]:
        """As plain numbers."""
        return {"per_decade": self.per_decade, "error": self.error, "freedom": self.freedom}

    def __str__(self) -> str:
        clear = self.per_decade > float(stdtrit(self.freedom, 0.975)) * self.error  # Student's t, 5 % two-sided
        words = "contacts age" if clear else "no ageing is seen"
        return (
            f"From the holds: static friction changes by {100 * self.per_decade:.2g} ± {100 * self.error:.1g} % per "
            f"decade of rest: {words}"
        )


def half_speed_of(speeds: ArrayLike, forces: ArrayLike) -> tuple[float, float, float, float]:
    """Half-speed, its relative standard error, force that falls, and rms misfit of ``F = stays + falls/(1 + v/v_h)``.

    Raises
    ------
    InputError
        If there are fewer than four speeds, or the force does not fall over them.
    """
    from scipy.optimize import minimize_scalar

    v, F = np.asarray(speeds, dtype=float), np.asarray(forces, dtype=float)
    if np.unique(v).size < _FEWEST_SPEEDS:
        raise InputError(f"speeds: {np.unique(v).size} different ones: at least {_FEWEST_SPEEDS} are needed", "speeds")

    def solved(log_half: float) -> tuple[Array, float]:
        design = np.column_stack([1.0 / (1.0 + v / math.exp(log_half)), np.ones_like(v)])
        falls, stays = np.linalg.lstsq(design, F, rcond=None)[0]
        if stays < 0:  # friction does not turn round
            falls, stays = float(design[:, 0] @ F / (design[:, 0] @ design[:, 0])), 0.0
        rest = F - design @ np.array([falls, stays])
        return np.array([falls, stays]), float(rest @ rest)

    low, high = math.log(v.min() / 30.0), math.log(v.max() * 30.0)
    grid = np.linspace(low, high, 60)
    best = grid[int(np.argmin([solved(at)[1] for at in grid]))]
    at = float(minimize_scalar(lambda x: solved(x)[1], bounds=(best - 0.3, best + 0.3), method="bounded").x)
    (falls, _), square = solved(at)
    if falls <= 0:
        raise InputError(
            f"speeds: the force does not fall with the speed, from {F[np.argmin(v)]:.4g} at the lowest to "
            f"{F[np.argmax(v)]:.4g} at the highest: it tells no delay",
            "speeds",
        )
    if not low + 0.4 < at < high - 0.4:
        raise InputError(
            f"speeds: the force does not show at which speed it halves within {v.min():.3g} to {v.max():.3g} m/s; "
            "measure over a wider range",
            "speeds",
        )
    ratio = v / math.exp(at)
    slopes = np.column_stack([falls * ratio / (1.0 + ratio) ** 2, 1.0 / (1.0 + ratio), np.ones_like(v)])
    error = math.sqrt(float(np.linalg.pinv(slopes.T @ slopes)[0, 0]) * square / (len(F) - slopes.shape[1]))
    return math.exp(at), error, float(falls), math.sqrt(square / len(F))


def delays_of(found: Fit, speeds: tuple[tuple[object, object], ...]) -> Delays:
    """The delay of each draw: mean rupture margin of a newborn contact over the half-speed.

    A contact is attached while the slider goes its margin, and detached for the delay: the friction that attached
    contacts add halves where the two take equal times.
    """
    v, F = _pairs("speeds", speeds, ("m/s", "0.1 mm/s"), ("N", "12 N"))
    half, error, _, misfit = half_speed_of(v, F)
    margin = _margins(found.values) * found.draws("breaking_displacement")
    scatter = np.random.default_rng([6, len(margin)]).standard_t(len(F) - 3, len(margin))
    return Delays(
        draws=np.asarray(margin / half * np.exp(error * scatter)),
        half_speed=half,
        misfit=misfit / max(float(np.ptp(F)), 1e-300),
    )


def _margins(values: Array) -> Array:
    """Mean of threshold less residual where that is above 0, per draw."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    threshold = 1.0 + values[:, 1, None] * nodes
    margin = np.maximum(threshold - values[:, 2, None], 0.0)
    inside = weights * (threshold > values[:, 2, None])
    return np.asarray((margin * inside).sum(axis=1) / inside.sum(axis=1))


def strengthening_of(holds: tuple[tuple[object, object], ...]) -> Strengthening:
    """Straight line of static friction over the logarithm of the time of rest before."""
    t, F = _pairs("holds", holds, ("s", "10 s"), ("N", "12 N"))
    if np.unique(t).size < _FEWEST_HOLDS:
        raise InputError(f"holds: {np.unique(t).size} different ones: at least {_FEWEST_HOLDS} are needed", "holds")
    decades = np.log10(t) - np.log10(t).mean()
    size = float(F[np.argmin(t)])
    slope = float(decades @ F / (decades @ decades))
    rest = F - F.mean() - slope * decades
    error = math.sqrt(float(rest @ rest) / max(len(F) - 2, 1) / float(decades @ decades))
    return Strengthening(per_decade=slope / size, error=error / size, freedom=max(len(F) - 2, 1))


def _pairs(place: str, given: object, first: tuple[str, str], second: tuple[str, str]) -> tuple[Array, Array]:
    """Pairs of numbers in SI units, or texts with units."""
    found = []
    for i, pair in enumerate(sequence(place, given, f"pairs, such as [({first[1]!r}, {second[1]!r})]")):
        if not isinstance(pair, (tuple, list)) or len(pair) != 2:
            raise InputError(f"{place}[{i}] = {pair!r}: must be a pair, such as ({first[1]!r}, {second[1]!r})", place)
        row = []
        for value, (unit, example) in zip(pair, (first, second), strict=True):
            read = read_quantity(value, unit, example) if isinstance(value, str) else value
            row.append(number(f"{place}[{i}]", read, above=0, hint=f"in {unit}"))
        found.append(row)
    pairs = np.array(found, dtype=float).reshape(-1, 2)
    return pairs[:, 0], pairs[:, 1]

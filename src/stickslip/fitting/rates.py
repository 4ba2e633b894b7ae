"""What more than one trace tells: the delay by the friction at several speeds, ageing by holds of several lengths."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import curve_fit, nnls
from scipy.special import stdtrit

from stickslip.answers import Answer
from stickslip.errors import InputError, sequence
from stickslip.io import files
from stickslip.measure.arrays import Array
from stickslip.model import Gaussian
from stickslip.model.quantities import read_value
from stickslip.words import engineering

if TYPE_CHECKING:
    from stickslip.fitting.fits import Fit

Pairs = tuple[tuple[object, object], ...]
_SPEED, _TIME, _FORCE = ("m/s", "0.1 mm/s"), ("s", "10 s"), ("N", "12 N")
_FEWEST_SPEEDS, _FEWEST_HOLDS = 4, 3
"""One more than the unknowns of the curve: else nothing is left to tell an error by."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Delays(Answer):
    """The delay of re-attachment that the friction at several speeds tells."""

    draws: Array  #: in s, in the order of the draws of the fit
    half_speed: float  #: in m/s: there the friction of the attached contacts has halved
    misfit: float  #: root mean square of what is left of the forces, over their range

    def to_dict(self) -> dict[str, Any]:
        """As plain numbers."""
        low, median, high = np.quantile(self.draws, (0.05, 0.5, 0.95)).tolist()
        return {"low": low, "median": median, "high": high, "half_speed": self.half_speed, "misfit": self.misfit}

    def __str__(self) -> str:
        low, median, high = (engineering(each, "s", 2) for each in np.quantile(self.draws, (0.05, 0.5, 0.95)))
        return (
            f"From friction at several speeds: re-attachment delay {median} ({low} to {high}): the friction of "
            f"attached contacts halves at {engineering(self.half_speed, 'm/s', 3)}; misfit {100 * self.misfit:.2g} % "
            "of the range"
        )


@dataclass(frozen=True, kw_only=True, repr=False)
class Strengthening(Answer):
    """How static friction grows with the time of rest."""

    per_decade: float  #: of the time, over the static friction at the shortest hold
    error: float  #: its standard error
    freedom: int  #: degrees of freedom of the error: holds less two

    def __str__(self) -> str:
        clear = self.per_decade > float(stdtrit(self.freedom, 0.975)) * self.error  # Student's t, 5 % two-sided
        words = "contacts age" if clear else "no ageing is seen"
        return (
            f"From the holds: static friction changes by {100 * self.per_decade:.2g} ± {100 * self.error:.1g} % per "
            f"decade of rest: {words}"
        )


def half_speed_of(speeds: ArrayLike, forces: ArrayLike) -> tuple[float, float, float]:
    """Half-speed, its relative standard error, and rms misfit of ``F = stays + falls/(1 + v/v_h)``, neither below 0."""
    v, F = np.asarray(speeds, dtype=float), np.asarray(forces, dtype=float)
    _enough("speeds", v, _FEWEST_SPEEDS)

    def force(v: Array, log_half: float, falls: float, stays: float) -> Array:
        return np.asarray(stays + falls / (1.0 + v / math.exp(log_half)))

    def levels(log_half: float) -> tuple[Array, float]:
        return nnls(np.column_stack([force(v, log_half, 1.0, 0.0), np.ones_like(v)]), F)

    low, high = math.log(v.min() / 30.0), math.log(v.max() * 30.0)
    start = min(np.linspace(low, high, 60).tolist(), key=lambda at: levels(at)[1])
    falls, stays = levels(start)[0]
    if falls <= 0:
        raise InputError(
            f"speeds: the force does not fall with the speed, from {F[np.argmin(v)]:.4g} at the lowest to "
            f"{F[np.argmax(v)]:.4g} at the highest: it tells no delay",
            "speeds",
        )
    bounds = [low - 1.0, 0.0, 0.0], [high + 1.0, math.inf, math.inf]
    found, covariance = curve_fit(force, v, F, [start, falls, stays], bounds=bounds)
    if not low + 0.4 < found[0] < high - 0.4:
        raise InputError(
            f"speeds: the force does not show at which speed it halves within {v.min():.3g} to {v.max():.3g} m/s; "
            "measure over a wider range",
            "speeds",
        )
    misfit = math.sqrt(float(np.mean((F - force(v, *found)) ** 2)))
    return math.exp(found[0]), math.sqrt(covariance[0, 0]), misfit


def delays_of(found: Fit, speeds: Pairs) -> Delays:
    """The delay of each draw: mean rupture margin of a newborn contact over the half-speed.

    A contact is attached while the slider goes its margin, and detached for the delay: the friction that attached
    contacts add halves where the two take equal times.
    """
    v, F = _pairs("speeds", speeds, _SPEED)
    half, error, misfit = half_speed_of(v, F)
    margins = [Gaussian(mean=1.0 - residual, std=std).positive() for std, residual in found.values[:, 1:3].tolist()]
    mean = np.array([margin.moment(1) for margin in margins])
    scatter = np.random.default_rng([6, len(mean)]).standard_t(len(F) - 3, len(mean))
    return Delays(
        draws=np.asarray(mean * found.draws("breaking_displacement") / half * np.exp(error * scatter)),
        half_speed=half,
        misfit=misfit / max(float(np.ptp(F)), 1e-300),
    )


def strengthening_of(holds: Pairs) -> Strengthening:
    """Straight line of static friction over the logarithm of the time of rest before."""
    t, F = _pairs("holds", holds, _TIME)
    _enough("holds", t, _FEWEST_HOLDS)
    (slope, _), covariance = np.polyfit(np.log10(t), F, 1, cov=True)
    size = float(F[np.argmin(t)])
    return Strengthening(per_decade=float(slope) / size, error=math.sqrt(covariance[0, 0]) / size, freedom=len(F) - 2)


def _enough(place: str, values: Array, fewest: int) -> None:
    if (count := np.unique(values).size) < fewest:
        raise InputError(f"{place}: {count} different ones: at least {fewest} are needed", place)


def _pairs(place: str, given: object, first: tuple[str, str]) -> tuple[Array, Array]:
    """Pairs of numbers in SI units, or texts with units, of something and a force."""
    example = f"({first[1]!r}, {_FORCE[1]!r})"
    found = []
    for i, pair in enumerate(sequence(place, given, f"pairs, such as [{example}]")):
        if not isinstance(pair, (tuple, list)) or len(pair) != 2:
            raise InputError(f"{place}[{i}] = {pair!r}: must be a pair, such as {example}", place)
        found.append([read_value(f"{place}[{i}]", *each) for each in ((pair[0], *first), (pair[1], *_FORCE))])
    columns = np.array(found, dtype=float).reshape(-1, 2).T
    return columns[0], columns[1]


def read_pairs(path: Path | None) -> Pairs:
    """Two columns of a text file: a speed in m/s or a time in s, and a force in N; names may stand above them."""
    if path is None:
        return ()
    rows: list[tuple[object, object]] = []
    text = files.read(path, "table of two columns", largest=1_000_000).decode("utf-8", "replace")
    for at, line in enumerate(text.splitlines(), start=1):
        cells = re.split(r"\s*[,;]\s*|\s+", line.split("#")[0].strip())
        if cells == [""] or not (rows or any(re.match(r"[-+]?[.]?\d", cell) for cell in cells)):
            continue
        try:
            first, second = map(float, cells)
        except ValueError:
            raise InputError(
                f"{path}: line {at}: {line.strip()[:60]!r}: must be two numbers without units, with decimal points, "
                "such as '0.001 12.5'"
            ) from None
        rows.append((first, second))
    if not rows:
        raise InputError(f"{path}: holds no rows of two numbers, such as '0.001 12.5'")
    return tuple(rows)

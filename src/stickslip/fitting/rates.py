"""What more than one trace tells: the delay by the friction at several speeds, ageing by holds of several lengths."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar, nnls
from scipy.special import stdtrit

from stickslip.answers import Answer
from stickslip.errors import InputError, sequence
from stickslip.io import files
from stickslip.measure.arrays import Array
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

    def solved(log_half: float) -> tuple[Array, float]:
        found, rest = nnls(np.column_stack([1.0 / (1.0 + v / math.exp(log_half)), np.ones_like(v)]), F)
        return found, float(rest)

    low, high = math.log(v.min() / 30.0), math.log(v.max() * 30.0)
    best = min(np.linspace(low, high, 60), key=lambda at: solved(at)[1])
    at = float(minimize_scalar(lambda x: solved(x)[1], bounds=(best - 0.3, best + 0.3), method="bounded").x)
    (falls, _), rest = solved(at)
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
    variance = float(np.linalg.pinv(slopes.T @ slopes)[0, 0]) * rest**2 / (len(F) - slopes.shape[1])
    return math.exp(at), math.sqrt(variance), rest / math.sqrt(len(F))


def delays_of(found: Fit, speeds: Pairs) -> Delays:
    """The delay of each draw: mean rupture margin of a newborn contact over the half-speed.

    A contact is attached while the slider goes its margin, and detached for the delay: the friction that attached
    contacts add halves where the two take equal times.
    """
    v, F = _pairs("speeds", speeds, _SPEED)
    half, error, misfit = half_speed_of(v, F)
    # Mean of the threshold less the residual, where that is above 0.
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    margin = 1.0 + found.values[:, 1, None] * nodes - found.values[:, 2, None]
    inside = weights * (margin > 0)
    mean = (margin * inside).sum(axis=1) / inside.sum(axis=1)
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
    decades = np.log10(t) - np.log10(t).mean()
    slope, size, freedom = float(decades @ F / (decades @ decades)), float(F[np.argmin(t)]), len(F) - 2
    rest = F - F.mean() - slope * decades
    error = math.sqrt(float(rest @ rest) / freedom / float(decades @ decades))
    return Strengthening(per_decade=slope / size, error=error / size, freedom=freedom)


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


_NUMBER = re.compile(r"[-+]?\d*[.]?\d+.*")
"""What begins as a number does: a line of names has none."""


def read_pairs(path: Path | None) -> Pairs:
    """Two columns of a text file: a speed in m/s or a time in s, and a force in N."""
    if path is None:
        return ()
    rows: list[tuple[object, object]] = []
    text = files.read(path, "table of two columns", largest=1_000_000).decode("utf-8", "replace")
    for at, line in enumerate(text.splitlines(), start=1):
        line = line.split("#")[0].strip()
        heading = not any(_NUMBER.fullmatch(cell) for cell in re.split(r"[\s,;]+", line))
        if not line or (heading and not rows):
            continue
        try:
            if re.search(r"\d,\d.*[\s;]", line):  # a decimal comma
                raise ValueError
            first, second = (float(cell) for cell in re.split(r"\s*[,;]\s*|\s+", line))
        except ValueError:
            raise InputError(
                f"{path}: line {at}: {line[:60]!r}: must be two numbers without units, with decimal points, such as "
                "'0.001 12.5'"
            ) from None
        rows.append((first, second))
    if not rows:
        raise InputError(f"{path}: holds no rows of two numbers, such as '0.001 12.5'")
    return tuple(rows)

"""The model that is fitted: slow driving, re-attachment on arrest, and its prior.

The limit of slow driving of a slider whose broken contacts slide with a residual force and re-attach when it stops. Six
numbers without a unit describe its slips; forces are in units of the total contact strength ``N f_s``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from stickslip.errors import InputError, number
from stickslip.measure.arrays import Array

VERSION = 2
"""Of what `simulate` makes of parameters and a seed: a table made by another version is not used."""

FLOOR = 0.01
"""Drops below this part of the peak are no slips of their own, in traces and in simulations."""

_PER_SLIP = 3
"""Contacts broken per slip wanted, over the number of contacts, after which a simulation is given up."""


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """A parameter of the model: its key, what it is, and whether it is varied in decades."""

    key: str
    title: str
    decades: bool = False


UNKNOWNS = (
    Unknown(key="contacts", title="effective number of contacts N", decades=True),
    Unknown(key="threshold_std", title="standard deviation of the thresholds, over their mean"),
    Unknown(key="sliding_force", title="force of a sliding contact, over its mean threshold"),
    Unknown(key="stiffness_ratio", title="stiffness of the driving spring over that of the interface", decades=True),
    Unknown(key="damping_ratio", title="damping ratio of the slider on the driving spring"),
    Unknown(key="track_scatter", title="scatter of the thresholds from slip to slip"),
)
KEYS = tuple(unknown.key for unknown in UNKNOWNS)
Range = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Prior:
    """What is held possible before a trace is seen: each parameter evenly spread over its range, two in decades.

    Parameters
    ----------
    contacts, stiffness_ratio : (float, float)
        Effective number of contacts, and ``K/(N k)``; evenly spread in their logarithms.
    threshold_std, sliding_force, damping_ratio, track_scatter : (float, float)
        Standard deviation of the thresholds and force of a sliding contact, over the mean threshold; damping ratio on
        the driving spring; scatter of the thresholds from slip to slip.
    """

    contacts: Range = (5.0, 500.0)
    threshold_std: Range = (0.02, 0.7)
    sliding_force: Range = (0.0, 0.95)
    stiffness_ratio: Range = (0.002, 3.16)
    damping_ratio: Range = (0.02, 0.98)
    track_scatter: Range = (0.0, 0.3)

    def __post_init__(self) -> None:
        bounds = {
            "contacts": (2.0, 5000.0),
            "threshold_std": (0.0, 2.0),
            "sliding_force": (0.0, 0.99),
            "stiffness_ratio": (1e-4, 1e3),
            "damping_ratio": (0.0, 0.99),
            "track_scatter": (0.0, 1.0),
        }
        for field in fields(self):
            place, given = f"Prior.{field.name}", getattr(self, field.name)
            least, most = bounds[field.name]
            if not isinstance(given, tuple) or len(given) != 2:
                raise InputError(f"{place} = {given!r}: must be two numbers, such as {field.default}", place)
            low, high = (number(place, end, at_least=least, at_most=most) for end in given)
            if low >= high:
                raise InputError(f"{place} = {given!r}: the first must be below the second", place)

    def _edges(self) -> tuple[Array, Array]:
        ends = np.array([getattr(self, unknown.key) for unknown in UNKNOWNS], dtype=float)
        for i, unknown in enumerate(UNKNOWNS):
            if unknown.decades:
                ends[i] = np.log10(ends[i])
        return ends[:, 0], ends[:, 1]

    def values(self, part: Array) -> Array:
        """Parameters at parts of their ranges, 0 to 1, along the last axis."""
        low, high = self._edges()
        found = np.array(low + (high - low) * part)
        for i, unknown in enumerate(UNKNOWNS):
            if unknown.decades:
                found[..., i] = 10.0 ** found[..., i]
        return found

    def parts(self, values: Array) -> Array:
        """Where parameters lie in their ranges, 0 to 1."""
        low, high = self._edges()
        found = np.array(values, dtype=float)
        for i, unknown in enumerate(UNKNOWNS):
            if unknown.decades:
                found[..., i] = np.log10(found[..., i])
        return np.asarray((found - low) / (high - low), dtype=float)


def simulate(values: Array, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Peaks and troughs of the force, in units of the total contact strength, of up to so many slips.

    Parameters
    ----------
    values : array
        The six parameters, in the order of `UNKNOWNS`.
    count : int
        Slips wanted; there are fewer where the model hardly stick-slips.
    rng : Generator
    """
    from stickslip.kernels.arrest import Arrest, slips

    contacts = max(round(float(values[0])), 1)
    model = Arrest(contacts, *(float(value) for value in values[1:]))
    peaks, troughs = np.empty(count), np.empty(count)
    found = slips(model, FLOOR, math.ceil(_PER_SLIP * contacts * count), rng, peaks, troughs)
    return peaks[:found], troughs[:found]

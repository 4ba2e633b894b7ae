"""Traces whose truth is known: what a bench would record of the model that is fitted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import xarray as xr

from stickslip.errors import InputError, number, whole
from stickslip.fitting.arrest import KEYS, simulate
from stickslip.measure.arrays import Array
from stickslip.model.records import Number, check

_SLIP = 0.4
"""Samples that a slip takes."""


@dataclass(frozen=True, kw_only=True)
class Bench:
    """How a made-up trace is loaded and recorded."""

    #: Total contact strength.
    strength: Annotated[float, Number(above=0, hint="in N")] = 15.0
    #: Rise of the force between slips.
    loading_rate: Annotated[float, Number(above=0, hint="in N/s")] = 0.5
    #: From slip to slip, on average.
    samples: Annotated[float, Number(above=2)] = 50.0
    #: Standard deviation of white noise, over the mean peak.
    noise: Annotated[float, Number(at_least=0)] = 0.002

    def __post_init__(self) -> None:
        check(self)


def synthetic_trace(
    *,
    contacts: float = 20.0,
    threshold_std: float = 0.25,
    sliding_force: float = 0.5,
    stiffness_ratio: float = 0.05,
    damping_ratio: float = 0.2,
    track_scatter: float = 0.1,
    slips: int = 150,
    bench: Bench = Bench(),
    seed: int = 0,
) -> xr.Dataset:
    """Return a trace of known parameters, as a bench would record it: from rest, sampled, with noise.

    Parameters
    ----------
    contacts, threshold_std, sliding_force, stiffness_ratio, damping_ratio, track_scatter : float
        The truth, as in `Prior`.
    slips : int
        How many there are.
    bench : Bench
    seed : int

    Returns
    -------
    Dataset
        `spring_force` in N along `time` in s.

    Raises
    ------
    InputError
        If there are hardly any slips with these parameters.

    Examples
    --------
    >>> from stickslip.fitting import pick_events, synthetic_trace
    >>> trace = synthetic_trace(slips=100)
    >>> len(pick_events(trace)) > 80
    True
    """
    truth = (contacts, threshold_std, sliding_force, stiffness_ratio, damping_ratio, track_scatter)
    values = np.array([number(key, value, at_least=0) for key, value in zip(KEYS, truth, strict=True)])
    slips = whole("slips", slips, at_least=2, at_most=100_000)
    rng = np.random.default_rng(seed)
    peaks, troughs = simulate(values, slips, rng)
    if peaks.size < slips:
        raise InputError(
            f"only {peaks.size} of {slips} slips: these parameters hardly stick-slip; take a softer spring"
        )
    strength, rate = bench.strength, bench.loading_rate
    step = strength * float((peaks[1:] - troughs[:-1]).mean()) / rate / bench.samples
    return sampled(strength * peaks, strength * troughs, rate, step, bench.noise * strength * float(peaks.mean()), rng)


def sampled(
    peaks: Array, troughs: Array, rate: float, step: float, noise: float, rng: np.random.Generator
) -> xr.Dataset:
    """Sample a saw of these peaks and troughs, from rest on, in N and s."""
    ends = np.concatenate([[0.0], troughs[:-1]])
    rises, falls = (peaks - ends) / rate, np.full(peaks.size, _SLIP * step)
    knots = np.concatenate([[0.0], np.cumsum(np.column_stack([rises, falls]).ravel())])
    force = np.concatenate([[0.0], np.column_stack([peaks, troughs]).ravel()])
    time = np.arange(0.0, knots[-1], step)
    values = np.interp(time, knots, force) + noise * rng.standard_normal(time.size)
    return xr.Dataset(
        {"spring_force": ("time", values, {"units": "N", "long_name": "force"})},
        coords={"time": ("time", time, {"units": "s", "long_name": "time"})},
        attrs={"source": "synthetic trace"},
    )

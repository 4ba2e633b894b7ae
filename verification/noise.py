"""The noise of N contacts: theory against runs of as many contacts, on random rigs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

import stickslip as ss
from stickslip.errors import InputError, UndecidedError
from stickslip.paper import Claim
from stickslip.paper.figure import near
from stickslip.stability import ContactNoise, contact_noise
from verification.study import Study, finding

_RIGS = 30
_SEEDS = 3
_ERROR = 0.012
# of the relative velocity, whose square is the next order: at .39 runs are 6 % above
# theory, at .2 2 %
_FLUCTUATION = 0.25
_MOST_BREAKS = 3e6  # breaks in all runs of a rig


def _thresholds(rng: np.random.Generator) -> Any:
    kinds = (
        lambda: ss.Gaussian(1.0, _between(rng, 0.1, 0.5)),
        lambda: ss.Gamma(mean=1.0, std=_between(rng, 0.2, 0.9)),
        lambda: ss.LogNormal(mean=1.0, std=_between(rng, 0.2, 0.7)),
        lambda: ss.Uniform(low=rng.uniform(0.3, 0.8), high=rng.uniform(1.1, 1.7)),
        lambda: ss.Weibull(scale=1.0, shape=_between(rng, 1.2, 4.0)),
        lambda: ss.Exponential(mean=1.0),
    )
    return kinds[rng.integers(len(kinds))]()


def _contacts(rng: np.random.Generator, thresholds: Any) -> dict[str, Any]:
    pull = float(rng.uniform(0.05, 0.4))
    growth = ss.LogarithmicGrowth(slope=_between(rng, 0.005, 0.03), time=1e-3)
    heat = ss.Bell(width=_between(rng, 0.005, 0.05), attempts=_between(rng, 1e3, 1e6))
    newborn = ss.Uniform(low=-0.1, high=float(rng.uniform(0.0, 0.4)))
    kinds: tuple[dict[str, Any], ...] = (
        {},
        {"sliding_force": pull},
        {"newborn": newborn, "sliding_force": pull},
        {
            "thresholds": None,
            "areas": ss.model.Areas(thresholds),
            "sliding_force": pull,
        },
        {"ageing": growth},
        {
            "ageing": ss.ExponentialGrowth(
                rate=_between(rng, 0.3, 3.0), newborn=float(rng.uniform(0.1, 0.8))
            )
        },
        {"activation": heat},
        {"activation": heat, "ageing": growth, "sliding_force": pull},
    )
    return {"thresholds": thresholds} | kinds[rng.integers(len(kinds))]


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def _random_rigs(seed: int) -> Iterator[tuple[ss.Rig, ContactNoise]]:
    """Yield stable rigs whose velocity fluctuates so little that the next order in
    ``1/N`` is within the bound.
    """
    rng = np.random.default_rng(seed)
    while True:
        velocity = _between(rng, 0.3, 3.0)
        delay = _between(rng, 0.01, 0.3)
        stiffness = _between(rng, 0.3, 8.0)
        mass = _between(rng, 1e-4, 1e-2)
        ratio = _between(rng, 0.05, 2.0)
        delays = (
            ss.Delay(0.0),
            ss.Delay(delay / velocity),
            ss.RandomDelay(mean=delay / velocity, std=0.3 * delay / velocity),
        )
        slider = ss.Slider(
            stiffness=stiffness,
            mass=mass / velocity**2,
            damping=2.0 * ratio * velocity * math.sqrt(stiffness / mass),
        )
        try:
            thresholds = _thresholds(rng)
            interface = ss.Interface(
                delay=delays[rng.integers(3)], **_contacts(rng, thresholds)
            )
            method = ss.Contacts(int(_between(rng, 200.0, 5000.0)))
            rig = ss.Rig(
                interface,
                slider,
                ss.constant(velocity),
                method=method,
                start=ss.FromSliding(),
            )
            noise = contact_noise(rig)
        # unstable, or newborns stretched beyond the thresholds
        except (InputError, UndecidedError):
            continue
        if (
            noise.relative_velocity < _FLUCTUATION
            and _SEEDS * _duration(noise) * velocity * noise.contacts < _MOST_BREAKS
        ):
            yield rig, noise


def _duration(noise: ContactNoise) -> float:
    """Return the duration with which all runs together give the size of the
    fluctuations to an error.
    """
    return noise.memory / (2.0 * _ERROR**2 * _SEEDS)


def _ratio(rig: ss.Rig, noise: ContactNoise) -> float:
    """Return the root mean square of the spring force in runs, over theory."""
    duration = _duration(noise)
    warm = 20.0 * noise.memory
    # variance that subtracting the mean of a run removes
    taken = float(noise.spectrum.spring_force[0]) / 2.0 / duration
    interval = min(noise.memory / 15.0, 0.05 / rig.velocity)
    drive = ss.constant(rig.velocity, warm + duration)
    squares = []
    for seed in range(_SEEDS):
        method = ss.Contacts(noise.contacts, seed=seed)
        run = ss.simulate(
            rig.replace(drive=drive), method=method, output=ss.Output(interval=interval)
        )
        squares.append(
            float(run.spring_force.sel(time=slice(warm, None)).var()) + taken
        )
    return math.sqrt(np.mean(squares)) / noise.spring_force


def _noise() -> tuple[Claim, ...]:
    measured = []
    for _, (rig, noise) in zip(range(_RIGS), _random_rigs(2026), strict=False):
        name = (
            f"{rig.interface.thresholds}, {noise.contacts} contacts, velocity "
            f"{noise.relative_velocity:.0%} rms"
        )
        measured.append(near(name, _ratio(rig, noise), 1.0, 0.05, "of theory"))
    return (
        finding(
            (
                "the spring force of stable rigs fluctuates as the noise of their "
                "contacts "
                "makes it"
            ),
            *measured,
            evidence=(
                f"{_SEEDS} runs of each of {_RIGS} random rigs, long enough to "
                f"know it to {_ERROR:.1%}"
            ),
        ),
    )


STUDIES = (
    Study(
        name="noise",
        group="Solver against solver",
        title="Noise of N contacts",
        run=_noise,
    ),
)

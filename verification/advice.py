"""Test whether the statements of `predict` are true: rigs drawn at random, each
statement against simulations of its own.

``python -m verification advice`` runs the study;
``python -m verification.advice 0 150`` prints each disagreement, and a summary.
Oscillations are identified here without `stickslip.measure`: noise of the contacts
halves if there are four times as many, an oscillation stays.
"""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import gamma

import stickslip as ss
from stickslip.advise import Band, Doubt, Mitigation, Prediction
from stickslip.advise.budget import Budget
from stickslip.advise.doubt import WIDEST
from stickslip.model import Contacts, Operation, Scales
from stickslip.model.distributions import Distribution
from stickslip.model.parameters import parameter_named
from stickslip.paper import Claim, Measured
from stickslip.simulation import estimate, record
from stickslip.stability import count_unstable
from verification.sources import COMPUTING
from verification.study import Study, finding

Array = NDArray[np.float64]

SEED = 20261122
_TINY, _NOISE, _STAYS = 0.02, 0.65, 0.8
"""Peak to peak over static friction below which the force is constant; factors of
noise, and of motion, with four times the contacts.
"""
_LENGTHS = 4
"""Number of durations tried, each twice the one before, until two agree."""
_PATIENT = 8.0
"""Factor of duration of the runs that check again oscillations that do not seem to
decay.
"""
_FAST = 3.5, 1.25
"""Largest velocity of a slip, in speeds of the drive, and the factor on either side of
it within which both words are right.
"""
_DEAREST = 6.0
"""Seconds that a run may take; longer ones are not tried."""
_MOST_AGED = 2_000


def draw(number: int) -> ss.Rig:
    """Return a random rig: soft or stiff, light or heavy, in natural or SI units, with
    any delay or ageing, with few contacts or many.
    """
    rng = np.random.default_rng([SEED, number])

    def log(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(math.log(low), math.log(high))))

    ageing = ss.Langevin(rate=log(0.3, 3.0)) if rng.random() < 0.12 else None
    thresholds = _thresholds(
        str(rng.choice(list(_KINDS))) if ageing is None else "gaussian", log(0.03, 0.33)
    )
    delay: ss.Delay | ss.RandomDelay = ss.Delay(0.0)
    if ageing is None:
        mean = log(0.02, 1.0)
        std = rng.uniform(0.1, 0.5)
        delay = ss.Delay(mean)
        if rng.random() < 0.35:
            negative = str(rng.choice(["fold", "redraw", "clip"]))
            delay = ss.RandomDelay(mean=mean, std=mean * std, negative=negative)  # type: ignore[arg-type]
    stiffness = log(0.02, 20.0)
    ratio = log(0.01, 2.0)
    fastest = log(3.0, 300.0)
    mass = (stiffness + 1.0) / fastest**2
    slider = ss.Slider(
        stiffness=stiffness,
        mass=mass,
        damping=2.0 * ratio * math.sqrt(stiffness / mass),
    )
    interface = ss.Interface(
        thresholds=thresholds,
        initial=ss.Gaussian(mean=0.0, std=float(rng.choice([0.01, 0.05, 0.2]))),
        delay=delay,
        ageing=ageing,
        sliding_force=log(0.05, 0.8) if ageing is None and rng.random() < 0.3 else 0.0,
    )
    speed = log(0.3, 3.0)
    way = float(rng.choice([60.0, 200.0]))
    drive = ss.constant(speed, way / speed)
    operation = Operation()
    kind = rng.random()
    if kind < 0.1:
        operation = Operation(speeds=(speed, 2.0 * speed, 5.0 * speed))
    elif kind < 0.2:
        operation = Operation(between=(speed / 2.0, 4.0 * speed))
    elif kind < 0.27:
        up = ss.ramp(speed, 6.0 * speed, duration=way / speed)
        drive = up.then(ss.ramp(6.0 * speed, speed, duration=way / speed))
    count = (
        int(log(50, 1e6 if rng.random() < 0.15 else 2e4))
        if ageing is None
        else int(log(100, 1500))
    )
    scales = None
    if rng.random() < 0.5:
        scales = Scales(
            force=log(1.0, 1e5), stretching=log(1e-6, 1e-3), time=log(1e-3, 1.0)
        )
    return ss.Rig(
        interface,
        slider,
        drive,
        method=ss.Contacts(count, seed=number),
        operation=operation,
        scales=scales,
        name=f"rig {number}",
    )


_KINDS = ("gaussian", "gamma", "log-normal", "uniform", "weibull")


def _thresholds(kind: str, std: float) -> Distribution:
    if kind == "gamma":
        return ss.Gamma(mean=1.0, std=std)
    if kind == "log-normal":
        return ss.LogNormal(mean=1.0, std=std)
    if kind == "uniform":
        half = math.sqrt(3.0) * std
        return ss.Uniform(low=1.0 - half, high=1.0 + half)
    if kind == "weibull":
        shape = std**-1.086  # to a few percent
        return ss.Weibull(scale=1.0 / float(gamma(1.0 + 1.0 / shape)), shape=shape)
    return ss.Gaussian(mean=1.0, std=std)


class TooDear(Exception):  # noqa: N818 - not an error: what it would tell stays unknown
    """Raised if a run would take too long."""


@dataclass(frozen=True)
class Look:
    """The late part of a run: peak to peak and standard deviation over static friction,
    and the largest velocity of a usual cycle, in speeds of the drive.
    """

    swing: float
    std: float
    fastest: float


def _watch(rig: ss.Rig, count: int, seed: int, longer: float) -> Look:
    """Evaluate the last 40 % of a run, long enough that contacts that attached together
    no longer break together.
    """
    slider = rig.slider
    stretch = rig.interface.threshold_distribution.moment(1)
    period = 2.0 * math.pi * math.sqrt(slider.mass / slider.stiffness)
    detached = rig.velocity * rig.interface.delay.moment(1)
    cycle = max(
        stretch * (1.0 + 1.0 / slider.stiffness) + detached, rig.velocity * period
    )
    ringing = 12.0 * rig.velocity / max(slider.damping, 1e-12)
    in_step = _memory(rig) * (stretch + detached)
    distance = longer * max(100.0, 25.0 * cycle, min(ringing, 100.0 * cycle), in_step)
    drive = ss.constant(rig.velocity, distance / rig.velocity)
    there = replace(
        rig,
        drive=drive,
        method=ss.Contacts(count, seed=seed),
        start=ss.FromRest(),
        output=ss.Output(),
    )
    if estimate(there).seconds > _DEAREST:
        raise TooDear
    track = record(there, long=True).track
    late = track.times > 0.6 * track.times[-1]
    force = slider.stiffness * (track.drive_position - track["displacement"])[late]
    bare = ss.Interface(
        thresholds=rig.interface.thresholds, initial=rig.interface.initial
    )
    friction = ss.static_friction(bare)[0]
    return Look(
        swing=float(np.ptp(force)) / friction,
        std=float(force.std()) / friction,
        fastest=_usual_maximum(force, track["velocity"][late]) / rig.velocity,
    )


def _usual_maximum(force: Array, velocity: Array) -> float:
    """Return the median of the largest velocities of the cycles; a cycle begins where
    the force rises through its upper quarter.
    """
    low, high = np.percentile(force, [25.0, 75.0])
    side = np.where(force > high, 1, np.where(force < low, -1, 0))
    outside = np.flatnonzero(side)
    begins = outside[1:][np.diff(side[outside]) > 0]
    if begins.size < 3:
        return float(velocity.max())
    return float(np.median(np.maximum.reduceat(velocity[: begins[-1]], begins[:-1])))


def motion(rig: ss.Rig, *, seed: int = 1000, shortest: float = 1.0) -> set[str]:
    """Return the kinds of motion of a rig at its first speed that runs do not
    contradict.

    The run is made longer until two durations agree, and is then repeated with four
    times the contacts, which halves noise.
    """
    assert isinstance(rig.method, Contacts)
    count = rig.method.count
    lengths = [shortest, 2.0 * shortest]
    looks = [_watch(rig, count, seed + k, longer) for k, longer in enumerate(lengths)]
    while not _agree(looks[-2].std, looks[-1].std) and len(looks) < _LENGTHS:
        lengths.append(2.0 * lengths[-1])
        looks.append(_watch(rig, count, seed + len(looks), lengths[-1]))
    if max(look.swing for look in looks[-2:]) < 0.8 * _TINY:
        return {"smooth sliding"}
    more = 4 * count if rig.interface.ageing is None else min(4 * count, 4 * _MOST_AGED)
    many = [_watch(rig, more, seed + k, lengths[-1]) for k in (7, 8)]
    fastest = float(np.median([look.fastest for look in (*looks[-2:], *many)]))
    kinds = {"stick-slip", "sustained oscillation"}
    if fastest > _FAST[0] * _FAST[1]:
        kinds = {"stick-slip"}
    elif fastest < _FAST[0] / _FAST[1]:
        kinds = {"sustained oscillation"}
    ratios = [
        look.std / float(np.mean([few.std for few in looks[-2:]])) for look in many
    ]
    if _agree(looks[-2].std, looks[-1].std):
        if min(ratios) > _STAYS and max(look.swing for look in many) > 1.25 * _TINY:
            return kinds
        if max(ratios) < _NOISE:
            # So few contacts that each break is a slip: noise, from their number, yet
            # slips.
            slips = min(look.fastest for look in looks[-2:]) > 2.0 * _FAST[0]
            return {"smooth sliding", "stick-slip"} if slips else {"smooth sliding"}
    return kinds | {"smooth sliding", "either"}


def _agree(one: float, other: float) -> bool:
    return min(one, other) > 0.75 * max(one, other)


def _memory(rig: ss.Rig) -> float:
    """Return after how many lives contacts that attached together break at any time: 2
    % of the first harmonic is left.
    """
    interface = rig.interface
    v = rig.velocity
    life = interface.threshold_distribution.moment(1) + v * interface.delay.moment(1)
    delays = max(interface.delay.moment(2) - interface.delay.moment(1) ** 2, 0.0)
    scatter = interface.threshold_distribution.standard_deviation() ** 2 + v**2 * delays
    return 8.0 * (life / (2.0 * math.pi)) ** 2 / scatter


def at(rig: ss.Rig, name: str, value: float) -> ss.Rig:
    """Return the rig in natural units with one parameter changed, given in its own
    units, at its first, constant speed.
    """
    drive = ss.constant(rig.natural.velocity, 100.0 / rig.natural.velocity)
    parameter = parameter_named(name)
    return parameter.set(
        replace(rig.natural, drive=drive), value / rig.unit(parameter.unit)
    )


def disagreements(number: int) -> Iterator[tuple[str, str]]:
    """Predict a rig, and test each statement: return the kinds of statements, each with
    its contradiction, or an empty text.
    """
    rig = draw(number)
    begun = time.process_time()
    found = ss.predict(rig)
    assert isinstance(found, Prediction)
    yield "predicted", f"{time.process_time() - begun:.1f} s"
    if not found.has_verdict or found.theory_note:
        yield "not judged", ""
        return
    here = at(rig, "velocity", rig.velocity)
    yield from _about_here(found, here)
    for margin in found.margins:
        for edge in (margin.lower, margin.upper):
            if edge is not None:
                try:
                    sides = [
                        count_unstable(at(rig, margin.parameter, edge * f)) == 0
                        for f in (0.99, 1.01)
                    ]
                except ss.InputError:  # at the limit of the theory of ageing
                    continue
                yield (
                    "margin",
                    ""
                    if sides[0] != sides[1]
                    else f"{margin.parameter} at {edge:.4g}: stable {sides}",
                )
    for band in found.bands:
        yield from _about_a_band(found, band)
    for mitigation in found.mitigations:
        yield from _about_a_mitigation(found, mitigation)
    alone = found.between is None and len(found.at_speeds) < 2
    for name, searched in found.attempts.items() if alone else ():
        for end in searched:
            try:
                there = at(rig, name, end)
                smooth = not count_unstable(there.natural) and all(
                    one == {"smooth sliding"} for one in _runs(there)
                )
            except (TooDear, ss.InputError, ss.UndecidedError):
                yield "attempt, too dear", ""
                continue
            yield (
                "attempt",
                f"{name} at {end:.4g}: smooth sliding in all runs" if smooth else "",
            )
    for name, (end, part) in found.unreliable.items() if alone else ():
        yield from _about_a_part(name, at(rig, name, end), part)


def _runs(rig: ss.Rig) -> Iterator[set[str]]:
    """Return what may be said of runs from 8 seeds, the number that an attempt
    mentions.
    """
    return (motion(rig, seed=seed) for seed in range(8000, 16000, 1000))


def _about_a_part(name: str, there: ss.Rig, part: float) -> Iterator[tuple[str, str]]:
    """Return whether as many of 8 runs slide smoothly as stated, within three standard
    errors.
    """
    try:
        kinds = [*_runs(there)] if not count_unstable(there.natural) else [set[str]()]
    except (TooDear, ss.InputError, ss.UndecidedError):
        yield "attempt in part, too dear", ""
        return
    sure = float(np.mean([each == {"smooth sliding"} for each in kinds]))
    likely = float(np.mean(["smooth sliding" in each for each in kinds]))
    nearest = min(max(part, sure), likely)
    mean = 0.5 * (part + nearest)
    far = abs(nearest - part) > 3.0 * math.sqrt(2.0 * mean * (1.0 - mean) / 8)
    wrong = (
        f"{name} at {there.value(name):.4g}: {100 * nearest:.0f} % smooth, not "
        f"{100 * part:.0f} %"
    )
    yield "attempt in part", wrong if far else ""


def _about_here(found: Prediction, here: ss.Rig) -> Iterator[tuple[str, str]]:
    kind = found.regime.kind
    if kind == "undecided":
        yield (
            "undecided",
            f"{found.regime.reason}; growing modes {found.unstable_modes}",
        )
        return
    try:
        kinds = motion(here)
    except TooDear:
        yield "regime, too dear", ""
        return
    fits = kind in kinds or (
        kind == "smooth sliding"
        and found.unstable_modes
        and "linearly unstable" in found.verdict
    )
    if not fits:  # a run may end in one of two states: two more decide
        fits = kind in motion(here, seed=2000)
    yield (
        "regime",
        ""
        if fits
        else f"{found.verdict} | runs: {kinds}, growing modes {found.unstable_modes}",
    )


def _about_a_band(found: Prediction, band: Band) -> Iterator[tuple[str, str]]:
    rig = found.rig
    middle = math.sqrt(band.low * band.high)
    if band.high < 1.15 * band.low:
        return
    there = at(rig, "velocity", middle)
    try:
        modes = count_unstable(there)
        linear = (
            modes == 0
            if band.bistable or band.kind in ("smooth sliding", "stable")
            else modes > 0
        )
        if band.kind != "unknown":  # about these bands nothing is stated
            yield (
                "band, linear",
                "" if linear else f"{band} at {middle:.4g}: growing modes {modes}",
            )
    except (ss.InputError, ss.UndecidedError) as reason:
        yield (
            "band, theory cannot tell",
            f"{band}: {reason}" if band.kind in ("stable", "unstable") else "",
        )
    if band.kind in ("stable", "unstable", "unknown"):
        yield "band, not simulated", ""
        return
    try:
        kinds = motion(there)
        fits = band.kind in kinds or band.kind in motion(there, seed=3000)
    except (TooDear, ss.InputError):
        yield "band, too dear", ""
        return
    yield "band", "" if fits else f"{band} at {middle:.4g}: {kinds}"


def _about_a_mitigation(
    found: Prediction, mitigation: Mitigation
) -> Iterator[tuple[str, str]]:
    there = at(found.rig, mitigation.parameter, mitigation.to)
    try:
        kinds = [motion(there, seed=seed) for seed in (5000, 6000)]
        bad = [each for each in kinds if "smooth sliding" not in each]
        if bad:  # a slow decay looks sustained for a while
            bad = [
                each
                for each in (motion(there, shortest=_PATIENT),)
                if "smooth sliding" not in each
            ]
    except (TooDear, ss.InputError):
        yield "decays, too dear", ""
        return
    yield "decays", f"{mitigation}: {bad}" if bad else ""


_FIRST, _LAST = 0, 60
"""Number of rigs in the study."""


def advice() -> tuple[Claim, ...]:
    """No statement about random rigs is contradicted by their runs, and no band or
    mitigation is noise.
    """
    found = [
        (number, *each)
        for number in range(_FIRST, _LAST)
        for each in disagreements(number)
    ]
    kinds = (
        "regime",
        "margin",
        "band",
        "band, linear",
        "decays",
        "attempt",
        "attempt in part",
    )
    claims = []
    for kind in kinds:
        tried = [(number, wrong) for number, each, wrong in found if each == kind]
        false = [f"rig {number}: {wrong}" for number, wrong in tried if wrong]
        claims.append(
            finding(
                f"no false sentence of the kind '{kind}', of {len(tried)} tried",
                Measured(name="false", value=float(len(false)), low=0.0, high=0.0),
                evidence=" | ".join(false),
            )
        )
    return tuple(claims)


_DRAWN = 40
"""Number of rigs drawn from the assumptions about one."""
_SET = {
    "slider.mass": ("mass", 1),
    "slider.stiffness": ("stiffness", 1),
    "slider.damping_ratio": ("damping", 1),
    "interface.breaking_displacement": ("contact_stiffness", -1),
    "interface.thresholds": ("std", 1),
    "interface.delay": ("delay", 1),
}
_WIDEST = 0.5
"""Largest standard deviation of thresholds, over their mean, that is drawn."""


def oscillates(name: str) -> Iterator[bool | None]:
    """Return whether rigs drawn from the assumptions about an example oscillate, by
    linear theory or in their own runs.
    """
    rig = ss.example(name)
    rng = np.random.default_rng(SEED)
    for number in range(_DRAWN):
        there = rig
        for parameter, side in (
            _SET[key]
            for key, item in rig.assumed.items()
            if key in _SET and not item.default
        ):
            value = there.value(parameter) * WIDEST ** (side * rng.uniform(-1.0, 1.0))
            there = there.with_values(
                **{parameter: min(value, _WIDEST) if parameter == "std" else value}
            )
        there = at(there, "velocity", there.velocity)
        try:
            kinds = (
                {"unstable"} if count_unstable(there) else motion(there, seed=number)
            )
            yield None if kinds > {"smooth sliding"} else "smooth sliding" not in kinds
        except (TooDear, ss.InputError, ss.UndecidedError):
            yield None


def doubt() -> tuple[Claim, ...]:
    """The statement about other values of the assumed parameters is true, for the
    examples that assume a delay.
    """
    claims = []
    for name in ("brake_pad", "precision_stage", "pmma_slider"):
        said = Doubt.of(ss.example(name), Budget(math.inf))
        assert said is not None
        seen = [each for each in oscillates(name) if each is not None]
        part = float(np.mean(seen))
        chance = (
            said.oscillates
            * (1.0 - said.oscillates)
            * (1.0 / len(seen) + 1.0 / said.draws)
        )
        error = (
            3.0 * math.sqrt(max(chance, 1.0 / len(seen) ** 2))
            + said.undecided
            + 1.0
            - len(seen) / _DRAWN
        )
        claims.append(
            finding(
                (
                    f"of {name}, as many rigs oscillate as is said, within three "
                    "standard "
                    "errors and what was not told"
                ),
                Measured(
                    name="fraction",
                    value=part,
                    low=said.oscillates - error,
                    high=said.oscillates + error,
                ),
                evidence=(
                    f"said {said.oscillates:.3f}, {said.undecided:.3f} not told; "
                    f"{len(seen)} rigs judged"
                ),
            )
        )
    return tuple(claims)


_ROOMS = (*COMPUTING, "advise")
STUDIES = (
    Study(
        name="advice",
        group="Advice",
        title="Predictions of rigs drawn at random",
        run=advice,
        rooms=_ROOMS,
    ),
    Study(
        name="doubt",
        group="Advice",
        title="Predictions over what was assumed",
        run=doubt,
        rooms=_ROOMS,
    ),
)


def main(first: int, last: int) -> int:
    """Test rigs by number; print each disagreement, then how many of each kind of
    statement were tested.
    """
    tried = Counter[str]()
    false = Counter[str]()
    for number in range(first, last):
        said = []
        for kind, wrong in disagreements(number):
            tried[kind] += 1
            if kind in ("predicted",):
                said.append(wrong)
            elif wrong:
                false[kind] += 1
                said.append(f"{kind}: {wrong}")
        print(f"rig {number}:", " | ".join(said), flush=True)
    for kind in sorted(tried):
        print(f"{kind:20} {tried[kind]:5} tried, {false[kind]} false")
    return 1 if set(false) - {"undecided"} else 0


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:3])))

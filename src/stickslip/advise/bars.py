"""The prediction for an elastic slider: the waves that grow in smooth sliding, the
slips of a run from rest, and the changes of one parameter that make smooth sliding
stable.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from functools import cache
from itertools import count, takewhile
from typing import Any

from stickslip.advise import survey as by_theory
from stickslip.advise.answer import ElasticPrediction
from stickslip.advise.budget import Budget, BudgetExhausted, cost_of_run
from stickslip.advise.findings import Slip, WaveAnswer
from stickslip.advise.mitigations import Mitigation, has, reach
from stickslip.advise.survey import PRECISION, factor_on, scaled, stability_along
from stickslip.cycles.edges import halved
from stickslip.elastic.modes import (
    CriticalLength,
    critical_length,
    length_in_words,
    sliders_of,
)
from stickslip.errors import InputError, UndecidedError
from stickslip.measure.fronts import large_events
from stickslip.model import Chain, ElasticBody, Slider, parameters
from stickslip.model.drive import constant
from stickslip.model.parameters import VELOCITY, Parameter, parameter_named
from stickslip.model.rig import Rig
from stickslip.progress import Progress, part
from stickslip.simulation import record
from stickslip.sliding import respond
from stickslip.stability import count_unstable

_MODES = 64  # the softest modes, among which the growing ones are counted
_WAVES = 5  # the softest modes of different stiffness, which are reported
_DENSITY = 6  # points per decade of speed at which growing modes of a wave are counted
_FOR_CHANGES = 0.5  # fraction of the budget for changes; the rest is for a run
# parameters that may be changed, one at a time
_CHANGES = (
    VELOCITY,
    parameter_named("side"),
    parameter_named("leaf"),
    parameter_named("coupling"),
    parameters.DAMPING,
    parameters.MASS,
    parameters.DELAY,
    parameters.STD,
    parameters.AGEING,
)


def predict_waves(
    rig: Rig, speeds: tuple[float, float], report: Progress
) -> ElasticPrediction:
    """Return which waves of an elastic slider grow at its drive velocity, and the
    velocities at which they grow, within `speeds`, given as factors.
    """
    searched = (speeds[0] * rig.velocity, speeds[1] * rig.velocity)
    found = ElasticPrediction(rig=rig, speeds_searched=searched)
    if respond(rig.interface).inert:
        return replace(found, theory_note=by_theory.CANNOT_GROW)
    grows = cache(_grows)
    waves: dict[Slider, WaveAnswer] = {}
    growing = 0
    critical = None
    try:
        for *numbers, slider in zip(*sliders_of(rig.slider, _MODES), strict=True):
            stiffness, coupling, wavelength = map(float, numbers)
            there = replace(rig, slider=slider, drive=constant(rig.natural.velocity))
            growing += grows(there)
            if slider in waves or len(waves) == _WAVES:
                continue  # modes come in pairs of equal stiffness
            growth, frequency = by_theory.fastest_mode(there)
            bands = stability_along(there, VELOCITY, *speeds, density=_DENSITY)
            length = length_in_words(rig, wavelength, 3)
            waves[slider] = WaveAnswer(
                name=_name(wavelength, coupling, rig.slider, length),
                wavelength=wavelength,
                stiffness=stiffness * rig.unit("k"),
                growth=growth,
                frequency=frequency,
                speeds=tuple(
                    band.ends
                    for band in scaled(bands, rig.velocity)
                    if band.kind == "unstable"
                ),
            )
            report(len(waves) / (_WAVES + 1))
    except UndecidedError as reason:
        return replace(found, theory_note=str(reason))
    if isinstance(rig.slider, Chain):
        with suppress(UndecidedError):
            critical = critical_length(rig)
    report(1.0)
    found_waves = tuple(waves.values())
    return replace(found, growing=growing, waves=found_waves, critical=critical)


def complete_waves(
    found: ElasticPrediction, budget: Budget, report: Progress
) -> ElasticPrediction:
    """Add to the answer the slips of a bar from rest, and the changes that make its
    smooth sliding stable, as far as the budget allows.
    """
    if found.theory_note or not isinstance(found.rig.slider, Chain):
        return found
    if found.growing:
        with budget.limited_to(_FOR_CHANGES):
            changes = _changes(
                found.rig, found.critical, budget, part(report, 0.0, 0.3)
            )
        found = replace(found, **changes)
    return replace(found, **_slips(found.rig, budget, part(report, 0.3, 1.0)))


def _name(wavelength: float, coupling: float, body: ElasticBody, length: str) -> str:
    """Return the name of a mode, in words."""
    if math.isnan(wavelength):
        return "a mode localised at the driven end"
    if math.isinf(wavelength):
        return "the uniform mode" if coupling == 0.0 else "waves across the drive"
    # a wave longer than its bar is not shown by its length
    if not isinstance(body, Chain) or wavelength <= body.size:
        return f"waves of {length}"
    whole = wavelength > 3.0 * body.size
    return "the bar nearly as a whole" if whole else "half a wave along the bar"


def _grows(rig: Rig) -> bool:
    """Whether a mode of a rigid slider grows."""
    return count_unstable(rig) > 0


def _is_stable(rig: Rig, budget: Budget) -> bool:
    """Whether linear theory shows that none of the softest modes of a bar grows at the
    speed of its drive.
    """
    drive = constant(rig.natural.velocity)
    try:
        modes = dict.fromkeys(sliders_of(rig.slider, _MODES)[-1])
        return not any(
            budget.theory(_grows, replace(rig, slider=slider, drive=drive))
            for slider in modes
        )
    except (InputError, UndecidedError):
        return False


def _changes(
    rig: Rig, critical: CriticalLength | None, budget: Budget, report: Progress
) -> dict[str, Any]:
    """Return, as fields of the answer, the smallest change of each parameter that makes
    smooth sliding stable, the smallest first, and the ranges searched of the others.
    """
    found = list[Mitigation]()
    tried = dict[str, tuple[float, float]]()
    with suppress(BudgetExhausted):
        # Leaf springs of the critical stiffness stabilise the softest mode of a bar
        # without any.
        if critical is not None and rig.natural.slider.leaf == 0:
            to = critical.stiffness * (1.0 + PRECISION)
            if _is_stable(rig.with_values(leaf=to), budget):
                found.append(Mitigation(parameter="leaf", now=0.0, to=to))
        for i, parameter in enumerate(_CHANGES):
            report(i / len(_CHANGES))
            if has(rig, parameter):
                now = rig.value(parameter)
                low, high = reach(rig, parameter)
                up = _smallest(rig, parameter, 1, high, budget)
                down = _smallest(rig, parameter, -1, 1.0 / low, budget)
                if math.isinf(min(up, down)):
                    tried[parameter.name] = now * low, now * high
                    continue
                to = now * up if up <= down else now / down
                found.append(Mitigation(parameter=parameter.name, now=now, to=to))
    found.sort(key=lambda each: each.size)
    return {"mitigations": tuple(found), "attempts": tried}


def _smallest(
    rig: Rig, parameter: Parameter, side: int, furthest: float, budget: Budget
) -> float:
    """Return the smallest factor on a parameter, up or down, beyond which smooth
    sliding is stable, to `PRECISION`; infinite if it is stable at none of the doubled
    factors that are tried.
    """
    change = factor_on((parameter, side))

    def stable(factor: float) -> bool:
        return _is_stable(change.set(rig, factor), budget)

    doubled = takewhile(lambda step: step < furthest, (2.0**k for k in count(1)))
    last = 1.0
    for step in (*doubled, furthest):
        if step > last and stable(step):
            edge = halved(stable, last, step, math.log1p(PRECISION))[1]
            beyond = min(edge * (1.0 + PRECISION), step)
            return beyond if stable(beyond) else step
        last = step
    return math.inf


def _slips(rig: Rig, budget: Budget, report: Progress) -> dict[str, Any]:
    """Return, as fields of the answer, the first partial slip and the first slip of all
    blocks in a run of a bar; empty if that exceeds the budget.

    The run of a drive at one speed ends once the springs balance all contacts, and the
    bar is compressed as far as the contacts can.
    """
    natural = rig.natural
    body = natural.slider
    mean = natural.interface.threshold_distribution.moment(1)
    pull = float(body.pulled.sum())
    if len(natural.drive.pieces) == 1 and pull > 0:
        compressed = 0.5 * body.size**2 / body.coupling if body.side > 0 else 0.0
        furthest = mean * (body.size / pull + 1.0 + compressed)
        lasts = min(furthest / abs(natural.velocity), natural.drive.duration)
        rig = replace(rig, drive=constant(natural.velocity, lasts))
    try:
        budget.spend(cost_of_run(rig))
        seen = large_events(record(rig, progress=report).dataset())
    # or the bar has no steady sliding, or cannot be simulated
    except (BudgetExhausted, InputError):
        return {}
    first = dict[bool, Slip]()
    for start, blocks, far, drop in zip(
        *(seen[name].values.tolist() for name in ("start", "blocks", "reach", "drop")),
        strict=True,
    ):
        whole = blocks >= body.size
        slip = Slip(start=start, blocks=body.size if whole else int(far), drop=drop)
        first.setdefault(whole, slip)
    return {
        "simulated": rig.drive.duration * rig.unit("time"),
        "partial": first.get(False),
        "whole": first.get(True),
    }

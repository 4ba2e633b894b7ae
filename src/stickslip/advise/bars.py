"""The prediction for an elastic slider: the waves that grow in smooth sliding, the
slips of a run from rest, and the changes of one parameter that make smooth sliding
stable.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain, count, groupby, takewhile
from typing import Any

import numpy as np

from stickslip.advise import survey as by_theory
from stickslip.advise.answer import ElasticPrediction
from stickslip.advise.budget import (
    Budget,
    BudgetExhausted,
    cost_of_run,
    cost_of_theory,
    is_expensive,
)
from stickslip.advise.findings import Slip, WaveAnswer
from stickslip.advise.mitigations import Mitigation, has, reach
from stickslip.advise.survey import PRECISION, Band, factor_on, scaled, theory_along
from stickslip.arrays import Array, Range
from stickslip.cycles.edges import halved
from stickslip.elastic.modes import (
    CriticalLength,
    critical_length,
    length_in_words,
    sliders_of,
)
from stickslip.errors import InputError, UndecidedError
from stickslip.loops import bounded
from stickslip.measure.fronts import large_events
from stickslip.model import Chain, ElasticBody, Slider, parameters
from stickslip.model.drive import constant
from stickslip.model.parameters import VELOCITY, Parameter, parameter_named
from stickslip.model.rig import Rig
from stickslip.progress import Progress, part
from stickslip.simulation import record
from stickslip.sliding import respond
from stickslip.stability.modes import smooth_sliding
from stickslip.stability.neutral import Neutral, neutral_frequencies

# Most modes that are looked at, the softest first. Without viscosity of the bulk all
# have the same losses, and one evaluation of linear theory serves all.
_MODES = 1024
_VISCOUS_MODES = 64
_WAVES = 5  # the softest modes of different stiffness, which are reported
_DENSITY = 6  # points per decade of speed at which growing modes are counted
# Cost of another mode, over that of the first, where contacts age or heat breaks them:
# their response is not known off the frequencies of the first.
_ANOTHER = 0.25
_FIRST = 8  # growth rates in the first round of the search for the fastest mode
_FOR_SPEEDS = 0.5  # fraction of the budget for what a first answer left out
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
    rig: Rig, speeds: tuple[float, float], budget: Budget, report: Progress
) -> ElasticPrediction:
    """Return which waves of an elastic slider grow at its drive velocity, and the
    velocities at which they grow, within `speeds`, given as factors.

    The budget does not limit the first evaluation, of which modes grow.
    """
    searched = (speeds[0] * rig.velocity, speeds[1] * rig.velocity)
    found = ElasticPrediction(rig=rig, speeds_searched=searched)
    if respond(rig.interface).inert:
        return replace(found, theory_note=by_theory.CANNOT_GROW)
    rows = [*zip(*_modes_of(rig.slider), strict=True)]
    sliders = [slider for *_, slider in rows]
    try:
        with budget.limited_to(math.inf):
            growing = _growing(rig, sliders, budget)
    except UndecidedError as reason:
        return replace(found, theory_note=str(reason))
    budget.allowed += budget.spent
    critical = None
    if isinstance(rig.slider, Chain):
        with suppress(UndecidedError):
            critical = critical_length(rig)
    waves = dict[Slider, WaveAnswer]()
    shown = [*dict.fromkeys(sliders)][:_WAVES]
    left = ["growth rates"]
    fastest = None
    turns = bounded("predict_waves", len(sliders))
    with suppress(BudgetExhausted):
        fastest = _fastest(rig, growing, budget)
        # from the last one on, those that grow where none of the others does
        while shown or (shown := _missed(rig, sliders, waves, speeds, budget)):
            next(turns)  # each time another mode
            slider = shown.pop(0)
            row = rows[sliders.index(slider)]
            waves[slider] = _wave(rig, row, speeds, budget)
            report(min(len(waves) / (_WAVES + 2), 1.0))
            if not shown and fastest is not None and fastest not in waves:
                shown.append(fastest)
            left = ["the speeds at which other waves grow"]
        left = []
    if not all(wave.searched for wave in waves.values()):
        left = ["the speeds at which some waves grow"]
    report(1.0)
    best = None if fastest is None else waves.get(fastest)
    return replace(
        found,
        looked=len(sliders),
        growing=sum(slider in growing for slider in sliders),
        fastest=best.name if best and best.growth is not None else "",
        waves=tuple(sorted(waves.values(), key=lambda wave: wave.stiffness)),
        complete=not left,
        critical=critical,
        not_searched=tuple(left),
    )


def _modes_of(body: ElasticBody) -> tuple[Array, Array, Array, list[Slider]]:
    """Return the softest modes of an elastic slider, as `sliders_of` does."""
    return sliders_of(body, _VISCOUS_MODES if body.viscosity > 0 else _MODES)


def _with_mode(rig: Rig, slider: Slider) -> Rig:
    """Return a mode at the speed of a rig, as a rig with a rigid slider."""
    return replace(rig, slider=slider, drive=constant(rig.natural.velocity))


def _growing(rig: Rig, sliders: Sequence[Slider], budget: Budget) -> list[Slider]:
    """Return the modes that grow at the speed of a rig, each once.

    Raises `UndecidedError` if none does for sure, but one may, to within the accuracy
    of the response of the contacts.
    """
    found = list[Slider]()
    fewest = most = 0
    more = 0.0
    margin = respond(rig.interface).accuracy
    alike = groupby(dict.fromkeys(sliders), key=lambda slider: slider.damping)
    for softest, *others in (list(group) for _, group in alike):
        there = _with_mode(rig, softest)
        neutral = budget.theory(_neutral, there, more=more)
        more = _beyond_the_first(there)
        for slider in (softest, *others):
            added = slider.stiffness - softest.stiffness
            if neutral.unstable(added):
                found.append(slider)
            fewest += neutral.unstable(added + margin)
            most += neutral.unstable(added - margin)
    if most and not fewest:
        raise UndecidedError(
            f"at {rig.in_units(rig.velocity, 'velocity')} a mode is on its stability "
            "boundary to within the accuracy of the response; change a parameter "
            "slightly"
        )
    return found


def _neutral(rig: Rig) -> Neutral:
    """Return the neutral frequencies of all sliders at least as stiff as that of a rig,
    with its mass and damping.
    """
    sliding = smooth_sliding(rig)
    (found,) = neutral_frequencies([sliding], softest=sliding.static_stiffness)
    return found


def _beyond_the_first(rig: Rig) -> float:
    """Return the cost of another mode on contacts whose response is known, in usual
    evaluations of linear theory.
    """
    return _ANOTHER * cost_of_theory(rig) if is_expensive(rig) else 0.0


def _growth(rig: Rig, slider: Slider, budget: Budget) -> tuple[float | None, ...]:
    """Return growth rate and frequency of a mode, as `fastest_mode` does."""
    there = _with_mode(rig, slider)
    more = _beyond_the_first(there)
    return budget.theory(by_theory.fastest_mode, there, more=more)


def _fastest(rig: Rig, growing: Sequence[Slider], budget: Budget) -> Slider | None:
    """Return the mode that grows fastest; None if none grows.

    Growth changes gradually from one mode to the next: ever closer neighbours of the
    best one are tried.
    """
    if not growing:
        return None

    def growth(index: int) -> float:
        return _growth(rig, growing[index], budget)[0] or -math.inf

    step = math.ceil(len(growing) / _FIRST)
    best = max(range(0, len(growing), step), key=growth)
    turns = bounded("fastest mode", _MODES)
    while step > 1:
        next(turns)  # it is halved
        step = math.ceil(step / 2)
        last = min(best + step, len(growing) - 1)
        best = max(range(max(best - step, 0), last + 1, step), key=growth)
    return growing[best]


def _wave(
    rig: Rig, row: Sequence[Any], speeds: tuple[float, float], budget: Budget
) -> WaveAnswer:
    """Return the answer for a mode, which is given by a row of `sliders_of`; its speeds
    as far as the budget allows.
    """
    *numbers, slider = row
    stiffness, coupling, wavelength = map(float, numbers)
    growth, frequency = _growth(rig, slider, budget)
    bands: tuple[Band, ...] = ()
    with suppress(BudgetExhausted):
        there = _with_mode(rig, slider)
        bands = theory_along(budget, there, VELOCITY, *speeds, density=_DENSITY)
    searched = bool(bands)
    bands = bands or (Band(kind="unknown", low=speeds[0], high=speeds[1]),)
    length = length_in_words(rig, wavelength, 3)
    return WaveAnswer(
        name=_name(wavelength, coupling, rig.slider, length),
        wavelength=wavelength,
        stiffness=stiffness * rig.unit("k"),
        growth=growth,
        frequency=frequency,
        speeds=_ranges(rig, bands, "unstable"),
        unknown=_ranges(rig, bands, "unknown"),
        searched=searched,
    )


def _ranges(rig: Rig, bands: Iterable[Band], kind: str) -> tuple[Range, ...]:
    """Return the ranges of speed of the bands of a kind, in the rig's own units."""
    found = [band for band in bands if band.kind == kind]
    return tuple(band.ends for band in scaled(found, rig.velocity))


def _missed(
    rig: Rig,
    sliders: Sequence[Slider],
    waves: Mapping[Slider, WaveAnswer],
    speeds: tuple[float, float],
    budget: Budget,
) -> list[Slider]:
    """Return a mode that grows at a speed at which the waves are known to decay, or
    nothing if there is none: on a grid, and just beyond where a wave begins to decay.
    """
    count = 1 + math.ceil(_DENSITY * math.log10(speeds[1] / speeds[0]))
    seen = waves.values()
    known = [ends for wave in seen for ends in (*wave.speeds, *wave.unknown)]
    beyond = [
        end / rig.velocity * factor
        for end in chain.from_iterable(known)
        for factor in (1.0 / (1.0 + PRECISION), 1.0 + PRECISION)
    ]
    tried = [*np.geomspace(*speeds, count).tolist(), *beyond]
    for factor in (each for each in tried if speeds[0] <= each <= speeds[1]):
        speed = factor * rig.velocity
        if any(low <= speed <= high for low, high in known):
            continue
        there = replace(rig, drive=constant(factor * rig.natural.velocity))
        with suppress(InputError, UndecidedError):
            growing = _growing(there, sliders, budget)
            if others := [slider for slider in growing if slider not in waves]:
                return others[:1]
    return []


def complete_waves(
    found: ElasticPrediction, budget: Budget, report: Progress
) -> ElasticPrediction:
    """Add to the answer the slips of a bar from rest, and the changes that make its
    smooth sliding stable, as far as the budget allows.
    """
    if found.not_searched:
        ends = found.speeds_searched
        low, high = (end / found.rig.velocity for end in ends)
        with budget.limited_to(_FOR_SPEEDS):
            found = predict_waves(
                found.rig, (low, high), budget, part(report, 0.0, 0.2)
            )
    if found.theory_note or not isinstance(found.rig.slider, Chain):
        return found
    if found.growing:
        with budget.limited_to(_FOR_CHANGES):
            changes = _changes(
                found.rig, found.critical, budget, part(report, 0.2, 0.4)
            )
        changes["not_searched"] = found.not_searched + changes["not_searched"]
        found = replace(found, **changes)
    return replace(found, **_slips(found.rig, budget, part(report, 0.4, 1.0)))


def _name(wavelength: float, coupling: float, body: ElasticBody, length: str) -> str:
    """Return the name of a mode, in words."""
    if math.isnan(wavelength):
        return "a mode localised at the driven end"
    if math.isinf(wavelength):
        return "the uniform mode" if coupling == 0.0 else "waves across the drive"
    # a wave longer than its bar is not shown by its length
    if not isinstance(body, Chain) or wavelength < body.size * (1.0 + 1e-9):
        return f"waves of {length}"
    whole = wavelength > 3.0 * body.size
    return "the bar nearly as a whole" if whole else "half a wave along the bar"


def _is_stable(rig: Rig, budget: Budget) -> bool:
    """Whether linear theory shows that no mode of a bar grows at the speed of its
    drive.
    """
    try:
        return not _growing(rig, _modes_of(rig.slider)[-1], budget)
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
    missed = list[str]()
    # Leaf springs of the critical stiffness stabilise the softest mode of a bar without
    # any.
    if critical is not None and rig.natural.slider.leaf == 0:
        to = critical.stiffness * (1.0 + PRECISION)
        with suppress(BudgetExhausted):
            if _is_stable(rig.with_values(leaf=to), budget):
                found.append(Mitigation(parameter="leaf", now=0.0, to=to))
    for i, parameter in enumerate(_CHANGES):
        report(i / len(_CHANGES))
        if not has(rig, parameter):
            continue
        now = rig.value(parameter)
        low, high = reach(rig, parameter)
        try:
            up = _smallest(rig, parameter, 1, high, budget)
            down = _smallest(rig, parameter, -1, 1.0 / low, budget)
        except BudgetExhausted:
            missed.append(parameter.title)
            continue
        if math.isinf(min(up, down)):
            tried[parameter.name] = now * low, now * high
            continue
        to = now * up if up <= down else now / down
        found.append(Mitigation(parameter=parameter.name, now=now, to=to))
    found.sort(key=lambda each: each.size)
    return {
        "mitigations": tuple(found),
        "attempts": tried,
        "not_searched": tuple(missed),
    }


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

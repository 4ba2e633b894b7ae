"""Making a prediction: first the verdict, then other speeds, margins, mitigations."""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import groupby
from typing import Any

import numpy as np

from stickslip.advise import survey as by_theory
from stickslip.advise.answer import ElasticPrediction, Prediction
from stickslip.advise.axis import AxisAnswer, complete_axis, judge_axis
from stickslip.advise.bars import complete_waves, predict_waves
from stickslip.advise.budget import (
    LINEAR_NOISE,
    OSCILLATES,
    SEEDS,
    Budget,
    BudgetExhausted,
    cost_of_run,
    cycle_of,
    fluctuation,
    is_expensive,
    length_of,
    method_of,
    survives_noise,
    trial,
    varies,
)
from stickslip.advise.doubt import Doubt
from stickslip.advise.findings import LARGE_NOISE, Margin
from stickslip.advise.mitigations import (
    Search,
    has,
    machine_parameters,
    reach,
)
from stickslip.advise.survey import Band, Survey, scaled, stability_along, theory_along
from stickslip.cycles.edges import halved
from stickslip.errors import InputError, UndecidedError, instance, number
from stickslip.measure.episodes import Episode, episodes
from stickslip.model import Delay, ElasticBody, OnArrest, Slider
from stickslip.model.drive import constant
from stickslip.model.methods import DRAWN
from stickslip.model.parameters import (
    DELAY,
    PARAMETERS,
    VELOCITY,
    parameter_named,
)
from stickslip.model.rig import Ends, Rig
from stickslip.model.structure import ControlledAxis, Structure
from stickslip.progress import Progress, heard, part, reporting
from stickslip.rigid import critical_stiffness, static_friction
from stickslip.simulation import Recording, record
from stickslip.simulation.engines.blocks import check_body
from stickslip.sliding import kinetic_friction, respond
from stickslip.stability import contact_noise, count_unstable

# Conventions: the number of runs for a verdict and for a whole answer, and the
# fractions of what is left of it that go to other speeds and to varied assumptions.
_FOR_VERDICT = 30.0
_FOR_ALL = 160.0
_FOR_SPEEDS = 0.5
_FOR_DOUBT = 0.15
# a peak to peak below this fraction of static friction is small: a convention
_SMALL = 0.05
# The first run costs at most `_FIRST` runs, but lasts for at least `_FEWEST_CYCLES` of
# the slowest cycle.
_FIRST = 15.0
_FEWEST_CYCLES = 3.3
# range of delays tried for a rig without a mechanism, in mean thresholds over the speed
_DELAYS = (0.01, 10.0)


def predict(
    rig: Rig,
    *,
    fast: bool = False,
    thorough: bool = False,
    smooth: Ends | None = None,
    progress: Progress | bool | None = None,
) -> Prediction | ElasticPrediction | AxisAnswer:
    """Predict whether a rig stick-slips at its own speed and at others, how far it is
    from the limits, and which changes would stop it.

    Parameters
    ----------
    rig : Rig
    fast : bool
        Stop at the verdict: linear theory, and one run at the rig's speed.
    thorough : bool
        Make all runs without a limit to their number, which may take minutes.
    smooth : (float or str, float or str), optional
        A range of speeds in which the rig is to slide smoothly, in place of those at
        which it works: also search for the smallest change of two parameters together
        that achieves it.
    progress : bool or callable, optional
        True for a progress bar, or a function that is called with the fraction of the
        work that is done.

    Returns
    -------
    Prediction
        It prints as a short text, and has ``plot()`` and ``to_dict()``. Every number is
        in the rig's own units. For a `Chain` or a `Sheet`, an `ElasticPrediction`: the
        linear stability of each wavelength. For a `ControlledAxis`, an `AxisAnswer`:
        whether it tracks steadily, and whether it hunts at rest.

    Raises
    ------
    InputError
        If the rig's speed is not above 0, or `smooth` is no range of speeds.

    Examples
    --------
    >>> answer = ss.predict(ss.example("brake_pad"), fast=True)
    >>> answer.regime.kind, answer.unstable_modes
    ('stick-slip', 2)
    """
    instance(
        "rig", rig, Rig, "a Rig(interface, slider, drive), such as read_rig() returns"
    )
    instance(
        "Rig.slider",
        rig.slider,
        Slider | Structure | ElasticBody,
        "a Slider, an elastic body or a linear structure, which can be simulated",
    )
    for name, given in (("fast", fast), ("thorough", thorough)):
        instance(name, given, bool, "True or False")
    if smooth is not None:
        rig = replace(
            rig,
            operation=replace(
                rig.operation, speeds=(), between=rig.span(VELOCITY, smooth, "smooth")
            ),
        )
    with reporting(progress, "predict") as report:
        if isinstance(rig.slider, ControlledAxis):
            return judge_axis(rig, fast=fast, progress=report)
        if isinstance(rig.slider, Structure):
            _check_structure(rig.natural.slider)
        if isinstance(rig.natural.slider, ElasticBody):
            check_body(rig)
            waves = part(report, 0.0, 1.0 if fast else 0.4)
            found: Prediction | ElasticPrediction = predict_waves(
                rig, _speeds_searched(rig), Budget(_FOR_VERDICT), waves
            )
        else:
            found = _verdict(rig, report if fast else part(report, 0.0, 0.3))
        if fast:
            return found
        return complete(
            found,
            thorough=thorough,
            pairs=smooth is not None,
            progress=part(report, 0.3, 1.0),
        )


def _check_structure(structure: Structure) -> None:
    """Raise `InputError` if a structure cannot follow its drive, so that it has no
    steady sliding.
    """
    system = structure.system
    moves = system.contact @ np.linalg.solve(system.A, -system.drive) + system.track
    if not math.isclose(moves, 1.0, rel_tol=1e-6):
        raise InputError(
            "Rig.slider: its own stiffness holds it, so that its contacts follow the "
            f"drive at {moves:.2g} of its speed; leave the driving spring out, so that "
            "the track moves, or give the mode of its rigid motion, of stiffness 0",
            "Rig.slider",
        )


def _verdict(rig: Rig, report: Progress) -> Prediction:
    """Return the prediction from linear theory and one run."""
    budget = Budget(_FOR_VERDICT)
    low, high = _speeds_searched(rig)
    modes, note = _linear(rig)
    growth = frequency = None
    # The slowest decay of contacts that age, or break by heat, takes up to half a
    # minute: growth_rate() gives it.
    if not note and (modes or not is_expensive(rig)):
        growth, frequency = by_theory.fastest_mode(rig)
    report(0.2)
    run = _first_run(rig, part(report, 0.2, 0.9))
    shown = _shown(rig, modes, budget, run)
    bands: tuple[Band, ...] = (Band(kind="unknown", low=low, high=high),)
    if not note:
        with suppress(BudgetExhausted):
            bands = theory_along(budget, rig, VELOCITY, low, high)
    forces = _steady_forces(rig)
    driven = None
    if _goes_through_speeds(rig):
        with suppress(BudgetExhausted):
            driven = _episodes(rig, budget, _SMALL * forces["static_friction"])
    report(1.0)
    return Prediction(
        rig=rig,
        **shown,
        **forces,
        driven=driven,
        unstable_modes=modes,
        growth_rate=growth,
        mode_frequency=frequency,
        theory_note=note,
        speeds_searched=(low * rig.velocity, high * rig.velocity),
        bands=scaled(bands, rig.velocity),
        delays=_over_delays(rig) if note == by_theory.CANNOT_GROW else (),
    )


def _steady_forces(rig: Rig) -> dict[str, Any]:
    """Return static and kinetic friction, and critical stiffness, as fields of the
    answer.

    For rigid motion from rest, thresholds are fully grown, and heat has no time to
    break contacts; contacts that re-attach only at an arrest never re-attach.
    """
    delay = rig.interface.delay
    if isinstance(delay, OnArrest):
        delay = Delay(math.inf)
    lasting = replace(rig.interface, delay=delay, slip_to_slip_scatter=0.0)
    aged = replace(lasting, ageing=None, activation=None)
    kinetic = float(kinetic_friction(lasting, rig.natural.velocity))
    without = critical_stiffness(aged, reattachment=False)
    return {
        "static_friction": static_friction(aged)[0] * rig.unit("f_s"),
        "kinetic_friction": kinetic * rig.unit("f_s"),
        "critical_stiffness": critical_stiffness(aged) * rig.unit("k"),
        "critical_stiffness_without_reattachment": without * rig.unit("k"),
    }


def _over_delays(rig: Rig) -> tuple[Band, ...]:
    """Return the bands of linear stability of a rig without a mechanism, over the delay
    that it might have.
    """
    mean = rig.interface.threshold_distribution.moment(1)
    time = mean / rig.natural.velocity
    supposed = replace(rig, interface=replace(rig.interface, delay=Delay(time)))
    bands = stability_along(supposed, DELAY, *_DELAYS)
    return scaled(bands, time * rig.unit("time"))


def _shown(
    rig: Rig, modes: int | None, budget: Budget, run: Recording
) -> dict[str, Any]:
    """Return, as fields of the answer, a run, made longer until its regime is decided,
    with that regime and its noise.
    """
    longer_runs = budget.until_decided(run)
    with suppress(BudgetExhausted):
        for run, seen in longer_runs:
            shown = {"recording": run, "regime": seen}
    bistable = seen.kind in OSCILLATES and modes == 0
    return shown | {
        "noise": fluctuation(run, seen) if seen.is_noise else None,
        "survives_noise": not bistable or survives_noise(rig),
    }


def complete(
    found: Prediction | ElasticPrediction | AxisAnswer,
    *,
    thorough: bool = False,
    pairs: bool = False,
    progress: Progress | None = None,
) -> Prediction | ElasticPrediction | AxisAnswer:
    """Add to a verdict what `predict` finds without ``fast``: the motion from rest at
    other speeds, margins, and mitigations.
    """
    report = heard(progress)
    if isinstance(found, AxisAnswer):
        return complete_axis(found, report)
    budget = Budget(math.inf if thorough else _FOR_ALL)
    if isinstance(found, ElasticPrediction):
        return complete_waves(found, budget, report)
    rig = found.rig
    if not found.has_verdict or (
        found.theory_note and not isinstance(rig.interface.delay, OnArrest)
    ):
        return replace(found, complete=True)
    if found.regime.kind == "undecided":
        shown = _shown(rig, found.unstable_modes, budget, found.recording)
        found = replace(found, **shown)
    found = replace(found, lasting=_lasting(found, budget))
    bands = scaled(found.bands, 1.0 / rig.velocity)
    ends = _speeds_searched(rig)
    if not found.theory_note and bands[0].ends == ends and bands[0].kind == "unknown":
        with suppress(BudgetExhausted):
            bands = theory_along(budget, rig, VELOCITY, *ends)
    survey = Survey(rig, bands, "undecided" if found.lasts_in_some else found.motion)
    with budget.limited_to(_FOR_SPEEDS):
        survey.simulate(budget)
    found = replace(found, bands=scaled(survey.bands(), rig.velocity), complete=True)
    report(0.3)
    margins, missed = ([], []) if found.theory_note else _margins(rig, budget)
    noise_limit = _noise_limit(rig, margins) if found.unstable_modes == 0 else None
    with budget.limited_to(_FOR_DOUBT):
        doubt = Doubt.of(rig, budget)
    found = replace(found, margins=tuple(margins), noise_limit=noise_limit, doubt=doubt)
    report(0.4)
    if found.needs_mitigation:
        search = Search(rig, found.between, budget)
        changes = search.changes(part(report, 0.4, 0.9), pairs=pairs)
        found = replace(found, **changes)
    report(1.0)
    survey.simulate(budget)  # with the rest of the budget
    return replace(
        found,
        bands=scaled(survey.bands(), rig.velocity),
        not_searched=(*found.not_searched, *missed),
    )


def _lasting(found: Prediction, budget: Budget) -> tuple[int, int] | None:
    """Return the number of runs from rest with other contacts whose oscillation
    persists, and the number of these runs; None if one run suffices.
    """
    rig = found.rig
    if found.driven is not None or not varies(rig):
        return None
    kinds = list[str]()
    with suppress(BudgetExhausted, InputError):
        for other in range(1, SEEDS + 1):
            case = trial(rig, other=other, most=math.inf)
            kinds.append(budget.regime(case).kind)
    return sum(kind in OSCILLATES for kind in kinds), len(kinds)


def _speeds_searched(rig: Rig) -> tuple[float, float]:
    """Return the range of speeds of an answer, as factors on the rig's speed: far
    beyond the speeds of the drive, and those at which the rig works, on either side.
    """
    unit = rig.unit_name("velocity")
    number("drive: the speed of a prediction", rig.velocity, above=0, hint=unit)
    ends = [end for piece in rig.drive.pieces for end in (piece.start, piece.end)]
    through = [abs(end) / rig.natural.velocity for end in ends if end != 0]
    through += by_theory.works_at(rig)
    widest = 10.0 if is_expensive(rig) else 100.0
    return min(through) / widest, max(through) * widest


def _first_run(rig: Rig, progress: Progress) -> Recording:
    """Simulate the rig as its file says, or with a constant drive if its own does not
    end with a long enough time at the speed of the answer; for a shorter time, or with
    fewer contacts, if the run costs too much.
    """
    velocity = rig.natural.velocity
    last = rig.drive.pieces[-1]
    short = last.duration * velocity < length_of(rig) and len(rig.drive.pieces) > 1
    if short or not last.start == last.end == velocity:
        rig = replace(rig, drive=trial(rig).drive)
    if len(rig.drive.pieces) == 1:
        duration = rig.drive.duration
        fewest = min(_FEWEST_CYCLES * cycle_of(rig) / velocity, duration)
        if cost_of_run(rig) * fewest > _FIRST * duration:
            rig = replace(rig, method=method_of(rig))
        lasts = min(max(_FIRST / cost_of_run(rig) * duration, fewest), duration)
        rig = replace(rig, drive=constant(velocity, lasts))
    return record(rig, progress=progress)


def _goes_through_speeds(rig: Rig) -> bool:
    """Whether the drive has more than one speed, all in one direction: episodes are
    found from the drops of a force that pulls in one direction.
    """
    velocities = rig.drive.velocities
    return len(velocities) > 1 and min(velocities) >= 0.0


def _episodes(rig: Rig, budget: Budget, smallest: float) -> tuple[Episode, ...]:
    """Return the episodes in which a rig oscillates along its own drive."""
    run = budget.record(replace(rig, method=method_of(rig)))
    return tuple(episodes(run.dataset(), smallest, _most_noise(rig)))


def _most_noise(rig: Rig) -> float:
    """Return the largest rms fluctuation of the force by the noise of the contacts, at
    those speeds of the drive at which smooth sliding is stable.
    """
    most = 0.0
    speeds = {abs(each) for each in rig.drive.velocities} - {0.0}
    for speed in speeds if isinstance(rig.method, DRAWN) else ():
        with suppress(InputError, UndecidedError):  # unstable, or no theory
            there = VELOCITY.set(rig.natural, speed)
            most = max(most, contact_noise(there).spring_force)
    return most * rig.unit("f_s")


def _linear(rig: Rig) -> tuple[int | None, str]:
    """Return the number of growing modes and an empty text; or, if the theory does not
    apply, None and a note.
    """
    if isinstance(rig.interface.delay, OnArrest):
        return None, (
            "contacts re-attach only when the slider stops, so there is no smooth "
            "sliding for linear theory to judge: "
            "speeds are judged by runs, and where stick-slip decays, the slider slides "
            "with no contact attached"
        )
    try:
        return (
            (0, by_theory.CANNOT_GROW)
            if respond(rig.interface).inert
            else (count_unstable(rig), "")
        )
    except (InputError, UndecidedError) as reason:
        return None, str(reason)


def _margins(rig: Rig, budget: Budget) -> tuple[list[Margin], list[str]]:
    """Return the margins of each parameter, within the range around its value in which
    the theory decides, and the titles of those that the budget did not allow.
    """
    margins: list[Margin] = []
    missed: list[str] = []
    for parameter in dict.fromkeys((*PARAMETERS, *machine_parameters(rig))):
        if not has(rig, parameter) or parameter.rescales:
            continue
        value = rig.value(parameter)
        try:
            bands = theory_along(budget, rig, parameter, *reach(rig, parameter))
        except BudgetExhausted:
            missed.append(f"stability limits of the {parameter.title}")
            continue
        for known, group in groupby(bands, key=lambda band: band.kind != "unknown"):
            around = scaled(group, value)
            searched = around[0].low, around[-1].high
            if not known or not searched[0] <= value < searched[1]:
                continue
            edges = [band.high for band in around[:-1]]
            margin = Margin(
                parameter=parameter.name,
                value=value,
                lower=max((edge for edge in edges if edge < value), default=None),
                upper=min((edge for edge in edges if edge > value), default=None),
                searched=searched,
                stable=tuple(band.ends for band in around if band.kind == "stable"),
            )
            margins.append(margin)
    return margins, missed


def _noise_limit(rig: Rig, margins: Sequence[Margin]) -> tuple[str, float] | None:
    """Return the machine parameter with the nearest stability limit, and its value on
    the way there beyond which the noise of the contacts exceeds `LARGE_NOISE`; None if
    that value is within `PRECISION` of the limit.
    """
    limits = [
        each.nearest
        for each in margins
        if each.nearest and parameter_named(each.parameter) in machine_parameters(rig)
    ]
    if not limits or not isinstance(rig.method, DRAWN):
        return None
    limit = min(limits, key=lambda each: each.size)
    # nearer to the limit, noise ends smooth sliding, and no machine is set so precisely
    part = 1.0 - math.log1p(by_theory.PRECISION) / limit.size
    nearest = (limit.to / limit.now) ** max(part, 0.0)
    change = by_theory.factor_on((parameter_named(limit.parameter), 1))

    def is_seen(factor: float) -> bool:
        there = change.set(rig.natural, factor)
        with suppress(UndecidedError):
            noise = contact_noise(there)
            return (
                noise.relative_force > LARGE_NOISE
                or noise.relative_velocity > LINEAR_NOISE
            )
        return True  # at a limit of stability

    with suppress(InputError, UndecidedError):  # no theory of their noise
        here = contact_noise(rig.natural)
        if here.relative_velocity > LINEAR_NOISE or not is_seen(nearest):
            return None
        quiet, _ = halved(is_seen, 1.0, nearest, by_theory.PRECISION / 10.0)
        return limit.parameter, quiet * limit.now
    return None

"""How a prediction is put together: the verdict first, then speeds, margins and mitigations."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

from stickslip.advise import mitigations as changes
from stickslip.advise.answer import Margin, Prediction
from stickslip.advise.bands import CANNOT_GROW, OSCILLATES, Band, fastest_mode, is_dear, stability_along
from stickslip.advise.elastic import ElasticPrediction, predict_waves
from stickslip.advise.runs import (
    Budget,
    about_stable_sliding,
    at_speed,
    cost_of,
    cycle_of,
    length_of,
    rms_over_mean,
    until_judged,
)
from stickslip.advise.speeds import Survey, range_of_speeds
from stickslip.errors import InputError, UndecidedError, instance
from stickslip.measure import Regime
from stickslip.model import Contacts, Delay, ElasticBody, OnArrest
from stickslip.model.drive import constant
from stickslip.model.parameters import DELAY, PARAMETERS, VELOCITY, Parameter, parameter_named
from stickslip.model.rig import Rig
from stickslip.progress import Progress, reporting
from stickslip.rigid import critical_stiffness, static_friction
from stickslip.simulation import Recording
from stickslip.sliding import kinetic_friction, respond
from stickslip.stability import count_unstable

_FIRST, _ALL, _FOR_SPEEDS = 0.8, 15.0, 0.25
"""Seconds, by estimate, for the first run, and for all runs; the part of the rest that goes to other speeds."""
_DEARER = 10.0
"""How much more contacts may take that age or break by heat, whose runs cost up to a hundred times as much."""
_FEWEST_CYCLES = 3.3
"""The first run lasts for so many, by their longest, whatever that takes; most are shorter."""
_FOR_A_VERDICT, _LONGEST, _MOST_RUNS = 40.0, 80.0, 30
"""For runs that tell noise from oscillation; and for a run that is made twice as long, again and again."""
NO_THEORY_OF_ARREST = (
    "contacts re-attach only when the slider stops, so there is no smooth sliding for linear theory to judge: speeds "
    "are judged by runs"
)
_DELAYS = (0.01, 10.0)
"""Delays tried where a rig names no mechanism, in breaking displacements over the speed."""


def predict(rig: Rig, *, fast: bool = False, progress: Progress | bool | None = None) -> Prediction | ElasticPrediction:
    """Say at which speeds a rig stick-slips, what it does at its own, how safely, and what would stop it.

    Parameters
    ----------
    rig : Rig
    fast : bool
        Stop at the verdict: linear theory, and one run at the rig's speed.
    progress : bool or callable, optional
        True for a bar, or a function that is called with the fraction of the work that is done.

    Returns
    -------
    Prediction
        It prints as a short text, and has ``plot()`` and ``to_dict()``. Every number is in the rig's own units. Of a
        `Chain` or a `Sheet`, `ElasticPrediction`: what linear theory says of each wavelength.

    Raises
    ------
    InputError
        If the rig's speed is not above 0.

    Examples
    --------
    >>> import stickslip as ss
    >>> answer = ss.predict(ss.example("brake_pad"), fast=True)
    >>> answer.regime.kind, answer.unstable_modes
    ('stick-slip', 2)
    """
    instance("rig", rig, Rig, "a Rig(interface, slider, drive), such as read_rig() returns")
    with reporting(progress, "predict") as report:
        if isinstance(rig.natural.slider, ElasticBody):
            return predict_waves(rig, report)
        found = _verdict(rig, lambda share: report(share if fast else 0.3 * share))
        return found if fast else complete(found, progress=lambda share: report(0.3 + 0.7 * share))


def _verdict(rig: Rig, report: Progress) -> Prediction:
    """Linear theory and one run."""
    setting = rig.natural
    low, high = range_of_speeds(rig)
    modes, note = _linear(setting)
    without = note == CANNOT_GROW
    bands: tuple[Band, ...] = (Band(kind="unknown", low=low, high=high),)
    if not note:
        bands = stability_along(VELOCITY, at_speed(setting, low), low, high)
    report(0.2)
    recording, seen = _watch(rig, lambda share: report(0.2 + 0.8 * share))
    state = "stays"
    if modes == 0 and not without and seen.kind != "smooth sliding" and isinstance(recording.rig.method, Contacts):
        kinds = (*OSCILLATES, "undecided")
        recording, seen, state = about_stable_sliding(recording, seen, Budget(_FOR_A_VERDICT), kinds)
    if modes:  # what grows is no transient
        seen = replace(seen, reason=seen.reason.split(" (seen for")[0])
    # Rigid motion from contacts at rest finds thresholds that have grown up, and is over before heat breaks any; a
    # slider that never stops attaches none that wait for its arrest.
    delay = rig.interface.delay
    lasting = replace(rig.interface, delay=Delay(math.inf) if isinstance(delay, OnArrest) else delay, track_scatter=0.0)
    aged = replace(lasting, ageing=None, temperature=None)
    growth, frequency = (None, None) if note else fastest_mode(rig)
    force, stiffness, speed = rig.unit("f_s"), rig.unit("k"), rig.unit("x_s/time")
    return Prediction(
        rig=rig,
        recording=recording,
        regime=seen,
        static_friction=static_friction(aged)[0] * force,
        kinetic_friction=float(kinetic_friction(lasting, setting.velocity)) * force,
        critical_stiffness=critical_stiffness(aged) * stiffness,
        critical_stiffness_without_reattachment=critical_stiffness(aged, reattachment=False) * stiffness,
        unstable_modes=modes,
        growth_rate=growth,
        mode_frequency=frequency,
        theory_note=note,
        speeds_searched=(low * speed, high * speed),
        bands=tuple(band.scaled(speed) for band in bands),
        delays=_over_delays(rig) if without else (),
        noise=rms_over_mean(recording, seen) if state == "noise" else None,
        stays=state != "leaves",
    )


def complete(found: Prediction, *, progress: Progress | None = None) -> Prediction:
    """Go on from a verdict to what `predict` finds without ``fast``: speeds from rest, margins, mitigations."""
    report = progress or (lambda _share: None)
    rig = found.rig
    setting, speed = at_speed(rig.natural, rig.natural.velocity), rig.unit("x_s/time")
    if not found.judged or (found.theory_note and not isinstance(rig.interface.delay, OnArrest)):
        report(1.0)
        return replace(found, complete=True)
    spent = min(cost_of(found.recording.rig), 0.7 * _ALL)
    left = (_ALL - spent) * (_DEARER if is_dear(rig.interface) else 1.0)
    bands = tuple(band.scaled(1.0 / speed) for band in found.bands)
    survey, allowed = Survey(setting, bands, found.regime.kind), Budget(_FOR_SPEEDS * left)
    survey.look(allowed, lambda share: report(0.3 * share))
    theory = {} if found.theory_note else dict(_theory(setting, bands))
    found = replace(found, margins=tuple(_margins(rig, theory)), complete=True)
    report(0.4)
    if found.ill:
        changing = Budget(left - _FOR_SPEEDS * left + allowed.left)
        search = changes.Search(rig, bool(found.unstable_modes), theory, changing)
        found = _with_mitigations(found, search, lambda share: report(0.4 + 0.5 * share))
        for change in found.mitigations:
            if change.parameters == (VELOCITY.name,) and change.stops is not None:
                survey.known[change.stops[0] / speed] = "smooth sliding"
        survey.look(changing, lambda share: report(0.9 + 0.1 * share))
    report(1.0)
    return replace(found, bands=tuple(band.scaled(speed) for band in survey.bands()))


def _with_mitigations(found: Prediction, search: changes.Search, report: Progress) -> Prediction:
    """Look for changes of one parameter; of two, if none of those that can be turned suffices."""

    def stopping() -> set[str]:
        return {m.parameters[0] for m in single if m.stops is not None}

    def attempts() -> dict[changes.Attempt, int]:
        static = found.static_friction / found.rig.unit("f_s")
        return search.attempts(found.relative_amplitude, static, stopping())

    single = search.single(changes.TURNABLE, lambda share: report(0.5 * share))
    tried: dict[changes.Attempt, int] = {}
    pairs: list[changes.Mitigation] = []
    if not stopping():
        tried = attempts()
        report(0.6)
        pairs = search.pairs({each.parameter: side for each, side in tried.items()})
    single += search.single(changes.OTHERS, lambda share: report(0.7 + 0.3 * share))
    turnable = {parameter.name for parameter, _ in changes.TURNABLE}

    def order(mitigation: changes.Mitigation) -> tuple[bool, bool, float]:
        return not turnable.issuperset(mitigation.parameters), mitigation.stops is None, round(mitigation.size, 3)

    helped = {parameter_named(name).title for name in stopping()}
    return replace(
        found,
        mitigations=tuple(sorted([*single, *pairs], key=order)),
        attempts=tuple(tried or attempts()),
        not_searched=tuple(name for name in dict.fromkeys(search.left_out) if name not in helped),
    )


def _watch(rig: Rig, progress: Progress) -> tuple[Recording, Regime]:
    """Simulate the rig as its file says, shorter if that takes long; longer if it cannot be judged.

    A drive whose last stretch is not of constant speed is replaced by one of constant speed.
    """
    drive, setting = rig.drive, rig.natural
    dearer = _DEARER if is_dear(rig.interface) else 1.0
    fewest = _FEWEST_CYCLES * cycle_of(setting) / setting.velocity
    if drive.pieces[-1].start != drive.pieces[-1].end or drive.pieces[-1].end <= 0:
        drive = constant(setting.velocity, length_of(setting) / setting.velocity)
    if len(drive.pieces) == 1:
        part = _FIRST * dearer / cost_of(replace(rig, drive=drive))
        enough = max(part * drive.duration, fewest)
        if part < 1.0 and drive.duration > enough:
            drive = constant(setting.velocity, enough)
    case, budget = replace(rig, drive=drive), Budget(_LONGEST * dearer)
    return until_judged(case, budget, most=_MOST_RUNS, fewest=fewest, long=False, progress=progress)


def _linear(setting: Rig) -> tuple[int | None, str]:
    """Growing modes, and a note where the theory has nothing to say."""
    if isinstance(setting.interface.delay, OnArrest):
        return None, NO_THEORY_OF_ARREST
    try:
        return (0, CANNOT_GROW) if respond(setting.interface).inert else (count_unstable(setting), "")
    except (InputError, UndecidedError) as reason:
        return None, str(reason)


def _over_delays(rig: Rig) -> tuple[Band, ...]:
    """What the verdict would be with delays between a hundredth and ten times the time to the breaking displacement."""
    setting = rig.natural
    time = setting.interface.threshold_distribution.moment(1) / setting.velocity
    low, high = (factor * time for factor in _DELAYS)
    supposed = replace(setting, interface=replace(setting.interface, delay=Delay(time)))
    return tuple(band.scaled(rig.unit("time")) for band in stability_along(DELAY, supposed, low, high))


def _theory(setting: Rig, speeds: tuple[Band, ...]) -> Iterator[tuple[str, tuple[Band, ...]]]:
    """Ranges of each parameter that a rig has in which smooth sliding is stable or not; speeds are known already."""
    for parameter in PARAMETERS:
        try:
            value = parameter.get(setting)
        except InputError:  # the rig has no such parameter
            continue
        if value <= 0:
            continue
        low, high = _searched(parameter, value, setting)
        if parameter is VELOCITY:
            inside = [band for band in speeds if band.low < high and band.high > low]
            yield parameter.name, tuple(replace(b, low=max(b.low, low), high=min(b.high, high)) for b in inside)
        else:
            yield parameter.name, stability_along(parameter, setting, low, high)


def _margins(rig: Rig, theory: Mapping[str, tuple[Band, ...]]) -> Iterator[Margin]:
    """Look up and down from where each parameter stands for the nearest limit of linear stability."""
    for name, bands in theory.items():
        value, size = rig.value(name), rig.unit(parameter_named(name).unit)
        # As far about the value as the theory can tell without a gap.
        gaps = [band for band in bands if band.kind == "unknown"]
        begin = max((gap.high for gap in gaps if gap.low <= value / size), default=0.0)
        end = min((gap.low for gap in gaps if gap.low > value / size), default=math.inf)
        known = [band.scaled(size) for band in bands if begin <= band.low < end and band.kind != "unknown"]
        if known:
            edges = [band.high for band in known[:-1]]
            yield Margin(
                parameter=name,
                value=value,
                lower=max((edge for edge in edges if edge < value), default=None),
                upper=min((edge for edge in edges if edge > value), default=None),
                searched=(known[0].low, known[-1].high),
                stable=tuple((band.low, band.high) for band in known if band.kind == "stable"),
            )


def _searched(parameter: Parameter, value: float, rig: Rig) -> tuple[float, float]:
    """Range of a parameter in which its margins are looked for, in its natural unit."""
    widest = changes.DEAR_RANGE if is_dear(rig.interface) else changes.RANGE
    if parameter.name == "std":  # wider than that is no longer a distribution of thresholds about its mean
        return value / 3.0, max(changes.WIDEST_STD * rig.interface.thresholds.moment(1), 1.5 * value)
    if parameter.name == "delay":  # longer delays never help, and have many modes
        return value / changes.RANGE, value * 3.0
    return value / widest, value * widest

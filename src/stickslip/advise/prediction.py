"""How a prediction is put together: the verdict first, then speeds, margins and
mitigations.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import groupby
from typing import Any

from stickslip.advise import bands as by_theory
from stickslip.advise import say
from stickslip.advise.answer import ElasticPrediction, Margin, Prediction, WaveAnswer
from stickslip.advise.bands import Band, Survey, scaled, stability_along, theory_along
from stickslip.advise.doubt import Doubt
from stickslip.advise.mitigations import TURNABLE, has, mitigated, reach, speeds_of
from stickslip.advise.runs import (
    OSCILLATES,
    SEEDS,
    Spent,
    Trials,
    cycle_of,
    fluctuation,
    method_of,
    stays,
    trial,
)
from stickslip.cycles.edges import halved
from stickslip.errors import InputError, UndecidedError, instance, number
from stickslip.model import Chain, Delay, ElasticBody, OnArrest, Slider
from stickslip.model.drive import constant
from stickslip.model.methods import DRAWN
from stickslip.model.parameters import DELAY, PARAMETERS, VELOCITY, parameter_named
from stickslip.model.rig import Ends, Rig
from stickslip.progress import Progress, part, reporting
from stickslip.rigid import critical_stiffness, static_friction
from stickslip.simulation import Recording, estimate, record
from stickslip.sliding import kinetic_friction, respond
from stickslip.stability import contact_noise, count_unstable

# By convention, in seconds of one core by estimate: what a verdict may take, and all of
# an answer. The parts of what is left at its turn that the first run gets, if it lasts
# long enough, other speeds, and what is assumed.
_FAST = 2.0
_ALL = 14.0
_FOR_FIRST = 0.5
_FOR_SPEEDS = 0.5
_FOR_DOUBT = 0.2
# that the first run lasts for, by their longest, whatever that takes; most are shorter
_FEWEST_CYCLES = 3.3
# of an elastic slider, the softest: that are counted; that are told of, of different
# stiffness
_MODES = 64
_WAVES = 5
# tried where a rig names no mechanism, in breaking displacements over the speed
_DELAYS = (0.01, 10.0)


def predict(
    rig: Rig,
    *,
    fast: bool = False,
    thorough: bool = False,
    smooth: Ends | None = None,
    progress: Progress | bool | None = None,
) -> Prediction | ElasticPrediction:
    """Say at which speeds a rig stick-slips, what it does at its own, how safely, and
    what would stop it.

    Parameters
    ----------
    rig : Rig
    fast : bool
        Stop at the verdict, after about 2 s: linear theory, and one run at the rig's
        speed.
    thorough : bool
        Make all runs that can be asked for, not just those of some 15 s;
        `stickslip.advise.in_full` estimates them.
    smooth : (float or str, float or str), optional
        A range of speeds in which it is to slide smoothly, in place of those at which
        it works: the smallest change, and the smallest of two parameters together, that
        see to it.
    progress : bool or callable, optional
        True for a bar, or a function that is called with the fraction of the work that
        is done.

    Returns
    -------
    Prediction
        It prints as a short text, and has ``plot()`` and ``to_dict()``. Every number is
        in the rig's own units. Of a `Chain` or a `Sheet`, `ElasticPrediction`: what
        linear theory says of each wavelength.

    Raises
    ------
    InputError
        If the rig's speed is not above 0, or the range is none.

    Examples
    --------
    >>> answer = ss.predict(ss.example("brake_pad"), fast=True)
    >>> answer.regime.kind, answer.unstable_modes
    ('stick-slip', 2)
    """
    instance(
        "rig", rig, Rig, "a Rig(interface, slider, drive), such as read_rig() returns"
    )
    if smooth is not None:
        rig = replace(
            rig,
            operation=replace(
                rig.operation, speeds=(), between=rig.span(VELOCITY, smooth, "smooth")
            ),
        )
    with reporting(progress, "predict") as report:
        if isinstance(rig.natural.slider, ElasticBody):
            return _predict_waves(rig, report)
        found = _verdict(rig, report if fast else part(report, 0.0, 0.3))
        if fast:
            return found
        return complete(
            found,
            thorough=thorough,
            pairs=smooth is not None,
            progress=part(report, 0.3, 1.0),
        )


def _verdict(rig: Rig, report: Progress) -> Prediction:
    """Linear theory and one run."""
    trials = Trials(_FAST)
    low, high = _speeds_searched(rig)
    modes, note = trials.theory(_linear, rig)
    growth = None
    frequency = None
    with suppress(Spent):
        growth, frequency = (
            (None, None)
            if note
            else trials.theory(by_theory.fastest_mode, rig, roots=1)
        )
    report(0.2)
    left = _FOR_FIRST * (trials.allowed - trials.spent)
    shown = _shown(rig, modes, trials, _first_run(rig, left, part(report, 0.2, 0.9)))
    bands: tuple[Band, ...] = (Band(kind="unknown", low=low, high=high),)
    with suppress(Spent):
        bands = bands if note else theory_along(trials, rig, VELOCITY, low, high)
    report(1.0)
    # Rigid motion from contacts at rest finds thresholds that have grown up, and is
    # over before heat breaks any; a slider that never stops attaches none that wait for
    # its arrest.
    delay = rig.interface.delay
    lasting = replace(
        rig.interface,
        delay=Delay(math.inf) if isinstance(delay, OnArrest) else delay,
        slip_to_slip_scatter=0.0,
    )
    aged = replace(lasting, ageing=None, activation=None)
    delays: tuple[Band, ...] = ()
    if note == by_theory.CANNOT_GROW:  # what the verdict would be with which delay
        time = rig.interface.threshold_distribution.moment(1) / rig.natural.velocity
        supposed = replace(rig, interface=replace(rig.interface, delay=Delay(time)))
        delays = scaled(
            stability_along(supposed, DELAY, *_DELAYS), time * rig.unit("time")
        )
    return Prediction(
        rig=rig,
        **shown,
        static_friction=static_friction(aged)[0] * rig.unit("f_s"),
        kinetic_friction=float(kinetic_friction(lasting, rig.natural.velocity))
        * rig.unit("f_s"),
        critical_stiffness=critical_stiffness(aged) * rig.unit("k"),
        critical_stiffness_without_reattachment=critical_stiffness(
            aged, reattachment=False
        )
        * rig.unit("k"),
        unstable_modes=modes,
        growth_rate=growth,
        mode_frequency=frequency,
        theory_note=note,
        speeds_searched=(low * rig.velocity, high * rig.velocity),
        bands=scaled(bands, rig.velocity),
        delays=delays,
    )


def _shown(
    rig: Rig, modes: int | None, trials: Trials, run: Recording
) -> dict[str, Any]:
    """What a run shows, made longer until that can be told, as fields of the answer."""
    run, seen, _ = trials.watch(run)
    return {
        "recording": run,
        "regime": seen,
        "noise": fluctuation(run, seen) if seen.is_noise else None,
        "stays": not (seen.kind in OSCILLATES and modes == 0) or stays(rig),
    }


def complete(
    found: Prediction,
    *,
    thorough: bool = False,
    pairs: bool = False,
    progress: Progress | None = None,
) -> Prediction:
    """Go on from a verdict to what `predict` finds without ``fast``: speeds from
    rest, margins, mitigations.
    """
    report = progress or (lambda _done: None)
    rig = found.rig
    if not found.judged or (
        found.theory_note and not isinstance(rig.interface.delay, OnArrest)
    ):
        return replace(found, complete=True)
    trials = Trials(math.inf if thorough else _ALL)
    missed = list[str]()
    trials.spent = min(estimate(found.recording.rig).seconds, _FAST)
    if found.regime.kind == "undecided":
        found = replace(
            found, **_shown(rig, found.unstable_modes, trials, found.recording)
        )
    bands = scaled(found.bands, 1.0 / rig.velocity)
    if (
        not found.theory_note
        and bands[0].ends == _speeds_searched(rig)
        and bands[0].kind == "unknown"
    ):
        with trials.within(0.5), suppress(Spent):
            bands = theory_along(trials, rig, VELOCITY, *bands[0].ends)
    survey = Survey(rig, bands, found.regime.kind)

    def surveyed(found: Prediction, part: float) -> Prediction:
        with trials.within(part):
            survey.look(trials)
        return replace(found, bands=scaled(survey.bands(), rig.velocity), complete=True)

    found = surveyed(found, _FOR_SPEEDS)
    report(0.3)
    margins = [] if found.theory_note else [*_margins(rig, trials, missed)]
    noisy = _noisy(rig, margins, trials) if found.unstable_modes == 0 else None
    with trials.within(_FOR_DOUBT):
        found = replace(
            found, margins=tuple(margins), noisy=noisy, doubt=Doubt.of(rig, trials)
        )
    report(0.4)
    if found.ill:
        found = mitigated(found, trials, part(report, 0.4, 0.9), pairs=pairs)
    report(1.0)
    return surveyed(replace(found, not_searched=(*found.not_searched, *missed)), 1.0)


def in_full(found: Prediction) -> float:
    """Seconds, by estimate, of the runs that `complete` may make: over speeds, and
    of each parameter one way.
    """
    trials = Trials(math.inf)
    rig = found.rig
    trials.judge(trial(rig))
    # steps double, are halved, and all must slide
    of_each = SEEDS + 2 * by_theory.halvings(max(reach(rig, VELOCITY)))
    return (
        trials.spent
        * of_each
        * (1 + (len(speeds_of(found)) * len(PARAMETERS) if found.ill else 0))
    )


def _speeds_searched(rig: Rig) -> tuple[float, float]:
    """The speeds that an answer is about, as factors: far on either side of those
    that the drive goes through.
    """
    number(
        "drive: the speed of a prediction",
        rig.velocity,
        above=0,
        hint=rig.unit_name("velocity"),
    )
    ends = [
        abs(v) / rig.natural.velocity
        for piece in rig.drive.pieces
        for v in (piece.start, piece.end)
        if v != 0
    ]
    through = [*ends, *by_theory.works_at(rig)]
    widest = 10.0 if by_theory.is_dear(rig) else 100.0
    return min(through) / widest, max(through) * widest


def _first_run(rig: Rig, seconds: float, progress: Progress) -> Recording:
    """Simulate the rig as its file says, if that ends at the speed of the answer;
    shorter if that is dear.
    """
    drive = rig.drive
    velocity = rig.natural.velocity
    if not drive.pieces[-1].start == drive.pieces[-1].end == velocity:
        drive = trial(rig).drive
    run = replace(rig, drive=drive)
    if len(drive.pieces) == 1:
        fewest = _FEWEST_CYCLES * cycle_of(rig) / velocity / drive.duration
        if fewest * estimate(run).seconds > seconds:
            run = replace(run, method=method_of(run))
        part_of = min(max(seconds / estimate(run).seconds, fewest), 1.0)
        run = replace(run, drive=constant(velocity, part_of * drive.duration))
    return record(run, progress=progress)


def _linear(rig: Rig) -> tuple[int | None, str]:
    """Growing modes, and a note where the theory has nothing to say."""
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


def _margins(rig: Rig, trials: Trials, missed: list[str]) -> Iterator[Margin]:
    """The nearest limits of linear stability about where each parameter stands, as far
    as theory has no gap.

    What costs too much is `missed`.
    """
    for parameter in (each for each in PARAMETERS if has(rig, each)):
        try:
            bands = theory_along(trials, rig, parameter, *reach(rig, parameter))
        except Spent:
            missed.append(f"stability limits of the {parameter.title}")
            continue
        for known, group in groupby(bands, key=lambda band: band.kind != "unknown"):
            about = list(group)
            if known and about[0].low <= 1.0 < about[-1].high:
                value = rig.value(parameter)
                about = list(scaled(about, value))
                edges = [band.high for band in about[:-1]]
                yield Margin(
                    parameter=parameter.name,
                    value=value,
                    lower=max((edge for edge in edges if edge < value), default=None),
                    upper=min((edge for edge in edges if edge > value), default=None),
                    searched=(about[0].low, about[-1].high),
                    stable=tuple(band.ends for band in about if band.kind == "stable"),
                )


def _noisy(
    rig: Rig, margins: Sequence[Margin], trials: Trials
) -> tuple[str, float] | None:
    """What could be set nearest to a limit, and its value on the way there at which
    noise of the contacts is seen.
    """
    near = [each for each in margins if parameter_named(each.parameter) in TURNABLE]
    limits = [
        (abs(math.log(end / each.value)), end, each)
        for each in near
        for end in each.limits
    ]
    if not limits or not isinstance(rig.method, DRAWN):
        return None
    _, end, nearest = min(limits, key=lambda each: each[0])
    change = by_theory.factor_on((parameter_named(nearest.parameter), 1))

    def seen(there: Rig) -> bool:
        with suppress(UndecidedError):
            return contact_noise(there).relative_force > say.SEEN
        return True  # at a limit of stability

    def probe(factor: float) -> bool:
        return trials.theory(seen, change.set(rig.natural, factor), roots=1)

    with suppress(InputError, Spent):  # no theory of their noise
        quiet, _ = halved(probe, 1.0, end / nearest.value, by_theory.PRECISION / 10.0)
        return nearest.parameter, quiet * nearest.value
    return None


def _predict_waves(rig: Rig, report: Progress) -> ElasticPrediction:
    """Say which waves of an elastic slider grow at the speed of its drive, and at
    which speeds.
    """
    # slow to load
    from stickslip.elastic.modes import critical_length, length_in_words, sliders_of

    low, high = _speeds_searched(rig)
    found = ElasticPrediction(
        rig=rig, speeds_searched=(low * rig.velocity, high * rig.velocity)
    )
    stiffness, coupling, wavelength, sliders = sliders_of(rig.slider, _MODES)
    if respond(rig.interface).inert:
        return replace(found, theory_note=by_theory.CANNOT_GROW)
    sliding = {
        slider: replace(rig, slider=slider, drive=constant(rig.natural.velocity))
        for slider in sliders
    }

    def wave(slider: Slider) -> WaveAnswer:  # modes come in pairs of one stiffness
        i = sliders.index(slider)
        growth, frequency = by_theory.fastest_mode(sliding[slider])
        report((i + 1) / (i + 2))
        bands = stability_along(sliding[slider], VELOCITY, low, high)
        length = length_in_words(rig, float(wavelength[i]), 3)
        return WaveAnswer(
            name=_name(float(wavelength[i]), float(coupling[i]), rig.slider, length),
            wavelength=float(wavelength[i]),
            stiffness=float(stiffness[i]) * rig.unit("k"),
            growth=growth,
            frequency=frequency,
            speeds=tuple(
                band.ends
                for band in scaled(bands, rig.velocity)
                if band.kind == "unstable"
            ),
        )

    try:
        grows = {slider: count_unstable(there) > 0 for slider, there in sliding.items()}
        waves = tuple(wave(slider) for slider in [*sliding][:_WAVES])
        critical = critical_length(rig) if isinstance(rig.slider, Chain) else None
    except UndecidedError as reason:
        return replace(found, theory_note=str(reason))
    report(1.0)
    return replace(
        found,
        growing=sum(grows[slider] for slider in sliders),
        waves=waves,
        critical=critical,
    )


def _name(wavelength: float, coupling: float, body: ElasticBody, length: str) -> str:
    if math.isnan(wavelength):
        return "a mode localised at the driven end"
    if isinstance(body, Chain) and body.size < wavelength < math.inf:
        # No wave is longer than what carries it.
        return (
            "the bar nearly as a whole"
            if wavelength > 3.0 * body.size
            else "half a wave along the bar"
        )
    if math.isfinite(wavelength):
        return f"waves of {length}"
    return "the uniform mode" if coupling == 0.0 else "waves across the drive"

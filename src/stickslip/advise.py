"""The answer to: will this rig stick-slip, at which speeds, and what would stop it.

`predict` answers for a `Rig`: the regime of a simulation with its evidence, the friction forces, the elastic
instability (the whole first fall of the force), the linear stability of smooth sliding, the margin
in every parameter of the rig, and the smallest single changes that would cure it.

Three questions are kept apart, because their answers differ:

- *elastic instability*: is the spring softer than the steepest fall of the force, ``K < K*``, Eq. (8)? Needed for a
  first slip, not enough for stick-slip to last.
- *linear stability*: does smooth sliding, once there, resist a small disturbance?
- *lasting stick-slip*: does stick-slip go on from a start at rest? Between the last two the rig is bistable.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from stickslip import stability
from stickslip.cycles import bistable_region, is_sustained
from stickslip.errors import InputError, UndecidedError, instance, number, whole
from stickslip.measure import Regime, regime
from stickslip.model import Contacts, FromRest, FromSliding, Method, Slider, Start
from stickslip.model.drive import constant
from stickslip.model.parameters import Parameter, parameter_named
from stickslip.model.rig import Rig
from stickslip.model.units import quantity
from stickslip.rigid import critical_stiffness, static_friction
from stickslip.simulation import Progress, simulate
from stickslip.theory import kinetic_friction

if TYPE_CHECKING:
    import xarray as xr

_EXTENSIONS = 2
"""How often a run that cannot be judged is made twice as long."""
_CLEARANCE = 0.05
"""How far past a linear boundary a mitigation goes."""
_STEPS = (1.0, 1.1, 1.25, 1.6, 2.2, 3.5, 6.0, 10.0, 20.0)
_HALVINGS = 2
"""How a parameter is turned in search of where stick-slip decays: by these factors, then by halving the last step."""
_TRIES = 12
_JUDGE = Contacts(10_000, seed=20)
"""The contacts that a mitigation must calm, and how often it is pushed on until it does."""
_SHORTEST, _CYCLES = 120.0, 12.0
"""A run lasts at least this many ``x_s``, and about this many cycles of a spring that unloads by ``f_s``."""
_RANGE = 30.0
"""Margins are looked for within this factor on either side of a parameter's value."""
_AGED_RANGE, _AGED_STEPS, _AGED_JUDGE = 10.0, (1.0, 1.25, 1.8, 3.0), Contacts(2_000, seed=20)
"""The same for thresholds that age, whose response and runs cost more; contacts search as well as judge."""

_TITLES = {
    "stiffness": "stiffness of the driving spring",
    "velocity": "speed",
    "mass": "mass of the slider",
    "damping": "damping eta",
    "delay": "delay of re-attachment",
    "std": "standard deviation of the thresholds",
    "ageing": "time of ageing of the thresholds",
}


@dataclass(frozen=True, kw_only=True)
class Margin:
    """How far a parameter can be turned, alone, before smooth sliding changes its linear stability.

    Attributes
    ----------
    parameter : str
    value : float
        Where it stands.
    lower, upper : float or None
        The nearest boundaries below and above; None if there is none within `searched`.
    searched : (float, float)
    """

    parameter: str
    value: float
    lower: float | None
    upper: float | None
    searched: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Mitigation:
    """A change of one parameter, alone, that gives smooth sliding.

    Attributes
    ----------
    parameter : str
    value : float
        Where it stands.
    keeps : float or None
        Just past the linear boundary: smooth sliding, once there, stays. None if it does so already.
    stops : float or None
        Stick-slip dies even after a start at rest: the bistable band is left behind, as simulated. None if no value
        was found in the range tried.
    seen : Regime or None
        Evidence at `stops`: a run of many contacts from rest.
    checked : tuple of Regime
        With ``verify``: the rig's own method after each change, `keeps` from smooth sliding, `stops` from rest.
    """

    parameter: str
    value: float
    keeps: float | None
    stops: float | None
    seen: Regime | None = None
    checked: tuple[Regime, ...] = ()

    @property
    def size(self) -> float:
        """How far the parameter must be turned, as the logarithm of a factor."""
        target = self.stops if self.stops is not None else self.keeps
        return abs(math.log(target / self.value)) if target else math.inf


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """What `predict` found, in natural units, the regime in the rig's own; the rig carries the scales.

    Attributes
    ----------
    regime : Regime
        Of the simulated run, with its evidence.
    static_friction, kinetic_friction : float
        Largest force in slow rigid motion, and mean force of steady sliding at the rig's speed, per contact.
    critical_stiffness, critical_stiffness_without_reattachment : float
        ``K*`` of Eq. (8) in both conventions, per contact. Where thresholds age, these and the static friction are
        those of contacts whose thresholds have fully grown and do not change during the motion.
    unstable_modes : int or None
        Growing modes of smooth sliding; None where the theory does not apply, for the reason in `theory_note`.
    growth : complex or None
        Growth rate and angular frequency of the fastest mode.
    """

    rig: Rig
    run: xr.Dataset
    regime: Regime
    static_friction: float
    kinetic_friction: float
    critical_stiffness: float
    critical_stiffness_without_reattachment: float
    unstable_modes: int | None
    growth: complex | None
    theory_note: str
    margins: tuple[Margin, ...]
    mitigations: tuple[Mitigation, ...]

    @property
    def stiffness_margin(self) -> float:
        """``K/K*``: above 1 there is no elastic instability; infinite if the force never falls."""
        return self.rig.slider.stiffness / self.critical_stiffness if self.critical_stiffness > 0 else math.inf

    @property
    def smooth(self) -> bool | None:
        """Whether the rig slides smoothly: stable, and seen to in the run; None if undecided."""
        if self.regime.kind == "undecided":
            return None
        return self.regime.kind == "smooth sliding" and not self.unstable_modes

    @property
    def bistable(self) -> bool:
        """Whether smooth sliding is stable although the run shows lasting stick-slip."""
        return self.unstable_modes == 0 and self.regime.kind in ("stick-slip", "sustained oscillation")

    @property
    def ill(self) -> bool:
        """Whether there is something to cure."""
        return bool(self.unstable_modes) or self.regime.kind in ("stick-slip", "sustained oscillation")

    @property
    def verdict(self) -> str:
        """The answer in one sentence."""
        speed = self.rig.in_units(self.rig.natural.velocity, "velocity")
        if self.bistable:
            return (
                f"{self.regime.kind} at {speed} from this start; smooth sliding, once reached, would be stable, too: "
                "the rig is bistable"
            )
        if self.regime.kind == "undecided":
            return f"undecided at {speed}: {self.regime.reason}"
        if self.regime.kind == "smooth sliding" and self.unstable_modes:
            return f"smooth at {speed} so far, but smooth sliding is unstable: oscillation will grow"
        return f"{self.regime.kind} at {speed}"

    def numbers(self) -> Iterator[tuple[str, str]]:
        """Names and values, with units, of the quantities behind the verdict."""
        rig = self.rig
        yield "total contact strength N f_s", rig.in_units(1.0, "force")
        aged = ", thresholds fully aged" if rig.interface.ageing is not None else ""
        yield f"static friction F_s (slow rigid motion{aged})", rig.in_units(self.static_friction, "force")
        yield "kinetic friction F_k at this speed", rig.in_units(self.kinetic_friction, "force")
        yield "stiffness K of the driving spring", rig.in_units(rig.slider.stiffness, "stiffness")
        yield (
            f"critical stiffness K*{aged}",
            f"{rig.in_units(self.critical_stiffness, 'stiffness')} "
            f"({rig.in_units(self.critical_stiffness_without_reattachment, 'stiffness')} without re-attachment)",
        )
        weaker = "softer: elastic instability" if self.stiffness_margin < 1 else "stiffer: no elastic instability"
        yield "margin K/K*", f"{self.stiffness_margin:.3g} ({weaker})"
        if self.theory_note:
            yield "linear stability", self.theory_note
        elif self.growth is None:
            state = f"unstable, {self.unstable_modes} growing modes" if self.unstable_modes else "stable"
            yield "linear stability of smooth sliding", state
        else:
            rate = rig.in_units(self.growth.real, "rate")
            turn = rig.in_units(abs(self.growth.imag) / (2 * math.pi), "rate")
            state = f"unstable, {self.unstable_modes} growing modes" if self.unstable_modes else "stable"
            oscillation = f", oscillating at {turn}" if self.growth.imag else ", without oscillating"
            yield "linear stability of smooth sliding", f"{state}; fastest mode: growth rate {rate}{oscillation}"

    def margin_rows(self) -> Iterator[tuple[str, str, str, str]]:
        """Parameter, value and nearest edges, in words."""
        for margin in self.margins:
            low, high = (amount(self.rig, margin.parameter, value) for value in margin.searched)
            yield (
                _TITLES[margin.parameter],
                amount(self.rig, margin.parameter, margin.value),
                f"none down to {low}" if margin.lower is None else amount(self.rig, margin.parameter, margin.lower),
                f"none up to {high}" if margin.upper is None else amount(self.rig, margin.parameter, margin.upper),
            )

    def mitigation_lines(self) -> Iterator[str]:
        """Each mitigation as a sentence."""
        for mitigation in self.mitigations:
            now = amount(self.rig, mitigation.parameter, mitigation.value)
            words = [f"{_TITLES[mitigation.parameter]}: from {now}"]
            if mitigation.keeps is not None:
                words.append(
                    f"to {amount(self.rig, mitigation.parameter, mitigation.keeps)}, and smooth sliding, once there, stays"
                )
            if mitigation.stops is not None:
                if mitigation.keeps is not None:
                    words.append("; on")
                words.append(
                    f"to {amount(self.rig, mitigation.parameter, mitigation.stops)}, and stick-slip decays from a start at rest, too "
                    "(simulated)"
                )
            else:
                words.append("; from a start at rest, stick-slip lasted in every run tried")
            if mitigation.checked:
                words.append(
                    "; checked with the rig's own method: " + ", ".join(seen.kind for seen in mitigation.checked)
                )
            yield " ".join(words).replace(" ;", ";")


def predict(
    rig: Rig, *, verify: bool = False, progress: Progress | None = None, long: bool = False
) -> Prediction:
    """Say what a rig does at its speed, how safely, and what would make it slide smoothly.

    Parameters
    ----------
    rig : Rig
    verify : bool
        Simulate the rig with its own method after each change that a mitigation proposes.
    progress : callable, optional
        Called with the fraction of the work that is done.
    long : bool
        Whether the simulation of the rig may take more than an hour; see `simulate`.

    Raises
    ------
    InputError
        If the rig's speed is not above 0, or its simulation would take too long and `long` is not set.
    """
    instance("predict: rig", rig, Rig, "a Rig(interface, slider, drive)")
    setting = rig.natural
    if setting.velocity <= 0:
        raise InputError(f"drive: the speed is {setting.velocity:g}: a prediction needs a speed above 0")
    report = progress or (lambda _share: None)
    run, seen = _watch(rig, lambda share: report(0.4 * share), long=long)
    modes, growth, note = _linear(setting)
    margins = tuple(_margins(setting)) if not note else ()
    aged = replace(rig.interface, ageing=None)  # rigid motion from contacts at rest finds thresholds that have grown up
    found = Prediction(
        rig=rig,
        run=run,
        regime=seen,
        static_friction=static_friction(aged)[0],
        kinetic_friction=float(kinetic_friction(rig.interface, setting.velocity)),
        critical_stiffness=critical_stiffness(aged),
        critical_stiffness_without_reattachment=critical_stiffness(aged, reattachment=False),
        unstable_modes=modes,
        growth=growth,
        theory_note=note,
        margins=margins,
        mitigations=(),
    )
    if found.ill:
        mitigations = _mitigations(setting, margins, bool(modes), lambda share: report(0.4 + 0.5 * share))
        found = replace(
            found, mitigations=tuple(_verified(rig, mitigation) if verify else mitigation for mitigation in mitigations)
        )
    report(1.0)
    return found


def _watch(rig: Rig, progress: Progress, *, long: bool) -> tuple[xr.Dataset, Regime]:
    """Simulate the rig as its file says, longer if that cannot be judged; the last stretch of drive is held."""
    drive = rig.drive
    for attempt in range(_EXTENSIONS + 1):
        # A run that was short enough to begin with may be made longer.
        run = simulate(replace(rig, drive=drive), progress=progress, long=long or attempt > 0)
        seen = regime(run)
        last = drive.pieces[-1]
        if seen.kind != "undecided" or last.start != last.end or attempt == _EXTENSIONS:
            break
        drive = drive.then(constant(last.end, drive.duration))
    return run, seen


def _linear(setting: Rig) -> tuple[int | None, complex | None, str]:
    """Growing modes, the fastest of them, and a note where the theory has nothing to say."""
    interface = setting.interface
    if interface.ageing is None and interface.delay.moment(1) == 0:
        return 0, None, "contacts re-attach at once: nothing can grow, smooth sliding is neutrally stable at any speed"
    try:
        modes = stability.count_unstable(setting)
    except (InputError, UndecidedError) as reason:
        return None, None, str(reason)
    try:
        return modes, stability.growth_rate(setting), ""
    except (
        UndecidedError
    ):  # stable, and no mode decays more slowly than the tail of the distribution: the count stands alone
        return modes, None, ""


def _margins(setting: Rig) -> Iterator[Margin]:
    """Look up and down from where each parameter stands for the nearest boundary of linear stability."""
    for parameter in stability.PARAMETERS:
        try:
            value = parameter.get(setting)
        except InputError:  # the rig has no such parameter
            continue
        if value <= 0:
            continue
        widest = _RANGE if setting.interface.ageing is None else _AGED_RANGE
        searched = (value / widest, value * widest)
        if parameter.name == "std":  # wider than that is no longer a distribution of thresholds about its mean
            searched = (value / 3.0, max(0.5, 1.5 * value))
        elif parameter.name == "delay":  # longer delays never help, and have many modes
            searched = (value / _RANGE, value * 3.0)
        try:
            found = stability.critical(setting, parameter, between=searched)
        except (InputError, UndecidedError):
            continue
        below = [edge.value for edge in found.edges if edge.value < value]
        above = [edge.value for edge in found.edges if edge.value > value]
        yield Margin(
            parameter=parameter.name,
            value=value,
            lower=max(below, default=None),
            upper=min(above, default=None),
            searched=searched,
        )


def _mitigations(setting: Rig, margins: tuple[Margin, ...], unstable: bool, report: Progress) -> tuple[Mitigation, ...]:
    """For each parameter, the nearest value past the linear boundary, and the nearest from which stick-slip decays."""
    found = []
    for i, margin in enumerate(margins):
        report(i / len(margins))
        parameter = parameter_named(margin.parameter)
        sides = [side for side in (-1, 1) if _leads_out(margin, side, unstable)]
        for side in sides:
            edge = margin.lower if side < 0 else margin.upper
            keeps = edge * (1 + _CLEARANCE) ** side if unstable and edge else None
            where = _where_it_dies if setting.interface.ageing is None else _where_it_dies_aged
            stops, seen = where(setting, parameter, margin, keeps or margin.value, side) or (None, None)
            if keeps is not None or stops is not None:
                found.append(
                    Mitigation(parameter=parameter.name, value=margin.value, keeps=keeps, stops=stops, seen=seen)
                )
    return tuple(sorted(found, key=lambda mitigation: (mitigation.stops is None, mitigation.size)))


def _leads_out(margin: Margin, side: int, unstable: bool) -> bool:
    """Whether turning a parameter this way leads into, or deeper into, stability."""
    edge = margin.lower if side < 0 else margin.upper
    if unstable:
        return edge is not None
    # Stable, but stick-slip persists: go away from the boundary on the other side, if there is none on this one.
    other = margin.upper if side < 0 else margin.lower
    return edge is None and other is not None


def _where_it_dies(
    setting: Rig, parameter: Parameter, margin: Margin, begin: float, side: int
) -> tuple[float, Regime] | None:
    """Turn the parameter on until stick-slip decays from rest, and then until a run with many contacts slides smoothly.

    The first search is that of `lasts`, without noise. Near the boundary the noise of the contacts keeps a mode that
    hardly decays alive for good; the second goes past that, and one step further.
    """
    low, high = margin.searched
    ill = margin.value
    for growth in _STEPS:
        value = begin * growth**side
        if not low <= value <= high:
            return None
        if value == margin.value:  # known to be ill
            continue
        if _dies(parameter, setting, value):
            break
        ill = value
    else:
        return None
    for _ in range(_HALVINGS):
        middle = math.sqrt(value * ill)
        if _dies(parameter, setting, middle):
            value = middle
        else:
            ill = middle
    calm = 0
    for _ in range(_TRIES):
        value *= (1.0 + _CLEARANCE) ** side
        seen = _run_from(FromRest(), parameter.set(setting, value), _JUDGE, extensions=0)
        calm = calm + 1 if seen.kind == "smooth sliding" else 0
        if calm == 2:
            return value, seen
        value *= (1.0 + _CLEARANCE) ** side
    return None


def _where_it_dies_aged(
    setting: Rig, parameter: Parameter, margin: Margin, begin: float, side: int
) -> tuple[float, Regime] | None:
    """Return the same for thresholds that age: vary the parameter on until a run of contacts from rest slides smoothly."""
    for growth in _AGED_STEPS:
        value = begin * growth**side
        if value == margin.value or not margin.searched[0] <= value <= margin.searched[1]:
            continue
        seen = _run_from(FromRest(), parameter.set(setting, value), _AGED_JUDGE, extensions=0)
        if seen.kind == "smooth sliding":
            return value, seen
    return None


def _dies(parameter: Parameter, setting: Rig, value: float) -> bool:
    """Whether stick-slip is known to die from a start at rest."""
    turned = parameter.set(setting, value)
    assert isinstance(turned.slider, Slider)
    return is_sustained(turned).lasts is False


def _run_from(start: Start, setting: Rig, method: Method, extensions: int = _EXTENSIONS) -> Regime:
    """The regime that a start leads to, from a run long enough for a soft spring's long cycles."""
    slider = setting.slider
    assert isinstance(slider, Slider)
    distance = max(_SHORTEST, _CYCLES / slider.stiffness)
    for _ in range(extensions + 1):
        drive = constant(setting.velocity, distance / setting.velocity)
        seen = regime(simulate(replace(setting, drive=drive), method=method, start=start))
        if seen.kind != "undecided":
            break
        distance *= 2.0
    return seen


def _verified(rig: Rig, mitigation: Mitigation) -> Mitigation:
    """Simulate both changes with the rig's own method."""
    parameter = parameter_named(mitigation.parameter)
    setting = rig.natural
    targets = [
        (value, start) for value, start in ((mitigation.keeps, FromSliding()), (mitigation.stops, FromRest())) if value
    ]
    return replace(
        mitigation,
        checked=tuple(_run_from(start, parameter.set(setting, value), rig.method) for value, start in targets),
    )


def amount(rig: Rig, parameter: str, value: float) -> str:
    """Return a parameter's value in words, in the rig's units; a standard deviation as a fraction of the mean threshold."""
    return f"{value:.3g}" if parameter == "std" else rig.in_units(value, quantity(parameter_named(parameter).unit))


def chart(
    rig: Rig,
    over: tuple[str, str],
    around: float,
    points: int,
    progress: Progress | None = None,
    *,
    bistable: bool = False,
) -> xr.Dataset:
    """Map the linear stability of smooth sliding over two parameters around a rig's own point, in the rig's units.

    Parameters
    ----------
    rig : Rig
    over : (str, str)
        Names of two parameters: the first along the horizontal axis.
    around : float
        Factor on either side of the rig's own values.
    points : int
        Twice the points of the shading along each parameter.
    bistable : bool
        Whether to follow stick-slip from the boundary to where it decays, along the second parameter, at some values of
        the first; takes seconds for each.

    Returns
    -------
    xarray.Dataset
        ``growth_rate`` over the two parameters; along ``point`` the boundary with ``curve`` and ``frequency``; scalars
        ``here_<parameter>``; with `bistable`, along ``band`` both ends of the bistable band; the attribute ``summary``
        in words.
    """
    around = number("map: around", around, above=1.0, at_most=1e4)
    points = whole("map: points", points, at_least=4, at_most=2_000)
    report = progress or (lambda _share: None)
    setting = rig.natural
    parameters = [parameter_named(name) for name in over]
    here = [parameter.get(setting) for parameter in parameters]
    for parameter, value in zip(parameters, here, strict=True):
        number(f"map: {parameter.name} of the rig", value, above=0)
    window = tuple(
        (value / around, min(value * around, _widest(parameter)))
        for parameter, value in zip(parameters, here, strict=True)
    )
    grids = tuple(np.geomspace(low, high, max(points // 2, 4)) for low, high in window)
    names = (parameters[0].name, parameters[1].name)
    found = stability.stability_map(rig.natural, over=names, values=(grids[0], grids[1]), growth=True)
    report(0.7)
    edge = stability.boundary(rig.natural, over=names, between=(window[0], window[1])).rename(
        {name: f"edge_{name}" for name in (*names, "frequency")}
    )
    found = found.merge(edge, combine_attrs="override")
    if bistable:
        bands = bistable_region(
            rig.natural,
            over=names,
            edge=edge.rename({f"edge_{name}": name for name in names}),
            between=window[1],
            progress=lambda share: report(0.7 + 0.3 * share),
        )
        found = found.merge(bands, combine_attrs="override")
    report(1.0)
    modes = stability.count_unstable(rig.natural)
    for name, value in zip(names, here, strict=True):
        found[f"here_{name}"] = ((), value, dict(found[name].attrs))
    curves = len(set(edge["curve"].to_numpy().tolist()))
    state = f"unstable ({modes} growing modes)" if modes else "stable"
    found.attrs["summary"] = (
        f"{rig.name}: smooth sliding is {state} at the rig's own point; "
        + (f"{curves} neutral curves" if curves else "no boundary")
        + f" within a factor {around:g} of it in {names[0]} and {names[1]}"
    )
    return rig.in_its_units(found)


def _widest(parameter: Parameter) -> float:
    """Largest value that makes sense: a distribution of thresholds wider than half its mean is another distribution."""
    return 0.5 if parameter.name == "std" else math.inf

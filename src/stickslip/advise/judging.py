"""Runs that judge a rig: how long they last, with which contacts, and what they may cost."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from stickslip.errors import InputError, UndecidedError
from stickslip.measure import Regime, regime
from stickslip.model import Contacts, FromRest, Method, Start
from stickslip.model.drive import constant
from stickslip.model.rig import Rig
from stickslip.simulation import simulate
from stickslip.stability import growth_rate

CYCLES = 12.0
"""A run lasts a dozen cycles of the slowest oscillation that the rig can have ..."""
_SHORTEST = 60.0
_RINGING = 10.0
"""... at least this far, in ``x_s``, and until the free slider has rung out, in units of ``1/eta``."""
_FALLS, _LONGEST = 6.0, 4.0
"""The last test of a change lasts for so many times 1/decay rate, but not for more than so many runs."""
_LONGER = 2
"""How often a run that cannot be judged is made again, twice as long."""
_PER_RADIAN, _PER_BREAK, _PER_RUN = 5.5e-6, 2.5e-7, 0.02
"""Seconds that a run takes: per radian of the slider on its spring, per contact that breaks, and at least."""
_PER_AGED_BREAK = 4e-6
PRECISION = 0.05
"""Where motion changes is found to this part of the value."""
_USUAL, _MOST_AGED = Contacts(10_000, seed=1), 2_000


class Spent(Exception):  # noqa: N818 - not an error: it ends a search
    """The work that was allowed is done."""


class Budget:
    """What runs may cost, in seconds by estimate and not by the clock, so that the same rig gets the same answer."""

    def __init__(self, seconds: float) -> None:
        self.left = seconds

    def pay(self, seconds: float) -> None:
        """Take the cost of a run, or raise `Spent` if there is not as much left."""
        if seconds > self.left:
            raise Spent
        self.left -= seconds


def contacts_of(rig: Rig) -> Contacts:
    """The contacts that judge a rig: its own, as their noise is its own; for a rig without a number of them, many."""
    own = rig.method if isinstance(rig.method, Contacts) else _USUAL
    return own if rig.interface.ageing is None else replace(own, count=min(own.count, _MOST_AGED))


def cycle_of(setting: Rig) -> float:
    """Travel of the drive in the slowest cycle of a rig: loading to the thresholds, or a free oscillation."""
    slider = setting.slider
    stretch = setting.interface.threshold_distribution.moment(1)
    period = 2.0 * math.pi / slider.frequency if slider.mass > 0 else 0.0
    return float(max(stretch * (1.0 + 1.0 / slider.stiffness), setting.velocity * period))


def length_of(setting: Rig) -> float:
    """Travel of the drive, in ``x_s``, after which a run can be judged."""
    damping = setting.slider.damping
    ringing = setting.velocity * _RINGING / damping if damping > 0 else 0.0
    return max(_SHORTEST, CYCLES * cycle_of(setting), min(ringing, 5.0 * CYCLES * cycle_of(setting)))


def cost_of(setting: Rig, distance: float, method: Method) -> float:
    """Seconds that a run will take, roughly."""
    slider, time = setting.slider, distance / setting.velocity
    count = method.count if isinstance(method, Contacts) else 20_000
    delay = setting.interface.delay.moment(1)
    breaks = count * time / (1.0 / setting.velocity + (delay if math.isfinite(delay) else time))
    each = _PER_BREAK if setting.interface.ageing is None else _PER_AGED_BREAK
    return float(_PER_RUN + _PER_RADIAN * time * (slider.frequency if slider.mass > 0 else 1.0) + each * breaks)


def judge(
    setting: Rig, method: Method, budget: Budget, *, start: Start = FromRest(), distance: float | None = None
) -> Regime:
    """The regime that a start leads to at the constant speed of a rig, in natural units; runs on until it can be told.

    Raises
    ------
    Spent
        If the budget does not allow for a first run. What cannot be told with what is left is undecided.
    """
    distance = length_of(setting) if distance is None else distance
    seen: Regime | None = None
    for _ in range(_LONGER + 1):
        try:
            budget.pay(cost_of(setting, distance, method))
        except Spent:
            if seen is None:
                raise
            break
        drive = constant(setting.velocity, distance / setting.velocity)
        seen = regime(simulate(replace(setting, drive=drive), method=method, start=start, long=True))
        if seen.kind != "undecided":
            break
        distance *= 2.0
    assert seen is not None
    return seen


def slides_smoothly(setting: Rig, method: Contacts, budget: Budget, start: Start, other: int) -> bool:
    """Whether a run slides smoothly; with `other` contacts, one that lasts until the slowest mode has decayed."""
    contacts = replace(method, seed=method.seed + other)
    distance = length_of(setting)
    if other:
        distance = min(max(2.0 * distance, setting.velocity * _decay_time(setting)), _LONGEST * distance)
    try:
        seen = judge(setting, contacts, budget, start=start, distance=distance)
    except InputError:  # such a rig cannot be simulated
        return False
    return seen.kind == "smooth sliding"


def _decay_time(setting: Rig) -> float:
    """Time in which an oscillation of the slowest mode falls to nothing; 0 where there is none that is slow."""
    try:
        rate = growth_rate(setting).real
    except (InputError, UndecidedError):
        return 0.0
    return _FALLS / -rate if rate < 0 else 0.0


def first_smooth(
    smooth: Callable[[float], bool], surely: Callable[[float], bool], begin: float, end: float, ill: float
) -> float | None:
    """The nearest value between two ends that slides smoothly, on from where it does not, to `PRECISION`.

    Steps double from the beginning on; the end itself is the last that is tried. What is found must pass a second test,
    and is moved on in steps of `PRECISION` until it does.

    Parameters
    ----------
    smooth, surely : callable
        Both tests.
    begin, end : float
        Where to look, and until where.
    ill : float
        A value before `begin` that does not slide smoothly.
    """
    step, value = 1.0 + PRECISION, begin
    while not smooth(value):
        ill = value
        if value == end:
            return None
        value = min(value * step, end)
        step *= step
    while value / ill > 1.0 + PRECISION:
        middle = math.sqrt(value * ill)
        if smooth(middle):
            value = middle
        else:
            ill = middle
    while not surely(value):
        value *= 1.0 + PRECISION
        if value > end or not smooth(value):
            return None
    return value


def at_speed(setting: Rig, speed: float) -> Rig:
    """The rig at another constant speed."""
    return replace(setting, drive=constant(speed, length_of(setting) / speed))

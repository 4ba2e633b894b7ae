"""A rig from a few readings, by closed forms: no simulation, and no error bars."""

from __future__ import annotations

from dataclasses import replace

from stickslip.errors import InputError, number
from stickslip.io.friction import thresholds_of
from stickslip.model.delays import Delay
from stickslip.model.distributions import Gaussian
from stickslip.model.drive import USUAL_DISTANCE, constant
from stickslip.model.interface import Interface
from stickslip.model.quantities import read_value
from stickslip.model.rig import Assumption, Rig
from stickslip.model.slider import Slider
from stickslip.model.units import Scales
from stickslip.words import engineering

_INITIAL = Gaussian(mean=0.0, std=0.01)
_LEAST_RATIO = 0.01
"""How much faster the spring is wound up than the force rises, at least, for the difference to say anything."""


def quick_fit(
    *,
    static_friction: object,
    kinetic_friction: object,
    stiffness: object,
    speed: object,
    mass: object,
    loading_rate: object | None = None,
    breaking_displacement: object | None = None,
    half_speed: object | None = None,
    damping_ratio: float = 0.15,
    name: str = "quick fit",
) -> Rig:
    """Make a rig of readings of a bench, by closed forms.

    Static over kinetic friction gives the standard deviation of the thresholds, and their size the total contact
    strength (slow rigid motion, Eqs. (1)-(4)). The loading rate ``R`` between slips gives the stiffness of the
    interface, ``K v = R (1 + K/(N k))``, and so the breaking displacement; it is useful only where the driving spring
    is stiff, else give the breaking displacement itself. The speed at which kinetic friction has halved gives the
    delay. Sliding contacts are taken to carry no force: where slips are smaller than those of the rig, they do, and it
    does not fit the bench; `fit` tells that force.

    Parameters
    ----------
    static_friction, kinetic_friction : float or str
        Largest force of a slow pull, and mean force of slow sliding: in N, or texts with a unit, as all that follow.
    stiffness, speed, mass : float or str
        Of the driving spring, of the drive, and of the slider.
    loading_rate : float or str, optional
        Rise of the force per time while the slider sticks, at this speed, in N/s.
    breaking_displacement : float or str, optional
        In place of the loading rate.
    half_speed : float or str, optional
        Speed at which kinetic friction has fallen to half; without it there is no delay, and the rig says so.
    damping_ratio : float
    name : str

    Returns
    -------
    Rig
        In SI units.

    Raises
    ------
    InputError
        If the readings contradict one another.

    Examples
    --------
    >>> import stickslip as ss
    >>> rig = ss.quick_fit(static_friction="14 N", kinetic_friction="9 N", stiffness="8 kN/m", speed="1 mm/s",
    ...                    mass="0.4 kg", loading_rate="7 N/s", half_speed="20 mm/s")
    >>> rig.in_units(1.0, "force"), rig.in_units(1.0, "length"), round(rig.interface.thresholds.std, 2)
    ('17.8 N', '317.8 um', 0.11)
    """
    static = read_value("static_friction", static_friction, "N", "14 N")
    kinetic = read_value("kinetic_friction", kinetic_friction, "N", "9 N")
    K = read_value("stiffness", stiffness, "N/m", "8 kN/m")
    v = read_value("speed", speed, "m/s", "1 mm/s")
    m = read_value("mass", mass, "kg", "0.4 kg")
    try:
        thresholds, strength = thresholds_of(static, kinetic, _INITIAL)
    except InputError as error:
        raise InputError(
            str(error).replace("mu_s/mu_k", "static_friction/kinetic_friction"), "static_friction"
        ) from None
    if (loading_rate is None) == (breaking_displacement is None):
        raise InputError("quick_fit: give either loading_rate or breaking_displacement", "loading_rate")
    if breaking_displacement is not None:
        x_s = read_value("breaking_displacement", breaking_displacement, "m", "0.2 mm")
    else:
        rate = read_value("loading_rate", loading_rate, "N/s", "7 N/s")
        ratio = K * v / rate - 1.0
        if ratio < _LEAST_RATIO:
            raise InputError(
                f"loading_rate = {rate:.4g} N/s: stiffness times speed is {K * v:.4g} N/s, {100 * ratio:.2g} % more: "
                f"must be at least {100 * _LEAST_RATIO:g} % more to tell how stiff the interface is; give "
                "breaking_displacement",
                "loading_rate",
            )
        x_s = strength * ratio / K
    scales = Scales(force=strength, stretching=x_s, time=x_s / v)
    assumed = {"slider.damping_ratio": Assumption(f"{damping_ratio:g}", "let the slider ring on its spring")}
    delay = Delay(0.0)
    if half_speed is None:
        assumed["interface.delay"] = Assumption(
            "0 s", "slide it at several speeds: the speed at which kinetic friction has halved tells the delay"
        )
    else:
        half = scales.natural(read_value("half_speed", half_speed, "m/s", "20 mm/s"), "velocity")
        delay = Delay(thresholds.positive().moment(1) / half)
    free = Slider(stiffness=scales.natural(K, "stiffness"), mass=scales.natural(m, "mass"), damping=0.0)
    ratio = number("damping_ratio", damping_ratio, at_least=0, hint="of the slider on the driving spring")
    return Rig(
        Interface(thresholds=thresholds, initial=_INITIAL, delay=delay),
        replace(free, damping=2.0 * ratio * free.frequency),
        constant(1.0, USUAL_DISTANCE),
        scales=scales,
        name=name,
        assumed=assumed,
        source=f"readings: static friction {engineering(static, 'N')}, kinetic friction {engineering(kinetic, 'N')}",
    )

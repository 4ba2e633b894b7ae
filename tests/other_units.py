"""Rigs in other units: all lengths times one factor, all times times another.

Forces are in the unit of length, as the stiffness of a contact stays 1.
"""

import math
from dataclasses import replace

import stickslip as ss


def rescaled(interface, length, time=1.0):
    """The same interface."""
    thresholds, initial, bell = interface.thresholds, interface.initial, interface.temperature
    return replace(
        interface,
        thresholds=replace(thresholds, mean=length * thresholds.mean, std=length * thresholds.std),
        initial=replace(initial, mean=length * initial.mean, std=length * initial.std),
        delay=ss.Delay(time * interface.delay.moment(1)),
        sliding_force=length * interface.sliding_force,
        ageing=_aged(interface.ageing, length, time),
        temperature=bell and ss.Bell(width=length * bell.width, attempts=bell.attempts / time),
    )


def _aged(ageing, length, time):
    if isinstance(ageing, ss.Langevin):
        return ss.Langevin(rate=ageing.rate / math.sqrt(time))
    return ageing and ss.LogarithmicGrowth(slope=length * ageing.slope, time=time * ageing.time)


def rescaled_rig(rig, length, time):
    """The same rig."""
    slider = rig.slider
    return replace(
        rig,
        interface=rescaled(rig.interface, length, time),
        slider=replace(slider, mass=time**2 * slider.mass, damping=slider.damping / time),
        drive=ss.constant(rig.velocity * length / time, time * rig.drive.duration),
    )

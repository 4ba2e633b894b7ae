"""Rigs in other units: all lengths times one factor, all times times another.

Forces are in the unit of length, as the stiffness of a contact stays 1. Fields without
a unit are relative to the thresholds, which are lengths here.
"""

from dataclasses import replace

import stickslip as ss
from stickslip.model.records import converted


def rescaled(interface, length, time=1.0):
    """Return the same interface in the other units."""
    made = converted(
        interface, ss.model.Scales(force=length, stretching=length, time=time).si
    )
    longer = {
        name: replace(known, mean=length * known.mean, std=length * known.std)
        for name, known in {
            "thresholds": interface.thresholds,
            "initial": interface.initial,
        }.items()
    }
    if isinstance(made.ageing, ss.LogarithmicGrowth):
        longer["ageing"] = replace(made.ageing, slope=length * made.ageing.slope)
    return replace(made, **longer)


def rescaled_rig(rig, length, time):
    """Return the same rig in the other units."""
    made = converted(
        rig, ss.model.Scales(force=length, stretching=length, time=time).si
    )
    return replace(made, interface=rescaled(rig.interface, length, time))

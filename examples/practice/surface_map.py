"""
The interface behind a surface
==============================

A map of heights is a prior for the interface of a rig, not a prediction. Pressed on a
flat surface, it gives the standard deviation of the thresholds, a few times what rigs
usually assume, and two lengths: contacts that slip when friction no longer holds them
break after some 0.1 µm, contacts that hold while they overlap break after some 10 µm.
The map does not decide between the two lengths, and the verdict depends on them. One
slow pull with a velocity step decides.

The stage of *Predict a rig and choose a mitigation* stick-slips with the values assumed
there. On the interface of this map it slides smoothly with one length, and oscillates
with the other.

Run it with ``python examples/practice/surface_map.py surface.png``.
"""

import sys

from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot

STAGE = {
    "name": "light stage",
    "slider": {"mass": "100 g", "stiffness": "20 MN/m", "damping_ratio": 0.15},
    "interface": {
        "contact_strength": "100 N",
        "breaking_displacement": "10 um",
        "thresholds": {"distribution": "gaussian", "std": 0.1},
        "delay": "1 ms",
    },
    "drive": {"velocity": "1 mm/s"},
    "simulation": {"contacts": 1000},
}


def draw() -> Figure:
    """Draw the map with its contacts, the values it gives, and how many rigs within
    their ranges oscillate.
    """
    rough = ss.surface.self_affine(
        rq="1 um", hurst=0.8, roll_off="60 um", cut_off="5 um", nodes=512
    )
    found = ss.surface.contacts(rough, pressure="2 MPa", material="pmma")
    estimate = ss.surface.estimate(found)
    rig = ss.surface.rig(estimate, ss.read_rig(STAGE), name="lapped PMMA")
    return plot.surface(found, estimate, ss.predict(rig))


if __name__ == "__main__":
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])

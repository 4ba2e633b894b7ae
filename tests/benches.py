"""Rig files, and readings of runs, that more than one room is tested with."""

import numpy as np

WARM = """
name = "Warm bench"
[slider]
mass = "1 kg"
stiffness = "4 MN/m"
damping_ratio = 0.1
[interface]
contact_strength = "768 N"
breaking_displacement = "2 um"
thresholds = { distribution = "gaussian", std = 0.3 }
ageing = { model = "logarithmic", slope = 0.02, time = "1 ms" }
[interface.temperature]
kind = "bell"
temperature = "293 K"
activation_volume = "0.4 nm^3"
shear_strength = "1 GPa"
attempts = "1e6 1/s"
[drive]
velocity = "2 um/s"
"""


def imbalance(run):
    """Largest gap between the work of the drive and what became of it, as a fraction of all energy turned over."""
    parts = ("kinetic_energy", "spring_energy", "contact_energy", "damped_energy", "broken_energy")
    found = sum(run[name] for name in parts)
    gap = run["work"] - found
    return float(np.abs(gap - gap[0]).max()) / max(float(found.max()), 1e-6)

"""Rig files that more than one room is tested with."""

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

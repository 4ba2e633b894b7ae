"""
The lightest bow that makes a string sing
=========================================

The slider need not hang on a spring: here the bow rubs on a string, whose modes enter
through their impedance at the bow. Below a smallest friction force the losses of the
string prevail, and only noise is heard. That force rises with the speed of the bow, as
players know; linear stability theory gives it, and the harmonic that starts first. What
the string does once it sings (Helmholtz's motion) is beyond linear theory.

Run it with ``python examples/practice/bowed_string.py string.png``.
"""

import sys
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot
from stickslip.model.parameters import Parameter
from stickslip.model.units import Scales
from stickslip.stability import Modes

LENGTH, PITCH, DENSITY, QUALITY = 0.33, 440.0, 6e-4, 100.0
"""Length, frequency and mass per length of an A string (m, Hz, kg/m), and the quality
factor of its modes with a finger and a bow on it (assumed).
"""
BOW = 0.11
"""Position of the bow, as a fraction of the length."""
MODES = np.arange(1, 13)
ROSIN = ss.Interface(
    thresholds=ss.Gaussian(mean=1.0, std=0.2), delay=ss.RandomDelay(mean=0.1, std=0.03)
)
"""Contacts of rosin stretch by 10 µm and re-attach after a tenth of a millisecond
(assumed).
"""
SPEEDS = np.geomspace(0.02, 1.0, 12)
"""Speeds of the bow, in m/s."""


def string(friction: float) -> Modes:
    """Return the string's modes at the bow, per contact, if all contacts together carry
    `friction` (N).
    """
    scales = Scales(force=friction, stretching=10e-6, time=1e-3)
    omega = 2 * np.pi * PITCH * MODES
    mass = 0.5 * DENSITY * LENGTH / np.sin(np.pi * BOW * MODES) ** 2
    return Modes(
        stiffness=0.0,
        masses=tuple(scales.natural(mass, "mass")),
        stiffnesses=tuple(scales.natural(mass * omega**2, "stiffness")),
        dampings=tuple(scales.natural(omega / QUALITY, "rate")),
    )


FRICTION = Parameter(
    name="friction",
    unit="1",  # N: the rig is in natural units
    get=lambda setting: string(1.0).masses[0] / setting.slider.masses[0],
    set=lambda setting, value: replace(setting, slider=string(value)),
)
"""The friction force as a parameter of our own, for `stickslip.critical`."""


def lightest(speed: float) -> tuple[float, float]:
    """Return the smallest friction force (N) at which the string sings, and the
    frequency (Hz) that starts first.
    """
    velocity = Scales(force=1.0, stretching=10e-6, time=1e-3).natural(speed, "velocity")
    edge = ss.critical(
        ss.Rig(ROSIN, string(0.1), ss.constant(velocity)), FRICTION, between=(1e-3, 2.0)
    ).edges[0]
    return edge.value, edge.frequency / (2 * np.pi * 1e-3)


def draw() -> Figure:
    """Draw the smallest friction against the speed of the bow, with the harmonic that
    starts first.
    """
    force, frequency = np.array([lightest(speed) for speed in SPEEDS]).T
    with plot.house_style():
        figure = plot.new_figure(plot.PAGE, 3.0)
        ax = figure.subplots()
        ax.loglog(SPEEDS, force, "o-", color=plot.BLUE)
        ax.fill_between(SPEEDS, force, 2.0, color=plot.ORANGE, alpha=0.2, linewidth=0)
        for speed, value, harmonic in zip(
            SPEEDS, force, np.round(frequency / PITCH), strict=True
        ):
            ax.annotate(
                f"{harmonic:.0f}",
                (speed, value),
                (0, -12),
                textcoords="offset points",
                ha="center",
                fontsize=8,
            )
        ax.text(0.03, 0.5, "the string sings", fontsize=9)
        ax.text(0.35, 0.003, "it stays silent", fontsize=9)
        ax.set(
            xlabel="speed of the bow (m/s)",
            ylabel="force of friction (N)",
            ylim=(1e-3, 2.0),
        )
        ax.set_title("number at a point: the harmonic that starts first")
    return figure


if __name__ == "__main__":
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])

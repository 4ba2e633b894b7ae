"""
How long a slider must be to be unstable
========================================

On a long slider smooth sliding is unstable to long waves first. A bar that is pulled at
one end is stable while it is short, and unstable from some number of blocks on: the
nucleation length. The same theory applies to any body with an impedance for each wave:
a half-space, or a layer that is held at its top. There the scale is the shear modulus
times the area of a contact, over the critical stiffness of the contacts.

Run it with ``python examples/elastic/nucleation_length.py length.png``.
"""

import sys

import numpy as np
from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot

CONTACTS = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1))
DRIVE = ss.constant(velocity=1.5)
SHEAR, SOUND, LOSSES = 10.0, 500.0, 2.0
"""Shear modulus times the area of a contact (``k`` times the unit of length), speed of
shear waves, and a damping of the bulk in 1/time, which keeps its resonances finite.
"""


def bar(blocks: int, coupling: float) -> ss.Rig:
    """Return a bar pulled at one end by a spring as stiff as one of its own."""
    body = ss.Chain(
        blocks=blocks, coupling=coupling, mass=1e-4, damping=42.426, side=coupling
    )
    return ss.Rig(CONTACTS, body, DRIVE)


def root(q, s):
    """Return the decay rate of a wave into the bulk, ``sqrt(q^2 + s^2/c^2)``, on the
    branch that carries energy away.
    """
    turn = 1j * np.sqrt(s * (s + LOSSES) / SOUND**2 + 0j)
    return np.sqrt(q + turn) * np.sqrt(q - turn)


def half_space(q: float) -> ss.Rig:
    """Return the impedance of a half-space for waves of wavenumber `q`."""
    return ss.Rig(CONTACTS, lambda s: SHEAR * root(q, s), DRIVE)


def layer(q: float, thickness: float = 6.0) -> ss.Rig:
    """Return the same for a layer whose top moves with the drive."""
    return ss.Rig(
        CONTACTS, lambda s: SHEAR * root(q, s) / np.tanh(thickness * root(q, s)), DRIVE
    )


def draw() -> Figure:
    """Draw the growth of the softest mode against the length of the bar, and growth
    against wavelength on other bodies.
    """
    with plot.house_style():
        figure = plot.new_figure(plot.PAGE, 2.8)
        left, right = figure.subplots(1, 2)
        for coupling, colour in ((80.0, plot.BLUE), (400.0, plot.VERMILLION)):
            blocks = np.arange(4, 41)
            growth = [
                float(ss.elastic.modes(bar(int(n), coupling), count=1)["growth"][0])
                for n in blocks
            ]
            left.plot(
                blocks, growth, ".", color=colour, label=f"$k_b = {coupling:g}\\,k$"
            )
            left.axvline(
                ss.elastic.critical_length(bar(4, coupling)).blocks - 0.5,
                color=colour,
                linewidth=0.9,
            )
        left.axhline(0.0, color=plot.GREY, linewidth=0.9)
        left.set(
            xlabel="blocks", ylabel="growth rate (1 per time unit)", ylim=(-0.6, 0.6)
        )
        plot.legend_above(left)
        length = np.geomspace(8.0, 120.0, 30)
        for body, colour, name in (
            (half_space, plot.BLUE, "half-space"),
            (layer, plot.VERMILLION, "layer of thickness 6"),
        ):
            right.semilogx(
                length,
                [ss.growth_rate(body(2 * np.pi / x)).real for x in length],
                color=colour,
                label=name,
            )
        critical = ss.stability.critical_spring(
            bar(1, 1.0).replace(
                slider=ss.Slider(stiffness=1.0, mass=1e-4, damping=42.426)
            )
        )
        right.axvline(2 * np.pi * SHEAR / critical, color=plot.BLUE, linewidth=0.9)
        right.axhline(0.0, color=plot.GREY, linewidth=0.9)
        right.set(xlabel="wavelength", ylabel="growth rate (1 per time unit)")
        plot.legend_above(right)
    return figure


if __name__ == "__main__":
    figure = draw()
    if sys.argv[1:]:
        plot.save(figure, sys.argv[1])

"""Rigs, and evaluations of runs, that several test files use."""

import copy
import math
from dataclasses import replace

import numpy as np

import stickslip as ss
from stickslip.simulation.driver import follow
from stickslip.simulation.engines import Beginning, engine_of

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
[interface.activation]
kind = "bell"
temperature = "293 K"
activation_volume = "0.4 nm^3"
shear_strength = "1 GPa"
attempts = "1e6 1/s"
[drive]
velocity = "2 um/s"
"""


def with_value(document, path, value):
    """Return a copy of a document with a key set to a value, or removed if None."""
    changed = copy.deepcopy(document)
    *parents, last = path.split(".")
    node = changed
    for part in parents:
        node = node.setdefault(part, {})
    node[last] = value
    if value is None:
        del node[last]
    return changed


STILL = ss.constant(velocity=0.0, duration=1.0)


def bar(
    kappa,
    leaf=0.0,
    alpha=0.0,
    zeta=0.0,
    *,
    std=0.0,
    sliding=0.0,
    mean=1.0,
    delay=ss.Delay(math.inf),
    **more,
):
    """Make a rig from the groups that a front depends on: contacts, leaf springs,
    damping, and viscosity of the bulk.
    """
    coupling = 1.0 / kappa
    chain = {
        "blocks": 400,
        "coupling": coupling,
        "mass": coupling,
        "damping": alpha,
        "viscosity": zeta * coupling,
    }
    chain |= {"leaf": leaf * coupling} | more
    interface = ss.Interface(
        thresholds=ss.Gaussian(mean=mean, std=std), delay=delay, sliding_force=sliding
    )
    return ss.Rig(interface, ss.Chain(**chain), STILL)


def pushed(rig, profile, duration):
    """A bar at rest under a prestress that is pushed at one end."""
    start = ss.Prestressed(stretching=profile, push=3.0, pushed_blocks=3)
    drive = ss.constant(0.0, duration=duration)
    return replace(rig, drive=drive, method=ss.Contacts(20), start=start)


def springs_between(body):
    """Matrix of the springs that couple the blocks."""
    matrix = np.zeros((body.size, body.size))
    for (i, j), k in zip(*body.links, strict=True):
        matrix[[i, j], [i, j]] += k
        matrix[[i, j], [j, i]] -= k
    return matrix


def rigidly(interface, method, drive, times, start=ss.FromSliding()):
    """Move contacts with a rigid slider along a drive, from its first velocity on."""
    beginning = Beginning(interface, None, drive.pieces[0].start, start)
    return follow(
        engine_of(interface, method, None)(beginning, method), drive, 0.0, times
    )


def oscillations(signal, interval):
    """Return growth and frequency of a signal as complex rates, by matrix pencil."""
    rows = np.lib.stride_tricks.sliding_window_view(signal, signal.size // 3)
    basis = np.linalg.svd(rows, full_matrices=False)[2][:8].T
    return np.log(np.linalg.eigvals(np.linalg.pinv(basis[:-1]) @ basis[1:])) / interval


def imbalance(run):
    """Return the largest gap in the balance of energies, as a fraction of the largest
    sum of them.
    """
    found = sum(run[name] for name in run if name.endswith("_energy"))
    gap = run["work"] - found
    return float(np.abs(gap - gap[0]).max()) / max(float(found.max()), 1e-6)

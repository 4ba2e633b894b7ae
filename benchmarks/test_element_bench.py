"""A step of the interface as an element compared with one of LuGre's model in a plain
loop, and with a step of the event engine; runs of a structure compared with both.

A step of LuGre's model takes one exponential and one division, always. Of 1,000
contacts one or two break in a step of 1e-3, and as many re-attach: each costs a scan of
the 32 contacts of its block, and each step one of the 32 blocks.
"""

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip.kernels import element as kernel
from stickslip.kernels._jit import jit
from stickslip.model import Modes
from stickslip.simulation.driver import follow
from stickslip.simulation.engines.base import Beginning
from stickslip.simulation.engines.contacts import EventByEvent
from stickslip.structures.contacts import element_of
from stickslip.structures.engines import DrivenEngine
from stickslip.structures.runs import SteppedStructure, longest_step

INTERFACE = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.1))
METHOD = ss.Contacts(1000, seed=1)
STEPS = 20_000
WAYS = {"sliding": 1e-3, "sticking": 1e-9}


@jit
def element_steps(
    state: kernel.ElementState, count: int, dt: float, way: float
) -> float:
    """Return the sum of the impulses of steps of one length."""
    total = 0.0
    for _ in range(count):
        end = state.motion[0].position + way
        total += kernel.step(state, dt, math.nan, end)[1]
    return total


@jit
def lugre_steps(z: float, count: int, dt: float, way: float) -> float:
    """Return the same for LuGre's model, its bristle exact for a constant velocity."""
    total = 0.0
    for i in range(count):
        # the velocity changes: otherwise the compiler moves the exponential out of the
        # loop
        velocity = way / dt * (1.0 + 1e-12 * i)
        rest = 0.46 + 0.1 / (1.0 + velocity * velocity)
        left = math.exp(-velocity * dt / rest)
        slope = (rest - z) * (1.0 - left) * rest / max(velocity, 1e-30)
        total += rest * dt - slope
        z = rest + (z - rest) * left
    return total


def slid():
    """Return an element in smooth sliding, already compiled."""
    made = ss.Element(INTERFACE, METHOD)
    made.step(10.0, 10.0)
    element_steps(made._carrier.state, 1, 1e-3, 1e-9)
    return made


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_lugre(benchmark, way):
    lugre_steps(0.4, 1, 1e-3, way)
    benchmark.group = f"{STEPS:,} steps of {way:g} x_s, 1,000 contacts"
    benchmark.extra_info.update(role="plain")
    benchmark.pedantic(lugre_steps, (0.4, STEPS, 1e-3, way), rounds=10)


@pytest.mark.parametrize(("way", "promised"), [(1e-3, 150), (1e-9, 10)], ids=list(WAYS))
def test_element(benchmark, way, promised):
    state = slid()._carrier.state
    benchmark.group = f"{STEPS:,} steps of {way:g} x_s, 1,000 contacts"
    benchmark.extra_info.update(
        role="cost", promised=promised, what="element, beside LuGre"
    )
    before = float(state.motion[0].breaks)
    benchmark.pedantic(element_steps, (state, STEPS, 1e-3, way), rounds=5)
    if way == WAYS["sliding"]:
        assert state.motion[0].breaks > before + STEPS


def python_steps(carrier):
    """Take steps of an element's state from Python."""
    for _ in range(200):
        carrier.step(1e-3, math.nan, carrier.here[1] + 1e-3)


def test_event_engine(benchmark):
    beginning = Beginning(INTERFACE, None, 0.0)
    driven = DrivenEngine(beginning, METHOD, EventByEvent)
    driven.step(10.0, math.nan, 10.0)
    benchmark.group = "200 steps from Python, 1,000 contacts sliding"
    benchmark.extra_info.update(role="plain")
    benchmark.pedantic(python_steps, (driven,), rounds=10)
    assert np.isfinite(driven.force)


def test_element_from_python(benchmark):
    made = slid()
    benchmark.group = "200 steps from Python, 1,000 contacts sliding"
    benchmark.extra_info.update(
        role="fast", promised=5, what="element, beside the event engine"
    )
    benchmark.pedantic(python_steps, (made._carrier,), rounds=10)


SLIDER = ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4)
MODE = Modes(masses=(1e-4,), stiffnesses=(0.0,), dampings=(42.4,), stiffness=2.0)
PULL = ss.constant(1.0, 3.0)  # through two slips


@jit
def verlet_steps(
    state: kernel.ElementState,
    count: int,
    dt: float,
    slider: tuple[float, float, float],
) -> float:
    """The loop that a user would write: Verlet's method with the impulse, pulled at
    velocity 1.
    """
    K, M, eta = slider
    x = v = pulled = 0.0
    friction = kernel.force_of(state)
    for i in range(count):
        end = x + dt * v + 0.5 * dt * dt * ((pulled - friction) / M - eta * v)
        friction, impulse, _ = kernel.step(state, dt, v, end)
        before = pulled
        pulled = K * ((i + 1) * dt - end)
        v += (0.5 * dt * (before + pulled) - impulse) / M - eta * (end - x)
        x = end
    return x


def begun(body):
    """Return a run of a body before its first step."""
    kind = EventByEvent if body is SLIDER else SteppedStructure
    engine = kind(Beginning(INTERFACE, body, 1.0), METHOD)
    return (engine, PULL, 0.0, np.array([PULL.duration])), {}


def test_plain_loop(benchmark):
    h = longest_step(MODE)
    constants = (SLIDER.stiffness, SLIDER.mass, SLIDER.damping)

    def start():
        state = element_of(Beginning(INTERFACE, None, 0.0), METHOD)
        return (state, round(PULL.duration / h), h, constants), {}

    verlet_steps(*start()[0])
    benchmark.group = "steps of a mass on a spring, 1,000 contacts, two slips"
    benchmark.extra_info.update(role="plain")
    end = benchmark.pedantic(verlet_steps, setup=start, rounds=10)
    assert 0.0 < end < PULL.duration


def test_structure_beside_a_plain_loop(benchmark):
    follow(*begun(MODE)[0])
    benchmark.group = "steps of a mass on a spring, 1,000 contacts, two slips"
    benchmark.extra_info.update(
        role="cost", promised=8, what="run of a mode, beside a plain loop"
    )
    track = benchmark.pedantic(follow, setup=lambda: begun(MODE), rounds=10)
    assert np.isfinite(track.rows).all()


@pytest.mark.parametrize("body", [SLIDER, MODE], ids=["slider", "mode"])
def test_structure_beside_the_event_engine(benchmark, body):
    follow(*begun(body)[0])
    benchmark.group = "run of 1,000 contacts through two slips"
    benchmark.extra_info.update(
        {"role": "plain"}
        if body is SLIDER
        else {
            "role": "cost",
            "promised": 80,
            "what": "run of a mode, beside the event engine",
        }
    )
    benchmark.pedantic(follow, setup=lambda: begun(body), rounds=10)

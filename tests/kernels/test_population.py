"""Contacts counted by cohorts: means and fluctuations of independent contacts; none is
lost.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from benches import rigidly
from hypothesis import given, settings
from hypothesis import strategies as st

import stickslip as ss
from stickslip.kernels import panel_state as kernel
from stickslip.simulation.driver import follow
from stickslip.simulation.engines import Beginning, engine_of

TENTH = ss.Gaussian(mean=1.0, std=0.1)
RELAXED = ss.Gaussian(mean=0.0, std=0.01)
CYCLING = ss.Interface(thresholds=TENTH, initial=RELAXED, delay=ss.Delay(0.2))
SLIDER = ss.Slider(stiffness=2.0, mass=1e-4, damping=200.0)


class Several(ss.model.DelayModel):
    """No delay for half of the contacts, and a given one for the others."""

    def moment(self, order):
        return 1.0 if order == 0 else 0.5 * 0.1**order

    def laplace(self, s):
        return 0.5 + 0.5 * np.exp(-0.1 * np.asarray(s, complex))

    def sample(self, rng, size):
        return rng.choice([0.0, 0.1], size)

    def quadrature(self):
        return np.array([0.0, 0.1]), np.array([0.5, 0.5])

    def __repr__(self):
        return "Several()"


DELAYS = [ss.Delay(time) for time in (0.0, 0.2, math.inf)]
DELAYS += [ss.RandomDelay(mean=0.2, std=0.05), ss.RandomDelay(mean=0.1, std=0.1)]
DELAYS += [ss.OnArrest(), Several()]
DISTRIBUTIONS = [TENTH, ss.Uniform(low=0.5, high=1.5), ss.Exponential(mean=1.0)]

interfaces = st.builds(
    ss.Interface,
    thresholds=st.sampled_from(DISTRIBUTIONS),
    initial=st.just(RELAXED),
    delay=st.sampled_from(DELAYS),
    sliding_force=st.sampled_from([0.0, 0.3]),
    newborn=st.sampled_from([None, ss.Gaussian(mean=0.2, std=0.1)]),
)
TURNING = ss.ramp(2, -2, duration=2).then(ss.ramp(-2, 2, duration=2))


@settings(max_examples=60, deadline=None)
@given(
    interfaces,
    st.sampled_from([TURNING, ss.constant(-0.5, duration=4)]),
    st.sampled_from([0.3, 0.7, 1.0]),
    st.sampled_from([10, 1_000, 10**9]),
    st.sampled_from([20.0, 200.0]),
)
def test_every_contact_is_attached_or_waits(interface, drive, end, count, damping):
    method = ss.Population(count, seed=1, rtol=1e-3)
    slider = replace(SLIDER, damping=damping)
    beginning = Beginning(interface, slider, 1.0, ss.FromRest())
    engine = engine_of(interface, method, slider)(beginning, method)
    follow(engine, drive, 0.0, np.linspace(0, end, 5))
    state = engine.state
    attached = state.cohorts.count[: state.used.cohorts]
    waiting = state.panels[: state.used.panels, kernel.WAITING :]
    for some in (attached, waiting):
        assert np.array_equal(some, np.round(some))
        assert some.min(initial=0.0) >= 0.0
    if math.isfinite(interface.delay.moment(1)):
        assert attached.sum() + waiting.sum() == count
    assert attached.sum() == round(count * state.motion.mass_in)


def moments(interface):
    """Variances, times N, of friction force and attached fraction at velocity 1."""
    m1, m2, m3 = (interface.threshold_distribution.moment(order) for order in (1, 2, 3))
    cycle = m1 + interface.delay.moment(1)
    return m3 / (3 * cycle) - (m2 / (2 * cycle)) ** 2, m1 / cycle * (1 - m1 / cycle)


SOME = [ss.Delay(0.0), ss.Delay(0.2), ss.RandomDelay(mean=0.2, std=0.1), Several()]


@pytest.mark.slow
@pytest.mark.parametrize("delay", SOME, ids=str)
@pytest.mark.parametrize("count", [10, 1_000, 10**8])
def test_fluctuations_in_rigid_sliding(delay, count):
    interface = replace(CYCLING, delay=delay)
    lifetimes = 600.0
    force, attached = moments(interface)
    times = np.arange(0.0, lifetimes, 0.037)
    method = ss.Population(count, seed=1)
    track = rigidly(interface, method, ss.constant(1.0, times[-1]), times)
    F = track["friction_force"]
    A = track["attached"]
    # A contact's force is uncorrelated after a life: the number of independent values n
    # gives a relative error of sqrt(2/n).
    slack = 4 * math.sqrt(2 / lifetimes)
    assert F.var() * count == pytest.approx(force, rel=slack)
    error = 4 * math.sqrt(force / count / lifetimes) + 1e-5
    assert F.mean() == pytest.approx(ss.kinetic_friction(interface, 1.0), abs=error)
    assert A.var() * count == pytest.approx(attached, rel=slack, abs=1e-12)


@pytest.mark.slow
def test_the_spectrum_in_rigid_sliding_is_that_of_contacts():
    """In octaves up to the sampling frequency, with errors from the scatter of parts of
    the run.

    Fluctuations faster than steps are too weak: by 7 % in the last octave at the
    default tolerance.
    """
    parts = 16
    length = 2**13
    times = 0.037 * np.arange(parts * length)

    def octaves(method):
        track = rigidly(CYCLING, method, ss.constant(1.0, times[-1]), times)
        F = track["friction_force"].reshape(parts, length)
        power = np.abs(np.fft.rfft(F - F.mean(), axis=1)) ** 2 / length * method.count
        edges = (power.shape[1] * 0.5 ** np.arange(7)).astype(int)
        bands = [power[:, low:high].mean(axis=1) for high, low in pairwise(edges)]
        bands = np.stack(bands)
        return bands.mean(axis=1), bands.std(axis=1, ddof=1) / math.sqrt(parts)

    exact, noise = octaves(ss.Contacts(1_000, seed=1))
    for rtol, slack in ((1e-4, 0.09), (1e-5, 0.03)):
        found, more = octaves(ss.Population(1_000, seed=1, rtol=rtol))
        slack = 4 * np.hypot(noise, more) + slack * exact
        assert np.all(np.abs(found - exact) < slack), (rtol, found / exact - 1)


def cycles(method):
    """Mean and standard deviation of period and drop in one run of Fig. 4c."""
    rig = ss.Rig(CYCLING, SLIDER, ss.constant(1.0, duration=30.0))
    run = ss.simulate(rig, method=method)
    drops = ss.drops(run)
    period = np.diff(drops["start"].to_numpy())[2:]
    drop = drops["drop"].to_numpy()[2:]
    return period.mean(), period.std(ddof=1), drop.mean(), drop.std(ddof=1)


@pytest.mark.slow
@pytest.mark.parametrize("count", [100, 3_000])
def test_cycles_are_those_of_contacts(count):
    seeds = 12
    found = [
        np.array([cycles(method(count, seed=seed)) for seed in range(seeds)])
        for method in (ss.Contacts, ss.Population)
    ]
    means = [part.mean(axis=0) for part in found]
    errors = np.sqrt(sum(part.var(axis=0, ddof=1) / seeds for part in found))
    assert np.all(np.abs(means[1] - means[0]) < 4.5 * errors), (means, errors)


def test_newborns_are_stretched_along_the_motion_after_each_reversal_too():
    fields = {"delay": ss.Delay(0.35), "newborn": ss.Gaussian(mean=0.2, std=0.0)}
    interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.2), **fields)
    slider = ss.Slider(stiffness=0.7, mass=6e-4, damping=13.0)
    rig = ss.Rig(interface, slider, ss.constant(0.3, duration=7.5))

    def force(method):  # the slip at 6.1 ends in reversals while contacts attach
        run = ss.simulate(rig, method=method, output=ss.Output(interval=0.01))
        return run.spring_force.values[run.time.values > 6.6]

    exact = force(ss.MasterEquation(rtol=1e-8))

    def off(method):
        return float(np.sqrt(np.mean((force(method) - exact) ** 2)))

    for rtol in (1e-4, 1e-6):
        assert off(ss.MasterEquation(rtol=rtol)) < 10.0 * rtol
    methods = (ss.Population(100_000, seed=seed) for seed in range(8))
    few = math.sqrt(np.mean([off(method) ** 2 for method in methods]))
    assert off(ss.Contacts(10_000, seed=1)) < 4.0 * few * math.sqrt(10.0)


def test_newborns_of_a_slider_at_rest_do_not_push_it():
    """It oscillates ever faster, and the force stays: no direction persists."""
    delay = ss.RandomDelay(mean=0.5, std=0.15)
    fields = {"delay": delay, "newborn": ss.Gaussian(mean=0.3, std=0.0)}
    interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.2), **fields)
    drive = ss.constant(1.0, duration=3.0).then(ss.constant(0.0, duration=4.0))
    drive = drive.then(ss.constant(1.0, duration=1.0))
    rig = ss.Rig(interface, ss.Slider(stiffness=0.7, mass=6e-4, damping=137.0), drive)
    methods = (ss.MasterEquation(rtol=rtol) for rtol in (1e-7, 1e-4))
    exact, found = (ss.simulate(rig, method=each).spring_force for each in methods)
    assert float(np.sqrt(((found - exact) ** 2).mean())) < 10.0 * 1e-4

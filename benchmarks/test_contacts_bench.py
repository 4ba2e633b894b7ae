"""The contacts engine and the renewal convolution compared with the plain loop over
contacts, in the same run.

Counting gives for 1e4 contacts: ten time units are 1e9 contact steps of the plain loop
and 127,065 events (`count_events.py`), 7,870 contact steps per event. A contact step
waits for the addition before it, in the sum of the forces: 3 or 4 cycles of the
processors measured. There an event took the time of 125 to 155 contact steps, and the
engine 50 to 63 times less than the loop. An addition takes 2 cycles on the fastest
processors of today, while the chain of square roots, divisions and exponentials of an
event gains little there: at most 200 contact steps per event, 7,870/200 = 40.
"""

import numpy as np
import pytest
from plain import plain_contacts

import stickslip as ss
from stickslip.paper.cases import FIG4

DURATION = 10.0
WARM = 0.01


def plain(count, duration):
    rng = np.random.default_rng(1)
    slider = FIG4.slider
    stretching = rng.normal(0.0, 0.01, count)
    threshold = rng.normal(1.0, 0.1, count)
    delay = FIG4.interface.delay.time
    return plain_contacts(
        rng,
        stretching,
        threshold,
        slider.stiffness,
        slider.mass,
        slider.damping,
        delay,
        1.0,
        duration,
        1e-4,
    )


def engine(count, duration):
    return ss.simulate(
        ss.Rig(FIG4.interface, FIG4.slider, ss.constant(1.0, duration)),
        method=ss.Contacts(count, seed=1),
        output=ss.Output(interval=5e-3),
    )


@pytest.mark.parametrize(
    ("count", "fraction", "rounds"),
    [(10_000, 1.0, 5), (1_000_000, 0.05, 3)],
    ids=["1e4", "1e6"],
)
def test_plain_loop(benchmark, count, fraction, rounds):
    """The cost of the plain loop is proportional to time: for 1e6 contacts a twentieth
    of the run is timed.
    """
    plain(100, WARM)
    benchmark.group = f"Fig. 4c, N = {count:.0e}, ten time units"
    benchmark.extra_info.update(role="plain", scale=1.0 / fraction)
    benchmark.pedantic(plain, (count, fraction * DURATION), rounds=rounds)


@pytest.mark.parametrize(
    ("count", "promised", "rounds"),
    [(10_000, 40, 10), (1_000_000, 40, 3)],
    ids=["1e4", "1e6"],
)
def test_contacts_engine(benchmark, count, promised, rounds):
    """An event among 1e6 contacts takes little more than a memory read that no cache
    holds (`count_events.py`).
    """
    engine(100, WARM)
    benchmark.group = f"Fig. 4c, N = {count:.0e}, ten time units"
    benchmark.extra_info.update(role="fast", promised=promised, what="contacts engine")
    run = benchmark.pedantic(engine, (count, DURATION), rounds=rounds)
    # check that it sticks and slips
    assert float(run["spring_force"].max() - run["spring_force"].min()) > 0.5


def test_plain_loop_for_one_per_cent_of_a_run(benchmark):
    plain(100, WARM)
    benchmark.group = "F(X) over 0..20 x_s to 1e-8"
    benchmark.extra_info.update(role="plain")
    benchmark.pedantic(plain, (10_000, 0.01 * DURATION), rounds=10)


def test_renewal_convolution(benchmark):
    interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1))
    exact = ss.rigid_slide(interface, 20.0, method=ss.model.Renewal(4000))[
        "friction_force"
    ].to_numpy()[::4]
    benchmark.group = "F(X) over 0..20 x_s to 1e-8"
    benchmark.extra_info.update(
        role="fast", promised=1, what="renewal convolution, beside 1 % of a plain run"
    )
    curve = benchmark.pedantic(
        ss.rigid_slide, (interface, 20.0), {"method": ss.model.Renewal(1000)}, rounds=20
    )
    assert np.abs(curve["friction_force"].to_numpy() - exact).max() < 1e-8

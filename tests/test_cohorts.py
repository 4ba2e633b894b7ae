"""The master equation on cohorts: exact where nothing breaks, conserving always, second order elsewhere."""

import math
from functools import cache, partial

import numpy as np
import pytest
import reference
from scipy.linalg import expm

from stickslip.kernels import cohorts, renewal
from stickslip.kernels.cohorts import (
    ATTACHED,
    CONTACT_FORCE,
    DAMPED,
    DRIVE_FORCE,
    LOST,
    MASS_IN,
    MASS_OUT,
    POSITION,
    STORED,
    TIME,
    VELOCITY,
    WORK,
    Delays,
)
from stickslip.kernels.drive import FORCE_ABOVE, FORCE_BELOW, TRAVEL, Quadratic, Stop
from stickslip.kernels.oscillator import RIGID, Slider, is_rigid, response
from stickslip.model import RandomDelay
from stickslip.model.distributions import Empirical, Exponential, Gamma, Gaussian, LogNormal, Uniform, Weibull, excess

GAUSSIAN = Gaussian(mean=1.0, std=0.1)
DISTRIBUTIONS = [
    GAUSSIAN,
    Uniform(low=0.7, high=1.3),
    Exponential(mean=1.0),
    Gamma(mean=1.0, std=0.4),
    LogNormal(mean=1.0, std=0.3),
    Weibull(scale=1.0, shape=3.0),
    Empirical(edges=(0.5, 0.8, 1.1, 1.5), weights=(1, 3, 2)),
]
SLIDER = Slider(stiffness=2.0, mass=1e-4, damping=200.0)  # of Fig. 4


@cache
def table(distribution, points=2**13):
    distribution = distribution.positive()
    top = float(distribution.inverse_survival(cohorts.EXTINCT))
    x = np.linspace(0.0, top, points + 1)
    return cohorts.tabulate(distribution.survival(x), distribution.density(x), top / points)


def after(*times, weights=None):
    weights = np.ones(len(times)) / max(len(times), 1) if weights is None else weights
    return Delays(np.array(times, float), np.array(weights, float))


NO_DELAY = after(0.0)
NEVER_BACK = after()


def narrow(std=0.01, nodes=24):
    z, weight = np.polynomial.hermite_e.hermegauss(nodes)
    return std * z, weight / weight.sum()


def run(
    duration,
    *,
    distribution=GAUSSIAN,
    delays=NO_DELAY,
    slider=SLIDER,
    velocity=1.0,
    start=None,
    pull=None,
    until=None,
    times=None,
    cells=400,
    **options,
):
    """Pull relaxed contacts at constant velocity, or go on from a state; sampled every 0.01."""
    state = start or cohorts.initial_state(table(distribution), delays, *narrow(), velocity=velocity)
    begin, position, force = state.scalar[[TIME, POSITION, DRIVE_FORCE]]
    spring = 0.0 if is_rigid(slider) else force / slider.stiffness
    return cohorts.advance(
        state,
        table(distribution),
        delays,
        slider,
        pull or Quadratic(begin, position + spring, velocity, 0.0),
        until=until or begin + duration,
        times=begin + np.arange(0.0, duration + 1e-9, 0.01) if times is None else times,
        cells=cells,
        **options,
    )


def sliding(delays, velocity, *, distribution=GAUSSIAN, slider=SLIDER, cells=400):
    """A state of smooth sliding, the driving spring stretched accordingly; also its spring force."""
    m1, m2 = (distribution.positive().moment(order) for order in (1, 2))
    cycle = m1 + velocity * float(delays.time @ delays.weight)
    x, weight = cohorts.smooth_sliding(table(distribution), cells, m1 / cycle)
    state = cohorts.initial_state(table(distribution), delays, x, weight, velocity=velocity, rate=velocity / cycle)
    force = 0.5 * m2 / cycle + slider.mass * slider.damping * velocity
    state.scalar[DRIVE_FORCE] = force
    return state, force


def imbalance(progress, slider):
    """Energy put in less energy found, from the first sample to the last."""
    first, last = progress.rows[0], progress.rows[-1]

    def kept(row):
        kinetic = 0.5 * slider.mass * row[VELOCITY] ** 2
        return kinetic + 0.5 * row[DRIVE_FORCE] ** 2 / slider.stiffness + row[[DAMPED, LOST, STORED]].sum()

    return last[WORK] - first[WORK] - kept(last) + kept(first)


# ---------------------------------------------------------------- parts


@pytest.mark.parametrize(
    ("t", "eta", "w"),
    [(0.01, 200, 2e4), (0.3, 42, 2e4), (1, 200, 1e4), (0.2, 10, -300), (0.5, 0, 0), (100, 200, 3e4), (5, 1e4, 1)],
)
def test_response_is_the_matrix_exponential_for_every_kind_of_damping(t, eta, w):
    chain = np.diag([0.0, 1, 1, 1], 1)[:5, :5]
    chain[0, 1], chain[1, 0], chain[1, 1], chain[1, 2] = 1, -w, -eta, 1
    exact = expm(chain * t)
    found = response(float(t), float(eta), float(w))
    assert found == pytest.approx([exact[1, 1], *exact[0, 1:]], rel=1e-10, abs=1e-14)


@pytest.mark.eq(3)
@pytest.mark.parametrize("distribution", [GAUSSIAN, Exponential(mean=1.0), Gamma(mean=1.0, std=0.4)], ids=type)
def test_table_gives_the_survival_to_rounding(distribution):
    thresholds = table(distribution, 2**14)
    x = np.random.default_rng(1).uniform(0.0, thresholds.spacing * thresholds.survival.size, 2000)
    found = [cohorts.survival(thresholds, value) for value in x]
    assert found == pytest.approx(distribution.positive().survival(x), abs=2e-12)


@pytest.mark.parametrize("distribution", [Uniform(low=0.7, high=1.3), Weibull(scale=1.0, shape=0.7)], ids=type)
def test_table_never_rises_where_the_density_jumps_or_diverges(distribution):
    thresholds = table(distribution, 512)
    x = np.linspace(0.0, 1.01 * thresholds.spacing * thresholds.survival.size, 20_001)
    assert np.max(np.diff([cohorts.survival(thresholds, value) for value in x])) < 1e-15


# ---------------------------------------------------------------- closed forms


@pytest.mark.eq(11)
@pytest.mark.parametrize("damping", [20.0, 2 * math.sqrt(3.0 / 1e-4), 1000.0], ids=["under", "critical", "over"])
def test_nothing_breaks_the_slider_is_an_oscillator_exactly(damping):
    slider = SLIDER._replace(damping=damping)
    pull = Quadratic(0.0, 0.05, 0.3, 0.4)
    start = cohorts.initial_state(table(Uniform(low=5.0, high=6.0)), NO_DELAY, np.zeros(1), np.ones(1), velocity=2.0)
    rows = run(1.0, distribution=Uniform(low=5.0, high=6.0), slider=slider, start=start, pull=pull, step=1.0).rows
    # state: X, V, 1, t, t^2/2
    K, M = slider.stiffness, slider.mass
    chain = np.zeros((5, 5))
    chain[0, 1], chain[3, 2], chain[4, 3] = 1, 1, 1
    chain[1] = [-(K + 1) / M, -damping, K * pull.position / M, K * pull.velocity / M, K * pull.acceleration / M]
    exact = np.array([expm(chain * t) @ [0, 2, 1, 0, 0] for t in rows[:, TIME]])
    assert rows[:, POSITION] == pytest.approx(exact[:, 0], abs=1e-13)
    assert rows[:, VELOCITY] == pytest.approx(exact[:, 1], abs=1e-11)
    assert rows[:, CONTACT_FORCE] == pytest.approx(exact[:, 0], abs=1e-13)
    far = pull.position + rows[:, TIME] * (pull.velocity + 0.5 * pull.acceleration * rows[:, TIME])
    assert rows[:, DRIVE_FORCE] == pytest.approx(K * (far - exact[:, 0]), abs=1e-13)


@pytest.mark.eq(1, 3, 4)
@pytest.mark.parametrize("distribution", DISTRIBUTIONS, ids=type)
def test_contacts_that_never_come_back_follow_the_survival_there_and_back(distribution):
    start = cohorts.initial_state(table(distribution), NEVER_BACK, np.zeros(1), np.ones(1))
    out = run(0.81, distribution=distribution, delays=NEVER_BACK, slider=RIGID, start=start)
    back = run(2.02, distribution=distribution, delays=NEVER_BACK, slider=RIGID, start=out.state, velocity=-1.0)
    rows = np.concatenate([out.rows, back.rows])
    attached = distribution.positive().survival(np.maximum.accumulate(np.abs(rows[:, POSITION])))
    # Inside a step samples are interpolated: off by a quarter of what breaks in one, at most. At its ends all
    # is exact.
    assert rows[:, ATTACHED] == pytest.approx(
        attached, abs=distribution.density(np.linspace(0, 3, 301)).max() / 400 / 4
    )
    at_ends = [out.rows[-1], back.rows[-1]]
    reached = distribution.positive().survival([0.81, 1.21])
    assert [row[ATTACHED] for row in at_ends] == pytest.approx(reached, abs=1e-11)
    assert [row[CONTACT_FORCE] for row in at_ends] == pytest.approx([0.81 * reached[0], -1.21 * reached[1]], abs=1e-11)


@pytest.mark.eq(1, 2, 4)
def test_exponential_thresholds_have_a_closed_form_and_second_order():
    start = cohorts.initial_state(table(Exponential(mean=1.0)), NO_DELAY, np.zeros(1), np.ones(1))
    errors = []
    for step in (0.02, 0.01):
        rows = run(3.0, distribution=Exponential(mean=1.0), slider=RIGID, start=start, step=step).rows[::2]
        errors.append(np.abs(rows[:, CONTACT_FORCE] - (1 - np.exp(-rows[:, POSITION]))).max())
    # The trapezoidal rule takes h^2/12 from Int exp(-x) dx, hence from the births, and as much from Int x
    # exp(-x) dx.
    assert errors[1] < 0.01**2 / 6
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.01)


# ---------------------------------------------------------------- conservation and fixed point


@pytest.mark.parametrize("distribution", DISTRIBUTIONS, ids=type)
@pytest.mark.parametrize("times", [(), (0.0,), (0.2,), (0.0, 0.1, 0.35)])
def test_mass_is_conserved_to_rounding(distribution, times):
    scalar = run(3.0, distribution=distribution, delays=after(*times), cells=100).state.scalar
    assert scalar[MASS_IN] + scalar[MASS_OUT] == pytest.approx(1.0, abs=1e-12)
    assert scalar[MASS_OUT] > -1e-12


@pytest.mark.eq(1)
@pytest.mark.parametrize("times", [(0.0,), (0.05,), (0.02, 0.05, 0.08)])
def test_smooth_sliding_is_a_fixed_point_with_the_exact_force(times):
    start, force = sliding(after(*times), 1.0)
    rows = run(5.0, delays=after(*times), start=start).rows
    # The trapezoidal rule on a Gaussian distribution is as good as exact; steps of other lengths leave second-order
    # ripples.
    assert rows[:, DRIVE_FORCE] == pytest.approx(force, abs=1e-5)
    assert rows[:, VELOCITY] == pytest.approx(1.0, abs=2e-4)


@pytest.mark.parametrize("damping", [0.0, 14.0, 200.0])
def test_energy_balance_closes_to_second_order(damping):
    slider = SLIDER._replace(damping=damping)
    gaps = [abs(imbalance(run(3.0, slider=slider, delays=after(0.2), cells=cells), slider)) for cells in (200, 800)]
    assert gaps[1] < 2e-5
    assert gaps[1] < gaps[0] / 8


# ---------------------------------------------------------------- order of convergence


@pytest.mark.parametrize("delays", [NEVER_BACK, NO_DELAY, after(0.2), after(0.01), after(0.1, 0.2, 0.3)])
def test_second_order_in_the_step_through_a_slip(delays):
    steps = [0.01 / 5, 0.01 / 10, 0.01 / 20]
    coarse, middle, fine = (run(2.0, delays=delays, step=step).rows for step in steps)
    for column in (POSITION, VELOCITY, DRIVE_FORCE, CONTACT_FORCE, ATTACHED, WORK, LOST, STORED):
        first, second = (np.abs(a - b)[:, column].max() for a, b in ((coarse, middle), (middle, fine)))
        assert 3.6 < first / second < 4.5 or first < 1e-12


def test_second_order_in_cells():
    coarse, middle, fine = (run(2.0, delays=after(0.2), cells=cells).rows for cells in (400, 800, 1600))
    for column in (POSITION, VELOCITY, CONTACT_FORCE):
        ratio = np.abs(coarse - middle)[:, column].max() / np.abs(middle - fine)[:, column].max()
        assert 3.0 < ratio < 5.5


# ---------------------------------------------------------------- agreement with the renewal convolution


@pytest.mark.eq(1, 2, 3, 4)
@pytest.mark.parametrize("distribution", DISTRIBUTIONS, ids=type)
@pytest.mark.parametrize("velocity", [1.0, 0.3])
def test_agrees_with_the_renewal_convolution(distribution, velocity):
    delays = after(0.0, 0.1, 0.4, weights=(0.2, 0.5, 0.3))
    agree(distribution, delays, velocity)


def test_agrees_with_the_renewal_convolution_for_a_random_delay():
    agree(
        GAUSSIAN,
        after(
            *RandomDelay(mean=0.2, std=0.12).quadrature()[0],
            weights=RandomDelay(mean=0.2, std=0.12).quadrature()[1],
        ),
        1.0,
    )


def agree(distribution, delays, velocity):
    x, weight = narrow(0.05)
    start = cohorts.initial_state(table(distribution), delays, x, weight)
    positive = distribution.positive()
    contacts = renewal.Contacts(
        positive.density, partial(excess, positive), x, weight, abs(x), velocity * delays.time, delays.weight
    )
    exact = renewal.solve(contacts, 4.0, 800)
    errors = []
    for cells in (200, 800):
        rows = run(
            4.0 / velocity,
            distribution=distribution,
            delays=delays,
            slider=RIGID,
            velocity=velocity,
            start=start,
            cells=cells,
        ).rows
        response = renewal.observe(contacts, exact, np.clip(rows[:, POSITION], 0.0, 4.0))
        errors.append(
            [
                np.abs(rows[:, column] - value).max()
                for column, value in ((CONTACT_FORCE, response.force), (ATTACHED, response.attached))
            ]
        )
    assert max(errors[1]) < 2e-4
    # Second order, but where a distribution jumps the constant depends on where in a step the jump falls.
    assert errors[1][0] < errors[0][0] / 4


# ---------------------------------------------------------------- any direction of motion


def test_motion_backwards_is_the_mirror_image():
    delays = after(0.1)
    start = cohorts.initial_state(table(GAUSSIAN), delays, *narrow(), velocity=1.0)
    mirror = cohorts.initial_state(table(GAUSSIAN), delays, *narrow(), velocity=-1.0)
    ahead = run(3.0, delays=delays, start=start).rows
    back = run(3.0, delays=delays, start=mirror, velocity=-1.0).rows
    assert back[:, [POSITION, VELOCITY, CONTACT_FORCE]] == pytest.approx(
        -ahead[:, [POSITION, VELOCITY, CONTACT_FORCE]], abs=1e-9
    )
    assert back[:, [ATTACHED, LOST, STORED]] == pytest.approx(ahead[:, [ATTACHED, LOST, STORED]], abs=1e-9)


def test_a_shuttle_breaks_no_more_than_its_widest_swing():
    state = cohorts.initial_state(table(GAUSSIAN), NEVER_BACK, np.zeros(1), np.ones(1))
    for velocity, duration in ((1.0, 0.95), (-1.0, 1.8), (1.0, 1.8)):
        state = run(duration, delays=NEVER_BACK, slider=RIGID, start=state, velocity=velocity).state
    assert state.scalar[ATTACHED] == pytest.approx(float(GAUSSIAN.survival(0.95)), abs=1e-11)
    assert state.scalar[CONTACT_FORCE] == pytest.approx(0.95 * state.scalar[ATTACHED], abs=1e-11)


def test_a_ringing_slider_breaks_what_its_widest_swing_reaches():
    # Let go with a stretched spring and no damping: the first oscillation decides what breaks, however long the
    # steps.
    slider = SLIDER._replace(damping=0.0)
    start = cohorts.initial_state(table(GAUSSIAN), NEVER_BACK, np.zeros(1), np.ones(1))
    found = [
        run(
            0.2, delays=NEVER_BACK, slider=slider, start=start, pull=Quadratic(0.0, 0.70, 0.0, 0.0), cells=cells
        ).state.scalar[ATTACHED]
        for cells in (400, 3200)
    ]
    # Energy: 1/2 K D^2 = 1/2 K (D - A)^2 + Int_0^A x J dx at the end of the oscillation.
    oscillation = np.linspace(0.8, 1.1, 300_001)
    distribution = GAUSSIAN.positive()
    pulled = (
        excess(distribution, 0.0, 2)
        - excess(distribution, oscillation, 2)
        - oscillation * excess(distribution, oscillation, 1)
    )
    widest = np.interp(0.0, pulled - oscillation * (1.4 - oscillation), oscillation)
    assert found == pytest.approx([float(distribution.survival(widest))] * 2, abs=2e-5)


# ---------------------------------------------------------------- the paper's runs


@pytest.mark.eq(11)
def test_fig_4_stick_slip_of_the_soft_system():
    rows = run(100.0, delays=after(0.2)).rows
    rows = rows[rows[:, POSITION] > 60]
    force = rows[:, DRIVE_FORCE]
    up = rows[1:, TIME][(force[1:] > force.mean()) & (force[:-1] <= force.mean())]
    assert np.ptp(force) == pytest.approx(0.77, abs=0.02)
    assert np.diff(up).mean() == pytest.approx(reference.PERIOD, abs=0.010)
    assert rows[:, VELOCITY].max() == pytest.approx(13.0, abs=0.7)


@pytest.mark.parametrize(
    ("stiffness", "delay", "low", "high"),
    [(2.0, 0.085, 0.0, 0.05), (2.0, 0.105, 0.5, 0.8), (5.0, 0.1, 0.0, 0.04), (5.0, 0.3, 0.62, 0.65)],
)
def test_fig_4_regimes(stiffness, delay, low, high):
    rows = run(100.0, delays=after(delay), slider=SLIDER._replace(stiffness=stiffness)).rows
    assert low <= np.ptp(rows[rows[:, POSITION] > 70, DRIVE_FORCE]) < high


def test_fig_5_instability_without_re_attachment():
    rows = run(2.0, delays=NEVER_BACK, times=np.arange(0.0, 2.0, 2e-4)).rows
    assert np.interp(0.9247, rows[:, POSITION], rows[:, TIME]) == pytest.approx(1.309, abs=0.004)
    assert rows[:, VELOCITY].max() == pytest.approx(14.4, abs=0.4)
    assert np.max(rows[:, DRIVE_FORCE] - rows[:, CONTACT_FORCE]) == pytest.approx(0.3155, abs=5e-4)


@pytest.mark.eq(10)
def test_memoryless_approximation_is_exact_for_the_mean_force_of_steady_sliding():
    delays = after(0.2)._replace(memoryless=True)
    rows = run(40.0, delays=delays, slider=RIGID, velocity=1.5).rows
    assert rows[-500:, CONTACT_FORCE].mean() == pytest.approx(1.01 / 2 / (1 + 1.5 * 0.2), rel=1e-4)
    assert rows[-500:, ATTACHED].mean() == pytest.approx(1 / (1 + 1.5 * 0.2), rel=1e-4)


# ---------------------------------------------------------------- control


def test_neither_samples_nor_pauses_change_the_steps():
    case = {"delays": after(0.1), "pull": Quadratic(0.0, 0.0, 1.0, 0.0), "until": 2.0}
    times = np.linspace(0.0, 2.0, 201)
    whole = run(2.0, times=times, **case)
    state, rows, reason = run(2.0, times=times, max_steps=7, **case)
    while reason == cohorts.PAUSED:
        state, more, reason = run(2.0, start=state, times=times[len(rows) :], max_steps=7, **case)
        rows = np.concatenate([rows, more])
    assert reason == cohorts.FINISHED
    assert np.array_equal(rows, whole.rows)
    assert np.array_equal(state.scalar, whole.state.scalar)
    assert np.array_equal(state.scalar, run(2.0, times=times[::50], **case).state.scalar)


@pytest.mark.parametrize(
    ("stop", "column", "expected"),
    [
        (Stop(TRAVEL, 0.5, 0.0), POSITION, 0.5),
        (Stop(FORCE_ABOVE, 0.6, 0.0), DRIVE_FORCE, 0.6),
        (Stop(FORCE_BELOW, -0.1, 0.0), DRIVE_FORCE, -0.1),
    ],
)
def test_stops_at_the_first_sample_where_the_condition_holds(stop, column, expected):
    velocity = -1.0 if stop.kind == 3 else 1.0
    state, rows, reason = run(5.0, velocity=velocity, stop=stop)
    past = (np.abs(rows[:, column]) >= abs(expected)).tolist()
    assert reason == cohorts.STOPPED
    assert past.index(True) == len(rows) - 1
    assert state.scalar[TIME] == pytest.approx(rows[-1, TIME], abs=1e-12)
    assert state.scalar[: cohorts.COLUMNS] == pytest.approx(rows[-1], abs=1e-12)


def test_the_state_given_is_left_alone():
    start = cohorts.initial_state(table(GAUSSIAN), NO_DELAY, *narrow(), velocity=1.0)
    copies = [array.copy() for array in start]
    run(1.5, start=start)
    assert all(np.array_equal(array, copy) for array, copy in zip(start, copies, strict=True))


def test_slow_and_resting_sliders_need_few_steps():
    slow = run(5e4, delays=after(0.2), velocity=1e-4, times=np.zeros(0), max_steps=20_000)
    assert slow.reason == cohorts.FINISHED
    rest = run(1e6, delays=after(0.2), start=slow.state, velocity=0.0, times=np.zeros(0), max_steps=5_000)
    assert rest.reason == cohorts.FINISHED
    assert rest.state.scalar[MASS_OUT] == pytest.approx(0.0, abs=1e-12)
    assert rest.state.used[0] < 1000


def test_distributions_all_but_equal_do_not_stall_it():
    progress = run(3.0, distribution=Uniform(low=1.0, high=1.0 + 1e-7), delays=after(0.1), max_steps=50_000)
    assert progress.reason == cohorts.FINISHED


def test_stretchings_are_the_distribution_of_the_attached():
    progress = run(2.3, delays=after(0.2))
    x, mass = cohorts.stretchings(progress.state)
    scalar = progress.state.scalar
    assert mass.sum() == pytest.approx(scalar[MASS_IN], abs=1e-13)
    assert mass @ x == pytest.approx(scalar[CONTACT_FORCE], abs=1e-12)
    assert 0.5 * mass @ x**2 == pytest.approx(scalar[STORED], abs=1e-12)

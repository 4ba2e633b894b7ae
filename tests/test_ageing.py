"""Contacts whose thresholds age: sampling, kinetic equation, stability, the paper's closure."""

from math import erf, erfc, exp, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip import model, stability
from stickslip.kernels.closure import Cohorts as ClosureCohorts
from stickslip.kernels.closure import (
    Thresholds,
    advance_closure,
    closure_friction,
    relax,
    threshold_edges,
    threshold_rates,
)
from stickslip.kernels.drive import Quadratic, drive_at
from stickslip.kernels.langevin import Langevin, Life
from stickslip.kernels.langevin_contacts import Contacts, advance_contacts, crossing, reflected
from stickslip.kernels.langevin_density import Cohorts, advance_density, cell_widths, density_nodes
from stickslip.kernels.langevin_response import excursions, life_transforms
from stickslip.kernels.langevin_steady import life_moments, pull_newborns, steady_friction, steady_moments
from stickslip.kernels.oscillator import RIGID, Load, Motion, Slider, travel
from stickslip.kernels.stepping import Course

STD = 0.1
NONE = np.zeros(1)
ONE = Langevin(rate=1.0, mean=1.0, std=STD)
FIG_8 = Slider(stiffness=1.0, mass=1e-4, damping=10.0)


def pulling(velocity, start=0.0, position=0.0):
    return Quadratic(start, position, velocity, 0.0)


def contacts_at_rest(n, rng):
    return Contacts(np.zeros(n), np.abs(rng.normal(1.0, STD, n)), np.full(n, -np.inf))


def dynamic_stiffness(velocity, langevin, s, delay=0.0):
    ageing = model.Langevin(rate=langevin.rate, newborn=langevin.newborn)
    thresholds = model.distributions.Gaussian(mean=langevin.mean, std=langevin.std)
    interface = model.Interface(thresholds=thresholds, ageing=ageing, delay=model.Delay(delay))
    return stability.dynamic_stiffness(interface, velocity, s)


def friction_of_contacts(u, step=0.04, n=10_000, span=20.0, seed=1):
    """Mean force of sampled contacts in steady rigid motion, and its standard error from 20 blocks."""
    rng = np.random.default_rng(seed)
    contacts = contacts_at_rest(n, rng)
    contacts.threshold[:] *= rng.random(n)  # desynchronised, so that the start is soon forgotten
    times = 12.0 / u + 4.0 + np.arange(0, 401) * span / 400
    run = advance_contacts(np.zeros(4), contacts, Course(pulling(u), RIGID, times, step, np.inf), ONE, NONE, rng)
    blocks = run[1:, 3].reshape(20, -1).mean(axis=1)
    return blocks.mean(), blocks.std() / sqrt(20)


def plain_euler(u, dt, n, steps, seed):
    """The plain loop: Euler-Maruyama, breaking seen at the end of a step only. Force in the second half."""
    rng = np.random.default_rng(seed)
    x, f, forces = np.zeros(n), np.abs(rng.normal(1.0, STD, n)), []
    for k in range(steps):
        x += u * dt
        f += (1.0 - f) * dt + STD * sqrt(2.0 * dt) * rng.standard_normal(n)
        broken = np.abs(x) >= f
        x[broken] = 0.0
        f[broken] = 0.0
        if k >= steps // 2:
            forces.append(x.mean())
    return np.mean(forces)


# ---------------------------------------------------------------- the distribution of thresholds


@pytest.mark.eq(13, 15, 16)
def test_distributions_at_rest_keep_their_distribution_and_forget_as_exp_minus_rate_squared_t():
    rng, n, rate, lag = np.random.default_rng(3), 20_000, 1.3, 0.4
    contacts = contacts_at_rest(n, rng)
    f, before = contacts.threshold, contacts.threshold.copy()
    course = Course(pulling(0.0), RIGID, np.array([0.5 * lag, lag]), 0.04 / rate**2, 0.05)
    advance_contacts(np.zeros(4), contacts, course, ONE._replace(rate=rate), NONE, rng)
    assert abs(f.mean() - 1.0) < 4 * STD / sqrt(n)
    assert abs(f.std() - STD) < 4 * STD / sqrt(2 * n)
    expected = exp(-(rate**2) * lag)
    correlation = np.corrcoef(before, f)[0, 1]
    assert abs(correlation - expected) < 4 * (1 - expected**2) / sqrt(n)
    third = np.mean(((f - 1.0) / STD) ** 3)
    fourth = np.mean(((f - 1.0) / STD) ** 4)
    assert abs(third) < 4 * sqrt(15 / n)
    assert abs(fourth - 3.0) < 4 * sqrt(96 / n)


@pytest.mark.eq(14, 17)
def test_cells_of_thresholds_relax_to_the_gaussian_at_second_order():
    errors = []
    for cells in (4.0, 8.0):
        edges = threshold_edges(ONE._replace(newborn=1.0), cells)
        mass = np.zeros(edges.size - 1)
        mass[mass.size // 3] = 1.0
        relax(mass, threshold_rates(edges, ONE), 1e5)  # an endless step ends at the stationary distribution
        assert abs(mass.sum() - 1.0) < 1e-9
        assert mass.min() >= 0.0
        gauss = np.diff([0.5 * (1 + erf((e - 1.0) / STD / sqrt(2))) for e in edges])
        errors.append(np.abs(mass - gauss).sum())
    assert errors[0] < 0.02
    assert errors[0] / errors[1] > 3.5


# ---------------------------------------------------------------- the pieces of a step


def test_a_margin_that_is_reflected_has_the_distribution_of_a_reflected_brownian_motion():
    rng, n, drift, noise, time = np.random.default_rng(5), 40_000, -0.7, 0.5, 1.0
    sigma = sqrt(noise * time)
    sample = np.array([reflected(0.0, drift, noise, time, rng) for _ in range(n)])

    def normal(z):
        return 0.5 * erfc(-z / sqrt(2))

    for y in (0.1, 0.3, 0.6, 1.0):
        below = normal((y - drift * time) / sigma) - exp(2 * drift * y / noise) * normal((-y - drift * time) / sigma)
        assert abs(np.mean(sample[:, 0] <= y) - below) < 4 * sqrt(below * (1 - below) / n)
    assert sample[:, 1].min() > 0.0
    assert sample[:, 1].max() <= time


def test_the_last_visit_to_the_boundary_is_where_the_bridge_has_it_on_average():
    """First passage densities of the two parts of the step, integrated over where the minimum lies."""
    rng, noise, time = np.random.default_rng(6), 0.3, 2.0
    margin, age = reflected(0.05, -0.2, noise, time, rng)
    # The depth of the minimum follows from margin and age, margin/(down + margin) of the step. Its time has the density
    down = margin * (time - age) / age
    t = time * 0.5 * (1 - np.cos(np.pi * (np.arange(20_000) + 0.5) / 20_000))
    weight = np.sin(np.pi * (np.arange(20_000) + 0.5) / 20_000) * (t * (time - t)) ** -1.5
    weight *= np.exp(-(down**2 / t + margin**2 / (time - t)) / (2 * noise))
    assert age == pytest.approx(((time - t) * weight).sum() / weight.sum(), rel=1e-6)


def test_the_moment_of_breaking_inside_a_step_is_that_of_a_bridge():
    rng, n = np.random.default_rng(8), 20_000
    start, end, variance = 0.8, 0.5, 1.0
    sample = np.array([crossing(start, end, variance, rng) for _ in range(n)])
    clock = sample / (1 - sample)  # inverse Gaussian of mean start/end and shape start^2/variance
    mean, shape = start / end, start**2 / variance
    assert abs(clock.mean() - mean) < 4 * sqrt(mean**3 / shape / n)
    assert abs(np.mean(1 / clock) - (1 / mean + 1 / shape)) < 4 * sqrt((1 / (mean * shape) + 2 / shape**2) / n)


@pytest.mark.parametrize(
    ("mass", "damping", "length", "tolerance"),  # the quadratures are of fourth order in the last doubling
    [(0.02, 40.0, 0.3, 1e-5), (1.0, 2.0, 0.3, 1e-5), (1.0, 2.0, 1.0, 5e-4), (0.02, 3.0, 0.05, 1e-6)],
)
def test_work_and_turning_points_of_the_oscillator(mass, damping, length, tolerance):
    """Against the equation of motion, integrated: a drive that turns, contacts that break ever slower."""
    K, begin, start = 1.5, 0.1, Motion(0.1, 0.15, -0.4)
    drive, load = Quadratic(0.0, 0.2, -1.0, 2.0), Load(0.1, 0.5, 0.7, -0.3)

    def slope(t, state):
        X, V, _, _ = state
        D, velocity = drive_at(drive, begin + t)
        friction = load.force + load.stiffness * (X - start.X) - load.loss * t - 0.5 * load.ramp * t * t
        return [V, (K * (D - X) - friction) / mass - damping * V, K * (D - X) * velocity, V * V]

    exact = solve_ivp(slope, (0, length), [start.X, start.V, 0, 0], "DOP853", rtol=1e-12, atol=1e-14, dense_output=True)
    X, V, work, squares = exact.y[:, -1]
    path = exact.sol(np.linspace(0, length, 10_001))[0]
    got = travel(Slider(K, mass, damping), drive, start, load, length)
    assert pytest.approx([X, V], abs=1e-12) == [got.X, got.V]
    assert [got.low, got.high] == pytest.approx([path.min(), path.max()], abs=20 * tolerance)  # a cubic between ends
    assert [got.work, got.squares] == pytest.approx([work, squares], abs=tolerance)


# ---------------------------------------------------------------- steady friction


@pytest.mark.eq(13, 14)
@pytest.mark.parametrize(("u", "force"), [(0.1, 0.4677), (0.5, 0.3756), (1.0, 0.1243), (5.0, 0.00310)])
@pytest.mark.parametrize("rate", [1.0, 1.5])
def test_steady_friction_of_the_kinetic_equation(u, force, rate):
    langevin = ONE._replace(rate=rate)
    solved = steady_friction(np.array([u * rate**2]), langevin)[0]
    assert solved == pytest.approx(force, rel=0.003)
    assert steady_friction(np.array([-u * rate**2]), langevin)[0] == -solved


def test_steady_friction_scales_with_the_mean_threshold():
    one = steady_friction(np.array([0.3]), ONE)[0]
    assert steady_friction(np.array([0.6]), Langevin(1.0, 2.0, 0.2))[0] == pytest.approx(2 * one, rel=1e-12)


def test_steady_friction_has_its_tail():
    u, std = np.array([20.0, 50.0, 100.0]), 0.02
    tail = std**2 * u / (u - 1) ** 2
    # The next order is std^2/(u-1)^2 with a factor near 5.
    assert np.all(np.abs(steady_friction(u, Langevin(1.0, 1.0, std)) / tail - 1) < 2e-4 + 12 * std**2 / (u - 1))


@pytest.mark.parametrize("u", [1e-3, 0.05, 0.5, 1.0, 3.0, 20.0])
def test_steady_friction_is_accurate_to_1e_4_and_of_second_order(u):
    plain = [np.divide(*life_moments(Life(u, STD, 0.0), m, 4 * m)[::-1]) for m in (100, 200, 400)]
    assert (plain[0] - plain[1]) / (plain[1] - plain[2]) == pytest.approx(4.0, rel=0.1)
    best = (4 * plain[2] - plain[1]) / 3
    assert steady_friction(np.array([u]), ONE)[0] == pytest.approx(best, rel=1e-4)


@pytest.mark.parametrize("u", [0.1, 0.5, 1.0, 2.0, 5.0])
def test_contacts_have_the_friction_of_the_kinetic_equation(u):
    force, error = friction_of_contacts(u)
    exact = steady_friction(np.array([u]), ONE)[0]
    assert abs(force - exact) < 4 * error + 0.005 * exact


@pytest.mark.slow
@pytest.mark.parametrize("u", [0.5, 1.0])
def test_halving_the_step_does_not_move_the_friction(u):
    coarse, error_1 = friction_of_contacts(u, step=0.04, n=40_000)
    fine, error_2 = friction_of_contacts(u, step=0.02, n=40_000, seed=2)
    assert abs(coarse / fine - 1) < 0.003 + 3 * np.hypot(error_1, error_2) / fine


def test_the_plain_loop_is_biased_where_bridges_are_not():
    u, exact = 2.0, steady_friction(np.array([2.0]), ONE)[0]
    bias = [plain_euler(u, dt, 2000, int(4.0 / dt), seed=4) / exact - 1 for dt in (8e-3, 2e-3)]
    assert -0.06 < bias[1] < -0.03
    assert 1.5 < bias[0] / bias[1] < 4.0  # a quarter of the step gives less than a quarter of the bias
    force, error = friction_of_contacts(u, step=0.04, n=4000)
    assert abs(force / exact - 1) < 4 * error / exact + 0.003


# ---------------------------------------------------------------- the kinetic equation in time


def density_at_rest(cells=400):
    """State, cohorts and nodes: contacts pulled back and ahead, Gaussian stretchings (20 points) and thresholds."""
    nodes, rows = density_nodes(ONE, cells / 40), cells // 2
    points, weights = np.polynomial.hermite_e.hermegauss(20)
    gauss = np.exp(-0.5 * ((nodes + 0.01 * np.abs(points)[:, None] - 1.0) / STD) ** 2) * cell_widths(nodes)
    gauss[:, 0] = 0.0
    gauss *= (weights / weights.sum() / gauss.sum(axis=1))[:, None]
    place, mass, moment = np.zeros(rows), np.zeros((rows, nodes.size)), np.zeros((rows, nodes.size))
    for row, side in enumerate((points < 0.0, points > 0.0)):
        mass[row], moment[row] = gauss[side].sum(axis=0), -0.01 * points[side] @ gauss[side]
    return np.array([0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0]), Cohorts(place, mass, moment), nodes


def advance(density, drive, slider, rate, times, cells=400):
    step = 4.0 / cells
    course = Course(drive, slider, np.asarray(times), step / rate**2, step)
    return advance_density(*density, course, ONE._replace(rate=rate))


def advance_to_and_fro(advance_to, times):
    """Samples at `times` as the drive goes one way until 0.12, then turns round: `advance_to` takes drive and times."""
    turn = int(np.searchsorted(times, 0.12 * (1 - 1e-12)))
    there = advance_to(pulling(10.0), np.append(times[:turn], 0.12))[:turn]
    return np.vstack([there, advance_to(pulling(-10.0, 0.12, 1.2), np.maximum(times[turn:], 0.12))])


def friction_of_density(u, cells):
    """Force after rigid motion over some sixteen lives at the least."""
    density, end = density_at_rest(cells), max(4.0, 16.0 / u)
    run = advance(density, pulling(u), RIGID, 1.0, np.linspace(0.9 * end, end, 50), cells)
    assert np.all(np.abs(run[:, 4] - 1.0) < 1e-12)
    assert density[1].mass.min() >= 0.0
    return run[:, 3].mean()


@pytest.mark.eq(17)
@pytest.mark.parametrize(("u", "tolerance"), [(2.0, 0.01), (5.0, 0.02)])
def test_the_density_slides_with_the_steady_friction(u, tolerance):
    exact = steady_friction(np.array([u]), ONE)[0]
    assert friction_of_density(u, 400) == pytest.approx(exact, rel=tolerance)


@pytest.mark.slow
def test_the_density_slides_slowly_with_the_steady_friction():
    u, cells, lives = 0.1, 200, 30
    density = state, (place, mass, moment), _ = density_at_rest(cells)
    state[4], place[:40] = 40.0, -0.02 * np.arange(40)  # of all ages, for slow ones forget their start slowly
    mass[:40], moment[:] = mass[:2].sum(axis=0) / 40, 0.0
    times = np.arange(lives * 50) * 0.2
    run = advance(density, pulling(u), RIGID, 1.0, times, cells)[-500:, 3]
    exact = steady_friction(np.array([u]), ONE)[0]
    assert np.average(run, weights=np.hanning(run.size)) == pytest.approx(exact, rel=0.003)


@pytest.mark.parametrize("u", [0.5, 1.0])
def test_the_density_converges_at_second_order(u):
    exact = steady_friction(np.array([u]), ONE)[0]
    errors = [friction_of_density(u, cells) / exact - 1 for cells in (100, 200, 400)]
    assert np.log(errors[0] / errors[2]) / np.log(4) > 1.6
    assert abs(errors[2]) < 0.001


@pytest.mark.eq(14, 17)
def test_the_density_at_rest_stays_the_gaussian_of_its_thresholds():
    density = _, (_, mass, moment), nodes = density_at_rest()
    moment[:], mass[:] = 0.0, 0.0
    mass[0] = np.exp(-0.5 * ((nodes - 1.0) / STD) ** 2) * cell_widths(nodes)
    mass[0] /= mass.sum()
    mass[0, 0], before = 0.0, mass.copy()
    run = advance(density, pulling(0.0), RIGID, 1.0, [3.0])
    assert np.abs(mass - before).sum() < 1e-10  # up to what the breaking boundary, ten standard deviations away, takes
    assert run[0, 3] == 0.0


def test_fast_motion_to_and_fro_agrees_with_many_contacts():
    rng, n, times = np.random.default_rng(14), 40_000, np.linspace(0.005, 0.4, 80)
    density, contacts, state = density_at_rest(800), contacts_at_rest(n, rng), np.zeros(4)
    contacts.stretching[:], langevin = rng.normal(0.0, 0.01, n), ONE._replace(rate=1.5)

    def sample(drive, times):
        course = Course(drive, RIGID, times, 0.005 / 1.5**2, 0.01)
        return advance_contacts(state, contacts, course, langevin, NONE, rng)

    run = advance_to_and_fro(lambda drive, to: advance(density, drive, RIGID, 1.5, to, 800), times)
    sampled = advance_to_and_fro(sample, times)
    # A contact's stretching scatters by less than 0.5.
    assert np.all(np.abs(run[:, 3] - sampled[:, 3]) < 4 * 0.5 / sqrt(n) + 0.004)


# ---------------------------------------------------------------- with a slider


def pulled_contacts(rate, steady, n=2000, span=40.0, seed=0, step=0.04, reach=0.03):
    """Fig. 8: spring force from relaxed contacts or from steady sliding, sampled every 0.01."""
    rng, velocity = np.random.default_rng(seed), 1.0
    contacts, langevin = contacts_at_rest(n, rng), ONE._replace(rate=rate)
    state, course = np.zeros(4), Course(pulling(velocity), RIGID, np.array([15.0]), step / rate**2, reach)
    if steady:
        contacts.threshold[:] *= rng.random(n)
        run = advance_contacts(state, contacts, course, langevin, NONE, rng)
        course = course._replace(drive=pulling(velocity, 15.0, state[1] + run[0, 3] + 1e-3))
    else:
        contacts.stretching[:] = rng.normal(0.0, 0.01, n)
    times = state[0] + np.arange(1, int(100 * span) + 1) * 0.01
    return advance_contacts(state, contacts, course._replace(slider=FIG_8, times=times), langevin, NONE, rng)


def period(force, dt=0.01, between=(1.5, 2.5), cycles=6):
    """Period from the lag of the autocorrelation's maximum after several cycles, which is sharper than after one."""
    f = force - force.mean()
    n = f.size
    correlation = np.fft.irfft(np.abs(np.fft.rfft(f, 2 * n)) ** 2)[:n] / np.arange(n, 0, -1)
    low, high = int(between[0] / dt), int(between[1] / dt)
    lag = low + int(np.argmax(correlation[low:high]))
    for k in range(2, cycles + 1):
        guess = round(lag * k / (k - 1))
        lag = guess - 15 + int(np.argmax(correlation[guess - 15 : guess + 16]))
    return dt * lag / cycles


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate", "steady", "low", "high"),
    [
        (0.7, False, 0.0, 0.05),
        (0.9, False, 0.36, 0.46),
        (1.5, False, 1.20, 1.28),
        (1.5, True, 1.20, 1.28),
        (2.0, False, 1.17, 1.26),
        (2.0, True, 0.0, 0.12),
    ],
)
def test_fig_8_contacts(rate, steady, low, high):
    # Steps half as long as usual: the usual ones shorten the period by .3 %, out of the band.
    force = pulled_contacts(rate, steady, step=0.02, reach=0.01)[1500:, 2]
    assert low <= np.ptp(force) <= high
    if rate == 1.5:
        assert 0.73 <= force.max() <= 0.77
        assert 1.95 <= period(force) <= 2.05


# ---------------------------------------------------------------- stability of smooth sliding


@pytest.mark.parametrize("u", [0.05, 0.3, 0.5, 1.0, 3.0])
def test_dynamic_stiffness_at_low_frequency_is_the_slope_of_the_friction(u):
    h, s = 1e-4 * u, 1e-4
    low, high = steady_friction(np.array([u - h, u + h]), ONE, 0.0, 300)
    slope = (high - low) / (2 * h)
    kappa = dynamic_stiffness(u, ONE, np.array([s + 0j]))[0]
    assert kappa.real / s == pytest.approx(slope, abs=1e-3 * max(0.3, abs(slope)))


def test_dynamic_stiffness_depends_on_velocity_and_frequency_over_rate_squared():
    s = np.array([1j, 0.3 + 5j])
    one = dynamic_stiffness(0.4, ONE, s)
    other = dynamic_stiffness(0.4 * 2.25, ONE._replace(rate=1.5), 2.25 * s)
    assert np.allclose(one, other, rtol=1e-12)
    assert np.allclose(dynamic_stiffness(0.4, ONE, np.conj(s)), np.conj(one), rtol=1e-12)


@pytest.mark.parametrize("newborn", [0.0, 0.3])
@pytest.mark.parametrize("u", [0.01, 0.1, 0.44, 1.0, 1.2, 8.0])
def test_lives_from_the_volterra_equation_are_those_of_the_kinetic_equation(u, newborn):
    life = Life(u, STD, newborn)
    parts = life_transforms(excursions(life), np.zeros(1, dtype=complex))[:, 0]
    length, work = steady_moments(life, 200)
    assert parts[1].real / parts[0].real == pytest.approx(work / length, rel=1e-4)
    assert parts[0].real == pytest.approx(length, rel=1e-4)
    assert np.all(np.abs(parts[2:]) < 1e-9 * length)  # nothing is perturbed that stands still


def test_at_high_frequency_all_contacts_are_springs():
    kappa = dynamic_stiffness(0.1, ONE, np.array([1e3j, 1e4j]))
    assert abs(kappa[1] - 1) < 0.02
    assert abs(kappa[1] - 1) < abs(kappa[0] - 1)


def test_dynamic_stiffness_with_newborns_and_delay_at_low_frequency():
    u, langevin, delay, s, h = 0.5, ONE._replace(newborn=0.3), 0.2, 1e-4, 1e-4
    low, high = steady_friction(np.array([u - h, u + h]), langevin, delay, 300)
    kappa = dynamic_stiffness(u, langevin, np.array([s + 0j]), delay)
    assert kappa[0].real / s == pytest.approx((high - low) / (2 * h), abs=2e-3)


def edge_of_stability(omega, rate, velocity=1.0):
    """Newton's method for a purely imaginary root of M s^2 + M eta s + K + kappa(s), in (omega, rate)."""
    h, unknown = 1e-4, np.array([omega, rate])

    def balance(w, b):
        s = 1j * w
        kappa = dynamic_stiffness(velocity, ONE._replace(rate=b), np.array([s]))[0]
        value = 1e-4 * s * s + 1e-3 * s + 1.0 + kappa
        return np.array([value.real, value.imag])

    for _ in range(15):
        f = balance(*unknown)
        slopes = np.column_stack(
            [(balance(unknown[0] + h, unknown[1]) - f) / h, (balance(unknown[0], unknown[1] + h) - f) / h]
        )
        step = np.linalg.solve(slopes, f)
        unknown -= step * min(1.0, 0.2 / np.max(np.abs(step / unknown)))
    assert np.abs(balance(*unknown)).max() < 1e-8
    return unknown


def test_smooth_sliding_of_fig_8_is_unstable_between_two_rates():
    omega, upper = edge_of_stability(5.5, 1.6)
    assert upper == pytest.approx(1.63, abs=0.05)
    assert omega == pytest.approx(5.5, abs=0.1)
    assert 0.78 < edge_of_stability(16.0, 0.8)[1] < 0.86


def growth_after_a_small_perturbation(rate, near, cells=400):
    """Growth rate and frequency of the mode next to `near` in a run of the kinetic equation, by linear prediction."""
    density, settled = density_at_rest(cells), 8.0
    run = advance(density, pulling(1.0), RIGID, rate, [settled], cells)
    drive = pulling(1.0, settled, density[0][1] + run[0, 3] + 2e-3)
    run = advance(density, drive, FIG_8, rate, settled + np.arange(1, 1251) * 0.002, cells)
    series = np.diff(run[150::25, 2])  # four damped modes
    rows = np.array([series[i : i + 4] for i in range(series.size - 4)])
    coefficients = np.linalg.lstsq(rows, series[4:], rcond=None)[0]
    modes = np.log(np.roots(np.r_[1.0, -coefficients[::-1]]).astype(complex)) / 0.05
    return modes[np.argmin(np.abs(modes - near))]


@pytest.mark.parametrize(("omega", "guess", "rates"), [(5.5, 1.6, (1.59, 1.63)), (16.0, 0.82, (0.80, 0.82))])
def test_small_perturbations_begin_to_grow_where_the_dynamic_stiffness_says(omega, guess, rates):
    omega, edge = edge_of_stability(omega, guess)
    growth = [growth_after_a_small_perturbation(rate, 1j * omega).real for rate in rates]
    seen = rates[0] - growth[0] * (rates[1] - rates[0]) / (growth[1] - growth[0])
    assert growth[0] * growth[1] < 0
    assert seen == pytest.approx(edge, rel=0.005)


@pytest.mark.parametrize("omega", [0.5, 2.15, 5.0])
def test_oscillating_the_density_gives_the_dynamic_stiffness(omega):
    u, amplitude, per = 1.5, 1e-3, 32
    density, settled = density_at_rest(), 8.0
    advance(density, pulling(u), RIGID, 1.0, [settled])
    t = np.arange(4 * per + 1) * 2 * np.pi / omega / per
    velocity = u + amplitude * omega * np.cos(omega * t)  # linear between the knots
    way = density[0][1] + np.r_[0.0, np.cumsum(0.5 * np.diff(t) * (velocity[1:] + velocity[:-1]))]
    pieces = zip(settled + t[:-1], way[:-1], velocity[:-1], np.diff(velocity) / np.diff(t), strict=True)
    run = [
        advance(density, Quadratic(*piece), RIGID, 1.0, [settled + end])
        for piece, end in zip(pieces, t[1:], strict=True)
    ]
    run = np.vstack(run)[2 * per :]
    t = t[2 * per + 1 :]
    waves = np.column_stack([np.sin(omega * t), np.cos(omega * t), np.ones(t.size), t])
    force, shaken = (np.linalg.lstsq(waves, part, rcond=None)[0] for part in (run[:, 3], run[:, 0]))
    kappa = dynamic_stiffness(u, ONE, np.array([1j * omega]))[0]
    assert abs((force[0] + 1j * force[1]) / (shaken[0] + 1j * shaken[1]) - kappa) < 0.002 + 0.005 * abs(kappa)


# ---------------------------------------------------------------- newborns dragged along: Fig. 11


@pytest.mark.eq(7)
@pytest.mark.parametrize(
    ("velocity", "stiffness"),
    [pytest.param(0.1, 3.306, marks=pytest.mark.slow), (0.3, 2.257), (0.5, 0.919), (0.8, 0.112)],
)
def test_effective_stiffness_of_fig_11(velocity, stiffness):
    way, force = pull_newborns(velocity, ONE, 1.5, 400)
    assert np.max(-np.gradient(force, way)[2:]) == pytest.approx(stiffness, rel=0.01)


def test_newborns_dragged_along_agree_with_contacts():
    velocity, n, rng = 0.5, 40_000, np.random.default_rng(12)
    way, force = pull_newborns(velocity, ONE, 1.5, 300)
    course = Course(pulling(velocity), RIGID, way[19::20] / velocity, 0.01, np.inf)
    contacts = Contacts(np.zeros(n), np.zeros(n), np.full(n, -np.inf))
    run = advance_contacts(np.zeros(4), contacts, course, ONE, NONE, rng)
    # A contact's stretching scatters by less than 0.5.
    assert np.all(np.abs(run[:, 3] - force[19::20]) < 4 * 0.5 / sqrt(n) + 0.002)


# ---------------------------------------------------------------- the paper's closure


def test_the_closure_at_low_speed_is_that_of_an_exponential_life():
    # <exp(-T)> and <exp(-2T)> over an exponential time: thresholds 1 - exp(-T) plus the Gaussian noise.
    u = 0.01
    gamma = 1 / (1 - u)
    mean = 1 / (1 + gamma * u)
    first, second = 1 - mean, gamma * u / (gamma * u + 2)
    square = 1 - 2 * first + second + STD**2 * (1 - second)
    force = closure_friction(np.array([u]), ONE, 40.0)[0]
    assert force == pytest.approx(square / (2 * mean), rel=1e-3)


@pytest.mark.eq(18)
def test_the_closure_in_time_ends_in_its_steady_state():
    velocity = 0.5
    edges = threshold_edges(ONE, 20.0)
    thresholds = np.diff([0.5 * (1 + erf((e - 1.0) / STD / sqrt(2))) for e in edges])
    thresholds /= thresholds.sum()
    steady, end = closure_friction(np.array([velocity]), ONE)[0], 40.0
    errors = []
    for reach in (0.01, 0.005):
        cohorts, state, p = ClosureCohorts(np.zeros(1000), np.zeros(1000)), np.zeros(5), thresholds.copy()
        cohorts.weight[0], state[4] = 1.0, 1
        course = Course(pulling(velocity), RIGID, np.array([0.9 * end, end]), 0.02, reach)
        run = advance_closure(state, cohorts, Thresholds(edges, p), course, ONE)
        assert np.all(np.abs(run[:, 4] - 1) < 1e-12)
        assert abs(p.sum() - 1) < 1e-10
        assert p.min() >= 0.0
        errors.append(run[-1, 3] / steady - 1)
    assert abs(errors[1]) < 0.005
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.25)  # first order in the step


# ---------------------------------------------------------------- thresholds that grow with age


def of_growing(ageing, velocity, delay=0.0):
    """Friction of contacts whose thresholds grow, by their lives."""
    thresholds = ss.Gaussian(mean=1.0, std=STD)
    return ss.kinetic_friction(ss.Interface(thresholds=thresholds, ageing=ageing, delay=ss.Delay(delay)), velocity)


def test_growth_too_slow_for_the_slider_carries_nothing():
    assert of_growing(ss.ExponentialGrowth(rate=1.0), 3.0) == 0.0
    assert of_growing(ss.ExponentialGrowth(rate=1.0), 3.0, delay=0.2) == 0.0


def test_a_logarithmic_threshold_that_does_not_grow_has_the_friction_of_the_renewal():
    # <x_s^2>/(2 <x_s>)
    assert of_growing(ss.LogarithmicGrowth(slope=0.0, time=1.0), 0.7) == pytest.approx((1 + STD**2) / 2, rel=1e-5)

"""From a trace to a rig: picking, statistics, inference, rigs and refusals."""

import json
import math
import operator
import pickle
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from drawn import assert_drawn, assert_kept
from refusals import refused

import stickslip as ss
from stickslip import cli, fitting
from stickslip.advise.budget import Budget
from stickslip.fitting.bench import half_speed_of, measured_velocity, strengthening_of
from stickslip.fitting.inference import infer
from stickslip.fitting.model import KEYS, Prior, sampled, simulate
from stickslip.fitting.rigs import remade
from stickslip.fitting.series_table import Observation, Recording, folder_of, table
from stickslip.fitting.summary import FITTED, NAMES, resampled, statistics
from stickslip.rate_state.fitting import Estimate

BENCH = Path(__file__).parent / "data" / "guldstrand_force7.txt"
TRUTH = (20.0, 0.25, 0.5, 0.05, 0.2, 0.1)
NARROW = Prior(contacts=(8.0, 50.0), threshold_std=(0.05, 0.5))
NARROW = replace(NARROW, sliding_force=(0.2, 0.8), stiffness_ratio=(0.01, 0.3))


def saw(peaks, troughs, *, samples=50.0, noise=0.0, seed=0):
    """A trace of slips of about 10 N, with `samples` from slip to slip on average."""
    peaks, troughs = 10.0 * peaks / peaks.mean(), 10.0 * troughs / peaks.mean()
    step = 2.0 * (peaks[1:] - troughs[:-1]).mean() / samples
    return sampled(peaks, troughs, 0.5, step, 10.0 * noise, np.random.default_rng(seed))


def bench(truth=TRUTH, count=120, seed=1, **how):
    return saw(*simulate(np.array(truth), count, np.random.default_rng(seed)), **how)


@pytest.fixture(scope="module", autouse=True)
def _cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STICKSLIP_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module")
def found():
    """A fit with a small table of simulations, over a narrow prior."""
    known = {"stiffness": "100 N/m", "mass": "0.4 kg", "load": "20 N"}
    return ss.fit(bench(noise=0.002), prior=NARROW, draws=1500, known=known)


# ------------------------------------------------------------------------------ picking


def force7(**how):
    return fitting.pick_events(ss.read_trace(BENCH, step=0.25), **how)


@pytest.mark.parametrize("smallest", [None, 0.15, 0.3])
def test_the_slips_of_a_measured_trace(smallest):
    events = force7(after=45, minimum_drop=smallest)
    found = dict(zip(NAMES, events.statistics, strict=True))
    for value, expected, error in (
        (len(events), 167, 2),
        (events.mean_peak, 11.82, 0.03),
        (events.drops.mean(), 3.10, 0.04),
        (events.drops.std() / events.drops.mean(), 0.42, 0.015),
        (events.recurrence, 6.08, 0.05),
        (events.drift, 1.45, 0.08),
        (events.sawtooth, 10.7, 0.5),
        # after removing the drift, which hides them
        (found["corr(peak, trough)"], -0.60, 0.05),
        (found["corr(trough, next peak)"], 0.26, 0.04),
    ):
        assert value == pytest.approx(expected, abs=error)
    assert "1.44 times that in the first" in " ".join(fitting.check(force7()))


@pytest.mark.parametrize("samples", [24, 50, 200])
@pytest.mark.parametrize("noise", [0.0, 0.003, 0.01])
def test_the_count_of_slips_at_other_samplings_and_noise(samples, noise):
    peaks, troughs = simulate(np.array(TRUTH), 168, np.random.default_rng(3))
    trace = saw(peaks, troughs, samples=samples, noise=noise)
    large = peaks - troughs > 0.1 * peaks.mean()
    events = fitting.pick_events(trace, minimum_drop=1.0)
    # the first is left out, and the trace ends with the last
    assert abs(len(events) - (large.sum() - 2)) <= 1


# ----------------------------------------------------------------- what must be refused


def trace_of(force):
    time = {"time": 0.01 * np.arange(len(force))}
    return xr.Dataset({"spring_force": ("time", force)}, time)


@pytest.mark.parametrize("of_the_slider", [False, True])
def test_a_measured_velocity_is_that_of_the_drive(of_the_slider):
    """The drive moves at .1 mm/s on a spring of 2 N/mm, measured in mm/s with noise."""
    t = 0.01 * np.arange(20_000)
    force = 10.0 + 2.0 * 0.1 * np.interp(t % 1.5, [0.0, 1.2, 1.5], [0.0, 1.2, 0.0])
    speed = 0.1 + RNG(2).normal(0.0, 0.01, t.size)
    if of_the_slider:
        speed -= np.gradient(force, t) / 2.0
    trace = trace_of(force).assign(measured_velocity=("time", speed, {"units": "mm/s"}))
    value, error = measured_velocity(trace, slips=133)["velocity"]
    assert abs(value - 1e-4) < 3.0 * error < 3e-6
    assert measured_velocity(trace_of(force), slips=133) == {}
    trace["measured_velocity"].attrs["units"] = "rad/s"
    assert measured_velocity(trace, slips=133) == {}


RNG = np.random.default_rng
PEAKS, TROUGHS = simulate(np.array(TRUTH), 120, RNG(1))
SINE = 10.0 + np.sin(0.06 * np.arange(20_000))
SLOW_AND_FAST = [
    saw(PEAKS[:60], TROUGHS[:60], samples=120),
    saw(PEAKS[60:], TROUGHS[60:], samples=30),
]
OTHER = simulate(np.array([8.0, 0.05, 0.8, 0.05, 0.2, 0.1]), 60, RNG(1))
NOT_STICK_SLIP = (
    lambda: trace_of(SINE),
    "rises for 1 times as long as it drops: an oscillation or noise, not stick-slip",
    lambda: trace_of(10 + 0.2 * RNG(0).normal(size=20_000)),
    "cannot be distinguished from noise",
    lambda: trace_of(100.0 + 0.1 * np.cumsum(RNG(0).normal(size=20_000))),
    "slip count depends on",
    lambda: trace_of(
        np.concatenate([part["spring_force"].values for part in SLOW_AND_FAST])
    ),
    "loading rate changes 4",
    lambda: saw(np.append(PEAKS[:60], OTHER[0]), np.append(TROUGHS[:60], OTHER[1])),
    "halves of the trace differ",
    lambda: bench(count=25),
    "slips: at least 30",
    lambda: bench(samples=8),
    "samples from slip to slip",
    lambda: bench(noise=0.05),
    "of the peak force: at most 3 %",
    lambda: with_column(filled=lambda t: np.abs(np.arange(t.size) - 1000.5) < 3),
    "6 samples in a row",
    lambda: with_column(load=lambda t: np.linspace(20.0, 24.0, t.size)),
    "normal load changes by",
    lambda: bench(noise=0.002).map(
        lambda F: F.clip(max=float(F.quantile(0.97)), keep_attrs=True)
    ),
    "fit: the tops of the force are flat",
    lambda: trace_of(np.full(1000, 5.0)),
    "0 drops",
)


def with_column(**made):
    trace = bench()
    return trace.assign({n: ("time", column(trace.time)) for n, column in made.items()})


@refused(*NOT_STICK_SLIP)
def test_what_is_refused(call, message):
    with pytest.raises(ss.InputError, match=message) as error:
        ss.fit(call(), draws=100)
    assert "\n" not in str(error.value)


@pytest.mark.slow
def test_a_long_trace_is_fitted_in_stretches():
    """Each stretch is compared with series of its length; the fits are averaged."""
    trace = fitting.pick_events(bench(count=340, noise=0.002))
    middle = len(trace) // 2
    halves = [trace.part(begin, begin + middle) for begin in (0, middle)]
    mean = np.mean([half.statistics for half in halves], axis=0)
    np.testing.assert_allclose(trace.statistics, mean, rtol=1e-12)
    found = ss.fit(trace, prior=NARROW, draws=1500)
    assert f"{len(trace)} slips are fitted in 2 stretches" in str(found)
    for key, truth in zip(KEYS, TRUTH, strict=True):
        assert found[key].low < truth < found[key].high


# ------------------------------------------------------------------ simulator and table


def test_contacts_all_alike_without_scatter_give_equal_slips():
    """Without scatter the overshoot alone determines the drop."""
    stiffness = 0.5
    ratio = 0.2
    residual = 0.4
    rig = np.array([1, 0.0, residual, stiffness, ratio, 0.0])
    peaks, troughs = simulate(rig, 30, np.random.default_rng(0))
    overshoot = np.exp(-np.pi * ratio / np.sqrt(1 - ratio**2))
    # force of the spring where the slider stops
    stopped = residual - overshoot * (1.0 - residual)
    # once contacts have re-attached, it rings down there
    settled = (stiffness * residual + stopped) / (1.0 + stiffness)
    np.testing.assert_allclose(peaks, 1.0, rtol=1e-12)
    np.testing.assert_allclose(troughs, settled, rtol=1e-9)


def test_a_table_is_kept_resumed_and_the_same_on_any_number_of_cores():
    prior = Prior(contacts=(5.0, 12.0))
    steps = []
    first = table(prior=prior, draws=700, slips=40, progress=steps.append)
    assert steps[-1] == 1.0
    place = folder_of(prior, 40, 0)
    (place / "1.npz").write_bytes((place / "1.npz").read_bytes()[:100])  # damaged
    (place / "2.npz").unlink()
    with ThreadPoolExecutor(1) as pool:
        how = {"executor": pool, "progress": steps.append}
        again = table(prior=prior, draws=700, slips=40, **how)
    assert len(steps) == 3 + 2
    np.testing.assert_array_equal(first.peaks, again.peaks)
    assert len(table(prior=prior, draws=500, slips=40)) == 500
    assert folder_of(prior, 41, 0) != place


def seen_of(observation, peaks, troughs, **how):
    """Statistics of one series of slips as recorded on a bench."""
    slips = {"count": np.array([peaks.size]), "peaks": peaks[None]}
    slips["troughs"] = troughs[None]
    one = ss.fitting.SeriesTable(prior=Prior(), parts=np.empty((1, 6)), **slips)
    return observation.sample(one, **how)[0][0]


def test_the_observation_biases_simulations_as_it_does_traces():
    """Statistics of a trace are those of its slips as recorded, not of the true."""
    rig = np.array([20, 0.2, 0.6, 0.3, 0.3, 0.15])
    peaks, troughs = simulate(rig, 400, np.random.default_rng(5))
    events = fitting.pick_events(saw(peaks, troughs, samples=24, noise=0.004))
    seen = seen_of(Observation.of(events), peaks, troughs)
    error = resampled(events.peaks, events.troughs).std(axis=0)
    away = np.abs(seen - events.statistics)[: len(FITTED)] / error[: len(FITTED)]
    assert np.all(away < 0.7)
    bare = np.abs(statistics(peaks, troughs) - events.statistics) / error
    bare = bare[: len(FITTED)]
    assert bare.max() > away.max()


def test_what_is_known_holds_for_the_draws():
    made = table(prior=NARROW, draws=1500, slips=60)
    error = 0.02
    sampling = Recording(slope=0.01, noise=0.0, resolution=0.0, drop=0.01, rise=0.01)
    ideal = Observation(slips=25, sampling=sampling)
    peaks, troughs = simulate(np.array(TRUTH), 60, np.random.default_rng(3))
    observed = seen_of(ideal, peaks, troughs, seed=1)

    def likelihood(values):
        """A case in which the sliding friction is known to be a half."""
        return np.exp(-0.5 * ((values[..., 2] - 0.5) / error) ** 2)

    sample = infer(made, ideal, observed, likelihood=likelihood, nearest=40)
    values = made.prior.values(sample.parts)[:, 2]
    assert sample.weights.sum() == pytest.approx(1.0)
    # Twice its error: the regression adjusts the draws by their statistics.
    assert math.sqrt(float(sample.weights @ (values - 0.5) ** 2)) < 2.0 * error


def test_block_bootstrap_errors_are_those_of_repeated_series():
    seeds = map(np.random.default_rng, range(40))
    series = [simulate(np.array(TRUTH), 150, rng) for rng in seeds]
    spread = np.std([statistics(*one) for one in series], axis=0)[:7]
    each = [resampled(*one, seed=1).std(axis=0) for one in series[:10]]
    errors = np.mean(each, axis=0)[:7]
    assert np.all((errors > 0.5 * spread) & (errors < 2.0 * spread))


# --------------------------------------------------------------------------------- fits


def test_a_fit_holds_the_truth(found):
    low, high = np.quantile(found.prior.parts(found.values), (0.02, 0.98), axis=0)
    parts = found.prior.parts(np.array(TRUTH))
    assert np.sum((low <= parts) & (parts <= high)) >= 5
    strength = found["contact_strength"]
    peaks, _ = simulate(np.array(TRUTH), 120, RNG(1))
    assert strength.low < 10.0 / peaks.mean() < strength.high
    assert min(found.p_values[name] for name in FITTED) > 0.02
    assert found["friction_coefficient"].median == pytest.approx(10.0 / 20.0, rel=0.05)
    assert set(json.loads(json.dumps(found.to_dict()))["parameters"]) == set(KEYS)


def test_quantities_go_as_far_as_what_is_known(found):
    bare = replace(found, known={})
    heavy = replace(found, known=found.known | {"mass": (1000.0, 20.0)})
    names = ["contact_strength", "static_friction", "sliding_friction"]
    assert [one.key for one in bare.quantities] == names
    for ask, why in (
        (lambda: bare["breaking_displacement"], "stiffness"),
        (lambda: bare["frequency"], "mass"),
        (lambda: bare["friction_coefficient"], "load"),
        (lambda: found["delay"], "several speeds"),
        (bare.rig, "give stiffness"),
        # slower than the slips
        (heavy.rig, "no rig is written: runs of .* draws all miss"),
    ):
        with pytest.raises(ss.InputError, match=why):
            ask()


@pytest.mark.slow
def test_speed_and_stiffness_tell_how_stiff_the_interface_is():
    trace = bench(noise=0.002, seed=4)
    rate = fitting.pick_events(trace).loading_rate
    K = 100.0
    speed = rate * (1.0 + 0.25) / K
    # Of series that would not be refused such a stiff spring is rare: more draws.
    known = {"stiffness": K, "velocity": (speed, 0.02 * speed)}
    found = ss.fit(trace, prior=NARROW, draws=4000, known=known)
    assert found["stiffness_ratio"].median == pytest.approx(0.25, abs=0.06)
    known["velocity"] = 0.5 * speed
    message = "cannot rise faster than stiffness times velocity"
    with pytest.raises(ss.InputError, match=message):
        ss.fit(trace, prior=NARROW, draws=1500, known=known)


def test_a_fitted_rig_file_reads_back_with_its_draws(found, tmp_path):
    rig = found.rig(name="bench")
    path = tmp_path / "rig.toml"
    path.write_text(ss.io.to_toml(rig))
    again = ss.read_rig(path)
    assert (again, again.fitted) == (rig, rig.fitted)
    assert "interface.delay" in again.assumed
    assert "mass" not in str(again.fitted)  # the mass was given, like the stiffness
    drawn = [*fitting.rigs_drawn(again)]
    assert [each.value("stiffness") for each in drawn] == pytest.approx([100.0] * 100)
    heavier = again.with_values(mass=2.0 * again.value("mass"))
    assert len([*fitting.rigs_drawn(heavier)]) == 100
    draws = again.fitted["interface.breaking_displacement"].draws
    assert [each.unit("x_s") for each in drawn] == pytest.approx(list(draws), rel=1e-7)


@pytest.mark.slow
def test_a_fitted_rig_is_judged_over_its_draws(found):
    """By runs, as contacts re-attach on arrest; the fitted trace was stick-slip."""
    doubt = ss.advise.Doubt.of(found.rig(), Budget(math.inf))
    assert doubt.draws == 64
    assert doubt.oscillates > 0.9
    assert "of 64 draws of the fit" in str(doubt)


def test_the_rig_holds_what_was_fitted_and_makes_its_trace(found):
    """With other contacts than those it was chosen with: within the errors of the two
    means (99 %), and a tenth for the choice.
    """
    rig = found.rig()
    assert "its own run drops" in rig.source
    assert rig.source.endswith("; lasts in 8 of 8 runs")
    residual = rig.interface.newborn.mean
    assert rig.interface.sliding_force == pytest.approx(residual, rel=1e-12)
    away = np.abs(found.values[:, 2] / residual - 1.0)
    away += np.abs(found.strength / rig.unit("f_s") - 1.0)
    i = int(np.argmin(away))
    # for a spring of 100 N/m
    assert rig.unit("k") == pytest.approx(100.0 / found.values[i, 3], rel=1e-3)
    other = rig.replace(method=ss.Contacts(rig.method.count, seed=2))
    made = remade(other, found.events, found.known)
    periods = np.diff(made.time[made.peak_at])
    for one, other in (
        (made.drops, found.events.drops),
        (periods, found.events.recurrence),
    ):
        mean = np.mean(other)
        error = 2.6 * one.std() / math.sqrt(one.size) + 0.1 * mean
        assert one.mean() == pytest.approx(mean, abs=error)


def test_speeds_add_the_delay_and_holds_ageing():
    half = 0.01
    speeds = np.geomspace(1e-4, 1.0, 9)
    forces = 4.0 + 6.0 / (1.0 + speeds / half)
    given = {"prior": NARROW, "draws": 1500, "known": {"stiffness": 100.0}}
    holds = tuple((t, 10.0 + 0.3 * np.log10(t)) for t in (1.0, 10.0, 100.0, 1000.0))
    pairs = tuple(zip(speeds.tolist(), forces.tolist(), strict=True))
    found = ss.fit(bench(noise=0.002), **given, speeds=pairs, holds=holds)
    margin = found.draws("delay") * half
    assert np.all((margin > 0) & (margin < 2.0 * found.draws("breaking_displacement")))
    assert found.delays.value == pytest.approx(half, rel=1e-6)
    assert found.strengthening.value == pytest.approx(0.03, abs=1e-6)
    with pytest.raises(ss.InputError, match="speeds: 3 are different; at least 4 are"):
        ss.fit(bench(), **given, speeds=[*pairs[:3], pairs[0]])
    assert "changes by (3 ± " in found.strengthening.words
    assert "contacts age" in str(found)
    close, _ = half_speed_of(speeds, np.random.default_rng(0).normal(forces, 0.2))
    assert abs(math.log(close / half)) < 3.0 * close.error / close < 1.0
    with pytest.raises(ss.InputError, match="does not show at which speed it halves"):
        half_speed_of(speeds, forces[::-1])
    with pytest.raises(ss.InputError, match="at least 3"):
        strengthening_of(((1.0, 10.0), ("10 s", "11 N")))


def test_pictures(found):
    assert_drawn(found.events.plot(), "slips")
    assert_drawn(found.plot(), "fit")
    assert_kept(str(found), "fit_told")


def test_the_quick_recipe_inverts_the_closed_forms():
    truth = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.2), delay=ss.Delay(0.5))
    strength = 100.0
    x_s = 1e-4
    K = 5e5
    speed = 1e-3
    at_once = replace(truth, delay=ss.Delay(0.0))
    readings = {
        "static_friction": strength * ss.static_friction(truth)[0],
        "kinetic_friction": strength * ss.kinetic_friction(at_once, velocity=1.0),
        "loading_rate": K * speed / (1.0 + K * x_s / strength),
        "half_speed": x_s / (0.5 * x_s / speed),  # the margin over the delay
    } | {"stiffness": K, "speed": speed, "mass": "0.1 kg"}
    rig = ss.quick_fit(**readings)
    assert rig.unit("f_s") == pytest.approx(strength, rel=2e-3)
    assert rig.unit("x_s") == pytest.approx(x_s, rel=5e-3)
    assert rig.interface.thresholds.std == pytest.approx(0.2, abs=2e-3)
    assert rig.interface.delay.time == pytest.approx(0.5, rel=5e-3)
    with pytest.raises(ss.InputError, match="must be at least 1 % more"):
        ss.quick_fit(**readings | {"loading_rate": K * speed})


def test_what_was_given_has_the_error_that_it_was_given_with(found):
    known = {"stiffness": (100.0, 10.0), "mass": (0.4, 0.0), "load": (20.0, 2.0)}
    given = replace(found, known=known)
    errors = {"frequency": 0.05, "speed": 0.1, "friction_coefficient": 0.1}
    for name, error in errors.items():
        assert np.log(given.draws(name)).std() == pytest.approx(error, rel=0.3)


@pytest.mark.parametrize(("unit", "size"), [("kN", 1000.0), ("mN", 1e-3), ("1", 20.0)])
def test_quantities_are_in_newtons_whatever_the_trace_is_in(found, unit, size):
    exact = {name: (value, 0.0) for name, (value, _) in found.known.items()}
    one = replace(found, known=exact)
    # the strength as a coefficient of friction, under 20 N
    other = replace(one, events=replace(found.events, force_unit=unit))
    assert other.simulated()["spring_force"].units == unit
    forces = "contact_strength", "sliding_friction"
    for name in (*forces, "breaking_displacement", "speed", "friction_coefficient"):
        np.testing.assert_allclose(other.draws(name), size * one.draws(name))
    sliding = found.strength * found.draws("sliding_force")
    np.testing.assert_allclose(one.draws("sliding_friction"), sliding)
    at_once = found.strength / (100.0 / found.draws("stiffness_ratio"))  # of 100 N/m
    np.testing.assert_allclose(one.draws("breaking_displacement"), at_once)


def test_holds_without_ageing_seldom_seem_to_age():
    """One degree of freedom: 2.5 % lie above the 97.5 % quantile of Student's t."""
    drawn = RNG(0).normal(10.0, 0.1, (1000, 3)).tolist()
    series = (tuple(zip((1.0, 10.0, 100.0), row, strict=True)) for row in drawn)
    words = [strengthening_of(holds).words for holds in series]
    assert sum(each.endswith("age") for each in words) == pytest.approx(25, abs=15)


SPEEDS = (0.002, 11.0), (0.003, 10.0)


@pytest.mark.parametrize(
    ("text", "pairs"),
    [
        ("speed [m/s], force [N]\n0.002,11\n0.003, 10\n", SPEEDS),
        ("v (mm/s);F (mN)\n2,0;11000\n3,0;10000\n", SPEEDS),
        ("0.002 11\n0.003 10\n", SPEEDS),
        ("speed (s)  force (N)\n0.002 11\n0.003 10\n", None),
        ("0.002\n0.003\n", None),
    ],
)
def test_speeds_in_a_file(tmp_path, text, pairs):
    (path := tmp_path / "speeds.txt").write_text(text)
    if pairs:
        np.testing.assert_allclose(fitting.bench.read_pairs(path, "m/s"), pairs)
    else:
        message = "needs two columns of numbers, in m/s and N; there are"
        with pytest.raises(ss.InputError, match=rf"speeds\.txt: {message}"):
            fitting.bench.read_pairs(path, "m/s")


@pytest.mark.parametrize("number", [3, 3.0, -3, 0.5, np.float64(3.0), np.int64(-2)])
def test_an_estimate_keeps_its_error_through_arithmetic_with_numbers(number):
    one = Estimate(4.0, 0.2)
    x = float(number)
    for found, value, error in (
        (one * number, 4.0 * x, 0.2 * abs(x)),
        (number * one, 4.0 * x, 0.2 * abs(x)),
        (one / number, 4.0 / x, 0.2 / abs(x)),
        (number / one, x / 4.0, 0.2 * abs(x) / 16.0),
        (one + number, 4.0 + x, 0.2),
        (number + one, 4.0 + x, 0.2),
        (one - number, 4.0 - x, 0.2),
        (number - one, x - 4.0, 0.2),
        (-one, -4.0, 0.2),
        (abs(-one), 4.0, 0.2),
        (one**number, 4.0**x, 0.2 * abs(x * 4.0 ** (x - 1.0))),
        (abs(number) ** one, abs(x) ** 4.0, 0.2 * abs(x) ** 4 * abs(np.log(abs(x)))),
        (round(one), 4.0, 0.2),
        (pickle.loads(pickle.dumps(one)), 4.0, 0.2),
    ):
        assert isinstance(found, Estimate)
        assert (found, found.error) == (pytest.approx(value), pytest.approx(error))
    for whole in (operator.floordiv, operator.mod, divmod):
        for pair in ((one, number), (number, one)):
            with pytest.raises(TypeError, match=r"use float\(...\)"):
                whole(*pair)
    # the error of two would need their covariance: a plain number, not a wrong error
    assert not isinstance(one - one, Estimate)
    assert not isinstance(one * one, Estimate)
    assert not isinstance(one**one, Estimate)
    assert (np.ones(2) * one).tolist() == (one * np.ones(2)).tolist() == [4.0, 4.0]


def test_a_torque_is_no_force_to_fit():
    events = replace(force7(after=45), force_unit="Nm")
    with pytest.raises(ss.InputError, match="is in Nm, which is no unit of force"):
        fitting.force_unit_in_newtons(events, {})


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--minimum-drop", "5 kN"), r"fit: 0 drops of at least 5e\+06"),
        (("--minimum-drop", "7"), r"fit: 0 drops of at least 7e\+03"),
        (("--after", "1.99 min"), r"2 samples of spring_force are too few"),
        (("--after", "5 mm"), r"--after: '5 mm'"),
        (("--minimum-drop", "5 s"), r"--minimum-drop: '5 s'"),
        (("--smallest", "3"), r"--smallest: is called --minimum-drop now"),
        (("--speed=3 mm/s",), r"--speed: is called --velocity now"),
        (("--velocity", "3 s"), r"known\.velocity = '3 s'"),
    ],
)
def test_a_fit_takes_the_options_of_a_reading(options, words, tmp_path, capsys):
    file = tmp_path / "saw.csv"
    saw = np.tile(np.linspace(1000.0, 1100.0, 10), 48)
    file.write_text("force (mN)\n" + "\n".join(map(str, saw)))
    assert cli.main(["fit", str(file), "--step", "250 ms", *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert re.search(words, line), line

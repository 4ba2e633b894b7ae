"""Rate-and-state fits of whole records: steps and holds found in the displacement."""

import json

import numpy as np
import pytest
import xarray as xr

import stickslip as ss
from stickslip.cli import main
from stickslip.errors import InputError, UndecidedError
from stickslip.rate_state import RateAndState, fit_rate_and_state, fit_record
from stickslip.rate_state.experiments import Record

ROCK = RateAndState(law="ageing", a=0.008, b=0.011, distance=12.0)
BEGINS = (0.0, 150.0, 230.0, 360.0)
SPEEDS = (3.0, 10.0, 3.0, 10.0)
UNTIL = 420.0


def record_of(
    begins,
    speeds,
    until,
    *,
    seed=0,
    rock=ROCK,
    stiffness=0.01,
    noise=2e-4,
    jitter=0.05,
    trend=0.0,
):
    """A record every 0.1 s of the friction of a spring-slider and its load point."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, until, 0.1)
    pull = np.array(speeds)[np.searchsorted(begins, time + 1e-9, side="right") - 1]
    place = np.append(0.0, np.cumsum(0.1 * pull[:-1]))
    friction = 0.6 + rock.slide(time, pull, stiffness=stiffness)[0] + trend * place
    friction = friction + rng.normal(0.0, noise, time.size)
    read = place + rng.normal(0.0, jitter, time.size)
    variables = {"mu": ("time", friction)}
    variables["measured_displacement"] = ("time", read, {"units": "um"})
    return xr.Dataset(variables, {"time": ("time", time, {"units": "s"})})


def steps_of(seed=0, **how):
    return record_of(BEGINS, SPEEDS, UNTIL, seed=seed, **how)


def pulls(fit, rock=ROCK):
    """Return by how many of their errors the estimates deviate."""
    found = fit.a, fit.b, fit.distance, fit.a_minus_b
    true = rock.a, rock.b, rock.distance, rock.a - rock.b
    pairs = zip(found, true, strict=True)
    return [(value - known) / value.error for value, known in pairs]


SLIP = RateAndState(law="slip", a=0.01, b=0.008, distance=7.0)
KINDS = {
    "ageing": {},
    "slip, with a trend": {"rock": SLIP, "trend": 2e-6},
    "noisy displacement": {"jitter": 1.0},
    "rigid": {"stiffness": 30.0},
}


@pytest.mark.takes(4)  # three steps by two laws, with and without a trend
@pytest.mark.parametrize("how", KINDS.values(), ids=KINDS)
def test_all_steps_of_a_record_are_found_and_fitted(how):
    found = fit_record(steps_of(5, **how))
    rock = how.get("rock", ROCK)
    assert found.law == rock.law
    assert not found.refused
    before = [fit.step.before for fit in found.steps]
    assert before == pytest.approx(SPEEDS[:-1], rel=1e-3)
    for fit, time in zip(found.steps, BEGINS[1:], strict=True):
        assert abs(fit.at - time) < 4.0 * fit.at.error < 0.1
        assert np.all(np.abs(pulls(fit, rock)) < 4.0)
    values = [float(fit.a) for fit in found.steps]
    assert found.mean["a"] == pytest.approx(np.mean(values))
    assert found.mean["a"].error == pytest.approx(np.std(values, ddof=1))
    assert ("without a linear trend" in str(found)) >= ("trend" in how)


@pytest.mark.slow
def test_errors_of_the_steps_of_twenty_records_are_honest():
    found = (fit_record(steps_of(seed), law="ageing") for seed in range(20))
    off = np.array([pulls(fit) for record in found for fit in record.steps])
    assert off.shape == (60, 4)
    # 60 values of standard deviation 1: .13 for the mean, .09 for that deviation
    assert np.all(np.abs(off.mean(axis=0)) < 0.5)
    assert np.all(np.abs(off.std(axis=0) - 1.0) < 0.4)


@pytest.mark.parametrize("at", [90.0, 160.0, 189.0])
def test_a_time_that_is_a_minute_off_is_a_hint(at):
    found = fit_rate_and_state(steps_of(), at=at, law="ageing")
    assert abs(found.at - 150.0) < 4.0 * found.at.error
    assert np.all(np.abs(pulls(found)) < 4.0)


def test_dates_become_seconds():
    data = steps_of()
    since = (1e9 * data["time"].values).astype("m8[ns]")
    dated = data.assign_coords(time=np.datetime64("2026-07-01") + since)
    found = fit_rate_and_state(dated, at=150.0, law="ageing")
    assert abs(found.at - 150.0) < 4.0 * found.at.error


@pytest.mark.slow
def test_a_wrong_time_without_a_displacement_is_refused_soon(monkeypatch):
    """The cost is counted in model curves, some 2 ms each."""
    curves = []
    slide = RateAndState.slide

    def counted(*given, **how):
        curves.append(1)
        return slide(*given, **how)

    monkeypatch.setattr(RateAndState, "slide", counted)
    trace = steps_of().drop_vars("measured_displacement")
    with pytest.raises(UndecidedError, match="not identified"):
        fit_rate_and_state(trace, at=90.0, before=3.0, after=10.0, law="ageing")
    assert len(curves) < 2500


@pytest.mark.parametrize(("unit", "size"), [("um/s", 1.0), ("rpm", 1.0 / 60.0)])
def test_the_steps_of_a_velocity_column_are_those_of_the_displacement(unit, size):
    data = steps_of(jitter=0.0)
    speed = np.gradient(data["measured_displacement"].values, data["time"].values)
    measured = ("time", speed, {"units": unit})
    data = data.drop_vars("measured_displacement").assign(measured_velocity=measured)
    found = fit_record(data, law="ageing")
    assert found.record.units[0] == ("um" if unit == "um/s" else "rev")
    for fit, time in zip(found.steps, BEGINS[1:], strict=True):
        assert abs(fit.at - time) < 0.1
        assert fit.distance == pytest.approx(size * ROCK.distance, rel=0.1)


HOLDS = (3.0, 10.0, 30.0, 100.0)


def holds_record(seed, **how):
    begins = [0.0]
    for hold in HOLDS:
        begins += [begins[-1] + 60.0, begins[-1] + 60.0 + hold]
    until = begins[-1] + 60.0
    speeds = (10.0, 0.0) * len(HOLDS) + (10.0,)
    return record_of(begins, speeds, until, seed=seed, **how)


def test_healing_in_the_holds_of_a_record():
    clean = holds_record(0, noise=0.0, jitter=0.0)["mu"]
    rests = np.cumsum([60.0 + hold for hold in HOLDS])
    peaks = [float(clean.sel(time=slice(t, t + 30.0)).max()) - 0.6 for t in rests]
    healing = np.polyfit(np.log10(HOLDS), peaks, 1)[0]
    off = []
    for seed in range(1, 6):
        found = fit_record(holds_record(seed, noise=5e-4))
        assert [one.hold for one in found.holds] == pytest.approx(HOLDS, abs=0.05)
        pairs = zip(found.holds, peaks, strict=True)
        off += [(one.peak - peak) / one.peak.error for one, peak in pairs]
        assert abs(found.healing - healing) < 4.0 * found.healing.error
    assert abs(np.mean(off)) < 1.0
    assert 0.5 < np.std(off) < 1.7


@pytest.mark.slow
def test_steps_by_decades_are_found_where_the_fast_ones_are_short():
    """Each piece covers one distance; the fastest lasts a hundredth of the slowest."""
    speeds = np.array([1.0, 0.1, 1.0, 10.0, 100.0, 10.0])
    time = np.append(0.0, np.cumsum(200.0 / speeds))
    t = np.arange(0.0, time[-1], 0.25)
    place = np.interp(t, time, 200.0 * np.arange(time.size))
    place += np.random.default_rng(2).normal(0.0, 0.05, t.size)
    values = {"mu": ("time", 0.0 * t), "measured_displacement": ("time", place)}
    steps = Record.of(xr.Dataset(values, coords={"time": t})).steps()
    assert [after.begin for _, after in steps] == pytest.approx(time[1:-1], abs=0.05)
    assert [after.velocity for _, after in steps] == pytest.approx(speeds[1:], rel=0.01)


def test_what_is_no_step_is_none():
    time = np.arange(0.0, 300.0, 0.1)
    rng = np.random.default_rng(1)
    place = 3.0 * time + 0.3 * np.sin(time / 5.0) + rng.normal(0.0, 0.1, time.size)
    trace = steps_of().isel(time=slice(0, time.size))
    message = r"shows no velocity step and no hold: .* is 3;"
    with pytest.raises(InputError, match=message):
        fit_record(trace.assign(measured_displacement=("time", place)))
    with pytest.raises(InputError, match="no displacement and no velocity"):
        fit_record(trace.drop_vars("measured_displacement"))


def test_swapped_velocities_are_told_by_the_displacement():
    with pytest.raises(InputError, match=r"swapped\? .* steps from 3 to 10"):
        fit_rate_and_state(steps_of(), at=150.0, before=10.0, after=3.0)


def test_a_step_that_is_not_identified_has_its_line():
    """The friction does not change at the second step of the velocity."""
    data = steps_of(3).sel(time=slice(0.0, 300.0))
    data["mu"] = data["mu"].where(data["time"] < 200.0, data["mu"].sel(time=200.0))
    found = fit_record(data, law="ageing")
    assert len(found.steps) == 1
    ((at, reason),) = found.refused
    assert at == pytest.approx(230.0, abs=0.1)
    assert f"step at {at:.7g}: {reason}" in str(found)


@pytest.mark.takes(3)
def test_the_command_prints_a_table_and_draws_it(tmp_path, capsys):
    begins = (0, 60, 63, 120, 130, 190, 220, 280)
    speeds = (10, 0, 10, 0, 10, 0, 10, 3)
    rows = record_of(begins, speeds, 400.0).to_dataframe()
    names = {"mu": "mu", "measured_displacement": "displacement (um)"}
    file = tmp_path / "rock.csv"
    rows.rename(columns=names).to_csv(file, index_label="time (s)")
    picture = tmp_path / "rock.png"
    asked = ["rsf", str(file), "--law", "ageing"]
    assert main([*asked, "--plot", str(picture)]) == 0
    assert picture.stat().st_size > 10_000
    told = capsys.readouterr().out
    assert "from (um/s)" in told
    assert "healing: " in told
    assert main([*asked, "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    found = fit_record(ss.read_trace(file), law="ageing")
    assert content == json.loads(json.dumps(found.to_dict()))
    assert [round(one["hold"]) for one in content["holds"]] == [3, 10, 30]
    assert content["steps"][-1]["distance_error"] > 0.0


def test_friction_that_curves_within_a_bin_biases_nothing():
    cut = {"at": 150.0, "span": (20.0, 240.0), "bins": 120}
    step = ss.rate_state.velocity_step_in(steps_of(noise=2e-5), **cut)
    assert np.all(np.abs(pulls(fit_rate_and_state(step, law="ageing"))) < 4.0)


def test_the_law_is_the_likelier_one_of_steps_that_both_identify():
    rock = RateAndState(law="slip", a=0.0042, b=0.001, distance=40.0)
    how = {"rock": rock, "noise": 4e-5, "stiffness": 0.0074, "seed": 2}
    found = fit_record(record_of((0, 240, 270), (2, 20, 200), 275, **how))
    assert (found.law, len(found.steps), len(found.refused)) == ("slip", 1, 1)

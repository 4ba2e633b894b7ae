"""Events, regime and transitions: of made-up forces, simulated runs and real traces."""

import json
import math
import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import reference
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused
from scipy.signal import lfilter

import stickslip as ss
from stickslip.measure import counted, drops, regime, regime_and_drops, statistics
from stickslip.measure.regimes import regime_of_run
from stickslip.measure.trace import Trace
from stickslip.simulation import record

TRACE = Path(__file__).parent / "data" / "guldstrand_force7.txt"
SMOOTH = "smooth sliding"
STICK_SLIP = "stick-slip"
SUSTAINED = "sustained oscillation"


# ----------------------------------------------------------------------- made-up forces


def trace(t, force, **more):
    """A Dataset with the force, and other given variables, along t."""
    variables = {"spring_force": ("time", force)}
    for name, value in more.items():
        variables[name] = ("time", np.broadcast_to(value, np.shape(t)))
    return xr.Dataset(variables, {"time": t})


def with_motion(t, force, *, stiffness=2.0, velocity=1.0):
    """The slider that goes with a force: X = v t - F/K."""
    X = velocity * t - force / stiffness
    motion = {"displacement": X, "velocity": np.gradient(X, t)}
    return trace(t, force, **motion, drive_velocity=velocity, attached=0.9)


def sawtooth(t, peaks, slips, *, fall=0.02, start=0.0):
    """Linear loading to each peak (time, force), then a fall by the slip."""
    times = [0.0]
    forces = [start]
    for (when, force), drop in zip(peaks, slips, strict=True):
        times += [when, when + fall]
        forces += [force, force - drop]
    return np.interp(t, times, forces)


def even_sawtooth(*, period=1.5, drop=0.7, cycles=12, step=0.01, fall=0.06, low=0.1):
    """A regular sawtooth that starts and ends on the way up."""
    t = np.arange(0.0, (cycles + 0.5) * period, step)
    when = period * np.arange(1, cycles + 1)
    peaks = [(w, low + drop) for w in when]
    force = sawtooth(t, peaks, np.full(cycles, drop), fall=fall, start=low)
    since = t - when[-1] - fall
    return t, np.where(since > 0.0, low + drop * since / (period - fall), force)


def bench(
    *, cycles=100, samples=26, noise=0.0, variation=0.05, ringing=0.0, slip=0.06, seed=1
):
    """A noisy sawtooth in N and s, with periods of about 1.5 s, and its drops."""
    rng = np.random.default_rng(seed)
    sizes = np.maximum(1.0 + variation * rng.normal(size=cycles), 0.4)
    when = np.cumsum(1.5 * sizes)
    lasts = 1.5 * slip
    t = np.arange(0.0, when[-1] + 0.7, 1.5 / samples)
    peaks = [(0.0, 5.0), *zip(when, 5.0 + sizes, strict=True), (when[-1] + 3.0, 7.0)]
    force = sawtooth(t, peaks[1:-1], sizes, fall=lasts, start=5.0)
    since = t - when[-1] - lasts
    force = np.where(since > 0.0, 5.0 + 2.0 * since / (3.0 - lasts), force)
    for w, size in zip(when, sizes, strict=True):
        since = np.maximum(t - w - lasts, 0.0)
        decay = np.exp(-since / (2.0 * lasts))
        force -= ringing * size * decay * np.sin(2.0 * np.pi * since / lasts)
    data = trace(t, force + noise * rng.normal(size=t.size))
    data["spring_force"].attrs["units"] = "N"
    data["time"].attrs["units"] = "s"
    return data, sizes


def wave(*, growth=0.0, size=0.2, mean=0.4):
    t = np.arange(0.0, 100.0, 0.01)
    size = size * np.exp(growth * (t - 100.0))
    return with_motion(t, mean + size * np.cos(5.0 * t), stiffness=5.0)


def white(size, *, std=1.0, seed=1):
    return std * np.random.default_rng(seed).normal(size=size)


def slow(size, *, memory=0.99, seed=5):
    """Correlated noise of unit variance."""
    return lfilter([math.sqrt(1 - memory**2)], [1.0, -memory], white(size, seed=seed))


def at(end, step, force):
    """A trace of the force alone."""
    t = np.arange(0.0, end, step)
    return trace(t, force(t))


def slips_of_a_second(t):
    return 2.0 + t % 1.0


def to_and_fro(each, *, displacement=False, rest=0.0):
    """Six strokes back and forth: each(s) is the force along a stroke of length 10."""
    s = np.minimum(np.linspace(0.0, 10.0 + rest, 2000, endpoint=False), 10.0)
    ways = [(-1) ** i * each(s) * np.minimum(s / 0.05, 1.0) for i in range(6)]
    force = np.concatenate(ways)
    way = np.concatenate([s if i % 2 == 0 else 10.0 - s for i in range(6)])
    more = {"measured_displacement": way} if displacement else {}
    return trace(np.arange(force.size) * 0.005, force, **more)


def stroke_of_slips(s):
    return 5.0 + np.minimum(2.0 * (s % 0.5), 19.0 * (0.5 - s % 0.5))


def soft_stroke(s):
    return np.where(s < 8.0, 1.25 * s - 5.0, 4.5 + s % 1.0)


def noisy_stroke(s):
    return 5.0 + white(s.size, std=0.02)


def paper(name):
    """Paper on paper, measured; an expert's values are in data/README.md."""
    file = TRACE.parent / "paper_on_paper" / f"{name}.csv.gz"
    return trace(*np.loadtxt(file, delimiter=",", skiprows=1).T)


def overshooting():
    """A soft spring: a slip overshoots the drive, and the slider swings back once."""
    t = np.arange(0.0, 720.0, 0.05)
    force = np.interp(t % 60.0, [0.0, 59.0, 59.5, 60.0], [0.0, 0.59, -0.45, 0.0])
    # Every second cycle is a little smaller, so that a rebound stays well below the
    # peak before.
    return with_motion(t, np.where(t % 120.0 < 60.0, 1.0, 0.6) * force, stiffness=0.01)


def driven(velocity):
    """A trace of slips whose drive does not move as they imply, but by a formula."""
    data = with_motion(*even_sawtooth(cycles=60))
    return data.assign(drive_velocity=formula(velocity)(data.time))


def changing(factor, about, rms, unit=1.0):
    """Slow noise that grows by a factor over 20 time units; the last 40 count."""
    t = np.arange(0.0, 100.0, 0.01)
    size = np.where(t < 55.0, 0.01, rms * factor ** ((t - about) / 20.0))
    force = unit * (0.45 + size * slow(t.size))
    return with_motion(t, force, stiffness=2.0 * unit, velocity=10.0)


def formula(text):
    """Return the function of the time t given as text."""
    return eval(f"lambda t: {text}", globals())


def alone(end, step, text, noise=0.0, seed=1):
    """A trace of the force alone, from a formula, with noise."""
    force = formula(text)
    return at(end, step, lambda t: force(t) + white(t.size, std=noise, seed=seed))


def of_contacts(count):
    """Slow noise of 3 %, like that of 300 contacts, and more than that of a million."""
    data = at(200.0, 0.01, lambda t: 5.0 + 0.15 * slow(t.size))
    return data.assign_attrs(contacts=count)


def tone(size, t):
    return size * np.sin(2.0 * np.pi * t)


def ramp_and_slips(t):
    return np.where(t < 12.0, t - 6.5, 5.5 + t % 1.0)


def stops(when, noise):
    return alone(40.0, 0.01, f"np.where(t < {when}, slips_of_a_second(t), 2.5)", noise)


def pauses(t):
    return np.where(abs(t - 27.5) < 7.5, 2.0, slips_of_a_second(t))


FORCES = {
    name: (force, kind, eval(f"dict({shows})"))
    for name, kind, shows, force in re.findall(
        r"^(\w.*): (.*?)(?: \| (.*))?\n {4}(.*)$",
        """
a sine that lasts: sustained oscillation | periodic=True, says="66.7 % of the largest"
    wave()
that grows: undecided | trend=1.49
    wave(growth=0.02)
that is small, and grows: undecided | grows=True
    wave(size=0.003, growth=0.02)
that decays slowly: undecided | grows=False
    wave(growth=-0.005, size=0.12)
that decays from much: undecided | says="a longer record would decide"
    alone(30.0, 0.01, "3 + tone(2, t) * np.exp(-t / 15)")
and for longer: smooth sliding
    alone(180.0, 0.01, "3 + tone(2, t) * np.exp(-t / 15)")
that decays, not small: undecided | grows=False
    wave(growth=-0.02, size=0.027, mean=0.1)
that decays, small: smooth sliding | grows=False
    wave(growth=-0.05, size=0.0013)
that is tiny: smooth sliding | says="1.49 %"
    wave(size=0.003)
sampled too rarely: undecided | says="record more often"
    wave().isel(time=slice(None, None, 40))
falls as it rises: sustained oscillation | says="oscillation, whatever stiffness"
    alone(40.0, 0.01, "3.0 + tone(0.5, t)", 0.01)
a beat: - | periodic=False
    alone(40.0, 0.01, "3.0 + tone(0.5, t) + tone(0.5, 1.1 * t)")
a tiny sine in noise: smooth sliding | says="1.59 %"
    alone(40.0, 0.01, "3 + tone(0.024, t)", 3e-3)
a small one, with a spark: sustained oscillation | periodic=True
    alone(40.0, 0.01, "3 + tone(0.036, t) + 900 * np.isclose(t, 20)", 3e-3)
noise as large: undecided | says="record more often"
    alone(100.0, 0.02, "5 + tone(0.1, t)", 0.1)
slips of 12 samples: undecided | says="record more often"
    bench(samples=12, noise=0.2)[0]
slips below noise: stick-slip | periodic=True
    alone(20.0, 0.01, "5.0 + 0.8 * (t / 2 % 1)", 0.2, 3)
slow noise: smooth sliding | normal=True
    alone(200.0, 0.01, "5.0 + 0.3 * slow(t.size)")
noise of 300 contacts: - | contacts=False
    of_contacts(300)
more than of a million: - | contacts=True
    of_contacts(1_000_000)
noise that grows: undecided | trend=5.0
    changing(5.0, 80.0, 0.01)
that decays to little: smooth sliding | grows=False
    changing(0.2, 70.0, 0.03)
a rise: undecided | says="stiffness and velocity"
    alone(100.0, 0.05, "0.1 * t")
in coarse steps: undecided | says="a finer record would decide"
    alone(60.0, 0.01, "0.4 * np.round(10 + slow(t.size) / 3)")
stuck all the time: undecided | says="a longer run would decide"
    with_motion(np.arange(0.0, 9.0, 0.01), np.arange(1.0, 19.0, 0.02))
a constant: undecided | says="sensor"
    alone(100.0, 0.05, "3.0 + 0 * t")
three slips: undecided | says="1 more, about"
    trace(*even_sawtooth(cycles=3))
few slips: stick-slip | periodic=True
    with_motion(*even_sawtooth())
creep between slips: stick-slip | periodic=True
    with_motion(*even_sawtooth(cycles=60))
a slip that overshoots: stick-slip | fast=True
    overshooting()
a drive that speeds up: undecided | says="transitions"
    driven("0.5 + t / 60.0")
that has sped up: stick-slip | begin=65.0
    driven("np.minimum(0.1 + t / 30, 1)")
that stands still: undecided | says="stands still"
    driven("0 * t")
slips on a drift: stick-slip | note="drifts by 6"
    alone(20.0, 0.01, "10 + 6 * t + 3 * (t / 0.5 % 1)")
through zero: stick-slip | note=""
    trace(*even_sawtooth(cycles=40, drop=2.0, low=-1.1))
saturated: stick-slip | note="flat at 5.7"
    bench(noise=0.01, samples=100)[0].clip(max=5.7)
in thirds of a drop: stick-slip | note=""
    (bench(samples=100)[0] * 3).round() / 3
mirrored: undecided | says="flip=True"
    6.0 - bench(samples=50, noise=0.02, slip=0.1, ringing=0.4)[0]
pulled backwards, off zero: stick-slip | drop=1.21
    4.8 - bench(samples=50, noise=0.02, slip=0.1, ringing=0.4)[0]
of either sign: - | says="133 % of the largest force"
    alone(9.0, 0.01, "-0.5 - tone(1.0, t)")
flipped: stick-slip
    (bench()[0] - 12.0).assign_attrs(flipped=1)
smooth strokes: smooth sliding | loop=(5.0, 0.0)
    to_and_fro(noisy_stroke, displacement=True)
strokes of slips: stick-slip | loop=(5.45, 0.0)
    to_and_fro(stroke_of_slips)
with rests: stick-slip | half_width=5.45
    to_and_fro(stroke_of_slips, displacement=True, rest=8.0)
strokes with peaks: smooth sliding | says="by all strokes together"
    to_and_fro(lambda s: 5 + 2 * np.exp(-s) + 0.02 * white(s.size))
strokes of one reading: undecided | says="recorded in steps of 0.2"
    to_and_fro(lambda s: np.minimum(np.round(s * 5), 15) / 5)
on a wavy path: smooth sliding | says="changes along the way"
    to_and_fro(lambda s: 5 + 0.2 * np.cos(5 * (s - 5)) + 0.02 * white(s.size))
strokes that slow down: stick-slip | says="by all strokes together"
    to_and_fro(lambda s: stroke_of_slips(s / 1.8 + s**2 / 36) + white(s.size) / 10)
of a soft spring: stick-slip | half_width=5.0
    alone(200.0, 0.01, "np.where(t % 40 < 20, 1, -1) * soft_stroke(t % 20)", 0.02)
in parts: undecided | parts=["stick-slip", "smooth sliding", "stick-slip"]
    alone(60.0, 0.01, "pauses(t)", 0.01)
in many parts: undecided | says="8 parts in turn (4 stick-slip, 4 smooth sliding)"
    alone(160.0, 0.01, "np.where(t % 40 < 20, 3 + t % 1, 3.5)", 0.01)
slips that stop: undecided | parts=["stick-slip", "smooth sliding"]
    stops(20.0, 0.01)
that become a sine: - | end=35.3
    alone(50, 0.01, "2 + np.where(t < 35.3, t % 1, 0.5 + tone(0.5, 2 * t))", 0.02, 5)
smaller ones: stick-slip | parts=["stick-slip", "stick-slip"]
    alone(60.0, 0.01, "2 + np.where(t < 30, 1, 0.4) * (t % 1)", 0.01)
that hum: stick-slip | drop=1.0
    alone(60.0, 0.001, "3 + t % 1 + tone(0.15, 50 * t)")
in pulls: stick-slip | note="unloaded for 20"
    alone(80.0, 0.01, "np.where(t % 20 < 15, 3 + t % 1, 0)", 0.003)
two strokes: smooth sliding | half_width=5.0
    alone(40.0, 0.01, "np.where(t < 20, 5, -5)", 0.02)
in one half: undecided | says="a part of the window"
    alone(50.0, 0.01, "3 + np.where(t < 25, tone(0.4, t), 0.8 * (t % 1) - 0.4)")
under a wavy load: undecided | says="a steady load"
    alone(60.0, 0.01, "(3 + t % 1.02) * (1 + tone(0.3, t / 30))")
pulses: sustained oscillation | periodic=True, says="by the drive or the track"
    alone(60.0, 0.01, "3 + np.exp(-(((t % 1 - 0.5) / 0.05) ** 2))")
to and fro, in ramps: undecided | says="strokes"
    alone(180.0, 0.01, "np.where(t % 36 < 18, 1, -1) * ramp_and_slips(t % 18)")
that falls slowly: undecided | says="the drive stops and starts"
    alone(60, 0.01, "np.cos((t % 6).clip(0, 5) / 1.6) + 2 * (t % 6).clip(5)", 0.01)
a sine and a half: undecided | says="too short"
    alone(1.5, 0.01, "3 + tone(0.3, t)", 0.003)
a start that rings: smooth sliding | says="decays until"
    alone(60.0, 0.01, "4 - 4 * np.exp(-t / 3) * np.cos(6 * t)", 0.01)
that falls: smooth sliding | begin=25.0
    alone(50.0, 0.02, "4 + np.exp(-t)", 0.016)
that rings long: smooth sliding | says="the amplitude decays"
    alone(60.0, 0.01, "4 + 1.5 * np.exp(-t / 20) * np.cos(6.28 * t)", 0.02)
on a drift: smooth sliding | cycles=0
    alone(60.0, 0.01, "np.minimum(t, 3.0 + t / 3000)", 0.001)
slips after a noisy rise: stick-slip | parts=[]
    alone(60.0, 0.002, "np.minimum(t / 10, 2.5 + (t - 25) / 10 % 0.5)", 0.08)
paper, K 168, V 42: stick-slip | periodic=False
    paper("k168_v42")
paper, K 1002, V 42: stick-slip | periodic=False
    paper("k1002_v42")
paper, K 1002, V 4300: sustained oscillation | periodic=True
    paper("k1002_v4300")
paper, K 2254, V 42: smooth sliding | normal=True
    paper("k2254_v42")
""",
        re.MULTILINE,
    )
}
"""For each force: its name, its regime, other values shown, and how it is made."""
SCALED = "a sine that lasts", "creep between slips", "noise that grows"


def assert_shows(seen, field, value):
    """Compare the values of a regime with the known values of a force."""
    passed = {row.name: row.passed for row in seen.table}
    by_name = {
        "periodic": "correlation of a cycle with the next",
        "normal": "kurtosis of the force",
        "contacts": "scatter over the noise of the contacts",
        "fast": "largest slider velocity over the drive's",
    }
    if field in by_name:
        assert passed[by_name[field]] == value
    elif field == "loop":
        assert (seen.half_width, seen.offset) == pytest.approx(value, abs=0.01)
        assert len(seen.segments) == 6
    elif field == "grows":
        assert (seen.trend > 1.0) == value
        assert seen.trend != pytest.approx(1.0, abs=0.05)
    elif field == "end":
        ends = re.findall(r"stick-slip until ([\d.]+)|^1 +\S+ +(\S+)", str(seen), re.M)
        both = [float("".join(end)) for end in ends]
        assert both == pytest.approx(2 * [value], abs=1)
    elif field == "says":
        assert value in str(seen)
    elif field == "note":
        assert (value in " ".join(seen.notes)) if value else not seen.notes
    elif field == "parts":
        assert [part.kind for part in seen.segments] == value
    elif field == "begin":
        assert seen.window[0] == pytest.approx(value, abs=6.0)
    else:
        assert getattr(seen, field) == pytest.approx(value, rel=0.15, abs=0.01)


@pytest.mark.parametrize("name", FORCES)
def test_regime_of_a_force_and_what_it_shows(name):
    force, kind, shows = FORCES[name]
    seen = regime(eval(force))
    assert kind in ("-", seen.kind), str(seen)
    assert seen.cycles > 3 or not re.search("1 cycle |second half", str(seen))
    for field, value in shows.items():
        assert_shows(seen, field, value)


@pytest.mark.parametrize("scale", [-1.0, 1e-3, 1e6])
@pytest.mark.parametrize("slower", [1.0, 1e-6, 1e3])
@pytest.mark.parametrize("name", [*SCALED, "paper, K 168, V 42"])
def test_units_of_force_and_time_and_the_direction_change_nothing(name, scale, slower):
    data = eval(FORCES[name][0])
    other = data.assign_coords(time=slower * data.time)
    motion = {"spring_force", "displacement", "velocity", "drive_velocity"}
    for each in motion & set(data):
        size = scale / slower if "velocity" in each else scale
        other[each] = "time", size * data[each].values
    there = regime(data)
    back = regime(other)
    assert (back.kind, back.cycles) == (there.kind, there.cycles)
    assert back.period == pytest.approx(slower * there.period, rel=1e-6, nan_ok=True)
    assert back.drop == pytest.approx(abs(scale) * there.drop, rel=1e-6)
    for one, two in zip(there.table, back.table, strict=True):
        assert (two.name, two.passed) == (one.name, one.passed)
        assert two.statistic == pytest.approx(one.statistic, rel=1e-5)


@settings(max_examples=50)
@given(seed=st.integers(0, 10_000), std=st.floats(0.1, 0.5))
def test_irregular_slips_of_a_force_alone_are_stick_slip(seed, std):
    rng = np.random.default_rng(seed)
    drawn = np.maximum(rng.normal(6.0, 6.0 * std, 30), 1.5)
    # so that nothing decays, even by chance
    gaps = np.append(drawn, rng.permutation(drawn))
    when = np.cumsum(gaps)
    sizes = 0.5 * np.append(gaps[1:], 6.0)
    t = np.arange(0.0, when[-1] + 4.0, 0.25)
    force = sawtooth(t, [(w, 11.0) for w in when], sizes, fall=0.4)
    force += rng.normal(0.0, 0.03, t.size)
    result = regime(trace(t, force))
    assert result.kind == "stick-slip"
    assert result.period == pytest.approx(drawn.mean(), rel=0.3)


def test_slips_faster_than_slopes_are_known_by_are_slips():
    noise = white(740, std=0.06, seed=3)
    slipping = at(60.0, 1 / 12.3, lambda t: 10.0 + t % 1.0 + noise[: t.size])
    slipping.spring_force.attrs["units"] = "N"
    moving = ss.measure.motion(slipping, stiffness=1000.0, velocity=0.00106)
    assert [regime(each).kind for each in (moving, slipping)] == 2 * ["stick-slip"]


@pytest.mark.parametrize("size", [200, 500, 2000])
def test_noise_with_a_memory_is_no_stick_slip(size):
    slipping = 0
    for seed in range(100):
        memory = np.random.default_rng(seed).uniform(0.5, 0.98)
        force = 5.0 + 0.3 * slow(size, memory=memory, seed=seed)
        seen = regime(trace(0.01 * np.arange(size), force))
        parts = seen, *seen.segments
        slipping += any(part.kind == "stick-slip" for part in parts)
    assert slipping <= 1


@settings(max_examples=20)
@given(seed=st.integers(0, 10_000), falls=st.floats(0.27, 0.5))
def test_a_force_that_climbs_at_one_rate_is_no_noise(seed, falls):
    rng = np.random.default_rng(seed)
    cycles = rng.lognormal(0.0, 0.6, 30)
    ends = np.cumsum(cycles)
    corners = np.ravel(np.column_stack([ends - falls * cycles, ends]))
    sizes = np.ravel(np.column_stack([cycles, np.zeros(30)]))
    t = np.arange(0.0, ends[-1], 0.02)
    force = 5.0 + np.interp(t, [0.0, *corners], [0.0, *sizes]) + white(t.size, std=0.02)
    assert regime(trace(t, force)).kind != "smooth sliding"


@settings(max_examples=20)
@given(st.floats(12.0, 48.0), st.floats(2.5, 8.0), st.floats(-1.0, 1.0))
def test_steps_of_amplitude_and_level_are_found_where_they_are(when, factor, level):
    t = np.arange(0.0, 60.0, 0.01)
    slips = np.where(t < when, t % 1.0, level + t % 1.0 / factor)
    force = 5.0 + slips + white(t.size, std=0.01)
    seen = regime(trace(t, force))
    assert [part.kind for part in seen.segments] == ["stick-slip", "stick-slip"]
    assert seen.segments[0].window[1] == pytest.approx(when, abs=1.0)  # a cycle
    assert seen == "stick-slip"
    smooth = regime(trace(t, 5.0 + (t > when) + white(t.size, std=0.02)))
    assert (smooth.kind, len(smooth.segments)) == ("smooth sliding", 2)


@pytest.mark.parametrize(
    "memory", [0.0, pytest.param(0.9, marks=pytest.mark.slow), 0.99]
)
def test_noise_has_no_steps_whatever_its_colour(memory):
    t = 0.05 * np.arange(4000)
    forces = (5.0 + 0.2 * slow(t.size, memory=memory, seed=n) for n in range(40))
    stepped = [bool(regime(trace(t, force)).segments) for force in forces]
    assert sum(stepped) <= 5


def test_a_force_over_its_times_is_enough():
    force = bench()[0]["spring_force"]
    series = force.to_series()
    dates = pd.Timestamp("2024-02-01") + pd.to_timedelta(series.index, unit="s")
    kept = drops(force.to_dataset())["recurrence"].attrs["mean"]
    for each in (force, force.rename(time="t"), series, series.set_axis(dates)):
        assert regime(each) == "stick-slip"
        assert drops(each)["recurrence"].attrs["mean"] == pytest.approx(kept, rel=1e-6)
    for each in (force.drop_vars("time"), series.reset_index(drop=True), series.values):
        with pytest.raises(ss.InputError, match="a force with its times"):
            regime(each)


@pytest.mark.parametrize("samples", [300, 2000, 20_000])
@pytest.mark.parametrize("noise", [0.03, 0.1])
def test_a_force_that_is_noise_is_smooth_sliding_however_long_it_lasts(samples, noise):
    """Chance drops of smoothed noise are not slips, nor would more of them be."""
    for seed in range(6):
        force = 5.0 + white(samples, std=noise, seed=seed)
        data = trace(0.01 * np.arange(samples), force)
        assert regime(data).kind == "smooth sliding"
        assert drops(data).sizes["event"] == 0


def test_samples_that_step_over_slips_do_not_make_them_smooth():
    data = with_motion(*even_sawtooth(cycles=60))
    for every in (1, 5, 10, 20):  # 150 to 7.5 samples per cycle, 6 to .3 per drop
        thin = data.isel(time=slice(None, None, every))
        velocity = np.gradient(thin.displacement, thin.time)
        assert regime(thin.assign(velocity=("time", velocity))) == "stick-slip"
    assert regime(data.isel(time=slice(None, None, 60))).kind == "undecided"


@pytest.mark.parametrize("samples", [4.5, 5.5, 6.5])
def test_a_cycle_that_is_no_whole_number_of_samples_is_one_cycle(samples):
    seen = regime(at(400.0, 1.0, lambda t: 2.0 + t / samples % 1))
    assert seen == "stick-slip"
    assert seen.period == pytest.approx(samples, rel=1.0 / seen.cycles)


def test_the_evidence_of_a_sine():
    seen = regime(wave())
    shape = [seen.period, seen.peak_to_peak, seen.trend]
    assert shape == pytest.approx([0.4 * math.pi, 0.4, 1.0], rel=0.01)
    motion = [seen.slip_phase, seen.largest_velocity, *seen.window]
    assert motion == pytest.approx([0.5, 1.2, 60.0, 100.0], rel=0.03)
    assert math.log(regime(wave(growth=0.02)).trend) == pytest.approx(0.4, abs=0.02)
    rows = {row.name: row for row in seen.table}
    assert {row.source for row in seen.table} == {"theory", "statistics", "convention"}
    fast = rows["largest slider velocity over the drive's"]
    assert (fast.limit, fast.passed) == (3.5, False)
    assert fast.statistic == pytest.approx(1.2, rel=0.01)
    written = json.loads(json.dumps(seen.to_dict()))["table"]
    assert [row["name"] for row in written] == list(rows)
    assert seen in {"sustained oscillation"}
    assert replace(seen, trend=math.nan) == replace(seen, trend=math.nan)


# -------------------------------------------------------------------------------- drops


@settings(max_examples=50)
@given(
    drop=st.floats(0.01, 100.0),
    period=st.floats(0.5, 50.0),
    level=st.floats(-200.0, 200.0),
    cycles=st.integers(3, 30),
)
def test_a_sawtooth_has_the_slips_it_was_made_of(drop, period, level, cycles):
    t, force = even_sawtooth(
        period=period, drop=drop, cycles=cycles, step=period / 100, fall=0.04 * period
    )
    if level < 0:  # a load cell that gives a pull as negative
        found = drops(trace(t, level - 2 * drop - (force - 0.1)))
        assert np.all(found.force_after > found.force_before)
    else:
        found = drops(trace(t, force + level))
    assert found.sizes["event"] == found.attrs["count"] == cycles
    np.testing.assert_allclose(found["drop"], drop, rtol=0.05)
    np.testing.assert_allclose(found["recurrence"][1:], period, rtol=0.021)
    assert np.isnan(found["recurrence"][0])
    assert np.all(found["duration"] <= 0.06 * period)


@pytest.mark.parametrize("noise", [0.03, 0.06, 0.1])
@pytest.mark.parametrize("samples", [12, 26, 50, 200])
def test_drops_ten_times_the_noise_are_all_found_and_not_overstated(samples, noise):
    data, sizes = bench(samples=samples, noise=noise)
    clean, _ = bench(samples=samples)
    found = drops(data)
    assert found.sizes["event"] == sizes.size
    assert found.attrs["noise"] == pytest.approx(noise, rel=0.3)
    # The extremes of a noisy slip would lie 2 to 3 standard deviations further apart.
    mean = float(drops(clean)["drop"].mean())
    assert float(found["drop"].mean()) == pytest.approx(mean, rel=0.03)
    assert regime(data).kind == "stick-slip"


@pytest.mark.parametrize("samples", [60, 200])
@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("ringing", [0.12, 0.2, 0.4])
def test_ringing_is_not_counted(ringing, noise, samples):
    more = {"noise": noise, "samples": samples, "slip": 0.08, "variation": 0.2}
    data, sizes = bench(ringing=ringing, **more)
    # A small slip may be lost in strong ringing.
    missed = 1 if ringing > 0.3 else 0
    assert drops(data).sizes["event"] == pytest.approx(sizes.size, abs=missed)


def test_ringing_that_goes_on_to_the_next_slip_joins_none_of_them():
    t = np.arange(0.0, 600.0, 0.02)
    since = t % 10.0
    rings = 0.25 * np.exp(-0.05 * since) * np.sin(2.0 * np.pi * since)
    load = np.where(since < 0.5, 1.0 - 2.0 * since, (since - 0.5) / 9.5)
    data = with_motion(t, load + rings, stiffness=1.0, velocity=0.1)
    assert drops(data).sizes["event"] == pytest.approx(60, abs=1)


@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("ringing", [0.0, 0.2])
def test_loading_that_quickens_makes_no_slip_ringing(ringing, noise):
    more = {"cycles": 60, "noise": noise, "ringing": ringing}
    slow_part, quick = (bench(samples=60 * n, seed=n, **more)[0] for n in (1, 4))
    again = slow_part.time.values[-1] + 0.025
    t = np.concatenate([slow_part.time, again + 0.25 * quick.time])
    force = np.concatenate([slow_part.spring_force, quick.spring_force])
    assert drops(trace(t, force)).sizes["event"] == pytest.approx(120, abs=4)


def test_small_slips_beside_large_ones_are_kept():
    t = np.arange(0.0, 60.0, 0.05)
    sizes = np.array([5.0, 4.0, 1.0, 0.7, 6.0, 3.0, 0.7, 5.0])
    when = [7.0, 14.0, 18.0, 22.0, 33.0, 40.0, 44.0, 55.0]
    heights = [11.0, 11.5, 10.0, 10.5, 14.0, 12.0, 11.0, 13.0]
    peaks = list(zip(when, heights, strict=True))
    found = drops(trace(t, sawtooth(t, peaks, sizes, fall=0.3)))
    np.testing.assert_allclose(found["drop"], sizes, atol=0.2)
    assert drops(overshooting()).sizes["event"] == 12


def test_slip_length_and_peak_velocity_come_with_the_motion():
    t, force = even_sawtooth(drop=0.7, fall=0.06)
    found = drops(with_motion(t, force, stiffness=2.0))
    # 5 % of the drop are left out at either end
    np.testing.assert_allclose(found["slip"], 0.35 + 0.06, atol=0.06)
    fastest = 1.0 + 0.7 / 0.06 / 2.0
    np.testing.assert_allclose(found["peak_velocity"], fastest, rtol=0.01)
    assert "slip" not in drops(trace(t, force))
    assert found["loading_rate"].attrs["mean"] == pytest.approx(0.7 / 1.44, rel=0.1)


def test_falls_cut_off_at_the_ends_are_left_out_and_counted():
    # from the middle of one drop to that of the next
    found = drops(trace(*even_sawtooth(cycles=10)).sel(time=slice(1.53, 13.53)))
    assert (found.sizes["event"], found.attrs["cut"]) == (7, 2)


def test_noise_alone_has_no_drops_unless_asked_for():
    t = np.arange(20_000) * 0.01
    assert drops(trace(t, 5.0 + white(t.size, std=0.1, seed=3))).sizes["event"] == 0
    data = trace(t, 0.5 + 0.003 * slow(t.size, seed=3))
    found = drops(data)
    assert (found.sizes["event"], found.attrs["count"], statistics(found)) == (0, 0, [])
    assert "slow noise" in found.attrs["criterion"]
    assert math.isnan(found["drop"].attrs["mean"])
    asked = drops(data, minimum_drop=0.003)
    assert asked.sizes["event"] > 10
    assert float(asked["drop"].min()) >= 0.003
    # drops that noise enlarges, at the limit
    found = drops(bench(samples=12, noise=0.15)[0])
    assert float(found["drop"].min()) >= found.attrs["minimum_drop"]


BACKWARDS = ss.Rig(
    ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.2)),
    ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4),
    ss.constant(-1.0, duration=8.0),
    method=ss.MasterEquation(),
)


@pytest.mark.parametrize(
    "rig",
    [
        ss.example("precision_stage"),
        ss.example("caliper").replace(drive=ss.constant(5.0, duration=60.0)),
        BACKWARDS,
    ],
    ids=["stage", "structure", "backwards"],
)
def test_a_run_is_judged_as_its_dataset_is(rig):
    run = record(rig)
    trace = Trace.of(run.dataset())
    direct = Trace.of_run(run)
    for field in fields(trace):
        assert np.array_equal(getattr(trace, field.name), getattr(direct, field.name))
    assert str(regime_of_run(run)) == str(regime(run.dataset()))


def test_after_holds_for_the_slips_as_for_the_regime():
    data, _ = bench(noise=0.02)
    late = drops(data, after=75.0)
    # a sample
    assert regime(data, after=75.0).window[0] == pytest.approx(75.0, abs=0.06)
    assert float(late["start"].min()) >= 75.0
    assert late.sizes["event"] == pytest.approx(50, abs=3)


def test_drops_of_strokes():
    found = drops(to_and_fro(stroke_of_slips))
    assert set(found["stroke"].values.tolist()) == set(range(6))
    before = found["force_before"]
    # along each stroke: the signs of the strokes do not cancel
    assert before.attrs["mean"] == pytest.approx(float(np.abs(before).mean()))
    assert found.sizes["event"] == found.attrs["count"] == pytest.approx(6 * 19, abs=6)
    assert float(found["drop"].max()) < 1.2  # no reversal counts as a drop


def test_a_gap_in_a_record_is_told_and_no_slip():
    t = np.arange(0.0, 60.0, 0.02)
    t = t[(t < 20.0) | (t > 25.0)]
    data = trace(t, slips_of_a_second(t / 0.7) + white(t.size, std=0.01))
    seen = regime(data)
    found = drops(data)
    assert seen == "stick-slip"
    assert seen.window[0] > 25.0
    assert "no readings in a gap from t = 19.98 to 25" in str(seen)
    assert float(found["recurrence"].max()) < 1.0  # none extends across the gap
    data["spring_force"][t < 20.0] = 2.5 + white(int((t < 20.0).sum()), std=0.01)
    assert regime(data).reason.startswith("smooth sliding until 20, then stick-slip")


def test_numbers_have_the_units_and_the_prefix_that_suit_them():
    data = trace(*even_sawtooth(cycles=30))
    units = (
        ("N", "700 ± 0 mN", "mN/s"),
        ("mN", "700 ± 0 uN", "uN/s"),
        ("1", "0.7 ± 0", "1/s"),
    )
    for force, drop, rate in units:
        data["spring_force"].attrs["units"] = force
        data["time"].attrs["units"] = "s"
        rows = dict(statistics(drops(data)))
        assert rows["drop"].replace("µ", "u").startswith(drop)
        assert f" {rate} (CV " in rows["loading rate"].replace("µ", "u")
        assert " s (CV " in rows["recurrence"]
    data["time"].attrs["units"] = "ms\x1b[2J"
    assert "\x1b" not in str(regime(data))


def test_the_coefficient_of_friction_is_told_beside_the_force(tmp_path):
    t = np.arange(0.0, 20.0, 0.01)
    load = 40.0 + 4.0 * np.sin(t)
    mu = 0.2 + 0.1 * (t / 0.5 % 1.0)
    rows = np.transpose([t, 1000 * load * mu, load])
    heading = "time [s],force [mN],normal load [N]"
    file = tmp_path / "mu.csv"
    np.savetxt(file, rows, "%.5f", ",", header=heading, comments="")
    seen, found = regime_and_drops(ss.read_trace(file))
    assert [seen.mean_mu, seen.static_mu] == pytest.approx([0.249, 0.298], abs=0.002)
    assert "friction 0.249 on average (kinetic), 0.298 at most (static)" in str(seen)
    np.testing.assert_allclose(found["mu_before"], 0.298, atol=1e-3)
    np.testing.assert_allclose(found["mu_drop"], 0.098, atol=1e-3)
    assert dict(statistics(found))["mu after"].startswith("0.2")
    axes = ss.plot.overview(ss.read_trace(file)).axes
    assert "coefficient of friction" in {ax.get_ylabel() for ax in axes}


def test_spikes_are_replaced_and_slips_are_not(tmp_path):
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 20.0, 0.01)
    spiky = np.append(0, np.arange(37, t.size, 190))
    ringing = bench(samples=12, noise=0.03, ringing=0.4)[0]["spring_force"].values
    still = 10.0 + white(t.size, std=0.02)
    saw = 3.0 * (t / 0.5 % 1.0)
    cases = (still + saw, spiky, 38), (still, spiky, 0), (ringing, spiky[:0], 100)
    for force, spikes, slips in cases:
        force = force.copy()
        heights = rng.uniform(4.0, 9.0, spikes.size)
        force[spikes] += np.resize([1.0, -1.0], spikes.size) * heights
        file = tmp_path / "spikes.csv"
        np.savetxt(file, force, "%.4f", header="force [N]", comments="")
        data = ss.read_trace(file, step=0.01)
        assert int(data["filled"].sum()) == spikes[1:].size  # the first row is left out
        note = f"{spikes.size} spikes of a single sample"
        assert (note in data.attrs["note"]) == (spikes.size > 0)
        moving = ss.measure.motion(data, stiffness=10.0, velocity=1.0)
        count = ss.measure.kinematics(moving).spikes
        assert count == data.attrs["spikes"] == spikes.size
        assert drops(data).sizes["event"] == pytest.approx(slips, abs=1)


SAW = even_sawtooth()
SAMPLED = trace(np.round(SAW[0], 6), SAW[1])
UNMEASURED = (
    lambda: regime_and_drops(SAMPLED.drop_vars("spring_force")),
    "spring_force along time",
    lambda: regime_and_drops(SAMPLED.isel(time=slice(5))),
    "5 samples",
    lambda: regime_and_drops(SAMPLED.where(SAMPLED.time != 3.0)),
    "spring_force = nan at t = 3",
    lambda: regime_and_drops(SAMPLED.assign_coords(time=SAMPLED.time.values[::-1])),
    "rising",
    lambda: regime_and_drops(SAMPLED.assign_coords(time=1e-308 * SAMPLED.time.values)),
    "between 1e-30 and",
    lambda: regime_and_drops(
        SAMPLED.assign(displacement=SAMPLED.spring_force.expand_dims(q=2).T)
    ),
    "displacement has shape",
    lambda: regime_and_drops(SAMPLED, after=500.0),
    "after = 500",
    lambda: regime_and_drops(SAMPLED, minimum_drop=0.0),
    lambda: regime_and_drops(SAMPLED, minimum_drop="much"),
    "minimum_drop",
)


@refused(*UNMEASURED)
def test_what_cannot_be_measured_is_refused(call, message):
    with pytest.raises(ss.InputError, match=message):
        call()


# ------------------------------------------------------------------------------ periods


TWO_RATES = np.cumsum(np.where(np.arange(20_000) // 2500 % 2 == 0, 0.01, 0.03))
QUICKER = np.append(np.arange(0.0, 400.0), np.arange(400.0, 800.0, 0.62))
MANY = np.cumsum(np.where(np.arange(263_000) < 131_500, 0.0005, 0.0015))


@pytest.mark.parametrize(
    ("t", "period"),
    [
        (np.arange(0.0, 200.0, 0.1), 5.0),
        (1e-3 * QUICKER, 0.02),
        (TWO_RATES, 1.37),
        (np.linspace(0.0, 1.0, 2_000_000), 1.0 / 6.0),  # few cycles with many samples
        # more samples than are correlated at once: from averages of samples, or from
        # the start
        (MANY, 1.7),
        (MANY, 0.01),
    ],
)
def test_the_period_is_found_however_a_force_is_sampled(t, period):
    found = ss.measure.find_cycles(t, np.sin(2.0 * math.pi * t / period))
    assert found.period == pytest.approx(period, rel=0.01 if t.size == 1046 else 1e-4)
    assert found.correlation > 0.9
    assert found.periodic


# --------------------------------------------------------------------------- kinematics


def labelled_paper(name):
    """Paper on paper with units, and the stiffness and velocity of its name."""
    data = ss.read_trace(TRACE.parent / "paper_on_paper" / f"{name}.csv.gz")
    stiffness, velocity = (float(each[1:]) for each in name.split("_"))
    return data, {"stiffness": stiffness, "velocity": 1e-6 * velocity}


PAPER = {  # regime, motion; stuck, swing, drop, recurrence, loading
    "k168_v42": ("stick-slip", "sticks and slips", 0.87, 4.4, 69e-6, 1.63, 1.08),
    "k168_v1100": ("stick-slip", "sticks and slips", 0.6, 2.0, 104e-6, 0.132, 1.11),
    "k1002_v42": ("stick-slip", "sticks and slips", 0.76, 2.6, 24e-6, 0.65, 0.94),
    "k1002_v4300": (SUSTAINED, "oscillates", 0.22, 0.71, 39e-6, 0.0286, 0.84),
    # by itself, or excited by its contacts
    "k2254_v42": ("undecided", "moves unevenly,", 0.016, 0.47, None, None, 0.19),
}


@pytest.mark.parametrize("name", PAPER)
def test_how_paper_slides_on_paper(name):
    """Compared with an expert's values, from another picker and another noise."""
    kind, motion, stuck, swing, drop, recurrence, loading = PAPER[name]
    data, bench = labelled_paper(name)
    moving = ss.measure.motion(data, **bench)
    seen = ss.measure.kinematics(moving, mass="30.7 g")
    assert regime(moving).kind == kind
    assert seen.motion.startswith(motion)
    assert seen.stuck == pytest.approx(stuck, abs=0.02)
    assert seen.swing == pytest.approx(swing, rel=0.08)
    assert seen.loading == pytest.approx(loading, abs=0.03)
    if drop is not None:
        lengths = [seen.drop, seen.recurrence]
        assert lengths == pytest.approx([drop, recurrence], rel=0.07)
    # of a light slider: part of the spring and the sensor ring
    if math.isfinite(seen.effective_mass):
        assert 0.5 <= seen.effective_mass / seen.mass <= 1.1


@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("samples", [8, 12, 16, 30])
def test_the_mass_that_slips_is_known_to_a_quarter(samples, noise):
    """Slips of random sizes, each a half cosine, of 1 kg on 1 N/m."""
    sizes = np.random.default_rng(1).uniform(0.5, 1.5, 200)
    begins = np.cumsum(30.0 * sizes) + math.pi * np.arange(200)
    t = np.arange(0.0, begins[-1] + 4.0, math.pi / samples)
    peaks = [*zip(begins, 5.0 + sizes, strict=True)]
    force = sawtooth(t, peaks, sizes, fall=math.pi, start=5.0)
    last = np.searchsorted(begins, t) - 1
    fallen = np.clip((t - begins[last]) / math.pi, 0.0, 1.0)
    force += sizes[last] * (fallen - 0.5 + 0.5 * np.cos(math.pi * fallen))
    data = trace(t, force + white(t.size, std=noise))
    seen, softer = (
        ss.measure.kinematics(ss.measure.motion(data, stiffness=K, velocity=1 / 30))
        for K in (1.0, 0.1)
    )
    assert seen.effective_mass == pytest.approx(1.0, rel=0.25)
    assert not seen.notes
    assert "at 10 of stiffness times velocity, too fast for" in str(softer)


def test_the_velocity_of_a_slider_by_its_force_is_that_of_the_run():
    """A run of stick-slip with sensor noise, read as a trace."""
    run = ss.simulate(fig4(2.0, 0.2, damping=20.0)).sel(time=slice(60.0, None))
    force = 1e4 * run["spring_force"].values
    data = trace(run.time.values, force + white(force.size, std=2e-4 * np.ptp(force)))
    moving = ss.measure.motion(data, stiffness=2e4, velocity=1.0)
    assert float(np.mean(np.abs(moving["velocity"] - run["velocity"].values))) < 0.1
    moved, expected = (np.diff(data["displacement"]) for data in (moving, run))
    np.testing.assert_allclose(moved, expected, atol=3e-3)
    assert regime(moving) == "stick-slip"
    assert "peak_velocity" in drops(moving)


@pytest.mark.parametrize(
    ("unit", "options", "message"),
    [
        ("N", {"stiffness": "350 N"}, "stiffness = '350 N'"),
        ("N", {"velocity": 0.0}, "velocity = 0"),
        ("N", {"contacts": 0}, "contacts = 0"),
        ("N", {"velocity": 1e-9}, "hides the loading"),
        ("1", {}, "no units of force|units of force"),
    ],
)
def test_a_motion_that_cannot_be_told_is_refused(unit, options, message):
    data = bench(noise=0.02)[0]
    data["spring_force"].attrs["units"] = unit
    with pytest.raises(ss.InputError, match=message):
        ss.measure.motion(data, **({"stiffness": 1.0, "velocity": 0.5} | options))
    own = data.assign(measured_velocity=-data["spring_force"].differentiate("time"))
    for each in (data, own):
        with pytest.raises(ss.InputError, match="motion"):
            ss.measure.kinematics(each)
    with pytest.raises(ss.InputError, match="know the motion"):
        ss.measure.motion(with_motion(*even_sawtooth()), stiffness=1.0, velocity=1.0)


# ---------------------------------------------------------------------------- true runs


def rig(interface, slider, duration, count, seed, velocity=1.0):
    """A rig of one slider with a stiffness, a mass and a damping."""
    stiffness, mass, damping = slider
    slider = ss.Slider(stiffness=stiffness, mass=mass, damping=damping)
    is_method = isinstance(count, ss.MasterEquation)
    method = count if is_method else ss.Contacts(count, seed=seed)
    return ss.Rig(interface, slider, ss.constant(velocity, duration), method=method)


def delayed(thresholds, delay, *numbers, **more):
    contacts = ss.Interface(thresholds=thresholds, delay=ss.Delay(delay), **more)
    return rig(contacts, *numbers)


def gaussian(std):
    return ss.Gaussian(mean=1.0, std=std)


def uniform(std):
    return ss.Uniform(low=1.0 - 3**0.5 * std, high=1.0 + 3**0.5 * std)


def fig4(stiffness, delay, *, damping=200.0, duration=100.0, count=10_000):
    """A rig of Fig. 4."""
    numbers = (stiffness, 1e-4, damping), duration, count, 1
    initial = ss.Gaussian(mean=0.0, std=0.01)
    return delayed(gaussian(0.1), delay, *numbers, initial=initial)


def few(contacts, stiffness, delay=0.0):
    """So few contacts that each slip is visible, or that noise dominates the force."""
    mass = 1e-4 * (stiffness + 1.0)
    numbers = (stiffness, mass, math.sqrt(stiffness / mass)), 100.0, contacts, 3
    initial = ss.Gaussian(mean=0.0, std=0.05)
    return delayed(gaussian(0.3), delay, *numbers, initial=initial)


NOT_YET = f"{SMOOTH}, undecided"
FAST = {"largest_velocity": (10.0, math.inf)}
MASTER = ss.MasterEquation()
PERIOD = reference.PERIOD - 0.010, reference.PERIOD + 0.010
ALONE = {"alone": (True, True)}
RELAXES = {"peak_to_peak": (0.75, 0.79), "largest_velocity": (12.3, 13.7)}
RELAXES |= {"period_variation": (0, 0.01), "period": PERIOD}
SWINGS = {"peak_to_peak": (0.62, 0.65), "period": (1.37, 1.39)}
SWINGS |= {"largest_velocity": (0.0, 3.0)}
FOUR_MODES = ss.Gamma(1.0, 0.077), 0.03931, (0.39341, 0.0055601, 0.55264), 120.0
TWO_DROPS = ss.Gamma(1.0, 0.2978), 0.85202, (0.47383, 0.026935, 0.042596), 120.0
NO_DELAY = ss.Weibull(1.0874688, 5.1335692), 0.0, (0.1806, 1.2771e-6, 5.8861), 120.0
AMPLIFIES = uniform(0.335), 0.746365, (3.695489, 8.567306e-4, 1.688416), 360.0, 2000, 5
NARROW = uniform(0.2713), 0.16456, (1.84587, 0.0589937, 0.250851), 133.0, 1062, 1047
SHAKEN = ss.LogNormal(1.0, 0.27266), 0.0756861, (0.2054, 0.03459, 0.653982), 85.7
RINGS = uniform(0.0363), 0.28133, (0.10183, 2.3339e-5, 4.4319), 151.5, 2000, 56
AGEING = ss.Interface(thresholds=gaussian(0.3106), ageing=ss.Langevin(rate=0.30041))
AGED = rig(AGEING, (0.04518344, 1.6051970e-4, 7.01152), 27.06, 630, 13, 2.2172)


@pytest.mark.parametrize(
    ("made", "kinds", "numbers"),
    [
        (fig4(2.0, 0.0), SMOOTH, {"peak_to_peak": (0.0, 0.05)} | ALONE),
        (fig4(2.0, 0.085), SMOOTH, {"peak_to_peak": (0.0, 0.05)}),
        (fig4(2.0, 0.105), STICK_SLIP, {}),
        (fig4(2.0, 0.2), STICK_SLIP, RELAXES | ALONE),
        (fig4(5.0, 0.1), SMOOTH, {"peak_to_peak": (0.0, 0.04)}),
        (fig4(5.0, 0.2), NOT_YET, {}),
        (fig4(5.0, 0.3), SUSTAINED, SWINGS | ALONE),
        (fig4(2.0, 0.0, count=300), SMOOTH, {}),
        (fig4(2.0, 0.2, count=300), STICK_SLIP, {}),
        (fig4(5.0, 0.15, count=300), SMOOTH, {}),
        (fig4(5.0, 0.3, count=300), SUSTAINED, {}),
        (fig4(5.0, 0.2, duration=10.0, count=MASTER), NOT_YET, {}),
        (fig4(5.0, 0.2, duration=40.0, count=MASTER), NOT_YET, {}),
        # A sawtooth, after which the slider rings for long: eta/Omega of .03 to .1.
        (delayed(*RINGS), STICK_SLIP, {"period": (8.53, 8.87)}),
        # A large and a small drop in each cycle.
        (delayed(*TWO_DROPS, 2000, 70), STICK_SLIP, {"period": (3.44, 3.58)}),
        # The thresholds age: in sliding, force and noise are a thirtieth of static
        # friction.
        (AGED, STICK_SLIP, {}),
        # Without a delay nothing can grow: all fluctuations are noise of the contacts,
        # however fast.
        (delayed(*NO_DELAY, 2000, 3), SMOOTH, {}),
        # Stable, and so lightly damped that it amplifies the contact noise in
        # proportion.
        (delayed(*AMPLIFIES), SMOOTH, {}),
        # The same, four times the noise of evenly stretched contacts. Few contacts, but
        # unstable: not noise.
        (delayed(*NARROW), SMOOTH, {}),
        (delayed(*SHAKEN, 114, 5054), SUSTAINED, {}),
        # Four growing modes; contact noise disturbs a sustained oscillation.
        (delayed(*FOUR_MODES, 2000, 67), SUSTAINED, {}),
        (delayed(*FOUR_MODES, 10_000, 1), SUSTAINED, {"period": (0.727, 0.757)}),
        # The force jumps by a quarter of static friction and more, at many times the
        # speed of the drive.
        (few(10, 0.3), STICK_SLIP, FAST),
        (few(31, 0.05), STICK_SLIP, FAST),
        (few(10, 5.0, delay=0.1), SUSTAINED, {}),
    ],
)
def test_the_regimes_of_runs(made, kinds, numbers):
    data = ss.simulate(made)
    seen, found = regime_and_drops(data)
    assert seen.kind in kinds.split(", "), str(seen)
    measured = dict(vars(seen))
    if "alone" in numbers:
        measured["alone"] = regime(data[["spring_force"]], after=60.0) == kinds
    for name, (least, most) in numbers.items():
        assert least <= measured[name] <= most, name
    if "period" in numbers:
        begin, end = seen.window
        count = pytest.approx((end - begin) / seen.period, abs=2)
        assert drops(data, after=begin).sizes["event"] == count
    # the listed slips came before, and are larger than in sliding
    if seen == SMOOTH and made.drive.duration > 100:
        assert bool((found["start"] < seen.window[0]).all())
        assert bool((found["drop"] > seen.peak_to_peak).all())
        assert re.search("smooth|noise", found.attrs["criterion"])


def test_drops_of_an_oscillation_without_sticking_are_cycles_and_no_slips():
    run = ss.simulate(ss.example("precision_stage").replace(velocity="2 mm/s"))
    seen, found = regime_and_drops(run)
    assert seen == SUSTAINED
    assert seen.drops_are == found.attrs["drops_are"] == "cycles"
    assert counted(found) == f"{found.sizes['event']} cycles"
    lines = ss.plot.overview(run, events=found).axes[0].lines
    assert counted(found) in {line.get_label() for line in lines}
    assert counted(ss.drops(ss.simulate(ss.example("brake_pad")))).endswith(" slips")


def test_drops_before_the_window_and_slow_ones_stay_in_the_table(wiper):
    # A drive that speeds up gives slow drops; in the window of a growing oscillation
    # there are four, after one fast slip.
    assert drops(wiper).sizes["event"] > 10
    assert drops(wiper).attrs["drops_are"] == "drops"
    t = np.arange(0.0, 100.0, 0.01)
    force = np.where(t < 40.0, 0.4 + 0.3 * (t % 2.0), 0.6) + white(t.size, std=0.002)
    data = with_motion(t, force, stiffness=5.0)
    seen, found = regime_and_drops(data)
    assert (seen.kind, found.sizes["event"]) == (SMOOTH, 20)
    assert float(found["start"].max()) < seen.window[0]


# -------------------------------------------------------------------------- transitions


def loop(up, down, *, noise=0.0, start=0.0):
    """A run up and down a ramp; its force oscillates by .8 between two velocities
    (beyond them if the first is larger), with a wavelength of 1.3 of travel. At the
    start of each way it oscillates by `start` more, which soon decays.
    """
    t = np.arange(0.0, 800.0, 0.02)
    v = 3.0 - 2.9 * np.abs(t - 400.0) / 400.0
    travel = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
    low, high = np.where(t <= 400.0, np.transpose([up]), np.transpose([down]))
    large = 1 * (v > low) + (v < high) + (low > high) > 1
    size = np.where(large, 0.8, 0.01) + start * np.exp(-(t % 400.0) / 7.0)
    wave = 0.5 * size * np.cos(2 * np.pi * travel / 1.3)
    return trace(t, 0.45 + wave + white(t.size, std=noise), drive_velocity=v)


@settings(max_examples=20)
@given(
    up=st.tuples(st.floats(0.6, 1.2), st.floats(1.8, 2.6)),
    down=st.tuples(st.floats(0.3, 1.0), st.floats(1.6, 2.6)),
)
def test_transitions_of_a_made_up_loop(up, down):
    found = ss.transitions(loop(up, down, noise=0.01))
    assert (found.v1, found.v2) == pytest.approx(up, abs=0.04)
    assert (found.v1_down, found.v2_down) == pytest.approx(down, abs=0.04)
    assert found.attrs["notes"] == ""


BOTH, UP, DOWN = slice(None), slice(0.0, 400.0), slice(400.01, None)
NOWHERE = (8.0, 9.0)
LATE = {"up": (1.4, 9.0), "down": (0.7, 9.0)}
INSIDE = {"up": (1.4, 2.4), "down": (0.7, 2.0)}
FALLING = {"up": NOWHERE, "down": (0.0, 2.0), "start": 0.9}
OUTSIDE = {"up": NOWHERE, "down": (2.4, 1.0)}
NEVER = dict.fromkeys(("up", "down"), NOWHERE)
LOW = {"v1": 1.4, "v1_down": 0.7}
HIGH = {"v1_down": 2.4, "v2_down": 1.0}


@pytest.mark.parametrize(
    ("made", "part", "seen", "note"),
    [
        (LATE, BOTH, LOW, "v2 not seen: stick-slip in "),
        (LATE | {"start": 0.9}, BOTH, LOW, "from the start"),
        (NEVER, BOTH, {}, "v1 and v2 not seen: stick-slip in 0 of "),
        (INSIDE, UP, {"v1": 1.4, "v2": 2.4}, "in 0 of 0 windows on the way down"),
        (FALLING, DOWN, {"v2_down": 2.0}, r"way up.*it sets in at \S* and persists"),
        (OUTSIDE, DOWN, HIGH, "start, ends at .*, sets in at .* persists"),
    ],
)
def test_what_a_ramp_does_not_show_is_not_seen_and_why(made, part, seen, note):
    found = ss.transitions(run := loop(**made).sel(time=part))
    for name in ("v1", "v2", "v1_down", "v2_down"):
        expected = pytest.approx(seen.get(name, math.nan), abs=0.04, nan_ok=True)
        assert float(found[name]) == expected
    words = (in_words := ss.measure.ramps.in_words)(run)
    assert re.search(note, f"{found.attrs['notes']} {words}")
    back = run.map(np.negative, keep_attrs=True).assign_coords(time=800.0 + run.time)
    strokes = in_words(xr.concat([run, back], "time")).replace("-", "")
    assert strokes.count(words.partition("; ")[2].replace("-", "")) == 2
    if {"v1", "v1_down"} <= set(seen):
        for velocity, difference in ((1.05, 0.8), (2.5, 0.0)):
            there = found.sel(velocity=velocity, method="nearest")
            higher = float(there["down"] - there["up"])
            assert higher == pytest.approx(difference, abs=0.05)


RAMP = loop((1.4, 2.4), (0.7, 2.0))
UNREAD = (
    lambda: ss.transitions(RAMP[["spring_force"]]),
    "InputError: .*drive_velocity",
    lambda: ss.transitions(RAMP, level=0.0),
    "InputError: .*level",
    lambda: ss.transitions(RAMP.assign(drive_velocity=RAMP.drive_velocity - 1.0)),
    "InputError: .*turns back",
    lambda: ss.transitions(RAMP.assign(drive_velocity=1.0 + 0.0 * RAMP.time)),
    "UndecidedError: .*keeps its velocity",
    lambda: ss.transitions(RAMP.assign(drive_velocity=2 - np.cos(RAMP.time / 64))),
    "UndecidedError: .*2 times",
    lambda: ss.transitions(RAMP.isel(time=slice(None, 300))),
    "UndecidedError: .*run it longer",
    lambda: ss.transitions(RAMP.isel(time=slice(None, None, 100))),
    "UndecidedError: .*record more often",
)


@refused(*UNREAD)
def test_ramps_that_cannot_be_read_are_refused(call, message):
    with pytest.raises((ss.InputError, ss.UndecidedError)) as caught:
        call()
    assert re.match(message, f"{caught.type.__name__}: {caught.value}")


@pytest.fixture(scope="module")
def wiper():
    return ss.simulate(ss.example("wiper"))


def test_a_window_holds_two_cycles_at_every_velocity(wiper):
    """In the wiper's cycle of 28 ms its drive moves 14 mm at .5 m/s, else 3 mm."""
    found = ss.transitions(wiper)
    for v, period in ((0.3, 28e-3), (0.65, 28e-3)):
        up = found.isel(travel=found.middle.to_numpy() < 0.5)
        nearest = int(np.abs(up.drive_velocity.to_numpy() - v).argmin())
        assert 2 * period <= float(up.end[nearest] - up.begin[nearest]) <= 5 * period
    # Read by eye: swings of 5 to 11 N from the first slip on, of 3 N at .94 m/s, none
    # while it slows down to .2 m/s.
    assert np.isnan([found.v1, found.v1_down]).all()
    assert float(found.v2) == pytest.approx(0.944, abs=0.02)
    assert 0.1 <= float(found.v2_down) <= 0.2
    assert found.attrs["level"] == pytest.approx(0.4 * 7.2)
    end, begin = (f"{1e3 * float(v):.3g} mm/s" for v in (found.v2, found.v2_down))
    up = f"speeding up, it is there from the start and ends at {end}; "
    down = f"slowing down, it sets in at {begin} and persists to the end"
    assert ss.measure.ramps.in_words(wiper).endswith(up + down)
    del (unknown := wiper.copy()).attrs["provenance"]  # of a rig that is not known
    message = "spring_force is in N, and f_s is not known"
    with pytest.raises(ss.InputError, match=message):
        ss.transitions(unknown)


# ------------------------------------------------------------------------- a real bench


def test_the_real_trace():
    data = ss.read_trace(TRACE, step=0.25)
    note = r"1 of 4262 rows could not be read.*\(line 3295: 'NaN N1'\)"
    assert re.search(note, data.note)
    found = drops(data)
    mean = {name: column.attrs.get("mean") for name, column in found.data_vars.items()}
    assert (data.sizes["time"], found.attrs["count"]) == (4262, 167)
    assert 2.6 <= mean["drop"] <= 3.6
    assert 5.3 <= mean["recurrence"] <= 6.8
    assert 0.24 <= found["recurrence"].attrs["std"] / mean["recurrence"] <= 0.36
    forces = [mean["force_before"], mean["force_after"]]
    assert forces == pytest.approx([11.8, 8.7], abs=0.2)
    assert mean["loading_rate"] == pytest.approx(0.55, abs=0.06)
    assert str(regime(data)).startswith("stick-slip: irregular")
    for every in (8, 10, 12, 16, 20, 24):
        rarely = regime(data.isel(time=slice(None, None, every)))
        assert rarely == "undecided"
        assert "record more often" in rarely.reason


def test_slips_between_two_readings_of_a_run_are_as_fast_as_their_mean_velocity():
    t = np.arange(0.0, 60.0, 0.05)
    creep = np.exp(-(t % 1.0) / 0.2)
    X = t // 1.0 - 0.4 * creep
    moves = {"velocity": 2.0 * creep, "drive_velocity": np.ones_like(t)}
    seen = regime(trace(t, 3.0 + t - X, displacement=X, **moves))
    assert (seen.kind, round(seen.largest_velocity, 1)) == ("stick-slip", 12.1)


@pytest.mark.parametrize("told_by", ["velocity", "displacement", "strokes"])
def test_friction_against_speed_is_found_in_a_record(told_by):
    """Steps and strokes about an offset, with friction that falls with the speed."""
    rng = np.random.default_rng(3)
    speeds = np.array([0.2, 1.0, 5.0, 25.0])
    t = np.arange(0.0, 400.0, 0.02)
    stage = (t // 50).astype(int)
    way = np.where(stage % 2, -1.0, 1.0) if told_by == "strokes" else 1.0
    v = way * speeds[stage % 4 if told_by != "strokes" else stage // 2]
    friction = 4.0 + 2.0 / (1.0 + np.abs(v))
    force = way * friction + rng.normal(0.0, 0.05, t.size)
    named = {"measured_velocity": v * rng.normal(1.0, 0.01, t.size)}
    if told_by != "velocity":
        named = {"measured_displacement": np.cumsum(v) * 0.02}
    if told_by == "strokes":
        force = force + 30.0
    found = ss.measure.friction_at_speeds(trace(t, force, **named))
    assert found["velocity"].values == pytest.approx(speeds, rel=0.01)
    off = found["friction"].values - (4.0 + 2.0 / (1.0 + speeds))
    bias = 0.02 if told_by == "strokes" else 0.0  # plateaus at several levels
    assert np.all(np.abs(off) < 4.0 * found["error"].values + bias)
    # for white noise, by its law
    expected = 0.05 / np.sqrt(found["readings"].values)
    assert bias or found["error"].values == pytest.approx(expected, rel=0.5)


def test_a_sinusoidal_test_has_the_friction_of_its_loop():
    """Off the offset of the sensor and the reversals; speeds with few readings go."""
    t = np.arange(0.0, 10.0, 0.002)
    way = 2.5 * np.sin(2.0 * np.pi * t)
    side = np.clip(20.0 * np.cos(2.0 * np.pi * t), -1.0, 1.0)
    force = 0.2 + 4.0 * side + white(t.size, std=0.03)
    data = trace(t, force, measured_displacement=way).assign(mu=("time", force / 10.0))
    seen = regime(data)
    assert (seen.kind, round(seen.mean_mu, 3)) == ("smooth sliding", 0.4)
    assert [each.mean_mu for each in seen.segments] == pytest.approx(
        [0.4] * 21, abs=0.005
    )
    friction = ss.measure.friction_at_speeds(data)["friction"]
    assert friction.values == pytest.approx(0.4, abs=0.005)


def test_friction_against_speed_needs_a_speed():
    t = np.arange(0.0, 10.0, 0.01)
    with pytest.raises(ss.InputError, match="needs a column of the velocity"):
        ss.measure.friction_at_speeds(trace(t, 5.0 + 0.01 * np.sin(t)))

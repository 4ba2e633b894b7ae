"""Sliding force, newborn stretchings, re-attachment on arrest, track scatter: in all
solvers, in closed forms, in files.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from benches import oscillations

import stickslip as ss
from conftest import DISTRIBUTIONS
from stickslip import stability
from stickslip.errors import InputError
from stickslip.io import rig_files
from stickslip.model.newborn import mean_life
from stickslip.rigid import effective_stiffness
from stickslip.theory import attached_fraction

TENTH = ss.Gaussian(mean=1.0, std=0.1)
NARROW = ss.Gaussian(mean=1.0, std=0.02)
SMALLER = ss.Gaussian(mean=0.7, std=0.0)
STRETCHED = ss.Uniform(low=-0.1, high=0.4)
NEWBORNS = [ss.Gaussian(mean=at, std=0.0) for at in (0.3, -0.3)]
NEWBORNS += [STRETCHED, ss.Gaussian(mean=0.1, std=0.3)]


def rig_of(
    interface,
    drive=None,
    *,
    damping=200.0,
    stiffness=2.0,
    mass=1e-4,
    count=1000,
    seed=1,
    start=None,
):
    slider = ss.Slider(stiffness=stiffness, mass=mass, damping=damping)
    drive = drive or ss.constant(1.0, duration=10)
    method = ss.Contacts(count, seed=seed)
    start = start or ss.FromRest()
    return ss.Rig(interface, slider, drive, method=method, start=start)


# ----------------------------------------------------------------------------- contacts

THERE_AND_BACK = ss.ramp(2, -2, duration=4).then(ss.ramp(-2, 2, duration=4))

CREEP = ss.LogarithmicGrowth(slope=0.02, time=0.05)


def reference(rig, dt):
    """One contact after the other in small steps: the rules, without any engine."""
    interface = rig.interface
    slider = rig.slider
    count = rig.method.count
    K = slider.stiffness
    M = slider.mass
    eta = slider.damping
    limit = interface.sliding_force
    delay = interface.delay.time
    stretching = 0.0 if interface.newborn is None else interface.newborn.moment(1)
    strength = interface.threshold_distribution.moment(1)
    growth = interface.ageing
    k = 1.0 if interface.areas is None else math.sqrt(strength)
    # stretchings; times of attachment, or of re-attachment if detached
    x = np.zeros(count)
    back = np.zeros(count)
    on = np.ones(count, dtype=bool)
    X = v = element = 0.0
    direction = 1.0
    rows = []
    pieces = rig.drive.pieces
    times = dt * np.arange(round(rig.drive.duration / dt))
    ends = np.cumsum([0.0, *(piece.duration for piece in pieces)])
    speeds = np.interp(times, ends, [pieces[0].start, *(piece.end for piece in pieces)])
    way = np.append(0.0, np.cumsum(0.5 * dt * (speeds[1:] + speeds[:-1])))
    for t, D in zip(times, way, strict=True):
        force = (k * x[on].sum() + (~on).sum() * element) / count
        rows.append((t, X, v, force, on.mean()))
        force = K * (D - X) - rows[-1][3]
        v = (v * (1 - eta * dt / 2) + force / M * dt) / (1 + eta * dt / 2)
        X += v * dt
        direction = math.copysign(1.0, v) if v else direction
        x += v * dt
        element = min(max(element + v * dt, -limit), limit)
        threshold = strength
        if growth is not None:
            age = np.maximum(t + dt - back, 0.0)
            threshold = strength + growth.slope * np.log1p(age / growth.time)
        broken = on & (k * np.abs(x) >= threshold)
        on[broken] = False
        back[broken] = t + dt + delay
        born = ~on & (back <= t + dt)
        on[born] = True
        x[born] = direction * stretching
    return np.array(rows).T


KEPT = {"areas": ss.model.Areas(SMALLER, kept=True), "ageing": CREEP}


@pytest.mark.parametrize(
    ("changes", "damping"),
    [
        ({"sliding_force": 0.4}, 20.0),
        ({"sliding_force": 0.4}, 1.0),
        ({"newborn": NEWBORNS[0]}, 20.0),
        ({"sliding_force": 0.2, "newborn": ss.Gaussian(mean=-0.2, std=0.0)}, 5.0),
        ({"ageing": CREEP, "sliding_force": 0.4}, 20.0),
        ({"ageing": CREEP, "newborn": NEWBORNS[0]}, 20.0),
        ({"areas": ss.model.Areas(SMALLER), "sliding_force": 0.3}, 20.0),
        (KEPT | {"newborn": ss.Gaussian(mean=0.2, std=0.0)}, 20.0),
    ],
)
def test_the_motion_is_that_of_the_rules_in_small_steps(changes, damping):
    """Equal contacts and a heavy slider: nothing is random, so that samples agree."""
    thresholds = None if "areas" in changes else ss.Gaussian(mean=1.0, std=0.0)
    initial = ss.Gaussian(mean=0.0, std=0.0)
    fields = {"thresholds": thresholds, "initial": initial, "delay": ss.Delay(0.15)}
    interface = ss.Interface(**fields, **changes)
    rig = rig_of(interface, THERE_AND_BACK, damping=damping, mass=0.02, count=3)
    run = ss.simulate(rig)
    dt = 2e-4
    t, X, _, force, attached = reference(rig, dt)
    time = run["time"].to_numpy()
    first = time < 7.9
    at = np.interp(time[first], t, X)
    assert np.ptp(X) > 1.5
    assert np.min(attached) == 0.0
    assert np.max(np.abs(run["displacement"].to_numpy()[first] - at)) < 30 * dt
    expected = np.interp(time[first], t, force)
    away = np.abs(run["friction_force"].to_numpy()[first] - expected)
    assert np.quantile(away, 0.95) < 30 * dt  # except at jumps, some steps late


BELLS = ss.Bell(width=0.02, attempts=1e4), ss.Bell(width=0.1, attempts=1e2)
ARRESTS = {"delay": ss.OnArrest(), "sliding_force": 0.2}
NOTHING = {
    "no attempt": {"activation": ss.Barrier(height=60.0, attempts=1e-12)},
    "no growth": {"ageing": ss.LogarithmicGrowth(slope=0.0, time=1.0)},
    "grown at once": {"ageing": ss.ExponentialGrowth(rate=1e9, newborn=0.9)},
}
FIELDS = {
    "sliding force": {"delay": ss.Delay(0.15), "sliding_force": 0.3},
    "newborns": {"newborn": STRETCHED},
    "arrests": ARRESTS | {"newborn": STRETCHED, "slip_to_slip_scatter": 0.2},
    "random delays": {"delay": ss.RandomDelay(mean=0.1, std=0.1)},
}


@pytest.mark.parametrize("nothing", NOTHING.values(), ids=NOTHING)
@pytest.mark.parametrize("fields", FIELDS.values(), ids=FIELDS)
def test_a_rule_that_changes_nothing_gives_the_run_without_it(nothing, fields):
    cold = ss.Interface(thresholds=TENTH, **fields)
    both = cold, replace(cold, **nothing)
    rigs = [rig_of(each, THERE_AND_BACK, damping=20.0, count=100) for each in both]
    runs = [ss.simulate(rig, output=ss.Output(interval=0.05)) for rig in rigs]
    for name in ("displacement", "friction_force", "attached", "broken_energy"):
        np.testing.assert_allclose(runs[1][name], runs[0][name], rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    "fields",
    [{}, {"newborn": STRETCHED, "delay": ss.Delay(0.1)}, ARRESTS],
    ids=["none", "newborns", "arrests"],
)
@pytest.mark.parametrize("bell", BELLS, ids=str)
def test_contacts_that_share_a_clock_break_as_those_in_boxes(fields, bell):
    """Thresholds that hardly grow give each contact a box: other draws, same law."""
    thresholds = ss.Gaussian(mean=1.0, std=0.3)
    cold = ss.Interface(thresholds=thresholds, activation=bell, **fields)
    apart = replace(cold, ageing=ss.LogarithmicGrowth(slope=1e-9, time=1.0))
    found = []
    for interface, seeds in ((cold, range(20)), (apart, range(100, 120))):
        body = {"damping": 20.0, "mass": 1e-2, "count": 300}
        rigs = (rig_of(interface, THERE_AND_BACK, seed=seed, **body) for seed in seeds)
        runs = [ss.simulate(rig, output=ss.Output(interval=0.05)) for rig in rigs]
        forces = [run["friction_force"].mean() for run in runs]
        attached = [run["attached"].mean() for run in runs]
        energies = [run["broken_energy"][-1] for run in runs]
        found.append(np.transpose([forces, attached, energies]))
    error = np.sqrt(sum(means.var(axis=0, ddof=1) for means in found) / 20)
    apart = np.abs(found[0].mean(axis=0) - found[1].mean(axis=0))
    assert np.all(apart <= 4 * error + 1e-12)


RE_STUCK = ss.Interface(
    thresholds=TENTH,
    delay=ss.OnArrest(),
    sliding_force=0.5,
    newborn=ss.Gaussian(mean=0.5, std=0.0),
)
"""Re-attachment while sliding and when the slider stops: sustained stick-slip."""


def stick_slip(interface, *, duration=1500, interval=0.05, count=100):
    """A soft spring, little damping, a slow drive: the slider stops in each slip."""
    drive = ss.constant(0.05, duration=duration)
    rig = rig_of(interface, drive, damping=20.0, stiffness=0.5, count=count)
    return ss.simulate(rig, output=ss.Output(interval=interval))


def test_contacts_stay_detached_until_the_slider_stops_and_then_all_re_attach():
    run = stick_slip(RE_STUCK)
    attached = run["attached"].to_numpy()
    force = run["spring_force"].to_numpy()
    drops = ss.drops(run)
    assert drops.sizes["event"] > 40
    assert np.mean(attached == 1.0) > 0.9  # before the first breaks and between slips
    # The slider overshoots the point where the detached contacts balance, and stops.
    assert float(drops["force_after"].mean()) < 0.45
    never = stick_slip(replace(RE_STUCK, delay=ss.Delay(math.inf)))
    assert float(never["attached"][-1]) == 0.0
    assert float(never["spring_force"][-1]) == pytest.approx(0.5, abs=1e-3)
    first = int(np.argmax(run["broken_energy"].to_numpy() != 0.0))
    assert force[first - 1] > 0.6
    assert np.allclose(force[:first], never["spring_force"][:first], atol=1e-12)


@pytest.mark.parametrize(("newborn", "let_go"), [(RE_STUCK.newborn, 0.0), (None, 0.5)])
def test_at_an_arrest_contacts_let_go_of_what_is_not_taken_over(newborn, let_go):
    """At the arrest the force drops by the part that newborns do not carry."""
    run = stick_slip(replace(RE_STUCK, newborn=newborn), duration=55, interval=2e-4)
    attached = run["attached"].to_numpy()
    friction = run["friction_force"].to_numpy()
    (back,) = np.flatnonzero(np.diff(attached) > 0.8)
    assert attached[back + 1] == 1.0
    drop = pytest.approx(-let_go * (1.0 - attached[back]), abs=0.02)
    assert friction[back + 1] - friction[back] == drop


@pytest.mark.parametrize(
    "contacts",
    [
        {"thresholds": NARROW},
        {"thresholds": None, "areas": ss.model.Areas(NARROW)},
        {"thresholds": None, "areas": ss.model.Areas(NARROW, kept=True)},
    ],
)
def test_peaks_of_slips_follow_the_factor_of_their_track(contacts):
    peaks = {}
    for scatter in (0.0, 0.15):
        interface = replace(RE_STUCK, slip_to_slip_scatter=scatter, **contacts)
        run = stick_slip(interface, count=200)
        peaks[scatter] = ss.drops(run)["force_before"].to_numpy()[1:]
    n = peaks[0.15].size
    assert n > 30
    assert peaks[0.0].std() < 0.02
    mean = peaks[0.0].mean()
    assert peaks[0.15].mean() == pytest.approx(mean, abs=4 * 0.15 / math.sqrt(n))
    assert peaks[0.15].std() == pytest.approx(0.15 * mean, rel=4 / math.sqrt(2 * n))


def peaks_of_a_block(method, scatter):
    interface = ss.Interface(thresholds=NARROW, delay=ss.Delay(0.1))
    interface = replace(interface, slip_to_slip_scatter=scatter)
    alone = ss.Chain(blocks=2, coupling=1e-6, mass=1e-4, damping=100.0, leaf=0.3)
    run = ss.simulate(ss.Rig(interface, alone, ss.constant(1.0, 150.0), method=method))
    force = run["friction_force"].isel(block=0).rename("spring_force")
    return ss.drops(force.to_dataset())["force_before"][1:]


@pytest.mark.parametrize("method", [ss.Contacts(200, 1), ss.QuasiStatic(200, 1)])
def test_each_block_of_a_chain_goes_from_track_to_track(method):
    peaks = peaks_of_a_block(method, 0.15)
    none = peaks_of_a_block(method, 0.0)
    assert peaks.size > 25
    assert float(none.std() / none.mean()) < 0.02
    mean = float(peaks.mean() / none.mean())
    assert mean == pytest.approx(1.0, abs=4 * 0.15 / math.sqrt(peaks.size))
    std = float(peaks.std() / none.mean())
    assert std == pytest.approx(0.15, rel=4 / math.sqrt(2 * peaks.size))


def test_blocks_that_never_stop_keep_their_track():
    """The friction of each block is that of smooth sliding times its factor."""
    interface = ss.Interface(thresholds=TENTH, delay=ss.Delay(0.05))
    interface = replace(interface, slip_to_slip_scatter=0.2)
    loose = ss.Chain(blocks=60, coupling=1e-3, mass=1e-3, damping=200.0, leaf=20.0)
    how = {"method": ss.Contacts(300, seed=2), "start": ss.FromSliding()}
    rig = ss.Rig(interface, loose, ss.constant(1.0, 6.0), **how)
    steady = ss.kinetic_friction(replace(interface, slip_to_slip_scatter=0.0), 1.0)
    friction = ss.simulate(rig)["friction_force"].mean("time") / steady
    assert float(friction.mean()) == pytest.approx(1.0, abs=4 * 0.2 / math.sqrt(60))
    assert float(friction.std()) == pytest.approx(0.2, rel=4 / math.sqrt(120))


# ------------------------------------------------------------------------- closed forms


def test_steady_force_in_numbers():
    interface = ss.Interface(thresholds=TENTH, delay=ss.Delay(0.1), sliding_force=0.3)
    expected = (0.505 + 0.3 * 0.15) / 1.15
    assert ss.kinetic_friction(interface, 1.5) == pytest.approx(expected, rel=1e-12)
    life = mean_life(replace(interface, newborn=ss.Gaussian(mean=0.25, std=0.0)))
    assert life == pytest.approx((0.75, (1.01 - 0.0625) / 2), rel=1e-12)
    # Friction falls with velocity only below k m2/(2 m1) = .505.
    carried = [replace(interface, sliding_force=force) for force in (0.504, 0.506)]
    forces = [ss.kinetic_friction(each, np.array([1.0, 2.0])) for each in carried]
    slope = [after - before for before, after in forces]
    assert slope[0] < 0 < slope[1]


FIG7 = ss.Interface(thresholds=TENTH, delay=ss.Delay(0.1))
HOT = {"activation": ss.Bell(width=0.01, attempts=1e6)}
SLOW = pytest.mark.slow
CARRIED = [(0.0, ()), (0.1, SLOW), (0.3, ())]
DELAYS = [(0.1, ()), (0.13, SLOW), (0.2, ())]


def grown(fields, velocity=1.5, rtol=1e-7, marks=()):
    return pytest.param(fields, velocity, 42.426, rtol, marks=marks)


@pytest.mark.parametrize(
    ("fields", "velocity", "damping", "rtol"),
    [
        *(grown({"sliding_force": f}, marks=marks) for f, marks in CARRIED),
        *(
            grown({"sliding_force": f, "newborn": NEWBORNS[0]}, marks=marks)
            for f, marks in CARRIED
        ),
        *(grown({"delay": ss.Delay(t)}, 1.0, marks=marks) for t, marks in DELAYS),
        ({"delay": ss.Delay(0.2)}, 1.0, 200.0, 1e-7),
        grown({"delay": ss.RandomDelay(mean=0.2, std=0.06)}, 2.0),
        grown(HOT, rtol=1e-5, marks=SLOW),
    ],
)
@pytest.mark.eq(11)
def test_the_master_equation_grows_as_linear_theory(fields, velocity, damping, rtol):
    """The growth rate in the difference of two perturbed runs."""
    interface = replace(FIG7, **fields)
    interval = 0.02
    rig = rig_of(interface, ss.constant(velocity, duration=14.0), damping=damping)
    how = {
        "method": ss.MasterEquation(rtol=rtol),
        "output": ss.Output(interval=interval),
    }
    starts = (ss.FromSliding(perturbation=change) for change in (1e-3, -1e-3))
    one, two = (ss.simulate(rig, start=start, **how) for start in starts)
    force = ss.kinetic_friction(interface, velocity)
    assert float(one.friction_force[0]) == pytest.approx(force, rel=rtol)
    apart = (one.displacement - two.displacement).to_numpy()
    found = oscillations(apart[100:], interval)
    root = stability.growth_rate(rig)
    assert found[np.argmin(np.abs(found - root))] == pytest.approx(root, abs=1e-4)


def roots_counted_on_a_contour(rig, reach=400.0):
    """Return the number of roots with ``Re s > 0``, from phases along a half circle."""
    slider = rig.slider
    interface = rig.interface
    v = rig.velocity

    def total(s):
        z = slider.stiffness + slider.mass * s * s + slider.mass * slider.damping * s
        return z + stability.dynamic_stiffness(interface, v, s)

    slow = np.geomspace(1e-6, 1, 2000)
    up = 1j * np.append(slow, np.linspace(1, reach, 200_000))
    turned = np.sum(np.angle(total(up)[1:] / total(up)[:-1]))
    arc = reach * np.exp(1j * np.linspace(math.pi / 2, 0, 2001))
    turned_back = np.sum(np.angle(total(arc)[1:] / total(arc)[:-1]))
    return -round((turned + turned_back) / math.pi)


@pytest.mark.parametrize("sliding_force", [0.0, 0.1, 0.5, 0.9, 1.5])
@pytest.mark.parametrize(("velocity", "stiffness"), [(0.3, 0.2), (1.5, 0.5), (4, 2)])
@pytest.mark.parametrize("damping", [0.0, 42.0])
def test_unstable_modes_are_all_counted(sliding_force, velocity, stiffness, damping):
    """A sliding force keeps the response large at high frequencies: modes may hide."""
    interface = replace(FIG7, sliding_force=sliding_force)
    body = {"damping": damping, "stiffness": stiffness}
    rig = rig_of(interface, ss.constant(velocity), **body)
    counted = stability.count_unstable(rig)
    assert counted == roots_counted_on_a_contour(rig)
    assert (stability.growth_rate(rig).real > 0) == (counted > 0)


WIDE = ss.Gaussian(mean=1.0, std=0.2)
SCATTERED = ss.RandomDelay(mean=0.3, std=0.1)
SOME_DELAYS = ss.Delay(0.0), ss.Delay(0.2), ss.Delay(math.inf), SCATTERED


@pytest.mark.parametrize(
    ("newborn", "delay"),
    [
        *((None, delay) for delay in SOME_DELAYS),
        *((newborn, delay) for newborn in NEWBORNS for delay in SOME_DELAYS[:2]),
        (NEWBORNS[0], SCATTERED),
    ],
)
@pytest.mark.eq(1, 2, 3, 4)
def test_rigid_motion_is_that_of_contacts_and_of_cohorts(newborn, delay):
    """The stiffness of the interface is the slope of its force."""
    interface = ss.Interface(
        thresholds=WIDE if newborn else TENTH,
        delay=delay,
        sliding_force=0.4,
        newborn=newborn,
    )
    method = ss.model.Renewal(600) if newborn else ss.model.Renewal()
    count = 20_000 if newborn else 100_000
    exact = ss.rigid_slide(interface, 3.0, method=method)
    X = exact["displacement"].to_numpy()
    # For cohorts second order in the step of 1/400 of x_s, times curvatures of some
    # (1/.1)^2.
    for solver, slack in (
        (ss.Contacts(count, seed=2), 5 * 0.5 / math.sqrt(count)),
        (ss.MasterEquation(), 3e-4),
    ):
        run = ss.rigid_slide(interface, 3.0, method=solver)
        for name in ("friction_force", "attached"):
            found = np.interp(run["displacement"], X, exact[name])
            assert np.max(np.abs(found - run[name])) < slack
    force = exact["friction_force"].to_numpy()
    slope = (force[2:] - force[:-2]) / (X[2:] - X[:-2])
    # except at the kink where all detached contacts begin to slide
    smooth = np.abs(X[1:-1] - 0.4) > (0.02 if newborn else 0.01)
    expected = exact["stiffness"][1:-1][smooth]
    assert np.allclose(slope[smooth], expected, atol=2e-3 if newborn else 2e-4)


@pytest.mark.parametrize("delay", [0.0, 0.2])
@pytest.mark.parametrize(
    ("thresholds", "newborn"),
    [
        *((each, None) for each in DISTRIBUTIONS.values()),
        *((WIDE, each) for each in NEWBORNS),
    ],
    ids=str,
)
def test_rigid_motion_ends_in_the_steady_state(thresholds, newborn, delay):
    """The deviation decays as exp(-X q), q = 2 pi^2 variance/(m1 + v tau)^3 >= .11."""
    fields = {"delay": ss.Delay(delay), "sliding_force": 0.25, "newborn": newborn}
    interface = ss.Interface(thresholds=thresholds, **fields)
    last = ss.rigid_slide(interface, 160.0).isel(displacement=-1)
    force = ss.kinetic_friction(interface, 1.0)
    assert float(last["friction_force"]) == pytest.approx(force, abs=1e-7)
    attached = attached_fraction(interface, 1.0)
    assert float(last["attached"]) == pytest.approx(attached, abs=1e-7)
    rate = 1.0 / (mean_life(interface)[0] + delay)
    assert float(last["breaking_rate"]) == pytest.approx(rate, abs=1e-6)
    assert float(last["stiffness"]) == pytest.approx(0.0, abs=1e-6)


def test_newborns_enter_the_falling_force_where_contacts_re_attach():
    plain = ss.Interface(thresholds=TENTH)
    for newborn in NEWBORNS:
        interface = replace(plain, newborn=newborn)
        stiffness = effective_stiffness(interface, np.linspace(0.0, 3.0, 3001))
        steepest = float(np.max(stiffness))
        assert ss.critical_stiffness(interface) == pytest.approx(steepest, rel=1e-4)
        never = ss.critical_stiffness(interface, reattachment=False)
        expected = ss.critical_stiffness(plain, reattachment=False)
        assert never == pytest.approx(expected, rel=1e-9)
        run = ss.rigid_slide(interface, 3.0, method=ss.Contacts(40_000, seed=1))
        largest = float(run["friction_force"].max())
        error = 0.5 / math.sqrt(40_000)
        assert ss.static_friction(interface)[0] == pytest.approx(largest, abs=5 * error)


def test_the_critical_stiffness_knows_the_sliding_force_where_contacts_stay_away():
    plain = ss.Interface(thresholds=TENTH)
    sliding = replace(plain, sliding_force=0.4)
    assert ss.critical_stiffness(plain) == ss.critical_stiffness(sliding)
    assert ss.static_friction(plain) == ss.static_friction(sliding)
    never = [ss.critical_stiffness(one, reattachment=False) for one in (plain, sliding)]
    # The force falls as contacts break, each of which now keeps .4 of about 1.
    assert never[1] == pytest.approx(0.6 * never[0], rel=0.07)


# ---------------------------------------------------------------------------- rig files


@pytest.mark.parametrize("sliding_force", ["0 N", "100 N"])
def test_at_the_speed_v_half_the_friction_has_halved(sliding_force):
    document = rig_files.to_document(rig_files.example("pmma_slider"))
    del document["interface"]["delay"]
    document["interface"] |= {"v_half": "1.3 mm/s", "sliding_force": sliding_force}
    rig = rig_files.from_document(document)
    at = rig.scales.natural(1.3e-3, "velocity")
    half = pytest.approx(0.5 * ss.kinetic_friction(rig.interface), rel=1e-12)
    assert ss.kinetic_friction(rig.interface, at) == half
    document["interface"]["sliding_force"] = "300 N"
    message = r"interface\.v_half: the friction never halves"
    with pytest.raises(InputError, match=message):
        rig_files.from_document(document)

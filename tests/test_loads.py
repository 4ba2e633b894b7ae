"""A normal load that changes in time, and a force in place of a velocity."""

import math

import numpy as np
import pytest
from benches import imbalance
from refusals import refused

import stickslip as ss
from stickslip.errors import InputError
from stickslip.io.rig_files import from_document, to_document
from stickslip.model import Mass, pull

TENTH = ss.Gaussian(mean=1.0, std=0.1)
BROAD = ss.Gaussian(mean=1.0, std=0.3)
START = ss.Gaussian(mean=0.0, std=0.2)
SLIDER = ss.Slider(stiffness=2.0, mass=1e-2, damping=10.0)
DELAYED = ss.Interface(thresholds=BROAD, delay=ss.Delay(0.1))
AT_ONCE = ss.Interface(thresholds=BROAD, initial=START)
CURVE = ss.model.TabulatedGrowth((0.1, 0.3, 1.0), (0.5, 1.0, 1.1))
SCATTERED = ss.RandomDelay(mean=0.1, std=0.05)
FIELDS = [
    {"delay": SCATTERED, "newborn": ss.Uniform(low=0.0, high=0.2)},
    {"delay": ss.OnArrest(), "slip_to_slip_scatter": 0.2},
    {"ageing": ss.ExponentialGrowth(rate=2.0)},
    {"ageing": CURVE},
]
INTERFACES = [DELAYED, *(ss.Interface(thresholds=TENTH, **more) for more in FIELDS)]
FEW = ss.Contacts(200, seed=1)
LENGTHS = ("displacement", "velocity", "spring_force", "friction_force")


def pulled(interface, drive, slider=SLIDER, method=FEW, **options):
    return ss.Rig(interface, slider, drive, method=method, **options)


@pytest.mark.parametrize("start", [ss.FromRest(), ss.FromSliding()], ids=repr)
@pytest.mark.parametrize("interface", INTERFACES, ids=range(len(INTERFACES)))
def test_under_a_load_all_lengths_and_forces_are_as_much_larger(interface, start):
    """Exact to the last bit for a power of two, except where roots are searched."""
    if isinstance(start, ss.FromSliding) and "on_arrest" in interface.mechanisms:
        start = ss.FromRest()
    usual = pulled(interface, ss.constant(1.0, 5.0), start=start)
    run = ss.simulate(usual)
    same = ss.simulate(usual.replace(drive=usual.drive.under([(1.0, 1.0), (2.0, 1.0)])))
    assert same.drop_vars("load").equals(run)
    heavy = ss.simulate(usual.replace(drive=ss.constant(4.0, 5.0).under(4.0)))
    for name in LENGTHS:
        exact = 0.0 if interface.ageing is None else 1e-11
        expected = pytest.approx(4.0 * run[name].values, rel=exact, abs=exact)
        assert heavy[name].values == expected, name


def test_contacts_that_hold_keep_their_strength_and_sliding_reaches_the_new_friction():
    """Under a load `L` the friction at `v` is `L` times that at ``v/L``."""
    stiff = ss.Slider(stiffness=20.0, mass=1e-3, damping=100.0)
    drive = ss.constant(1.0, 80.0)
    rig = pulled(DELAYED, drive, stiff, ss.Contacts(1000), start=ss.FromSliding())
    before = ss.simulate(rig)
    after = ss.simulate(rig.replace(drive=drive.under([(20.0, 1.0), (20.0, 3.0)])))
    force = after["friction_force"]
    early = slice(0.0, 20.0)
    expected = before["friction_force"].sel(time=early)
    np.testing.assert_array_equal(force.sel(time=early), expected)
    just_after = force.sel(time=20.01, method="nearest")
    assert just_after == pytest.approx(float(force.sel(time=early)[-1]), abs=0.02)
    # a life takes some 3 x_s here
    late = force.sel(time=slice(26.0, None)).values
    parts = np.array([part.mean() for part in np.array_split(late, 9)])
    error = parts.std(ddof=1) / 3.0
    expected = 3.0 * ss.kinetic_friction(DELAYED, velocity=1.0 / 3.0)
    assert error < 0.02 * expected
    assert abs(late.mean() - expected) < 4.0 * error
    assert imbalance(after) < 1e-9
    assert set(np.unique(after["load"])) == {1.0, 3.0}


def test_the_picture_of_a_run_shows_a_load_that_changes():
    drive = ss.constant(1.0, 5.0)
    for drawn, panels in ((drive, 3), (drive.under([(1.0, 1.0), (2.0, 3.0)]), 4)):
        assert len(ss.plot.overview(ss.simulate(pulled(DELAYED, drawn))).axes) == panels


def test_a_verdict_is_of_the_last_load_and_a_force_has_none():
    def seen(drive, **options):
        return ss.regime(ss.simulate(pulled(DELAYED, drive, **options)))

    ramp = [(1.0, 1.0), (10.0, 6.0)]
    assert "load changes until 10" in seen(ss.constant(1.0, 10.0).under(ramp)).reason
    held = seen(ss.constant(1.0, 40.0).under(ramp))
    assert held.kind != "undecided"
    assert held.window[0] >= 10.0
    for force, moves in ((0.3, "rests"), (0.9, "slides")):
        told = seen(pull(force, duration=20.0), slider=Mass(mass=1.0))
        assert told.kind == "undecided"
        assert moves in told.reason


def test_at_rest_a_larger_load_changes_nothing():
    drive = ss.constant(1.0, 2.0).then(ss.constant(0.0, 2.0))
    rig = pulled(AT_ONCE, drive)
    run = ss.simulate(rig)
    hold = slice(3.0, None)  # from when the slider has come to rest
    loaded = ss.simulate(rig.replace(drive=drive.under([(3.0, 1.0), (3.5, 9.0)])))
    assert np.ptp(run["friction_force"].sel(time=hold).values) < 1e-3
    assert loaded.drop_vars("load").equals(run)


def test_a_force_moves_a_mass_beyond_the_static_friction_by_what_it_has_in_excess():
    many = ss.Contacts(10_000)
    static, _ = ss.static_friction(AT_ONCE)
    kinetic = ss.kinetic_friction(AT_ONCE, velocity=1.0)
    noise = 0.5 / math.sqrt(many.count)  # bound for the force of a contact
    rises = pull(0.0, 1.2 * static, duration=200.0)
    slow = ss.simulate(pulled(AT_ONCE, rises, Mass(mass=0.01, damping=5.0), many))
    onset = slow["spring_force"][int(np.argmax(slow["velocity"].values > 0.5))]
    assert onset == pytest.approx(static, abs=4.0 * noise)
    half = pull(0.5 * static, duration=50.0)
    sticks = ss.simulate(pulled(AT_ONCE, half, Mass(mass=0.1), many))
    assert sticks["displacement"].max() < 1.5
    pushed = pulled(AT_ONCE, pull(2.0 * static, duration=20.0), Mass(mass=2.0), many)
    run = ss.simulate(pushed)
    speed = run["velocity"].sel(time=slice(5.0, None))
    rate = float((speed[-1] - speed[0]) / (speed.time[-1] - speed.time[0]))
    assert rate == pytest.approx((2.0 * static - kinetic) / 2.0, abs=noise)
    assert imbalance(run) < 1e-9
    assert "spring_energy" not in run
    assert ss.rerun(run).identical(run)


@pytest.mark.parametrize("damping", [0.0, 0.7])
def test_a_mass_that_nothing_holds_moves_as_newton_says(damping):
    gone = ss.Interface(thresholds=TENTH, delay=ss.Delay(math.inf))
    drive = pull(2.0, 1.0, duration=4.0).then(pull(-1.0, duration=4.0))
    run = ss.simulate(pulled(gone, drive, Mass(mass=0.5, damping=damping)))
    assert imbalance(run) < 1e-11
    for begin, end, first, rate in ((2.5, 4.0, 1.375, -0.25), (4.5, 8.0, -1.0, 0.0)):
        part = run.sel(time=slice(begin, end - 1e-9))
        assert not part["attached"].any()
        t = part["time"].values - float(part["time"][0])
        expected = first + rate * (float(part["time"][0]) - begin)
        assert float(part["spring_force"][0]) == pytest.approx(expected, abs=1e-12)
        force = float(part["spring_force"][0])
        v = float(part["velocity"][0])
        if damping == 0.0:
            exact = v + (force * t + 0.5 * rate * t**2) / 0.5
        else:
            slope = rate / (0.5 * damping)
            steady = force / (0.5 * damping) - slope / damping
            exact = steady + slope * t + (v - steady) * np.exp(-damping * t)
        np.testing.assert_allclose(part["velocity"], exact, atol=1e-11)


STEPPED = ss.ramp(1.0, 2.0, 0.6).under([(0.0, 1.0), (0.3, 2.0)])


@pytest.mark.parametrize(
    ("slider", "first", "second"),
    [
        (SLIDER, ss.constant(1.0, 0.7).under(2.0), ss.ramp(1.0, 0.2, 0.6)),
        (SLIDER, ss.constant(1.0, 0.7), STEPPED),
        (Mass(mass=0.1), pull(0.0, 0.9, duration=0.7), pull(0.3, duration=0.6)),
    ],
    ids=["load stays", "load", "force"],
)
def test_a_run_goes_on_bit_for_bit(slider, first, second):
    output = ss.Output(interval=0.05, state=True)
    rig = pulled(DELAYED, first, slider, output=output)
    whole = ss.simulate(rig.replace(drive=first.then(second)))
    joined = ss.simulate(rig.replace(drive=second), start=ss.simulate(rig))
    assert joined.drop_vars("engine_state").identical(whole.drop_vars("engine_state"))


INTERFACE = {
    "contact_strength": "100 N",
    "normal_load": "200 N",
    "breaking_displacement": "2 um",
    "thresholds": {"distribution": "gaussian", "std": 0.1},
    "delay": "1 ms",
}
LOADED = {"velocity": "1 mm/s", "duration": "20 ms"}
BRAKE = {
    "slider": {"mass": "1 kg", "stiffness": "1 MN/m", "damping": "10 1/s"},
    "interface": INTERFACE,
    "drive": LOADED | {"load": [["0 s", "100 N"], ["7.3 ms", 1.7]]},
    "simulation": {"contacts": 100},
}
FORCES = [
    {"start": "-3 N", "end": "90 N", "duration": "7.7 ms"},
    {"start": "60 N", "end": "60 N", "duration": "1.1 ms"},
]
WEIGHT = BRAKE | {"slider": {"mass": "1 kg"}, "drive": {"force": FORCES}}


def test_a_file_gives_loads_and_forces_at_times():
    brake = from_document(BRAKE)
    assert [point.load for point in brake.drive.load] == [0.5, 1.7]
    run = ss.simulate(brake)
    assert float(run["load"][0]) == 0.5
    assert float(run["load"][-1]) == 1.7
    weight = from_document(WEIGHT)
    assert weight.drive.force[0].start == -0.03
    assert ss.simulate(weight)["spring_force"].max() == pytest.approx(90.0)
    for rig in (brake, weight):
        assert from_document(to_document(rig)).replace(given=()) == rig
    constant = {"force": "40 N", "duration": "3 ms"}
    drive = from_document(WEIGHT | {"drive": constant}).drive
    assert [(p.start, p.end) for p in drive.force] == [(0.4, 0.4)]


@pytest.mark.parametrize(
    ("document", "changes", "words"),
    [
        (BRAKE, {"load": "-1 N"}, "drive.load = '-1 N': must be above 0"),
        (BRAKE, {"load": 0.0}, "drive.load = 0.0: must be above 0"),
        (BRAKE, {"load": "3 mm"}, "drive.load = '3 mm'"),
        (BRAKE, {"load": [["0 s", "3 kg"]]}, "drive.load = '3 kg'"),
        (BRAKE, {"load": [["0 s", 1.0, 2.0]]}, "drive.load[0] = "),
        (BRAKE, {"load": [[0, 1.0]]}, "drive.load[0] = 0: has no unit"),
        (BRAKE, {"load": [["2 s", 1.0], ["1 s", 1.0]]}, "drive.load[1]: is at 1"),
        (BRAKE, {"load": []}, "drive.load"),
        (BRAKE, {"force": "3 N"}, "give velocity or pieces or force, not both"),
        (WEIGHT, {"distance": "1 mm"}, "not both"),
        (WEIGHT, {"force": [{"start": 3.0}]}, "force[0].start = 3.0: has no unit"),
        (WEIGHT, {"force": []}, "drive.force = []: must be a list"),
        (WEIGHT, {"force": "3 m"}, "drive.force = '3 m'"),
        (WEIGHT, {"force": "3 N"}, "drive.duration: is missing"),
        (WEIGHT, {"duration": "3 ms"}, "has durations; leave drive.duration out"),
    ],
)
def test_what_a_file_gives_wrongly_is_said_in_one_line(document, changes, words):
    with pytest.raises(InputError) as error:
        from_document(document | {"drive": document["drive"] | changes})
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_a_load_in_newtons_needs_the_normal_load_and_a_force_no_spring():
    interface = {k: v for k, v in INTERFACE.items() if k != "normal_load"}
    with pytest.raises(InputError, match=r"interface.normal_load: is missing"):
        from_document(BRAKE | {"interface": interface})
    with pytest.raises(InputError, match=r"slider.stiffness: drive.force pulls a mass"):
        from_document(WEIGHT | {"slider": BRAKE["slider"]})


LOADED = pulled(DELAYED, ss.constant(1.0, 5.0).under(2.0))
FORCED = pulled(DELAYED, pull(0.3, duration=5.0), Mass(mass=1.0))
CHAIN = ss.Chain(blocks=3, coupling=9.0, mass=1.0, damping=0.1, leaf=0.2)
ONE = {"masses": (1.0,), "stiffnesses": (1.0,), "dampings": (0.1,)}
MODES = ss.model.Modes(**ONE, contact=(1.0,))


def of(rig, **mechanism):
    """A run of contacts with a further mechanism."""
    interface = ss.Interface(thresholds=TENTH, **mechanism)
    return ss.simulate(rig.replace(interface=interface))


UNDER_THEM = (
    lambda rig: ss.simulate(rig, method=ss.MasterEquation()),
    lambda rig: ss.simulate(rig, method=ss.Population(100)),
    lambda rig: ss.simulate(rig.replace(slider=CHAIN)),
    lambda rig: ss.simulate(rig.replace(slider=MODES)),
    lambda rig: of(rig, ageing=ss.LogarithmicGrowth(slope=0.1, time=1.0)),
    lambda rig: of(rig, ageing=ss.ExponentialGrowth(rate=1.0, newborn=0.1)),
    lambda rig: of(rig, ageing=ss.Langevin(rate=1.0)),
    lambda rig: of(rig, activation=ss.Bell(width=0.01, attempts=1e3)),
    lambda rig: of(rig, sliding_force=0.1),
    lambda rig: ss.predict(rig),
    lambda rig: ss.growth_rate(rig),
    lambda rig: ss.Element(rig),
    lambda rig: ss.critical(rig, "stiffness"),
    lambda rig: ss.sustained(rig, "stiffness", between=(1.0, 3.0)),
    lambda rig: ss.sweep(rig, {"stiffness": [1.0, 2.0]}, store=None),
    r"Drive\.(load|force)",
)


@refused(*UNDER_THEM)
@pytest.mark.parametrize("rig", [LOADED, FORCED], ids=["load", "force"])
def test_all_else_refuses_them_in_one_line(call, message, rig):
    if rig is FORCED:
        rig = rig.replace(slider=SLIDER)
    with pytest.raises(InputError, match=message) as error:
        call(rig)
    assert "\n" not in str(error.value)


NO_DRIVE = (
    lambda: ss.constant(1.0).under([(2.0, 1.0), (1.0, 1.0)]),
    lambda: ss.constant(1.0).under(0.0),
    lambda: ss.constant(1.0).under("2 N"),
    lambda: ss.constant(1.0).under([]),
    lambda: ss.constant(1.0).then(pull(0.3, duration=5.0)),
    lambda: pull(0.3, duration=0.0),
    lambda: pull(math.inf, duration=2.0),
    lambda: ss.model.Drive(load=((0.0, 1.0),)),
    lambda: FORCED.velocity,
    lambda: LOADED.velocity,
    lambda: ss.simulate(FORCED.replace(drive=ss.constant(1.0))),
    lambda: ss.predict(FORCED.replace(drive=ss.constant(1.0))),
    lambda: ss.simulate(FORCED.replace(start=ss.FromSliding())),
    r"^[^\n]*$",
)


@refused(*NO_DRIVE)
def test_a_drive_that_cannot_be_is_refused_in_one_line(call, message):
    with pytest.raises(InputError, match=message):
        call()

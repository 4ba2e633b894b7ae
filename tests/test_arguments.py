"""Arguments that cannot be meant: every public function refuses them in one line of bearable length."""

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip import theory
from stickslip.errors import LARGEST, LONGEST_MESSAGE, SMALLEST, InputError, number, numbers, sequence, whole

THRESHOLDS = ss.Gaussian(mean=1.0, std=0.1)
INTERFACE = ss.Interface(thresholds=THRESHOLDS, delay=ss.Delay(0.2))
AGEING = ss.Interface(thresholds=THRESHOLDS, ageing=ss.Langevin(rate=1.0))
SLIDER = ss.Slider(stiffness=2.0, mass=1e-4, damping=200.0)
DRIVE = ss.constant(1.0, duration=1.0)


class Nothing:
    """An object of no kind, named alike in every process."""

    def __repr__(self):
        return "nothing"


NO_NUMBERS = ["1", b"1", None, True, [], np.array(["1"]), 1j, {}, Nothing(), [1.0, "a"], [[1.0], [2.0, 3.0]], [True]]
NO_SIZES = [math.nan, [1.0, math.nan], 1e300, -1.0, [1.0, -1.0]]
NO_RECORDS = [None, 3, "slider", [1.0], True, Nothing(), 1j]

RIG = ss.Rig(INTERFACE, SLIDER, DRIVE)

VELOCITIES = {
    "kinetic_friction": lambda v: ss.kinetic_friction(INTERFACE, v),
    "attached_fraction": lambda v: theory.attached_fraction(INTERFACE, v),
    "ageing friction": lambda v: ss.kinetic_friction(AGEING, v),
    "closure_friction": lambda v: theory.closure_friction(AGEING, v),
    "slip_displacement": lambda t: theory.slip_displacement(SLIDER, 1.0, t),
}
SPEEDS = {
    "count_unstable": lambda v: ss.stability.count_unstable(RIG.replace(velocity=v)),
    "growth_rate": lambda v: ss.growth_rate(RIG.replace(velocity=v)),
    "is_sustained": lambda v: ss.is_sustained(RIG.replace(velocity=v)),
    "bistable_range": lambda v: ss.bistable_range(RIG, "velocity", between=v),
    "sustained": lambda v: ss.sustained(RIG, "velocity", between=v),
    "critical": lambda v: ss.critical(RIG, "velocity", between=(v, 10.0)),
    "rigid_slide": lambda v: ss.rigid_slide(INTERFACE, v),
}
INTERFACES = {
    "kinetic_friction": lambda i: ss.kinetic_friction(i, 1.0),
    "closure_friction": lambda i: theory.closure_friction(i, 1.0),
    "static_friction": ss.static_friction,
    "critical_stiffness": ss.critical_stiffness,
    "rig": lambda i: ss.Rig(i, SLIDER, DRIVE),
}
SLIDERS = {
    "slip_displacement": lambda s: theory.slip_displacement(s, 1.0, 1.0),
    "rig": lambda s: ss.Rig(INTERFACE, s, DRIVE),
}
RIGS = {
    "simulate": ss.simulate,
    "predict": ss.predict,
    "growth_rate": ss.growth_rate,
    "count_unstable": ss.stability.count_unstable,
    "is_sustained": ss.is_sustained,
    "critical": lambda rig: ss.critical(rig, "velocity", between=(0.1, 10)),
    "sustained": lambda rig: ss.sustained(rig, "delay", between=(0.1, 1)),
    "bistable_range": lambda rig: ss.bistable_range(rig, "velocity", between=(0.1, 1)),
    "stability_map": lambda rig: ss.stability_map(rig, over=("velocity", "stiffness"), values=([1.0], [1.0])),
}
OTHERS = {
    "snapshots": lambda v: ss.Output(snapshots=v),
    "memoryless": lambda v: ss.MasterEquation(memoryless=v),
    "progress": lambda v: ss.simulate(RIG, progress=v),
    "reattachment": lambda v: ss.critical_stiffness(INTERFACE, reattachment=v),
    "regime": ss.regime,
    "load": ss.load,
    "rerun": ss.rerun,
    "edges": lambda v: ss.Empirical(edges=v, weights=(1.0,)),
    "samples": ss.Empirical.from_samples,
}


def refused(call, value):
    with pytest.raises(InputError) as caught:
        call(value)
    message = str(caught.value)
    assert len(message) <= LONGEST_MESSAGE
    assert "\n" not in message
    return message


@pytest.mark.parametrize("call", [*VELOCITIES.values(), *SPEEDS.values()], ids=[*VELOCITIES, *SPEEDS])
@pytest.mark.parametrize("value", [*NO_NUMBERS, *NO_SIZES], ids=repr)
def test_what_is_no_speed(call, value):
    refused(call, value)


@pytest.mark.parametrize("call", SPEEDS.values(), ids=SPEEDS)
@pytest.mark.parametrize("value", [5e-324, 1e-300, 1e300, 0])
def test_speeds_out_of_all_proportion(call, value):
    refused(call, value)


@pytest.mark.parametrize(
    "call", [*INTERFACES.values(), *SLIDERS.values(), *RIGS.values()], ids=[*INTERFACES, *SLIDERS, *RIGS]
)
@pytest.mark.parametrize("value", NO_RECORDS, ids=repr)
def test_what_is_no_record(call, value):
    refused(call, value)


@pytest.mark.parametrize("call", OTHERS.values(), ids=OTHERS)
@pytest.mark.parametrize("value", [3.0, "no", b"no", 1j, Nothing()], ids=repr)
def test_other_arguments(call, value):
    refused(call, value)


def test_arrays_of_speeds_are_taken():
    speeds = np.array([[0.5, 1.0], [2.0, 4.0]])
    assert ss.kinetic_friction(INTERFACE, speeds).shape == (2, 2)
    assert ss.kinetic_friction(INTERFACE, [0.5, 1]) == pytest.approx(ss.kinetic_friction(INTERFACE, speeds)[0])
    assert ss.kinetic_friction(INTERFACE, np.float32(1)) == ss.kinetic_friction(INTERFACE, 1)


@pytest.mark.parametrize(
    "make",
    [
        lambda size: ss.Delay(size),
        lambda size: ss.Slider(stiffness=size, mass=1.0, damping=1.0),
        lambda size: ss.Slider(stiffness=1.0, mass=size, damping=1.0),
        lambda size: ss.Slider(stiffness=1.0, mass=1.0, damping=size),
        lambda size: ss.Gaussian(mean=1.0, std=size),
        lambda size: ss.Gamma(mean=size, std=0.1),
        lambda size: ss.LogNormal(mean=1.0, std=size),
        lambda size: ss.Weibull(scale=size, shape=1.0),
        lambda size: ss.Langevin(rate=size),
        lambda size: ss.Output(interval=size),
    ],
)
@pytest.mark.parametrize("size", [5e-324, 1e-300, 0.9 * SMALLEST, 1.1 * LARGEST, 1e300, 10**400])
def test_no_record_takes_a_size_out_of_all_proportion(make, size):
    refused(make, size)


def test_sizes_at_the_bounds():
    for size in (0, SMALLEST, 1.0, LARGEST):
        assert number("place", size, at_least=0) == size
    assert number("place", -1e-300) == -1e-300  # a speed may come that near to 0
    assert number("place", math.inf, infinite=True) == math.inf
    assert whole("place", 2**100, at_least=0) == 2**100  # a seed has no size
    assert numbers("place", [[0, 1], [2, 3]], at_least=0).dtype == float
    assert sequence("place", np.array([1.0, 2.0]), "numbers") == (1.0, 2.0)


@pytest.mark.parametrize(
    ("call", "std", "words"),
    [
        (ss.static_friction, 1e-29, "next to equal"),
        (ss.critical_stiffness, 1e-29, "next to equal"),
        (ss.static_friction, 1e-6, "points are needed"),
        (ss.critical_stiffness, 1e-6, "points are needed"),
    ],
)
def test_thresholds_too_narrow_to_be_resolved(call, std, words):
    interface = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=std))
    assert words in refused(call, interface)


def test_thresholds_too_wide_to_be_in_units_of_x_s():
    assert "units of x_s" in refused(lambda std: ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=std)), 1e11)


def test_a_delay_that_is_random_in_name_only():
    assert "use Delay" in refused(lambda s: ss.RandomDelay(mean=0.1, std=s), 1e-20)


def test_a_run_whose_numbers_stop_being_finite_names_the_moment(monkeypatch):
    from stickslip.kernels import events

    advance = events.advance

    def overflow(state, slider, piece, sampling, *rest):
        why = advance(state, slider, piece, sampling, *rest)
        sampling.samples[10:, 0] = np.nan
        return why

    monkeypatch.setattr(events, "advance", overflow)
    with pytest.raises(InputError, match=r"from t = 0\.1 on the numbers of the run are not finite: .*mass"):
        ss.simulate(RIG, method=ss.Contacts(10, seed=1), output=ss.Output(interval=0.01))


def test_a_snapshot_without_attached_contacts_is_empty():
    never = ss.Interface(thresholds=THRESHOLDS, delay=ss.Delay(math.inf))
    rig = ss.Rig(never, SLIDER, ss.constant(1, 5), method=ss.MasterEquation(), output=ss.Output(snapshots=(0.3, 4.0)))
    run = ss.simulate(rig)
    assert float(run["attached"][-1]) == 0
    assert float(run["stretching_density"][0].sum() * np.diff(run["x"])[0]) == pytest.approx(1.0)
    assert not run["stretching_density"][1].any()


def test_messages_are_cut_in_the_middle():
    message = str(InputError("place: " + "x" * 4_000_000 + ": remedy"))
    assert len(message) <= LONGEST_MESSAGE
    assert message.startswith("place: x")
    assert message.endswith("x: remedy")

"""The interface as an element: results depend on the path, not on its division into
steps.
"""

import math
import pickle
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import RK45

import stickslip as ss
from stickslip.errors import InputError
from stickslip.simulation.engines.base import Beginning, Leg, Quadratic, Stop, advances
from stickslip.simulation.engines.contacts import EventByEvent

TENTH = ss.Gaussian(mean=1.0, std=0.1)
ALIKE = ss.Gaussian(mean=1.0, std=0.0)
WIDE = ss.Gaussian(mean=0.0, std=0.3)
SHORT = ss.Delay(0.1)
BASE = ss.Interface(thresholds=TENTH, delay=SHORT)
TWO_HEAPS = ss.Empirical(edges=(0.5, 0.7, 1.1, 1.3), weights=(1.0, 0.0, 2.0))
WAYS = [(2.1, 1.7), (-0.4, 0.3), (0.0, 0.2), (0.9, 0.6)]
"""Displacements and durations of straight parts of a path."""
SCATTERED = ss.RandomDelay(mean=0.1, std=0.1, negative="clip")
STRETCHED = {"delay": SHORT, "newborn": ss.Gaussian(mean=0.2, std=0.3)}
ON_AREAS = {"areas": ss.model.Areas(TENTH), "initial": WIDE}
KEPT = ss.model.Areas(ss.Gamma(mean=1.0, std=0.2), kept=True)
FIELDS = {
    "no delay": {"thresholds": ss.Weibull(scale=1.0, shape=1.5)},
    "never": {"delay": ss.Delay(math.inf)},
    "clip": {"delay": SCATTERED},
    "fold": {"thresholds": TWO_HEAPS, "delay": replace(SCATTERED, negative="fold")},
    "arrests": {"delay": ss.OnArrest(), "slip_to_slip_scatter": 0.2},
    "newborn": {"thresholds": ss.Exponential(mean=1.0)} | STRETCHED,
    "sliding force": {"delay": ss.Delay(0.5), "sliding_force": 0.3},
    "areas": ON_AREAS | {"delay": SHORT, "sliding_force": 0.1},
    "kept areas": {"areas": KEPT, "delay": SHORT},
}


def interface_of(fields):
    usual = {} if "areas" in fields else {"thresholds": TENTH}
    return ss.Interface(**usual | fields)


INTERFACES = {"base": BASE}
INTERFACES |= {name: interface_of(fields) for name, fields in FIELDS.items()}


def gone(element, cut, ways=WAYS):
    """Move along a path in steps; return the work, the force at the end of each part,
    the impulse.
    """
    work = impulse = 0.0
    for way, duration in ways:
        start = element.displacement
        for i in range(1, cut + 1):
            dt = duration / cut
            end = start + way if i == cut else start + way * i / cut
            done = element.step(dt, end).impulse
            impulse += done
            work += way / duration * done
    return work, impulse


def breaks(element):
    return element._carrier.state.motion[0].breaks


@pytest.mark.parametrize("interface", INTERFACES.values(), ids=INTERFACES)
def test_the_way_decides_not_how_it_is_cut(interface):
    elements = [ss.Element(interface, ss.Contacts(100, seed=3)) for _ in range(4)]
    before = elements[0].stored_energy
    done = [gone(e, cut) for e, cut in zip(elements, (3, 6, 9, 21), strict=True)]
    assert breaks(elements[0]) >= 90
    assert len({breaks(element) for element in elements}) == 1
    np.testing.assert_allclose(done, np.array(done[:1] * 4), rtol=0, atol=1e-12)
    forces = [element.force for element in elements]
    np.testing.assert_allclose(forces, forces[0], rtol=0, atol=1e-12)
    # work in = stored + lost
    for (work, _), element in zip(done, elements, strict=True):
        kept = element.stored_energy - before + element.lost_energy
        assert work == pytest.approx(kept, abs=1e-12)


@pytest.mark.parametrize("name", ["base", "sliding force"])
def test_a_parabola_that_turns_round_is_cut_alike(name):
    one, several = (ss.Element(INTERFACES[name], ss.Contacts(100)) for _ in range(2))
    v = 3.0
    a = -2.0
    whole = one.step(4.0, 4.0 * (v + 2.0 * a), v)
    impulse = 0.0
    for t in np.arange(0.0, 4.0, 0.25):
        end = t + 0.25
        step = several.step(0.25, float(end * (v + 0.5 * a * end)), float(v + a * t))
        impulse += step.impulse
    assert breaks(one) == breaks(several) > 100
    assert whole.impulse == pytest.approx(impulse, abs=1e-12)
    assert whole.force == pytest.approx(step.force, abs=1e-12)


ALL_ALIKE = ss.Interface(thresholds=ALIKE, initial=WIDE, delay=SHORT)
CARRIED = {"sliding_force": 0.2, "newborn": ss.Gaussian(mean=0.2, std=0.0)}
WITHOUT_DRAWS = {
    "never": INTERFACES["never"],
    "kept areas": INTERFACES["kept areas"],
    "delay": ALL_ALIKE,
    "sliding force": replace(ALL_ALIKE, delay=ss.Delay(0.4), **CARRIED),
}


@pytest.mark.parametrize("interface", WITHOUT_DRAWS.values(), ids=WITHOUT_DRAWS)
def test_the_event_engine_goes_alike_where_nothing_new_is_drawn(interface):
    method = ss.Contacts(200, seed=5)
    engine = EventByEvent(Beginning(interface, None, 1.0), method)
    element = ss.Element(interface, method)
    t = x = 0.0
    for way, duration in WAYS:
        v = way / duration
        leg = Leg(Quadratic(t, x, v, 0.0), t + duration, np.empty(0), Stop())
        for _ in advances(engine, leg):
            pass
        gone(element, 5, [(way, duration)])
        t += duration
        x += way
        assert element.force == pytest.approx(engine.contact_force(), abs=1e-11)
    assert breaks(element) > 100


def test_contacts_attach_where_the_slider_turns_round_within_a_step():
    interface = ss.Interface(thresholds=ALIKE, initial=WIDE, delay=ss.OnArrest())
    element = ss.Element(interface, ss.Contacts(200, seed=5))
    v, a, duration = 4.0, -4.0, 1.4  # moves to 2 and back
    end = duration * (v + 0.5 * a * duration)
    force = element.step(duration, end, v).force
    assert breaks(element) == 200
    assert force == pytest.approx(end - 2.0, abs=1e-12)


RINGING = ss.Rig(
    ss.Interface(thresholds=ALIKE, delay=SHORT),
    ss.Slider(stiffness=2.0, mass=1e-3, damping=0.0),
    ss.constant(velocity=1.0, duration=0.3),
    method=ss.Contacts(1000, seed=2),
    start=ss.FromSliding(perturbation=0.3),
    output=ss.Output(interval=0.02),
)


@cache
def exact_run():
    """Displacements at the samples."""
    return ss.simulate(RINGING)["displacement"].to_numpy()


def verlet(rig, dt):
    """Displacements at the samples, by the scheme of the docstring."""
    element = ss.Element(rig, rig.method)
    slider = rig.slider
    drive = element.force / slider.stiffness
    pull = element.force
    friction = element.force
    x = 0.0
    v = 1.3
    found = [0.0]
    every = round(rig.output.interval / dt)
    for i in range(1, round(rig.drive.pieces[0].duration / dt) + 1):
        x += dt * (v + 0.5 * dt * (pull - friction) / slider.mass)
        friction, impulse, _ = element.step(dt, x, v)
        before, pull = pull, slider.stiffness * (drive + i * dt - x)
        v += (0.5 * dt * (before + pull) - impulse) / slider.mass
        if i % every == 0:
            found.append(x)
    return np.array(found)


@pytest.mark.takes(5)
def test_verlet_with_the_impulse_is_of_second_order():
    exact = exact_run()
    steps = 4e-4, 2e-4, 1e-4, 1e-5
    errors = [float(np.abs(verlet(RINGING, dt) - exact).max()) for dt in steps]
    assert errors[-1] <= 5e-9
    order = math.log(errors[0] / errors[-1]) / math.log(steps[0] / steps[-1])
    assert order == pytest.approx(2.0, abs=0.1)


def runge_kutta(rtol, commits):
    """Largest error of RK45, which calls the element or commits accepted steps."""
    element = ss.Element(RINGING, RINGING.method)
    drive = element.force / RINGING.slider.stiffness
    known = element.save(), 0.0

    def slope(t, y):
        if commits:
            element.load(known[0])
        h = t - (known[1] if commits else element.time)
        force = element.step(h, float(y[0])).force if h > 0.0 else element.force
        pull = RINGING.slider.stiffness * (drive + t - y[0])
        return [y[1], (pull - force) / RINGING.slider.mass]

    solver = RK45(slope, 0.0, [0.0, 1.3], 0.3, rtol=rtol, atol=1e-9)
    while solver.status == "running":
        solver.step()
        if commits:
            element.load(known[0])
            element.step(solver.t - known[1], float(solver.y[0]))
            known = element.save(), solver.t
    return abs(solver.y[0] - exact_run()[-1])


def test_a_callback_is_wrong_and_a_commit_on_acceptance_right():
    callback = [runge_kutta(rtol, False) for rtol in (1e-3, 1e-6)]
    commits = [runge_kutta(rtol, True) for rtol in (1e-3, 1e-6)]
    assert callback[1] > 3.0 * commits[1]
    assert commits[1] < 0.2 * commits[0]


def test_a_saved_state_goes_on_bit_for_bit():
    one = ss.Element(INTERFACES["clip"], ss.Contacts(100, seed=1))
    gone(one, 3)
    saved = pickle.loads(pickle.dumps(one.save()))
    other = ss.Element(INTERFACES["clip"], ss.Contacts(100, seed=2))
    other.load(saved)  # the seed comes from the state
    gone(one, 3)
    gone(other, 3)
    assert one.save() == other.save()
    one.load(saved)
    assert one.save() == saved
    gone(one, 3)
    assert one.save() == other.save()
    assert one.next_event() == other.next_event()


def test_below_the_first_break_nothing_creeps():
    element = ss.Element(BASE, ss.Contacts(1000))
    first = element.step(1.0, 0.3)
    for _ in range(1000):
        element.step(1.0, 0.4)
        element.step(1.0, 0.2)
        last = element.step(1.0, 0.3)
    assert breaks(element) == 0
    assert last.force == pytest.approx(first.force, abs=1e-14)
    assert last.stiffness == 1.0


def test_the_next_event_comes_where_it_is_said():
    element = ss.Element(BASE, ss.Contacts(100, seed=4))
    ahead, behind, wait = element.next_event()
    assert wait == math.inf
    element.step(1.0, ahead * (1.0 - 1e-12))
    assert breaks(element) == 0
    element.step(1e-9, ahead * (1.0 + 1e-12))
    assert breaks(element) == 1
    assert element.next_event().behind > behind > 0.3
    assert element.next_event().reattachment == pytest.approx(SHORT.time)


def test_a_rig_has_its_units_and_the_friction_of_theory():
    rig = ss.read_rig("brake_pad")
    v = rig.value("velocity")
    element = ss.Element(rig, ss.Contacts(1000, seed=1))
    dt = rig.unit("length") / v
    element.step(20 * dt, 20 * dt * v)
    impulse = element.step(40 * dt, 60 * dt * v).impulse
    force = ss.kinetic_friction(rig.interface, velocity=rig.natural.velocity)
    assert impulse / (40 * dt) == pytest.approx(force * rig.unit("force"), rel=0.01)
    assert element.time == pytest.approx(60 * dt)


HEAT = ss.Bell(width=0.05, attempts=1e3)
GROWTH = ss.ExponentialGrowth(rate=2.0, newborn=0.1)
THOUSAND = ss.Contacts(1000)
THROUGH_ENGINES = {
    "master equation": (BASE, ss.MasterEquation()),
    "population": (BASE, ss.Population(100_000)),
    "activation": (interface_of({"delay": SHORT, "activation": HEAT}), THOUSAND),
    "growth": (interface_of({"delay": SHORT, "ageing": GROWTH}), THOUSAND),
    "Langevin": (interface_of({"ageing": ss.Langevin(rate=1.5)}), THOUSAND),
}


@pytest.mark.parametrize(
    ("interface", "method"), THROUGH_ENGINES.values(), ids=THROUGH_ENGINES
)
def test_other_methods_go_through_their_engines(interface, method):
    element = ss.Element(interface, method)
    gone(element, 60, [(3.0, 3.0)])
    saved = element.save()
    _, impulse = gone(element, 40, [(2.0, 2.0)])
    last = element.force
    force = ss.kinetic_friction(interface, velocity=1.0)
    assert impulse / 2.0 == pytest.approx(force, rel=0.04)
    element.load(saved)
    assert gone(element, 40, [(2.0, 2.0)])[1] == impulse
    assert element.force == last
    with pytest.raises(InputError, match="have no next event that is known"):
        element.next_event()


STATE = ss.Element(BASE, ss.Contacts(10)).save()
OLD_AREAS = {"areas": ss.model.Areas(TENTH), "ageing": GROWTH}


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda e: e.step(-1.0, 0.1), r"Element\.step: dt = -1: must be .* above 0"),
        (lambda e: e.step(0.0, 0.1), r"Element\.step: dt = 0: must be .* above 0"),
        (lambda e: e.step(0.1, math.nan), r"Element\.step: displacement = nan: must"),
        (lambda e: e.step(0.1, 0.1, "1"), r"Element\.step: velocity = '1': must be"),
        (lambda e: e.step(0.1, 2e4), "breaking displacements away; take shorter"),
        (lambda e: e.load(STATE), "is of other contacts or another method; load"),
        (lambda e: e.load(b""), r"Element\.load: state = b'': must be a State"),
        (lambda _: ss.Element(BASE, "contacts"), "method = 'contacts': is not for"),
        (lambda _: ss.Element(ss.Contacts(10)), "must be a Rig or an Interface"),
        (lambda _: ss.Element(interface_of(OLD_AREAS)), r"\.areas = .* leave one out"),
    ],
)
def test_bad_input_is_one_line(wrong, words):
    with pytest.raises(InputError, match=words) as error:
        wrong(ss.Element(BASE, ss.Contacts(20)))
    assert "\n" not in str(error.value)

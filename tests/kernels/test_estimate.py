"""Work is estimated before it starts: what would take hours is refused in one line,
unless it is requested.
"""

import math
import re
import time
from dataclasses import replace

import numpy as np
import pytest

import stickslip as ss
from stickslip import cli
from stickslip.cycles import cycle_branch, is_sustained
from stickslip.errors import LONGEST_MESSAGE
from stickslip.io import rig_files
from stickslip.kernels.drive import Quadratic, Stop
from stickslip.progress import bar
from stickslip.simulation import estimate, estimates
from stickslip.simulation.driver import follow
from stickslip.simulation.engines import Beginning, engine_of
from stickslip.simulation.engines.base import Leg
from stickslip.simulation.estimates import Work

INTERFACE = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.2))
AGEING = ss.Interface(thresholds=INTERFACE.thresholds, ageing=ss.Langevin(rate=1e5))
SLIDER = ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4)
DRIVE = ss.constant(1.0, duration=10.0)
RIG = ss.Rig(INTERFACE, SLIDER, DRIVE, method=ss.Contacts(100, seed=1))
GROWTH = ss.LogarithmicGrowth(slope=0.05, time=0.01)
MANY = ss.Contacts(100_000_000)
EXACT = ss.MasterEquation(rtol=1e-9)
TOO_MUCH = {
    "slider.mass": RIG.replace(mass=1e-28),
    "simulation.contacts": RIG.replace(method=MANY, drive=ss.constant(1.0, 1000.0)),
    "simulation.rtol": RIG.replace(method=EXACT, drive=ss.constant(1.0, 1e6)),
    "interface.ageing.time": RIG.replace(interface=AGEING),
    "simulation.interval": RIG.replace(output=ss.Output(interval=1e-12)),
}


@pytest.mark.parametrize("key", TOO_MUCH)
def test_a_run_that_would_take_hours_names_the_number_that_makes_it_so(key):
    """And the number that the message proposes suffices."""
    rig = TOO_MUCH[key]
    words = rf"^{key} = .* would take about .*; give at .*long=True \(--long\)"
    with pytest.raises(ss.InputError, match=words) as caught:
        ss.simulate(rig)
    assert len(str(caught.value)) <= LONGEST_MESSAGE
    assert max(estimate(rig).parts, key=lambda part: part.seconds).key == key
    fraction = 0.99 * 3600.0 / estimate(rig).seconds
    shorter = ss.constant(1.0, duration=rig.drive.duration * fraction)
    estimate(rig.replace(drive=shorter)).check(bytes=1e99)


def test_a_long_run_can_be_asked_for(monkeypatch):
    monkeypatch.setattr(Work.check, "__defaults__", (1e-9, 4e9, "long=True"))
    with pytest.raises(ss.InputError, match="long=True"):
        ss.simulate(RIG)
    run = ss.simulate(RIG, long=True)
    assert ss.rerun(run).identical(run)
    with pytest.raises(ss.InputError, match="long = 'no'"):
        ss.simulate(RIG, long="no")


def test_only_what_happens_in_a_run_is_counted():
    """Pieces that end after a distance, an impulse that rings on, sliders that stick
    and ring in place, contacts that wait.
    """

    def seconds(**changes):
        return estimate(RIG.replace(**changes)).seconds

    long = ss.constant(1.0, duration=1e3)
    waiting = replace(INTERFACE, delay=ss.Delay(9.0))
    shaken = ss.FromSliding(perturbation=1e25)
    assert seconds(drive=long.until(ss.model.Travel(2.0))) < seconds(drive=long)
    short = ss.constant(1.0, 1e-3)
    assert seconds(start=ss.FromSliding(), drive=short) > 2 * seconds(drive=short)
    at_once = RIG.replace(interface=replace(INTERFACE, delay=ss.Delay(0.0)))
    message = "breaks of 1e\\+02 contacts would take about"
    with pytest.raises(ss.InputError, match=message):
        ss.simulate(at_once.replace(start=shaken))
    # contacts that are detached for long do not break, however far it goes
    assert seconds(start=shaken) < 1.0
    with pytest.raises(ss.InputError, match=r"simulation\.contacts = 1e\+08: .* GB"):
        ss.simulate(RIG.replace(method=MANY, drive=short))
    assert seconds(slider=replace(SLIDER, stiffness=0.1, damping=0.5)) < 3 * seconds()
    waits = estimate(RIG.replace(interface=waiting)).parts
    parts = {part.key: part.what for part in waits}
    assert parts["simulation.contacts"] == "about 1e+02 breaks of 1e+02 contacts"
    # no more than there are, once the ringing is over
    for duration, turns in ((0.1, "10"), (20.0, "1.5e+02")):
        soft = RIG.replace(stiffness=0.1, drive=ss.constant(1.0, duration))
        most = estimate(soft).parts[0].what
        assert most == f"{turns} rad of the slider's oscillation"


HOT = {"activation": ss.Bell(width=0.1, attempts=1e6), "delay": ss.Delay(0.02)}
WARM = {"activation": ss.Bell(width=0.02, attempts=1e4)}


@pytest.mark.parametrize(
    ("interface", "velocity", "expected"),
    [
        # at rest: each contact waits for activation, exp(10)/1e6, and for the delay
        (HOT, 0.0, 1e1 / (math.exp(10) / 1e6 + 0.02)),
        # so slow that contacts break by activation where a break is due, a logarithm
        # early
        (WARM, 1.0, 1e1 / (1.0 - 0.02 * math.log(200.0))),
        # a threshold that grows more slowly than the stretching: contacts hold little
        # longer than newborns
        ({"ageing": ss.ExponentialGrowth(rate=0.1, newborn=0.01)}, 1.0, 1e3),
        ({"delay": ss.OnArrest()}, 1.0, 1e1),
    ],
)
def test_breaks_are_counted_as_theory_has_them(interface, velocity, expected):
    """With equal thresholds; within the factor 2 that renewal theory allows."""
    thresholds = ss.Gaussian(mean=1.0, std=1e-3)
    contacts = ss.Interface(thresholds=thresholds, **interface)
    rig = RIG.replace(interface=contacts, drive=ss.constant(velocity, 10.0))
    parts = estimate(rig).parts
    (part,) = (part for part in parts if part.key == "simulation.contacts")
    breaks = float(part.what.split()[1]) / 100
    assert expected / 2 < breaks < 2 * expected


AGED = {  # rate, std and newborn of the contacts; mass; velocities of the drive
    "tenths": (0.63, 0.153, 0.0, 1e-6, (1.0, 1.0)),
    "narrow": (0.6, 0.05, 0.0, 1e-7, (1.0, 1.0)),
    "broad": (0.4, 0.2, 0.0, 1e-8, (1.0, 1.0)),
    "newborns": (0.55, 0.13, 0.1, 1e-6, (1.0, 1.0)),
    "slower and slower": (0.5, 0.1, 0.0, 1e-7, (2.0, 0.5)),
    "backwards": (0.5, 0.1, 0.0, 1e-8, (-1.0, -3.0)),
    "heavy": (0.5, 0.1, 0.3, 1.0, (1.0, 1.0)),
}


def steps_of(rig, at_once=10):
    """Count the steps of a run of ageing contacts, in batches."""
    solver = engine_of(rig.interface, rig.method)
    courses = []

    class Counting(solver):
        def take(self, course):
            courses.append(course)
            return super().take(course._replace(budget=at_once))

    beginning = Beginning(rig.interface, rig.slider, rig.velocity, rig.start)
    engine = Counting(beginning, rig.method)
    position = beginning.drive_position(engine.contact_force())
    follow(engine, rig.drive, position, np.zeros(1))
    return at_once * len(courses)


@pytest.mark.parametrize(
    ("method", "words"),
    [
        (ss.Contacts(200, seed=1), "(.*) steps of 2e\\+02 contacts"),
        (ss.MasterEquation(rtol=1e-2), "(.*) steps of cohorts"),
    ],
    ids=["contacts", "kinetic equation"],
)
@pytest.mark.parametrize("numbers", AGED.values(), ids=AGED)
def test_contacts_that_age_take_as_many_steps_as_were_said(numbers, method, words):
    """However short their memory, where the slider never rings; else not more."""
    rate, std, newborn, mass, velocities = numbers
    thresholds = ss.Gaussian(mean=1.0, std=std)
    ageing = ss.Langevin(rate=rate, newborn=newborn)
    interface = ss.Interface(thresholds=thresholds, ageing=ageing)
    damping = 4.0 * math.sqrt(1.7 / mass)
    slider = ss.Slider(stiffness=0.7, mass=mass, damping=damping)
    rig = ss.Rig(interface, slider, ss.ramp(*velocities, 3.0), method=method)

    def match_of(part):
        return re.fullmatch(words, part.what)

    (said,) = (found[1] for found in map(match_of, estimate(rig).parts) if found)
    assert float(said) / 2 < steps_of(rig) < 2 * float(said)
    ringing = rig.replace(damping=0.02 * damping)
    (said,) = (found[1] for found in map(match_of, estimate(ringing).parts) if found)
    assert float(said) < 2 * steps_of(ringing)


QUICK = [name for name in rig_files.example_names() if name != "pmma_bar"]
SLOW_BAR = pytest.param("pmma_bar", marks=pytest.mark.slow)


@pytest.mark.takes(8)
@pytest.mark.parametrize("name", [*QUICK, SLOW_BAR])
def test_the_estimate_holds_for_the_examples(name):
    """Within a factor of 3 on an idle machine, twice that on a busy one."""
    rig = ss.example(name)
    ss.simulate(ss.example("brake_pad"))  # compiled
    took = math.inf
    for _ in range(1 if estimate(rig).seconds > 1.0 else 2):
        begun = time.process_time()
        ss.simulate(rig)
        took = min(took, time.process_time() - begun)
    assert took / 6 - 0.02 < estimate(rig).seconds < 6 * (took + 0.02)


ABSURD = {"mass": "1e-20 kg", "distance": "1000 km", "velocity": "1e-15 m/s"}
ABSURD["stiffness"] = "1e25 N/m"


@pytest.mark.parametrize(("key", "value"), ABSURD.items())
def test_the_command_line_refuses_in_one_line(tmp_path, capsys, key, value):
    rig = rig_files.example_file("pmma_slider").read_text()
    line = next(line for line in rig.splitlines() if line.startswith(f"{key} ="))
    place = tmp_path / "rig.toml"
    place.write_text(rig.replace(line, f'{key} = "{value}"'))
    begun = time.process_time()
    assert cli.main(["simulate", str(place)]) == 2
    assert time.process_time() - begun < 5
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "--long" in error


@pytest.mark.parametrize(("least", "lines"), [(60.0, 0), (1e-9, 1)])
def test_a_run_of_a_minute_is_announced(tmp_path, monkeypatch, caplog, least, lines):
    """A run that takes more than a minimum time is announced in one line."""
    place = tmp_path / "rig.toml"
    rig = RIG.replace(drive=ss.constant(1.0, duration=0.1))
    place.write_text(rig_files.to_toml(rig))
    monkeypatch.setattr(estimates, "ANNOUNCED", least)
    assert cli.main(["simulate", str(place)]) == 0
    parts = estimate(rig_files.read_rig(place)).parts
    worst = max(parts, key=lambda part: part.seconds)
    assert len(caplog.messages) == lines
    line = rf"rig: about .* on one core: {re.escape(worst.what)}"
    assert all(re.fullmatch(line, said) for said in caplog.messages)


def test_a_long_run_in_a_pipe_says_how_far_it_is(monkeypatch, capsys):
    now = [0.0]
    monkeypatch.setattr("stickslip.progress.time.monotonic", lambda: now[0])
    with bar("sweep") as report:
        for now[0], part in ((1.0, 0.1), (300.0, 0.25), (301.0, 0.3), (1200.0, 1.0)):
            report(part)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("sweep: 25 %, about 15 min left")


def test_stiff_dashpots_ask_for_short_steps():
    """In proportion to the viscosity, once dashpots need shorter steps than springs."""
    body = ss.Chain(blocks=8, coupling=5.0, mass=1e-2, damping=1.0, leaf=1.0)
    drive = ss.constant(1.0, duration=1.0)
    rig = ss.Rig(INTERFACE, body, drive, method=ss.Contacts(20))

    def work(viscosity):
        return estimate(replace(rig, slider=replace(body, viscosity=viscosity)))

    none = work(0.0)
    much = work(1e3)
    more = work(1e5)
    assert work(1e-9).seconds == none.seconds
    steps = [each.parts[0].seconds for each in (none, much, more)]
    assert steps[2] == pytest.approx(100 * steps[1])
    assert steps[1] > 1000 * steps[0]
    message = r"^slider.viscosity = 1e\+09 .* steps of blocks would .*; give at most"
    with pytest.raises(ss.InputError, match=message):
        work(1e9).check()


BELL = ss.Bell(width=0.02, attempts=1e4)
STRETCHED = ss.Uniform(low=-0.1, high=0.3)
JUMPS = (ss.constant(0.5, 0.1).pieces + ss.constant(1.5, 0.1).pieces) * 40
LIGHT = ss.Slider(stiffness=1.4, mass=1e-6, damping=200.0)
HEATED = {"interface": replace(INTERFACE, activation=BELL)}
COUNTED = {"method": ss.Population(1_000_000, rtol=1e-3)}
ON_PANELS = {
    "slips": {},
    "slides": {"slider": ss.Slider(stiffness=20.0, mass=1e-4, damping=1000.0)},
    "rings": {"slider": ss.Slider(stiffness=2.0, mass=1e-5, damping=42.4)},
    "on arrest": {"interface": replace(INTERFACE, delay=ss.OnArrest())},
    "newborns": {"interface": replace(INTERFACE, newborn=STRETCHED)},
    "growth": {"interface": replace(INTERFACE, ageing=GROWTH)},
    "heat": HEATED | {"drive": ss.ramp(0.5, 1.5, 10.0)},
    "counted": COUNTED | {"drive": ss.ramp(0.5, 1.5, 40.0)},
    "jumps": {"slider": LIGHT, "drive": ss.model.Drive(JUMPS)},
}


def begun(rig):
    """The engine of a rig at its start."""
    beginning = Beginning(rig.interface, rig.slider, rig.velocity, rig.start)
    return engine_of(rig.interface, rig.method)(beginning, rig.method)


def steps_along(rig):
    """Follow a run, 20 steps at a time; yield the engine and their seconds by count."""
    engine = begun(rig)
    position = 0.0
    for piece in rig.drive.pieces:
        begin = engine.here()[0]
        motion = Quadratic(begin, position, piece.start, piece.acceleration)
        leg = Leg(motion, begin + piece.duration, np.empty(0), Stop())
        over = False
        while not over:
            engine.steps = 20
            over = engine.advance(leg).over
            yield engine, engine.seconds
        position = float(leg.drive_position(np.asarray(leg.end)))


def seconds_by_count(rig):
    """Estimated seconds of all steps of a run, by their number and cohorts."""
    return sum(seconds for _, seconds in steps_along(rig))


def said_of_cohorts(rig):
    """Estimated seconds of the steps of cohorts."""
    parts = estimate(rig).parts
    (said,) = (part.seconds for part in parts if part.key == "simulation.rtol")
    return said


@pytest.mark.parametrize("name", ON_PANELS)
def test_a_run_takes_as_many_steps_as_were_said(name):
    """Whether it slips or slides, which only a run of its first part shows."""
    how = {"method": ss.MasterEquation(rtol=1e-5), "drive": ss.constant(1.0, 40.0)}
    tried = RIG.replace(**how).replace(**ON_PANELS[name])
    took = seconds_by_count(tried)
    assert took / 2 < said_of_cohorts(tried) < 2 * took


def ringing_rig(decade, seed):
    """A random slider on the master equation: its mass is of a given decade, its width
    and damping are random; it rings for some hundred radians after the first slip.
    """
    rng = np.random.default_rng([decade + 20, seed])
    low = (decade, -0.5, -1.5)
    high = (decade + 1, 0.7, -0.3)
    mass, stiffness, std = 10 ** rng.uniform(low, high)
    ratio = [0.0, 10 ** rng.uniform(-3, -1), 10 ** rng.uniform(-1, 2)][seed % 3]
    omega = math.sqrt((stiffness + 1.0) / mass)
    slider = ss.Slider(stiffness=stiffness, mass=mass, damping=2.0 * ratio * omega)
    interface = ss.Interface(thresholds=ss.LogNormal(mean=1.0, std=std))
    method = ss.MasterEquation(rtol=10 ** rng.uniform(-4.0, -3.0))
    rig = ss.Rig(interface, slider, ss.constant(1.0, 20.0), method=method)
    engines = (engine for engine, _ in steps_along(rig))
    engine = next(each for each in engines if each.state.motion.broken >= 0.5)
    slip = float(engine.state.motion.time)
    return rig.replace(drive=ss.constant(1.0, min(20.0, slip + 6e2 / omega)))


@pytest.mark.parametrize("decade", [-9, -6, -3])
def test_the_master_equation_is_estimated_over_decades(decade, monkeypatch):
    """Within a factor of 2 from a part of the run, with the same costs of steps and
    cohorts; anything below a hundredth of a second need not be known.
    """
    monkeypatch.setattr("stickslip.simulation.engines.panel_trial._LEAST", 0.01)
    little = 0.01
    for seed in range(3):
        rig = ringing_rig(decade, seed)
        said = said_of_cohorts(rig)
        took = seconds_by_count(rig)
        assert 0.5 < (said + little) / (took + little) < 2.0, seed


@pytest.mark.parametrize("method", [ss.Contacts(100), ss.MasterEquation()])
def test_pieces_of_a_drive_and_snapshots_take_time(method):
    """Each starts anew, however short it is: a thousand take as much more."""

    def pieces(count):
        piece = ss.constant(1.0, 1.0 / count).pieces
        return RIG.replace(drive=ss.model.Drive(piece * count), method=method)

    def looks(count):
        times = tuple(np.linspace(0.0, 1.0, count))
        return pieces(1).replace(output=ss.Output(snapshots=times))

    for rigs, key in ((pieces, "drive.pieces"), (looks, "simulation.snapshots")):
        both = (estimate(rigs(count)).parts for count in (10, 10_000))
        few, many = ({part.key: part for part in parts}[key] for parts in both)
        assert many.seconds == pytest.approx(1000 * few.seconds)
        # 9e-5 s on a desktop machine, where nothing happens
        assert 0.5 * 9e-5 * 10_000 < many.seconds < 4 * 9e-5 * 10_000
    assert estimate(pieces(10_000)).seconds > 0.9


@pytest.mark.parametrize("method", [ss.Contacts(1), ss.Contacts(), ss.QuasiStatic(1)])
@pytest.mark.parametrize("blocks", [10**5, 10**6, 10**8])
def test_bodies_of_many_blocks_are_refused_before_they_are_made(blocks, method):
    body = ss.Chain(blocks=blocks, coupling=5.0, mass=1e-2, damping=1.0, leaf=1.0)
    rig = ss.Rig(INTERFACE, body, ss.constant(1.0, 1e6), method=method)
    with pytest.raises(ss.InputError, match="would take about") as caught:
        ss.simulate(rig)
    assert len(str(caught.value)) <= LONGEST_MESSAGE


@pytest.mark.parametrize("search", [ss.sustained, ss.bistable_range, cycle_branch])
def test_a_search_that_would_take_hours_is_refused_at_once(search, monkeypatch):
    monkeypatch.setattr("stickslip.cycles.edges.LONGEST", 1e-3)
    with pytest.raises(ss.InputError, match=r"would take about .* a part of the range"):
        search(RIG, "velocity", between=(0.9, 1.0))


def test_a_search_is_estimated_by_the_number_of_its_runs():
    rig = replace(RIG, slider=replace(SLIDER, damping=0.0))
    message = r"^velocity from 0.5 .* to 2 .*: 6022 runs"
    with pytest.raises(ss.InputError, match=message):
        ss.sustained(rig, "velocity", between=(0.5, 2.0), points=10_000)


def test_a_search_of_more_than_a_minute_is_announced(monkeypatch, caplog):
    monkeypatch.setattr(estimates, "ANNOUNCED", 1e-9)
    ss.sustained(RIG, "delay", between=(0.19, 0.2), points=1, tolerance=0.5)
    (said,) = caplog.messages
    assert re.match(r"delay from .* to .*: about .* on one core: 2 runs, ", said)


@pytest.mark.parametrize("side", [0.0, 1.0])
def test_modes_that_would_take_too_much_are_refused(side):
    springs = {"coupling": 5.0, "leaf": 1.0, "side": side}
    body = ss.Chain(blocks=10**8, mass=1e-2, damping=1.0, **springs)
    with pytest.raises(ss.InputError, match=r"^modes: count = .*; give at most"):
        ss.elastic.modes(replace(RIG, slider=body), count=10**6)


def test_an_answer_on_more_blocks_than_memory_takes_is_refused():
    body = ss.Chain(blocks=10**8, coupling=5.0, mass=1e-2, damping=1.0, leaf=1.0)
    with pytest.raises(ss.InputError, match=r"^slider.blocks = 1e\+08: .*; give at mo"):
        ss.predict(replace(RIG, slider=body))


def test_a_search_on_a_slider_that_hardly_starts_is_refused():
    """Its cycle takes 1e15 times the distance of the first part of a run."""
    with pytest.raises(ss.InputError, match=r"\d+ runs, .* would take about"):
        ss.sustained(RIG.replace(mass=1e30), "velocity", between=(0.5, 2.0), points=12)


def test_a_cycle_that_is_not_complete_in_reach_ends_in_one_line(monkeypatch):
    """Contacts with so heavy a tail load without end: each attempt is twice as long."""
    monkeypatch.setattr("stickslip.cycles.cycle_run._LONG", 0.05)
    thresholds = ss.LogNormal(mean=1.0, std=50.0)
    rig = RIG.replace(interface=replace(INTERFACE, thresholds=thresholds))
    message = r"no cycle is complete at t = .*; give"
    with pytest.raises(ss.UndecidedError, match=message):
        is_sustained(rig)

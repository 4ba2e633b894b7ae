"""Predictions are true: verdicts against reference cases, and each mitigation against a
simulation of it.
"""

import html
import math
import re
import time
import tomllib
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import stickslip as ss
from stickslip import advise
from stickslip.advise import Mitigation, mitigations, prediction, sections
from stickslip.advise.budget import (
    SEEDS,
    Budget,
    BudgetExhausted,
    cost_of_run,
    cost_of_theory,
    survives_noise,
    trial,
)
from stickslip.advise.mitigations import Search
from stickslip.advise.report import report
from stickslip.advise.survey import PRECISION, Band, Survey, stability_along
from stickslip.io import rig_files as rigs
from stickslip.paper.cases import FIG8


def make(
    *,
    stiffness,
    mass=1e-4,
    damping=None,
    drive=ss.constant(1.0, 80.0),
    contacts=3000,
    seed=1,
    **interface,
):
    """A rig in natural units, with a damping ratio of .15 if no damping is given."""
    damping = 0.3 * math.sqrt(stiffness / mass) if damping is None else damping
    contact = ss.Interface(
        **({"thresholds": ss.Gaussian(1.0, 0.1), "delay": ss.Delay(0.1)} | interface)
    )
    slider = ss.Slider(stiffness=stiffness, mass=mass, damping=damping)
    return ss.Rig(contact, slider, drive, method=ss.Contacts(contacts, seed=seed))


def scattered(mean, std):
    return ss.RandomDelay(mean=mean, std=std, negative="redraw")


@pytest.fixture(scope="module")
def paper_s_rig():
    """The full answer for the paper's rig, which takes ten seconds."""
    return advise.predict(make(stiffness=2.0))


@pytest.mark.slow
@pytest.mark.eq(8)
def test_the_paper_s_rig_is_bistable_with_its_margins(paper_s_rig):
    found = paper_s_rig
    assert (found.regime.kind, found.unstable_modes) == ("stick-slip", 0)
    assert (found.bistable, found.smooth) == (True, False)
    assert found.critical_stiffness == pytest.approx(2.989, abs=3e-3)
    assert found.stiffness_margin == pytest.approx(2.0 / 2.989, abs=1e-3)
    margins = {margin.parameter: margin for margin in found.margins}
    assert margins["velocity"].upper == pytest.approx(1.388221, abs=1e-6)
    assert margins["delay"].upper == pytest.approx(0.138218, abs=1e-6)
    assert margins["velocity"].lower is None


def test_a_verdict_is_about_the_speed_that_it_names():
    """A drive that speeds up later is judged at its first speed."""
    steady = ss.constant(1.0, 80.0)
    drives = steady, steady.then(ss.constant(30.0, 10.0))
    kinds = {
        advise.predict(make(stiffness=2.0, drive=drive), fast=True).regime.kind
        for drive in drives
    }
    assert kinds == {"stick-slip"}


@pytest.mark.slow
def test_a_mitigation_leaves_the_bistable_band(paper_s_rig):
    found = paper_s_rig
    rig = paper_s_rig.rig
    # from the narrow start stick-slip decays below tau* = .0755, and below v1' = .71
    stops = {mitigation.parameter: mitigation.to for mitigation in found.mitigations}
    assert 0.8 * 0.71 < stops["velocity"] < 0.73
    if "delay" in stops:
        assert 0.8 * 0.0755 < stops["delay"] < 0.0755 + 0.003
    assert found.mitigations[0].parameter != "delay"  # a machine can change others
    for mitigation in found.mitigations:
        there = rig.with_values(**{mitigation.parameter: mitigation.to})
        long = replace(there, drive=ss.constant(there.velocity, 300.0 / there.velocity))
        run = ss.simulate(long, method=replace(there.method, seed=5))
        assert ss.regime(run).kind == "smooth sliding", mitigation


@pytest.mark.parametrize(("contacts", "told"), [(3000, False), (1500, True)])
def test_noise_is_told_only_where_runs_are_as_noisy_as_linear_theory(contacts, told):
    """3000 contacts show it only so near the limit that runs leave smooth sliding."""
    rig = make(stiffness=2.0, contacts=contacts)
    margins, _ = prediction._margins(rig, Budget(math.inf))
    limit = prediction._noise_limit(rig, margins)
    assert (limit is not None) == told
    if limit is not None:
        name, value = limit
        end = next(each.upper for each in margins if each.parameter == name)
        there = rig.with_values(velocity=value)
        assert (name, value < 0.95 * end) == ("velocity", True)
        assert ss.stability.contact_noise(there).relative_velocity < 0.21
        (line,) = sections.noise(SimpleNamespace(rig=rig, noise_limit=limit))
        assert "before the speed reaches its limit" in line


@pytest.mark.slow
def test_an_assumption_is_varied_within_the_range_that_the_file_gives():
    assumed = {"slider.mass": ["2.9 kg", "3.1 kg"], "interface.delay": ["1 us", "2 us"]}
    rig = example("brake_pad", assumed=assumed)
    assert rig.assumed["interface.delay"].factors == pytest.approx((1e-3, 2e-3))
    assert ss.read_rig(tomllib.loads(rigs.to_toml(rig))).assumed == rig.assumed
    short, wide = (
        advise.Doubt.of(each, Budget(math.inf)).oscillates
        for each in (rig, example("brake_pad"))
    )
    # with delays so short no contact strengthens with rest
    assert (short, wide > 0.9) == (0.0, True)


@pytest.mark.slow
def test_the_speeds_of_the_paper_s_rig(paper_s_rig):
    found = paper_s_rig
    # the slowest speeds take long to simulate
    seen = [band for band in found.bands if band.kind != "stable"]
    kinds = [(band.kind, band.bistable) for band in seen]
    first = [("smooth sliding", False), ("stick-slip", True), ("stick-slip", False)]
    assert kinds[:3] == first
    # v1', to the precision of the search
    assert seen[1].low == pytest.approx(0.71, rel=0.06)
    assert seen[1].high == pytest.approx(1.388221, abs=1e-6)  # v1
    words = r"at 1 x_s/time: stick-slip, 0.74\d cycles per time unit, force ±0.44"
    assert re.match(words, found.verdict)
    bistable = (
        r"stick-slip from 0\.\d+ to 1.39 x_s/time if started from rest; "
        r"stick-slip from 1.39 "
    )
    assert re.search(bistable, found.verdict)


def test_a_prediction_is_in_the_units_of_its_rig_and_prints_as_its_answer():
    rig = ss.example("brake_pad")
    found = ss.predict(rig, fast=True)
    assert str(found) == repr(found)
    in_full = found.text(details=True)
    assert re.search(r"at 20 mm/s: stick-slip, 170 Hz, force ±1\.(19|2)\d* kN", in_full)
    assert "; linearly unstable from 1.1 to 154 mm/s; " in found.verdict
    assert len(found.headline) <= 100
    bold = found.text(40, details=True, bold=True)  # the codes for bold have no width
    assert bold.startswith("\033[1mBrake pad, creep groan\033[0m: at 20 mm/s:\n")
    assert re.sub("\033\\[[01]m", "", bold) == found.text(40, details=True)
    # numbers as text, as the command line gives them
    natural = ss.predict(rig.natural, fast=True, smooth=("0.5", "3"))
    assert natural.between == (0.5, 3.0)
    assert found.critical_stiffness == pytest.approx(
        natural.critical_stiffness * rig.unit("k")
    )
    assert found.frequency == pytest.approx(natural.frequency / rig.scales.time)
    assert found.bands[1].high == pytest.approx(
        natural.bands[1].high * rig.unit("x_s/time")
    )
    assert found.to_dict()["velocity"] == pytest.approx(0.02)
    shown = found._repr_html_()
    assert ">Brake pad, creep groan: at 20 mm/s: stick-slip, 170 Hz" in shown
    # a strip of its speeds, to scale
    drawn = ET.fromstring(re.search("(?s)<svg viewBox.*?</svg>", shown)[0])
    wide = [
        float(part.get("width"))
        for part in drawn.iter("rect")
        if part.find("title") is not None
    ]
    decades = math.log10(found.speeds_searched[1] / found.speeds_searched[0])
    assert wide == pytest.approx(
        [600 * math.log10(b.high / b.low) / decades for b in found.bands], abs=0.06
    )
    assert not found.complete


def test_a_rig_without_a_mechanism_is_not_judged_but_told_over_delays():
    found = advise.predict(make(stiffness=2.0, delay=ss.Delay(0.0)))
    assert (found.has_verdict, found.smooth, found.mitigations) == (False, None, ())
    assert found.verdict.startswith(
        "cannot be judged: nothing says how contacts strengthen with rest"
    )
    assert [band.kind for band in found.delays] == ["stable", "unstable"]
    assert found.delays[0].high == pytest.approx(0.138218, abs=1e-6)


@pytest.mark.slow
def test_where_nothing_helps_the_range_searched_is_told():
    shares = []
    found = advise.predict(ss.example("pmma_slider"), progress=shares.append)
    assert shares == sorted(shares)
    assert 0.0 <= shares[0] < 0.3
    assert shares[-1] == 1.0
    assert not found.mitigations
    assert found.attempts["damping"][1] == pytest.approx(
        30 * found.rig.value("damping")
    )
    assert any(line.endswith(" does not stop it") for line in sections.attempts(found))


def test_what_one_run_of_eight_denies_is_told_as_that():
    class Fated(Budget):
        def slide_smoothly(self, _rigs, others):
            return 3 not in others

    found = ss.predict(ss.example("brake_pad"), fast=True)
    changes = Search(found.rig, None, Fated(math.inf)).changes(lambda _done: None)
    found = replace(found, **changes)
    assert found.unreliable["damping"] == (
        pytest.approx(30 * found.rig.value("damping")),
        7 / 8,
    )
    # where the linear theory still excludes it
    there = found.rig.with_values(damping=found.attempts["damping"][1])
    assert ss.stability.growth_rate(there).real == pytest.approx(0.0, abs=1e-6)
    assert any(
        re.search("damping.* the furthest, smooth sliding in 7 of 8 runs", line)
        for line in sections.attempts(found)
    )


def test_a_slow_decay_is_waited_for():
    """These runs cannot be judged after 120 x_s; they are smooth after 600 and 1500."""
    random = {
        "thresholds": ss.Gaussian(1.0, 0.1996),
        "delay": scattered(0.7828, 0.078629),
    }
    slow = {"stiffness": 0.45803, "mass": 1.6253e-6, "damping": 389.13}
    slow["drive"] = ss.constant(14.8, 120 / 14.8)
    rig = make(**slow, **random, contacts=10_000, seed=20)
    assert Budget(100.0).regime(trial(rig)).kind == "smooth sliding"


def test_a_mode_that_decays_more_slowly_than_runs_last_is_not_called_sustained():
    light = {"stiffness": 15.0, "mass": 5e-4, "damping": 12.0, "contacts": 500}
    rig = make(**light, thresholds=ss.Gamma(1.0, 0.18), delay=ss.Delay(0.5))
    rig = replace(rig, drive=ss.constant(20.0, 4.0))
    assert -0.01 < ss.stability.growth_rate(rig).real < 0.0
    assert Budget(500.0).regime(trial(rig)).kind == "undecided"


@pytest.mark.parametrize(
    ("speed", "kind"), [(150, "sustained oscillation"), (186, "undecided")]
)
def test_what_decays_to_an_oscillation_that_lasts_is_not_smooth(speed, kind):
    slider = {"stiffness": 1.68, "mass": 1.83e-3, "damping": 1.35, "contacts": 373}
    random = {"thresholds": ss.Gaussian(1.0, 0.148), "delay": ss.Delay(0.41)}
    rig = make(**slider, **random, seed=204, drive=ss.constant(speed, 1.0))
    assert Budget(1000.0).regime(trial(rig)).kind == kind


def test_a_budget_counts_the_lives_of_contacts_and_never_allows_more():
    case = replace(trial(ss.example("brake_pad")), method=ss.Contacts(40_000))
    twice = ss.constant(case.natural.velocity, 2.0 * case.drive.duration)
    longer = replace(case, drive=twice)
    assert cost_of_run(longer) == pytest.approx(2.0 * cost_of_run(case), rel=0.1)
    half = cost_of_run(replace(case, method=ss.Contacts(20_000)))
    assert half == pytest.approx(0.5 * cost_of_run(case), rel=0.1)
    budget = Budget(10.0)
    with budget.limited_to(0.3):
        budget.spend(3.0)
        with pytest.raises(BudgetExhausted):
            budget.spend(0.1)
    budget.spend(7.0)
    assert budget.spent == budget.allowed == 10.0
    heat = ss.Barrier(height=50.0, attempts=6000.0)
    wide = ss.Interface(
        thresholds=ss.Exponential(mean=1.0), delay=ss.Delay(0.3), activation=heat
    )
    other = replace(case, interface=wide, scales=None)
    assert cost_of_theory(other) > 5.0 * cost_of_theory(case)
    # runs whose contacts are advanced in time steps: a second, or a minute
    ageing = {"delay": ss.Delay(0.0), "ageing": ss.Langevin(rate=1.2)}
    ageing["thresholds"] = ss.Gaussian(1.0, 0.0366, lower=0.0)
    stiff = {"stiffness": 11.2, "mass": 1.54e-3, "damping": 3.6, "contacts": 960}
    slow, fast = (make(**ageing, **stiff, drive=ss.constant(v, 45.0)) for v in (1, 13))
    assert cost_of_run(fast) > 100.0 * cost_of_run(slow)


def test_less_friction_is_a_higher_speed_and_no_run_is_made_twice():
    rig = ss.example("brake_pad")
    budget = Budget(100.0)
    faster = rig.with_values(velocity=7.0 * rig.velocity)
    smoother = rig.with_values(friction=rig.value("friction") / 7.0)
    budget.regime(trial(faster))
    spent = budget.spent
    assert budget.regime(trial(smoother)).kind == budget.regime(trial(faster)).kind
    assert budget.spent == spent


@pytest.mark.slow
def test_ageing_rigs_have_margins_and_mitigations_that_are_true():
    rig = replace(
        make(stiffness=1.0, damping=10.0, contacts=300), interface=FIG8.interface
    )
    found = advise.predict(rig, thorough=True)
    assert (found.regime.kind, found.unstable_modes) == ("stick-slip", 2)
    margins = {margin.parameter: margin for margin in found.margins}
    # The edges of Fig. 8, as times of ageing.
    assert margins["ageing"].lower == pytest.approx(1.63**-2, rel=0.04)
    assert margins["ageing"].upper == pytest.approx(0.80**-2, rel=0.06)
    assert margins["velocity"].lower == pytest.approx(0.8687, abs=0.002)
    assert "stiffness" in {mitigation.parameter for mitigation in found.mitigations}
    for mitigation in found.mitigations:
        here = rig.with_values(**{mitigation.parameter: mitigation.to})
        assert ss.stability.count_unstable(here) == 0
        drive = ss.constant(here.velocity, 60.0 / here.velocity)
        run = ss.simulate(
            ss.Rig(here.interface, here.slider, drive),
            method=ss.Contacts(2_000, seed=77),
        )
        late = run["spring_force"].to_numpy()[
            run["time"].to_numpy() > 36.0 / here.velocity
        ]
        assert np.ptp(late) < 0.25


def example(name, **tables):
    """An example with tables of its file replaced."""
    return ss.read_rig(
        tomllib.loads(rigs.example_file(name).read_text(encoding="utf-8")) | tables
    )


@pytest.mark.slow
@pytest.mark.takes(60)
@pytest.mark.parametrize("std", [0.002, 0.02, 0.9])
@pytest.mark.parametrize("part", ["thresholds", "newborn", "delay"])
def test_a_prediction_of_narrow_or_wide_scatter_ends(part, std):
    """However long one computation of the response of such contacts takes."""
    scattered_parts = {
        "thresholds": ss.LogNormal(mean=1.0, std=std),
        "newborn": ss.Gaussian(0.3, 0.3 * std),
        "delay": scattered(0.1, 0.1 * std),
    }
    begun = time.process_time()
    assert advise.predict(make(stiffness=0.5, **{part: scattered_parts[part]})).complete
    assert time.process_time() - begun < 120.0


@pytest.mark.slow
def test_the_answer_is_about_the_speeds_at_which_the_rig_works():
    answer = ss.predict(example("brake_pad", drive={"velocity": ["20 mm/s", "1 m/s"]}))
    (first, here), (second, there) = answer.at_speeds
    assert (first, second) == (pytest.approx(0.02), pytest.approx(1.0))
    assert (here, there) == ("stick-slip", "smooth sliding")
    assert answer.verdict.startswith("at 20 mm/s: stick-slip, 170 Hz")
    assert answer.verdict.endswith("; at 1 m/s: smooth sliding")
    assert answer.to_dict()["at_speeds"] == [[first, here], [second, there]]


def test_a_rig_that_goes_through_speeds_is_judged_along_them():
    answer = ss.predict(
        example("brake_pad", drive={"velocity": {"from": "10 mm/s", "to": "1 m/s"}}),
        fast=True,
    )
    assert (
        "over its range, if each speed lasted: linearly unstable from 10 mm/s, "
        "linearly stable from 15"
    ) in answer.verdict
    answer = ss.predict(ss.example("wiper"), fast=True)
    assert (
        "along its drive: sustained oscillation 53 ms to 551 ms and 881 ms to 955 ms, "
        "34.8 Hz, at worst ±5.63 N at 316 ms (636 mm/s)"
    ) in answer.verdict
    first, second = answer.driven
    both = replace(answer, driven=(first, replace(second, peak=4.0)))
    assert both.headline.startswith("along its drive: stick-slip 881 ms to 955 ms, ")
    assert "); sustained oscillation 53 ms to 551 ms; if 10 mm/s " in both.verdict
    rings = replace(answer, driven=(first, replace(second, rings_down=True)))
    assert "881 ms" not in rings.headline
    assert rings.along_drive == answer.along_drive  # as the strip shows it
    slips = Band(kind="stick-slip", low=0.1, high=2.0)
    smooth = replace(answer.regime, kind="smooth sliding")
    # where its own run was too long, as if each speed were kept
    by_theory = replace(answer, driven=None)
    assert (
        "along its drive, if each speed lasted: linearly unstable from 0 s, linearly "
        "stable from 2"
    ) in by_theory.verdict
    assert replace(by_theory, regime=smooth, bands=[slips]).headline.startswith(
        "stick-slip from 45."
    )
    assert answer.between == (pytest.approx(0.01), pytest.approx(1.0))
    for found, kind in ((by_theory, "unstable"), (answer, "smooth sliding")):
        first, *_, last = found.along_drive  # speeds up and down again within a second
        assert (first.low, last.high) == (0.0, pytest.approx(1.0))
        assert (first.kind, last.kind) == (kind, kind)
    # a pause has no speed at which to slide smoothly
    paused = ss.constant(1.0, 1.0).then(ss.constant(0.0, 1.0)).then(ss.constant(2.0))
    assert replace(answer, rig=make(stiffness=2.0, drive=paused)).between == (1.0, 2.0)


def test_what_was_not_simulated_is_not_called_smooth():
    setting = make(stiffness=2.0)
    linear = stability_along(setting, ss.stability.VELOCITY, 0.01, 100.0)
    assert [band.kind for band in linear] == ["stable", "unstable"]
    survey = Survey(setting, linear, ss.regime(ss.simulate(setting)).kind)
    known = []
    for runs in (0.0, 8.0, 100.0):
        survey.simulate(Budget(runs))
        bands = survey.bands()
        assert all(one.high == other.low for one, other in pairwise(bands))
        known.append(
            sum(
                math.log(b.high / b.low)
                for b in bands
                if b.kind not in ("stable", "unstable")
            )
        )
    # from the rig's own run, which gives no range
    assert known[0] == pytest.approx(2.0 * math.log(1.0 + PRECISION))
    assert known[0] < known[1] < known[2]


@pytest.mark.parametrize("again", ["stick-slip", "smooth sliding"])
def test_a_band_that_its_neighbours_contradict_is_run_again(again):
    """Between two speeds with stick-slip another kind must show in a second run."""

    class Fated(Budget):
        def regime(self, rig):
            smooth = 2.0 < rig.natural.velocity < 4.0
            first = "smooth sliding" if smooth else "stick-slip"
            return replace(seen, kind=first if rig.method.seed == 1 else again)

    rig = make(stiffness=2.0)
    seen = ss.regime(ss.simulate(rig))
    survey = Survey(rig, [Band(kind="stable", low=0.1, high=40.0)], "stick-slip")
    survey.simulate(Fated(math.inf))
    kinds = [band.kind for band in survey.bands() if band.low < 3.0 < band.high]
    assert kinds == ["stable" if again == "stick-slip" else again]


SLOW = {"stiffness": 0.14, "mass": 2.7e-8, "damping": 140.0, "delay": ss.Delay(9e-4)}


@pytest.mark.parametrize(
    "noisy", [{"stiffness": 2.0, "contacts": 100}, SLOW | {"contacts": 10_000}]
)
def test_next_to_a_change_contacts_whose_noise_matters_have_to_agree(noisy):
    """A run of one seed, or of fewer contacts, would make a band by chance."""

    class Fated(Budget):
        def regime(self, rig):
            assert rig.method.seed == 1 or rig.method.count == noisy["contacts"]
            slips = rig.natural.velocity < (3.0 if rig.method.seed == 5 else 2.0)
            return replace(seen, kind="stick-slip" if slips else "smooth sliding")

    rig = make(**noisy, thresholds=ss.Gaussian(mean=1.0, std=0.3))
    seen = ss.regime(ss.simulate(make(stiffness=2.0)))
    survey = Survey(rig, [Band(kind="stable", low=0.1, high=40.0)], "stick-slip")
    survey.simulate(Fated(math.inf))
    kinds = {v: b.kind for v in (1.5, 2.5, 3.5) for b in survey.bands() if v in b}
    assert [*kinds.values()] == ["stick-slip", "stable", "smooth sliding"]
    text = str(ss.predict(make(**noisy), fast=True))
    assert ("10000 contacts leave smooth sliding" in text) == ("delay" in noisy)


def test_a_drive_with_strokes_is_not_headlined_by_a_speed_that_never_lasts():
    """Its motion is taken from a run that lasts, not from the last stroke."""
    strokes = ss.constant(1.0, 3.0).then(ss.constant(-1.0, 3.0))
    both = (make(stiffness=2.0, drive=d) for d in (strokes, strokes.then(strokes)))
    lasting = ss.predict(make(stiffness=2.0), fast=True).amplitude
    for answer in (ss.predict(rig, fast=True) for rig in both):
        assert "; if 1 x_s/time lasted" in str(answer)
        assert answer.amplitude == pytest.approx(lasting, rel=0.1)


def test_a_change_tells_the_noise_that_it_leaves():
    """Near its limit smooth sliding may fluctuate as much as what it replaces."""
    rig = make(stiffness=2.0)
    change = mitigations._with_noise(
        rig, Mitigation(parameter="velocity", now=1.0, to=0.5)
    )
    there = ss.stability.contact_noise(rig.with_values(velocity=0.5))
    assert change.noise == there.relative_force
    *_, (*_, also) = sections.change_rows(rig, [replace(change, noise=0.091)])
    assert also == "the force fluctuates by 9.1 % rms, noise"
    # where the velocity fluctuates by more than linear theory covers, as a run shows
    few = make(stiffness=2.0, contacts=150)
    run = ss.regime(ss.simulate(trial(few.with_values(velocity=0.5))))
    shown = mitigations._with_noise(few, change).noise
    assert 0.1 < shown * run.mean_force / run.peak_to_peak < 0.4
    tiny = make(stiffness=1.0, mass=3.4e-8, damping=5440.0, contacts=30)
    assert mitigations._with_noise(tiny, change).noise > 0.1  # its run is undecided
    (line,) = sections.attempts(SimpleNamespace(rig=few, attempts={"mass": (1.0, 2.0)}))
    assert line.endswith(" does not stop it in every run")


ACTUATOR = """
slider = { mass = "0.9 kg", stiffness = "120 kN/m", damping_ratio = 0.12 }
interface = { normal_load = "60 N", mu_s = 0.5, mu_k = 0.34, v_half = "4 mm/s", breaking_displacement = "9 um" }
drive = { velocity = "0.4 mm/s" }
feasible = { load = ["20 N", "90 N"] }"""  # noqa: E501
SAID = {
    "mass": {"slider.mass": "mass", "slider.damping_ratio": "damping ratio"},
    "damping mass": {"slider.damping_ratio": "damping ratio", "slider.mass": "mass"},
    "contact_stiffness": {
        "interface.breaking_displacement": "breaking displacement",
        "interface.v_half": "v_half",
    },
    "load": {"interface.normal_load": "normal load"},
}


@pytest.mark.parametrize("changes", SAID)
def test_a_change_in_words_written_into_its_file_is_that_change(changes):
    rig, written = (
        read(tomllib.loads(ACTUATOR)) for read in (rigs.from_document, dict)
    )
    made = [
        Mitigation(parameter=name, now=(v := rig.value(name)), to=2.0 * v)
        for name in changes.split()
    ]
    words = ss.predict(rig, fast=True).changed(*made)
    for (table, name), before in (
        (key.split("."), before) for key, before in SAID[changes].items()
    ):
        value = re.search(rf"{before} from [^,]* to ([\d.]+( [^ ,]+)?)", words)[1]
        written[table][name] = float(value) if name == "damping_ratio" else value
    there = rigs.from_document(written)
    wanted = rig.with_values(**{each.parameter: each.to for each in made})
    handles = "mass stiffness damping contact_stiffness delay friction load"
    for name in handles.split():
        assert there.value(name) == pytest.approx(wanted.value(name), rel=5e-3), words
    # which gives the contact strength
    for each in (rig, rigs.from_document(rigs.to_document(rig))):
        assert each.operation.range_of("load")[0] == pytest.approx(
            each.natural.value("load") / 3.0
        )


@pytest.mark.slow
def test_mitigations_stay_within_what_could_be_built():
    feasible = {"mass": ["4 kg", "5 kg"], "load": ["24 N", "24 N"]}
    free, bound = (
        {change.parameter: change.to for change in ss.predict(rig).mitigations}
        for rig in (
            example("precision_stage"),
            example("precision_stage", feasible=feasible),
        )
    )
    assert free["mass"] > 5.0
    assert free["load"] < 24.0
    assert not {"mass", "load"} & set(bound)
    assert bound["stiffness"] == free["stiffness"]


@pytest.mark.slow
def test_where_linear_theory_ends_nothing_is_called_a_limit_of_stability():
    """Beyond 50 times the velocity of ageing the theory cannot decide."""
    ageing = ss.Langevin(rate=0.38)
    slow = {"stiffness": 0.15, "mass": 0.05, "damping": 4.8, "contacts": 200}
    slow["drive"] = ss.constant(1.6, 20.0)
    rig = make(
        **slow, thresholds=ss.Gaussian(1.0, 0.15), delay=ss.Delay(0.0), ageing=ageing
    )
    end = 50.0 * ageing.rate**2 / rig.velocity
    *_, stable, beyond = stability_along(rig, ss.stability.VELOCITY, 0.9, 2.0 * end)
    assert (stable.kind, beyond.kind) == ("stable", "unknown")
    assert stable.high == beyond.low == pytest.approx(end, rel=0.01)
    (margin,) = (
        each
        for each in prediction._margins(rig, Budget(math.inf))[0]
        if each.parameter == "velocity"
    )
    assert (margin.upper, margin.searched[1]) == (
        None,
        pytest.approx(stable.high * rig.velocity, rel=1e-3),
    )
    found = replace(
        ss.predict(rig, fast=True),
        bands=(stable, beyond),
        speeds_searched=(stable.low, beyond.high),
    )
    assert "(or more): linear theory cannot decide" in found.verdict
    figure = found.plot()
    assert "not known" in {text.get_text() for text in figure.legends[0].get_texts()}


def test_a_narrow_range_of_instability_is_told():
    """It is 8 % wide and lies between two of the speeds at which modes are counted."""
    rig = make(stiffness=0.3, mass=1e-3, damping=47.83)
    bands = stability_along(rig, ss.stability.VELOCITY, 0.01, 100.0)
    assert [band.kind for band in bands] == ["stable", "unstable", "stable"]


def test_an_oscillation_is_no_smooth_sliding_however_slow_it_is():
    """The slider never exceeds three times the drive, yet the force oscillates on."""
    both = {"mass": 0.01, "damping": 2.0, "contacts": 2000, "delay": ss.Delay(0.2)}
    both["drive"] = ss.constant(3.0, 30.0)
    rig, stiff = (make(stiffness=k, **both) for k in (2.0, 50.0))
    seen = ss.regime(ss.simulate(rig))
    assert (seen.kind, seen.largest_velocity < 3.0) == ("sustained oscillation", True)
    assert not Budget(300.0).slide_smoothly([rig], range(1, SEEDS + 1))
    assert Budget(300.0).slide_smoothly([stiff], range(1, SEEDS + 1))


@pytest.mark.filterwarnings("error")
# takes the master equation at nodes of the stretching, and responses at many speeds
@pytest.mark.slow
def test_contacts_that_break_by_heat():
    """Static friction and critical stiffness ignore it; the rest depends on it."""
    thresholds = ss.Gaussian(mean=1.0, std=0.3)
    interface = ss.Interface(
        thresholds=thresholds,
        delay=ss.Delay(0.5),
        activation=ss.Bell(width=0.1, attempts=10.0),
    )
    rig = ss.Rig(
        interface, ss.Slider(stiffness=0.5, mass=1e-3, damping=20.0), ss.constant(1.0)
    )
    found = ss.predict(rig, fast=True)
    assert (found.regime.kind, found.unstable_modes) == ("stick-slip", 2)
    assert not found.theory_note
    cold = replace(interface, activation=None)
    assert found.static_friction == ss.static_friction(cold)[0]
    assert (
        found.kinetic_friction
        == ss.kinetic_friction(interface, 1.0)
        < ss.kinetic_friction(cold, 1.0)
    )
    assert (
        "static friction F_s (slow rigid motion, no contact broken by heat)",
        "0.6457 f_s",
    ) in sections.numbers(found)
    stable, unstable = found.bands
    assert (stable.kind, unstable.kind) == ("stable", "unstable")
    assert stable.high == unstable.low
    for factor, modes in ((0.99, 0), (1.01, 2)):
        there = replace(rig, drive=ss.constant(factor * stable.high))
        assert ss.stability.count_unstable(there) == modes


def test_noise_of_few_contacts_is_no_oscillation():
    """The force fluctuates as 1/sqrt(N), whether a run starts in sliding or at rest."""
    random = {
        "thresholds": ss.LogNormal(1.0, 0.3222),
        "delay": scattered(0.09368, 0.053667),
    }
    light = {"stiffness": 0.3941, "mass": 0.004138, "damping": 0.4808}
    light["drive"] = ss.constant(1.0, 400.0)
    found = ss.predict(make(**light, **random, contacts=1000, seed=701), fast=True)
    assert found.unstable_modes == 0
    assert found.smooth
    assert not found.bistable
    assert not found.needs_mitigation
    words = "smooth sliding; the force fluctuates by .* % rms, noise of 1000 c"
    assert re.match(f"at 1 x_s/time: {words}", found.verdict)
    run = ss.simulate(
        found.recording.rig, start=ss.FromSliding(), method=ss.Contacts(1000, seed=5)
    )
    late = run["spring_force"].to_numpy()[-20_000:]
    assert found.noise == pytest.approx(late.std() / late.mean(), rel=0.3)
    assert Budget(300.0).regime(trial(found.rig)).kind == "smooth sliding"


def test_slips_of_few_contacts_are_noise_where_those_of_more_are_less():
    """Contacts that break one by one cause slips, although smooth sliding is stable."""
    few = {"stiffness": 8.0, "mass": 1e-3, "damping": 20.0, "contacts": 144}
    rig = make(**few, drive=ss.constant(0.005, 2e4))
    assert ss.regime(ss.simulate(rig)).kind == "stick-slip"
    assert not survives_noise(rig)
    assert Budget(300.0).regime(trial(rig)).kind == "smooth sliding"


def test_stick_slip_beside_a_limit_is_no_noise_though_theory_allows_as_much():
    """The oscillation does not fade with more contacts. The theory of noise does not
    cover it: the velocity fluctuates by more than a fifth.
    """
    few = {"stiffness": 3.745, "mass": 0.0033, "damping": 0.698, "contacts": 186}
    few |= {"thresholds": ss.LogNormal(1.0, 0.041), "delay": ss.Delay(0.1174)}
    rig = make(**few, drive=ss.constant(0.6185))
    assert survives_noise(rig)
    assert Budget(300.0).regime(trial(rig)).kind == "stick-slip"
    many = {"stiffness": 0.537, "mass": 2.7e-4, "damping": 6.78, "contacts": 2000}
    many |= {"thresholds": ss.LogNormal(1.0, 0.0187), "delay": ss.Delay(0.0378)}
    many |= {"newborn": ss.Gaussian(-0.218, 0.05), "initial": ss.Gaussian(0.0, 0.05)}
    small = make(**many, drive=ss.constant(0.8))
    assert ss.regime(ss.simulate(trial(small))).kind == "smooth sliding"
    assert Budget(300.0).regime(trial(small)).kind == "undecided"


@pytest.mark.takes(5)  # searches by simulations
def test_what_one_run_cannot_decide_is_judged_by_eight():
    few = {"stiffness": 0.36, "mass": 1.5e-3, "damping": 12.0, "contacts": 30}
    few |= {"drive": ss.constant(5.0), "delay": ss.OnArrest()}
    rig = make(**few, slip_to_slip_scatter=0.1, seed=0)
    runs = (trial(rig, other=other) for other in range(1, 9))
    kinds = [ss.regime(ss.simulate(run)).kind for run in runs]
    found = ss.predict(rig)
    assert found.lasting == (kinds.count("stick-slip"), 8)
    assert found.regime.kind == "smooth sliding"
    assert not found.smooth
    assert found.mitigations


@pytest.mark.slow
def test_contacts_that_attach_on_arrest_are_judged_by_runs():
    light = {"stiffness": 0.36, "mass": 1.5e-3, "damping": 3.0}
    light |= {"drive": ss.constant(0.85), "delay": ss.OnArrest()}
    found = ss.predict(make(**light, slip_to_slip_scatter=0.1, contacts=300, seed=0))
    assert found.regime.kind == "stick-slip"
    assert "no smooth sliding for linear theory to judge" in found.verdict
    assert any(
        band.kind == "stick-slip" and band.high > 1.5 * band.low for band in found.bands
    )
    assert (
        found.static_friction
        == ss.static_friction(make(stiffness=1.0, delay=ss.Delay(0.0)).interface)[0]
    )
    assert "damping" not in {m.parameter for m in found.mitigations}


@pytest.mark.parametrize(
    ("delay", "modes", "words"),
    [(0.0, 0, "cannot become unstable"), (math.inf, None, "never")],
)
def test_contacts_without_any_response_cannot_become_unstable(delay, modes, words):
    interface = ss.Interface(
        thresholds=ss.Gaussian(mean=1.0, std=0.2), delay=ss.Delay(delay)
    )
    rig = ss.Rig(
        interface, ss.Slider(stiffness=0.3, mass=1e-3, damping=1.0), ss.constant(0.5)
    )
    found = ss.predict(rig, fast=True)
    assert found.unstable_modes == modes
    assert words in found.theory_note


@pytest.mark.slow
def test_the_doubt_is_the_fraction_of_rigs_that_oscillate():
    """Among rigs drawn at random from the same ranges, within three standard errors."""
    rig = ss.example("precision_stage")
    rng = np.random.default_rng(7)
    budget = Budget(math.inf)
    found = advise.Doubt.of(rig, budget)
    count = 60
    names = {"slider.stiffness": "stiffness", "interface.thresholds": "std"}
    names["interface.delay"] = "delay"
    names |= {"interface.breaking_displacement": "contact_stiffness"}
    assert {key for key, *_ in found.matters} == set(names)
    seen = []
    for _ in range(count):
        there = rig
        for name in names.values():
            most = 0.5 if name == "std" else math.inf
            there = there.with_values(
                **{name: min(there.value(name) * 3.0 ** rng.uniform(-1.0, 1.0), most)}
            )
        seen.append(budget.regime(trial(there.natural, other=5)).kind)
    told = [kind for kind in seen if kind != "undecided"]
    part = sum(kind != "smooth sliding" for kind in told) / len(told)
    assert (
        abs(part - found.oscillates)
        < 3.0 * math.sqrt(0.25 / count + 0.25 / found.draws) + found.undecided
    )
    key, larger, smaller = found.matters[0]
    name = "breaking_displacement"
    assert f"Measure {name}: smaller, {100 * smaller:.0f} % oscillate" in str(found)
    assert (key, larger < smaller) == (f"interface.{name}", True)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "now", "then"), [("mu_s", 0.47, 0.55), ("mu_k", 0.33, 0.31)]
)
def test_an_assumed_coefficient_of_friction_is_varied_as_in_the_file(key, now, then):
    coefficients = {"normal_load": "3.1 kN", "mu_s": 0.47, "mu_k": 0.33}
    coefficients["breaking_displacement"] = "12 um"
    rest = {
        "slider": {"mass": "1.7 kg", "stiffness": "6 MN/m", "damping_ratio": 0.02},
        "drive": {"velocity": "40 mm/s"},
    }
    rig, read = (
        ss.read_rig(rest | {"interface": coefficients | {key: value}})
        for value in (now, then)
    )
    parameter, _ = advise.doubt._VARIED[f"interface.{key}"]
    varied = parameter.set(rig, parameter.get(rig) * then / now)
    assert varied.interface.thresholds.std == pytest.approx(
        read.interface.thresholds.std
    )
    assert varied.unit("f_s") == pytest.approx(read.unit("f_s"))


def test_what_the_doubt_cannot_tell_counts_neither_way():
    found = advise.Doubt(
        oscillates=1.0,
        undecided=0.75,
        draws=64,
        matters=(("slider.mass", 1.0, math.nan),),
    )
    assert "16 were decided: all oscillate." in str(found)
    none = advise.Doubt.of(ss.example("precision_stage"), Budget(0.0))
    assert "none could be decided (--thorough decides more)." in str(none)


@pytest.mark.slow
def test_a_range_of_speeds_is_made_smooth_by_one_change_or_by_two_smaller_ones():
    found = ss.predict(ss.example("precision_stage"), smooth=("0.5 mm/s", "5 mm/s"))
    smallest = min(each.size for each in found.mitigations)
    assert len(found.combined) == 2
    assert all(each.size < smallest for each in found.combined)
    for changes in (*((each,) for each in found.mitigations), found.combined):
        there = found.rig.with_values(**{each.parameter: each.to for each in changes})
        for speed in (0.5e-3, 1.3e-3, 3.1e-3, 5e-3):
            judged = Budget(math.inf).regime(
                trial(there.with_values(velocity=speed), other=40)
            )
            assert judged.kind == "smooth sliding", (changes, speed)


FASTER = Mitigation(parameter="velocity", now=0.02, to=0.22)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "found", "pictures"),
    [
        ("brake_pad", {"mitigations": [FASTER]}, 3),
        ("brake_pad", {"combined": [FASTER, replace(FASTER, parameter="mass")]}, 3),
        ("brake_pad", {}, 2),  # the map is drawn whatever helps
        ("caliper", {"mitigations": [FASTER]}, 3),  # which has no driving spring
    ],
)
def test_a_report_is_one_page_that_asks_for_no_other_file(name, found, pictures):
    found = replace(ss.predict(ss.example(name), fast=True), **found)
    page = report(found)
    assert page.count("data:image/svg+xml;base64,") == pictures
    assert page.count(html.escape(found.headline)) == 1  # not on the picture too
    assert 'delay = "1' in html.unescape(page)
    assert not re.search(r"(src|href)=.(?!data:)", page)

"""Every example runs as its page says, and the statements of the page are true."""

import runpy
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import stickslip as ss
from stickslip.io import rig_files as rig
from stickslip.paper import FIGURES
from stickslip.sweep.plan import read_plan

EXAMPLES = Path(__file__).parents[1] / "examples"
PAGES = sorted(
    f"{folder}/{path.stem}"
    for folder in ("practice", "elastic")
    for path in (EXAMPLES / folder).glob("*.py")
)
QUICK = ("precision_stage", "steps_and_holds", "teaching_bench", "wiper")


def example(name, folder="practice"):
    """The content of an example."""
    return SimpleNamespace(**runpy.run_path(str(EXAMPLES / folder / f"{name}.py")))


@pytest.mark.parametrize("name", rig.example_names())
def test_example_rigs_can_be_read_and_say_what_was_assumed(name):
    assert rig.read_rig(rig.example_file(name)).assumed


def test_an_example_that_is_not_there_is_told():
    words = r"^whiper: no such file or example; examples are axis, .*wiper$"
    with pytest.raises(ss.InputError, match=words):
        rig.example_file("whiper")
    words = "^phase_diagram: a sweep, not a rig; `stickslip sweep phase_diagram "
    with pytest.raises(ss.InputError, match=words):
        ss.read_rig("phase_diagram")
    assert read_plan("phase_diagram").total == 3200


def test_every_figure_has_its_page():
    pages = {f"{name[:3]}{int(name[3:]):02d}.py" for name in FIGURES}
    assert {path.name for path in (EXAMPLES / "figures").glob("*.py")} == pages


@pytest.mark.takes(6)
@pytest.mark.parametrize(
    "name",
    [
        name if Path(name).name in QUICK else pytest.param(name, marks=pytest.mark.slow)
        for name in PAGES
    ],
)
def test_an_example_is_its_own_command(name, tmp_path, monkeypatch, capsys):
    page = EXAMPLES / f"{name}.py"
    picture = tmp_path / "picture.png"
    assert f"``python examples/{name}.py " in page.read_text()
    monkeypatch.setattr(sys, "argv", [name, str(picture)])
    runpy.run_path(str(page), run_name="__main__")
    assert picture.stat().st_size > 10_000
    printed = capsys.readouterr().out
    assert "brake_pad" not in name or "damping times 10: groans from " in printed


def test_the_wiper_chatters_at_both_ends_of_its_stroke():
    wiper = example("wiper")
    low, high = wiper.chattering(rig.read_rig(wiper.RIG))
    # m/s: the stroke begins within these speeds, and its fastest part is outside
    assert low < 0.01 < high < 1.0


def test_damping_narrows_the_groan_from_above():
    brake = example("brake_pad")
    low, high = brake.groaning()
    low_damped, high_damped = brake.groaning(damping=10.0)
    assert high_damped < 0.5 * high
    assert low_damped == pytest.approx(low, rel=0.2)


def test_a_servo_stiffer_than_critical_tracks_better():
    stage = example("precision_stage")
    rig_ = rig.read_rig(stage.RIG)
    softest = np.interp(1e-3, stage.SPEEDS, stage.softest_servo(rig_))
    errors = []
    for factor in (0.5, 1.5):
        t, error = stage.error_of_tracking(rig_, factor * softest)
        errors.append(error[t > 0.7 * t[-1]].std())
    assert errors[1] < 0.2 * errors[0]


@pytest.mark.slow
def test_a_faster_bow_needs_more_force():
    string = example("bowed_string")
    forces, frequencies = zip(
        *(string.lightest(speed) for speed in (0.05, 0.2, 0.8)), strict=True
    )
    assert list(forces) == sorted(forces)
    harmonics = np.array(frequencies) / string.PITCH
    # the string chooses the pitch, not the rosin
    np.testing.assert_allclose(harmonics, harmonics.round(), atol=0.02)


@pytest.mark.slow
def test_faster_loading_makes_events_more_frequent_not_smaller():
    rock = example("rock_slab")
    slab = rig.read_rig(rock.RIG)
    (wait, drop), (wait_fast, drop_fast) = (
        rock.recurrence_and_drop(rock.load(slab, f)) for f in (0.1, 0.3)
    )
    assert wait / wait_fast == pytest.approx(3.0, rel=0.05)
    assert drop / drop_fast == pytest.approx(1.0, rel=0.1)


def test_a_stiffer_spring_turns_stick_slip_into_sliding():
    bench = example("teaching_bench")
    rig_ = rig.read_rig(bench.RIG)
    kinds = [ss.regime(bench.pull(rig_, stiffness)).kind for stiffness in bench.SPRINGS]
    assert kinds == ["stick-slip", "stick-slip", "smooth sliding"]


@pytest.mark.slow
def test_a_trace_tells_the_strength_of_its_contacts():
    trace = example("measured_trace")
    found = trace.fitted(draws=1500)
    strength = found["contact_strength"]
    assert strength.low < trace.BENCH.strength < strength.high
    ratio = found["stiffness_ratio"]
    assert ratio.low < trace.TRUTH["stiffness_ratio"] < ratio.high


@pytest.mark.parametrize(
    ("blocks", "at_rest", "left"), [(8, 4, 8), (16, 8, 0), (12, 0, 0), (12, 12, 12)]
)
def test_stick_slip_takes_a_short_bar_smooth_sliding_a_longer_one_and_alone_either_stays(  # noqa: E501
    blocks, at_rest, left
):
    case = example("side_by_side", "elastic")
    count = case.in_stick_slip(case.run(blocks, at_rest, duration=30.0))
    assert (count[0], count[-1]) == (at_rest, left)


@pytest.mark.slow
def test_a_slow_front_by_slow_slip():
    """The fast front, as in theory, stops where the prestress falls; a slow one does
    not.
    """
    module = example("slow_front", "elastic")
    run = ss.simulate(module.rig(beyond=0.44))
    fast, slow = module.speeds(run)
    fronts = ss.measure.fronts(run)
    assert int(fronts["blocks"][0]) == pytest.approx(114, abs=1)
    assert fast == pytest.approx(
        float(ss.elastic.front_speed(module.rig(), prestress=0.7)), abs=2e-3
    )
    assert slow == pytest.approx(0.026, abs=0.001)
    assert float(fronts["front_speed"][1]) == pytest.approx(slow, rel=0.1)
    without = ss.simulate(module.rig(sliding_force=0.0))["first_break"]
    assert (int(np.isfinite(without).sum()), float(without.max()) < 250) == (114, True)


@pytest.mark.slow
def test_few_contacts_without_weakening_move_as_paper_on_paper_does():
    diagram = example("regime_diagram")
    slow = []  # drops of the force in mN, at 42 um/s
    for (stiffness, velocity), row in diagram.compared():
        motions = [motion for _, motion in row.values()]
        assert len({diagram.word(motion) for motion in motions}) == 1
        slow += (
            [[1e3 * stiffness * motion.drop for motion in motions]]
            if velocity == 42
            else []
        )
    measured, model, _ = zip(*slow, strict=True)
    assert measured[1] > 1.5 * max(measured[0], measured[2])
    assert max(model) < 1.3 * min(model)

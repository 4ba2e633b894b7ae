"""The door for rigs: what a file says reaches the model, and every mistake gets one clear line."""

import copy
import math
import tomllib

import pytest

import stickslip as ss
from stickslip.io import rig_files as rigs
from stickslip.io.validation import LARGEST_FILE
from stickslip.model import units

EXAMPLE = rigs.example_file("pmma_slider")


@pytest.fixture
def document():
    return tomllib.loads(EXAMPLE.read_text())


def with_value(document, path, value):
    changed = copy.deepcopy(document)
    node = changed
    *parents, last = path.split(".")
    for part in parents:
        node = node[part]
    if value is None:
        del node[last]
    else:
        node[last] = value
    return changed


def test_the_published_bench_reaches_the_model_in_natural_units():
    rig = rigs.read_rig(EXAMPLE)
    scales = rig.scales
    assert scales.force == pytest.approx(1920 * 0.4)
    assert scales.si(rig.slider.mass, "mass") == pytest.approx(75.6e-3)
    assert scales.si(rig.slider.stiffness, "stiffness") == pytest.approx(4e6)
    assert rig.velocity == pytest.approx(0.4e-3)
    assert scales.si(rig.interface.delay.time, "time") == pytest.approx(2e-3)
    # Omega is a rate: the same in both systems of units.
    assert scales.si(rig.slider.frequency, "rate") == pytest.approx(math.sqrt(4e6 / 75.6e-3))
    assert rig.slider.damping == pytest.approx(0.3 * rig.slider.frequency)


def test_every_assumed_value_says_how_to_measure_it():
    rig = rigs.read_rig(EXAMPLE)
    assert "interface.breaking_displacement" in rig.assumed
    assert all(len(how) > 30 for how in rig.assumed.values())


def test_a_rig_written_as_toml_reads_back_the_same():
    rig = rigs.read_rig(EXAMPLE)
    again = rigs.from_document(tomllib.loads(rigs.to_toml(rig)))
    assert again == rig


@pytest.mark.parametrize(
    ("written", "same"),
    [("75.6 g", "0.0756 kg"), ("75.6 g", "75600 mg")],
)
def test_units_of_one_quantity_are_interchangeable(document, written, same):
    one = rigs.from_document(with_value(document, "slider.mass", written))
    two = rigs.from_document(with_value(document, "slider.mass", same))
    assert one.slider.mass == pytest.approx(two.slider.mass, rel=1e-12)


@pytest.mark.parametrize(
    ("distribution", "expected"),
    [
        ({"distribution": "gaussian", "std": 0.2}, ss.Gaussian(mean=1.0, std=0.2)),
        ({"distribution": "uniform", "low": 0.5, "high": 1.5}, ss.Uniform(low=0.5, high=1.5)),
        ({"distribution": "exponential"}, ss.Exponential(mean=1.0)),
        ({"distribution": "gamma", "std": 0.3}, ss.Gamma(mean=1.0, std=0.3)),
        ({"distribution": "lognormal", "std": 0.3}, ss.LogNormal(mean=1.0, std=0.3)),
        ({"distribution": "weibull", "shape": 3.0}, ss.Weibull(scale=1.0, shape=3.0)),
        (
            {"distribution": "empirical", "edges": [0.5, 1.0, 1.5], "weights": [1.0, 2.0]},
            ss.Empirical(edges=(0.5, 1.0, 1.5), weights=(1.0, 2.0)),
        ),
        ({"distribution": "empirical", "samples": [0.9, 1.0, 1.3]}, ss.Empirical.from_samples([0.9, 1.0, 1.3])),
    ],
)
def test_every_distribution_can_be_written(document, distribution, expected):
    assert (
        rigs.from_document(with_value(document, "interface.thresholds", distribution)).interface.thresholds == expected
    )


def test_delays_random_and_never(document):
    random = {"mean": "2 ms", "std": "1 ms", "negative": "fold"}
    delay = rigs.from_document(with_value(document, "interface.delay", random)).interface.delay
    assert (delay.mean, delay.std, delay.negative) == (pytest.approx(0.4), pytest.approx(0.2), "fold")
    never = rigs.from_document(with_value(document, "interface.delay", "never")).interface.delay
    assert math.isinf(never.time)


def test_natural_units_take_plain_numbers():
    rig = rigs.from_document(
        {
            "units": "natural",
            "slider": {"stiffness": 2, "mass": 1e-4, "damping": 200},
            "interface": {"thresholds": {"distribution": "gaussian", "std": 0.1}, "delay": 0.2},
            "drive": {"pieces": [{"start": 0.1, "end": 3, "duration": 10}, {"start": 3, "end": 0.1, "duration": 10}]},
        }
    )
    assert rig.scales is None
    assert rig.slider == ss.Slider(stiffness=2.0, mass=1e-4, damping=200.0)
    assert rig.drive == ss.ramp(0.1, 3.0, 10).then(ss.ramp(3.0, 0.1, 10))


MISTAKES = [
    ("slider.stifness", "4 MN/m", "slider.stifness", "did you mean 'stiffness'"),
    ("slider.mass", None, "slider.mass", "is missing"),
    ("slider.mass", "-75 g", "slider.mass = '-75 g'", "at least 0"),
    ("slider.mass", "75 mm", "slider.mass = '75 mm'", "not in a unit of 'kg'"),
    ("slider.mass", 75, "slider.mass = 75", "has no unit"),
    ("slider.mass", "75", "slider.mass = '75'", "has no unit"),
    ("slider.mass", "heavy", "slider.mass = 'heavy'", "cannot be read"),
    ("slider.mass", "", "slider.mass = ''", "cannot be read"),
    ("slider.mass", "nan g", "slider.mass = 'nan g'", "finite"),
    ("slider.mass", "inf g", "slider.mass = 'inf g'", "finite"),
    ("slider.mass", True, "slider.mass = True", "quantity"),
    ("slider.stiffness", "0 N/m", "slider.stiffness = '0 N/m'", "above 0"),
    ("slider.damping", "3 1/s", "slider", "one of damping"),
    ("slider.relative_damping", -0.3, "damping", "at least 0"),
    ("interface.thresholds", {"distribution": "gausian", "std": 0.1}, "interface.thresholds", "known distributions"),
    (
        "interface.thresholds",
        {"distribution": "gaussian", "sdt": 0.1},
        "interface.thresholds.sdt",
        "did you mean 'std'",
    ),
    ("interface.thresholds", {"distribution": "gaussian", "std": -0.1}, "Gaussian.std", "at least 0"),
    ("interface.thresholds", {"distribution": "uniform", "low": 2.0, "high": 1.0}, "Uniform.high", "above 2"),
    ("interface.thresholds", {"distribution": "empirical"}, "interface.thresholds", "samples, or edges and weights"),
    ("interface.thresholds", 0.1, "interface.thresholds = 0.1", "table"),
    ("interface.initial", {"distribution": "gaussian", "mean": 9.0, "std": 0.1}, "Interface.initial", "nearer to 0"),
    ("interface.normal_load", "1920 kg", "interface.normal_load", "unit of 'N'"),
    ("interface.friction_coefficient", None, "interface", "contact_strength"),
    ("interface.breaking_displacement", None, "interface.breaking_displacement", "missing"),
    ("interface.delay", "-2 ms", "interface.delay = '-2 ms'", "at least 0"),
    ("interface.delay", {"mean": "2 ms"}, "interface.delay.std", "missing"),
    ("interface.delay", {"mean": "2 ms", "std": "1 ms", "negative": "drop"}, "interface.delay.negative", "'clip'"),
    ("interface.ageing", {"distribution": "langevin", "time": "0 s"}, "interface.ageing.time", "above 0"),
    ("drive.velocity", "0 m/s", "drive.velocity", "above 0"),
    ("drive.distance", "-1 mm", "drive.distance", "above 0"),
    ("drive.pieces", [], "drive", "either velocity, or pieces"),
    ("drive", 3, "drive = 3", "table"),
    ("simulation.contacts", 0, "Contacts.count = 0", "at least 1"),
    ("simulation.contacts", 1.5, "simulation.contacts = 1.5", "whole number"),
    ("simulation.contacts", 10**12, "Contacts.count", "at most"),
    ("simulation.method", "monte carlo", "simulation.method", "'contacts' or 'master equation'"),
    ("simulation.seed", -1, "Contacts.seed", "at least 0"),
    ("units", "imperial", "units = 'imperial'", "'SI' or 'natural'"),
    ("assumed", {"slider.colour": "look"}, "slider.colour", "names no key"),
]


@pytest.mark.parametrize(("path", "value", "place", "remedy"), MISTAKES)
def test_a_mistake_names_its_place_and_its_remedy(document, path, value, place, remedy):
    with pytest.raises(ss.InputError) as caught:
        rigs.from_document(with_value(document, path, value), "rig.toml")
    message = str(caught.value)
    assert message.startswith("rig.toml: ")
    assert place in message
    assert remedy in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty"),
        (b"  \n", "empty"),
        (b"\x89HDF\r\n\x1a\n\x00\xff", "binary"),
        (b"a = 1\x00", "binary"),
        (b"mass = ", "not valid TOML"),
        (b"# " + b"x" * LARGEST_FILE, "more than a rig file may have"),
    ],
)
def test_a_file_that_is_no_rig(tmp_path, content, words):
    file = tmp_path / "rig.toml"
    file.write_bytes(content)
    with pytest.raises(ss.InputError, match=words):
        rigs.read_rig(file)


def test_no_file_and_a_directory(tmp_path):
    with pytest.raises(ss.InputError, match="no such file"):
        rigs.read_rig(tmp_path / "none.toml")
    with pytest.raises(ss.InputError, match="directory"):
        rigs.read_rig(tmp_path)


@pytest.mark.parametrize(
    ("value", "unit", "words"),
    [
        (4e6, "N/m", "4 MN/m"),
        (0.0756, "kg", "75.6 g"),
        (4e-4, "m/s", "400 um/s"),
        (1.5, "kg", "1.5 kg"),
        (0.0, "N", "0 N"),
    ],
)
def test_values_in_words(value, unit, words):
    assert units.engineering(value, unit) == words

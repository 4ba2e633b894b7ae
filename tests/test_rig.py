"""Rig files: their values reach the model, and each mistake gets one clear line."""

import json
import re
import tomllib
from dataclasses import fields, replace

import pytest
from benches import with_value
from drawn import NUMBER
from refusals import mistakes

import stickslip as ss
from stickslip.errors import InputError
from stickslip.io import datasets, rig_keys
from stickslip.io import rig_files as rigs
from stickslip.io.tables import LARGEST_FILE
from stickslip.rigid import static_friction
from stickslip.sliding import kinetic_friction

EXAMPLE = rigs.example_file("pmma_slider")


@pytest.fixture
def document():
    return tomllib.loads(EXAMPLE.read_text())


def reread(rig):
    return ss.read_rig(tomllib.loads(rigs.to_toml(rig)))


def test_the_published_bench_reaches_the_model_in_natural_units():
    rig = rigs.read_rig(EXAMPLE)
    given = {"mass": 75.6e-3, "stiffness": 4e6, "velocity": 0.4e-3, "delay": 2e-3}
    given["load"] = 1920 * 0.4
    assert {name: rig.value(name) for name in given} == pytest.approx(given)
    # Omega is a rate, equal in both systems of units.
    rate = rig.scales.si(rig.slider.frequency, "rate")
    assert (rate**2, rig.slider.damping_ratio) == pytest.approx((4e6 / 75.6e-3, 0.15))


def test_a_default_that_was_taken_is_assumed_with_its_value(document):
    for key in ("interface.delay", "interface.initial"):
        document = with_value(document, key, None)
        document["assumed"].pop(key)
    rig = rigs.from_document(document)
    taken = {key: item for key, item in rig.assumed.items() if item.default}
    assert {key: item.value for key, item in taken.items()} == {
        "interface.initial": '{ distribution = "gaussian", mean = 0.0, std = 0.01 }',
        "interface.delay": "0 s",
    }
    warning = "never strengthen with rest and nothing can stick-slip"
    assert warning in str(taken["interface.delay"])
    assert reread(rig).assumed.keys() == rig.assumed.keys()
    assert rig.assumed.keys() - rig.replace(delay="5 ms").assumed == {"interface.delay"}


RANDOM = {"mean": "2 ms", "std": "1 ms", "negative": "fold"}
DELAYS = RANDOM, "never", "on arrest", "0 s", "1.2345678901234 ms"
UNIFORM = {"distribution": "uniform", "low": 0.2, "high": 1}
PIECE = {"start": "1 um/s", "end": "0.3 mm/s", "duration": "7 s"}
MASTER = {"method": "master equation", "rtol": 7e-4}
GAUSSIAN = {"distribution": "gaussian"}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        (None, None),
        *(("interface.delay", delay) for delay in DELAYS),
        ("interface.newborn", GAUSSIAN | {"mean": 0.3, "std": 0.0}),
        ("interface.ageing", {"model": "langevin", "time": "3 s", "newborn": 0.1}),
        ("interface.ageing", {"model": "exponential", "time": "70 ms"}),
        ("interface.ageing", {"model": "logarithmic", "time": "7 ms", "slope": 0.02}),
        (
            "interface.thresholds",
            {"distribution": "empirical", "samples": [0.9, 1, 1.3]},
        ),
        ("interface.thresholds", GAUSSIAN | {"std": 0.7, "lower": 0.1}),
        ("interface.initial", {"distribution": "steady state", "thresholds": UNIFORM}),
        ("drive", {"velocity": "-0.7 mm/s", "duration": "1 min"}),
        ("drive", {"pieces": [PIECE] * 3}),
        ("simulation", MASTER | {"start": "sliding", "interval": "0.3 ms"}),
        ("slider", {"mass": "0 g", "stiffness": "0.7 N/um", "damping": "1e7 1/s"}),
    ],
)
def test_a_rig_written_as_toml_reads_back_the_same(document, key, value):
    rig = rigs.from_document(with_value(document, key, value) if key else document)
    assert reread(rig) == rig
    assert rigs.to_toml(reread(rig)) == rigs.to_toml(rig)
    assert rig.source in rigs.to_toml(rig)


# Files that together have every key: of sliders, the interface, the drive, the
# simulation.
SPRINGS = "leaf side damping viscosity ends"
BLOCK = "spacing width height youngs_modulus density"
FILES = {
    kind: " ".join(keys.split()).replace("BLOCK", BLOCK).replace("SPRINGS", SPRINGS)
    for kind, keys in re.findall(
        r"^(\w.*):\n((?: {4}.*\n)+)",
        """
slider:
    mass stiffness damping | thresholds initial delay newborn
    | velocity distance | method seed rtol
slider by ratio:
    mass stiffness damping_ratio | thresholds v_half activation
    | velocity duration | start
slider on areas:
    mass stiffness damping | areas | pieces | contacts interval
slider by friction:
    mass stiffness damping | normal_load mu_s mu_k slip_to_slip_scatter
    | velocity | contacts
slider by friction curve:
    mass stiffness damping | normal_load friction mu_s viscosity
    | velocity | contacts
chain:
    blocks coupling mass SPRINGS | thresholds sliding_force ageing
    | velocity | contacts
chain of material:
    blocks BLOCK SPRINGS | thresholds | velocity | contacts
chain held on top:
    blocks BLOCK shear_modulus side | thresholds | velocity | contacts
sheet:
    along across coupling shear mass SPRINGS | thresholds | velocity | contacts
sheet of material:
    along across BLOCK shear_modulus SPRINGS | thresholds | velocity | contacts
""",
        re.MULTILINE,
    )
}


def keys_of(kind):
    return [part.split() for part in FILES[kind].split(" | ")]


STARTS = {name: key.example for name, key in rig_keys.START.items()}
HEADS = "name", "source", "feasible", "assumed", "fitted"
TOP = {name: rig_keys.TOP[name].example for name in HEADS}


def written(kind, factor, *, natural):
    """Write a rig file from the examples of keys, with all quantities times a factor,
    or equal to it if they are plain numbers.
    """
    tables = (kind.split()[0], "interface", "drive", "simulation")
    names = dict(zip(tables, keys_of(kind), strict=True))
    if not natural:
        without_friction = "mu_s" not in names["interface"]
        names["interface"] += ["breaking_displacement"]
        names["interface"] += ["contact_strength"] * without_friction
    found = dict(TOP)
    for table in tables:
        keys = rig_keys.TABLES[table]
        found[table] = {name: keys[name].example for name in names[table]}
    if "rtol" in found["simulation"]:
        found["simulation"]["method"] = "population"
    if kind == "sheet":
        found["simulation"] |= {"start": STARTS}

    def scaled(value):
        if isinstance(value, dict):
            bell = rig_keys.keys_of(ss.Bell) if "kind" in value else {}
            # quantities that no scale of the rig measures
            apart = {name for name, key in bell.items() if key.si}
            scales = value.keys() - apart
            return value | {name: scaled(value[name]) for name in scales}
        if isinstance(value, list):
            return [scaled(item) for item in value]
        is_text = isinstance(value, str)
        parts = re.fullmatch(r"([-+.e0-9]+) (\S+)", value) if is_text else None
        if parts is None:
            return value
        return factor if natural else f"{float(parts[1]) * factor!r} {parts[2]}"

    assumed = {name: found.pop(name) for name in ("assumed", "fitted")}
    feasible = {"feasible": {"stiffness": [factor, 2 * factor]}} if natural else {}
    units = {"units": "natural"} if natural else {}
    return scaled(found) | assumed | feasible | units


@pytest.mark.parametrize(
    ("kind", "natural"),
    [(kind, n) for kind in FILES for n in (False, True)[: 2 - ("friction" in kind)]],
)
@pytest.mark.parametrize("factor", [1.0, 0.7310585786300049, 2.0 / 3.0])
def test_every_key_is_written_and_reads_back(kind, natural, factor):
    rig = rigs.from_document(written(kind, factor, natural=natural))
    again = reread(rig)
    # A natural value that no SI text gives exactly is read back as its neighbour.
    plain, before = (json.dumps(datasets.encode(each)) for each in (again, rig))
    assert NUMBER.sub("#", plain) == NUMBER.sub("#", before)
    expected = pytest.approx(list(map(float, NUMBER.findall(before))), rel=1e-15)
    assert list(map(float, NUMBER.findall(plain))) == expected
    draws = {key: one.draws for key, one in rig.fitted.items()}
    assert {key: one.draws for key, one in again.fitted.items()} == draws
    assert rigs.to_toml(again) == rigs.to_toml(rig)


OWN = [
    {"mu_s": 0.16, "mu_k": 0.13, "v_half": "1.5 mm/s"},
    {"mu_s": 0.4123456, "mu_k": 0.3217654, "v_half": "0.3141592 mm/s"},
    {"contact_strength": "44.123456 N", "v_half": "20 mm/s"},
    {"contact_strength": "41 N", "delay": "3.14159265 ms"},
]


@pytest.mark.parametrize("changes", [{}, {"delay": "7 ms", "std": 0.0987}])
@pytest.mark.parametrize("given", OWN)
def test_a_rig_is_shown_in_the_keys_that_it_was_given_by(given, changes):
    interface = {"normal_load": "220 N", "breaking_displacement": "8 um"} | given
    if "mu_s" not in given:
        interface["thresholds"] = GAUSSIAN | {"std": 0.2}
    slider = {"mass": "22 kg", "stiffness": "1.2 MN/m", "damping": "40.9 1/s"}
    document = {"slider": slider, "interface": interface}
    rig = ss.read_rig(document | {"drive": {"velocity": "0.2 mm/s"}})
    rig = rig.replace(**changes)
    shown = tomllib.loads(rigs.to_toml(rig, own=True))
    defaults = {"initial"} | ({"delay"} if "v_half" not in given else set())
    assert shown["interface"].keys() | defaults == interface.keys() | defaults
    again = ss.read_rig(shown)
    for name in ("mass", "stiffness", "damping", "velocity", "delay", "std", "load"):
        assert again.value(name) == pytest.approx(rig.value(name), rel=2e-4, abs=0)
    for unit in ("force", "length"):
        assert again.unit(unit) == pytest.approx(rig.unit(unit), rel=1e-4)
    if not changes:
        for key in given.keys() & {"mu_s", "mu_k"}:
            assert shown["interface"][key] == pytest.approx(given[key], rel=1e-4)
        digits = re.findall(r"\d+(?:\.\d+)?", shown["interface"].get("v_half", "1"))
        assert len(digits[0].replace(".", "").lstrip("0")) <= 4


def test_every_key_is_in_a_file_above():
    used = set()
    for kind in FILES:
        tables = (kind.split()[0], "interface", "drive", "simulation")
        for table, names in zip(tables, keys_of(kind), strict=True):
            used |= {(table, name) for name in names}
    # test_structures.py and test_loads.py write files with these
    used |= {("slider", name) for name in rig_keys.STRUCTURES}
    used |= {("controller", name) for name in rig_keys.TABLES["controller"]}
    used |= {("drive", "load"), ("drive", "force")}
    used |= {("interface", "breaking_displacement"), ("interface", "contact_strength")}
    known = {(table, name) for table, keys in rig_keys.TABLES.items() for name in keys}
    assert used == known


def test_a_rig_made_in_python_or_shipped_can_be_written():
    for name in rigs.example_names():
        assert reread(rigs.example(name)) == rigs.example(name)
    interface = ss.Interface(thresholds=ss.Gamma(1.0, 0.1), delay=ss.Delay(1 / 3))
    rig = ss.Rig(interface, rigs.example("wiper").slider, ss.constant(0.7, 20))
    assert reread(rig) == rig
    for speeds in ("2 mm/s", ["1 mm/s", "9 mm/s"], {"from": "1 mm/s", "to": "9 mm/s"}):
        rig = ss.read_rig(BRAKE | {"drive": {"velocity": speeds}})
        assert reread(rig) == rig
        faster = rig.replace(velocity="7 mm/s")
        assert reread(faster).velocity == pytest.approx(faster.velocity, rel=1e-15)
        assert faster.operation.speeds[:1] in ((), (faster.natural.velocity,))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"method": ss.MasterEquation(memoryless=True)}, "the method MasterEq"),
        ({"drive": ss.constant(1.0).until(ss.model.Travel(3.0))}, "conditions"),
        ({"slider": lambda s: s}, "no name among slider"),
        ({"start": ss.Prestressed(stretching=0.6)}, "not elastic"),
    ],
)
def test_what_no_file_can_hold_is_said(changes, words):
    message = f"{words}.* cannot be written into a rig file"
    with pytest.raises(ss.InputError, match=message):
        rigs.to_document(rigs.example("pmma_slider").replace(**changes))


THRESHOLDS = "interface.thresholds"
DRAWS = {"interval": "1 to 2", "how": "weak"}
MISTAKES = [
    *mistakes("""
slider.stifness = "4 MN/m"
    slider.stifness | did you mean 'stiffness'
slider.mass
    slider.mass | is missing
slider.mass = "-75 g"
    slider.mass = '-75 g' | at least 0
slider.mass = 75
    slider.mass = 75 | has no unit
interface.temperature = {}
    interface.temperature | it is called 'activation'
interface.track_scatter = 0.1
    interface.track_scatter | it is called 'slip_to_slip_scatter'
interface.areas = "site"
    interface.areas = 'site' | kept = true
slider.mass = true
    slider.mass = True | quantity
slider.damping = "3 1/s"
    slider | give damping_ratio or damping, not both
interface.thresholds = { distribution = "gausian", std = 0.1 }
    interface.thresholds.distribution | the known distributions
interface.thresholds = { distribution = "uniform", low = 2.0, high = 1.0 }
    interface.thresholds.high = 1 | above 2
interface.thresholds = { distribution = "empirical" }
    interface.thresholds.samples | missing
interface.initial = { distribution = "gaussian", mean = 9.0, std = 0.1 }
    interface.initial | nearer to 0
interface.mu_s = 0.4
    interface | give contact_strength or mu_s and mu_k, not both
interface.delay = { mean = "2 ms", std = "1 ms", negative = "drop" }
    interface.delay.negative | 'clip'
drive.velocity = "0 m/s"
    drive.velocity | above 0
drive.pieces = []
    drive | give velocity or pieces or force, not both
interface.ageing = { distribution = "langevin", time = "1 s" }
    interface.ageing.model | 'logarithmic'
drive = 3
    drive = 3 | table
simulation.contacts = 0
    simulation.contacts = 0 | at least 1
simulation.method = "monte carlo"
    simulation.method | 'contacts' or 'master equation'
simulation = { method = "master equation", seed = 3 }
    simulation.seed | unknown key
assumed = { "interface.delay" = "2 ms to 1 ms" }
    interface.delay | two values, the lowest first
assumed = { "simulation.rtol" = [0.1, 0.2] }
    simulation.rtol | is not in the file, so at its default
assumed = { "interface.delay" = ["1 ms", "1 kg"] }
    interface.delay | write it as in '
assumed = { "slider.colour" = "look" }
    slider.colour | did you mean 'slider.modes'
drive.velocity = []
    drive.velocity = [] | must be speeds, as in
drive.velocity = ["20 mm/s", "1,2 m/s"]
    drive.velocity[1] = '1,2 m/s' | write '1.2 m/s'
drive.velocity = { from = "1 mm/s" }
    drive.velocity.to | is missing
drive.velocity = { from = "2 mm/s", to = "1 mm/s" }
    drive.velocity = { | must be speeds, as in
feasible = { stifness = ["1 MN/m", "2 MN/m"] }
    feasible.stifness | did you mean 'stiffness'
feasible = { mass = ["5 kg", "1 kg"] }
    feasible.mass | the lowest first
feasible = { mass = ["5 N", "6 kg"] }
    feasible.mass[0] = '5 N' | not in a unit of 'kg'
"""),
    ("fitted", {"slider.mass": DRAWS}, "fitted.slider.mass.draws", "is missing"),
    ("drive", {"pieces": None}, "drive.pieces = None", "must be a list of at least"),
    (THRESHOLDS, {"distribution": 10**5000}, f"{THRESHOLDS}.distribution = an", "be"),
    *(
        (
            "fitted",
            {key: DRAWS | {"draws": [0.5, draw, 0.25]}},
            f"fitted.{key}.draws[1] = {draw}",
            "must be above 0",
        )
        for key, draw in (
            ("slider.mass", 0.0),
            ("slider.stiffness", -2.0),
            ("slider.damping_ratio", -0.1),
            ("interface.thresholds.std", -1.0),
            ("interface.newborn.std", -1.0),
            ("interface.delay", 0.0),
            ("interface.breaking_displacement", -1e-6),
            ("drive.velocity", 0.0),
            ("simulation.contacts", -3.0),
        )
    ),
    *(
        ("fitted", {key: DRAWS | {"draws": draws}}, f"fitted.{key}.draws{at}", words)
        for key, draws, at, words in (
            ("slider.mass", [1.0, 1e40], "[1] = 1e+40", "must be between"),
            ("interface.thresholds", [1.0], "", "is no number"),
            ("interface.newborn.colour", [1.0], "", "is no key of a rig file"),
        )
    ),
]


def test_draws_of_thresholds_whose_distribution_has_no_name_are_refused(document):
    document["interface"]["thresholds"]["distribution"] = ["gaussian"]
    document["fitted"] = {"interface.thresholds.std": DRAWS | {"draws": [0.1]}}
    with pytest.raises(ss.InputError, match="one of the known distributions"):
        rigs.from_document(document)


@pytest.mark.parametrize(("path", "value", "place", "remedy"), MISTAKES)
def test_a_mistake_names_its_key_and_its_remedy(document, path, value, place, remedy):
    with pytest.raises(ss.InputError) as caught:
        rigs.from_document(with_value(document, path, value), "rig.toml")
    message = str(caught.value)
    assert message.startswith("rig.toml: ")
    assert place in message
    assert remedy in message
    assert "\n" not in message
    keys = [mistake.place for mistake in caught.value.mistakes]
    assert place.partition(" ")[0] in [key.removeprefix("assumed.") for key in keys]
    assert caught.value.place == (keys[0] if len(keys) == 1 else "")


def test_all_missing_keys_are_told_at_once_each_with_a_value_that_it_could_have():
    with pytest.raises(ss.InputError) as caught:
        rigs.from_document({}, "rig.toml")
    mistakes = caught.value.mistakes
    values = [f"{mistake.place} = {mistake.example}" for mistake in mistakes]
    assert all(value in str(caught.value) for value in values)
    assert len(values) == 7
    mended = rigs.from_document(tomllib.loads("\n".join(values)))
    assert mended.velocity == pytest.approx(0.4e-3)


def test_of_many_mistakes_some_are_told_and_the_rest_counted(document):
    names = [f"{'mistaken_' * 9}{i}" for i in range(9)]
    with pytest.raises(ss.InputError) as caught:
        rigs.from_document(document | dict.fromkeys(names, 1), "rig.toml")
    told = str(caught.value).count(" mistaken_")
    assert 0 < told < 9
    assert str(caught.value).endswith(f"; and {9 - told} more")
    places = [mistake.place for mistake in caught.value.mistakes]
    assert places == [name[:60] for name in names]
    for thousands in (
        {"drive": {"pieces": [{}] * 20_000}},
        {"assumed": {f"slider.a{i}": "b" for i in range(20_000)}},
    ):
        with pytest.raises(ss.InputError, match=r" more|duration = "):
            rigs.from_document(document | thousands)


COEFFICIENTS = (0.45, 0.35), (0.6, 0.35), (0.36, 0.34), (0.9, 0.35), (0.355, 0.35)


@pytest.mark.parametrize(("mu_s", "mu_k"), COEFFICIENTS)
def test_two_coefficients_of_friction_are_those_of_the_rig(document, mu_s, mu_k):
    """Coefficients that no thresholds can give are refused, with their range."""
    for key in ("contact_strength", "thresholds"):
        del document["interface"][key]
    document["interface"] |= {"normal_load": "4 kN", "mu_s": mu_s, "mu_k": mu_k}
    if not 1.03 < mu_s / mu_k < 1.917:
        with pytest.raises(ss.InputError, match=r"between 1\.030 and 1\.917") as caught:
            rigs.from_document(document)
        assert caught.value.place == "interface.mu_s"
        return
    rig = rigs.from_document(document)
    unit = rig.scales.force / 4e3
    assert static_friction(rig.interface)[0] * unit == pytest.approx(mu_s, rel=1e-4)
    assert kinetic_friction(rig.interface, 1e-9) * unit == pytest.approx(mu_k, rel=1e-6)


def test_a_file_that_is_no_rig(tmp_path):
    file = tmp_path / "rig.toml"
    contents = {
        b"": "empty",
        b"  \n": "empty",
        b"\x89HDF\r\n\x1a\n\x00\xff": "not valid TOML",
        b"mass = ": "not valid TOML",
        b"# " + b"x" * LARGEST_FILE: "more than a rig file may have",
    }
    for content, words in contents.items():
        file.write_bytes(content)
        with pytest.raises(ss.InputError, match=words):
            rigs.read_rig(file)
    text = rigs.example_file("wiper").read_text()
    file.write_text(text, encoding="utf-8-sig")
    assert rigs.read_rig(file) == ss.example("wiper")


BRAKE = tomllib.loads(rigs.example_file("brake_pad").read_text(encoding="utf-8"))


def brake(velocity="20 mm/s", **top):
    return {**BRAKE, "drive": {"velocity": velocity}, **top}


@pytest.mark.parametrize(
    ("velocity", "first", "speeds", "between"),
    [
        (["20 mm/s", "0.1 m/s"], 0.02, (0.02, 0.1), None),
        ({"from": "1 mm/s", "to": "0.1 m/s"}, 0.01, (), (0.001, 0.1)),
    ],
)
def test_a_rig_gives_speeds_and_what_could_be_built(velocity, first, speeds, between):
    ranges = {"stiffness": ["20 MN/m", "60 MN/m"], "std": [0.1, 0.3]}
    ranges["load"] = ["1 kN", "4 kN"]
    read = ss.read_rig(brake(velocity, feasible=ranges))
    ends = [end * read.unit("k") for end in read.operation.range_of("stiffness")]
    assert ends == pytest.approx([2e7, 6e7])
    assert read.operation.range_of("mass") is None
    size = read.unit("x_s/time")
    assert read.velocity == pytest.approx(first, rel=1e-12)
    operation = read.operation
    for found, expected in ((operation.speeds, speeds), (operation.between, between)):
        assert [speed * size for speed in found or ()] == pytest.approx(expected or ())
    assert ss.read_rig(rigs.to_document(read)) == read


SPEEDS = ["20 mm/s", "0.1 m/s"], {"from": "20 mm/s", "to": "0.1 m/s"}


@pytest.mark.parametrize("speeds", SPEEDS, ids=["list", "range"])
@pytest.mark.parametrize(
    ("name", "force", "length"),
    [("load", 2, 1), ("friction", 2, 2), ("contact_stiffness", 1, 0.5)],
)
def test_all_else_is_as_it_was_when_a_unit_is_varied(name, force, length, speeds):
    read = ss.read_rig(brake(speeds, feasible={"mass": ["1 kg", "9 kg"]}))
    turned = read.with_values(**{name: 2 * read.value(name)})
    assert turned.value(name) == pytest.approx(2 * read.value(name))
    assert turned.scales.force == pytest.approx(force * read.scales.force)
    assert turned.scales.stretching == pytest.approx(length * read.scales.stretching)
    for other in ("stiffness", "mass", "damping", "velocity", "delay", "std"):
        assert turned.value(other) == pytest.approx(read.value(other)), other
    for rig in (read, turned):
        operation = rig.operation
        speeds = operation.speeds or operation.between
        at = [speed * rig.unit("x_s/time") for speed in speeds]
        unit = rig.unit("f_s time^2/x_s")
        mass = [end * unit for end in operation.range_of("mass")]
        assert (at, mass) == (pytest.approx([0.02, 0.1]), pytest.approx([1.0, 9.0]))


def test_a_rig_says_itself_in_its_own_units():
    read = ss.read_rig("brake_pad")
    assert "30 MN/m" in repr(read)
    assert "20 mm/s" in str(read)
    assert ">Brake pad, creep groan</b>" in read._repr_html_()
    assert ">30 MN/m</td>" in read._repr_html_()
    text = str(read)
    for line in ("contact strength N f_s +2.4 kN", "breaking displacement x_s +20 um"):
        assert re.search(f"^{line}$", text, re.MULTILINE)
    with_load = read.replace(operation=ss.model.Operation(normal_load=2.0))
    assert re.search(r"^normal load +4\.8 kN$", str(with_load), re.MULTILINE)
    bar = ss.example("pmma_bar")
    assert "contact strength N f_s of a block" in str(bar)


@pytest.mark.parametrize(
    ("part", "cells"),
    [
        ("slider", ("Slider, in natural units", ">stiffness<", ">0.25 k<")),
        ("interface", ("Interface, in natural units", ">delay<", ">Delay(time=1.0)<")),
        ("drive", ("Drive, in natural units", ">for (time)<", ">200<")),
    ],
)
def test_parts_of_a_rig_are_cards_with_their_units(part, cells):
    shown = getattr(ss.example("brake_pad"), part)._repr_html_()
    for cell in cells:
        assert cell in shown


def _every_rig():
    """The example rigs in SI units, the same without units, and one that keeps its time
    in milliseconds, with no part at its default.
    """
    shipped = [rigs.example(name) for name in rigs.example_names()]
    until = ss.constant(2.0, 1.0).until(ss.model.Travel(0.7))
    drive = ss.ramp(0.3, 2.0, 4.0).then(until)
    first = shipped[0].natural.replace(
        drive=drive,
        output=ss.Output(interval=0.3, snapshots=(0.7, 1.9), bins=30),
        start=ss.Prestressed(stretching=0.3, push=0.7),
        method=ss.Contacts(30, seed=4),
    )
    scales = ss.model.Scales(force=700.0, stretching=3e-6, time=1e-3)
    natural = [rig.natural for rig in shipped]
    return [*shipped, *natural, first, replace(first, scales=scales)]


@pytest.mark.parametrize("name", [field.name for field in fields(ss.Rig)])
def test_what_is_read_from_a_rig_can_be_given_back(name):
    for rig in _every_rig():
        assert rig.replace(**{name: getattr(rig, name)}) == rig
        other = rig.replace(name="another")
        changed = other.replace(**{name: getattr(rig, name)}).natural
        assert changed == (rig if name == "name" else other).natural


def test_a_number_without_unit_is_refused_by_a_rig_in_si_units():
    rig = rigs.example("brake_pad")
    refused = r"^replace: velocity = 10: has no unit; write velocity='10 m/s', or with"
    with pytest.raises(InputError, match=refused):
        rig.replace(velocity=10)
    assert rig.replace(velocity="10 m/s") == rig.with_values(velocity=10)
    assert rig.replace(std=0.2).value("std") == pytest.approx(0.2)
    assert rig.natural.replace(velocity=10).velocity == pytest.approx(10.0)


def test_a_record_in_the_units_of_a_rig_becomes_one_of_the_rig():
    for rig in _every_rig():
        speed = rig.unit("velocity")
        force = rig.unit("force")
        given = ss.ramp(3.0 * speed, 5.0 * speed, 0.2 * rig.unit("time"))
        ends = given.until(ss.model.ForceAbove(0.7 * force))
        (piece,) = rig.replace(drive=rig.to_natural(ends)).drive.pieces
        found = (piece.start, piece.end, piece.duration, piece.until.force)
        assert found == pytest.approx((3.0, 5.0, 0.2, 0.7))


def test_a_drive_that_runs_backwards_may_run_forwards():
    bench = ss.read_rig("precision_stage")
    backwards = replace(bench.natural, drive=ss.constant(-1.0, duration=5.0))
    assert backwards.replace(velocity=2.0).drive == ss.constant(2.0, duration=2.5)
    turning = replace(backwards, drive=ss.ramp(-1.0, -2.0, duration=5.0))
    for rig in (turning, replace(turning, scales=bench.scales)):
        with pytest.raises(InputError, match=f"{-rig.unit('velocity'):g}, not this"):
            rig.with_values(velocity=rig.unit("velocity"))


@pytest.mark.parametrize("velocity", [0.0, 2.0])
def test_a_velocity_that_a_drive_has_changes_nothing(velocity):
    rig = ss.example("precision_stage").natural
    rig = replace(rig, drive=ss.ramp(velocity, 3.0, duration=5.0))
    assert rig.replace(velocity=velocity) == rig

"""The answer in some twenty lines: each of its sentences has a test."""

import math
import re
from dataclasses import replace

import pytest

import stickslip as ss
from stickslip import advise
from stickslip.advise import Band, Mitigation, screen, sections
from stickslip.io import rig_files as rigs
from stickslip.model.parameters import PARAMETERS, UNITS_OF_A_RIG

KINDS = ("smooth sliding", "stick-slip", "sustained oscillation", "unstable", "stable")


@pytest.fixture(scope="module")
def found():
    """The verdict on a rig that stick-slips."""
    return ss.predict(ss.example("brake_pad"), fast=True)


def bands_of(found, *kinds):
    """Bands of these kinds, of equal width on the strip."""
    low, high = found.speeds_searched
    ends = [low * (high / low) ** (i / len(kinds)) for i in range(len(kinds) + 1)]
    parts = zip(kinds, ends, ends[1:], strict=False)
    return tuple(
        Band(kind=kind.removeprefix("- "), bistable=kind[0] == "-", low=a, high=b)
        for kind, a, b in parts
    )


def changed(rig, **factors):
    return tuple(
        Mitigation(parameter=name, now=rig.value(name), to=rig.value(name) * factor)
        for name, factor in factors.items()
    )


def doubted(**fields):
    """A doubt about sixty-four rigs, half of which oscillate."""
    usual = {"oscillates": 0.5, "undecided": 0.0, "draws": 64}
    usual |= {"matters": (("slider.mass", 0.9, 0.1),), "assumed": ("slider.mass",)}
    return advise.Doubt(**usual | fields)


SHIPPED = {name: rigs.example(name) for name in rigs.example_names()}
RIGID = [name for name, rig in SHIPPED.items() if isinstance(rig.slider, ss.Slider)]


@pytest.mark.parametrize("name", RIGID)
def test_all_that_can_be_said_of_a_rig_that_ships_fits_in_24_lines(name, found):
    rig = ss.example(name)
    known = (*PARAMETERS, *UNITS_OF_A_RIG)
    names = [each.name for each in known if advise.mitigations.has(rig, each)]
    low = min(rig.operation.speeds or [rig.velocity])
    matters = (("interface.breaking_displacement", 0.9, 0.1),)
    ended = {"undecided": 0.5, "ended": True, "decides": True}
    here = replace(
        found,
        rig=rig,
        complete=True,
        speeds_searched=(low / 100.0, low * 100.0),
        mitigations=changed(rig, **dict.fromkeys(names, 4.0)),
        not_searched=("mass of the slider",),
        doubt=doubted(matters=matters, assumed=(*rig.assumed,)[:1], **ended),
    )
    here = replace(here, bands=bands_of(here, *KINDS))
    lines = here.text(80).splitlines()
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    assert f"and {len(names) - 5} more: --details." in " ".join(lines)
    assert len(here.text(details=True).splitlines()) > len(lines)


def test_the_verdict_comes_first_in_capitals_with_frequency_and_force(found):
    title, verdict, *_ = str(found).splitlines()
    assert title == "Brake pad, creep groan, at 20 mm/s"
    assert re.fullmatch(r"  STICK-SLIP   170 Hz, force ±1\.(19|2)\d* kN", verdict)


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("smooth sliding", "LINEARLY UNSTABLE   but smooth in this run"),
        ("undecided", "UNDECIDED   smooth sliding is linearly unstable"),
    ],
)
def test_any_verdict_is_in_capitals(kind, said, found):
    here = replace(found, regime=replace(found.regime, kind=kind))
    assert screen.verdict(here.headline_motion) == said


@pytest.mark.parametrize(
    ("kind", "lasting", "said", "mitigated"),
    [
        ("stick-slip", (2, 8), "; lasts in 2 of 8 runs", True),
        ("smooth sliding", (2, 8), "an oscillation lasts in 2 of 8 runs", True),
        ("smooth sliding", (0, 8), None, False),
        ("stick-slip", None, None, True),
    ],
)
def test_a_verdict_counts_other_contacts(kind, lasting, said, mitigated, found):
    regime = replace(found.regime, kind=kind)
    here = replace(found, regime=regime, lasting=lasting, unstable_modes=0)
    here = replace(here, bands=bands_of(here, "smooth sliding"))
    words = " ".join(str(here).split())
    assert said in words if said else "lasts in" not in words
    assert here.needs_mitigation == mitigated
    assert here.smooth == (not mitigated)
    # noise that ends smooth sliding is that of the rig, whose run may have fewer
    rig = here.rig.replace(method=ss.Contacts(77_000))
    noisy = str(replace(here, rig=rig, survives_noise=False))
    assert ("but 77000 contacts leave" in noisy) == (kind == "stick-slip")


@pytest.mark.parametrize("count", [7, 40, 60])
@pytest.mark.parametrize("kinds", [KINDS, ("- stick-slip", *KINDS), KINDS[::-1]])
def test_marks_of_the_strip_agree_with_the_bands(count, kinds, found):
    bands = bands_of(found, *kinds)
    strip = screen.strip(replace(found, bands=bands), count)
    assert strip.count("now") == 1
    place = strip.index("now")
    low, high = found.speeds_searched
    at = count * math.log(found.rig.velocity / low) / math.log(high / low)
    assert abs(place - at) <= 0.5
    cells = [kind for kind in strip if kind != "now"]
    assert len(cells) == count
    for i, kind in enumerate(cells):
        ends = [low * (high / low) ** ((i + side) / count) for side in (0.45, 0.55)]
        here = [band for band in bands if band.low <= ends[1] and ends[0] <= band.high]
        wanted = {"bistable" if band.bistable else band.kind for band in here}
        assert kind in wanted


def test_a_band_narrower_than_a_mark_is_on_the_strip(found):
    wide, *_ = bands_of(found, "smooth sliding")
    narrow = Band(kind="stick-slip", low=0.3, high=0.301)
    bands = replace(wide, high=0.3), narrow, replace(wide, low=0.301)
    assert screen.strip(replace(found, bands=bands), 60).count("stick-slip") == 1


def test_speeds_that_no_band_tells_of_are_not_known(found):
    band = Band(kind="stick-slip", low=0.01, high=0.1)
    strip = screen.strip(replace(found, bands=(band,)), 40)
    assert strip[0] == strip[-1] == "unknown"


@pytest.mark.parametrize("kinds", [KINDS, KINDS[:2], ("- stick-slip", "unknown")])
def test_the_legend_explains_the_marks_that_are_there_and_no_others(kinds, found):
    lines = replace(found, bands=bands_of(found, *kinds)).text(200).splitlines()
    marks = set(lines[2].split("um/s")[1].split("2 m/s")[0].strip())
    told = {each.split()[0] for each in lines[3].strip().split("  ")}
    assert marks == told
    meanings = dict(each.split(" ", 1) for each in lines[3].strip().split("  "))
    meant = dict(screen.MARKS.values())
    assert meanings == {mark: meant[mark] for mark in marks}


def test_both_ends_of_a_range_of_speeds_are_marked(found):
    here = ss.read_rig("brake_pad")
    here = replace(here, operation=replace(here.operation, between=(0.5, 3.0)))
    told = replace(found, rig=here)
    assert screen.strip(told, 60).count("now") == 2
    assert "| now (its speeds)" in str(told)


def test_what_can_be_changed_on_the_machine_is_told_first_and_the_rest_counted(found):
    names = ("velocity", "stiffness", "damping", "mass", "load", "delay", "std")
    factors = {name: 2.0 + 0.1 * i for i, name in enumerate(names[:5])}
    changes = changed(found.rig, **factors, delay=1.2, std=1.3)
    lines = str(replace(found, mitigations=changes, complete=True)).splitlines()
    assert len([line for line in lines if "->" in line]) == 5
    assert "  and 2 more: --details." in lines
    assert not re.search("delay|thresholds", str(lines))


def test_changes_are_sorted_and_say_their_factors(found):
    factors = {"velocity": 11.0, "mass": 0.2, "load": 1.7, "damping": 8.0}
    changes = changed(found.rig, **factors)
    lines = str(replace(found, mitigations=changes, complete=True)).splitlines()
    table = [line for line in lines if "->" in line]
    said = [line.split()[-2:] for line in table]
    assert said == [["x", "1.7"], ["/", "5"], ["x", "8"], ["x", "11"]]
    assert re.sub(" +", " ", table[0]) == " contact strength 2.4 kN -> 4.08 kN x 1.7"
    assert re.sub(" +", " ", table[2]) == " damping ratio 0.05 -> 0.4 x 8"
    assert "All are large" not in str(lines)
    large = replace(found, mitigations=changes[:1], complete=True)
    assert "All are large: try two together with --smooth." in str(large)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("mass", "and damping ratio 0.0707"),
        ("contact_stiffness", "and breaking displacement 10 um"),
        ("velocity", None),
        ("damping", None),
    ],
)
def test_what_a_file_has_to_give_anew_stands_beneath_a_change(name, said, found):
    _, *more = screen.table(found.rig, changed(found.rig, **{name: 2.0}))
    assert [line.strip() for line in more] == [said] * bool(said)


def test_a_file_with_v_half_has_to_give_it_anew(found):
    rig = replace(found.rig, given=("interface.v_half",))
    _, more = screen.table(rig, changed(rig, contact_stiffness=2.0))
    assert "v_half 10 mm/s" in more


def test_where_nothing_stops_it_the_next_step_is_named(found):
    tried = {"attempts": {"velocity": (0.1, 1.0)}, "not_searched": ("mass", "load")}
    here = replace(found, complete=True, **tried)
    words = " ".join(str(here).split())
    assert "What stops it" not in words
    assert "No single change within the ranges searched stops it." in words
    assert "2 parameters not fully searched: --thorough." in words
    assert '--smooth "20 mm/s" "20 mm/s" tries two together.' in words
    one = str(replace(here, not_searched=("mass",)))
    assert "1 parameter not" in " ".join(one.split())
    assert "No single change" not in str(replace(here, attempts={}))


def test_a_smooth_rig_says_what_would_end_it_the_nearest_first(found):
    speed = {"lower": 0.001, "upper": 0.05, "stable": ((0.001, 0.05),)}
    mass = {"lower": 2.0, "upper": None, "stable": ((2.0, 90.0),)}
    here = replace(
        found,
        regime=replace(found.regime, kind="smooth sliding"),
        unstable_modes=0,
        bands=bands_of(found, "smooth sliding"),
        margins=(
            advise.Margin(
                parameter="velocity", value=0.02, searched=(1e-4, 1.0), **speed
            ),
            advise.Margin(parameter="mass", value=3.0, searched=(0.1, 90.0), **mass),
        ),
    )
    lines = str(here).splitlines()
    place = lines.index("What would end it, each alone (linear stability)")
    changes = [line.split() for line in lines if "->" in line]
    assert [words[-2:] for words in changes] == [["/", "1.5"], ["x", "2.5"]]
    below = [line.split() for line in lines[place + 1 :] if "->" in line]
    assert [words[0] for words in below] == ["mass", "speed"]


HALF = {"undecided": 0.5}
ALL = "32 were decided: all oscillate"


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({}, "32 of 64 rigs within a factor 3 of what was assumed oscillate."),
        ({"undecided": 0.5}, "32 were decided: 16 oscillate."),
        (
            HALF | {"oscillates": 1.0, "ended": True},
            f"{ALL} (--thorough decides more).",
        ),
        ({"undecided": 1.0, "oscillates": math.nan}, "none could be decided."),
        ({"assumed": ()}, "32 of 64 draws of the fit oscillate."),
        ({"decides": True}, "Measure mass: smaller, 10 % oscillate; larger, 90 %."),
    ],
)
def test_how_sure_it_is_is_the_fraction_of_the_doubt(fields, said, found):
    assert said in " ".join(str(replace(found, doubt=doubted(**fields))).split())


def test_without_an_assumption_nothing_is_said_of_how_sure_it_is(found):
    assert "How sure?" not in str(found)
    assert str(found).endswith(screen.MORE)


def test_a_terminal_gets_colours_and_signs(found, monkeypatch):
    here = replace(found, mitigations=changed(found.rig, velocity=11.0, mass=0.2))
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    shown = here.text(80, bold=True, signs=True)
    assert re.search("\033\\[30;48;[0-9;]*m\\*", shown)  # on a coloured background
    bare = re.sub("\033\\[[0-9;]*m", "", shown)
    for sign, plain in zip(sections.ARROWS, sections.ASCII, strict=True):
        assert f" {sign} " in bare
        bare = bare.replace(f" {sign} ", f" {plain} ")
    assert bare == here.text(80)
    monkeypatch.setenv("NO_COLOR", "1")
    assert not re.search("\033\\[[0-9;]*48;", here.text(80, bold=True))
    assert here.text(80).replace("±", "").isascii()


@pytest.mark.parametrize("width", [60, 80, 200])
def test_no_line_is_wider_than_the_terminal(width, found):
    bands = bands_of(found, "- stick-slip", *KINDS)
    here = replace(found, bands=bands, doubt=doubted())
    here = replace(here, mitigations=changed(found.rig, velocity=11.0))
    assert max(map(len, here.text(width).splitlines())) <= width


def test_waves_are_told_on_the_strip():
    chain = ss.Chain(blocks=8, coupling=80.0, mass=1e-4, damping=42.426, leaf=1.0)
    interface = ss.Interface(thresholds=ss.Gaussian(1.0, 0.1), delay=ss.Delay(0.1))
    found = ss.predict(ss.Rig(interface, chain, ss.constant(velocity=1.5)))
    title, verdict, strip, legend, *_, more = str(found).splitlines()
    assert title == "rig, at 1.5 x_s/time"
    assert verdict.startswith("  SMOOTH SLIDING IS UNSTABLE   from 0.824 to ")
    assert {mark for mark in "*:|" if mark in strip} == {"*", ":", "|"}
    assert legend == "  * unstable by theory  : stable by theory  | now"
    assert more == screen.MORE


def test_a_drive_there_and_back_keeps_the_strip_of_speeds(found):
    there = ss.constant(1.0, 30.0)
    for back, at in (
        (ss.constant(-1.0, 30.0), "at 1"),
        (ss.ramp(1.0, -2.0, 30.0), " - 2 x_s"),
    ):
        drive = there.then(back)
        answer = ss.predict(replace(found.rig, scales=None, drive=drive), fast=True)
        title, _, strip, *_ = str(answer).splitlines()
        assert at in title
        assert answer.driven is None
        assert "x_s/time" in strip

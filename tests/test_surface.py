"""Surfaces: the solver against closed forms and kept numbers, contacts of maps."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.io.rig_files import to_document
from stickslip.surface import press, tangential_stiffness
from stickslip.surface.maps import correlation_length, mean_waves
from stickslip.surface.prior import births, stretchings


def waves(n, most, turn=0.0):
    """Waves in all directions of up to `most` periods, with random phases; rms 1e-3."""
    golden = (math.sqrt(5.0) - 1.0) / 2.0
    modes = np.zeros((n, n), dtype=complex)
    pairs = ((i, j) for i in range(most + 1) for j in range(-most, most + 1))
    for m, (i, j) in enumerate((i, j) for i, j in pairs if i or j > 0):
        phase = (golden * (m + 1) ** 2 + turn) % 1.0
        modes[i, j % n] = (i * i + j * j) ** -0.9 * np.exp(2j * np.pi * phase)
    height = np.fft.ifft2(modes).real
    return height * (1e-3 / height.std())


def sphere(n, radius, curvature):
    """A sphere in a cell, and the pressure (Hertz) of a contact of a given width."""
    at = np.arange(n) - (n - 1) / 2.0
    height = -(at[:, np.newaxis] ** 2 + at**2) / (2.0 * curvature)
    return height, 4.0 / 3.0 * radius**3 / curvature / n**2


LARGE = pytest.param(1024, 0.005, marks=pytest.mark.slow)  # 5 s


@pytest.mark.parametrize(("n", "error"), [(256, 0.025), (512, 0.01), LARGE])
def test_a_sphere_touches_as_hertz_says(n, error):
    radius, curvature = n // 15, 400.0
    height, pressure = sphere(n, radius, curvature)
    p = press(height, 1.0, pressure, 1.0)
    assert np.count_nonzero(p) / (np.pi * radius**2) == pytest.approx(1.0, abs=error)
    assert p.max() == pytest.approx(2.0 / np.pi * radius / curvature, rel=1e-3)


@pytest.mark.parametrize("part", [0.1, 0.6])
def test_a_wave_touches_as_westergaard_says(part):
    x = np.arange(256) / 256
    height = 1e-3 * np.cos(2.0 * np.pi * x)[:, np.newaxis] + np.zeros(256)
    full = np.pi * 1e-3  # pressure that flattens the surface
    p = press(height, 1.0 / 256, part * full, 1.0)
    assert p.max() == pytest.approx(2.0 * math.sqrt(part) * full, rel=1e-3)


UNIT = ss.surface.Material(young=2.0 * (1.0 - 0.3**2))  # with a contact modulus of 1 Pa
FINER = 512, 32, 5e-4, math.inf, 0.05975, 0.6848, 1.313


@pytest.mark.parametrize(
    ("n", "most", "pressure", "hardness", "area", "length", "effective"),
    [
        (256, 16, 2e-4, math.inf, 0.03973, 0.3070, 4.077),
        (256, 16, 2e-4, 0.01, 0.04004, 0.3058, 4.074),
        pytest.param(*FINER, marks=pytest.mark.slow),
    ],
)
def test_rough_surfaces_touch(n, most, pressure, hardness, area, length, effective):
    """Areas, lengths and numbers of effective contacts agree with a kept table."""
    height = waves(n, most)
    p = press(height, 1.0 / n, pressure, 1.0, hardness=hardness)
    stiffness = tangential_stiffness(p, 1.0 / n, 1.0, 0.3)
    assert p.mean() == pytest.approx(pressure, rel=1e-9)
    assert p.max() <= hardness
    assert np.count_nonzero(p) / p.size == pytest.approx(area, abs=5.1e-6)
    assert pressure / stiffness / 1e-3 == pytest.approx(length, abs=5.1e-5)
    body = replace(UNIT, hardness=hardness)
    seen = ss.surface.contacts(height, 1.0 / n, pressure=pressure, material=body)
    assert float(seen["effective_number"][0]) == pytest.approx(effective, abs=5.1e-4)
    assert "effective contacts" in seen.attrs["note"]
    assert "correlation lengths" in seen.attrs["note"]


def test_all_contact_at_the_hardness_bears_on_the_highest_nodes():
    height = waves(64, 8)
    p = press(height, 1.0 / 64, 2e-4, 1.0, hardness=4e-4)
    assert p.mean() == pytest.approx(2e-4)
    borne = p >= 4e-4
    assert np.count_nonzero(borne) == p.size // 2
    assert height[borne].min() >= height[p == 0.0].max()


def test_a_disc_is_a_little_stiffer_in_its_cell_than_alone():
    """Mindlin's stiffness is that of a disc without neighbours."""
    at = np.arange(256) - 127.5
    disc = at[:, np.newaxis] ** 2 + at**2 < 12.0**2
    alone = 2.0 * 12.0 * 2.0 * (1.0 - 0.3) / (2.0 - 0.3) / disc.size
    assert 1.08 < tangential_stiffness(disc, 1.0, 1.0, 0.3) / alone < 1.18


def test_progress_runs_to_the_end_of_a_solution():
    done = []
    press(waves(64, 8), 1.0 / 64, 2e-4, 1.0, progress=done.append)
    assert min(done) >= 0.0
    assert 0.8 < max(done) <= 1.0


# ------------------------------------------------------------------ contacts of a map

SURFACE = ss.surface


@pytest.fixture(scope="module")
def rough():
    band = {"roll_off": "40 um", "cut_off": "8 um"}
    return SURFACE.self_affine(rq="1 um", hurst=0.8, nodes=256, **band)


@pytest.fixture(scope="module")
def found(rough):
    return SURFACE.contacts(rough, pressure="2 MPa", material="pmma")


def finest(found, name):
    return found[name].to_numpy()[found["resolution_of"].to_numpy() == 0]


def test_contacts_carry_the_load_and_have_the_stiffness_of_all(found):
    whole = found.attrs["map_area"] * found.attrs["load"]
    assert finest(found, "force").sum() == pytest.approx(whole, rel=1e-9)
    together = whole / float(found["length"][0])
    assert finest(found, "stiffness").sum() == pytest.approx(together, rel=1e-9)
    covered = finest(found, "area").sum() / found.attrs["map_area"]
    assert covered == pytest.approx(float(found["contact_area"][0]))


def test_a_contact_across_the_edges_of_a_map_is_one(rough, found):
    again = SURFACE.contacts(rough.roll(x=56, y=100), pressure="2 MPa", material="pmma")
    assert again["number"].to_numpy().tolist() == found["number"].to_numpy().tolist()


def test_area_grows_with_the_load_and_the_length_does_not(rough):
    """Amontons' law over a factor of 16 in load."""
    pressures = np.array([0.5e6, 2e6, 8e6])
    seen = SURFACE.loads(rough, pressures=pressures, material="pmma")
    logs = np.log(pressures)
    area = np.polyfit(logs, np.log(seen["contact_area"][:, 0]), 1)[0]
    length = np.polyfit(logs, np.log(seen["length"][:, 0]), 1)[0]
    number = np.polyfit(logs, np.log(seen["number"][:, 0]), 1)[0]
    assert 0.95 < area <= 1.0
    assert abs(length) < 0.1
    assert 0.3 < number < 0.8


def test_the_length_hardly_depends_on_the_resolution_but_the_number_does(found):
    length, number = (found[name].to_numpy() for name in ("length", "number"))
    assert np.ptp(length) < 0.1 * length[0]  # 5 % in the mean of several maps
    assert number[0] > 1.5 * number[1] > 1.5 * 1.2 * number[2]


@pytest.mark.parametrize("length", ["renewal", "elastic"])
def test_the_law_of_births_gives_the_friction_of_the_map(found, length):
    """The snapshot gives too much by 1 + CV^2; kept areas need no correction."""
    x, w = stretchings(found, 0, length, 0.4)
    mean = (w * x).sum()
    births_mean = 1.0 / (w / x).sum()
    made = SURFACE.interface(found, length=length)
    friction = births_mean * ss.kinetic_friction(made, velocity=1.0)
    assert friction == pytest.approx(mean / 2.0, rel=0.02)
    law, std = births(x, w)
    assert law * (1.0 + std**2) == pytest.approx(mean)


def test_kept_areas_give_half_of_their_strength(found):
    made = SURFACE.interface(found, kept=True)
    assert made.areas.kept
    friction = ss.kinetic_friction(made, velocity=1.0)
    assert friction == pytest.approx(0.5 * made.areas.distribution.moment(1))


def test_a_tilt_is_removed_and_reported(rough, found):
    tilted = rough + 0.02 * rough["x"] - 0.01 * rough["y"]
    again = SURFACE.contacts(tilted.assign_attrs(rough.attrs), **PMMA)
    assert "a tilt of 22" in again.attrs["note"]
    assert "tilt" not in found.attrs["note"]
    length = [float(each["length"][0]) for each in (again, found)]
    assert length[0] == pytest.approx(length[1], rel=0.1)


PMMA = {"pressure": "2 MPa", "material": "pmma"}
NOISE = np.random.default_rng(1).standard_normal((64, 64))
HOLED = np.where(NOISE > 3.0, np.nan, NOISE)
SOFT = SURFACE.Material(young=3e9, hardness=1e6)
REFUSED = {
    "holes": (HOLED, {}, r"nodes \(.* %\) have no height; fill"),
    "flat": (0.0 * NOISE, {}, "the same everywhere"),
    "a line": (NOISE[0], {}, "two dimensions"),
    "texts": ([["a"]], {}, "array of real numbers"),
    "complex": (NOISE + 0j, {}, "array of real numbers"),
    "hardly rough": (1e-300 * NOISE, {}, "the same everywhere"),
    "single nodes": (1e-7 * NOISE, {}, r"not resolve them: .*shortest = '8 um'"),
    "much contact": (1e-3 * waves(64, 8), {"pressure": "80 MPa"}, "lower the pressure"),
    "all in contact": (1e-3 * waves(64, 8), {"pressure": "80 GPa"}, "covers 100 %"),
    "too much load": (waves(64, 8), {"material": SOFT}, "not below the hardness"),
    "no material": (waves(64, 8), {"material": "cheese"}, "glass and pmma; for others"),
    "no pressure": (waves(64, 8), {"pressure": "2 N"}, "not in a unit of 'Pa'"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_map_that_shows_no_contacts_is_refused(name):
    height, given, words = REFUSED[name]
    with pytest.raises(ss.InputError, match=words):
        SURFACE.contacts(height, "1 um", **(PMMA | given))


def test_heights_of_unknown_unit_or_places_are_refused(rough):
    for height, words in (
        (rough.drop_attrs(deep=False), r"units is None; give heights in m"),
        (rough.drop_vars("y"), "has no coordinates"),
        (rough.assign_coords(y=2.0 * rough["y"]), "pixels must be square"),
    ):
        with pytest.raises(ss.InputError, match=words):
            SURFACE.contacts(height, **PMMA)


def test_few_contacts_make_no_interface():
    seen = SURFACE.contacts(1e-3 * waves(128, 8), "1 um", **PMMA)
    with pytest.raises(ss.InputError, match="effective contacts; an interface of many"):
        SURFACE.interface(seen)


# ------------------------------------------------------------------ maps


@pytest.mark.parametrize("nodes", [64, 128])
def test_a_drawn_map_has_its_spectrum(nodes):
    band = {"roll_off": "40 um", "cut_off": "8 um"}
    made = SURFACE.self_affine(rq="2 um", hurst=0.8, nodes=nodes, **band)
    assert float(made.std()) == pytest.approx(2e-6)
    long, short = mean_waves(made)
    assert 8e-6 < short < 16e-6 < long < 40e-6
    assert 4e-6 < correlation_length(made) < 20e-6


def test_a_drawing_gives_a_map_and_says_how_little_it_is():
    made = SURFACE.from_drawing(ra="0.8 um", nodes=256)
    assert float(made.std()) == pytest.approx(math.sqrt(math.pi / 2.0) * 0.8e-6)
    assert "their diameters within 6.6" in made.attrs["note"]
    finer = SURFACE.from_drawing(ra="0.8 um", rsm="0.1 mm", nodes=256)
    assert "their diameters within 4" in finer.attrs["note"]


HEADER = "# Channel: Height\n# Width: 64.00 µm\n# Height: 64.00 µm\n# Value units: nm\n"


def written(folder, name, values):
    """Write a file of a map in nm, with 1 um from node to node."""
    file = folder / name
    if name.endswith(".npz"):
        np.savez(file, height=values, spacing=1e-6, unit="nm")
    else:
        mark = "," if name.endswith(".csv") else "\t"
        rows = "\n".join(mark.join(f"{v!r}" for v in row) for row in values.tolist())
        if "de" in name:  # German
            rows = rows.translate(str.maketrans(",.", ";,"))
        encoding = "latin-1" if "de" in name else "utf-8"
        file.write_text(HEADER + rows, encoding=encoding)
    return file


@pytest.mark.parametrize("name", ["map.npz", "map.csv", "map.asc", "de.csv"])
def test_files_give_the_map_that_was_written(name, tmp_path):
    read = SURFACE.read(written(tmp_path, name, NOISE))
    assert read.to_numpy() == pytest.approx(1e-9 * NOISE)
    assert float(read["x"][1]) == pytest.approx(1e-6)


class Topography:
    """A stand-in for the class of SurfaceTopography."""

    unit = "um"
    pixel_size = (2.0, 2.0)

    def heights(self):
        return NOISE


def test_a_topography_is_a_map():
    read = SURFACE.read(Topography())
    assert read.to_numpy() == pytest.approx(1e-6 * NOISE)
    assert float(read["y"][1]) == pytest.approx(2e-6)


SQUARE = ("1 " * 40 + "\n") * 40
OBLONG = "# Width: 3 um\n# Height: 2 um\n" + SQUARE
AXES = "\n".join(f"{i}" + 40 * f" {i % 7}" for i in range(40))
BAD_FILES = {
    "no unit": ("map.csv", SQUARE, {}, "unit of the heights is missing"),
    "no spacing": ("map.csv", SQUARE, {"unit": "um"}, "spacing .* is missing"),
    "no map": ("map.csv", "# a\nb c\n", {"unit": "um"}, "cannot be read as a map"),
    "axes": ("map.asc", AXES, {"unit": "um"}, "the first column rises evenly"),
    "points": ("map.csv", "1 2 3\n" * 40, {"unit": "um"}, "40 rows of 3 .* are points"),
    "oblong": ("map.asc", OBLONG, {"unit": "um"}, "pixels must be square"),
    "cut off": ("map.npz", "PK\x03\x04", {}, "cannot be read as a map of heights"),
    "instrument": ("map.opd", "x", {}, r"pip install 'stickslip\[surface\]'"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_a_file_that_is_no_map_is_refused(name, tmp_path):
    called, text, given, words = BAD_FILES[name]
    file = tmp_path / called
    file.write_text(text)
    with pytest.raises(ss.InputError, match=words):
        SURFACE.read(file, **given)


def test_a_light_load_is_borne_by_few_nodes(rough):
    p = press(rough.to_numpy(), 1e-6, 50, 1e9)
    assert 1 <= np.count_nonzero(p) < 10
    assert p.mean() == pytest.approx(50.0)


ANY = (None, 5, -1.0, "x", [], [1, 2], {}, math.nan, object(), NOISE[0], True)


@pytest.mark.parametrize("value", ANY, ids=lambda value: type(value).__name__)
def test_what_is_no_argument_is_refused_in_one_line(value, rough, found):
    told = SURFACE.estimate(found)
    calls = {
        "contacts": lambda: SURFACE.contacts(value, **PMMA),
        "loads": lambda: SURFACE.loads(rough, pressures=value, material="pmma"),
        "estimate": lambda: SURFACE.estimate(value),
        "interface": lambda: SURFACE.interface(found, length=value),
        "rig": lambda: SURFACE.rig(value),
        "machine": lambda: SURFACE.rig(told, value),
        "low_pass": lambda: SURFACE.low_pass(rough, value),
        "read": lambda: SURFACE.read(value),
        "press": lambda: press(value, 1.0, 1.0, 1.0),
        "tangential_stiffness": lambda: tangential_stiffness(value, 1.0, 1.0, 0.3),
    }
    for name, call in calls.items():
        with pytest.raises(ss.InputError) as error:
            call()
        assert "\n" not in str(error.value), name


# ------------------------------------------------------------------ the rig


def test_a_rig_has_the_ranges_that_a_map_leaves(found):
    told = SURFACE.estimate(found)
    both = SURFACE.rig(told, "pmma_slider", name="lapped")
    one = SURFACE.rig(told, ss.example("pmma_slider"), length="elastic")
    assert both.name == "lapped, PMMA slider"
    assert both.value("stiffness") == one.value("stiffness") == pytest.approx(4e6)
    key = "interface.breaking_displacement"
    ratio = [made.assumed[key].factors for made in (both, one)]
    assert ratio[0][1] > 20.0 * ratio[0][0]
    assert ratio[1][1] < 3.0 * ratio[1][0]
    assert both.interface.thresholds.std == pytest.approx(told.std["renewal"], rel=0.01)
    low, high = told.std_between
    assert 0.2 < low <= told.std["renewal"] <= high < 1.0
    assert "velocity step" in both.source


def test_a_rig_given_by_friction_keeps_its_strength(found):
    told = SURFACE.estimate(found)
    before = ss.example("brake_pad")
    made = SURFACE.rig(told, "brake_pad")
    assert made.scales.force == pytest.approx(before.scales.force, rel=1e-4)
    assert ss.read_rig(to_document(made)) == made


def test_what_is_no_length_or_no_si_rig_is_refused(found):
    told = SURFACE.estimate(found)
    with pytest.raises(ss.InputError, match="must be 'renewal' or 'elastic'"):
        SURFACE.rig(told, length="plastic")
    slider = ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4)
    thresholds = ss.Gaussian(mean=1.0, std=0.1)
    natural = ss.Rig(ss.Interface(thresholds=thresholds), slider, ss.constant(1.0))
    with pytest.raises(ss.InputError, match="natural units"):
        SURFACE.rig(told, natural)


# ------------------------------------------------------------------ command, pictures


@pytest.fixture
def heights(rough, tmp_path):
    file = tmp_path / "lapped.npz"
    step = float(rough["x"][1])
    np.savez(file, height=1e6 * rough.to_numpy(), spacing=step, unit="um")
    return file


@pytest.mark.takes(8)  # a page of pictures
def test_a_command_writes_a_rig_and_says_what_to_measure(heights, capsys):
    rig, picture = (heights.with_name(name) for name in ("rig.toml", "seen.png"))
    given = ["--pressure", "2 MPa", "--material", "pmma", "-o", str(rig)]
    assert main(["surface", str(heights), *given, "--plot", str(picture)]) == 0
    said = capsys.readouterr().out
    assert "Measure next: one slow pull with a velocity step" in said
    assert "give yours by --rig" in said
    assert picture.stat().st_size > 10_000
    assert ss.read_rig(rig).assumed["interface.breaking_displacement"].factors[0] < 0.2


def test_a_command_takes_numbers_of_a_material_and_prints_json(heights, capsys):
    steel = ["--young", "200 GPa", "--poisson", "0.3", "--hardness", "6 GPa"]
    given = ["--pressure", "130 MPa", *steel, "--length", "elastic", "--json"]
    assert main(["surface", str(heights), *given]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["elastic"] < told["renewal"]


def test_the_picture_shows_the_contacts_and_the_doubt(found):
    told = SURFACE.estimate(found)
    doubt = SimpleNamespace(oscillates=0.25, undecided=0.5, draws=64)
    figure = ss.plot.surface(found, told, SimpleNamespace(doubt=doubt))
    axes = {ax.get_title(loc="left"): ax for ax in figure.axes}
    assert f"{int(found['number'][0])} contacts on" in next(iter(axes))
    assert len(axes["sizes at three resolutions"].lines) == 3
    widths = [bar.get_width() for bar in axes["and so the verdict"].patches]
    assert widths == pytest.approx([0.125, 0.375, 0.5])

"""Pictures: labels with units, marks of slips, thinning, complete files or none."""

import tomllib

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from drawn import assert_drawn
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from PIL import Image, ImageSequence
from scipy.io import wavfile

from stickslip import cli, example, plot, predict, read_rig, regime
from stickslip.advise import chart
from stickslip.errors import InputError
from stickslip.io import datasets as store
from stickslip.io.rig_files import example_file
from stickslip.model import Contacts, Output, Rig
from stickslip.model.drive import constant
from stickslip.model.units import Scales, in_si
from stickslip.paper.cases import FIG4
from stickslip.plot import film, maps
from stickslip.simulation import simulate


@pytest.fixture(scope="module")
def run():
    rig = Rig(FIG4.interface, FIG4.slider, constant(1.0, 12.0))
    return simulate(rig, method=Contacts(1000, seed=1), output=Output(interval=0.002))


@pytest.fixture(scope="module")
def run_si(run):
    return in_si(run, Scales(force=768.0, stretching=2e-6, time=5e-3))


@pytest.fixture
def trace():
    """A sawtooth as a bench records it: a force and nothing else."""
    t = 0.25 * np.arange(800)
    force = 8.0 + 4.0 * (t / 7.0 % 1.0) + 0.02 * np.sin(37.0 * t)
    units = {"units": "N", "long_name": "spring force"}
    variables = {"spring_force": ("time", force, units)}
    variables["filled"] = ("time", t == 50.0)
    time = ("time", t, {"units": "s", "long_name": "time"})
    return xr.Dataset(variables, {"time": time})


# ---------------------------------------------------------------- what is drawn


def test_the_module_draws_what_it_is_called_with(run):
    both = plot(run), plot.overview(run)
    titles = [[ax.get_title() for ax in figure.axes] for figure in both]
    assert titles[0] == titles[1]
    rig = example("precision_stage")
    for no_picture in (3, run["spring_force"], rig):
        with pytest.raises(InputError, match="there is no picture"):
            plot(no_picture)


def test_a_run_is_seen_and_heard_at_its_own_pitch(run, trace, tmp_path, monkeypatch):
    monkeypatch.setattr(film, "_FRAMES", 5)
    made = simulate(example("brake_pad"))
    for name in ("film.gif", "brake.wav"):
        store.save(made, tmp_path / "run.nc")
        assert cli.main(["plot", str(tmp_path / "run.nc"), str(tmp_path / name)]) == 0
    done: list[float] = []
    moving = plot.contacts(made, progress=done.append)
    plot.save(moving, tmp_path / "film.gif", progress=done.append)
    assert done[-6:] == [1.0, 0.2, 0.4, 0.6, 0.8, 1.0]
    with Image.open(tmp_path / "film.gif") as pictures:
        frames = ImageSequence.Iterator(pictures)
        seen = [pictures.convert("L").tobytes() for _ in frames]
    assert len(set(seen)) == 5
    rate, samples = wavfile.read(tmp_path / "brake.wav")
    assert samples.size / rate == pytest.approx(float(made["time"][-1]), abs=2 / rate)
    loudest = np.abs(np.fft.rfft(samples * np.hanning(samples.size)))[3:].argmax() + 3
    heard = regime(made)
    step = rate / samples.size
    assert loudest * step == pytest.approx(1.0 / heard.period, abs=step)
    with pytest.raises(InputError, match=r"0.143 Hz is inaudible.*--kind contacts"):
        plot.sound(trace)
    with pytest.raises(InputError, match="give the rig in SI units"):
        plot.sound(run)
    with pytest.raises(InputError, match="no provenance"):
        plot.contacts(trace)
    with pytest.raises(InputError, match=r"a sound is written as \.wav"):
        plot.save(plot.sound(made), tmp_path / "brake.png")


def test_only_what_is_printed_has_a_prefix(run_si):
    _, speed, _ = plot.overview(run_si).axes
    fastest = float(run_si["velocity"].max())
    assert speed.lines[0].get_ydata().max() == pytest.approx(fastest)
    speeds = "speed", [0.01, 0.03, 0.1], {"units": "m/s"}
    table = dict.fromkeys(("friction", "error", "velocity"), speeds)
    short = plot.friction_at_speeds(xr.Dataset(table)).axes[0].xaxis  # logarithmic
    assert short.get_label_text() == "velocity (mm/s)"
    values = (speed.yaxis, 0.002), (short, 0.02)
    assert [axis.get_major_formatter()(at) for axis, at in values] == ["2", "20"]


def test_labels_of_panels_do_not_overlap(run):
    figure = plot.overview(run)
    figure.canvas.draw()
    boxes = [ax.yaxis.label.get_window_extent() for ax in figure.axes]
    assert not any(a.overlaps(b) for a in boxes for b in boxes if a is not b)
    assert all(figure.bbox.y0 <= box.y0 and box.y1 <= figure.bbox.y1 for box in boxes)


@pytest.mark.parametrize("width", [plot.COLUMN, 1.2 * plot.COLUMN, plot.PAGE])
def test_a_legend_below_stays_within_its_picture(width):
    figure = plot.new_figure(width, 3.0)
    maps.legend_below(figure, [Patch(label=kind) for kind in maps.REGIMES])
    figure.canvas.draw()
    box = figure.legends[0].get_window_extent()
    assert figure.bbox.x0 <= box.x0 <= box.x1 <= figure.bbox.x1


NAMES = "overview", "force_trace", "velocity", "attached", "phase_portrait", "energy"


@pytest.mark.parametrize("name", NAMES)
def test_pictures_of_a_run_are_what_they_were(run_si, name):
    shown = getattr(plot, name)(run_si)
    assert_drawn(shown if isinstance(shown, Figure) else shown.figure, f"run_{name}")


def test_other_pictures_are_what_they_were(run, trace):
    assert_drawn(plot.overview(trace), "trace_overview")  # the force alone
    late = run.isel(time=slice(1000, None))
    assert_drawn(plot.side_by_side(run, late), "side_by_side")


def test_energies_stack_up_to_the_work(run):
    ax = plot.energy(run)
    top = ax.collections[-1].get_paths()[0].vertices[:, 1].max()
    # The contacts start with a little energy of their own.
    energy = float(run["work"].max() + run["contact_energy"][0])
    assert top == pytest.approx(energy, rel=1e-9)


def test_speeds_at_which_a_rig_works_are_drawn():
    document = tomllib.loads(example_file("brake_pad").read_text(encoding="utf-8"))
    document["drive"] = {"velocity": ["20 mm/s", "1 m/s"]}
    answer = predict(read_rig(document), fast=True)
    lines = (line for ax in answer.plot().axes for line in ax.lines)
    dashed = [line for line in lines if line.get_linewidth() == 0.9]
    assert [line.get_xdata()[0] for line in dashed][:2] == pytest.approx([0.02, 1.0])


def test_velocity_goes_logarithmic_for_violent_slips(run):
    violent = run.assign(velocity=100.0 * run["velocity"])
    axes = plot.velocity(violent)
    unknown = plot.velocity(violent.drop_vars("drive_velocity"))
    shown = plot.velocity(run), unknown, axes
    assert [ax.get_yscale() for ax in shown] == ["linear", "linear", "symlog"]
    drive = float(run["drive_velocity"].max())
    label = axes.yaxis.get_major_formatter()
    assert label(0.5 * drive) == label(-0.5 * drive) == ""  # they would crowd around 0
    assert (label(0.0), label(10.0 * drive)) == ("0", f"{10 * drive:g}")


def test_a_long_line_is_drawn_by_its_envelope(trace):
    t = np.arange(1_000_000)
    force = np.sin(t / 5e4)
    force[123_457] = 7.0
    long = xr.Dataset({"spring_force": ("time", force)}, coords={"time": t})
    x, y = plot.force_trace(long).lines[0].get_data()
    assert y.size < 10_000
    assert (x[y.argmax()], y.max()) == (123_457, 7.0)
    assert (x[0], x[-1], np.diff(x).min() > 0) == (0, 999_999, True)
    assert plot.force_trace(trace).lines[0].get_ydata().size == 800


WITHOUT = "no variable velocity; it has: spring_force"


@pytest.mark.parametrize(
    ("picture", "of", "message"),
    [
        ("velocity", lambda _, trace: trace, WITHOUT),
        ("energy", lambda _, trace: trace, "no variable broken_energy"),
        ("overview", lambda *_: xr.Dataset(), "no variable spring_force"),
        ("force_trace", lambda run, _: xr.concat([run, run], "n"), "along time alone"),
    ],
)
def test_what_is_not_there_is_named(run, trace, picture, of, message):
    with pytest.raises(InputError, match=message):
        getattr(plot, picture)(of(run, trace))


def test_style_does_not_leak(run):
    before = dict(mpl.rcParams)
    plot.overview(run)
    assert dict(mpl.rcParams) == before


# ---------------------------------------------------------------- files


HEADS = ("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF"), ("PNG", b"\x89PNG")


@pytest.mark.parametrize(("suffix", "head"), HEADS)
def test_save_by_suffix(run, tmp_path, suffix, head):
    path = plot.save(plot.overview(run), tmp_path / f"run.{suffix}")
    assert path.read_bytes().startswith(head)
    assert [p.name for p in tmp_path.iterdir()] == [f"run.{suffix}"]


def test_the_same_figure_gives_the_same_bytes(run, tmp_path):
    for suffix in ("svg", "pdf"):
        files = (tmp_path / f"{i}.{suffix}" for i in "ab")
        one, two = (plot.save(plot.force_trace(run).figure, file) for file in files)
        assert one.read_bytes() == two.read_bytes()


def test_a_prediction_shows_the_speeds_searched_and_a_dozen_cycles():
    answer = predict(example("precision_stage"), fast=True)
    figure = plot.prediction(answer)
    assert_drawn(figure, "prediction")
    strip, force = figure.axes
    assert strip.get_xlim() == pytest.approx(answer.speeds_searched)
    shown = force.lines[0].get_xdata()
    assert 10 < (shown[-1] - shown[0]) * answer.frequency < 13  # not a black band


@pytest.mark.slow
def test_frequencies_on_a_map_are_in_hertz():
    found = chart(example("brake_pad"), ("velocity", "stiffness"), 10.0, 24)
    figure = plot.chart(found)
    assert_drawn(figure, "chart")
    hertz = found["edge_frequency"].to_numpy() / (2 * np.pi)
    written = [float(text.get_text()) for text in figure.axes[0].texts]
    assert written
    assert all(np.min(np.abs(hertz / value - 1)) < 0.01 for value in written)

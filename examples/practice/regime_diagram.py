"""
A measured regime diagram
=========================

Paper slides on paper, pulled by springs of three stiffnesses at three velocities (Colas
et al., *Phys. Rev. E*, 2019). From the stiffness of the spring, the velocity of the
drive and the force, the motion of the slider follows:
``stickslip measure --stiffness --velocity``. What do five of these traces reveal about
the interface?

Beside each stands a model of 280 contacts **without any weakening**: no delay, no
ageing, no temperature. Its smooth sliding is stable everywhere, and only the noise of
few contacts disturbs it. Recorded like the measurement, with the same sampling and
noise, it has the same motion as the paper in all five cases, and so does a model with a
delay of 50 µs. Such traces show how many contacts there are and how strong they are;
they do not reveal a mechanism.

Where both models fail is more instructive. At 42 µm/s the force drops by 11, 24 and 8
mN on springs of 168, 1002 and 2254 N/m; without weakening by 16, 15 and 14 mN, with the
delay by 21, 16 and 14 mN.

The motions, drops and periods of five traces are compared here. Five parameters were
fitted to these traces and to four others: number of contacts, standard deviation of the
thresholds, breaking displacement, strength and damping; the delay is a sixth.

Run it with ``python examples/practice/regime_diagram.py diagram.png beside.png``.
"""

import sys
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

import stickslip as ss
from stickslip import measure, plot

DATA = Path(ss.__file__).parents[2] / "tests" / "data" / "paper_on_paper"
BENCHES = [(168, 42), (168, 1100), (1002, 42), (1002, 4300), (2254, 42)]  # N/m, um/s
MODELS = {"no weakening": {}, "a delay of 50 µs": {"delay": "50 us"}}
DISTANCE = 4000  # um, distance of the drive in the model
SHOWN = 0.7e-3  # m, distance shown of a trace
COLOURS = {
    "sticks and slips": plot.VERMILLION,
    "stops and goes": plot.PALETTE[3],
    "oscillates": plot.ORANGE,
    "moves unevenly": plot.BLUE,
    "moves evenly": plot.GREEN,
}
Row = tuple[tuple[int, int], dict[str, tuple[xr.Dataset, measure.Kinematics]]]
"""Stiffness and velocity of a bench; the measured trace and those of the models, and
their motion, by name.
"""


def rig(stiffness: float, velocity: float, **mechanisms: str) -> ss.Rig:
    """Return the model: 280 contacts with broad thresholds, with a total strength of
    half the slider's weight.
    """
    return ss.read_rig(
        {
            "slider": {
                "mass": "30.7 g",
                "stiffness": f"{stiffness} N/m",
                "damping": "1 1/s",
            },
            "interface": {
                "contact_strength": "0.15 N",
                "breaking_displacement": "8.3 um",
                "thresholds": {"distribution": "gamma", "std": 0.64},
                **mechanisms,
            },
            "drive": {"velocity": f"{velocity} um/s", "distance": f"{DISTANCE} um"},
            "simulation": {"contacts": 280, "seed": 1},
        }
    )


def measured(stiffness: float, velocity: float) -> xr.Dataset:
    """Return a measured trace."""
    return ss.read_trace(DATA / f"k{stiffness}_v{velocity}.csv.gz")


def simulated(
    stiffness: float, velocity: float, step: float, noise: float, **mechanisms: str
) -> xr.Dataset:
    """Return the model as the bench would have recorded it: the force alone, with the
    same sampling and noise.
    """
    run = ss.simulate(rig(stiffness, velocity, **mechanisms))
    # without the first loading
    force = run["spring_force"].sel(time=slice(0.1 * float(run["time"][-1]), None))
    times = np.arange(float(force["time"][0]), float(force["time"][-1]), step)
    values = np.interp(times, force["time"], force) + np.random.default_rng(1).normal(
        0.0, noise, times.size
    )
    return xr.Dataset(
        {"spring_force": ("time", values, {"units": "N"})},
        {"time": ("time", times, {"units": "s"})},
    )


def seen(trace: xr.Dataset, stiffness: float, velocity: float) -> measure.Kinematics:
    """Return the motion of the slider, read from its force in the same way for all."""
    known = measure.motion(
        trace, stiffness=f"{stiffness} N/m", velocity=f"{velocity} um/s"
    )
    return measure.kinematics(known, mass="30.7 g")


def word(motion: measure.Kinematics) -> str:
    """Return the motion in a word or two."""
    return motion.motion.partition(":")[0].partition(",")[0]


def diagram(points: int = 11) -> xr.DataArray:
    """Return the motion of the model without weakening, over stiffness and velocity, as
    indices into `COLOURS`.
    """
    stiffness = np.geomspace(60, 6000, points)
    velocity = np.geomspace(15, 15_000, points)
    places = [*COLOURS]

    def place(K: float, V: float) -> int:
        # 2 kHz, and 200 Hz where it is slow
        trace = simulated(K, V, min(max(2.0 / V, 5e-4), 5e-3), 1e-4)
        return places.index(word(seen(trace, K, V)))

    table = [[place(K, V) for V in velocity] for K in stiffness]
    return xr.DataArray(
        table, {"stiffness": stiffness, "velocity": velocity}, ("stiffness", "velocity")
    )


def compared() -> list[Row]:
    """Return each measured trace with those of the models, and the motion of the slider
    in them.
    """
    rows = []
    for bench in BENCHES:
        trace = measured(*bench)
        row = {"measured": (trace, seen(trace, *bench))}
        step = float(np.median(np.diff(trace["time"])))
        for name, mechanisms in MODELS.items():
            made = simulated(
                *bench, step, row["measured"][1].noise * bench[0], **mechanisms
            )
            row[name] = made, seen(made, *bench)
        rows.append((bench, row))
    return rows


def draw_diagram(ax: Axes, cells: xr.DataArray, rows: list[Row]) -> None:
    """Draw the motion of the model as coloured cells, and the measured traces as points
    on them.
    """
    colours = ListedColormap(list(COLOURS.values()))
    mesh = {
        "cmap": colours,
        "vmin": -0.5,
        "vmax": len(COLOURS) - 0.5,
        "alpha": 0.5,
        "linewidth": 0,
    }
    ax.pcolormesh(
        cells["velocity"], cells["stiffness"], cells, shading="nearest", **mesh
    )
    for (stiffness, velocity), row in rows:
        colour = COLOURS[word(row["measured"][1])]
        ax.plot(
            velocity,
            stiffness,
            "o",
            color=colour,
            markeredgecolor="black",
            markersize=8,
        )
    for name, colour in COLOURS.items():
        ax.plot([], [], "s", color=colour, alpha=0.5, markersize=9, label=name)
    ax.plot(
        [],
        [],
        "o",
        color="white",
        markeredgecolor="black",
        markersize=8,
        label="measured",
    )
    ax.set(
        xscale="log",
        yscale="log",
        xlabel="velocity of the drive [µm/s]",
        ylabel="stiffness [N/m]",
    )
    ax.set_title("280 contacts without weakening, and five measured traces", fontsize=9)
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)


def draw_trace(
    ax: Axes, trace: xr.Dataset, motion: measure.Kinematics, velocity: float
) -> None:
    """Draw a part of a trace in the colour of its motion, with the drop of its slips
    and the time between them.
    """
    begin = 0.5 * float(trace["time"][0] + trace["time"][-1])
    part = trace["spring_force"].sel(
        time=slice(begin, begin + SHOWN / (1e-6 * velocity))
    )
    ax.plot(
        1e-3 * velocity * (part["time"] - begin),
        1e3 * part,
        color=COLOURS[word(motion)],
        linewidth=0.7,
    )
    ax.set(xlim=(0, 1e3 * SHOWN), ylim=(40, 155), yticks=(50, 100, 150))
    text = f"{1e6 * motion.drop:.3g} µm every {motion.recurrence:.2g} s"
    ax.text(0.03, 0.05, text, transform=ax.transAxes, fontsize=7)
    ax.tick_params(labelsize=7, labelbottom=False)


def draw_beside(rows: list[Row]) -> Figure:
    """Draw the measured traces above those of the model without weakening."""
    names = ["measured", "no weakening"]
    figure = plot.new_figure(9.0, 3.0)
    axes = figure.subplots(len(names), len(rows), sharex=True, sharey=True)
    for column, (bench, row) in zip(axes.T, rows, strict=True):
        for ax, name in zip(column, names, strict=True):
            trace, motion = row[name]
            draw_trace(ax, trace, motion, bench[1])
        column[0].set_title(
            f"{bench[0]} N/m, {bench[1]} µm/s\n{word(row['measured'][1])}", fontsize=8
        )
        column[-1].tick_params(labelbottom=True)
    for ax, label in zip(
        axes[:, 0],
        ("measured:\npaper on paper", "280 contacts\nwithout weakening"),
        strict=True,
    ):
        ax.set_ylabel(label, fontsize=8)
    figure.supylabel("spring force [mN]", fontsize=8)
    figure.supxlabel("travel of the drive [mm]", fontsize=8)
    return figure


def draw(rows: list[Row]) -> Figure:
    """Print the motions, and draw the diagram of the model above the traces."""
    figure = plot.new_figure(plot.PAGE, 7.6)
    grid = figure.add_gridspec(
        1 + len(rows), 1 + len(MODELS), height_ratios=(2.6, *[1] * len(rows))
    )
    draw_diagram(figure.add_subplot(grid[0, :]), diagram(), rows)
    for k, (bench, row) in enumerate(rows, start=1):
        for column, (name, (trace, motion)) in enumerate(row.items()):
            print(f"K = {bench[0]} N/m, V = {bench[1]} um/s, {name}:\n{motion}\n")
            ax = figure.add_subplot(grid[k, column])
            draw_trace(ax, trace, motion, bench[1])
            if k == 1:
                ax.set_title(name, fontsize=9)
            if column == 0:
                ax.set_ylabel(f"{bench[0]} N/m\n{bench[1]} µm/s", fontsize=8)
            if k == len(rows):
                ax.tick_params(labelbottom=True)
                ax.set_xlabel("travel of the drive [mm]", fontsize=8)
    figure.supylabel("spring force [mN]", fontsize=8)
    return figure


if __name__ == "__main__":
    rows = compared()
    figure = draw(rows)
    for each, file in zip((figure, draw_beside(rows)), sys.argv[1:], strict=False):
        plot.save(each, file)

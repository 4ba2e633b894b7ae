"""The figures of the paper: claims come out as settled, pictures have ink and labels, data make their way to a file.

The quick versions here; `python -m verification` makes the full ones.
"""

import json
import math

import numpy as np
import pytest
import reference
import xarray as xr
from drawn import assert_drawn, assert_kept
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from stickslip.errors import InputError, UndecidedError
from stickslip.io import datasets as store
from stickslip.model import Slider
from stickslip.paper import FIGURES, Claim, Figure, fig10
from stickslip.paper.cases import FIG2, FIG5
from stickslip.paper.fig1 import _parabola
from stickslip.paper.fig2 import first_instability
from stickslip.paper.figure import at_least, at_most, between, near, portions, variable, verdict
from stickslip.rigid import effective_stiffness
from stickslip.simulation import LABELS
from stickslip.stability import Crossing
from stickslip.theory import critical_stiffness_estimate, effective_potential, slip_displacement

READ, PRINTED, NOT = "reproduced under the stated reading", "reproduced", "not reproduced"

# The verdicts as settled, by number of the claim in the project's list; None: a statement outside it.
SETTLED = {
    "fig1": {1: PRINTED, 2: PRINTED, 3: PRINTED, 4: PRINTED},
    "fig2": {None: PRINTED},
    "fig3": {5: READ, 6: NOT, 18: READ},
    "fig4": {7: READ, 11: READ},
    "fig5": {8: READ},
    "fig6": {9: READ},
    "fig7": {10: PRINTED, 12: READ},
    "fig8": {13: PRINTED, 14: READ},
    "fig9": {15: PRINTED},
    "fig10": {16: PRINTED},
    "fig11": {17: NOT},
}
# Figures whose quick versions take more than a few seconds, too: runs of some thousand time units.
QUICKLY = [
    pytest.param(name, marks=pytest.mark.slow) if name in ("fig9", "fig10", "fig11") else name for name in SETTLED
]

# Claims about oscillations of which rounding tells all but the first digits, and how far that goes.
ROUNDED = {"fig4": {"atol": 1e-4}, "fig5": {"rtol": 0.03}}


@pytest.fixture(scope="session")
def quick():
    """Data of a figure, computed once; how far it had come stands in `progress`."""
    made, progress = {}, {}

    def data(name):
        if name not in made:
            progress[name] = []
            made[name] = FIGURES[name].compute(progress=progress[name].append, quick=True)
        return made[name]

    data.progress = progress
    return data


# ---------------------------------------------------------------- each figure


@pytest.mark.parametrize("name", QUICKLY)
def test_claims_come_out_as_settled(quick, name):
    claims = FIGURES[name].check(quick(name))
    assert {claim.number: claim.verdict for claim in claims} == SETTLED[name]
    failed = [str(claim) for claim in claims if not claim.ok]
    assert not failed, "\n".join(failed)


@pytest.mark.parametrize("name", QUICKLY)
def test_picture_has_ink_and_every_panel_names_its_quantities(quick, name):
    picture = FIGURES[name].draw(quick(name))
    canvas = FigureCanvasAgg(picture)
    canvas.draw()
    image = np.asarray(canvas.buffer_rgba())[..., :3]
    inked = np.mean(np.any(image < 250, axis=-1))
    assert 0.01 < inked < 0.5
    for panel in picture.axes:
        assert panel.has_data() or not panel.axison
    words = [text for ax in picture.axes for text in (ax.get_xlabel(), ax.get_ylabel())]
    words += [sub.get_supylabel() for sub in picture.subfigs]
    assert sum("(" in text for text in words if text) >= 2


@pytest.mark.parametrize("name", QUICKLY)
def test_picture_and_claims_are_what_they_were(quick, name):
    assert_drawn(FIGURES[name].draw(quick(name)), name)
    claims = "\n".join(str(claim) for claim in FIGURES[name].check(quick(name)))
    assert_kept(claims, f"{name}_claims", **ROUNDED.get(name, {}))


@pytest.mark.parametrize("name", QUICKLY)
def test_claims_on_other_numbers_are_what_they_were(quick, name):
    """Each number of a figure in turn, made a third and three times as large: which claims notice, and how."""

    def told(data):
        try:
            claims = FIGURES[name].check(data)
        except (ValueError, RuntimeWarning):
            return "nothing can be said"
        return "; ".join(f"{claim.number} {claim.verdict} {[m.ok for m in claim.measured]}" for claim in claims)

    as_it_is = told(quick(name))
    lines = []
    for key, values in quick(name).data_vars.items():
        for factor in (1 / 3, 3.0) if values.dtype.kind == "f" else ():
            changed = told(quick(name).assign({key: values.copy(data=factor * values)}))
            if changed != as_it_is:
                lines.append(f"{key} times {factor:.2f}: {changed}")
    assert_kept("\n".join(lines), f"{name}_claims_on_other_numbers")


@pytest.mark.parametrize("name", QUICKLY)
def test_words_stay_within_the_picture(quick, name):
    assert_within(FIGURES[name].draw(quick(name)))


def assert_within(picture):
    """Titles, labels and words; not those of axes that are not shown."""
    FigureCanvasAgg(picture).draw()
    for ax in picture.axes:
        labels = [axis.label for axis in (ax.xaxis, ax.yaxis) if axis.get_visible() and ax.axison]
        for words in [*labels, *(each for each in ax.get_children() if isinstance(each, Text))]:
            box = words.get_window_extent()
            if words.get_text():
                assert picture.bbox.x0 <= box.x0, words
                assert box.x1 <= picture.bbox.x1, words
                assert picture.bbox.y0 - 1 <= box.y0, words
                assert box.y1 <= picture.bbox.y1 + 1, words


@pytest.mark.parametrize("name", QUICKLY)
def test_data_are_labelled_and_go_through_a_file(quick, name, tmp_path):
    data = quick(name)
    for array in (*data.data_vars.values(), *data.coords.values()):
        if array.dtype.kind == "f":
            assert "units" in array.attrs, array.name
            assert "long_name" in array.attrs, array.name
    loaded = store.load(store.save(data, tmp_path / "data.nc"))
    xr.testing.assert_identical(loaded, data)
    made_by = store.read_provenance(loaded)
    assert made_by["call"] == "paper"
    assert made_by["arguments"] == {"figure": name, "quick": True}
    assert [c.plain() for c in FIGURES[name].check(loaded)] == [c.plain() for c in FIGURES[name].check(data)]


def _made_up(name):
    """Data as those of the figures whose quick versions take long, from lines and waves."""
    t, rates = np.arange(0.0, 2350.0, 0.5), np.array([0.8, 1.2, 2.0])
    waves = 0.3 + 0.2 * np.sin(t / 3.0)
    along = {"time": ("time", t, LABELS["time"])}
    if name == "fig9":
        loop = np.interp(t, [0.0, 400.0, 550.0, 750.0, 850.0, 2350.0], [0.3, 1.3, 4.0, 0.3, 0.1, 0.012])
        v, ends = np.linspace(0.0, 4.0, 9), {"v1": 0.9, "v2": 3.0, "v2_down": 2.8, "v1_down": 0.05}
        return xr.Dataset(
            {
                "spring_force": ("time", waves, LABELS["spring_force"]),
                "drive_velocity": ("time", loop, LABELS["drive_velocity"]),
                **{end: variable("seed", [value, 1.02 * value], end, "x_s/time") for end, value in ends.items()},
                "v1_linear": variable((), 0.91, "v1", "x_s/time"),
                "up": variable("v", 0.2 * v, "peak to peak", "f_s"),
                "down": variable("v", 0.3 * v, "peak to peak", "f_s"),
            },
            along | {"seed": variable("seed", [1, 2], "seed", "1"), "v": variable("v", v, "velocity", "x_s/time")},
            {"count": 1000},
        )
    if name == "fig10":
        ends = {"v1": np.outer(rates**2.01, [0.4, 0.42]), "v2": np.outer(rates**2.05, [1.1, 1.12])}
        return xr.Dataset(
            {
                **{end: variable(("rate", "seed"), value, end, "x_s/time") for end, value in ends.items()},
                "v1_linear": variable("rate", 0.41 * rates**2, "v1", "x_s/time"),
            },
            {"rate": variable("rate", rates, "rate", "1/sqrt(time)"), "seed": variable("seed", [1, 2], "seed", "1")},
            {},
        )
    velocities, X = np.array([0.1, 0.3, 0.5, 0.8]), np.linspace(0.0, 1.6, 641)
    force = np.sin(2.0 * X) / (1.0 + velocities[:, None])
    return xr.Dataset(
        {
            "spring_force": ("time", waves, LABELS["spring_force"]),
            "drive_velocity": ("time", 0.05 + 1.75 * t / t[-1], LABELS["drive_velocity"]),
            "friction_force": variable(("velocity", "displacement"), force, "force", "f_s"),
            "F_contacts": variable(("checked", "X_checked"), force[:, 19::20] + 0.01, "force", "f_s"),
            "K_eff": variable("velocity", [3.3, 2.25, 0.92, 0.2], "effective stiffness", "k"),
            "K_eff_smoothed": variable("velocity", [3.2, 2.21, 0.9, 0.1], "effective stiffness", "k"),
            "crossing": variable((), 0.485, "crossing", "x_s/time"),
            "v1_ramp": variable((), 0.4, "onset", "x_s/time"),
            "v2_ramp": variable((), 1.1, "end", "x_s/time"),
            "unstable": variable("end", [0.42, 1.5], "unstable", "x_s/time"),
        },
        along
        | {
            "velocity": variable("velocity", velocities, "velocity", "x_s/time"),
            "displacement": variable("displacement", X, "displacement", "x_s"),
            "checked": variable("checked", velocities, "velocity", "x_s/time"),
            "X_checked": variable("X_checked", X[19::20], "displacement", "x_s"),
            "end": variable("end", ["low", "high"], "end of the range"),
        },
        {"count": 4000},
    )


@pytest.mark.parametrize("name", ["fig9", "fig10", "fig11"])
def test_claims_and_pictures_of_data_that_are_made_up(name):
    figure, data = FIGURES[name], _made_up(name)
    assert_kept("\n".join(str(claim) for claim in figure.claims(data)), f"{name}_made_up_claims")
    assert_drawn(figure.drawing(data), f"{name}_made_up")
    assert_within(figure.drawing(data))


@pytest.mark.parametrize("name", QUICKLY)
def test_progress_rises_to_one(quick, name):
    quick(name)
    seen = quick.progress[name]
    assert seen[-1] == 1.0
    assert seen == sorted(seen)
    assert 0.0 <= seen[0] < (0.5 if name != "fig2" else 0.51)  # figure 2 has two parts


@pytest.mark.parametrize("rate", [0.5, 2.0])
def test_the_ramps_of_figure_10_go_with_the_square_of_the_rate(monkeypatch, rate):
    runs = []
    monkeypatch.setattr(fig10, "simulate", lambda rig, **options: runs.append((rig, options)))
    monkeypatch.setattr(fig10, "transitions", lambda *_, **__: {"v1": 0.4 * rate**2, "v2": 1.1 * rate**2})
    assert fig10._ramped(rate, 3, None, quick=False) == pytest.approx((0.4, 1.1))
    ((rig, options),) = runs
    told = [(piece.start, piece.end, piece.duration) for piece in rig.drive.pieces]
    expected = [(0.25, 0.6, 500.0), (0.6, 1.7, 250.0)]
    for one, (start, end, duration) in zip(told, expected, strict=True):
        assert one == pytest.approx((start * rate**2, end * rate**2, duration / rate**2))
    assert options["method"].seed == 3
    assert options["output"].interval == pytest.approx(0.02 / rate**2)


def test_figure_10_runs_two_ramps_at_each_rate(monkeypatch):
    def ramped(rate, seed, progress, *, quick):
        assert not quick
        progress(1.0)
        return 0.4 + 0.01 * seed, 1.1 + 0.01 * rate

    def lost(rig, parameter, *, between):
        rate = rig.interface.ageing.rate
        assert (parameter, between) == ("velocity", pytest.approx((0.25 * rate**2, 0.6 * rate**2)))
        counts = ((0.3, 1, 0), (0.41, 0, 1), (0.5, 0, 1))
        return [
            Crossing(value=value * rate**2, frequency=1.0, unstable_below=below, unstable_above=above)
            for value, below, above in counts
        ]

    monkeypatch.setattr(fig10, "_ramped", ramped)
    monkeypatch.setattr(fig10, "critical", lost)
    seen = []
    data = FIGURES["fig10"].compute(progress=seen.append)
    rate = data["rate"].to_numpy()
    assert seen == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.0])
    np.testing.assert_allclose(data["v1"], np.outer(rate**2, [0.41, 0.42]))
    np.testing.assert_allclose(data["v2"], np.outer(rate**2 * (1.1 + 0.01 * rate), [1.0, 1.0]))
    np.testing.assert_allclose(data["v1_linear"], 0.41 * rate**2)


def test_data_of_another_figure_are_refused(quick):
    for use in (FIGURES["fig1"].check, FIGURES["fig1"].draw):
        with pytest.raises(InputError, match="fig1: these are other data"):
            use(quick("fig2"))


def test_the_full_data_name_the_figure_alone():
    empty = Figure(name="fig0", title="", caption="", data=lambda *_: xr.Dataset(), drawing=None, claims=lambda _: ())
    assert store.read_provenance(empty.compute())["arguments"] == {"figure": "fig0"}


# ---------------------------------------------------------------- a claim that fails shows it


def test_a_wrong_number_fails_its_claim(quick):
    data = quick("fig3").copy(deep=True)
    data["critical_stiffness"][0, 1, 2] = reference.CRITICAL_STIFFNESS_PRINTED
    claims = {claim.number: claim for claim in FIGURES["fig3"].check(data)}
    assert claims[6].verdict == "reproduced"
    assert not claims[6].ok
    assert "expected: not reproduced" in str(claims[6])
    assert "NOT MET" in str(claims[6])
    assert claims[18].ok


def test_a_law_of_whichever_critical_delay_is_reproduced_as_printed(quick):
    data = quick("fig6").copy(deep=True)
    data["linear_by_mass"][:] = data["sustained_by_mass"].to_numpy()
    (claim,) = FIGURES["fig6"].check(data)
    assert claim.verdict == PRINTED
    assert not claim.ok  # it was settled otherwise


def test_stick_slip_that_ends_with_the_delays_of_the_paper_is_reproduced_as_printed(quick):
    data = quick("fig7").copy(deep=True)
    data["sustained"].loc[{"case": "0.12, clip"}] = [0.5, 2.0]
    claims = {claim.number: claim for claim in FIGURES["fig7"].check(data)}
    assert claims[12].verdict == PRINTED
    assert not claims[12].ok


def test_a_transition_that_was_not_seen_fails_its_claim():
    data = _made_up("fig10")
    data["v2"][0] = math.nan
    (claim,) = FIGURES["fig10"].claims(data)
    assert claim.verdict == NOT
    assert not claim.ok


@pytest.mark.parametrize("wrong", ["K* rises", "steeper"])
def test_a_critical_stiffness_that_goes_another_way_fails_its_claim(quick, wrong):
    data = quick("fig3").copy(deep=True)
    at_once = {"reattachment": "at once", "initial_std": 0.0}
    if wrong == "K* rises":
        data["critical_stiffness"].loc[at_once | {"threshold_std": data["threshold_std"][-1]}] = 99.0
    else:
        data["critical_stiffness"].loc[at_once | {"threshold_std": data["threshold_std"][0]}] *= 3.0
    (claim,) = (claim for claim in FIGURES["fig3"].check(data) if claim.number == 5)
    assert claim.verdict != "reproduced under the stated reading"
    assert not claim.ok


@pytest.mark.parametrize(
    ("stiffness", "delay", "kind"),
    [(5.0, 0.1, "stick-slip"), (2.0, 0.085, "stick-slip"), (2.0, 0.1, "smooth sliding"), (2.0, 0.2, "undecided")],
)
def test_a_wrong_regime_fails_its_claim(quick, stiffness, delay, kind):
    data = quick("fig4").copy(deep=True)
    data["kind"].loc[{"solver": "contacts", "stiffness": stiffness, "delay": delay}] = kind
    claims = {claim.number: claim for claim in FIGURES["fig4"].check(data)}
    assert claims[7].verdict == "not reproduced"
    assert not claims[7].ok
    assert claims[11].ok


# ---------------------------------------------------------------- the physics that the figures bring along


@pytest.mark.eq(1, 2, 3, 4)
def test_fig_1_turning_points_and_kinetic_friction(quick):
    data = quick("fig1")
    assert data["F_k"].to_numpy() == pytest.approx(list(reference.KINETIC_FRICTION.values()), abs=1e-5)
    narrow = data["friction_force"].sel(initial_std=0.01, threshold_std=0.1)
    assert float(narrow.max()) == pytest.approx(reference.STATIC_FRICTION, abs=2e-4)
    assert float(narrow["displacement"][narrow.argmax("displacement")]) == pytest.approx(
        reference.STATIC_DISPLACEMENT, abs=0.005
    )


def test_fig_1_wide_start_remembers_being_stretched_backwards(quick):
    # Brute force, 2e6 contacts: .5688 with x_s > |x_0| and .5684 with x_s > x_0; noise 2e-4.
    data = quick("fig1").sel(threshold_std=0.3)
    wide = data.sel(initial_std=0.3)
    assert float(wide["F_c_remembering"].max()) == pytest.approx(0.5688, abs=6e-4)
    assert float(wide["friction_force"].max()) == pytest.approx(0.5679, abs=1e-4)


@pytest.mark.eq(5)
def test_fig_2_slope_of_the_potential_is_the_force(quick):
    data = quick("fig2")
    X, force = data["displacement"].to_numpy(), data["friction_force"].to_numpy()
    for drive, V in zip(data["drive"].to_numpy(), data["V_eff"].to_numpy(), strict=True):
        assert np.gradient(V, X)[1:-1] == pytest.approx((force - 2.0 * (drive - X))[1:-1], abs=1e-4)
    relaxed = effective_potential(Slider(stiffness=2.0, mass=1.0, damping=0.0), X, force, 0.0)
    assert relaxed[0] == 0.0


@pytest.mark.eq(6, 7)
@pytest.mark.parametrize(
    ("interface", "expected"),
    [(FIG5.interface, reference.INSTABILITY_NEVER), (FIG2.interface, reference.INSTABILITY)],
)
def test_instability_is_where_the_stiffness_of_the_interface_reaches_that_of_the_spring(interface, expected):
    found = first_instability(interface, 2.0)
    assert (found.X, found.drive) == pytest.approx(expected, abs=1e-4)
    assert effective_stiffness(interface, [found.X]) == pytest.approx(2.0, abs=1e-6)


def test_a_stiff_spring_has_no_instability():
    with pytest.raises(UndecidedError, match="K_eff stays below K = 5"):
        first_instability(FIG2.interface, 5.0)


@pytest.mark.eq(8, 9)
def test_fig_3_exact_values_beside_the_estimate(quick):
    data = quick("fig3").sel(initial_std=0.01, threshold_std=0.1)
    exact = [reference.CRITICAL_STIFFNESS, reference.CRITICAL_STIFFNESS_NEVER]
    assert data["critical_stiffness"].to_numpy() == pytest.approx(exact, abs=0.003)
    assert float(data["critical_stiffness_estimate"]) == pytest.approx(reference.CRITICAL_STIFFNESS_ESTIMATE)
    assert critical_stiffness_estimate(FIG2.interface) == pytest.approx(reference.CRITICAL_STIFFNESS_ESTIMATE)


@pytest.mark.eq(11)
def test_fig_4_smooth_sliding_carries_the_mean_force_of_the_closed_form(quick):
    data = quick("fig4").sel(solver="master equation")
    smooth = data["kind"] == "smooth sliding"
    off = abs(data["mean_force"] - data["mean_force_smooth"])
    assert float(off.where(smooth & (data["peak_to_peak"] < 0.01)).max()) < 1e-3
    assert int(smooth.sum()) >= 7


@pytest.mark.eq(12)
def test_fig_5_eq_12_needs_the_actual_velocity(quick):
    data = quick("fig5")
    start = float(data["velocity_passed"][0])
    assert start == pytest.approx(2.33, abs=0.05)
    elapsed = data["phase"].to_numpy() / FIG5.slider.frequency
    assert data["slip_actual"][0].to_numpy() == pytest.approx(slip_displacement(FIG5.slider, start, elapsed))
    one = data.sel(phase=1.0, method="nearest").isel(damping=0)
    assert float(one["slip"] / one["slip_actual"]) == pytest.approx(1.0, abs=0.1)
    assert float(one["slip"] / one["slip_printed"]) > 2.0


# ---------------------------------------------------------------- records


def claim(**changes):
    fields = {
        "number": 6,
        "statement": "K* = 3.59",
        "verdict": NOT,
        "settled": NOT,
        "exact": "2.989",
        "measured": (near("K*", 2.9891, 2.989, 0.003, "k"),),
        "evidence": "computed",
    }
    return Claim(**(fields | changes))


def test_not_reproduced_passes_when_the_exact_value_is_met():
    assert claim().ok
    assert not claim(measured=(near("K*", 3.59, 2.989, 0.003, "k"),)).ok
    assert not claim(verdict=PRINTED).ok
    assert not claim(measured=(near("K*", math.nan, 2.989, 0.003),)).ok


def test_a_claim_must_say_what_its_verdict_needs():
    with pytest.raises(InputError, match=r"Claim\.exact is empty"):
        claim(exact="")
    with pytest.raises(InputError, match=r"Claim\.reading is empty"):
        claim(settled=READ)
    with pytest.raises(InputError, match=r"Claim\.verdict = 'fine'"):
        claim(verdict="fine")


def test_a_claim_reads_well():
    assert str(claim()).splitlines() == [
        "ok  claim 6: K* = 3.59",
        "    as expected: not reproduced",
        "    exact: 2.989",
        "    K* = 2.9891 k (2.989 ± 0.003)",
        "    evidence: computed",
    ]
    assert str(at_most("p", 0.1, 0.05)) == "p = 0.1 (at most 0.05: NOT MET)"
    assert str(at_least("p", 0.1, 0.05, "f_s")) == "p = 0.1 f_s (at least 0.05)"
    assert between("p", 1.0, 1.0, 2.0).ok
    assert claim(number=None).title == "K* = 3.59"


def test_a_claim_as_json():
    plain = json.loads(json.dumps(claim(measured=(at_most("p", math.nan, 0.05),)).plain(), allow_nan=False))
    assert plain["number"] == 6
    assert plain["ok"] is False
    assert plain["measured"] == [{"name": "p", "value": None, "low": None, "high": 0.05, "unit": "", "ok": False}]


def test_verdicts():
    assert verdict(printed=True, read=False) == PRINTED
    assert verdict(printed=False, read=True) == READ
    assert verdict(printed=False) == NOT


def test_portions_of_progress():
    seen = []
    for part in portions(seen.append, 2):
        part(0.5)
        part(1.0)
    assert seen == [0.25, 0.5, 0.75, 1.0]


@pytest.mark.parametrize(("height", "place", "bend"), [(2.0, 0.2, 3.0), (-1.0, -0.4, 0.5), (0.3, 0.0, -2.0)])
def test_the_extreme_of_a_parabola_is_between_samples(height, place, bend):
    y = height + bend * (np.array([-1.0, 0.0, 1.0]) - place) ** 2
    assert _parabola(y) == pytest.approx(height, abs=1e-14)

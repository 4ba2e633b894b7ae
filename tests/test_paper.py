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
from stickslip.paper import FIGURES, Claim, Figure
from stickslip.paper.cases import FIG2, FIG5
from stickslip.paper.fig2 import first_instability
from stickslip.paper.figure import at_least, at_most, between, near, verdict
from stickslip.paper.kit import portions
from stickslip.rigid import effective_stiffness
from stickslip.theory import critical_stiffness_estimate, effective_potential, slip_displacement

READ, PRINTED, NOT = "reproduced under the stated reading", "reproduced", "not reproduced"

# Quick versions of figures 9 to 11 take more than a few seconds, too: runs of some thousand time units.
QUICKLY = [
    pytest.param(name, marks=pytest.mark.slow) if name in ("fig9", "fig10", "fig11") else name for name in FIGURES
]

# Claims about oscillations of which rounding tells all but the first digits, and how far that goes.
ROUNDED = {"fig4": {"atol": 1e-4}, "fig5": {"rtol": 0.03}}


@pytest.fixture(scope="session")
def quick():
    """Data of a figure, computed once; its progress rises to one."""
    made = {}

    def data(name):
        if name not in made:
            seen = []
            made[name] = FIGURES[name].compute(progress=seen.append, quick=True)
            assert seen == sorted(seen)
            assert 0.0 <= seen[0] < 1.0 == seen[-1]
        return made[name]

    return data


# ---------------------------------------------------------------- each figure


@pytest.mark.parametrize("name", QUICKLY)
def test_claims_come_out_as_settled_and_are_what_they_were(quick, name):
    claims = FIGURES[name].check(quick(name))
    failed = [str(claim) for claim in claims if not claim.ok]
    assert not failed, "\n".join(failed)
    assert_kept("\n".join(map(str, claims)), f"{name}_claims", **ROUNDED.get(name, {}))


@pytest.mark.parametrize("name", QUICKLY)
def test_picture_is_what_it_was_and_its_words_stay_within(quick, name):
    picture = FIGURES[name].draw(quick(name))
    assert_drawn(picture, name)
    canvas = FigureCanvasAgg(picture)
    canvas.draw()
    assert 0.01 < np.mean(np.any(np.asarray(canvas.buffer_rgba())[..., :3] < 250, axis=-1)) < 0.5
    for ax in picture.axes:
        assert ax.has_data() or not ax.axison
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


def test_data_of_another_figure_are_refused(quick):
    for use in (FIGURES["fig1"].check, FIGURES["fig1"].draw):
        with pytest.raises(InputError, match="fig1: these are other data"):
            use(quick("fig2"))


def test_the_full_data_name_the_figure_alone():
    empty = Figure(name="fig0", title="", caption="", data=lambda *_: xr.Dataset(), drawing=None, claims=())
    assert store.read_provenance(empty.compute())["arguments"] == {"figure": "fig0"}


# ---------------------------------------------------------------- a claim that fails shows it


def test_a_wrong_number_fails_its_claim(quick):
    data = quick("fig3").copy(deep=True)
    data["critical_stiffness"][0, 1, 2] = reference.CRITICAL_STIFFNESS_PRINTED
    claims = {claim.number: claim for claim in FIGURES["fig3"].check(data)}
    assert claims[6].verdict == PRINTED
    assert not claims[6].ok
    assert "expected: not reproduced" in str(claims[6])
    assert "NOT MET" in str(claims[6])
    assert claims[18].ok


@pytest.mark.parametrize(
    ("figure", "number", "name", "where", "value", "verdict"),
    [
        ("fig3", 5, "critical_stiffness", {"reattachment": 0, "initial_std": 0, "threshold_std": -1}, 99.0, NOT),
        ("fig3", 5, "critical_stiffness", {"reattachment": 0, "initial_std": 0, "threshold_std": 0}, 40.0, NOT),
        # Of the linear critical delay, too, as the paper has it.
        ("fig6", 9, "linear_by_mass", {}, "sustained_by_mass", PRINTED),
        ("fig7", 12, "sustained", {"case": 1}, [0.5, 2.0], PRINTED),  # smooth again with the delays of the paper
        pytest.param("fig10", 16, "v2", {"rate": 0}, math.nan, NOT, marks=pytest.mark.slow),
    ],
)
def test_data_that_say_otherwise_fail_their_claim(quick, figure, number, name, where, value, verdict):
    data = quick(figure).copy(deep=True)
    data[name][where] = data[value].to_numpy() if isinstance(value, str) else value
    (claim,) = (claim for claim in FIGURES[figure].check(data) if claim.number == number)
    assert claim.verdict == verdict
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


def test_what_a_claim_says_in_place_of_the_paper_tells_what_is_settled():
    assert claim().settled == NOT
    assert claim(exact="", reading="late").settled == READ
    assert claim(exact="").settled == PRINTED


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
    for part in portions(seen.append, 1.0, 1.0):
        part(0.5)
        part(1.0)
    assert seen == [0.25, 0.5, 0.75, 1.0]

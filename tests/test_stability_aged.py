"""Linear stability of smooth sliding with thresholds that age: response, growing modes, and their boundaries."""

from dataclasses import replace

import numpy as np
import pytest

from stickslip.errors import InputError, UndecidedError
from stickslip.model import Bell, Delay, Langevin, Rig, constant
from stickslip.paper.cases import FIG8
from stickslip.sliding import respond
from stickslip.stability import (
    AGEING,
    boundary,
    count_unstable,
    critical,
    critical_spring,
    dynamic_stiffness,
    growth_rate,
    onset,
    stability_map,
)


def aged(rate):
    return replace(FIG8.interface, ageing=Langevin(rate=rate))


def rig(rate, velocity=1.0, **changes):
    return Rig(aged(rate), replace(FIG8.slider, **changes), constant(velocity))


def lost_balance(rate, velocity, s, **changes):
    """``|Z + kappa|``, computed without the table."""
    slider = replace(FIG8.slider, **changes)
    impedance = slider.mass * s * (s + slider.damping) + slider.stiffness
    return abs(impedance + complex(dynamic_stiffness(aged(rate), velocity, s)))


def test_response_depends_on_reduced_velocity_and_frequency_and_is_stiff_at_high_frequency():
    s = np.array([0.3j, 2.0j, 1.0 + 5.0j])
    np.testing.assert_allclose(
        dynamic_stiffness(aged(1.0), 0.7, s), dynamic_stiffness(aged(1.5), 0.7 * 2.25, 2.25 * s), rtol=1e-6
    )
    # Contacts near their boundary break within any time: the approach to 1 is as slow as s^(-1/2).
    assert abs(complex(dynamic_stiffness(aged(1.0), 0.7, 1e4j)) - 1.0) < 0.1


def test_growth_rate_solves_the_equation_of_modes():
    s = growth_rate(rig(1.5))
    assert s.real > 0
    assert lost_balance(1.5, 1.0, s) < 1e-4
    assert growth_rate(rig(1.7)).real < 0
    with pytest.raises(UndecidedError, match="is stable"):
        growth_rate(rig(2.0, stiffness=5.0))


def test_first_critical_velocity_lies_where_figures_9_and_10_have_it():
    (edge,) = critical(rig(1.5), "velocity", between=(0.5, 1.2))
    assert (edge.unstable_below, edge.unstable_above) == (0, 2)
    assert edge.value == pytest.approx(0.8687, abs=1e-3)
    assert lost_balance(1.5, edge.value, 1j * edge.frequency) < 1e-3


def test_what_is_not_known_is_refused():
    sharp = replace(aged(1.0), thresholds=replace(FIG8.interface.thresholds, std=1e-5))
    with pytest.raises(InputError, match=r"^Interface\.thresholds: their standard deviation is 1e-05 of the mean"):
        growth_rate(Rig(sharp, FIG8.slider, constant(0.01)))
    warm = replace(FIG8.interface, ageing=Langevin(rate=1.0), temperature=Bell(width=0.01, attempts=1e6))
    for ask in (count_unstable, growth_rate):
        with pytest.raises(InputError, match="the linear response of thresholds that age by Langevin"):
            ask(Rig(warm, FIG8.slider, constant(1.0)))


def test_the_table_agrees_with_single_points_and_there_are_two_windows_of_instability():
    # At low rate of ageing smooth sliding is stable between the window of Fig. 9 and one of fast oscillations.
    crossings = critical(rig(1.0), "velocity", between=(0.3, 6.0))
    assert [edge.loses_stability for edge in crossings.edges] == [True, False, True, False]
    assert all(lost_balance(1.0, edge.value, 1j * edge.frequency) < 1e-3 for edge in crossings)
    omega = np.geomspace(0.3, 60.0, 40)
    table = respond(aged(1.0)).stiffness(0.7, 1j * omega)
    assert np.max(np.abs(table - dynamic_stiffness(aged(1.0), 0.7, 1j * omega))) < 5e-3


@pytest.mark.parametrize("speed", [0.7, 1.5, 3.0, 8.0])
def test_the_table_reaches_up_to_where_contacts_are_springs(speed):
    response, omega = respond(aged(1.0)), np.geomspace(30.0, 1000.0, 8)
    table, points = response.stiffness(speed, 1j * omega), dynamic_stiffness(aged(1.0), speed, 1j * omega)
    assert np.max(np.abs(table - points)) < (0.03 if speed < 1 else 0.01)


def test_rates_of_ageing_at_the_edges_of_figure_8():
    found = critical(Rig(FIG8.interface, FIG8.slider, constant(1.0)), AGEING, between=(0.2, 3.0))
    rates = sorted(edge.value**-0.5 for edge in found.edges)
    assert rates == pytest.approx([0.80, 1.63], abs=0.03)
    assert AGEING.get(Rig(FIG8.interface, FIG8.slider, constant(1.0))) == pytest.approx(1 / 2.25)
    with pytest.raises(InputError, match="has no ageing to vary"):
        AGEING.get(Rig(replace(FIG8.interface, ageing=None), FIG8.slider, constant(1.0)))


def test_critical_spring_is_where_the_count_changes():
    spring = critical_spring(rig(1.5, 1.2))
    assert [count_unstable(rig(1.5, 1.2, stiffness=factor * spring)) for factor in (0.97, 1.03)] == [2, 0]


def test_delays_count_where_newborns_have_strength():
    interface = replace(FIG8.interface, ageing=Langevin(rate=1.5, newborn=0.3), delay=Delay(0.01))
    delay = onset(Rig(interface, FIG8.slider, constant(3.5)), "delay", between=(1e-3 / 3.5, 1e2 / 3.5))
    for factor, modes in ((0.9, 0), (1.1, 2)):
        assert count_unstable(Rig(replace(interface, delay=Delay(factor * delay)), FIG8.slider, constant(3.5))) == modes
    with pytest.raises(InputError, match="newborn = 0"):
        onset(rig(1.5), "delay", between=(1e-3, 1e2))


def test_a_map_has_the_signs_of_its_counts():
    grids = np.array([0.5, 1.5]), np.array([0.8, 1.2, 2.5])
    found = stability_map(rig(1.5), values=grids, growth=True)
    assert found["unstable_modes"].to_numpy().tolist() == [[2, 2, 2], [0, 2, 2]]
    np.testing.assert_array_equal(found["growth_rate"] > 0, found["unstable_modes"] > 0)


def test_a_boundary_is_neutral_along_its_points():
    found = boundary(rig(1.5), between=((0.8, 1.6), (0.7, 1.4)))
    assert found.sizes["point"] > 5
    points = np.transpose([found[name].values for name in ("velocity", "frequency", "stiffness")])[::4].tolist()
    assert all(lost_balance(1.5, v, 1j * omega, stiffness=k) < 1e-3 for v, omega, k in points)

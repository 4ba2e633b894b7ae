"""Linear stability of smooth sliding with thresholds that age: response, growing modes, and their boundaries."""

from dataclasses import replace

import numpy as np
import pytest

from stickslip.errors import InputError, UndecidedError
from stickslip.model import FIG8, ExponentialGrowth, Langevin
from stickslip.stability import critical_velocities, dynamic_stiffness, growth_rate, unstable_modes
from stickslip.theory import kinetic_friction


def aged(rate):
    return replace(FIG8.interface, ageing=Langevin(rate=rate))


def test_slow_shaking_feels_the_slope_of_the_friction_law():
    interface, speed, step = aged(1.0), 0.5, 1e-3
    slope = (kinetic_friction(interface, speed + step) - kinetic_friction(interface, speed - step)) / (2 * step)
    kappa = dynamic_stiffness(interface, speed, 1e-3j)
    assert complex(kappa) == pytest.approx(1e-3j * slope, rel=0.02)


def test_response_depends_on_reduced_velocity_and_frequency_and_is_stiff_at_high_frequency():
    s = np.array([0.3j, 2.0j, 1.0 + 5.0j])
    np.testing.assert_allclose(
        dynamic_stiffness(aged(1.0), 0.7, s), dynamic_stiffness(aged(1.5), 0.7 * 2.25, 2.25 * s), rtol=1e-6
    )
    # Contacts near their boundary break within any time: the approach to 1 is as slow as s^(-1/2).
    assert abs(complex(dynamic_stiffness(aged(1.0), 0.7, 1e4j)) - 1.0) < 0.1


# The edges seen in runs from smooth sliding: growth from .80, smooth again from 1.63 +- .05.
@pytest.mark.parametrize(("rate", "modes"), [(0.76, 0), (0.85, 2), (1.5, 2), (1.58, 2), (1.68, 0), (3.0, 0)])
def test_window_of_figure_8_is_where_smooth_sliding_is_unstable(rate, modes):
    assert unstable_modes(aged(rate), FIG8.slider, 1.0) == modes


def test_growth_rate_solves_the_equation_of_modes():
    interface, slider = aged(1.5), FIG8.slider
    s = growth_rate(interface, slider, 1.0)
    assert s.real > 0
    total = slider.mass * s * (s + slider.damping) + slider.stiffness + complex(dynamic_stiffness(interface, 1.0, s))
    assert abs(total) < 1e-4
    with pytest.raises(UndecidedError, match="is stable"):
        growth_rate(aged(0.7), slider, 1.0)


def test_first_critical_velocity_lies_where_figures_9_and_10_have_it():
    crossings = critical_velocities(aged(1.5), FIG8.slider, (0.5, 1.2))
    (edge,) = crossings
    assert (edge.unstable_below, edge.unstable_above) == (0, 2)
    assert 0.75 < edge.value < 1.05
    omega = 1j * edge.frequency
    z = FIG8.slider.stiffness + FIG8.slider.mass * omega * (omega + FIG8.slider.damping)
    assert abs(z + complex(dynamic_stiffness(aged(1.5), edge.value, omega))) < 1e-3


def test_what_is_not_known_is_refused():
    growing = replace(FIG8.interface, ageing=ExponentialGrowth(rate=1.0))
    for ask in (unstable_modes, growth_rate):
        with pytest.raises(InputError, match="ageing = ExponentialGrowth"):
            ask(growing, FIG8.slider, 1.0)

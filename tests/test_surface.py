"""Surfaces: the solver against closed forms and kept numbers, and its contacts."""

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip.surface import press, tangential_stiffness


def waves(n, most, turn=0.0):
    """Waves of all directions down to the length n/most, with phases of a sequence
    that never repeats; rms 1e-3.
    """
    golden = (math.sqrt(5.0) - 1.0) / 2.0
    modes = np.zeros((n, n), dtype=complex)
    pairs = ((i, j) for i in range(most + 1) for j in range(-most, most + 1))
    for m, (i, j) in enumerate((i, j) for i, j in pairs if i or j > 0):
        phase = (golden * (m + 1) ** 2 + turn) % 1.0
        modes[i, j % n] = (i * i + j * j) ** -0.9 * np.exp(2j * np.pi * phase)
    height = np.fft.ifft2(modes).real
    return height * (1e-3 / height.std())


def sphere(n, radius, curvature):
    """A sphere in the middle of a cell, and the pressure under which its contact has a
    radius of so many nodes (Hertz).
    """
    at = np.arange(n) - (n - 1) / 2.0
    height = -(at[:, np.newaxis] ** 2 + at**2) / (2.0 * curvature)
    return height, 4.0 / 3.0 * radius**3 / curvature / n**2


@pytest.mark.parametrize(("n", "error"), [(256, 0.025), (512, 0.01)])
def test_a_sphere_touches_as_hertz_says(n, error):
    radius, curvature = n // 15, 400.0
    height, pressure = sphere(n, radius, curvature)
    p = press(height, 1.0, pressure, 1.0)
    assert np.count_nonzero(p) / (np.pi * radius**2) == pytest.approx(1.0, abs=error)
    highest = 2.0 / np.pi * radius / curvature
    assert p.max() == pytest.approx(highest, rel=1e-3)


@pytest.mark.slow  # 5 s
def test_a_large_sphere_touches_as_hertz_says():
    height, pressure = sphere(1024, 68, 1600.0)
    p = press(height, 1.0, pressure, 1.0)
    assert np.count_nonzero(p) / (np.pi * 68**2) == pytest.approx(1.0, abs=0.005)


@pytest.mark.parametrize("part", [0.1, 0.6])
def test_a_wave_touches_as_westergaard_says(part):
    x = np.arange(256) / 256
    height = 1e-3 * np.cos(2.0 * np.pi * x)[:, np.newaxis] + np.zeros(256)
    full = np.pi * 1e-3  # pressure that flattens it
    p = press(height, 1.0 / 256, part * full, 1.0)
    assert p.max() == pytest.approx(2.0 * math.sqrt(part) * full, rel=1e-3)


TABLE = [
    (256, 16, 2e-4, math.inf, 0.03973, 0.3070),
    (256, 16, 2e-4, 0.01, 0.04004, 0.3058),
    pytest.param(512, 32, 5e-4, math.inf, 0.05975, 0.6848, marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("n", "most", "pressure", "hardness", "area", "length"), TABLE)
def test_rough_surfaces_touch_as_in_the_table(
    n, most, pressure, hardness, area, length
):
    p = press(waves(n, most), 1.0 / n, pressure, 1.0, hardness=hardness)
    stiffness = tangential_stiffness(p, 1.0 / n, 1.0, 0.3)
    assert p.mean() == pytest.approx(pressure, rel=1e-9)
    assert p.max() <= hardness
    assert np.count_nonzero(p) / p.size == pytest.approx(area, abs=5.1e-6)
    assert pressure / stiffness / 1e-3 == pytest.approx(length, abs=5.1e-5)


def test_all_contact_at_the_hardness_bears_on_the_highest_nodes():
    height = waves(64, 8)
    p = press(height, 1.0 / 64, 2e-4, 1.0, hardness=4e-4)
    assert p.mean() == pytest.approx(2e-4)
    borne = p >= 4e-4
    assert np.count_nonzero(borne) == p.size // 2
    assert height[borne].min() >= height[p == 0.0].max()


def test_more_load_than_the_hardness_is_refused():
    with pytest.raises(ss.InputError, match="is not below the hardness"):
        press(waves(64, 4), 1.0 / 64, 2e-3, 1.0, hardness=1e-3)


def test_a_disc_is_a_little_stiffer_in_its_cell_than_alone():
    """Mindlin's stiffness of a disc is that of one without neighbours."""
    at = np.arange(256) - 127.5
    disc = at[:, np.newaxis] ** 2 + at**2 < 12.0**2
    alone = 2.0 * 12.0 * 2.0 * (1.0 - 0.3) / (2.0 - 0.3) / disc.size
    assert 1.08 < tangential_stiffness(disc, 1.0, 1.0, 0.3) / alone < 1.18


def test_progress_runs_to_the_end_of_a_solution():
    done = []
    press(waves(64, 8), 1.0 / 64, 2e-4, 1.0, progress=done.append)
    assert min(done) >= 0.0
    assert 0.8 < max(done) <= 1.0

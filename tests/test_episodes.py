"""Episodes of oscillation in a run whose drive goes through several speeds."""

from itertools import pairwise

import numpy as np
import pytest
import xarray as xr

from stickslip.measure.episodes import episodes


def _run(
    *saws: tuple[float, float, float, float], peak: float = 10.0, speed: float = 2.0
) -> xr.Dataset:
    """A drive that speeds up from 1 to `speed`. Between two times, saw-teeth of a
    period and with a drop of this size are added; in a drop the slider is `peak` times
    as fast as the drive.
    """
    time = np.arange(0.0, 12.0, 1e-3)
    drive = 1.0 + (speed - 1.0) * time / 12.0
    force = np.full(time.size, 5.0)
    velocity = drive.copy()
    for begin, end, period, drop in saws:
        phase = (time - begin) / period % 1.0
        inside = (time >= begin) & (time < end)
        climbing = np.where(phase < 0.9, phase / 0.9, (1.0 - phase) / 0.1)
        force[inside] += drop * climbing[inside]
        velocity[inside & (phase >= 0.9)] *= peak
    seen = {"spring_force": force, "velocity": velocity, "drive_velocity": drive}
    variables = {name: ("time", values) for name, values in seen.items()}
    return xr.Dataset(variables, {"time": time})


def test_episodes_are_those_that_were_put_in():
    first, second = episodes(_run((1.0, 4.0, 0.2, 2.0), (7.0, 11.0, 0.25, 3.0)))
    times = [first.begin, first.end, second.begin]
    assert times == pytest.approx([1.18, 4.0, 7.225], abs=0.01)
    numbers = [first.frequency, first.worst, second.frequency, second.worst]
    assert numbers == pytest.approx([5.0, 1.0, 4.0, 1.5], rel=0.01)
    assert second.worst_velocity == pytest.approx(1 + second.worst_time / 12, rel=1e-3)


@pytest.mark.parametrize(
    ("peak", "kind"), [(3.0, "sustained oscillation"), (4.0, "stick-slip")]
)
def test_stick_slip_is_faster_than_three_and_a_half_times_the_drive(peak, kind):
    (episode,) = episodes(_run((1.0, 11.0, 0.2, 2.0), peak=peak))
    assert episode.kind == kind


def test_small_drops_make_no_episode_and_slow_changes_of_the_period_none_of_their_own():
    run = _run((1.0, 4.0, 0.2, 2.0), (4.0, 8.0, 0.25, 2.0), (8.0, 11.0, 0.3, 2.0))
    (episode,) = episodes(run)
    assert episode.drops == 15 + 16 + 10
    assert episodes(run, minimum_drop=2.5) == []
    # one noise drop in 41: exp(-(drop/std)^2/8) < .05/41
    assert len(episodes(run, noise=2.0 / 7.4)) == 1
    assert episodes(run, noise=2.0 / 7.2) == []


@pytest.mark.parametrize("steps", [(0.2, 0.05), (0.05, 0.2), (0.2, 0.05, 0.2)])
@pytest.mark.parametrize("pause", [0.0, 1.0])
def test_a_pause_is_longer_than_the_waits_on_both_its_sides(steps, pause):
    begins = [1.0 + (2.0 + pause) * n for n in range(len(steps))]
    saws = [(t, t + 2.0, step, 2.0) for t, step in zip(begins, steps, strict=True)]
    # a single drop, which belongs to no episode
    found = episodes(_run((0.2, 0.25, 0.05, 2.0), *saws))
    counts = [round(2.0 / step) for step in steps]
    assert [one.drops for one in found] == (counts if pause else [sum(counts)])
    assert found[0].begin == pytest.approx(1.0 + 0.9 * steps[0], abs=0.01)
    assert found[-1].end == pytest.approx(begins[-1] + 2.0, abs=0.01)


def test_slips_that_come_with_the_way_of_the_drive_are_one_episode():
    ways = np.append([1.0, 10.0, 19.0, 28.0], np.arange(29.5, 120.0, 1.5))
    times = (np.sqrt(1.0 + 4.0 * ways * 19.0 / 24.0) - 1.0) * 12.0 / 19.0
    drops = np.diff(ways)  # rise of the force while the slider sticks
    saws = [
        (a, b, b - a, drop)
        for (a, b), drop in zip(pairwise(times.tolist()), drops, strict=True)
    ]
    (episode,) = episodes(_run(*saws, speed=20.0))
    assert episode.drops == len(saws)


def test_an_oscillation_that_falls_after_a_start_rings_down():
    sizes = [3.2, 1.75, 1.0, 0.55]
    lasts = [*sizes, *(0.5 for _ in range(20))]
    for drops, rings_down in ((sizes, True), (sizes[::-1], False), (lasts, False)):
        starts = [1.0 + 0.2 * n for n in range(len(drops))]
        saws = [(t, t + 0.2, 0.2, d) for t, d in zip(starts, drops, strict=True)]
        assert [one.rings_down for one in episodes(_run(*saws))] == [rings_down]


def test_irregular_slips_have_no_frequency():
    rng = np.random.default_rng(2)
    bounds = np.cumsum(rng.uniform(0.05, 0.6, 30))
    saws = [(float(a), float(b), float(b - a), 2.0) for a, b in pairwise(bounds)]
    assert all(np.isnan(one.frequency) for one in episodes(_run(*saws)))

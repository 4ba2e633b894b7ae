"""A reading does not depend on where the times are counted from."""

import numpy as np
import pytest
import xarray as xr

import stickslip as ss


def _trace(kind: str, t: np.ndarray) -> np.ndarray:
    noise = 0.02 * np.random.default_rng(3).normal(size=t.size)
    force = {
        "sawtooth": 5.0 + 2.0 * (t % 0.5) / 0.5,
        "sine": 5.0 + np.sin(7.0 * t),
        "noise": 5.0 + 0.0 * t,
    }
    return force[kind] + noise


@pytest.mark.parametrize("origin", [1e3, 1e6, 4e8, 1.8e9])
@pytest.mark.parametrize("kind", ["sawtooth", "sine", "noise"])
def test_origin_of_time_changes_no_reading(kind, origin):
    t = np.arange(0.0, 30.0, 1 / 128)
    force = _trace(kind, t)

    def seen(first):
        data = xr.DataArray(force, {"time": first + t}, "time")
        return ss.regime(data)

    assert str(seen(origin)) == str(seen(0.0))

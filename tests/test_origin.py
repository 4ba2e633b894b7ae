"""Results do not depend on the origins of times, forces and positions."""

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


@pytest.mark.parametrize("offset", [1.0, 10.0, 50.0])
@pytest.mark.parametrize("kind", ["sawtooth", "sine", "noise"])
def test_origin_of_force_changes_no_kind_and_no_drop(kind, offset):
    t = np.arange(0.0, 30.0, 1 / 128)
    shifted, plain = (
        xr.DataArray(_trace(kind, t) + more, {"time": t}, "time")
        for more in (offset, 0.0)
    )

    assert ss.regime(shifted).kind == ss.regime(plain).kind
    xr.testing.assert_allclose(
        ss.drops(shifted)["drop"], ss.drops(plain)["drop"], rtol=1e-9
    )


@pytest.mark.parametrize("place", [-3.0, 1e3, 1e6])
def test_origin_of_place_changes_no_reading(place, tmp_path):
    t = np.arange(0.0, 30.0, 1 / 16)
    to_and_fro = np.abs(t % 6.0 - 3.0)
    force = 5.0 * np.sign(t % 6.0 - 3.0) + 0.1 * np.sin(40.0 * t)

    def seen(origin):
        table = np.column_stack([t, force, origin + to_and_fro])
        file = tmp_path / "strokes.csv"
        names = "time [s],force [N],displacement [mm]"
        np.savetxt(file, table, "%.6f", ",", header=names, comments="")
        return str(ss.regime(ss.read_trace(file)))

    assert seen(place) == seen(0.0)

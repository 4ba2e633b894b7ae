"""Random numbers that are a function of a contact and its life."""

import numpy as np
import pytest

import stickslip as ss
from stickslip.kernels import keyed_draws
from stickslip.kernels.keyed_draws import Portion, quantile, tabulate_quantiles


def test_quantiles_are_those_of_the_distributions():
    p = np.random.default_rng(0).random(300)
    for kind in (
        ss.Gaussian(mean=1.0, std=0.1),
        ss.Weibull(scale=1.0, shape=0.5),
        ss.Gamma(mean=1.0, std=0.3),
        ss.Uniform(low=0.5, high=1.5),
    ):
        table = tabulate_quantiles([[], [Portion(1.0, kind.inverse_survival)]])
        found = [quantile(table, 1, each) for each in p.tolist()]
        assert found == pytest.approx(kind.inverse_survival(p), rel=2e-13, abs=1e-13)
    # one piece for each factor of 2, as no piece of a straight line is too wide
    assert len(tabulate_quantiles([[Portion(1.0, kind.inverse_survival)]]).edges) < 110


@pytest.mark.parametrize(
    ("word", "hashed"),
    [(0, (0x6B200159, 0x99BA4EFE)), (0xFFFFFFFF, (0x1CB996FC, 0xBB002BE7))],
)
def test_the_hash_is_threefry(word, hashed):
    # known answers of the Random123 library
    assert keyed_draws.threefry((word, word), (word, word)) == hashed

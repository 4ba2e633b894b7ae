"""The records of a rig: what they let through, and delays against their own samples."""

import math
import pickle
from dataclasses import FrozenInstanceError, dataclass, fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special

import stickslip as ss
from stickslip.errors import InputError
from stickslip.model import (
    Delay,
    DelayModel,
    ExponentialGrowth,
    Interface,
    Langevin,
    LogarithmicGrowth,
    RandomDelay,
    Slider,
)
from stickslip.model.distributions import Empirical, Exponential, Gaussian, SteadyState, Uniform
from stickslip.paper import cases

TENTH = Gaussian(mean=1.0, std=0.1)

RECORDS = [
    Delay(0.2),
    Delay(math.inf),
    RandomDelay(mean=0.2, std=0.12, negative="fold"),
    Langevin(rate=1.5),
    ExponentialGrowth(rate=2.0, newborn=0.1),
    LogarithmicGrowth(slope=0.05, time=1e-3),
    Interface(thresholds=TENTH),
    Interface(thresholds=Uniform(low=0.5, high=1.5), initial=SteadyState(thresholds=TENTH), ageing=Langevin(rate=1)),
    Slider(stiffness=2.0, mass=1e-4, damping=200.0),
    *{case.interface for name, case in vars(cases).items() if name.startswith("FIG")},
    cases.FIG8,
]


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: type(record).__name__)
def test_records_are_values(record):
    twin = replace(record)
    assert twin == record
    assert hash(twin) == hash(record)
    assert pickle.loads(pickle.dumps(record)) == record
    with pytest.raises(FrozenInstanceError):
        setattr(record, fields(record)[0].name, 1.0)


def test_records_differ_where_a_field_does():
    interface = Interface(thresholds=TENTH, delay=Delay(0.2))
    assert interface != replace(interface, delay=Delay(0.3))
    assert interface != replace(interface, ageing=Langevin(rate=1))
    assert len({interface, replace(interface), replace(interface, delay=Delay(0.3))}) == 2


def test_an_interface_stays_a_value_after_its_distribution_was_asked_for():
    interface = Interface(thresholds=Gaussian(mean=1.0, std=0.3))
    before = hash(interface)
    assert interface.threshold_distribution == Gaussian(mean=1.0, std=0.3, lower=0.0)
    assert hash(interface) == before
    assert interface == Interface(thresholds=Gaussian(mean=1.0, std=0.3))
    copy = pickle.loads(pickle.dumps(interface))
    assert copy.threshold_distribution == interface.threshold_distribution
    # Varied, it does not keep the distribution of the one it was made from.
    assert replace(interface, thresholds=TENTH).threshold_distribution == TENTH.positive()


def test_numbers_become_floats():
    slider = Slider(stiffness=2, mass=np.float32(0.5), damping=np.int64(3))
    assert [type(getattr(slider, field.name)) for field in fields(slider)] == [float] * 3
    assert type(Delay(1).time) is float


def test_frequency_of_the_slider():
    assert Slider(stiffness=2.0, mass=1e-4, damping=0).frequency == pytest.approx(141.4213562, rel=1e-9)
    assert Slider(stiffness=2.0, mass=0, damping=0).frequency == math.inf


def test_initial_loss_is_the_share_beyond_the_largest_threshold_on_either_side():
    interface = Interface(thresholds=Uniform(low=0.5, high=1.0), initial=Gaussian(mean=0.1, std=0.28))
    expected = special.ndtr(-(1.0 - 0.1) / 0.28) + special.ndtr(-(1.0 + 0.1) / 0.28)
    assert interface.initial_loss == pytest.approx(expected, abs=1e-14)
    with pytest.raises(InputError, match=r"^Interface\.initial = .*: 4\.5\d* % of the contacts would start beyond"):
        Interface(thresholds=Uniform(low=0.5, high=1.0), initial=Gaussian(mean=0.0, std=0.5))


def test_the_papers_parameters():
    for case in (cases.FIG4, cases.FIG5):
        assert case.slider == Slider(stiffness=2.0, mass=1e-4, damping=200.0)
        assert case.contacts == 10_000
    for case in (cases.FIG4, cases.FIG5, cases.FIG6, cases.FIG7, cases.FIG8, cases.FIG11):
        assert case.interface.thresholds == TENTH
        assert case.interface.initial == Gaussian(mean=0.0, std=0.01)
    assert cases.FIG5.interface.delay == Delay(math.inf)
    assert cases.FIG6.slider.damping == pytest.approx(0.3 * cases.FIG6.slider.frequency, rel=1e-15)
    assert cases.FIG8.slider.damping == pytest.approx(0.1 * cases.FIG8.slider.frequency, rel=1e-15)
    assert cases.FIG7.interface.delay == Delay(0.1)
    assert cases.FIG8.interface.ageing == Langevin(rate=1.5)
    assert cases.FIG11.interface.ageing == Langevin(rate=1.0)


# ------------------------------------------------------------------------------------------------ delays

DELAYS = [
    Delay(0.0),
    Delay(0.2),
    *(
        RandomDelay(mean=mean, std=std, negative=negative)
        for mean, std in ((0.2, 0.12), (0.0, 0.3), (0.5, 0.08), (0.1, 1.0))
        for negative in ("clip", "redraw", "fold")
    ),
]
every_delay = pytest.mark.parametrize("delay", DELAYS, ids=str)


def normal(z):
    return math.exp(-0.5 * z * z) / math.sqrt(2 * math.pi)


def closed_mean(delay: RandomDelay) -> float:
    """Mean of a Gaussian whose negative draws are clipped, drawn again or folded."""
    z = delay.mean / delay.std
    above = delay.mean * special.ndtr(z) + delay.std * normal(z)  # mean of max(tau, 0)
    match delay.negative:
        case "clip":
            return above
        case "redraw":
            return above / special.ndtr(z)
        case "fold":
            return 2 * above - delay.mean


@pytest.mark.parametrize("delay", [d for d in DELAYS if isinstance(d, RandomDelay)], ids=str)
def test_mean_of_a_random_delay_in_closed_form(delay):
    # A folded tail of less than 2e-6 of the draws is left out.
    assert delay.moment(1) == pytest.approx(closed_mean(delay), rel=1e-12 if delay.mean < 0.5 else 2e-6)


@every_delay
@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_moments_agree_with_quadrature(delay, order):
    tau, weight = delay.quadrature()
    assert delay.moment(order) == pytest.approx(np.sum(weight * tau**order), rel=1e-12, abs=1e-15)


@every_delay
def test_quadrature_is_a_distribution_on_positive_times(delay):
    tau, weight = delay.quadrature()
    assert tau.shape == weight.shape
    assert np.all(tau >= 0)
    assert np.all(np.diff(tau) > 0)
    assert np.all(weight >= 0)
    assert weight.sum() == pytest.approx(1.0, abs=1e-13)


@every_delay
def test_laplace_agrees_with_quadrature(delay):
    tau, weight = delay.quadrature()
    for s in (0.0, 1.0, -0.5, 2j, 1 + 5j, -0.5 + 3j, 20j):
        # 96 nodes over some 16 standard deviations resolve exp(-s tau) up to |s| standard deviation of some 40.
        assert delay.laplace(s) == pytest.approx(np.sum(weight * np.exp(-s * tau)), abs=1e-11)
    assert delay.laplace([[0, 1j]]).shape == (1, 2)


@every_delay
def test_samples_agree_with_moments(delay):
    n = 40_000
    tau = delay.sample(np.random.default_rng(1), n)
    assert tau.shape == (n,)
    assert tau.min() >= 0
    variance = delay.moment(2) - delay.moment(1) ** 2
    assert abs(tau.mean() - delay.moment(1)) <= 6 * math.sqrt(max(variance, 0) / n) + 1e-12
    for s in (3.0, 4j):
        estimate, exact = np.mean(np.exp(-s * tau)), complex(delay.laplace(s))
        # |exp(-s tau)| <= 1, so its variance is at most 1 - |mean|^2.
        assert abs(estimate - exact) <= 6 * math.sqrt(max(1 - abs(exact) ** 2, 0) / n) + 1e-12


def test_what_becomes_of_negative_draws():
    n = 50_000
    below = special.ndtr(-0.2 / 0.12)
    rng = np.random.default_rng
    clip, redraw, fold = (
        RandomDelay(mean=0.2, std=0.12, negative=negative).sample(rng(2), n) for negative in ("clip", "redraw", "fold")
    )
    assert abs(np.mean(clip == 0) - below) < 6 * math.sqrt(below / n)
    assert not np.any(redraw == 0)
    assert not np.any(fold == 0)
    # Folding and clipping start from the same draws.
    np.testing.assert_array_equal(clip[clip > 0], fold[clip > 0])


def test_the_fixed_delay_draws_no_random_number():
    rng = np.random.default_rng(3)
    before = rng.bit_generator.state
    np.testing.assert_array_equal(Delay(0.2).sample(rng, 3), [0.2, 0.2, 0.2])
    assert rng.bit_generator.state == before


def test_contacts_that_never_come_back():
    delay = Delay(math.inf)
    assert delay.moment(1) == math.inf
    np.testing.assert_array_equal(delay.laplace([0.5, 2j]), [0, 0])
    tau, weight = delay.quadrature()
    assert tau.size == weight.size == 0
    np.testing.assert_array_equal(delay.sample(np.random.default_rng(0), 2), [math.inf, math.inf])


@given(st.just(0.0) | st.floats(1e-30, 2), st.floats(0.01, 2), st.sampled_from(["clip", "redraw", "fold"]))
def test_random_delays_keep_their_weight_and_order(mean, std, negative):
    delay = RandomDelay(mean=mean, std=std, negative=negative)
    tau, weight = delay.quadrature()
    assert weight.sum() == pytest.approx(1.0, abs=1e-12)
    assert tau.min() >= 0
    assert delay.moment(1) >= mean * (1 - 3e-6)
    assert delay.moment(2) >= delay.moment(1) ** 2
    assert delay.laplace(0.0) == pytest.approx(1.0, abs=1e-12)
    # Clipped draws lie below folded ones, in the mean.
    clip, fold = (RandomDelay(mean=mean, std=std, negative=n).moment(1) for n in ("clip", "fold"))
    assert clip <= fold + 3e-6


@dataclass(frozen=True)
class TwoDelays(DelayModel):
    """A delay distribution of the user's own: either of two times."""

    first: float
    second: float

    def moment(self, order):
        return 0.5 * (self.first**order + self.second**order)

    def laplace(self, s):
        s = np.asarray(s, dtype=complex)
        return 0.5 * (np.exp(-s * self.first) + np.exp(-s * self.second))

    def sample(self, rng, size):
        return np.where(rng.random(size) < 0.5, self.first, self.second)

    def quadrature(self):
        return np.array([self.first, self.second]), np.array([0.5, 0.5])


def test_a_delay_distribution_of_ones_own():
    assert isinstance(TwoDelays(0.1, 0.3), DelayModel)
    assert Interface(thresholds=TENTH, delay=TwoDelays(0.1, 0.3)).delay.moment(1) == pytest.approx(0.2)


# ------------------------------------------------------------------------------------------------ bad records


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Delay(-0.1), r"^Delay\.time = -0\.1: must be a number at least 0 \(the delay time tau_d\)"),
        (lambda: Delay(math.nan), r"^Delay\.time = nan: must be a number at least 0"),
        (lambda: Delay("0.2"), r"^Delay\.time = '0\.2': must be a number at least 0"),
        (lambda: Delay(None), r"^Delay\.time = None: must be a number at least 0"),
        (lambda: RandomDelay(mean=-1, std=1), r"^RandomDelay\.mean = -1: must be a finite number at least 0"),
        (lambda: RandomDelay(mean=math.inf, std=1), r"^RandomDelay\.mean = inf: must be a finite number"),
        (lambda: RandomDelay(mean=1, std=0), r"^RandomDelay\.std = 0: must be a finite number above 0"),
        (lambda: RandomDelay(mean=1, std=-1), r"^RandomDelay\.std = -1: must be a finite number above 0"),
        (
            lambda: RandomDelay(mean=1, std=1, negative="drop"),
            r"^RandomDelay\.negative = 'drop': must be one of clip, redraw, fold",
        ),
        (lambda: Langevin(rate=0), r"^Langevin\.rate = 0: must be a finite number above 0 \(beta\)"),
        (lambda: Langevin(rate=1, newborn=-1), r"^Langevin\.newborn = -1: must be a finite number at least 0"),
        (lambda: ExponentialGrowth(rate=-1), r"^ExponentialGrowth\.rate = -1: must be a finite number above 0"),
        (lambda: LogarithmicGrowth(slope=-1, time=1), r"^LogarithmicGrowth\.slope = -1: must be .* at least 0"),
        (lambda: LogarithmicGrowth(slope=1, time=0), r"^LogarithmicGrowth\.time = 0: must be .* above 0"),
        (lambda: Slider(stiffness=0, mass=1, damping=1), r"^Slider\.stiffness = 0: must be .* above 0 \(K/N\)"),
        (lambda: Slider(stiffness=-2, mass=1, damping=1), r"^Slider\.stiffness = -2: must be .* above 0 \(K/N\)"),
        (lambda: Slider(stiffness=1, mass=-1, damping=1), r"^Slider\.mass = -1: must be .* at least 0 \(M/N\)"),
        (lambda: Slider(stiffness=1, mass=math.nan, damping=1), r"^Slider\.mass = nan: must be a finite number"),
        (lambda: Slider(stiffness=1, mass=1, damping=-1), r"^Slider\.damping = -1: must be .* at least 0 \(eta\)"),
        (lambda: Slider(stiffness=1, mass=1, damping=math.inf), r"^Slider\.damping = inf: must be a finite number"),
        (lambda: Slider(stiffness=True, mass=1, damping=1), r"^Slider\.stiffness = True: must be a number above 0"),
        (lambda: Interface(thresholds=1.0), r"^Interface\.thresholds = 1\.0: must be a distribution, such as Gaussian"),
        (
            lambda: Interface(thresholds=Gaussian),
            r"^Interface\.thresholds = <class .*: must be a distribution, such as",
        ),
        (lambda: Interface(thresholds=TENTH, initial=0.0), r"^Interface\.initial = 0\.0: must be a distribution"),
        (lambda: Interface(thresholds=TENTH, delay=0.2), r"^Interface\.delay = 0\.2: must be a delay, such as Delay"),
        (lambda: Interface(thresholds=TENTH, delay=Delay), r"^Interface\.delay = <class .*: must be a delay, such as"),
        (lambda: Interface(thresholds=TENTH, ageing=1.5), r"^Interface\.ageing = 1\.5: must be an ageing model, such"),
        (
            lambda: Interface(thresholds=TENTH, initial=Gaussian(mean=3, std=0.1)),
            r"^Interface\.initial = .*100 % of the contacts would start beyond .* \(1\.83.*\); narrow",
        ),
        (
            lambda: Interface(thresholds=Uniform(low=0.5, high=1), initial=Exponential(mean=1)),
            r"^Interface\.initial = .*36\.8 % of the contacts",
        ),
        (
            lambda: Interface(thresholds=Empirical(edges=(0, 1), weights=(1,)), initial=Uniform(low=-2, high=0)),
            r"^Interface\.initial = .*50 % of the contacts",
        ),
        (
            lambda: Interface(thresholds=Gaussian(mean=-2, std=0.1)),
            r"^Gaussian\.lower = 0: less than one value in a million lies above it; raise the mean \(-2\)",
        ),
    ],
)
def test_bad_records(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize("kind", [RandomDelay, Langevin, ExponentialGrowth, LogarithmicGrowth, Interface, Slider])
def test_records_are_made_by_keyword_only(kind):
    with pytest.raises(TypeError):
        kind(1.0, 1.0)


def test_a_misspelt_field_is_refused():
    with pytest.raises(TypeError, match="stifness"):
        Slider(stifness=1.0, mass=1.0, damping=1.0)


def test_what_a_notebook_tries_works_or_says_what_to_write():
    assert Gaussian(1.0, 0.1) == Gaussian(mean=1.0, std=0.1)
    assert Uniform(0.8, 1.2) == Uniform(low=0.8, high=1.2)
    with pytest.raises(InputError, match=r"Slider\.stiffness = '2 MN/m': .* give SI to read_rig or Rig\.replace"):
        Slider(stiffness="2 MN/m", mass=1.0, damping=1.0)
    rig = ss.example("brake_pad")
    with pytest.raises(AttributeError, match=r"Rig has no 'simulate'; write stickslip\.simulate\(rig\)"):
        rig.simulate()
    with pytest.raises(AttributeError, match=r"Rig has no 'colour'$"):
        rig.colour()
    assert not hasattr(rig, "__wrapped__")

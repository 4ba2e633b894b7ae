"""Extensions by users: a distribution, delay, ageing, barrier, body, engine and
parameter, each a class and a registration.
"""

import ast
import math
import re
import tomllib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated
from unittest import mock

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import InputError
from stickslip.io import rig_files
from stickslip.model import (
    activation,
    ageing,
    body,
    delays,
    distributions,
    methods,
    parameters,
)
from stickslip.model.distribution import Distribution
from stickslip.model.parameters import Parameter
from stickslip.model.records import Number
from stickslip.simulation.engines import contacts
from stickslip.simulation.engines.base import (
    ENGINES,
    MOTION,
    Advance,
    Engine,
    Stretchings,
    slider_constants,
    solves,
)
from stickslip.sliding import respond

PAGE = Path(__file__).parents[1] / "docs" / "howto" / "add-a-distribution.md"
TABLES = distributions.DISTRIBUTIONS, delays.DELAYS, ageing.AGEING_MODELS
TABLES += body.BODIES, methods.METHODS
TABLES += (activation.ACTIVATIONS, parameters.BY_NAME, ENGINES)


@contextmanager
def as_shipped():
    """Undo at the end of the test all registrations made in it."""
    with ExitStack() as stack:
        for table in TABLES:
            stack.enter_context(mock.patch.dict(table))
        yield


def taught():
    """Classes and functions of the page on extensions, as its readers write them."""
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    tree = ast.parse("\n".join(blocks))
    kinds = (ast.Import, ast.ImportFrom, ast.ClassDef, ast.FunctionDef)
    tree.body = [node for node in tree.body if isinstance(node, kinds)]
    known = {"__name__": __name__}
    with as_shipped():
        exec(compile(tree, PAGE, "exec"), known)
    names = "Triangular", "ConstantRate", "Steep", "set_ratio"
    return [known[name] for name in names]


Triangular, ConstantRate, Steep, set_ratio = taught()


@dataclass(frozen=True)
class Glued:
    """Contacts never break, under a slider half as fast as the drive."""

    stretched: Annotated[float, Number("x_s", at_least=0)] = 0.0


@dataclass(frozen=True, kw_only=True)
class Hardened(ageing.AgeingModel):
    """Thresholds times a factor at birth: everything is known of them, as without."""

    factor: Annotated[float, Number(at_least=1)]

    def hard(self, thresholds, delay):
        mean = self.factor * thresholds.mean
        std = self.factor * thresholds.std
        return ss.Interface(thresholds=ss.Gaussian(mean=mean, std=std), delay=delay)

    def friction(self, thresholds, delay, velocity):
        return ss.kinetic_friction(self.hard(thresholds, delay), velocity)

    def response(self, thresholds, delay):
        return respond(self.hard(thresholds, delay))


class HardenedContacts(contacts.EventByEvent):
    def __init__(self, beginning, method):
        interface = beginning.interface
        hard = interface.ageing.hard(interface.thresholds, interface.delay)
        super().__init__(replace(beginning, interface=hard), method)


@dataclass(frozen=True, kw_only=True)
class Unknown(ageing.AgeingModel):
    """One that says nothing of itself."""


class GluedContacts(Engine):
    columns = MOTION
    angle = 0.1

    def __init__(self, beginning, method):
        self.slider = slider_constants(beginning.slider)
        self._now = (0.0, 0.0)
        self._stretched = method.stretched

    def here(self):
        return self._now

    def stretchings(self):
        stretching = np.array([self._now[1] + self._stretched])
        return Stretchings(stretching, np.ones(1), cells=False)

    def advance(self, leg):
        """Advance in one go, for a drive of constant velocity from the start."""
        speed = 0.5 * leg.drive.velocity
        X = speed * np.append(leg.times, leg.end)
        self._now = float(leg.end), float(X[-1])
        columns = [X, np.full_like(X, speed), X + self._stretched, np.ones_like(X)]
        return Advance(np.column_stack(columns)[:-1], (), over=True)


@dataclass(frozen=True, kw_only=True)
class Star(body.ElasticBody):
    """Blocks each of which is coupled to the first one only."""

    arms: Annotated[int, Number(at_least=1)]

    @property
    def size(self):
        return self.arms + 1

    @property
    def links(self):
        tips = np.arange(1, self.size)
        pairs = np.column_stack([np.zeros_like(tips), tips])
        return pairs, np.full(self.arms, self.coupling)


STAR = Star(arms=4, coupling=2.0, mass=0.05, damping=2.0, side=0.5, leaf=0.1)

ZETA = Parameter(
    name="damping ratio",
    unit="1",
    title="damping ratio of the slider",
    get=lambda rig: rig.slider.damping / (2 * rig.slider.frequency),
    set=set_ratio,
)


@pytest.fixture(scope="module", autouse=True)
def _registered() -> Iterator[None]:
    """Register as decorators do; `as_shipped` keeps it from other tests."""
    with as_shipped():
        distributions.register("triangle of a test")(Triangular)
        delays.register("rate of a test")(ConstantRate)
        parameters.register(ZETA)
        methods.register("glued of a test")(Glued)
        solves(Glued)(GluedContacts)
        body.register("star of a test")(Star)
        ageing.register("hardened of a test")(Hardened)
        activation.register("steep of a test")(Steep)
        solves(ss.Contacts, Hardened)(HardenedContacts)
        yield


THRESHOLDS = Triangular(mean=1.0, half_width=0.25)
# The same in 400 bins
_EDGES = np.linspace(0.75, 1.25, 401)
_BELOW = np.where(_EDGES <= 1, 8 * (_EDGES - 0.75) ** 2, 1 - 8 * (1.25 - _EDGES) ** 2)
WEIGHTS = tuple(np.diff(_BELOW).tolist())
HISTOGRAM = ss.Empirical(edges=tuple(_EDGES.tolist()), weights=WEIGHTS)
SLIDER = ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4)


def rig_with(delay, thresholds=THRESHOLDS, distance=4.0):
    interface = ss.Interface(thresholds=thresholds, delay=delay)
    return ss.Rig(interface, SLIDER, ss.constant(1.0, distance))


def is_kept(rig):
    """Return the text of a rig's file, once it is read back and its run repeated."""
    run = ss.simulate(rig)
    text = rig_files.to_toml(rig)
    assert ss.rerun(run).identical(run)
    assert ss.read_rig(tomllib.loads(text)) == rig
    return text


def test_a_density_is_a_whole_distribution():
    moments = (THRESHOLDS.moment(1), THRESHOLDS.standard_deviation())
    assert moments == pytest.approx((1.0, 0.25 / math.sqrt(6)), rel=1e-12)
    x = np.linspace(0.7, 1.3, 25)
    u = np.clip((x - 0.75) / 0.25, 0.0, 2.0)
    survival = np.where(u <= 1, 1 - 0.5 * u**2, 0.5 * (2 - u) ** 2)
    assert THRESHOLDS.survival(x) == pytest.approx(survival, abs=1e-14)
    p = np.array([0.999, 0.7, 0.5, 0.2, 1e-6])
    x = THRESHOLDS.inverse_survival(p)
    assert THRESHOLDS.survival(x) == pytest.approx(p, rel=1e-12)
    # The sum of two uniform draws: the product of their transforms.
    half = ss.Uniform(low=0.375, high=0.625)
    q = np.array([0.0, 1e-6j, 3.0 + 2j, -4.0, 40j, 2e3j, 1e3])
    mean, slope = THRESHOLDS.transform(q)
    of_half, slope_of_half = half.transform(q)
    assert mean == pytest.approx(of_half**2, rel=1e-11, abs=1e-14)
    assert slope == pytest.approx(2 * of_half * slope_of_half, rel=1e-11, abs=1e-14)
    # Thresholds are its positive part.
    assert THRESHOLDS.positive() is THRESHOLDS
    wide = Triangular(mean=0.2, half_width=0.5)
    x = np.linspace(0.05, 0.65, 7)
    part = wide.survival(x) / wide.survival(0.0)
    assert wide.positive().survival(x) == pytest.approx(part, rel=1e-12)


@dataclass(frozen=True)
class Odd(Distribution):
    """No density: of another integral, or below zero."""

    sign: int

    def density(self, x):
        return 1.0 * np.where(np.abs(np.asarray(x)) < 1, np.sign(x) ** self.sign, 0.0)


def test_a_density_that_is_none_is_told_so():
    for sign, told in (
        (2, "integral of its density is 2, must be 1"),
        (1, r"density is -1 at x = -"),
    ):
        with pytest.raises(InputError, match=told):
            Odd(sign).moment(1)


def test_every_solver_takes_them():
    for delay in (ss.Delay(0.1), ConstantRate(10.0)):
        rig = rig_with(delay)
        expected = ss.kinetic_friction(rig.interface, 1.0)
        assert expected == pytest.approx(0.5 * (1 + 0.25**2 / 6) / (1 + 0.1), rel=1e-12)
        for method in (ss.Contacts(2_000, seed=3), ss.MasterEquation()):
            run = ss.simulate(replace(rig, method=method, start=ss.FromSliding()))
            late = run["friction_force"].to_numpy()[len(run["time"]) // 2 :]
            assert late.mean() == pytest.approx(expected, rel=0.05)
    rigid = ss.rigid_slide(rig_with(ss.Delay(0.0)).interface, distance=6.0)
    other = rig_with(ss.Delay(0.0), HISTOGRAM).interface
    histogram = ss.rigid_slide(other, distance=6.0)
    force = rigid["friction_force"].to_numpy()
    assert force == pytest.approx(histogram["friction_force"].to_numpy(), abs=1e-5)


def test_stability_takes_them_by_name():
    both = THRESHOLDS, HISTOGRAM
    rigs = [rig_with(ss.Delay(0.1), each).replace(velocity=1.6) for each in both]
    rig = rigs[0]
    ranges = {"velocity": (1.0, 1.9), "damping ratio": (0.05, 2.0)}
    for parameter, between in ranges.items():
        found = (ss.critical(each, parameter, between=between) for each in rigs)
        own, other = ([edge.value for edge in crossings] for crossings in found)
        assert len(own) > 0
        # The square of a bin width over that of the standard deviation
        assert own == pytest.approx(other, rel=1.5e-4)
    damping = rig.replace(**{"damping ratio": own[0]}).slider.damping
    assert damping == pytest.approx(2 * own[0] * SLIDER.frequency)
    assert ss.growth_rate(rig) == pytest.approx(ss.growth_rate(rigs[1]), rel=1e-3)
    # Equal delays make smooth sliding unstable, scattered ones do not.
    rigs = (rig_with(delay) for delay in (ss.Delay(0.2), ConstantRate(5.0)))
    modes = [ss.stability.count_unstable(rig) for rig in rigs]
    assert modes == [2, 0]


def test_a_rig_file_names_a_distribution_and_a_sweep_varies_its_rig(tmp_path):
    file = tmp_path / "own.toml"
    file.write_text("""
units = "natural"
slider = { mass = 1e-4, stiffness = 2.0, damping = 42.4 }
drive = { velocity = 1.0, distance = 2.0 }
simulation = { contacts = 200 }
[interface]
thresholds = { distribution = "triangle of a test", mean = 1.0, half_width = 0.25 }
delay = 0.1
""")
    rig = ss.read_rig(file)
    assert rig.interface.thresholds == THRESHOLDS
    found = ss.sweep(rig, {"stiffness": [1.0, 3.0]}, store=tmp_path / "own.sqlite")
    assert found.sizes["stiffness"] == 2
    assert np.all(np.isfinite(found["mean_force"]))
    varied = ss.sweep(rig, {"damping ratio": [0.1, 2.0], "seed": [1]})
    assert varied["damping ratio"].attrs["long_name"] == "damping ratio of the slider"
    assert varied["mean_force"][0] != varied["mean_force"][1]
    is_kept(rig)
    file.write_text(file.read_text().replace("half_width", "width"))
    with pytest.raises(InputError, match=r"own\.toml: interface\.thresholds.*width"):
        ss.read_rig(file)


def test_a_rig_file_names_a_delay():
    rig = ss.example("pmma_slider")
    document = rig_files.to_document(rig)
    document["interface"]["delay"] = {"model": "rate of a test", "rate": "2.5 1/ms"}
    own = ss.read_rig(document)
    assert own.interface.delay == ConstantRate(2500.0 / own.scales.unit("1/time"))
    kept = is_kept(replace(own, drive=ss.constant(1.0, 2.0)))
    assert 'model = "rate of a test"' in kept
    document["interface"]["delay"] = {"model": "rate of a tset"}
    message = r"must be one of the known models .*'rate of a test'"
    with pytest.raises(InputError, match=message):
        ss.read_rig(document)


def test_an_engine_of_ones_own():
    rig = replace(rig_with(ss.Delay(0.1)), method=Glued(0.3))
    run = ss.simulate(rig)
    np.testing.assert_array_equal(run["displacement"], 0.5 * run["time"])
    np.testing.assert_array_equal(run["friction_force"], 0.5 * run["time"] + 0.3)
    np.testing.assert_allclose(run["spring_force"], run["time"])  # the stiffness is 2
    assert 'method = "glued of a test"' in is_kept(rig)
    # it grows without bound
    assert (ss.sweep(rig, {"stiffness": [1.0, 2.0]})["mean_force"] > 10.0).all()
    for field in ({"ageing": ss.Langevin(rate=1.0)}, {"sliding_force": 0.1}):
        message = r"Interface\..* = .*: not available with Glued"
        with pytest.raises(InputError, match=message):
            ss.simulate(replace(rig, interface=replace(rig.interface, **field)))


@pytest.mark.slow
def test_a_body_of_ones_own():
    rig = rig_with(ss.Delay(0.1), distance=2.0)
    rig = replace(rig, slider=STAR, method=ss.Contacts(50, seed=1))
    # Arms that move against each other feel the springs alone; the other modes are
    # those of a row of two blocks, with root 4.
    link = -2.0 * math.sqrt(4)
    pair = np.linalg.eigvalsh([[4 * 2.0 + 0.5, link], [link, 2.0]])
    expected = np.sort([*pair, 2.0, 2.0, 2.0]) + 0.1
    stiffness = ss.elastic.modes(rig).stiffness.to_numpy()
    assert stiffness == pytest.approx(expected, rel=1e-12)
    run = ss.simulate(rig)
    # Before the first contact breaks the arms move alike.
    alike = replace(rig.interface, initial=ss.Gaussian(mean=0.0, std=0.0))
    drive = ss.constant(1.0, duration=0.5)
    loaded = ss.simulate(replace(rig, interface=alike, drive=drive))
    assert run.sizes["block"] == loaded.sizes["block"] == 5
    displacement = loaded["displacement"].to_numpy()
    assert displacement[-1, 1] > 0.0
    together = displacement[:, 1:2] * np.ones(4)
    np.testing.assert_allclose(displacement[:, 1:], together, atol=1e-12)
    text = is_kept(rig)
    assert '["star of a test"]' in text
    with pytest.raises(InputError, match=r"^rig: star of a test\.arms: is missing"):
        ss.read_rig(tomllib.loads(text.replace("arms = 4\n", "")))
    document = rig_files.to_document(replace(ss.example("pmma_slider"), slider=STAR))
    assert ss.read_rig(document).slider == STAR
    found = ss.sweep(replace(rig, drive=ss.constant(1.0, 1.0)), {"leaf": [0.1, 0.3]})
    assert found.sizes["leaf"] == 2


def test_an_ageing_of_ones_own():
    thresholds = ss.Gaussian(mean=1.0, std=0.1)
    method = ss.Contacts(500, seed=2)
    aged = replace(rig_with(ss.Delay(0.1), thresholds), method=method)
    aged = replace(aged, interface=replace(aged.interface, ageing=Hardened(factor=2.0)))
    doubled = {"thresholds": ss.Gaussian(mean=2.0, std=0.2), "ageing": None}
    hard = replace(aged, interface=replace(aged.interface, **doubled))
    run = ss.simulate(aged)
    same = ss.simulate(hard)
    np.testing.assert_array_equal(run["friction_force"], same["friction_force"])
    assert 'model = "hardened of a test"' in is_kept(aged)
    speeds = np.array([0.5, 2.0])
    for law in (ss.kinetic_friction, ss.stability.friction_slope):
        expected = pytest.approx(law(hard.interface, speeds), rel=1e-6)
        assert law(aged.interface, speeds) == expected
    edges = [ss.critical(each, "velocity", between=(0.5, 5.0)) for each in (aged, hard)]
    assert len(edges[0]) == len(edges[1]) > 0
    assert [edge.value for edge in edges[0]] == [edge.value for edge in edges[1]]
    found, known = (ss.sweep(each, {"stiffness": [1.0, 3.0]}) for each in (aged, hard))
    np.testing.assert_array_equal(found["mean_force"], known["mean_force"])


@pytest.mark.slow
def test_a_barrier_of_ones_own():
    rig = rig_with(ss.Delay(0.1), ss.Gaussian(mean=1.0, std=0.1), distance=1.0)
    bell = ss.Bell(width=0.01, attempts=1e6)
    steep = Steep(slope=100.0, period=1e-6)
    interfaces = (replace(rig.interface, activation=each) for each in (steep, bell))
    own, known = (replace(rig, interface=each) for each in interfaces)
    assert own.interface == known.interface  # which keeps the shape
    for method in (ss.Contacts(500, seed=2), ss.MasterEquation(rtol=1e-3)):
        is_kept(replace(own, method=method))
    force = ss.kinetic_friction(known.interface, 1.0)
    assert ss.kinetic_friction(own.interface, 1.0) == force
    assert ss.growth_rate(own) == ss.growth_rate(known)
    assert np.isfinite(ss.sweep(own, {"stiffness": [1.0, 3.0]})["mean_force"]).all()
    document = rig_files.to_document(ss.example("pmma_slider"))
    barrier = {"kind": "steep of a test", "slope": "20 1/um", "period": "10 ns"}
    document["interface"]["activation"] = barrier
    read = ss.read_rig(document)
    heat = read.interface.activation
    assert heat.width * read.unit("x_s") == pytest.approx(50e-9, rel=1e-12)
    assert heat.attempts * read.unit("1/time") == pytest.approx(1e8, rel=1e-12)


@dataclass(frozen=True)
class Formless(activation.ActivationModel):
    """One that says nothing of itself."""


def test_an_ageing_or_a_barrier_that_says_nothing_is_refused_by_name():
    message = r"Interface\.activation = Formless\(\): needs a method form"
    with pytest.raises(InputError, match=message):
        ss.Interface(thresholds=THRESHOLDS, activation=Formless())
    rig = rig_with(ss.Delay(0.1))
    rig = replace(rig, interface=replace(rig.interface, ageing=Unknown()))
    for ask, told in (
        (lambda: ss.kinetic_friction(rig.interface, 1.0), "friction"),
        (lambda: ss.critical(rig, "velocity", between=(0.5, 5.0)), "response"),
    ):
        unknown = r"Interface\.ageing = Unknown.* not known; simulate"
        with pytest.raises(InputError, match=rf"{unknown}.*{told}\(thresholds"):
            ask()
    message = r"Unknown.*: not available with MasterEquation; no registered solver"
    with pytest.raises(InputError, match=message):
        ss.simulate(rig)


def test_a_registration_names_one_frozen_dataclass():
    message = "distribution 'gaussian': Gaussian has this name already; choose another"
    with pytest.raises(InputError, match=message):
        distributions.register("gaussian")(Triangular)
    message = r"ageing model 'none': int must be a frozen dataclass"
    with pytest.raises(InputError, match=message):
        ageing.register("none")(int)
    with pytest.raises(InputError, match="comes with the package"):
        parameters.register(replace(ZETA, name="mass"))
    assert distributions.register("triangle of a test")(Triangular) is Triangular
    for make in (
        lambda: Hardened(factor=0.5),
        lambda: ConstantRate(0.0),
        lambda: replace(STAR, arms=0),
    ):
        message = r"^(Hardened\.factor|ConstantRate\.rate|Star\.arms) = 0.*: must be"
        with pytest.raises(InputError, match=message):
            make()

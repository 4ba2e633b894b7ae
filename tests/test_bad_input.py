"""Bad input: a table of what is refused, with the words, and what the checks accept.

Any other argument of any public function is drawn at random by tests/test_fuzz.py.
"""

import math
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import xarray as xr
from refusals import refused

import stickslip as ss
from stickslip import fitting, rigid
from stickslip.cycles import is_sustained
from stickslip.errors import LARGEST, LONGEST_MESSAGE, SMALLEST, number, together
from stickslip.io.datasets import provenance
from stickslip.model.drive import Drive
from stickslip.stability import contact_noise, dynamic_stiffness
from stickslip.theory import attached_fraction, closure_friction

TENTH = ss.Gaussian(mean=1.0, std=0.1)
INTERFACE = ss.Interface(thresholds=TENTH, delay=ss.Delay(0.2))
SLIDER = ss.Slider(stiffness=2.0, mass=1e-4, damping=200.0)
RIG = ss.Rig(INTERFACE, SLIDER, ss.constant(1.0, duration=1.0))


def interface(**parts):
    return ss.Interface(**({"thresholds": TENTH} | parts))


NEVER = interface(delay=ss.Delay(math.inf))
EQUAL = interface(thresholds=ss.Gaussian(mean=1.0, std=0.0))
AGEING = interface(ageing=ss.Langevin(rate=1.0))
LASTING = interface(ageing=ss.Langevin(rate=1.0, newborn=0.3))
TRACK = interface(newborn=ss.Uniform(-0.1, 0.4), slip_to_slip_scatter=0.1)
WARM = interface(activation=ss.Bell(width=0.01, attempts=1e6))
KEPT = ss.Interface(areas=ss.model.Areas(TENTH, kept=True))
STEP = {"before": 1.0, "after": 2.0, "distance": 1.0}


def run_of(**changes):
    changes = {"method": ss.MasterEquation()} | changes
    return ss.simulate(RIG.replace(**changes), long=True)


REFUSED = (
    lambda: number("place", "2"),
    lambda: number("place", True),
    lambda: number("place", 2j),
    "^place = .*: must be a number$",
    lambda: number("place", math.nan),
    "^place = nan: must be a finite number$",
    lambda: number("place", 1, below=1),
    "^place = 1: must be a finite number below 1$",
    lambda: number("place", 3, above=0, at_most=1),
    "^place = 3: must be a finite number above 0 and at most 1$",
    lambda: number("place", "1", above=0, hint="in N"),
    r"^place = '1': must be a number above 0 \(in N\)$",
    lambda: number("place", 10**400, above=0),
    "^place = an integer of about 401 digits: must be a number above 0$",
    lambda: number("place", 0.9 * SMALLEST, at_least=0),
    "^place = 9e-31: must be between 1e-30 and 1e",
    lambda: number("place", 1.1 * LARGEST),
    r"^place = 1\.1e\+30: must be between 1e-30 and 1e",
    lambda: ss.Gaussian(mean=1, std=0.1, lower=2),
    r"^Gaussian\.lower = 2: less than one .* raise the mean \(1\)",
    lambda: ss.Gaussian(mean=-1, std=0.1).positive(),
    r"^Gaussian\.lower = 0: less than one value in a million",
    lambda: ss.Empirical((0, 1), (1, 2)),
    "^Empirical: 2 edges and 2 weights: must be one edge more",
    lambda: ss.Empirical((0, 2, 1), (1, 2)),
    r"^Empirical\.edges: must rise",
    lambda: ss.Empirical((0, 1, 2), (0, 0)),
    r"^Empirical\.weights: must have a positive sum",
    lambda: ss.Empirical.from_samples([1.0, 1.0]),
    r"^Empirical\.from_samples: needs at least two different",
    lambda: ss.Empirical.from_samples(["a"]),
    r"^Empirical\.from_samples = .*: must be a number or an array",
    lambda: ss.RandomDelay(mean=0.1, std=1e-20),
    r"^RandomDelay\.std = 1e-20: .* use Delay",
    lambda: ss.RandomDelay(mean=1, std=1, negative="drop"),
    r"^RandomDelay\.negative = 'drop': must be 'clip' or 'redraw' or 'fold'$",
    lambda: ss.Slider(stiffness=0, mass=1, damping=1),
    r"^Slider\.stiffness = 0: must be .* above 0 \(K/N\)",
    lambda: ss.Slider(stiffness="2 MN/m", mass=1, damping=1),
    r"'2 MN/m': .* give SI to read_rig or Rig\.replace",
    lambda: interface(thresholds=ss.Gaussian),
    r"^Interface\.thresholds = <class .*: must be a distribution, such as",
    lambda: interface(initial=ss.Gaussian(3, 0.1)),
    r"^Interface\.initial = .*100 % of the .* \(1\.83.*\); narrow",
    lambda: interface(thresholds=ss.Gaussian(1.0, 1e11)),
    "units of x_s, the breaking displacement",
    lambda: interface(newborn=ss.Gaussian(1.5, 0.3)),
    "newborn = .*would start beyond the largest threshold",
    lambda: ss.constant(0),
    "^constant: velocity = 0 needs a duration",
    lambda: ss.constant(1, 1).until(3.0),
    r"^drive until = 3\.0: must be Travel, ForceAbove or ForceBelow",
    lambda: Drive(()),
    r"^Drive\.pieces: must hold at least one piece; make one with constant\(\) or",
    lambda: Drive((1.0,)),
    r"^Drive\.pieces\[0\] = 1\.0: must be a piece",
    lambda: attached_fraction(AGEING, 1.0),
    "ageing",
    lambda: ss.kinetic_friction(AGEING),
    lambda: ss.kinetic_friction(NEVER),
    "velocity = 0",
    lambda: ss.kinetic_friction(replace(AGEING, delay=ss.Delay(0.1)), 1.0),
    "newborn = 0",
    lambda: ss.kinetic_friction(replace(AGEING, sliding_force=0.1), 1.0),
    "sliding_force = 0.1: not",
    lambda: ss.kinetic_friction(interface(slip_to_slip_scatter=0.1)),
    "0.1: not available with smooth sliding",
    lambda: ss.static_friction(interface(slip_to_slip_scatter=0.1)),
    "0.1: not available with static_friction",
    lambda: dynamic_stiffness(interface(delay=ss.OnArrest()), 1.0, 1j),
    "delay = .*: not available",
    lambda: ss.kinetic_friction(interface(ageing=ss.Langevin(rate=1.0)), 1e8),
    lambda: ss.kinetic_friction(interface(ageing=ss.Langevin(rate=1e-25)), 1.0),
    r"times rate\*\*2",
    lambda: ss.critical(RIG, "velocity", between=(1.0,)),
    r"^between = \(1\.0,\): must be two values",
    lambda: ss.critical_stiffness(interface(thresholds=ss.Gaussian(1.0, 1e-29))),
    "next to equal",
    lambda: ss.static_friction(interface(thresholds=ss.Gaussian(1.0, 1e-6))),
    "points are needed",
    lambda: run_of(mass=0.0),
    r"^Slider\.mass = 0: a simulation needs a mass above 0",
    lambda: run_of(output=ss.Output(snapshots=(2.0,))),
    r"^Output\.snapshots: 2 lies beyond the end of the",
    lambda: run_of(start=ss.FromSliding(), drive=ss.constant(0.0, 1.0)),
    "^FromSliding: .* at velocity 0: .* above 0",
    lambda: run_of(start=ss.FromSliding(), interface=NEVER),
    lambda: is_sustained(RIG.replace(interface=NEVER), start=ss.FromSliding()),
    r"^FromSliding: contacts that never re-attach .* start FromRest\(\)",
    lambda: run_of(interface=TRACK, method=ss.Contacts(9)),
    "delay = .*above 0",
    lambda: run_of(interface=EQUAL),
    r"^Gaussian\.std = 0: .* or use the method Contacts",
    lambda: run_of(output=ss.Output(interval=1e-9)),
    r"^Output\.interval = 1e-09: 1e\+09 samples; choose at least 2e-08",
    lambda: run_of(interface=replace(AGEING, thresholds=ss.Uniform(0.5, 1.5))),
    "Gaussian",
    lambda: run_of(interface=AGEING, method=ss.MasterEquation(memoryless=True)),
    lambda: is_sustained(RIG, method=ss.MasterEquation(memoryless=True)),
    "memoryless",
    lambda: ss.model.Operation(feasible=(("damping_ratio", 0.1, 0.5),)),
    r"^Operation\.feasible = 'damping_ratio': must be one of .*damping",
    lambda: run_of(interface=replace(AGEING, delay=ss.Delay(1)), method=ss.Contacts(9)),
    "newborn = 0",
    lambda: ss.rerun(xr.Dataset()),
    "no provenance",
    lambda: ss.rerun(xr.Dataset(attrs={"provenance": provenance("sweep", {})})),
    "made by 'sweep', not by",
    lambda: is_sustained(RIG.replace(drive=ss.constant(-1.0))),
    "velocity = -1",
    lambda: is_sustained(RIG.replace(drive=ss.constant(1e-25))),
    "velocity = 1e-25 x_s/time: the .* give at least",
    lambda: ss.sustained(RIG, "velocity", between=(0.5, 2.0), points=10**9),
    "^points = .*: must be a finite number at least 1 and at most 10000",
    lambda: is_sustained(RIG.replace(interface=AGEING)),
    "ageing",
    lambda: contact_noise(RIG.replace(method=ss.MasterEquation())),
    "infinitely many, .* such as contacts=1000",
    lambda: contact_noise(RIG.replace(mass=0.0, damping=0.0, delay=0.01), contacts=9),
    "without mass it would jump",
    lambda: contact_noise(RIG.replace(slider=lambda s: 2.0 + s), contacts=9),
    "no driving spring",
    lambda: contact_noise(RIG.replace(interface=KEPT)),
    r"areas = Areas\(.*\): not available with",
    lambda: interface(areas=ss.model.Areas(TENTH)),
    r"^Interface\.thresholds = .* and areas = .*: give one of them",
    lambda: interface(thresholds=None),
    "areas = None: give one of them",
    lambda: contact_noise(RIG.replace(interface=interface(slip_to_slip_scatter=0.1))),
    "scatter = 0.1: not available with",
    lambda: fitting.bench.read_known({"speed": "1 mm/s"}),
    "known: 'speed': is called 'velocity' now",
    lambda: ss.rate_and_state(INTERFACE, law=np.array([1.0, 2.0])),
    "law = array.*: must be 'best', 'ageing' or 'slip'",
    lambda: ss.sweep.Refinement(resolution=1),
    r"^refine\.resolution = 1: must be a finite number below 1$",
    lambda: ss.rigid_slide(AGEING, 1),
    r"^Interface\.ageing = .*: not available with",
    lambda: ss.static_friction(AGEING),
    r"Interface\.ageing = .*: not available with static_friction",
    lambda: rigid.effective_stiffness(INTERFACE, [1.0, math.nan]),
    "^effective_stiffness: X = nan: must be a finite number",
    lambda: closure_friction(replace(LASTING, delay=ss.Delay(0.3)), 1.0),
    "closure has no delay",
    lambda: ss.velocity_step(WARM, before=0.0, after=1.0, distance=1.0),
    "^velocity_step: before = 0",
    lambda: ss.slide_hold_slide(WARM, velocity=1.0, holds=(1.0, -2.0)),
    r"holds\[1\] = -2",
    lambda: ss.velocity_step(INTERFACE, **STEP, stiffness=1.0),
    "activation = None: not available with a spring",
)


@refused(*REFUSED)
def test_what_is_refused_and_in_which_words(call, message):
    with pytest.raises(ss.InputError, match=message) as caught:
        call()
    assert len(str(caught.value)) <= LONGEST_MESSAGE
    assert "\n" not in str(caught.value)


REAL = 2, 2.0, np.float64(2), np.float32(2), np.int64(2), Fraction(2)


@pytest.mark.parametrize("value", REAL)
def test_number_takes_every_real_number_and_gives_a_float(value):
    assert type(number("place", value)) is float
    assert number("place", value) == 2.0
    assert type(ss.errors.whole("place", value, at_least=1)) is int


def test_what_lies_on_a_bound_is_taken():
    for size in (0, SMALLEST, 1.0, LARGEST):
        assert number("place", size, at_least=0) == size
    assert number("place", 1, at_most=1) == 1
    assert number("place", -1e-300) == -1e-300  # a speed may be as near to 0 as this
    assert number("place", math.inf, infinite=True) == math.inf
    assert math.copysign(1.0, number("place", -0.0)) == 1.0
    # a seed may have any size, and keeps every digit
    assert ss.errors.whole("place", 2**127 + 1, at_least=0) == 2**127 + 1
    assert ss.errors.numbers("place", [[0, 1], [2, 3]], at_least=0).dtype == float
    assert ss.errors.sequence("place", np.array([1.0, 2.0]), "numbers") == (1.0, 2.0)
    speeds = np.array([[0.5, 1.0], [2.0, 4.0]])
    assert ss.kinetic_friction(INTERFACE, speeds).shape == (2, 2)


def test_messages_are_one_short_line_that_steers_no_terminal():
    assert issubclass(ss.InputError, ValueError)
    both = "a: is missing; b = 1: must be 2"
    assert together(["a: is missing", "b = 1: must be 2"]) == both
    assert together(["a" * 320, "b", "c", "d"]) == f"{'a' * 320}; b; and 2 more"
    assert together(["a" * 321, "b"]) == f"{'a' * 321}; and 1 more"
    said = str(ss.InputError("a\x1b[2J\x07\x9b\u202e\u2028b = 1"))
    assert said.isprintable()
    message = str(ss.InputError("place: " + "x" * 4_000_000 + ": remedy"))
    assert len(message) <= LONGEST_MESSAGE
    assert message.startswith("place: x")
    assert message.endswith("x: remedy")


def test_a_snapshot_without_attached_contacts_is_empty():
    never = interface(delay=ss.Delay(math.inf))
    rig = ss.Rig(never, SLIDER, ss.constant(1, 5), method=ss.MasterEquation())
    rig = rig.replace(output=ss.Output(snapshots=(0.3, 4.0)))
    run = ss.simulate(rig)
    assert float(run["attached"][-1]) == 0
    held = run["stretching_density"][0].sum() * np.diff(run["x"])[0]
    assert float(held) == pytest.approx(1.0)
    assert not run["stretching_density"][1].any()


def test_a_system_without_locks_of_files_is_told_at_the_import():
    script = (
        "import sys; sys.platform = 'win32'\ntry: import stickslip\nexcept "
        "ImportError as error: print(error)"
    )
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "under Windows, use WSL" in done.stdout

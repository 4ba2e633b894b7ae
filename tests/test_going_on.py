"""A run continued from the end of another one equals a run in one piece."""

import os
import pickle

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import InputError

TENTH = ss.Gaussian(mean=1.0, std=0.1)
BASE = ss.Interface(thresholds=TENTH, delay=ss.RandomDelay(mean=0.1, std=0.05))
KEPT = ss.Output(interval=0.05, state=True)
FIRST, SECOND = ss.constant(1.0, 0.7), ss.ramp(1.0, 0.2, 0.6)
RIG = ss.Rig(
    BASE,
    ss.Slider(stiffness=2.0, mass=1e-3, damping=30.0),
    FIRST,
    method=ss.Contacts(50),
    output=KEPT,
)
RUN = ss.simulate(RIG)
AGEING = ss.Interface(thresholds=TENTH, ageing=ss.Langevin(rate=1.5))
IN_SI = ss.model.Scales(force=3.0, stretching=7e-6, time=0.013)


@pytest.mark.parametrize(
    "rig",
    [
        RIG,
        RIG.replace(scales=IN_SI),
        RIG.replace(method=ss.MasterEquation()),
        RIG.replace(method=ss.Population(1000)),
        RIG.replace(interface=AGEING),
    ],
    ids=["contacts", "SI", "master equation", "population", "ageing"],
)
def test_it_is_that_of_one_piece_bit_for_bit(rig, tmp_path):
    ss.save(ss.simulate(rig), tmp_path / "first.nc")
    first = ss.load(tmp_path / "first.nc")
    whole = ss.simulate(rig.replace(drive=FIRST.then(SECOND)))
    joined = ss.simulate(rig.replace(drive=SECOND), start=first)
    assert joined.drop_vars("engine_state").identical(whole.drop_vars("engine_state"))
    assert '"state": true' in first.attrs["provenance"]
    again = ss.simulate(rig.replace(drive=SECOND), start=joined, output=ss.Output())
    assert "engine_state" not in again
    assert '"state"' not in again.attrs["provenance"]
    assert again.sizes["time"] > joined.sizes["time"]


class Evil:
    def __reduce__(self):
        return os.getpid, ()


def with_state(content):
    return RUN.assign(engine_state=("byte", np.frombuffer(content, np.uint8)))


@pytest.mark.parametrize(
    ("start", "changes", "words"),
    [
        (
            RUN.drop_vars("engine_state"),
            {},
            r"make it with output=Output\(state=True\)",
        ),
        (RUN, {"stiffness": 3.0}, r"the run is of another rig \(slider\)"),
        (RUN, {"output": ss.Output(snapshots=(0.1,))}, r"Output\.snapshots: not avail"),
        (with_state(pickle.dumps(Evil())), {}, "holds posix.getpid, which no engine"),
        (with_state(b"nothing"), {}, "its state cannot be read"),
    ],
)
def test_what_it_cannot_go_on_from_is_refused(start, changes, words):
    with pytest.raises(InputError, match=words):
        ss.simulate(RIG.replace(**changes), start=start)

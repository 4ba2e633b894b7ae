"""An interrupt takes effect soon: kernels return after a time, not some steps."""

import contextlib
import signal
import time
from dataclasses import replace

import numpy as np
import pytest

import stickslip as ss
from stickslip import __main__, console
from stickslip.simulation.driver import follow
from stickslip.simulation.engines import Beginning, engine_of, panels

INTERFACE = ss.Interface(thresholds=ss.Gaussian(mean=1.0, std=0.1), delay=ss.Delay(0.2))
SLIDER = ss.Slider(stiffness=2.0, mass=1e-4, damping=42.4)
RIG = ss.Rig(INTERFACE, SLIDER, ss.constant(1.0, 1.0), method=ss.MasterEquation())
KINDS = {
    "panels": INTERFACE,
    "bell": replace(INTERFACE, activation=ss.Bell(width=0.02, attempts=1e4)),
    "parabolic": replace(
        INTERFACE, activation=ss.model.Parabolic(temperature=0.01, attempts=1e3)
    ),
}


@pytest.mark.parametrize(
    ("name", "method", "duration"),
    [(name, ss.MasterEquation(), 0.2) for name in KINDS]
    + [("panels", ss.Population(100, seed=3), 1.3)],
)
def test_how_often_a_kernel_comes_back_changes_nothing(
    name, method, duration, monkeypatch
):
    rig = RIG.replace(
        interface=KINDS[name], method=method, drive=ss.constant(1.0, duration)
    )
    runs = []
    for lasts in (1e9, 1e-3):
        monkeypatch.setattr(panels, "_LASTS", lasts)
        runs.append(ss.simulate(rig))
    assert runs[0].equals(runs[1])


@pytest.mark.parametrize("slow", [1e-3, 2e-2, 0.1])
def test_an_advance_is_bounded_by_time(slow, monkeypatch):
    """A kernel whose steps last so long, until each lasts longer than an advance."""
    engine = engine_of(INTERFACE, RIG.method)
    beginning = Beginning(INTERFACE, SLIDER, 1.0)
    running = engine(beginning, RIG.method)
    clock = [0.0]
    kernel = panels.advance_panels
    lasted = []

    def heavy(state, case, until, times, stop, steps):
        lasted.append(slow * steps)
        clock[0] += slow * steps
        return kernel(state, case, until, times, stop, steps)

    monkeypatch.setattr(panels, "advance_panels", heavy)
    monkeypatch.setattr(time, "perf_counter", lambda: clock[0])
    follow(running, ss.constant(1.0, 20.0), 0.0, np.zeros(1))
    assert len(lasted) > 2
    assert max(lasted) <= 2.0
    assert max(lasted[1:]) <= max(2.0 * panels._LASTS, slow)


def test_what_fails_after_an_interrupt_is_told_as_one():
    """A compiler callback may swallow it; the code it skipped fails later."""

    @console.stoppable()
    def run():
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise RuntimeError("no compiled object yet")

    # a shell that starts tests in the background makes them ignore it
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            run()
    finally:
        signal.signal(signal.SIGINT, before)


def test_what_stops_the_command_line_as_it_starts_is_told_in_one_line(
    monkeypatch, capsys
):
    def stopped(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("builtins.__import__", stopped)
        code = __main__.main()
    assert code == 130
    assert capsys.readouterr().err == "stickslip: interrupted as it started\n"

"""Compile the kernels, once, before workers share the tests: `make test` begins with
it, beside the checks of style.

What the laws hold for, they compile: every engine with every mechanism that it takes.
The cases of kernels/test_plain.py go through the rest.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from stickslip.kernels import _jit

# pytest finds these by its settings, a script does not
TESTS = Path(__file__).parent
sys.path[:0] = [str(TESTS / "kernels"), str(TESTS.parent / "tools")]


def compile_some(drawn: bool) -> None:
    """Make a short run of each pair with drawn contacts, or of the others and cases."""
    from test_laws import PAIRS, has_steady_force, simulate
    from test_plain import results

    import stickslip as ss

    short = ss.constant(1.0, 0.02)
    for pair in PAIRS.values():
        if isinstance(pair.method, ss.Contacts | ss.QuasiStatic) != drawn:
            continue
        simulate(pair, drive=short, output=ss.Output(interval=0.01, snapshots=(0.01,)))
        if has_steady_force(pair.interface):
            simulate(pair, drive=short, start=ss.FromSliding())
    if drawn:  # and what steps of a structure compile
        ss.simulate(ss.example("caliper").replace(drive=short))
    else:
        results()


if __name__ == "__main__":
    assert _jit._PLACE is not None, "machine code cannot be kept here"
    done = _jit._PLACE / "all"
    if not done.exists():
        # Both share hardly a kernel, and the checks of style take less than a core.
        with ProcessPoolExecutor(2, get_context("spawn")) as pool:
            list(pool.map(compile_some, (True, False)))
        done.touch()

"""Compile the kernels, once, before workers share the tests: `make test` begins with it, beside the checks of style.

What the laws hold for, they compile: every engine with every mechanism that it takes. The cases of test_plain.py go
through the rest.
"""

from test_laws import PAIRS, has_steady_force, simulate
from test_plain import results

import stickslip as ss
from stickslip.kernels import _jit

SHORT = ss.constant(1.0, 0.02)


def main() -> None:
    """Make a short run of every pair, unless all is compiled."""
    assert _jit._PLACE is not None, "machine code cannot be kept here"
    done = _jit._PLACE / "all"
    if done.exists():
        return
    for pair in PAIRS.values():
        simulate(pair, drive=SHORT, output=ss.Output(interval=0.01, snapshots=(0.01,)))
        if has_steady_force(pair.interface):
            simulate(pair, drive=SHORT, start=ss.FromSliding())
    results()
    done.touch()


if __name__ == "__main__":
    main()

"""Run the property tests of tests/test_fuzz.py with new examples each time: `python
tools/fuzz.py MINUTES [SEED]`.

Each round has its own seed, which is printed; the same seed tries the same examples
again.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time

EXAMPLES = 100
"""Examples of each property in a round."""
LONGEST = 1800
"""Seconds that a round may take before it counts as hanging."""


def main(minutes: float, seed: int) -> int:
    """Run rounds until the time is up or one fails; return the exit code."""
    end = time.monotonic() + 60.0 * minutes
    while time.monotonic() < end:
        print(f"seed {seed}", flush=True)
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-x",
            "-m",
            "not slow",
            "-p",
            "no:cacheprovider",
        ]
        command += ["tests/test_fuzz.py", f"--hypothesis-seed={seed}"]
        try:
            done = subprocess.run(
                command,
                env={**os.environ, "FUZZ_EXAMPLES": str(EXAMPLES)},
                timeout=LONGEST,
            )
        except subprocess.TimeoutExpired:
            print(f"seed {seed}: hangs")
            return 1
        if done.returncode:
            print(f"seed {seed}: failed; see the example above")
            return 1
        seed += 1
    return 0


if __name__ == "__main__":
    sys.exit(
        main(
            float(sys.argv[1]),
            int(sys.argv[2]) if len(sys.argv) > 2 else int(time.time()),
        )
    )

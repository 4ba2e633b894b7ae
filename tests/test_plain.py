"""With the compiler off the kernels are plain Python, the readable reference: the same numbers, rounding aside."""

import json
import os
import subprocess
import sys

import numpy as np
import plain_cases
import pytest


@pytest.fixture(scope="module")
def results():
    """What the small cases give, compiled and plain."""
    off = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    plain = subprocess.run([sys.executable, plain_cases.__file__], env=off, capture_output=True, text=True, check=True)
    return plain_cases.results(), json.loads(plain.stdout)


def leaves(value, path=""):
    """Arrays of numbers in nested results, by where they stand."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from leaves(item, f"{path}/{key}")
    else:
        yield path, np.asarray(value, dtype=float)


def test_plain_python_gives_the_same_numbers(results):
    compiled, plain = (dict(leaves(result)) for result in results)
    assert compiled.keys() == plain.keys()
    for name, values in compiled.items():
        np.testing.assert_allclose(plain[name], values, rtol=1e-8, atol=1e-9, err_msg=name)


def test_the_cases_hold_breaks_and_slips(results):
    broken = [result for name, result in results[0].items() if "Contacts(" in name and "broken_energy" in result]
    assert len(broken) >= 4
    assert all(run["broken_energy"][-1] > 0 for run in broken)

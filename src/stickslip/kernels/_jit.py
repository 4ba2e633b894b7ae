"""The one place that knows how our kernels are compiled."""

from collections.abc import Callable
from typing import TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])


def jit(function: F) -> F:
    """Compile a kernel: without the GIL, cached on disk, numpy's rules for division by zero.

    ``parallel=True`` is never used: it aborts under threads and dies under fork; run cases in parallel instead.
    With ``NUMBA_DISABLE_JIT=1`` the plain Python function runs: the readable reference.
    """
    return cast(F, numba.njit(nogil=True, cache=True, error_model="numpy")(function))

"""The one place that knows how our kernels are compiled."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])
_njit: Any = numba.njit  # its stubs do not know _nrt


def jit(function: F) -> F:
    """Compile a kernel: without the GIL, cached on disk, numpy's rules for division by zero.

    ``parallel=True`` is never used: it aborts under threads and dies under fork; run cases in parallel instead.
    With ``NUMBA_DISABLE_JIT=1`` the plain Python function runs: the readable reference.
    """
    return cast(F, _njit(nogil=True, cache=True, error_model="numpy")(function))


def bare(function: F) -> F:
    """Compile a kernel that makes no array, without numba's reference counting.

    The arrays belong to the caller, who outlives the call. Small functions that hand arrays to one another spend most
    of their time on atomic counts otherwise: the event engine took 1,200 ns an event with them, 340 ns without.
    """
    return cast(F, _njit(nogil=True, cache=True, error_model="numpy", _nrt=False)(function))


def inlined(function: F) -> F:
    """Compile a small `bare` kernel into its callers: a call costs more than its work (340, then 120 ns an event)."""
    options = {"nogil": True, "cache": True, "error_model": "numpy", "_nrt": False, "forceinline": True}
    return cast(F, _njit(**options)(function))

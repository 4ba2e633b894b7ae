"""The one place that knows how our kernels are compiled, and where their machine
code is kept.
"""

import contextlib
import hashlib
import os
import re
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core.registry import CPUDispatcher
from numba.misc.appdirs import AppDirs

F = TypeVar("F", bound=Callable[..., object])
_numba: Any = numba  # its stubs know neither all of its settings nor all options
_folders: Any = AppDirs  # nor this

# folders of machine code that stay: a switch between two branches, and back, compiles
# nothing anew
_KEPT = 3


def _place() -> Path | None:
    """Return the folder of our machine code, which is named by a hash of all kernel
    files; none if none can be written.

    numba compares a function with its own file only: its code would outlive a change to
    what it calls in another file.
    """
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for file in sorted(here.glob("*.py")):
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    if given := _numba.config.CACHE_DIR:
        homes = [Path(given)]
    else:
        homes = [
            here / "__pycache__",
            Path(_folders("numba", appauthor=False).user_cache_dir),
        ]
    for home in homes:
        folder = home / f"kernels-{digest.hexdigest()[:16]}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            os.utime(folder)  # the last use, by which `_sweep` goes
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        _sweep(home)
        return folder
    return None


def _sweep(home: Path) -> None:
    """Remove the machine code of kernels as they once were, but for the folders used
    last.
    """
    folders = [
        folder
        for folder in home.glob("kernels-*")
        if re.fullmatch("kernels-[0-9a-f]{16}", folder.name)
    ]
    with contextlib.suppress(FileNotFoundError):  # another process sweeps, too
        folders.sort(key=lambda folder: folder.stat().st_mtime)
        for old in folders[:-_KEPT]:
            shutil.rmtree(old, ignore_errors=True)


_PLACE = None if _numba.config.DISABLE_JIT else _place()


def compiled_before() -> bool:
    """Whether machine code of these kernels is kept from an earlier run."""
    return _PLACE is not None and any(_PLACE.rglob("*.nbi"))


def _compiled(function: F, **options: bool) -> F:
    """Compile a kernel: without the GIL, numpy's rules for division by zero, machine
    code in our own folder.

    No kernel is handed to another as an argument: what numba would make for that is
    left out.
    """
    given = _numba.config.CACHE_DIR
    _numba.config.CACHE_DIR = str(_PLACE or "")
    options = {
        "nogil": True,
        "no_cfunc_wrapper": True,
        "cache": _PLACE is not None,
        **options,
    }
    try:
        return cast(F, _numba.njit(error_model="numpy", **options)(function))
    finally:
        _numba.config.CACHE_DIR = given


def jit(function: F) -> F:
    """Compile a kernel.

    ``parallel=True`` is never used: it aborts under threads and dies under fork; run
    cases in parallel instead. With ``NUMBA_DISABLE_JIT=1`` the plain Python function
    runs: the readable reference.
    """
    return _compiled(function)


def bare(function: F) -> F:
    """Compile a kernel that makes no array, without numba's reference counting.

    The arrays belong to the caller, who outlives the call. Small functions that hand
    arrays to one another spend most of their time on atomic counts otherwise: the event
    engine took 1,200 ns an event with them, 340 ns without.
    """
    return _compiled(function, _nrt=False)


class _Inlined(CPUDispatcher):
    """A kernel that other kernels call; what Python calls is the plain function."""

    def __call__(self, *args: Any) -> Any:
        return self.py_func(*args)


def inlined(function: F) -> F:
    """Compile a small `bare` kernel into its callers: a call costs more than its work
    (340, then 120 ns an event).

    It is not compiled for Python, too: to unpack a state of many arrays takes longer to
    compile than the kernel.
    """
    kernel: Any = _compiled(
        function, _nrt=False, forceinline=True, no_cpython_wrapper=True
    )
    if not _numba.config.DISABLE_JIT:
        kernel.__class__ = _Inlined
    return cast(F, kernel)

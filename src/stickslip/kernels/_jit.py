"""The one place that knows how our kernels are compiled, and where their machine
code is kept.
"""

import contextlib
import hashlib
import logging
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core.caching import FunctionCache
from numba.core.registry import CPUDispatcher
from numba.misc.appdirs import AppDirs

F = TypeVar("F", bound=Callable[..., object])
_numba: Any = numba  # its stubs know neither all of its settings nor all options
_folders: Any = AppDirs  # nor this
_FunctionCache: Any = FunctionCache

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
    name = f"kernels-{digest.hexdigest()[:16]}"
    if given := _numba.config.CACHE_DIR:
        homes = [Path(given)]
    else:
        homes = [
            here / "__pycache__",
            Path(_folders("numba", appauthor=False).user_cache_dir),
        ]
    for home in homes:
        # without a home, the user's folder is "~/.cache" below the working directory
        if (given or home.is_absolute()) and _is_usable(home / name):
            _sweep(home)
            return home / name
    return _temporary(name)


def _is_usable(folder: Path) -> bool:
    """Make a folder, and return whether files can be written to it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)  # the last use, by which `_sweep` goes
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def _temporary(name: str) -> Path | None:
    """Return a folder of this user alone among the temporary files; none if none can
    be had.

    Whoever can write there decides what code runs here: a folder of somebody else, or
    open to others, is not used.
    """
    home = Path(tempfile.gettempdir()) / f"stickslip-{os.getuid()}"
    try:
        home.mkdir(mode=0o700, exist_ok=True)
        found = home.lstat()
    except OSError:
        return None
    is_folder = stat.S_ISDIR(found.st_mode)
    if not is_folder or found.st_uid != os.getuid() or found.st_mode & 0o077:
        return None
    is_new = not (home / name).exists()
    if not _is_usable(home / name):
        return None
    _sweep(home)
    if is_new:
        logging.getLogger("stickslip").warning(
            "compiled code is kept in %s, which may not last; NUMBA_CACHE_DIR names "
            "another folder",
            home,
        )
    return home / name


def _sweep(home: Path) -> None:
    """Remove the machine code of kernels as they once were, but for the folders used
    last.
    """
    folders = [
        folder
        for folder in home.glob("kernels-*")
        if re.fullmatch("kernels-[0-9a-f]{16}", folder.name)
    ]
    with contextlib.suppress(FileNotFoundError):  # another process removed it
        folders.sort(key=lambda folder: folder.stat().st_mtime)
        for old in folders[:-_KEPT]:
            shutil.rmtree(old, ignore_errors=True)


_PLACE = None if _numba.config.DISABLE_JIT else _place()


def compiled_before() -> bool:
    """Whether machine code of these kernels is kept from an earlier run."""
    return _PLACE is not None and any(_PLACE.rglob("*.nbi"))


class _Cache(_FunctionCache):  # type: ignore[misc]
    """Machine code on disk; what cannot be read, such as a file that was cut, is
    removed and compiled anew.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # unpickling what is damaged raises nearly anything
            self.flush()  # write an empty index: new code is kept beside it
            return None


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
        kernel = _numba.njit(error_model="numpy", **options)(function)
        if options["cache"] and not _numba.config.DISABLE_JIT:
            kernel._cache = _Cache(function)
    finally:
        _numba.config.CACHE_DIR = given
    return cast(F, kernel)


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
        function,
        _nrt=False,
        forceinline=True,
        no_cpython_wrapper=True,
    )
    if not _numba.config.DISABLE_JIT:
        kernel.__class__ = _Inlined
    return cast(F, kernel)

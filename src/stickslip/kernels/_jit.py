"""Compilation of the kernels, and the folder of their machine code; no other module
deals with either.
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
_numba: Any = numba  # its stubs lack some settings and options
_folders: Any = AppDirs  # its stubs lack this class
_FunctionCache: Any = FunctionCache

# number of folders of machine code that are kept, so that switching between branches
# compiles nothing again
_KEPT = 3


def _place() -> Path | None:
    """Return the folder of our machine code, named by a hash of all kernel files; None
    if no folder can be written.

    numba compares a function only with its own file: its code would outlive a change of
    a function that it calls in another file.
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
        # in an environment without HOME, the user's folder would be relative
        if (given or home.is_absolute()) and _is_usable(home / name):
            _sweep(home)
            return home / name
    return _temporary(name)


def _is_usable(folder: Path) -> bool:
    """Make a folder, and return whether files can be written to it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)  # records the last use, for `_sweep`
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def _temporary(name: str) -> Path | None:
    """Return a folder of this user among the temporary files; None if there is none.

    Whoever can write there decides which code runs here, so a folder that belongs to
    another user, or is open to others, is not used.
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
    """Remove the machine code of earlier versions of the kernels, except in the folders
    used last.
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
    """Whether machine code of these kernels was kept by an earlier run."""
    return _PLACE is not None and any(_PLACE.rglob("*.nbi"))


class _Cache(_FunctionCache):  # type: ignore[misc]
    """Machine code on disk; a file that cannot be read, such as a truncated one, is
    removed and compiled again.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # unpickling damaged data raises nearly anything
            self.flush()  # write an empty index; new code is added to it
            return None


def _compiled(function: F, **options: bool) -> F:
    """Compile a kernel without the GIL, with numpy's rules for division by zero, and
    with machine code in our own folder.

    No kernel is passed to another as an argument, so the C wrapper for that is not
    made.
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

    ``parallel=True`` is never used, as it aborts under threads and dies under fork; run
    cases in parallel instead. With ``NUMBA_DISABLE_JIT=1`` the plain Python function
    runs, as the readable reference.
    """
    return _compiled(function)


def bare(function: F) -> F:
    """Compile a kernel that makes no array, without numba's reference counting.

    The arrays belong to the caller, which outlives the call. Otherwise small functions
    that pass arrays to each other spend most of their time on atomic counts: the event
    engine took 1,200 ns an event with them, 340 ns without.
    """
    return _compiled(function, _nrt=False)


class _Inlined(CPUDispatcher):
    """A kernel that other kernels call; Python calls get the plain function."""

    def __call__(self, *args: Any) -> Any:
        return self.py_func(*args)


def inlined(function: F) -> F:
    """Compile a small `bare` kernel into its callers, as a call costs more than its
    work (340 ns an event with calls, 120 ns without).

    No Python wrapper is compiled: unpacking a state of many arrays takes longer to
    compile than the kernel itself.
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

"""Disks that fail: the n-th system call that writes raises an error."""

import _sqlite3
import builtins
import ctypes
import errno
import io
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

ERRORS = (errno.ENOSPC, errno.EIO)

_CALLS = ("fsync", "fdatasync", "fchmod", "replace", "rename", "unlink", "write")
"""Calls of `os` that change files."""

_INT = ctypes.c_int
_SIZE = ctypes.c_ssize_t
_ANY = ctypes.c_void_p
_SQLITE = {
    "open": (_INT, ctypes.c_char_p, _INT, _INT),
    "write": (_SIZE, _INT, _ANY, ctypes.c_size_t),
    "pwrite": (_SIZE, _INT, _ANY, ctypes.c_size_t, ctypes.c_int64),
    "pwrite64": (_SIZE, _INT, _ANY, ctypes.c_size_t, ctypes.c_int64),
    "ftruncate": (_INT, _INT, ctypes.c_int64),
    "unlink": (_INT, ctypes.c_char_p),
    "openDirectory": (_INT, ctypes.c_char_p, _ANY),
}
"""System calls of sqlite that its file system `unix` lets a test replace."""


class Faults:
    """Count calls, of which the n-th fails, once."""

    def __init__(self, nth: int, code: int) -> None:
        self.nth = nth
        self.code = code
        self.calls: list[str] = []

    @property
    def failed(self) -> bool:
        """Whether the failing call was made."""
        return len(self.calls) >= self.nth

    def strikes(self, name: str) -> bool:
        """Count a call; return whether it is the one that fails."""
        self.calls.append(name)
        return len(self.calls) == self.nth

    def check(self, name: str) -> None:
        """Count a call; raise the error if it is the one that fails."""
        if self.strikes(name):
            raise OSError(self.code, os.strerror(self.code))


class _File:
    """A file opened for writing, whose calls may fail."""

    def __init__(self, file: Any, faults: Faults) -> None:
        self._file = file
        self._faults = faults

    def __enter__(self) -> "_File":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def write(self, content: Any) -> int:
        # only half is written, as on a full disk
        self._file.write(content[: len(content) // 2])
        self._faults.check("file.write")
        self._file.write(content[len(content) // 2 :])
        return len(content)

    def flush(self) -> None:
        self._faults.check("file.flush")
        self._file.flush()

    def close(self) -> None:
        is_open = not self._file.closed
        self._file.close()
        if is_open:
            self._faults.check("file.close")


@contextmanager
def failing(nth: int, code: int) -> Iterator[Faults]:
    """Make the n-th call fail that opens, writes, syncs, moves or removes a file."""
    faults = Faults(nth, code)
    opened = builtins.open

    def open_(file: Any, mode: str = "r", *more: Any, **options: Any) -> Any:
        if not set(mode) & set("wxa+"):
            return opened(file, mode, *more, **options)
        faults.check("open")
        return _File(opened(file, mode, *more, **options), faults)

    def counted(name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def wrapper(*arguments: Any, **options: Any) -> Any:
            faults.check(name)
            return call(*arguments, **options)

        return wrapper

    with pytest.MonkeyPatch.context() as patch:
        for name in _CALLS:
            patch.setattr(os, name, counted(name, getattr(os, name)))
        patch.setattr(builtins, "open", open_)
        patch.setattr(io, "open", open_)
        yield faults


class _Vfs(ctypes.Structure):
    """`sqlite3_vfs`, version 3."""

    _fields_ = [
        ("version", _INT),
        ("file_size", _INT),
        ("longest", _INT),
        ("next", _ANY),
        ("name", ctypes.c_char_p),
        ("data", _ANY),
        ("methods", _ANY * 13),
        ("set_call", ctypes.CFUNCTYPE(_INT, _ANY, ctypes.c_char_p, _ANY)),
        ("get_call", ctypes.CFUNCTYPE(_ANY, _ANY, ctypes.c_char_p)),
    ]


def sqlite_files() -> Any:
    """Return the file system of Python's sqlite, if it is available."""
    try:
        find = ctypes.CDLL(_sqlite3.__file__).sqlite3_vfs_find
    except (AttributeError, OSError):  # built into Python
        return None
    find.restype = ctypes.POINTER(_Vfs)
    found = find(b"unix")
    return found if found and found.contents.version >= 3 else None


@contextmanager
def failing_sqlite(nth: int, code: int) -> Iterator[Faults]:
    """Make the n-th call fail that opens, writes, cuts or removes a file in sqlite."""
    faults = Faults(nth, code)
    place = sqlite_files()
    files = place.contents
    kept = []  # C calls these: they must not be collected

    def counted(name: str, kind: Any, call: Callable[..., int]) -> Any:
        def wrapper(*arguments: Any) -> int:
            if faults.strikes(name):
                ctypes.set_errno(code)
                return -1
            return call(*arguments)

        return kind(wrapper)

    try:
        for name, types in _SQLITE.items():
            kind = ctypes.CFUNCTYPE(*types, use_errno=True)
            address = files.get_call(place, name.encode())
            if address:
                kept.append(counted(name, kind, kind(address)))
                by = ctypes.cast(kept[-1], _ANY)
                assert files.set_call(place, name.encode(), by) == 0
        yield faults
    finally:
        for name in _SQLITE:
            files.set_call(place, name.encode(), None)  # restore its own call

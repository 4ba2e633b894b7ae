"""Files: read only if regular and of a size to bear; written whole or not at all, and never over anything else.

A symbolic link is followed, for reading and for writing: the link stays, and the file that it leads to is replaced.
"""

import os
import secrets
import stat
from pathlib import Path

from stickslip.errors import InputError, instance

_KINDS = {
    stat.S_IFDIR: "a directory",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
}


def size(path: str | os.PathLike[str], kind: str, *, largest: int) -> int:
    """Return how many bytes a regular file has, at most `largest`; `kind` names it in errors: ``"rig file"``."""
    instance("path", path, (str, os.PathLike), "the name of a file")
    try:
        found = os.stat(path)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise _failed(path, "read", error) from None
    if not stat.S_ISREG(found.st_mode):
        raise InputError(f"{path}: is {_KINDS[stat.S_IFMT(found.st_mode)]}, not a {kind}")
    if found.st_size > largest:
        most = f"{largest / 1e6:g} MB"
        raise InputError(f"{path}: has {found.st_size / 1e6:.3g} MB, more than a {kind} may have ({most})")
    return found.st_size


def read(path: str | os.PathLike[str], kind: str, *, largest: int) -> bytes:
    """Return the content of a file; arguments and errors are those of `size`."""
    if size(path, kind, largest=largest) == 0:  # the kernel's own files have no size, and some have no end
        return b""
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise _failed(path, "read", error) from None


def _failed(path: str | os.PathLike[str], done: str, error: OSError | ValueError, remedy: str = "") -> InputError:
    return InputError(f"{path}: cannot be {done} ({getattr(error, 'strerror', None) or error}){remedy}")


def target(path: str | os.PathLike[str]) -> Path:
    """Return where a file is to be written: a free name, or a regular file that may be replaced; links are followed."""
    instance("path", path, (str, os.PathLike), "the name of a file")
    try:
        place = Path(os.path.realpath(path))
        found = place.stat()
    except FileNotFoundError:
        if not place.parent.is_dir():
            raise InputError(f"{path}: there is no directory {place.parent}; make it first") from None
        found = None
    except (OSError, ValueError) as error:
        raise _failed(path, "written", error, "; nothing was lost, choose another place") from None
    kind = stat.S_IFREG if found is None else stat.S_IFMT(found.st_mode)
    if kind == stat.S_IFDIR:
        raise InputError(f"{path}: is a directory; give the name of a file")
    if kind != stat.S_IFREG:
        raise InputError(f"{path}: is {_KINDS[kind]}; only a file is replaced, choose another name")
    # The system lets root write anywhere: what its owner may not write is meant to stay.
    if found is not None and not (found.st_mode & stat.S_IWUSR and os.access(place, os.W_OK)):
        raise InputError(f"{path}: is read-only; choose another name, or make it writable first")
    if not os.access(place.parent, os.W_OK | os.X_OK):
        raise InputError(f"{path}: cannot be written ({place.parent} is read-only); choose another place")
    return place


def write(path: str | os.PathLike[str], content: bytes | memoryview) -> Path:
    """Write a file whole or not at all: beside its place and moved there, with the permissions of the one before."""
    place = target(path)
    try:
        part = place.parent / f".stickslip-{secrets.token_hex(8)}.part"
        try:
            with part.open("xb") as file:  # with the permissions of any new file
                if place.exists():
                    os.fchmod(file.fileno(), stat.S_IMODE(place.stat().st_mode))
                file.write(content)
                file.flush()
                os.fsync(file.fileno())  # a disk that is full may say so only now
            part.replace(place)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise _failed(path, "written", error, "; nothing was lost, choose another place") from None
    return Path(path)

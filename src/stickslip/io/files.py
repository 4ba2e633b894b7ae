"""Safe reading of files, and atomic writing.

Symbolic links are followed, for reading and for writing: the link stays, and the file
to which it leads is replaced.
"""

import difflib
import errno
import gzip
import os
import secrets
import stat
import zlib
from contextlib import suppress
from pathlib import Path

from stickslip.errors import InputError, instance

FileName = str | os.PathLike[str]
_KINDS = {
    "d": "a directory",
    "c": "a device",
    "b": "a device",
    "p": "a named pipe",
    "s": "a socket",
}
"""Files that are not regular, by the first letter of `stat.filemode`."""
_GZIP = b"\x1f\x8b"
_REMEDIES = {
    errno.EACCES: "ask its owner, or make it and its folders accessible (chmod)",
    errno.EPERM: "ask its owner, or make it and its folders accessible (chmod)",
    errno.ENOSPC: "free some space, or choose another place",
    errno.EDQUOT: "free some space, or choose another place",
    errno.ELOOP: "name the file that the links should lead to",
}
"""Remedies of errors of the operating system, by their number."""
_OF_WRITING = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF}


def as_path(path: FileName | None, place: str = "path") -> Path:
    """Return the path of a file; `InputError` if it is no name."""
    instance(place, path, (str, os.PathLike), "the name of a file")
    assert path is not None
    return Path(path)


def check_suffix(path: FileName | None, what: str, suffix: str) -> None:
    """Raise `InputError` if a file would be written under the suffix of another
    kind.
    """
    if path is None:
        return
    place = as_path(path)
    if place.suffix not in ("", suffix):
        name = place.with_suffix(suffix).name
        raise InputError(f"{path}: {what} is written as {suffix}; name it {name}")


def size(path: FileName, kind: str, *, largest: int) -> int:
    """Return the size in bytes of a regular file; `InputError` if it exceeds `largest`.

    `kind` names the file in errors, such as ``"rig file"``.
    """
    found = _regular(path, "read", kind)
    if found is None:
        raise InputError(f"{path}: no such file{_nearest_name(Path(path))}")
    if found.st_size > largest:
        most = f"{largest / 1e6:g} MB"
        raise InputError(
            f"{path}: has {found.st_size / 1e6:.3g} MB, more than a {kind} may have "
            f"({most})"
        )
    return found.st_size


def _nearest_name(path: Path) -> str:
    """Return a hint at the file with the name nearest to that of a missing one."""
    if path.is_symlink():
        return f"; it is a link to {os.readlink(path)}, which is not there"
    with suppress(OSError):
        names = [file.name for file in path.parent.iterdir()]
        near = difflib.get_close_matches(path.name, names, n=1, cutoff=0.8)
        if near:
            return f"; did you mean {near[0]!r}?"
    return ""


def read(path: FileName, kind: str, *, largest: int) -> bytes:
    """Return the content of a file, unpacked if it is packed by gzip; arguments and
    errors are those of `size`.
    """
    # files of /proc and the like have no size, and some have no end
    if size(path, kind, largest=largest) == 0:
        return b""
    try:
        content = Path(path).read_bytes()
        if content.startswith(_GZIP):
            with gzip.open(path) as packed:
                content = packed.read(largest + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise _failed(path, "read", error) from None
    if len(content) > largest:
        raise InputError(
            f"{path}: unpacks to more than a {kind} may have ({largest / 1e6:g} MB)"
        )
    return content


def begin(path: FileName, count: int) -> bytes:
    """Return the first bytes of a file."""
    try:
        with open(path, "rb") as file:
            return file.read(count)
    except OSError as error:
        raise _failed(path, "read", error) from None


def _regular(path: FileName, done: str, kind: str) -> os.stat_result | None:
    """Return the status of a regular file, following links; None if there is no such
    file.
    """
    try:
        found = os.stat(as_path(path))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise _failed(path, done, error) from None
    if not stat.S_ISREG(found.st_mode):
        raise InputError(
            f"{path}: is {_KINDS[stat.filemode(found.st_mode)[0]]}, not a {kind}"
        )
    return found


def _failed(path: FileName, done: str, error: Exception) -> InputError:
    kept = "; nothing was lost" if done == "written" else ""
    return InputError(f"{path}: cannot be {done} ({_why(error)}){_remedy(error)}{kept}")


def _why(error: Exception) -> object:
    return getattr(error, "strerror", None) or error


def _remedy(error: Exception) -> str:
    remedy = _REMEDIES.get(getattr(error, "errno", None) or 0)
    return f"; {remedy}" if remedy else ""


def in_words(error: OSError) -> str:
    """Describe an error of the operating system: its place, reason, and remedy."""
    try:
        os.getcwd()
    except FileNotFoundError:
        return "the working directory no longer exists; change to another (cd)"
    place = "the system: this cannot be done"
    if error.filename is not None:
        place = f"{error.filename}: cannot be used"
    elif error.errno in _OF_WRITING:  # files that we write are named in the error
        place = "standard output: cannot be written"
    return f"{place} ({_why(error)}){_remedy(error)}"


def target(path: FileName) -> Path:
    """Return the path, with links followed, at which a file can be written: of no file,
    or of a regular file that may be replaced; else `InputError`.
    """
    found = _regular(path, "written", "file")
    place = Path(os.path.realpath(path))
    if not place.parent.is_dir():
        raise InputError(f"{path}: there is no directory {place.parent}; make it first")
    # Root may write any file, but one that its owner may not write is left alone.
    own = found is None or (found.st_mode & stat.S_IWUSR and os.access(place, os.W_OK))
    if not (own and os.access(place.parent, os.W_OK | os.X_OK)):
        closed = place.parent if own else place
        raise InputError(
            f"{path}: {closed} is read-only; choose another place, or make it writable "
            "first"
        )
    return place


def write(path: FileName, content: bytes | memoryview) -> Path:
    """Write a file completely or not at all: under a temporary name in its directory,
    and then renamed, with the permissions of the file that it replaces.
    """
    place = target(path)
    try:
        part = place.parent / f".stickslip-{secrets.token_hex(8)}.part"
        try:
            with part.open("xb") as file:  # with the permissions of any new file
                if place.exists():
                    os.fchmod(file.fileno(), stat.S_IMODE(place.stat().st_mode))
                file.write(content)
                file.flush()
                os.fsync(file.fileno())  # may be the first to report a full disk
            part.replace(place)
        except BaseException:
            with suppress(OSError):  # so that the first error is reported
                part.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise _failed(path, "written", error) from None
    return Path(path)

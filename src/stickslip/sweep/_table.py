"""The store of a sweep: one sqlite table, a row for each finished case, each with a checksum.

::

    CREATE TABLE cases (key TEXT PRIMARY KEY, row TEXT, checksum TEXT) WITHOUT ROWID

A key is the values of the axes as JSON, a row is ``{"result": {...}}`` or ``{"error": "..."}``. The row with the empty
key is the head: what the sweep is made of. Transactions of sqlite (rollback journal, no write-ahead log: network file
systems will do) leave every commit whole after a kill; the checksums tell what a disk has changed since.

Only the process that drives a sweep writes, and holds a lock on ``<store>.lock`` as long as it does; the lock goes with
the process, however it ends. Anybody may read meanwhile.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import json
import os
import socket
import sqlite3
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

from stickslip.errors import InputError, instance

FORMAT = 0x5354534C  # "STSL"
EVERY = 1.0
"""Seconds between commits: what a kill can cost, together with the batches in flight."""
PATIENCE = 60.0
"""Seconds that a commit waits for those who read."""

_HEAD = ""
_ERROR = '{"error"'


class Table:
    """What is known of the cases of a sweep; in memory if it has no path."""

    def __init__(self, path: Path | None, head: Mapping[str, Any] | None = None, *, weigh: bool = True) -> None:
        self.path = path
        self.keys: set[str] = set()
        self.failed: set[str] = set()
        self.head: dict[str, Any] = dict(head or {})
        self._stored: dict[str, Any] = {}
        self._begun: float | None = None  # when the transaction that is open was begun
        self._held = ExitStack()
        self._writing = False
        self._connection = sqlite3.connect(":memory:", isolation_level=None)
        try:
            if path is None:
                self._create()
            elif _is_there(path):
                self._read(weigh)
            elif not self.head:
                raise InputError(f"store = {str(path)!r}: there is no such file")
        except BaseException:
            self._connection.close()
            raise

    def __enter__(self) -> Table:
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()
        self._held.close()

    def claim(self) -> None:
        """Become the one who writes."""
        if self._writing or self.path is None:
            return
        self._held.enter_context(_locked(self.path))
        there = _is_there(self.path)
        if there:  # read again: another may have written before the lock was ours
            self._read(weigh=True)
        self.head |= {"started": time.time(), "found": len(self.keys)}
        if there:
            self.add(_HEAD, json.dumps(self.head))
            self.commit()
        else:
            with _in_one_line(self.path):
                self._connection.close()
                self._connection = _connect(self.path, "rwc")
            self._create()
        self._writing = True

    def keep_head(self, **more: Any) -> None:
        """Write down the head, with what is known more by now, unless it stands there."""
        self.head |= more
        mine, theirs = ({**head, "started": 0, "found": 0} for head in (self.head, self._stored))
        if self.path is not None and json.loads(json.dumps(mine)) != theirs:
            self.claim()
            self.add(_HEAD, json.dumps(self.head))
            self.commit()

    def forget_failed(self) -> None:
        """Take failed cases for not run; their rows stay until others replace them."""
        if self.failed:
            self.claim()
        self.keys -= self.failed
        self.failed.clear()

    def add(self, key: str, row: str) -> None:
        """Note what came of a case; it is on the disk after the next commit."""
        with _in_one_line(self.path):
            if self._begun is None:
                self._connection.execute("BEGIN IMMEDIATE")
                self._begun = time.monotonic()
            self._connection.execute("INSERT OR REPLACE INTO cases VALUES (?, ?, ?)", (key, row, _checksum(key, row)))
        self._note(key, row.startswith(_ERROR))

    def get(self, key: str) -> dict[str, Any]:
        """What came of a case."""
        with _in_one_line(self.path):
            (row,) = self._connection.execute("SELECT row FROM cases WHERE key = ?", (key,)).fetchone()
            return dict(json.loads(row))

    def rows(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """All that is known, in the order of the keys."""
        with _in_one_line(self.path):
            for key, row in self._connection.execute("SELECT key, row FROM cases WHERE key > '' ORDER BY key"):
                yield key, json.loads(row)

    def until_commit(self) -> float | None:
        """Seconds until the next commit is due; None if there is nothing to commit."""
        return None if self._begun is None else max(0.0, self._begun + EVERY - time.monotonic())

    def commit(self) -> None:
        """Write down what was added."""
        if self._begun is not None:
            self._begun = None
            with _in_one_line(self.path):
                try:
                    self._connection.execute("COMMIT")
                except BaseException:
                    with suppress(sqlite3.Error):
                        self._connection.execute("ROLLBACK")
                    raise

    def _create(self) -> None:
        """Make a table with nothing but its head, whole or not at all."""
        with _in_one_line(self.path):
            self._connection.execute("BEGIN IMMEDIATE")
            self._begun = time.monotonic()
            self._connection.execute(f"PRAGMA application_id = {FORMAT}")
            self._connection.execute(
                "CREATE TABLE cases (key TEXT PRIMARY KEY, row TEXT NOT NULL, checksum TEXT NOT NULL) WITHOUT ROWID"
            )
        self.add(_HEAD, json.dumps(self.head))
        self.commit()

    def _note(self, key: str, failed: bool) -> None:
        if key != _HEAD:
            self.keys.add(key)
            (self.failed.add if failed else self.failed.discard)(key)

    def _read(self, weigh: bool) -> None:
        """Open the file; a table that lost or changed anything, or is of another sweep, is refused."""
        path = self.path
        assert path is not None
        self._connection.close()
        with _in_one_line(path):
            connection = self._connection = _connect(path, "rw")
            (form,) = connection.execute("PRAGMA application_id").fetchone()
            if form != FORMAT:
                raise InputError(f"store = {str(path)!r}: is not the store of a sweep; choose another")
            connection.execute("BEGIN")  # one state of the table, whoever writes meanwhile
            head = connection.execute("SELECT row FROM cases WHERE key = ''").fetchone()
            if head is None:
                raise _damaged(path, "its head is missing")
            self._stored = json.loads(head[0])
            if weigh:
                _weigh(path, connection)
            for key, failed in connection.execute(
                f"SELECT key, substr(row, 1, {len(_ERROR)}) = ? FROM cases", (_ERROR,)
            ):
                self._note(key, bool(failed))
            connection.execute("COMMIT")
            if self.head:
                _check_identity(path, self._stored["identity"], self.head["identity"])
            else:
                self.head = self._stored


def _weigh(path: Path, connection: sqlite3.Connection) -> None:
    """Hold every page and row of a table against its checksum."""
    (health,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
    if health != "ok":
        raise _damaged(path, str(health).splitlines()[-1])
    for key, row, checksum in connection.execute("SELECT key, row, checksum FROM cases"):
        if checksum != _checksum(key, row):
            raise _damaged(path, "a row is not what was written")


def is_store(path: str | os.PathLike[str]) -> bool:
    """Whether a path looks like a store, whole or not: a file of sqlite."""
    instance("path", path, (str, os.PathLike), "the name of a file")
    try:
        with Path(path).open("rb") as file:
            return file.read(15) == b"SQLite format 3"
    except OSError:
        return False


def writer_of(path: Path) -> str | None:
    """Who is writing a store, in words; None if nobody is."""
    lock = _lock_of(path)
    try:
        with lock.open() as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return _owner(lock)
    except OSError:
        return None
    return None


# ---------------------------------------------------------------- parts


def _is_there(path: Path) -> bool:
    """Whether there is a file at a path, or nothing; a file without a page is one whose making was cut short."""
    with _in_one_line(path):
        if not path.exists():
            return False
        if not path.is_file():
            raise InputError(f"store = {str(path)!r}: is no regular file; choose another store")
        return path.stat().st_size > 0


def _connect(path: Path, mode: str) -> sqlite3.Connection:
    if mode == "rwc":
        path.absolute().parent.mkdir(parents=True, exist_ok=True)
    return sqlite3.connect(
        f"file:{quote(str(path.absolute()))}?mode={mode}", uri=True, isolation_level=None, timeout=PATIENCE
    )


def _checksum(key: str, row: str) -> str:
    return hashlib.blake2b(f"{key}\n{row}".encode(), digest_size=8).hexdigest()


def _check_identity(path: Path, there: Mapping[str, str], here: Mapping[str, str]) -> None:
    differs = [part for part in here if there.get(part) != here[part]] + [part for part in there if part not in here]
    if differs:
        shown = ", ".join(differs[:4]) + (f" and {len(differs) - 4} more" if len(differs) > 4 else "")
        raise InputError(
            f"store = {str(path)!r}: holds another sweep; what differs: {shown}. Choose another store, or delete this "
            "one to start afresh"
        )


def _damaged(path: Path, how: str) -> InputError:
    short = " ".join(how.split())[:100]  # sqlite quotes what it stumbled over, line ends included
    return InputError(
        f"store = {str(path)!r}: is damaged ({short}): what it holds cannot be trusted; put back a copy of it, or "
        "delete it to start afresh"
    )


@contextmanager
def _in_one_line(path: Path | None) -> Iterator[None]:
    """Say in one line what went wrong with a file."""
    try:
        yield
    except InputError:
        raise
    except (sqlite3.Error, OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        if path is None:
            raise
        raise _refusal(path, error) from error


_REMEDIES = {
    ("SQLITE_FULL", "SQLITE_IOERR", "ENOSPC", "EDQUOT", "EFBIG"): "free some space and start again",
    ("SQLITE_BUSY", "SQLITE_LOCKED"): "another program reads it or holds it; start again when it is done",
    ("",): "make it writable or choose another place",
}
"""What to do about errors, by the beginnings of their names."""


def _refusal(path: Path, error: Exception) -> InputError:
    code = getattr(error, "sqlite_errorname", errno.errorcode.get(getattr(error, "errno", None) or 0, ""))
    if code == "SQLITE_NOTADB":
        return InputError(
            f"store = {str(path)!r}: is not the store of a sweep, or its beginning is damaged; choose another"
        )
    of_the_disk = isinstance(error, sqlite3.OperationalError) and code not in ("", "SQLITE_ERROR")  # no such table
    if not (of_the_disk or isinstance(error, OSError)):
        return _damaged(path, str(error) if isinstance(error, sqlite3.Error) else f"{type(error).__name__}: {error}")
    reason = error.strerror if isinstance(error, OSError) else str(error)
    remedy = next(remedy for names, remedy in _REMEDIES.items() if code.startswith(names))
    return InputError(f"store = {str(path)!r}: cannot be written ({reason}); what was written is kept: {remedy}")


def _lock_of(path: Path) -> Path:
    return path.with_name(path.name + ".lock")


def _owner(lock: Path) -> str:
    with suppress(OSError):
        return lock.read_text(errors="replace")[:100] or "another process"
    return "another process"


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold the lock of a store; the kernel takes it back when the process ends."""
    lock = _lock_of(path)
    with _in_one_line(path):
        lock.absolute().parent.mkdir(parents=True, exist_ok=True)
        file = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            mine = lock.exists() and os.fstat(file).st_ino == lock.stat().st_ino  # the last one may have removed it
        except BlockingIOError:
            mine = False
        except OSError as error:
            raise InputError(
                f"store = {str(path)!r}: this file system has no locks ({error.strerror}); choose another place"
            ) from None
        if not mine:
            raise InputError(
                f"store = {str(path)!r}: another sweep ({_owner(lock)}) is writing it; choose another store"
            )
        try:
            with _in_one_line(path):
                os.ftruncate(file, 0)
                os.write(file, f"process {os.getpid()} on {socket.gethostname()}".encode())
            yield
        finally:
            with suppress(OSError):
                lock.unlink()
    finally:
        os.close(file)

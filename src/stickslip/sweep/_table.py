"""The store of a sweep: one sqlite table with a row of JSON, and a checksum, for each
finished case.

The row with the empty key is the head: the description of the sweep. Transactions (with
a rollback journal, not a write-ahead log, so that network file systems work) leave
every commit complete after a kill; checksums reveal later changes on the disk.

Only the process that drives a sweep writes, and holds a lock on ``<store>.lock``, which
is released when the process ends in any way. Others may read meanwhile.
"""

import fcntl
import hashlib
import json
import math
import os
import socket
import sqlite3
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from typing import Any

from stickslip.errors import InputError
from stickslip.io.files import FileName, as_path

FORMAT = 0x53545332  # "STS2"
# seconds between commits: a kill can lose this much work, and the batches in flight
EVERY = 1.0
PATIENCE = 60.0  # seconds that a commit waits for readers

_HEAD = ""
_CASES = (
    "CREATE TABLE cases (key TEXT PRIMARY KEY, row TEXT NOT NULL, checksum TEXT NOT "
    "NULL) WITHOUT ROWID"
)


class Store:
    """Results of the cases of a sweep, as JSON by their keys; in memory if it has no
    path.

    With a head, the description of the sweep, it is opened for writing.
    """

    def __init__(
        self, store: FileName | None, head: Mapping[str, Any] | None = None
    ) -> None:
        path = None
        if store is not None or head is None:
            path = as_path(store, "store")
        self.path = path
        self.rows: dict[str, str] = {}
        self.head: dict[str, Any] = json.loads(json.dumps(head or {}, default=str))
        self._due = math.inf  # time at which added rows are to be committed
        with _in_one_line(path), ExitStack() as held:
            if path is not None and head is not None:
                held.enter_context(_locked(path))
            self._connection = held.enter_context(
                closing(_opened(path, new=head is not None))
            )
            tables = "SELECT count(*) FROM sqlite_master"
            # no table if its creation was interrupted, and rolled back
            if self._value_of(tables):
                self._read()
            elif head is None:
                raise InputError("holds no case yet")
            else:
                # created in one transaction with its head, or not at all
                self._connection.execute("BEGIN IMMEDIATE")
                self._connection.execute(f"PRAGMA application_id = {FORMAT}")
                self._connection.execute(_CASES)
            if head is not None:
                self.write_head()
            self._held = held.pop_all()

    def close(self) -> None:
        """Close the store, and release its lock."""
        with _in_one_line(self.path):
            self._held.close()

    def row(self, key: str) -> dict[str, Any]:
        """Return the ``result`` or the ``error`` of a case; neither if it never ran."""
        found: dict[str, Any] = json.loads(self.rows.get(key, "{}"))
        return found

    def has_failed(self, key: str) -> bool:
        """Whether a finished case has ended with an error."""
        return self.rows[key].startswith('{"error"')

    def forget_failed(self) -> None:
        """Let failed cases be run again; on the disk their rows stay until they are
        replaced.
        """
        for key in [key for key in self.rows if self.has_failed(key)]:
            del self.rows[key]

    def add(self, key: str, row: str) -> None:
        """Add the result of a case; it is on the disk after the next commit."""
        self.rows[key] = row
        self._write(key, row)

    def write_head(self, **more: Any) -> None:
        """Write the description of the sweep, with additions."""
        self.head |= more
        self._write(_HEAD, json.dumps(self.head))
        self.commit()

    def commit(self, *, if_due: bool = False) -> bool:
        """Commit added rows or, with `if_due`, only if the oldest is older than
        `EVERY`; return whether it was done.
        """
        if if_due and time.monotonic() < self._due:
            return False
        self._due = math.inf
        with _in_one_line(self.path):
            self._connection.commit()
        return True

    def _write(self, key: str, row: str) -> None:
        self._due = min(self._due, time.monotonic() + EVERY)
        with _in_one_line(self.path):
            self._connection.execute(
                "INSERT OR REPLACE INTO cases VALUES (?, ?, ?)",
                (key, row, _checksum(key, row)),
            )

    def _value_of(self, question: str) -> Any:
        return self._connection.execute(question).fetchone()[0]

    def _read(self) -> None:
        """Read all rows; a table that was changed or damaged, or belongs to another
        sweep, is refused.
        """
        if self._value_of("PRAGMA application_id") != FORMAT:
            raise InputError("is not the store of a sweep; choose another")
        for key, row, checksum in self._connection.execute(
            "SELECT key, row, checksum FROM cases"
        ):
            if checksum != _checksum(key, row):
                raise ValueError("a row is not what was written")
            self.rows[key] = row
        stored = json.loads(self.rows.pop(_HEAD))
        there = stored["identity"]
        here = self.head.get("identity", there)
        if differs := [
            part for part in {**here, **there} if there.get(part) != here.get(part)
        ]:
            raise InputError(
                f"holds another sweep; what differs: {', '.join(differs)}. Choose "
                "another store, or delete this one to start afresh"
            )
        self.head = self.head or stored


def _opened(path: Path | None, *, new: bool) -> sqlite3.Connection:
    """Open a store, in memory if it has no path; create it only if `new`."""
    place = ":memory:" if path is None else path.absolute()
    if isinstance(place, Path):
        if not (new or place.exists()):
            raise InputError("there is no such file")
        if place.exists() and not place.is_file():
            raise InputError("is no regular file; choose another store")
    return sqlite3.connect(place, isolation_level="IMMEDIATE", timeout=PATIENCE)


def is_store(path: FileName) -> bool:
    """Whether a path looks like a store, damaged or not: a file of sqlite."""
    try:
        with as_path(path, "store").open("rb") as file:
            return file.read(15) == b"SQLite format 3"
    except OSError:
        return False


def writer_of(path: FileName) -> str | None:
    """Return the process that writes a store, as text; None if there is none."""
    lock = _lock_of(Path(path))
    with suppress(OSError), open(lock, errors="replace") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return file.read(100) or "another process"
    return None


def _checksum(key: str, row: str) -> str:
    return hashlib.blake2b(f"{key}\n{row}".encode(), digest_size=8).hexdigest()


@contextmanager
def _in_one_line(path: Path | None) -> Iterator[None]:
    """Turn the errors of a file into one line each that names the file."""
    place = f"store = {str(path)!r}"
    try:
        yield
    except InputError as error:
        raise error.at(place) from None
    except Exception as error:  # a damaged file fails in many ways
        code = getattr(error, "sqlite_errorname", "")
        # "no such table" has the code of an operation, SQLITE_ERROR
        unwritten = (OSError, sqlite3.OperationalError)
        if code == "SQLITE_NOTADB":
            words = (
                "is not the store of a sweep, or its beginning is damaged; choose "
                "another"
            )
        elif isinstance(error, unwritten) and code != "SQLITE_ERROR":
            words = (
                f"cannot be written ({getattr(error, 'strerror', None) or error}); "
                "what was written is kept: free some "
                "space, make it writable or choose another place, and start again"
            )
        else:
            # sqlite quotes the damaged content, including line ends
            short = " ".join(str(error).split())[:100]
            words = (
                f"is damaged ({short}): what it holds cannot be trusted; put back a "
                "copy of it, or delete it to start "
                "afresh"
            )
        raise InputError(f"{place}: {words}", place) from error


def _lock_of(path: Path) -> Path:
    place = path.resolve()  # a store and a link to it share one lock
    return place.with_name(place.name + ".lock")


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold the lock of a store; the system releases it when the process ends."""
    lock = _lock_of(path)
    lock.absolute().parent.mkdir(parents=True, exist_ok=True)
    with open(lock, "a") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f"another sweep ({writer_of(path)}) is writing it; choose another store"
            ) from None
        try:
            file.truncate(0)
            file.write(f"process {os.getpid()} on {socket.gethostname()}")
            file.flush()
            yield
        finally:
            with suppress(OSError):  # a lock file that is left behind holds no lock
                lock.unlink(missing_ok=True)

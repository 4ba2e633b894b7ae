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

import fcntl
import hashlib
import json
import os
import socket
import sqlite3
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote

from stickslip.errors import InputError, instance

FORMAT = 0x5354534C  # "STSL"
EVERY = 1.0
"""Seconds between commits: what a kill can cost, together with the batches in flight."""
PATIENCE = 60.0
"""Seconds that a commit waits for those who read."""

Row = Mapping[str, Any]
"""What came of a case: its ``result``, or its ``error``."""

_HEAD = ""
_ERROR = '{"error"'


class Table:
    """What came of the cases of a sweep; in memory if it has no path.

    `known` says of the key of each case that has finished whether it failed.
    """

    def __init__(self, path: Path | None, head: Mapping[str, Any] | None = None, *, weigh: bool = True) -> None:
        self.path = path
        self.known: dict[str, bool] = {}
        self.head: dict[str, Any] = dict(head or {})
        self._stored = ""
        self._due = 0.0  # when what was added is to be committed
        self._writing = path is None
        self._held = ExitStack()
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
        self.head |= {"started": time.time(), "found": len(self.known)}
        if there:
            self._write_head()
        else:
            self._connect("rwc")
            self._create()
        self._writing = True

    def keep_head(self, **more: Any) -> None:
        """Write down what the sweep is made of, with what is known by now, unless it stands there."""
        self.head |= more
        if self._text() != self._stored:
            self.claim()
            self._write_head()

    def forget_failed(self) -> None:
        """Take failed cases for not run; their rows stay until others replace them."""
        if any(self.known.values()):
            self.claim()
            self.known = {key: False for key, failed in self.known.items() if not failed}

    def add(self, key: str, row: str) -> None:
        """Note what came of a case; it is on the disk after the next commit."""
        with _in_one_line(self.path):
            if not self._connection.in_transaction:
                self._connection.execute("BEGIN IMMEDIATE")
                self._due = time.monotonic() + EVERY
            self._connection.execute("INSERT OR REPLACE INTO cases VALUES (?, ?, ?)", (key, row, _checksum(key, row)))
        if key != _HEAD:
            self.known[key] = row.startswith(_ERROR)

    def get(self, key: str) -> Row:
        """What came of a case."""
        with _in_one_line(self.path):
            (row,) = self._connection.execute("SELECT row FROM cases WHERE key = ?", (key,)).fetchone()
            return dict(json.loads(row))

    def rows(self) -> dict[str, Row]:
        """What came of all cases."""
        with _in_one_line(self.path):
            found = self._connection.execute("SELECT key, row FROM cases WHERE key > ''")
            return {key: json.loads(row) for key, row in found}

    def commit(self, *, if_due: bool = False) -> bool:
        """Write down what was added, or, `if_due`, what was added a while ago; say whether that was done."""
        if if_due and not (self._connection.in_transaction and time.monotonic() >= self._due):
            return False
        with _in_one_line(self.path):
            self._connection.commit()
        return True

    def _connect(self, mode: str) -> None:
        assert self.path is not None
        self._connection.close()
        with _in_one_line(self.path):
            place = f"file:{quote(str(self.path.absolute()))}?mode={mode}"
            self._connection = sqlite3.connect(place, uri=True, isolation_level=None, timeout=PATIENCE)

    def _create(self) -> None:
        """Make a table with nothing but its head, whole or not at all."""
        with _in_one_line(self.path):
            self._connection.execute("BEGIN IMMEDIATE")
            self._connection.execute(f"PRAGMA application_id = {FORMAT}")
            self._connection.execute(
                "CREATE TABLE cases (key TEXT PRIMARY KEY, row TEXT NOT NULL, checksum TEXT NOT NULL) WITHOUT ROWID"
            )
        self._write_head()

    def _text(self) -> str:
        return json.dumps(self.head)

    def _write_head(self) -> None:
        self._stored = self._text()
        self.add(_HEAD, self._stored)
        self.commit()

    def _read(self, weigh: bool) -> None:
        """Open the file; a table that lost or changed anything, or is of another sweep, is refused."""
        path = self.path
        assert path is not None
        self._connect("rw")
        self.known, self._stored = {}, ""
        with _in_one_line(path):
            connection = self._connection
            (form,) = connection.execute("PRAGMA application_id").fetchone()
            if form != FORMAT:
                raise InputError(f"store = {str(path)!r}: is not the store of a sweep; choose another")
            connection.execute("BEGIN")  # one state of the table, whoever writes meanwhile
            (health,) = connection.execute("PRAGMA integrity_check(1)").fetchone() if weigh else ("ok",)
            if health != "ok":
                raise _damaged(path, str(health).splitlines()[-1])
            for key, row, checksum in connection.execute("SELECT key, row, checksum FROM cases"):
                if row is None or (weigh and checksum != _checksum(key, row)):
                    raise _damaged(path, "a row is not what was written")
                if key == _HEAD:
                    self._stored = row
                else:
                    self.known[key] = row.startswith(_ERROR)
            connection.execute("COMMIT")
            if not self._stored:
                raise _damaged(path, "its head is missing")
            stored = json.loads(self._stored)
            if self.head:
                _check_identity(path, stored["identity"], self.head["identity"])
            self.head = (self.head or stored) | {name: stored[name] for name in ("started", "found")}


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
    try:
        with open(_lock_of(path), errors="replace") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                return file.read(100) or "another process"
    except OSError:
        pass
    return None


# ---------------------------------------------------------------- parts


def _is_there(path: Path) -> bool:
    """Whether there is a file at a path, or nothing; a file without a page is one whose making was cut short."""
    with _in_one_line(path):
        if path.exists() and not path.is_file():
            raise InputError(f"store = {str(path)!r}: is no regular file; choose another store")
        return path.exists() and path.stat().st_size > 0


def _checksum(key: str, row: str) -> str:
    return hashlib.blake2b(f"{key}\n{row}".encode(), digest_size=8).hexdigest()


def _check_identity(path: Path, there: Mapping[str, str], here: Mapping[str, str]) -> None:
    differs = [part for part in {**here, **there} if there.get(part) != here.get(part)]
    if differs:
        raise InputError(
            f"store = {str(path)!r}: holds another sweep; what differs: {', '.join(differs)}. Choose another store, or "
            "delete this one to start afresh"
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
        code = getattr(error, "sqlite_errorname", "")
        of_the_disk = isinstance(error, sqlite3.OperationalError) and code not in ("", "SQLITE_ERROR")  # no such table
        if path is None:
            raise
        if code == "SQLITE_NOTADB":
            what = "is not the store of a sweep, or its beginning is damaged; choose another"
        elif of_the_disk or isinstance(error, OSError):
            what = (
                f"cannot be written ({getattr(error, 'strerror', None) or error}); what was written is kept: free some "
                "space, make it writable or choose another place, and start again"
            )
        else:
            raise _damaged(path, str(error) if code else f"{type(error).__name__}: {error}") from error
        raise InputError(f"store = {str(path)!r}: {what}") from error


def _lock_of(path: Path) -> Path:
    return path.with_name(path.name + ".lock")


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold the lock of a store; the kernel takes it back when the process ends."""
    lock = _lock_of(path)
    with ExitStack() as held:
        with _in_one_line(path):
            lock.absolute().parent.mkdir(parents=True, exist_ok=True)
            file = held.enter_context(open(lock, "a"))
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                mine = lock.exists() and os.path.samestat(os.stat(lock), os.fstat(file.fileno()))  # or it was removed
            except BlockingIOError:
                mine = False
            if not mine:
                raise InputError(
                    f"store = {str(path)!r}: another sweep ({writer_of(path)}) is writing it; choose another store"
                )
            held.callback(lock.unlink, missing_ok=True)
            file.truncate(0)
            file.write(f"process {os.getpid()} on {socket.gethostname()}")
            file.flush()
        yield

"""A store in an SQLite file: its tables, and what is checked before a file is taken for one.

One connection writes and does all the checkpoints; any number read at the same time, which SQLite makes sure never
check-point (two that do can corrupt the file in SQLite 3.7.0 to 3.51.2).
"""

import os
import sqlite3
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Self

from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.files import read_beginning, refuse_link, written_whole
from pneumarm.transitions.database import (
    EXPECTED,
    VERSION,
    Database,
    Line,
    Values,
    as_settings,
    check_joints,
    check_version,
    damaged,
    further_columns,
    read_settings,
    row_columns,
)
from pneumarm.transitions.lock import WriterLock

APPLICATION = 0x706E6575
"""SQLite's application id of a store: "pneu"."""

_LONGEST_VALUE = 16 << 20  # bytes of a text or a blob: far over any state of an arm, far under what hurts


class SqliteFile(Database):
    """A store in a file."""

    def __init__(self, path: Path, connection: sqlite3.Connection, lock: WriterLock | None) -> None:
        self.address = self._path = path
        self.connection = connection
        self._lock = lock
        self.writer = lock is not None
        with self.translated():
            if self.writer and self.version == 1:
                self.settings()  # these are the tables that it says they are
                connection.executescript(f"BEGIN IMMEDIATE; {_MARKS}; PRAGMA user_version = 2; COMMIT;")

    @classmethod
    def is_there(cls, address: Path) -> bool:
        """Return whether there is something at the path, a store or not."""
        return address.exists()

    @classmethod
    def opened(cls, address: Path, *, writer: bool) -> Self:
        """Return the file of a store."""
        if not writer:
            return cls._opened(address, None)
        if not address.parent.is_dir():
            raise UnusableInput(f"{address}: the folder {address.parent} does not exist")
        return cls._opened(address, WriterLock(address))

    @classmethod
    def created(cls, address: Path, spec: ArmSpec, valves: bool) -> Self:
        """Make the file of an empty store and return it for writing."""
        lock = lock_vacant(address)
        try:
            with written_whole(address) as temporary:
                create_tables(temporary, spec, valves)
        except BaseException:
            lock.release()
            raise
        return cls._opened(address, lock)

    @classmethod
    @contextmanager
    def made_whole(cls, address: Path, spec: ArmSpec, valves: bool) -> Iterator[Self]:
        """Give the file of an empty store to be filled, beside its place; it is put there when it is."""
        lock = lock_vacant(address)
        try:
            with written_whole(address) as temporary:
                made = cls.created(temporary, spec, valves)
                try:
                    yield made
                finally:
                    made.close()
        finally:
            lock.release()

    @classmethod
    def _opened(cls, path: Path, lock: WriterLock | None) -> Self:
        try:
            connection = connect(path, writer=lock is not None)
            try:
                return cls(path, connection, lock)
            except BaseException:
                connection.close()
                raise
        except BaseException:
            if lock is not None:
                lock.release()
            raise

    @property
    def version(self) -> int:
        """Version of the tables."""
        return int(self.connection.execute("PRAGMA user_version").fetchone()[0])

    def settings(self) -> tuple[ArmSpec, bool]:
        """Return the arm and whether commands are valves, after checking that the tables are ours to the letter.

        Nothing else may be in the file: a view or a trigger in place of a table could do anything.
        """
        kept = dict(self.connection.execute("SELECT name, value FROM store LIMIT 10"))
        spec, valves = read_settings(kept, self._path)
        found = self.connection.execute("SELECT name, sql FROM sqlite_master WHERE sql IS NOT NULL LIMIT 100")
        if dict(found) != tables(spec, self.version):
            raise damaged(self._path, "its tables are not those of a store")
        return spec, valves

    def execute(self, query: str, values: Values | None = None) -> Iterator[Line]:
        """Execute a query and return the lines of its answer."""
        return self.connection.execute(query, values or {})

    def insert(self, table: str, columns: Sequence[str], lines: Sequence[Line]) -> None:
        """Add ``lines`` to a ``table``."""
        places = ", ".join("?" * len(columns))
        self.connection.executemany(f'INSERT INTO "{table}" ({", ".join(columns)}) VALUES ({places})', lines)

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Write what is written within at once: the log is synced at the end."""
        with self._within("BEGIN IMMEDIATE"):
            yield

    @contextmanager
    def snapshot(self) -> Iterator[None]:
        """Read what is read within as it was at one moment: that of the first reading."""
        with self._within("BEGIN"):
            yield

    @contextmanager
    def _within(self, begin: str) -> Iterator[None]:
        connection = self.connection
        with self.translated():
            connection.execute(begin)
            try:
                yield
                connection.execute("COMMIT")
            except BaseException:
                if connection.in_transaction:
                    connection.execute("ROLLBACK")
                raise

    @contextmanager
    def translated(self) -> Iterator[None]:
        """Turn SQLite's errors into ours."""
        with translated(self._path):
            yield

    def check(self) -> None:
        """Raise UnusableInput where SQLite finds something wrong."""
        found = self.connection.execute("PRAGMA integrity_check(1)").fetchone()[0]
        if found != "ok":
            raise damaged(self._path, str(found))

    def close(self) -> None:
        """Close the file and let go of the lock."""
        self.connection.close()
        if self._lock is not None:
            self._lock.release()


def lock_vacant(path: Path) -> WriterLock:
    """Return the lock of a place for a store where there is none yet.

    Raises:
        UnusableInput: there is something at ``path`` already, or its folder is missing or cannot be written.

    """
    if not path.parent.is_dir():
        raise UnusableInput(f"{path}: the folder {path.parent} does not exist; create it first")
    lock = WriterLock(path)
    if os.path.lexists(path):
        lock.release()
        raise UnusableInput(f"{path}: exists already; remove it or give another name")
    for suffix in ("-wal", "-shm"):  # SQLite would replay a log that outlived the store it belonged to
        path.with_name(path.name + suffix).unlink(missing_ok=True)
    return lock


_MARKS = (
    "CREATE TABLE marks (sequence INTEGER NOT NULL REFERENCES sequences, first INTEGER NOT NULL, "
    "last INTEGER NOT NULL, reason TEXT NOT NULL)"
)


def tables(spec: ArmSpec, version: int = VERSION) -> dict[str, str]:
    """Return the statements that create the tables of a ``version``, by name."""
    columns = row_columns(spec.joints, further_columns(spec, version))
    values = "".join(f", {name} REAL{'' if '_command_' in name else ' NOT NULL'}" for name in columns)
    made = {
        "store": "CREATE TABLE store (name TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID",
        "runs": "CREATE TABLE runs (number INTEGER PRIMARY KEY, purpose TEXT NOT NULL, metadata TEXT NOT NULL)",
        "sequences": (
            "CREATE TABLE sequences (number INTEGER PRIMARY KEY, run INTEGER REFERENCES runs, kind TEXT NOT NULL, "
            "at_rest INTEGER NOT NULL, rows INTEGER NOT NULL, transitions INTEGER NOT NULL, info TEXT NOT NULL)"
        ),
        "rows": (
            "CREATE TABLE rows (sequence INTEGER NOT NULL REFERENCES sequences, step INTEGER NOT NULL"
            f"{values}, PRIMARY KEY (sequence, step)) WITHOUT ROWID"
        ),
        "state": "CREATE TABLE state (name TEXT PRIMARY KEY, value BLOB NOT NULL) WITHOUT ROWID",
    }
    return made if version == 1 else made | {"marks": _MARKS}


def create_tables(path: Path, spec: ArmSpec, valves: bool) -> None:
    """Make an empty store of the file ``path``, which does not exist yet."""
    check_joints(spec, path)
    connection = sqlite3.connect(path, isolation_level=None)
    try:
        with translated(path):
            connection.execute("PRAGMA journal_mode = MEMORY")  # no second file: this one is put in place whole
            connection.execute(f"PRAGMA application_id = {APPLICATION}")
            version = VERSION if spec.further else 2
            connection.execute(f"PRAGMA user_version = {version}")
            for statement in tables(spec, version).values():
                connection.execute(statement)
            connection.executemany("INSERT INTO store VALUES (?, ?)", as_settings(spec, valves).items())
    finally:
        connection.close()


def connect(path: Path, *, writer: bool) -> sqlite3.Connection:
    """Open the store ``path``, for one writer or for reading only.

    Raises:
        UnusableInput: no such file, or not a store of this version.

    """
    _check_header(path)
    uri = path.absolute().as_uri() + ("?mode=rw" if writer else "?mode=ro")
    with translated(path):
        try:
            connection = _connect(uri)
        except sqlite3.OperationalError as error:
            # In a folder that cannot be written SQLite can only open a store that nobody has open.
            if writer or error.sqlite_errorname != "SQLITE_CANTOPEN" or path.with_name(path.name + "-wal").exists():
                raise
            connection = _connect(uri + "&immutable=1")
        if writer:
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = FULL")
    return connection


def _connect(uri: str) -> sqlite3.Connection:
    connection = sqlite3.connect(uri, uri=True, isolation_level=None)
    try:
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LONGEST_VALUE)
        connection.execute("PRAGMA trusted_schema = OFF")
        connection.execute("PRAGMA cell_size_check = ON")
        connection.execute("SELECT count(*) FROM sqlite_master").fetchone()  # opens the file: errors come here
    except BaseException:
        connection.close()
        raise
    return connection


def is_store(path: Path) -> bool:
    """Return whether ``path`` is a file that begins as those of stores do."""
    return path.is_file() and read_beginning(path, "a store", len(_MAGIC)) == _MAGIC


_MAGIC = b"SQLite format 3\0"


def _check_header(path: Path) -> None:
    """Refuse what is plainly no store before SQLite, which would wait for or repair it, gets to see it."""
    header = read_beginning(path, EXPECTED.removeprefix("expected "), 100)
    for suffix in ("-wal", "-shm", "-journal"):
        refuse_link(path.with_name(path.name + suffix))
    if len(header) < 100 or not header.startswith(_MAGIC):
        raise UnusableInput(f"{path}: {EXPECTED}, this is something else")
    version, application = struct.unpack(">I4xI", header[60:72])
    if application != APPLICATION:
        raise UnusableInput(f"{path}: {EXPECTED}, this is another program's database")
    check_version(version, path)


_MESSAGES = {
    "SQLITE_FULL": "the disk is full; free some space, then run the same command again",
    "SQLITE_READONLY": "the file or its disk is read-only; make it writable, then run the same command again",
    "SQLITE_IOERR": "reading or writing failed; look at the disk, then run the same command again",
    "SQLITE_BUSY": "another program keeps it locked; close that first",
    "SQLITE_CANTOPEN": "it cannot be opened; look at its permissions and those of its folder",
}


@contextmanager
def translated(path: Path) -> Iterator[None]:
    """Turn SQLite's errors into ours: :class:`UnusableInput` for a damaged file, else :class:`PneumarmError`."""
    try:
        yield
    except sqlite3.ProgrammingError:
        raise  # a mistake in the calling code, such as using a closed store
    except sqlite3.Error as error:
        name = getattr(error, "sqlite_errorname", "")
        for prefix, message in _MESSAGES.items():
            if name.startswith(prefix):
                raise PneumarmError(f"{path}: {message} ({error}); what was acknowledged is safe") from error
        raise damaged(path, str(error)) from error

"""A store in an SQLite file: its tables, and what is checked before a file is taken for one.

One connection writes and does all the checkpoints; any number read at the same time, which SQLite makes sure never
check-point (two that do can corrupt the file in SQLite 3.7.0 to 3.51.2).
"""

import os
import sqlite3
import struct
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager
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
    check_version,
    damaged,
    read_settings,
    tables,
)
from pneumarm.transitions.lock import WriterLock

APPLICATION = 0x706E6575
"""SQLite's application id of a store: "pneu"."""

_LONGEST_VALUE = 16 << 20  # bytes of a text or a blob: far over any state of an arm, far under what hurts


class SqliteFile(Database):
    """A store in a file."""

    begin_transaction = "BEGIN IMMEDIATE"
    place = "?"

    def __init__(self, path: Path, *, writer: bool) -> None:
        """Open the file; the writer has the lock then, and makes tables of version 1 those of version 2."""
        self.address = self._path = path
        self.writer = writer
        self._held = ExitStack()
        with self.opening():
            if writer:
                self._held.callback(WriterLock(path).release)
            self.connection = connect(path, writer=writer)
            self._held.callback(self.connection.close)
            self.spec, self.valves = self._settings()
            if writer and self.version == 1:
                marks = _statements(self.spec, 2)["marks"]
                self.connection.executescript(f"BEGIN IMMEDIATE; {marks}; PRAGMA user_version = 2; COMMIT;")

    @classmethod
    def is_there(cls, address: Path) -> bool:
        """Return whether there is something at the path, a store or not."""
        return address.exists()

    @classmethod
    def opened(cls, address: Path, *, writer: bool) -> Self:
        """Return the file of a store."""
        if writer and not address.parent.is_dir():
            raise UnusableInput(f"{address}: the folder {address.parent} does not exist")
        return cls(address, writer=writer)

    @classmethod
    @contextmanager
    def made_whole(cls, address: Path, spec: ArmSpec, valves: bool) -> Iterator[Self]:
        """Give the file of an empty store to be filled, beside its place; it is put there when it is."""
        lock = lock_vacant(address)
        try:
            with written_whole(address) as temporary:
                create_tables(temporary, spec, valves)
                with closing(cls(temporary, writer=True)) as made:
                    yield made
        finally:
            lock.release()

    @property
    def version(self) -> int:
        """Version of the tables, which a writer may change at any time."""
        return int(self.query("PRAGMA user_version")[0][0])

    def _settings(self) -> tuple[ArmSpec, bool]:
        """Return the arm and whether commands are valves, after checking that the tables are ours to the letter.

        Nothing else may be in the file: a view or a trigger in place of a table could do anything.
        """
        kept = dict(self.connection.execute("SELECT name, value FROM store LIMIT 10"))
        spec, valves = read_settings(kept, self._path)
        found = self.connection.execute("SELECT name, sql FROM sqlite_master WHERE sql IS NOT NULL LIMIT 100")
        if dict(found) != _statements(spec, self.version):
            raise damaged(self._path, "its tables are not those of a store")
        return spec, valves

    def execute(self, query: str, values: Values | None = None) -> Iterator[Line]:
        """Execute a query and return the lines of its answer."""
        return self.connection.execute(query, values or {})

    def execute_many(self, statement: str, lines: Sequence[Line]) -> None:
        """Execute a statement with the values of each of the ``lines``."""
        self.connection.executemany(statement, lines)

    def translated(self) -> AbstractContextManager[None]:
        """Turn SQLite's errors into ours."""
        return translated(self._path)

    def check(self) -> None:
        """Raise UnusableInput where SQLite finds something wrong."""
        found = self.connection.execute("PRAGMA integrity_check(1)").fetchone()[0]
        if found != "ok":
            raise damaged(self._path, str(found))

    def close(self) -> None:
        """Close the file and let go of the lock."""
        self._held.close()


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


def _statements(spec: ArmSpec, version: int) -> dict[str, str]:
    """Return the statements that create the tables of a ``version``, by name, to the letter as SQLite keeps them."""
    return {
        name: f"CREATE TABLE {name} ({', '.join(map(' '.join, table.columns.items()))}{table.end}"
        for name, table in tables(spec, version).items()
    }


def create_tables(path: Path, spec: ArmSpec, valves: bool) -> None:
    """Make an empty store of the file ``path``, which does not exist yet."""
    connection = sqlite3.connect(path, isolation_level=None)
    try:
        with translated(path):
            connection.execute("PRAGMA journal_mode = MEMORY")  # no second file: this one is put in place whole
            connection.execute(f"PRAGMA application_id = {APPLICATION}")
            version = VERSION if spec.further else 2
            connection.execute(f"PRAGMA user_version = {version}")
            for statement in _statements(spec, version).values():
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

"""The tables of a store, and what is checked before a file is taken for one."""

import json
import sqlite3
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

import msgspec

from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import PneumarmError, UnusableInput

APPLICATION = 0x706E6575
"""SQLite's application id of a store: "pneu"."""
VERSION = 3
"""Version of the tables below. Version 1 had no marks; it is read, and made version 2 by the first writer. Version 3
has the readings of further sensors; of an arm without any a store is of version 2, which earlier programs read."""
LONGEST_SEQUENCE = 100_000
"""Most rows of a sequence, so that a block of whole sequences is bounded in memory."""
MOST_JOINTS = 64
"""Most joints of an arm, so that the tables have no more columns than SQLite can hold: 9 a joint with all sensors."""

_LONGEST_VALUE = 16 << 20  # bytes of a text or a blob: far over any state of an arm, far under what hurts


def row_columns(joints: int, further: Sequence[str] = ()) -> list[str]:
    """Return the names of the columns of a row after its sequence and step; ``further`` sensors come last."""
    names = ["angle", "pressure_1", "pressure_2", "command_1", "command_2"]
    return ["time", *(f"joint_{j}_{name}" for j in range(1, joints + 1) for name in names), *further]


def further_columns(spec: ArmSpec, version: int) -> tuple[str, ...]:
    """Return the columns of further sensors in a store of a ``version``; before the third there were none."""
    return spec.further if version >= 3 else ()


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
    if spec.joints > MOST_JOINTS:
        raise UnusableInput(f"{path}: a store has room for {MOST_JOINTS} joints, this arm has {spec.joints}")
    connection = sqlite3.connect(path, isolation_level=None)
    try:
        with translated(path):
            connection.execute("PRAGMA journal_mode = MEMORY")  # no second file: this one is put in place whole
            connection.execute(f"PRAGMA application_id = {APPLICATION}")
            version = VERSION if spec.further else 2
            connection.execute(f"PRAGMA user_version = {version}")
            for statement in tables(spec, version).values():
                connection.execute(statement)
            settings = {"spec": json.dumps(asdict(spec)), "valves": json.dumps(valves)}
            connection.executemany("INSERT INTO store VALUES (?, ?)", settings.items())
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


def _check_header(path: Path) -> None:
    """Refuse what is plainly no store before SQLite, which would wait for or repair it, gets to see it."""
    expected = "expected a store written by `pneumarm collect` or `pneumarm import`"
    if not path.exists():
        raise UnusableInput(f"{path}: no such file; {expected}")
    if not path.is_file():
        raise UnusableInput(f"{path}: {expected}, this is not a file")
    try:
        with open(path, "rb") as file:
            header = file.read(100)
    except OSError as error:
        raise UnusableInput(f"{path}: cannot be read ({error.strerror})") from error
    if len(header) < 100 or not header.startswith(b"SQLite format 3\0"):
        raise UnusableInput(f"{path}: {expected}, this is something else")
    version, application = struct.unpack(">I4xI", header[60:72])
    if application != APPLICATION:
        raise UnusableInput(f"{path}: {expected}, this is another program's database")
    if not 1 <= version <= VERSION:
        raise UnusableInput(
            f"{path}: a store of version {version}, this pneumarm reads versions 1 to {VERSION}; "
            "use the one that wrote it"
        )


def read_settings(connection: sqlite3.Connection, path: Path) -> tuple[ArmSpec, bool]:
    """Return the arm and whether commands are valves, after checking that the tables are ours to the letter.

    Nothing else may be in the file: a view or a trigger in place of a table could do anything.
    """
    settings = dict(connection.execute("SELECT name, value FROM store LIMIT 10"))
    try:
        spec = msgspec.json.decode(settings["spec"], type=ArmSpec, strict=True)
        valves = msgspec.json.decode(settings["valves"], type=bool)
    except (KeyError, msgspec.MsgspecError, UnusableInput, TypeError) as error:
        raise damaged(path, f"its arm cannot be read: {error}") from error
    if spec.joints > MOST_JOINTS:
        raise damaged(path, f"an arm of {spec.joints} joints")
    found = connection.execute("SELECT name, sql FROM sqlite_master WHERE sql IS NOT NULL LIMIT 100")
    if dict(found) != tables(spec, version_of(connection)):
        raise damaged(path, "its tables are not those of a store")
    return spec, valves


def version_of(connection: sqlite3.Connection) -> int:
    """Return the version of the tables."""
    return int(connection.execute("PRAGMA user_version").fetchone()[0])


def upgrade(connection: sqlite3.Connection) -> None:
    """Make a store of version 1, whose tables were checked, one of version 2."""
    if version_of(connection) == 1:
        connection.executescript(f"BEGIN IMMEDIATE; {_MARKS}; PRAGMA user_version = 2; COMMIT;")


def damaged(path: Path, what: str) -> UnusableInput:
    """Return the error for a store that cannot be trusted."""
    return UnusableInput(f"{path}: the store is damaged ({what}); use a copy of it or collect again")


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

"""A store in a database on a server: PostgreSQL, or MySQL and MariaDB with InnoDB; through SQLAlchemy.

The tables are those of a file (:func:`pneumarm.transitions.database.tables`), in a database, or a schema of
PostgreSQL, of their own. Where we differ from a file:

1. The one writer holds a lock of the server's, by the session that it writes in. The server lets go of it when that
   session ends, however it does; then nothing can be written in it any more.
2. A session is never replaced by another: once its connection is lost, everything fails until the store is opened
   again, so that nobody goes on in the middle of a transaction.
3. Further tables beside those of a store are none of its business. A server trusts whoever may change its tables; a
   file may come from anywhere.
"""

import os
import socket
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from time import monotonic, sleep
from typing import NamedTuple, Self

import sqlalchemy
from sqlalchemy.exc import DBAPIError

from pneumarm.address import ServerAddress
from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.extras import extra
from pneumarm.transitions.database import (
    EXPECTED,
    VERSION,
    Database,
    Line,
    StoreTable,
    Values,
    as_settings,
    check_version,
    damaged,
    read_settings,
    tables,
)

_PATIENCE = 1.0  # s for which a lock is waited for: the server may not have noticed yet that its holder is dead
_WRITER = "writer"  # the setting that says who writes
_SETTINGS = {"spec", "valves", "version", _WRITER}
_AGAIN = "what was acknowledged is safe: run the same command again"


class System(NamedTuple):
    """What a system of databases calls things."""

    driver: str
    connection: Mapping[str, str]
    """Settings of a connection that the address does not set. One that was lost is noticed within five minutes."""
    session: tuple[str, ...]
    """Statements that begin every session."""
    writing: tuple[str, ...]
    """Those that begin a writer's."""
    durable: Mapping[str, tuple[str, tuple[str, ...], str]]
    """Queries for what makes commits durable: what the answer must be, and what to tell where it is not, by name."""
    lock: str
    """Query that tries to take the writer's lock, of this database or schema."""
    snapshot: str
    """Statement that begins a transaction which sees one moment."""
    here: str
    """The database or schema that the session is in."""
    engine: str
    """What keeps a table ``t`` of the catalogue; 'InnoDB' is safe."""
    types: Mapping[str, str]
    """Types of columns, by what SQLite calls them."""
    counted: str
    """Type of a key that the server counts by itself."""
    options: str
    """End of the statements that create tables."""


_POSTGRESQL = System(
    driver="postgresql+psycopg",
    connection={
        "application_name": "pneumarm",
        "connect_timeout": "10",
        "keepalives_idle": "30",
        "keepalives_interval": "10",
        "keepalives_count": "3",
        "tcp_user_timeout": "60000",
    },
    session=(),
    writing=(
        "SET synchronous_commit = on",
        # The server notices in a minute, not in hours, that a writer's machine is gone, and lets go of its lock.
        "SET tcp_keepalives_idle = 30",
        "SET tcp_keepalives_interval = 10",
        "SET tcp_keepalives_count = 3",
    ),
    durable={"fsync": ("SHOW fsync", ("on",), "fsync = on")},
    # 0x706E6575 is "pneu", as in the files' headers.
    lock="SELECT pg_try_advisory_lock(x'706E6575'::int, oid::int) FROM pg_namespace WHERE nspname = current_schema()",
    snapshot="BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY",
    here="current_schema()",
    engine="'InnoDB'",
    types={"INTEGER": "BIGINT", "REAL": "DOUBLE PRECISION", "TEXT": "TEXT", "BLOB": "BYTEA"},
    counted="BIGSERIAL PRIMARY KEY",
    options="",
)
_MYSQL = System(
    driver="mysql+pymysql",
    connection={
        "sql_mode": "ANSI_QUOTES,STRICT_ALL_TABLES",
        "charset": "utf8mb4",
        "connect_timeout": "10",
        "read_timeout": "300",
        "write_timeout": "60",
    },
    session=("SET SESSION TRANSACTION ISOLATION LEVEL REPEATABLE READ",),
    writing=("SET SESSION wait_timeout = 2147483",),  # an arm may stand still for a night
    durable={
        "innodb_flush_log_at_trx_commit": (
            "SELECT @@GLOBAL.innodb_flush_log_at_trx_commit",
            ("1", "3"),  # 3 is one of MariaDB's, as safe
            "innodb_flush_log_at_trx_commit = 1",
        ),
        # What the binary log has lost is rolled back after a crash, though InnoDB has it.
        "sync_binlog": ("SELECT IF(@@GLOBAL.log_bin, @@GLOBAL.sync_binlog, 1)", ("1",), "sync_binlog = 1"),
    },
    lock="SELECT GET_LOCK(CONCAT('pneumarm ', MD5(DATABASE())), 0)",
    snapshot="START TRANSACTION WITH CONSISTENT SNAPSHOT, READ ONLY",
    here="DATABASE()",
    engine="t.engine",
    types={"INTEGER": "BIGINT", "REAL": "DOUBLE", "TEXT": "LONGTEXT", "BLOB": "LONGBLOB"},
    counted="BIGINT PRIMARY KEY AUTO_INCREMENT",
    # By default it takes "Velocity" and "velocity" for the same kind of sequence.
    options=" ENGINE = InnoDB CHARACTER SET utf8mb4 COLLATE utf8mb4_bin",
)
_SYSTEMS = {"postgresql": _POSTGRESQL, "mysql": _MYSQL}


class Server(Database):
    """A store on a server."""

    version = VERSION
    place = "%s"

    def __init__(self, address: ServerAddress, *, writer: bool) -> None:
        """Connect; the writer has the lock then."""
        self.address = self._address = address
        self.writer = writer
        self._system = system = _SYSTEMS[address.system]
        self.begin_snapshot = system.snapshot
        extra(system.driver.partition("+")[2], "server", f"{address}: a store on a server")
        try:
            self._connection = _engine(address, system).connect()
        except (DBAPIError, TypeError, ValueError, RuntimeError) as error:  # drivers do not check all settings well
            raise UnusableInput(
                f"{address}: cannot be opened ({_reason(error)}); expected a server that runs there, and a user, a "
                "password and a database that it knows"
            ) from error
        with self.opening():
            self._begin_session()
            self._tables = self._catalogue()

    def _begin_session(self) -> None:
        for statement in self._system.session + (self._system.writing if self.writer else ()):
            self.execute(statement)
        if not self.writer:
            return
        for name, (query, wanted, advice) in self._system.durable.items():
            ((found,),) = self.execute(query)
            if str(found) not in wanted:
                raise UnusableInput(
                    f"{self.address}: the server may lose what it has acknowledged, its {name} is {found}; set "
                    f"{advice} on it"
                )
        self._lock()

    def _lock(self) -> None:
        """Take the writer's lock, or raise UnusableInput which says who has it."""
        deadline = monotonic() + _PATIENCE
        while not (found := [taken for (taken,) in self.execute(self._system.lock)]) or not found[0]:
            if not found:
                raise UnusableInput(f"{self.address}: its search_path names no schema that there is; create it first")
            if monotonic() > deadline:
                raise UnusableInput(
                    f"{self.address}: {self._holder()} is writing to it; wait for it or stop it first"
                )
            sleep(0.02)

    def _holder(self) -> str:
        with suppress(PneumarmError, DBAPIError):  # such as missing rights
            self._tables = self._catalogue()
            return self._kept().get(_WRITER, "another process")
        return "another process"

    @classmethod
    def is_there(cls, address: ServerAddress) -> bool:
        """Return whether there is a store in the database, also an empty one."""
        with closing(cls(address, writer=False)) as database, database.translated():
            return bool(database._kept())

    @classmethod
    def opened(cls, address: ServerAddress, *, writer: bool) -> Self:
        """Return the database of a store."""
        database = cls(address, writer=writer)
        with database.opening():
            database._require_store()
            database.spec, database.valves = database._settings()
            if writer:
                with database.transaction():
                    database.execute("DELETE FROM store WHERE name = :name", {"name": _WRITER})
                    database.insert("store", [(_WRITER, _this_process())])
        return database

    @classmethod
    @contextmanager
    def made_whole(cls, address: ServerAddress, spec: ArmSpec, valves: bool) -> Iterator[Self]:
        """Give an empty store to be filled, in one transaction; where that fails the tables go again."""
        with closing(cls(address, writer=True)) as database:
            database.spec, database.valves = spec, valves
            with database.translated():
                database._require_vacant()
                database._drop()
                for name, table in _tables(spec).items():
                    database.execute(_statement(name, table, database._system))
                database._tables = database._catalogue()
                settings = {**as_settings(spec, valves), "version": str(VERSION), _WRITER: _this_process()}
                with database.transaction():  # it is a store once it has these
                    database.insert("store", list(settings.items()))
            try:
                with database.transaction():
                    yield database
            except BaseException:
                with suppress(Exception):  # what is left is empty then, and the next one clears it away
                    database._drop()
                raise

    def _drop(self) -> None:
        for name in _tables(ArmSpec()):
            self.execute(f'DROP TABLE IF EXISTS "{name}"')

    # ---- what is in the database

    def _catalogue(self) -> dict[str, list[str]]:
        """Return the columns of the tables that there are; of one that is not safe, none."""
        found: dict[str, list[str]] = {}
        for table, column, engine in self.execute(
            f"SELECT t.table_name, c.column_name, {self._system.engine} FROM information_schema.tables t "
            "JOIN information_schema.columns c "
            "ON c.table_schema = t.table_schema AND c.table_name = t.table_name "
            f"WHERE t.table_schema = {self._system.here} AND t.table_type = 'BASE TABLE' "
            "ORDER BY t.table_name, c.ordinal_position"
        ):
            columns = found.setdefault(str(table), [])
            columns += [str(column)] if engine == "InnoDB" else []
        return found

    def _known(self) -> set[str]:
        """Return the names of those that are tables of a store, of an arm of one joint or of more."""
        ours = {name: list(table.columns) for name, table in _tables(ArmSpec()).items()}
        found = {name: self._tables.get(name, []) for name in ours}
        found["rows"] = found["rows"][: len(ours["rows"])]
        return {name for name, columns in ours.items() if found[name] == columns}

    def _kept(self) -> dict[str, str]:
        """Return the settings; none where there is no store."""
        if "store" not in self._known():
            return {}
        return {str(name): str(value) for name, value in self.execute("SELECT name, value FROM store LIMIT 10")}

    def _require_store(self) -> None:
        """Raise UnusableInput unless the tables of a store are there."""
        if len(self._known()) < len(_tables(ArmSpec())) or "version" not in self._kept():
            holds = f"holds other tables ({_some(set(self._tables))})" if self._tables else "is empty"
            raise UnusableInput(f"{self.address}: {EXPECTED}, this database {holds}")

    def _require_vacant(self) -> None:
        """Raise UnusableInput unless there is nothing but what is left of a store that was never filled.

        What passes here is dropped: whatever might be somebody else's is not to.
        """
        known = self._known()
        others = self._tables.keys() - known
        if self._kept().keys() - _SETTINGS:
            others = others | {"store"}
        if others:
            raise UnusableInput(
                f"{self.address}: holds other tables ({_some(others)}); give a database"
                f"{' or a schema' if self._system is _POSTGRESQL else ''} of its own"
            )
        if any(list(self.execute(f'SELECT 1 FROM "{name}" LIMIT 1')) for name in known - {"store"}):
            raise UnusableInput(f"{self.address}: exists already; remove its tables or give another database")

    def _settings(self) -> tuple[ArmSpec, bool]:
        """Return the arm and whether commands are valves, after checking that the tables are those of a store."""
        kept = self._kept()
        version = kept.get("version", "")
        check_version(int(version) if version.isdigit() else 0, self.address)
        spec, valves = read_settings(kept, self.address)
        if any(self._tables.get(name) != list(table.columns) for name, table in _tables(spec).items()):
            raise damaged(self.address, "its tables are not those of a store")
        return spec, valves

    # ---- queries

    def _usable(self) -> sqlalchemy.Connection:
        """Return the connection, unless it was lost: SQLAlchemy would make another one."""
        if self._connection.invalidated:
            raise PneumarmError(f"{self.address}: the connection to the server was lost; {_AGAIN}")
        return self._connection

    def execute(self, query: str, values: Values | None = None) -> Iterator[Line]:
        """Execute a query and return the lines of its answer."""
        found = self._usable().execute(sqlalchemy.text(query), dict(values or {}))
        return iter(found) if found.returns_rows else iter(())

    def execute_many(self, statement: str, lines: Sequence[Line]) -> None:
        """Execute a statement with the values of each of the ``lines``."""
        self._usable().exec_driver_sql(statement, [tuple(line) for line in lines])

    @contextmanager
    def translated(self) -> Iterator[None]:
        """Turn the server's errors into ours: :class:`UnusableInput` for missing rights, else PneumarmError."""
        try:
            yield
        except DBAPIError as error:
            raise _told(self._address, error) from error

    def check(self) -> None:
        """Do nothing: a server checks its own pages."""

    def close(self) -> None:
        """End the session, and with it the lock."""
        with suppress(DBAPIError):
            self._connection.close()


def _engine(address: ServerAddress, system: System) -> sqlalchemy.Engine:
    """Return what connects to ``address``; every statement is a transaction of its own unless one is begun."""
    url = sqlalchemy.URL.create(
        system.driver,
        username=address.user,
        password=address.the_password(),
        host=address.host,
        port=address.port,
        database=address.database,
        query={**system.connection, **address.settings},
    )
    return sqlalchemy.create_engine(
        url, poolclass=sqlalchemy.NullPool, isolation_level="AUTOCOMMIT", hide_parameters=True
    )


def _tables(spec: ArmSpec) -> dict[str, StoreTable]:
    """Return the tables of a store; lines of marks are counted, which SQLite does by itself."""
    found = tables(spec)
    return found | {"marks": StoreTable({"rowid": "", **found["marks"].columns})}


def _statement(name: str, table: StoreTable, system: System) -> str:
    """Return the statement that creates a ``table``."""
    columns = [f'"{column}" {_type(words, system)}' for column, words in table.columns.items()]
    return f'CREATE TABLE "{name}" ({", ".join(columns)}{table.end.removesuffix(" WITHOUT ROWID")}{system.options}'


def _type(words: str, system: System) -> str:
    """Return what a ``system`` calls the type of a column; it checks no references, which only we make."""
    if not words:
        return system.counted
    kind, _, rest = words.partition(" REFERENCES ")[0].partition(" ")
    # A text of any length cannot be a key.
    return f"{'VARCHAR(100)' if (kind, rest) == ('TEXT', 'PRIMARY KEY') else system.types[kind]} {rest}"


def _this_process() -> str:
    return f"process {os.getpid()} on {socket.gethostname()}"


def _some(names: set[str]) -> str:
    shown = sorted(names)
    return ", ".join(shown[:5]) + (", ..." if len(shown) > 5 else "")


_NO_RIGHTS = {"42501", 1044, 1142, 1143, 1227, 1370}
_FULL = {"53100", 1021, 1114, 3, 28}
_READ_ONLY = {"25006", 1290, 1836}


def _told(address: ServerAddress, error: DBAPIError) -> PneumarmError:
    """Return what to tell people of an ``error`` of the server's or its driver's."""
    reason = _reason(error)
    codes = {getattr(error.orig, "sqlstate", None), *getattr(error.orig, "args", ())[:1]}
    if error.connection_invalidated:
        return PneumarmError(f"{address}: the connection to the server was lost ({reason}); {_AGAIN}")
    if codes & _NO_RIGHTS:
        return UnusableInput(f"{address}: its user lacks rights ({reason}); grant all of them on this database")
    if codes & _FULL:
        return PneumarmError(f"{address}: the server's disk is full ({reason}); free some space; {_AGAIN}")
    if codes & _READ_ONLY:
        return PneumarmError(f"{address}: the server takes no changes ({reason}); make it writable; {_AGAIN}")
    return PneumarmError(f"{address}: the server failed ({reason}); {_AGAIN}")


def _reason(error: Exception) -> str:
    """Return the words of the server or its driver, in a line."""
    driven = getattr(error, "orig", None) or error
    said = driven.args[-1] if driven.args else type(driven).__name__
    return " ".join(str(said).split()).removesuffix(".")

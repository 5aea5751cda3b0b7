"""What a store asks of the database that it is kept in: the only thing that files and servers differ in.

Queries are written once, in :mod:`pneumarm.transitions.store`, in SQL that all of them know: values are named,
``:name``, and ``"rows"``, a reserved word of MySQL, is quoted.
"""

import json
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import asdict
from typing import Any, NamedTuple, Self

import msgspec

from pneumarm.address import Address
from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.files import parse_json

VERSION = 3
"""Version of the tables. Version 1 had no marks; it is read, and made version 2 by the first writer. Version 3 has
the readings of further sensors; of an arm without any a file is of version 2, which earlier programs read. On a
server stores are of version 3."""
LONGEST_SEQUENCE = 100_000
"""Most rows of a sequence, so that a block of whole sequences is bounded in memory."""
MOST_JOINTS = 64
"""Most joints of an arm, so that the tables have no more columns than databases can hold: 9 a joint with all
sensors."""
EXPECTED = "expected a store written by `pneumarm collect` or `pneumarm import`"

Values = Mapping[str, Any]
"""Values of a query by their names."""
Line = Sequence[Any]
"""A line of a table."""
PAGE = 10_000
"""Lines of a table that are held at once."""


class Database(ABC):
    """The tables of one store, opened by one writer or for reading only."""

    address: Address
    """Where it is; shown without a password."""
    writer: bool
    """Whether this is the one that may write."""
    spec: ArmSpec
    """The arm that the rows are of."""
    valves: bool
    """Whether the commands are valves -1, 0, +1 or pulses in between; imported ones may be continuous."""
    begin_transaction = begin_snapshot = "BEGIN"
    """Statements that begin a transaction which writes, and one that sees the moment of its first reading."""
    place: str
    """What stands for a value in a statement for many lines."""
    _is_writing = False

    @classmethod
    @abstractmethod
    def is_there(cls, address: Any) -> bool:
        """Return whether there is something at ``address``, a store or not."""

    @classmethod
    @abstractmethod
    def opened(cls, address: Any, *, writer: bool) -> Self:
        """Return the database of the store at ``address``, after checking that its tables are those of one.

        Raises:
            UnusableInput: there is none, it cannot be read, or another writer is at it.

        """

    @classmethod
    @abstractmethod
    def made_whole(cls, address: Any, spec: ArmSpec, valves: bool) -> AbstractContextManager[Self]:
        """Give the database of an empty store to be filled; what fails on the way leaves nothing at ``address``.

        Raises:
            UnusableInput: there is something already, or nothing can be made there.

        """

    @property
    @abstractmethod
    def version(self) -> int:
        """Version of the tables."""

    @abstractmethod
    def execute(self, query: str, values: Values | None = None) -> Iterator[Line]:
        """Execute a query and return the lines of its answer."""

    @abstractmethod
    def execute_many(self, statement: str, lines: Sequence[Line]) -> None:
        """Execute a statement with the values of each of the ``lines`` in its places."""

    @abstractmethod
    def translated(self) -> AbstractContextManager[None]:
        """Turn the database's errors into ours."""

    @abstractmethod
    def check(self) -> None:
        """Raise UnusableInput where the database itself is damaged."""

    @abstractmethod
    def close(self) -> None:
        """Close it and let go of the writer's lock. May be called twice."""

    @contextmanager
    def opening(self) -> Iterator[None]:
        """Close the database where what is done within fails."""
        try:
            with self.translated():
                yield
        except BaseException:
            self.close()
            raise

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Write what is written within at once: durable when it ends well, nothing of it otherwise.

        Within another one it is part of that.
        """
        if self._is_writing:
            yield
            return
        self._is_writing = True
        try:
            with self._within(self.begin_transaction):
                yield
        finally:
            self._is_writing = False

    @contextmanager
    def snapshot(self) -> Iterator[None]:
        """Read what is read within as it was at one moment: that of the first reading."""
        with self._within(self.begin_snapshot):
            yield

    @contextmanager
    def _within(self, begin: str) -> Iterator[None]:
        with self.translated():
            self.execute(begin)
            try:
                yield
                self.execute("COMMIT")
            except BaseException:
                with suppress(Exception):  # the first failure is the one to tell of
                    self.execute("ROLLBACK")
                raise

    def columns(self, table: str) -> list[str]:
        """Return the names of a table's columns."""
        return list(tables(self.spec, self.version)[table].columns)

    def insert(self, table: str, lines: Sequence[Line]) -> None:
        """Add ``lines`` to a ``table``, their values in the order of its columns; None is NULL."""
        columns = self.columns(table)
        values = ", ".join([self.place] * len(columns))
        self.execute_many(f'INSERT INTO "{table}" ({_quoted(columns)}) VALUES ({values})', lines)

    def query(self, query: str, values: Values | None = None) -> list[Line]:
        """Return all lines of the answer to a query."""
        with self.translated():
            return list(self.execute(query, values))

    def pages(
        self,
        table: str,
        columns: Sequence[str],
        key: str = "number",
        where: str = "",
        values: Values | None = None,
        page: int = PAGE,
    ) -> Iterator[Line]:
        """Yield the lines of a ``table``, in order of its ``key``, which comes before their ``columns``.

        They are asked for a ``page`` at a time, because servers send their answers whole. ``where`` is a condition
        on them, with its ``values``.
        """
        known, conditions = dict(values or {}), [where] if where else []
        found: list[Line] = [()] * page
        while len(found) == page:
            chosen = f" WHERE {' AND '.join(conditions)}" if conditions else ""
            query = f'SELECT {_quoted([key, *columns])} FROM "{table}"{chosen} ORDER BY {key} LIMIT {page}'
            found = self.query(query, known)
            yield from found
            if found:
                known["after"], conditions = found[-1][0], [*filter(None, [where]), f"{key} > :after"]

    @property
    def further(self) -> tuple[str, ...]:
        """Names of the further sensors whose readings it holds; in tables of an older version, none."""
        return further_columns(self.spec, self.version)


def _quoted(columns: Sequence[str]) -> str:
    return ", ".join(f'"{column}"' for column in columns)


class StoreTable(NamedTuple):
    """A table: its columns, with their types, and how its statement ends; in the words of SQLite."""

    columns: Mapping[str, str]
    end: str = ")"


def tables(spec: ArmSpec, version: int = VERSION) -> dict[str, StoreTable]:
    """Return the tables of a store by name; servers translate the types."""
    number, text, key = "INTEGER NOT NULL", "TEXT NOT NULL", {"number": "INTEGER PRIMARY KEY"}
    named, of_sequence = {"name": "TEXT PRIMARY KEY"}, {"sequence": "INTEGER NOT NULL REFERENCES sequences"}
    columns = row_columns(spec.joints, further_columns(spec, version))
    values = {name: "REAL" if "_command_" in name else "REAL NOT NULL" for name in columns}
    made = {
        "store": StoreTable({**named, "value": text}, ") WITHOUT ROWID"),
        "runs": StoreTable({**key, "purpose": text, "metadata": text}),
        "sequences": StoreTable(
            {**key, "run": "INTEGER REFERENCES runs", "kind": text}
            | {"at_rest": number, "rows": number, "transitions": number, "info": text}
        ),
        "rows": StoreTable(
            {**of_sequence, "step": number, **values}, ", PRIMARY KEY (sequence, step)) WITHOUT ROWID"
        ),
        "state": StoreTable({**named, "value": "BLOB NOT NULL"}, ") WITHOUT ROWID"),
    }
    marks = StoreTable({**of_sequence, "first": number, "last": number, "reason": text})
    return made if version == 1 else made | {"marks": marks}


def row_columns(joints: int, further: Sequence[str] = ()) -> list[str]:
    """Return the names of the columns of a row after its sequence and step; ``further`` sensors come last."""
    names = ["angle", "pressure_1", "pressure_2", "command_1", "command_2"]
    return ["time", *(f"joint_{j}_{name}" for j in range(1, joints + 1) for name in names), *further]


def further_columns(spec: ArmSpec, version: int) -> tuple[str, ...]:
    """Return the columns of further sensors in a store of a ``version``; before the third there were none."""
    return spec.further if version >= 3 else ()


def as_settings(spec: ArmSpec, valves: bool) -> dict[str, str]:
    """Return what is kept of the arm, as text by name."""
    return {"spec": json.dumps(asdict(spec)), "valves": json.dumps(valves)}


def read_settings(kept: Mapping[str, str], address: Address) -> tuple[ArmSpec, bool]:
    """Return the arm and whether commands are valves, of what was ``kept``."""
    try:
        spec = msgspec.json.decode(kept["spec"], type=ArmSpec, strict=True)
        valves = msgspec.json.decode(kept["valves"], type=bool)
    except (KeyError, msgspec.MsgspecError, UnusableInput, TypeError) as error:
        raise damaged(address, f"its arm cannot be read: {error}") from error
    if spec.joints > MOST_JOINTS:
        raise damaged(address, f"an arm of {spec.joints} joints")
    return spec, valves


def check_version(version: int, address: Address) -> None:
    """Raise UnusableInput where tables of this ``version`` cannot be read."""
    if not 1 <= version <= VERSION:
        raise UnusableInput(
            f"{address}: a store of version {version}, this pneumarm reads versions 1 to {VERSION}; "
            "use the one that wrote it"
        )


def kept_json(text: Any, address: Address, what: str) -> dict[str, Any]:
    """Return the object that a store keeps as JSON of ``what``; raises UnusableInput where it is none."""
    return parse_json(text, f"{address}: the store is damaged: expected {what}")


def damaged(address: Address, what: str) -> UnusableInput:
    """Return the error for a store that cannot be trusted."""
    return UnusableInput(f"{address}: the store is damaged ({what}); use a copy of it or collect again")

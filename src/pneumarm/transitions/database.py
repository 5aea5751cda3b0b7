"""What a store asks of the database that it is kept in: the only thing that files and servers differ in.

Queries are written once, in :mod:`pneumarm.transitions.store`, in SQL that all of them know: values are named,
``:name``, and ``"rows"``, a reserved word of MySQL, is quoted.
"""

import json
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict
from typing import Any, Self

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


class Database(ABC):
    """The tables of one store, opened by one writer or for reading only."""

    address: Address
    """Where it is; shown without a password."""
    writer: bool
    """Whether this is the one that may write."""

    @classmethod
    @abstractmethod
    def is_there(cls, address: Any) -> bool:
        """Return whether there is something at ``address``, a store or not."""

    @classmethod
    @abstractmethod
    def opened(cls, address: Any, *, writer: bool) -> Self:
        """Return the database of the store at ``address``.

        Raises:
            UnusableInput: there is none, it cannot be read, or another writer is at it.

        """

    @classmethod
    @abstractmethod
    def created(cls, address: Any, spec: ArmSpec, valves: bool) -> Self:
        """Make the database of an empty store and return it for writing.

        Raises:
            UnusableInput: there is something already, or nothing can be made there.

        """

    @classmethod
    @abstractmethod
    def made_whole(cls, address: Any, spec: ArmSpec, valves: bool) -> AbstractContextManager[Self]:
        """Give the database of an empty store to be filled; what fails on the way leaves nothing at ``address``."""

    @property
    @abstractmethod
    def version(self) -> int:
        """Version of the tables."""

    @abstractmethod
    def settings(self) -> tuple[ArmSpec, bool]:
        """Return the arm and whether commands are valves, after checking that the tables are those of a store."""

    @abstractmethod
    def execute(self, query: str, values: Values | None = None) -> Iterator[Line]:
        """Execute a query and return the lines of its answer."""

    @abstractmethod
    def insert(self, table: str, columns: Sequence[str], lines: Sequence[Line]) -> None:
        """Add ``lines`` to a ``table``; None is NULL."""

    @abstractmethod
    def transaction(self) -> AbstractContextManager[None]:
        """Write what is written within at once: durable when it ends well, nothing of it otherwise."""

    @abstractmethod
    def snapshot(self) -> AbstractContextManager[None]:
        """Read what is read within as it was at one moment."""

    @abstractmethod
    def translated(self) -> AbstractContextManager[None]:
        """Turn the database's errors into ours."""

    @abstractmethod
    def check(self) -> None:
        """Raise UnusableInput where the database itself is damaged."""

    @abstractmethod
    def close(self) -> None:
        """Close it and let go of the writer's lock. May be called twice."""


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


def check_joints(spec: ArmSpec, address: Address) -> None:
    """Raise UnusableInput where a store has no room for so many joints."""
    if spec.joints > MOST_JOINTS:
        raise UnusableInput(f"{address}: a store has room for {MOST_JOINTS} joints, this arm has {spec.joints}")


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


PAGE = 10_000
"""Lines of a table that are held at once."""


def pages(
    database: Database,
    table: str,
    columns: Sequence[str],
    key: str = "number",
    where: str = "",
    values: Values | None = None,
    page: int = PAGE,
) -> Iterator[Line]:
    """Yield the lines of a ``table``, in order of its ``key``, which comes before their ``columns``.

    They are asked for a ``page`` at a time, because servers send their answers whole. ``where`` is a condition on
    them, with its ``values``.
    """
    known, conditions = dict(values or {}), [where] if where else []
    found: list[Line] = [()] * page
    while len(found) == page:
        chosen = f" WHERE {' AND '.join(conditions)}" if conditions else ""
        query = f'SELECT {", ".join([key, *columns])} FROM "{table}"{chosen} ORDER BY {key} LIMIT {page}'
        with database.translated():
            found = list(database.execute(query, known))
        yield from found
        if found:
            known["after"], conditions = found[-1][0], [*filter(None, [where]), f"{key} > :after"]

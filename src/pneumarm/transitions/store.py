"""The store: everything that was ever measured on an arm, raw, in one SQLite file.

Source: thesis section 3.2.3. Rows are identified by (sequence, step) and hold an observation and the command that
followed it, so that the store does not depend on how many steps a state window happens to take.

A sequence is written in one transaction and is durable when :meth:`Store.append` returns: the write-ahead log is
synced at every commit. One connection writes and does all the checkpoints; any number read at the same time, which
SQLite makes sure never check-point (two that do can corrupt the file in SQLite 3.7.0 to 3.51.2).
"""

import json
import math
import os
import sqlite3
import time as wall_clock
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

import pneumarm
from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.files import written_whole
from pneumarm.transitions.blocks import Blocks, Predicate
from pneumarm.transitions.lock import WriterLock
from pneumarm.transitions.possible import row_values
from pneumarm.transitions.quantiles import Quantiles
from pneumarm.transitions.rows import Mark, Recorded, Rows, joinable, unmarked
from pneumarm.transitions.schema import (
    LONGEST_SEQUENCE,
    connect,
    create_tables,
    damaged,
    further_columns,
    read_settings,
    translated,
    upgrade,
    version_of,
)

BLOCK = 200_000
"""Rows of a block, about; with one joint a block takes 20 MB."""


_STEPS = 1 << 32  # more than any step of a sequence


class SequenceEntry(NamedTuple):
    """What the store knows of a sequence besides its rows."""

    number: int
    run: int | None
    kind: str
    at_rest: bool
    rows: int
    transitions: int
    info: dict[str, Any]


class Store:
    """A store on disk; a context manager. Iterating over it gives :class:`Rows`, block by block, again and again."""

    def __init__(self, path: Path, connection: sqlite3.Connection, lock: WriterLock | None) -> None:
        self.path = path
        self._connection = connection
        self._lock = lock
        self._run: int | None = None
        self.spec: ArmSpec
        """The arm that the rows are of."""
        self.valves: bool
        """Whether the commands are valves -1, 0, +1 or pulses in between; imported ones may be continuous."""
        with translated(path):
            self.spec, self.valves = read_settings(connection, path)
            if lock is not None:
                upgrade(connection)
            self.further: tuple[str, ...] = further_columns(self.spec, version_of(connection))
            """Names of the further sensors whose readings it holds; in a store of an older version, none."""
            self._check_sequences()

    @classmethod
    def create(cls, path: Path | str, spec: ArmSpec, valves: bool = True) -> "Store":
        """Make an empty store for the arm ``spec`` and return it for writing.

        Raises:
            UnusableInput: there is something at ``path`` already, or its folder is missing or cannot be written.

        """
        path = Path(path)
        lock = lock_vacant(path)
        try:
            with written_whole(path) as temporary:
                create_tables(temporary, spec, valves)
            return cls._opened(path, lock)
        except BaseException:
            lock.release()
            raise

    @classmethod
    def append_to(cls, path: Path | str) -> "Store":
        """Return the store at ``path`` for writing.

        Raises:
            UnusableInput: it is not a store, or it is damaged, or another process is writing to it.

        """
        path = Path(path)
        if not path.parent.is_dir():
            raise UnusableInput(f"{path}: the folder {path.parent} does not exist")
        lock = WriterLock(path)
        try:
            return cls._opened(path, lock)
        except BaseException:
            lock.release()
            raise

    @classmethod
    def for_arm(cls, path: Path | str, spec: ArmSpec) -> "Store":
        """Return the store at ``path`` for writing; made for the arm ``spec`` where there is none."""
        return cls.append_to(path) if Path(path).exists() else cls.create(path, spec)

    @classmethod
    def open(cls, path: Path | str) -> "Store":
        """Return the store at ``path`` for reading, also while another process writes to it.

        Raises:
            UnusableInput: it is not a store, or it is damaged.

        """
        return cls._opened(Path(path), None)

    @classmethod
    def _opened(cls, path: Path, lock: WriterLock | None) -> "Store":
        connection = connect(path, writer=lock is not None)
        try:
            return cls(path, connection, lock)
        except BaseException:
            connection.close()
            raise

    def close(self) -> None:
        """Close the file and let go of the lock. May be called twice."""
        self._connection.close()
        if self._lock is not None:
            self._lock.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # ---- what is in it

    @property
    def joints(self) -> int:
        """Number of joints."""
        return self.spec.joints

    @property
    def transitions(self) -> int:
        """Number of transitions: rows with a command and the row of the next step, none of them marked."""
        return int(self._one("SELECT coalesce(sum(transitions), 0) FROM sequences"))

    @property
    def sequences(self) -> int:
        """Number of sequences; they are numbered from 1."""
        return int(self._one("SELECT count(*) FROM sequences"))

    def catalogue(self, run: int | None = None) -> Iterator[SequenceEntry]:
        """Yield what is known of every sequence, or of those of a run."""
        query = "SELECT number, run, kind, at_rest, rows, transitions, info FROM sequences"
        with translated(self.path):
            for number, of_run, kind, at_rest, rows, transitions, info in self._connection.execute(
                f"{query} WHERE ?1 IS NULL OR run = ?1 ORDER BY number", (run,)
            ):
                yield SequenceEntry(number, of_run, kind, bool(at_rest), rows, transitions, json.loads(info))

    def runs(self) -> dict[int, dict[str, Any]]:
        """Return for each run its purpose, settings, arm, version of pneumarm and time of its beginning."""
        with translated(self.path):
            found = self._connection.execute("SELECT number, purpose, metadata FROM runs ORDER BY number").fetchall()
        return {number: {"purpose": purpose, **json.loads(metadata)} for number, purpose, metadata in found}

    def state(self, name: str = "arm") -> bytes | None:
        """Return the state last kept under ``name``, or None."""
        with translated(self.path):
            found = self._connection.execute("SELECT value FROM state WHERE name = ?", (name,)).fetchone()
        return None if found is None else bytes(found[0])

    def __iter__(self) -> Iterator[Rows]:
        return iter(self.blocks())

    def blocks(
        self,
        rows: int = BLOCK,
        sequences: Predicate | None = None,
        kinds: Collection[str] | None = None,
        *,
        marked: bool = False,
    ) -> "Blocks":
        """Return the rows as blocks of whole sequences of about ``rows`` rows, in bounded memory.

        ``sequences`` and ``kinds`` choose what is read. Marked rows are left out, which leaves a gap in the steps
        that no transition spans, unless ``marked`` asks for them. The result can be iterated over again and again.
        """
        return Blocks(self, rows, sequences, kinds, marked)

    def marks(self, number: int | None = None) -> dict[int, list[Mark]]:
        """Return the marks of every sequence that has some, or of sequence ``number``, in the order of marking."""
        found: dict[int, list[Mark]] = {}
        for sequence, mark in self._marks("?1 IS NULL OR sequence = ?1", (number,)):
            found.setdefault(sequence, []).append(mark)
        return found

    def marked_rows(self, run: int) -> dict[str, int]:
        """Return how many rows of ``run`` are marked, by reason; a row with several marks counts for each reason."""
        with translated(self.path):
            if version_of(self._connection) == 1:
                return {}
            found = self._connection.execute(
                "SELECT marks.reason, count(DISTINCT rows.sequence * ? + rows.step) FROM marks "
                "JOIN sequences ON sequences.number = marks.sequence AND sequences.run = ? "
                "JOIN rows ON rows.sequence = marks.sequence AND rows.step BETWEEN marks.first AND marks.last "
                "GROUP BY marks.reason ORDER BY min(marks.rowid)",
                (_STEPS, run),
            ).fetchall()
        return {str(reason): int(rows) for reason, rows in found}

    def _marks(self, condition: str, values: tuple[Any, ...]) -> list[tuple[int, Mark]]:
        with translated(self.path):
            if version_of(self._connection) == 1:
                return []
            query = f"SELECT sequence, first, last, reason FROM marks WHERE {condition} ORDER BY sequence, rowid"
            found = self._connection.execute(query, values).fetchall()
        try:
            return [(int(sequence), Mark(first, last, reason)) for sequence, first, last, reason in found]
        except (UnusableInput, TypeError, ValueError) as error:
            raise damaged(self.path, f"an impossible mark: {error}") from error

    def percentiles(
        self,
        shares: ArrayLike = (1.0, 99.0),
        sequences: Predicate | None = None,
        kinds: Collection[str] | None = None,
    ) -> NDArray[np.float64]:
        """Return percentiles of the stored angles, shape (joints, len(shares)) [counts].

        Equal to ``numpy.percentile`` for integer counts up to 4095, within 0.03 % of the value for others; bounded
        memory. The default is the range that goals are drawn from.

        Raises:
            UnusableInput: nothing is stored.

        """
        counted = Quantiles(self.joints)
        for block in self.blocks(sequences=sequences, kinds=kinds):
            counted.add(block.angle)
        if not counted.total:
            raise UnusableInput(f"{self.path}: holds no rows; collect some first")
        return counted(np.asarray(shares, np.float64) / 100).T

    # ---- writing

    def check_arm(self, spec: ArmSpec) -> None:
        """Raise UnusableInput where what an arm of ``spec`` does cannot be added: the store is of another one."""
        if not self.valves:
            raise UnusableInput(f"{self.path}: holds continuous commands; collect into a store of its own")
        mine, kept = asdict(spec), asdict(self.spec)
        different = [f"{name} was {kept[name]!r}, is {mine[name]!r}" for name in kept if mine[name] != kept[name]]
        if different:
            raise UnusableInput(f"{self.path}: was made for another arm ({'; '.join(different)}); give another file")

    def begin_run(self, purpose: str, settings: Mapping[str, Any]) -> int:
        """Begin a run, to which what is appended from now on belongs, and return its number."""
        metadata = {
            "settings": dict(settings),
            "arm": asdict(self.spec),
            "version": pneumarm.__version__,
            "started": wall_clock.strftime("%Y-%m-%dT%H:%M:%SZ", wall_clock.gmtime()),
        }
        with self._writing() as connection:
            cursor = connection.execute(
                "INSERT INTO runs (purpose, metadata) VALUES (?, ?)", (purpose, _as_json(metadata))
            )
        self._run = cursor.lastrowid
        assert self._run is not None
        return self._run

    def resume_run(self, purpose: str, settings: Mapping[str, Any]) -> int:
        """Go on with the run of this purpose, or begin one where there is none; return its number.

        Raises:
            UnusableInput: it was begun with other settings.

        """
        for number, run in self.runs().items():
            if run["purpose"] != purpose:
                continue
            before, now = run["settings"], json.loads(json.dumps(dict(settings)))
            different = [name for name in before.keys() | now.keys() if before.get(name) != now.get(name)]
            if different:
                changes = ", ".join(f"{n} was {before.get(n)!r}, is {now.get(n)!r}" for n in sorted(different))
                raise UnusableInput(
                    f"{self.path}: its {purpose} run has other settings ({changes}); give those or another file"
                )
            self._run = number
            return number
        return self.begin_run(purpose, settings)

    def append(self, recorded: Recorded, state: Mapping[str, bytes] | None = None) -> int:
        """Write a sequence, and states to go on from after it, and return its number: it is durable then.

        Raises:
            UnusableInput: shapes or numbers are impossible; nothing was written.
            PneumarmError: the disk is full, read-only or broken; nothing of this sequence was written.

        """
        return self.append_all([recorded], state)

    def append_all(self, recorded: Iterable[Recorded], state: Mapping[str, bytes] | None = None) -> int:
        """Write sequences in one transaction, all or none, and return the number of the last one."""
        with self._writing() as connection:
            number = int(self._one("SELECT coalesce(max(number), 0) FROM sequences"))
            for one in recorded:
                number += 1
                self._insert(connection, number, one)
            for name, value in (state or {}).items():
                connection.execute("INSERT OR REPLACE INTO state VALUES (?, ?)", (name, value))
        return number

    def mark(self, number: int, marks: Iterable[Mark]) -> None:
        """Mark steps of sequence ``number``, so that nothing is learned from them; marks are never taken back.

        Raises:
            UnusableInput: there is no such sequence.

        """
        with self._writing() as connection:
            steps = connection.execute("SELECT step FROM rows WHERE sequence = ? ORDER BY step", (number,)).fetchall()
            if not steps:
                raise UnusableInput(f"{self.path}: there is no sequence {number} to mark")
            self._insert_marks(connection, number, marks)
            left = joinable(np.array(steps, np.int64).ravel(), self.marks(number).get(number, []))
            connection.execute("UPDATE sequences SET transitions = ? WHERE number = ?", (left, number))

    def mark_since(self, time: float, reason: str, run: int) -> None:
        """Mark all rows of ``run`` read at ``time`` [s] or later, the newest sequences, that are not marked yet.

        Sequences before the arm's clock last began anew have times of another clock, and are left as they are.
        """
        with translated(self.path):
            numbers = self._connection.execute(
                "SELECT number FROM sequences WHERE run = ? ORDER BY number DESC", (run,)
            ).fetchall()
        after = math.inf  # when the next sequence began
        for (number,) in numbers:
            with translated(self.path):
                rows = self._connection.execute(
                    "SELECT step, time FROM rows WHERE sequence = ? ORDER BY step", (number,)
                ).fetchall()
            steps = [step for step, read in rows if read >= time]
            if not steps or rows[-1][1] > after:
                return
            after = rows[0][1]
            first, last = steps[0], steps[-1]
            marks = self.marks(number).get(number, [])
            if unmarked(np.array(steps, np.int64), marks).any():
                self.mark(number, [Mark(first, last, reason)])

    @staticmethod
    def _insert_marks(connection: sqlite3.Connection, number: int, marks: Iterable[Mark]) -> None:
        connection.executemany(
            "INSERT INTO marks VALUES (?, ?, ?, ?)", ((number, one.first, one.last, one.reason) for one in marks)
        )

    def _insert(self, connection: sqlite3.Connection, number: int, one: Recorded) -> None:
        values = row_values(one, self.spec, self.further, self.valves)
        connection.execute(
            "INSERT INTO sequences VALUES (?, ?, ?, ?, ?, ?, ?)",
            (
                number,
                self._run,
                one.kind,
                int(one.at_rest),
                len(one),
                one.transitions,
                _as_json(one.info),
            ),
        )
        self._insert_marks(connection, number, one.marks)
        places = ", ".join("?" * (values.shape[1] + 1))
        # SQLite stores NaN as NULL, which is what a row without a command has.
        connection.executemany(
            f"INSERT INTO rows VALUES ({number}, {places})",
            zip(one.step.tolist(), *values.T.tolist(), strict=True),
        )

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """Give the connection within a transaction: durable when this ends well, rolled back when it does not."""
        if self._lock is None:
            raise PneumarmError(f"{self.path}: was opened for reading; open it with Store.append_to to write")
        connection = self._connection
        with translated(self.path):
            connection.execute("BEGIN IMMEDIATE")
            try:
                yield connection
                connection.execute("COMMIT")
            except BaseException:
                if connection.in_transaction:
                    connection.execute("ROLLBACK")
                raise

    # ---- checks

    def check(self) -> None:
        """Read everything and check it.

        Raises:
            UnusableInput: something is damaged; the message says what.

        """
        with translated(self.path):
            found = self._one("PRAGMA integrity_check(1)")
            if found != "ok":
                raise damaged(self.path, str(found))
            numbers, joined = 0, 0
            for block in self.blocks(marked=True):
                numbers += len(np.unique(block.sequence))
            for block in self.blocks():
                joined += int(((np.diff(block.sequence) == 0) & (np.diff(block.step) == 1)).sum())
            stray = self._one("SELECT count(*) FROM rows") - self._one("SELECT coalesce(sum(rows), 0) FROM sequences")
        if numbers != self.sequences or joined != self.transitions or stray:
            raise damaged(self.path, "its catalogue does not agree with its rows")

    def _check_sequences(self) -> None:
        count, first, last, shortest, longest = self._connection.execute(
            "SELECT count(*), min(number), max(number), min(rows), max(rows) FROM sequences"
        ).fetchone()
        if count and not (first == 1 and last == count and shortest >= 2 and longest <= LONGEST_SEQUENCE):
            raise damaged(self.path, "its sequences are not numbered from 1 or are of impossible lengths")

    def _one(self, query: str) -> Any:
        with translated(self.path):
            return self._connection.execute(query).fetchone()[0]


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


def _as_json(info: Mapping[str, Any]) -> str:
    try:
        return json.dumps(dict(info), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise UnusableInput(
            f"a sequence's or a run's info must be of JSON's types, with finite numbers: {error}"
        ) from error

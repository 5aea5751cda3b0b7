"""The store: everything that was ever measured on an arm, raw, in one SQLite file or a database on a server.

Source: thesis section 3.2.3. Rows are identified by (sequence, step) and hold an observation and the command that
followed it, so that the store does not depend on how many steps a state window happens to take.

A sequence is written in one transaction and is durable when :meth:`Store.append` returns. One process writes; any
number read at the same time. What databases differ in is behind :class:`~pneumarm.transitions.database.Database`.
"""

import copy
import json
import math
import time as wall_clock
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, replace
from itertools import chain
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.address import Address, ServerAddress, StoreAddress, address_of
from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.extras import extra
from pneumarm.transitions.blocks import STEPS, Blocks, Predicate, stored_marks
from pneumarm.transitions.choice import hashed_uniform
from pneumarm.transitions.database import (
    LONGEST_SEQUENCE,
    MOST_JOINTS,
    Database,
    damaged,
    kept_json,
)
from pneumarm.transitions.doubtful import with_doubtful_marked
from pneumarm.transitions.possible import row_values
from pneumarm.transitions.quantiles import Quantiles
from pneumarm.transitions.rows import Mark, Recorded, Rows, joinable, unmarked
from pneumarm.transitions.schema import SqliteFile
from pneumarm.version import __version__

BLOCK = 200_000
"""Rows of a block, about; with one joint a block takes 20 MB."""

MOST_USED = 400_000
"""Transitions that a simulation is fitted to and judged by at most: twice as many as the thesis collects."""
_DRAWN = 11  # seed of the draw of these, not that of what is held out

_ALL = (1, 1 << 62)  # the first and the last number of any sequence


class SequenceEntry(NamedTuple):
    """What the store knows of a sequence besides its rows."""

    number: int
    run: int | None
    kind: str
    at_rest: bool
    rows: int
    transitions: int
    info: dict[str, Any]


class _Part(NamedTuple):
    """What was drawn from a store."""

    sequences: frozenset[int]
    transitions: int
    of: int
    """Transitions of the whole store."""


class Store:
    """A store, opened; a context manager. Iterating over it gives :class:`Rows`, block by block, again and again.

    Where it is, is a path, or the address of a database on a server: ``postgresql://user@host/database`` or
    ``mysql://user@host/database``.
    """

    def __init__(self, database: Database) -> None:
        self.address: Address = database.address
        """Where it is; shown without a password."""
        self.database = database
        self._run: int | None = None
        self._part: _Part | None = None
        self.spec = database.spec
        """The arm that the rows are of."""
        self.valves = database.valves
        """Whether the commands are valves -1, 0, +1 or pulses in between; imported ones may be continuous."""
        with database.opening():
            self.further = database.further
            """Names of the further sensors whose readings it holds; in a store of an older version, none."""
            self._check_sequences()

    @classmethod
    def create(cls, address: StoreAddress, spec: ArmSpec, valves: bool = True) -> "Store":
        """Make an empty store for the arm ``spec`` and return it for writing.

        Raises:
            UnusableInput: there is something at ``address`` already, its folder is missing, or nothing can be written
                there.

        """
        with cls.made_whole(address, spec, valves):
            pass
        return cls.append_to(address)

    @classmethod
    @contextmanager
    def made_whole(cls, address: StoreAddress, spec: ArmSpec, valves: bool = True) -> "Iterator[Store]":
        """Give an empty store to be filled, which is at ``address`` when all went well, and nothing otherwise.

        Raises:
            UnusableInput: as for :meth:`create`.

        """
        place = address_of(address)
        if spec.joints > MOST_JOINTS:
            raise UnusableInput(f"{place}: a store has room for {MOST_JOINTS} joints, this arm has {spec.joints}")
        with _kind(place).made_whole(place, spec, valves) as database:
            yield cls(database)

    @classmethod
    @contextmanager
    def added_whole(cls, address: StoreAddress, spec: ArmSpec, valves: bool = True) -> "Iterator[Store]":
        """Give the store at ``address``, made where there is none, to be added to: all that is written, or nothing.

        Raises:
            UnusableInput: it is of another arm; else as for :meth:`create` and :meth:`append_to`.

        """
        place = address_of(address)
        is_there = _kind(place).is_there(place)
        with cls.append_to(place) if is_there else cls.made_whole(place, spec, valves) as store:
            store.check_arm(spec, valves)
            with store.writing():
                yield store

    @classmethod
    def append_to(cls, address: StoreAddress) -> "Store":
        """Return the store at ``address`` for writing.

        Raises:
            UnusableInput: it is not a store, or it is damaged, or another process is writing to it.

        """
        place = address_of(address)
        return cls(_kind(place).opened(place, writer=True))

    @classmethod
    def for_arm(cls, address: StoreAddress, spec: ArmSpec) -> "Store":
        """Return the store at ``address`` for writing; made for the arm ``spec`` where there is none."""
        place = address_of(address)
        return cls.append_to(place) if _kind(place).is_there(place) else cls.create(place, spec)

    @classmethod
    def open(cls, address: StoreAddress) -> "Store":
        """Return the store at ``address`` for reading, also while another process writes to it.

        Raises:
            UnusableInput: it is not a store, or it is damaged.

        """
        place = address_of(address)
        return cls(_kind(place).opened(place, writer=False))

    def close(self) -> None:
        """Close it and let go of the lock. May be called twice."""
        self.database.close()

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
        if self._part is not None:
            return self._part.transitions
        return int(self._one("SELECT coalesce(sum(transitions), 0) FROM sequences"))

    def drawn(self, most: int = MOST_USED) -> "Store":
        """Return the store for reading as if it held ``most`` transitions: whole sequences, drawn evenly by lot.

        One that holds no more is returned as it is. The same sequences are drawn again and again.
        """
        total = self.transitions
        if self._part is not None or total <= most:
            return self
        pairs = chain.from_iterable(self.database.pages("sequences", ("transitions",)))
        number, transitions = np.fromiter(pairs, np.int64).reshape(-1, 2).T
        order = np.argsort(hashed_uniform(_DRAWN, number))
        order = order[np.cumsum(transitions[order]) <= most]
        part = copy.copy(self)
        part._part = _Part(frozenset(number[order].tolist()), int(transitions[order].sum()), total)
        return part

    @property
    def used(self) -> list[str]:
        """What to tell a person of how much is used of a store that was :meth:`drawn` from."""
        if self._part is None:
            return []
        return [f"used {self._part.transitions:,} of {self._part.of:,} transitions, evenly drawn"]

    @property
    def sequences(self) -> int:
        """Number of sequences; they are numbered from 1."""
        return int(self._one("SELECT count(*) FROM sequences"))

    def catalogue(self, run: int | None = None) -> Iterator[SequenceEntry]:
        """Yield what is known of every sequence, or of those of a run."""
        where = "" if run is None else "run = :run"
        _, *columns = self.database.columns("sequences")
        for number, of_run, kind, at_rest, rows, transitions, info in self.database.pages(
            "sequences", columns, where=where, values={"run": run} if where else {}
        ):
            if self._part is not None and number not in self._part.sequences:
                continue
            about = kept_json(info, self.address, f"what sequence {number} is")
            yield SequenceEntry(number, of_run, kind, bool(at_rest), rows, transitions, about)

    @property
    def keeps_marks(self) -> bool:
        """Whether it can hold marks; a store of version 1 that is opened for reading cannot."""
        return self.database.version > 1

    def snapshot(self) -> AbstractContextManager[None]:
        """Have all that is read within be as it was at one moment, whatever is written meanwhile."""
        return self.database.snapshot()

    def runs(self) -> dict[int, dict[str, Any]]:
        """Return for each run its purpose, settings, arm, version of pneumarm and time of its beginning."""
        found = self.database.pages("runs", ("purpose", "metadata"))
        return {
            number: {"purpose": purpose, **kept_json(metadata, self.address, f"what run {number} is")}
            for number, purpose, metadata in found
        }

    def state(self, name: str = "arm") -> bytes | None:
        """Return the state last kept under ``name``, or None."""
        found = self.database.query("SELECT value FROM state WHERE name = :name", {"name": name})
        return bytes(found[0][0]) if found else None

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
        if (part := self._part) is None:
            return Blocks(self.database, rows, sequences, kinds, marked)
        drawn = np.array(sorted(part.sequences), np.int64)

        def among_drawn(numbers: NDArray[np.int64]) -> NDArray[np.bool_]:
            wanted: NDArray[np.bool_] = np.isin(numbers, drawn)
            return wanted if sequences is None else wanted & sequences(numbers)

        return Blocks(self.database, rows, among_drawn, kinds, marked)

    def marks(self, number: int | None = None) -> dict[int, list[Mark]]:
        """Return the marks of every sequence that has some, or of sequence ``number``, in the order of marking."""
        found: dict[int, list[Mark]] = {}
        for sequence, mark in stored_marks(self.database, *(_ALL if number is None else (number, number))):
            found.setdefault(sequence, []).append(mark)
        return found

    def marked_rows(self, run: int | None = None) -> dict[str, int]:
        """Return how many rows of ``run``, or of all, are marked, by reason; one marked twice counts for both."""
        if not self.keeps_marks:
            return {}
        of_run = "" if run is None else "AND sequences.run = :run "
        found = self.database.query(
            f'SELECT marks.reason, count(DISTINCT "rows".sequence * {STEPS} + "rows".step) FROM marks '
            f"JOIN sequences ON sequences.number = marks.sequence {of_run}"
            'JOIN "rows" ON "rows".sequence = marks.sequence '
            'AND "rows".step BETWEEN marks.first AND marks.last '
            "GROUP BY marks.reason ORDER BY min(marks.rowid)",
            {} if run is None else {"run": run},
        )
        return {str(reason): int(rows) for reason, rows in found}

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
            raise UnusableInput(f"{self.address}: holds no rows; collect some first")
        return counted(np.asarray(shares, np.float64) / 100).T

    # ---- writing

    def check_arm(self, spec: ArmSpec, valves: bool = True) -> None:
        """Raise UnusableInput where what an arm of ``spec`` does cannot be added: the store is of another one."""
        if self.valves != valves:
            held, given = ("valves or pulses", "continuous commands")[:: 1 if self.valves else -1]
            raise UnusableInput(f"{self.address}: holds {held}, not {given}; give another store")
        # Nothing that is stored depends on the links: they may be measured, or measured again, while an arm is used.
        mine, kept = asdict(replace(spec, links=())), asdict(replace(self.spec, links=()))
        different = [f"{name} was {kept[name]!r}, is {mine[name]!r}" for name in kept if mine[name] != kept[name]]
        if different:
            raise UnusableInput(
                f"{self.address}: was made for another arm ({'; '.join(different)}); give another store"
            )

    def begin_run(self, purpose: str, settings: Mapping[str, Any]) -> int:
        """Begin a run, to which what is appended from now on belongs, and return its number."""
        metadata = {
            "settings": dict(settings),
            "arm": asdict(self.spec),
            "version": __version__,
            "started": wall_clock.strftime("%Y-%m-%dT%H:%M:%SZ", wall_clock.gmtime()),
        }
        with self.writing() as database:
            number = 1 + int(self._one("SELECT coalesce(max(number), 0) FROM runs"))
            database.insert("runs", [(number, purpose, _as_json(metadata))])
        self._run = number
        return number

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
                    f"{self.address}: its {purpose} run has other settings ({changes}); give those or another store"
                )
            self._run = number
            return number
        return self.begin_run(purpose, settings)

    def append(self, recorded: Recorded, state: Mapping[str, bytes] | None = None, *, grows: bool = False) -> int:
        """Write a sequence, and states to go on from after it, and return its number: it is durable then.

        Rows that no sound sensor gives are marked (:mod:`pneumarm.transitions.doubtful`), unless the sequence
        ``grows`` (:meth:`extend`): whoever adds to it marks them when it is complete.

        Raises:
            UnusableInput: shapes or numbers are impossible; nothing was written.
            PneumarmError: the disk is full, read-only or broken; nothing of this sequence was written.

        """
        return self.append_all([recorded], state, grows=grows)

    def append_all(
        self, recorded: Iterable[Recorded], state: Mapping[str, bytes] | None = None, *, grows: bool = False
    ) -> int:
        """Write sequences in one transaction, all or none, and return the number of the last one."""
        with self.writing() as database:
            number = int(self._one("SELECT coalesce(max(number), 0) FROM sequences"))
            for one in recorded:
                number += 1
                self._insert(number, one, grows)
            for name, value in (state or {}).items():
                database.execute("DELETE FROM state WHERE name = :name", {"name": name})
                database.insert("state", [(name, value)])
        return number

    def extend(self, number: int, more: Recorded) -> None:
        """Add to sequence ``number``, in which nothing is marked; it is durable then.

        ``more`` begins with the last row that is stored, now with its command. Who adds sees to it that
        the sequence does not get longer than one may be.

        Raises:
            UnusableInput: the sequence does not end in that row, or what follows is impossible; nothing was written.
            PneumarmError: as for :meth:`append`.

        """
        values = row_values(more, self.spec, self.further, self.valves)
        query = 'SELECT step, time FROM "rows" WHERE sequence = :number ORDER BY step DESC LIMIT 1'
        with self.writing() as database:
            step, time = next(iter(database.execute(query, {"number": number})), (0, None))
            if time != more.time[0]:
                raise UnusableInput(f"{self.address}: sequence {number} does not end where this goes on")
            last = {"number": number, "step": step}
            database.execute('DELETE FROM "rows" WHERE sequence = :number AND step = :step', last)
            self.insert_rows(np.full(len(more), number), more.step + step, values)
            added = {"number": number, "more": len(more) - 1, "transitions": more.transitions}
            query = 'UPDATE sequences SET "rows" = "rows" + :more, transitions = transitions + :transitions '
            database.execute(query + "WHERE number = :number", added)

    def mark(self, number: int, marks: Iterable[Mark]) -> None:
        """Mark steps of sequence ``number``, so that nothing is learned from them; marks are never taken back.

        Raises:
            UnusableInput: there is no such sequence.

        """
        with self.writing() as database:
            query = 'SELECT step FROM "rows" WHERE sequence = :number ORDER BY step'
            steps = [step for (step,) in database.execute(query, {"number": number})]
            if not steps:
                raise UnusableInput(f"{self.address}: there is no sequence {number} to mark")
            self._insert_marks(number, marks)
            left = joinable(np.array(steps, np.int64), self.marks(number).get(number, []))
            changed = {"transitions": left, "number": number}
            database.execute("UPDATE sequences SET transitions = :transitions WHERE number = :number", changed)

    def mark_since(self, time: float, reason: str, run: int) -> None:
        """Mark all rows of ``run`` read at ``time`` [s] or later, the newest sequences, that are not marked yet.

        Sequences before the arm's clock last began anew have times of another clock, and are left as they are.
        """
        numbers = self.database.query(
            "SELECT number FROM sequences WHERE run = :run ORDER BY number DESC", {"run": run}
        )
        after = math.inf  # when the next sequence began
        query = 'SELECT step, time FROM "rows" WHERE sequence = :number ORDER BY step'
        for (number,) in numbers:
            rows = self.database.query(query, {"number": number})
            steps = [step for step, read in rows if read >= time]
            if not steps or rows[-1][1] > after:
                return
            after = rows[0][1]
            first, last = steps[0], steps[-1]
            marks = self.marks(number).get(number, [])
            if unmarked(np.array(steps, np.int64), marks).any():
                self.mark(number, [Mark(first, last, reason)])

    def _insert_marks(self, number: int, marks: Iterable[Mark]) -> None:
        lines = [(number, one.first, one.last, one.reason) for one in marks]
        if lines:
            self.database.insert("marks", lines)

    def _insert(self, number: int, one: Recorded, grows: bool) -> None:
        values = row_values(one, self.spec, self.further, self.valves)
        if not grows:
            one = with_doubtful_marked(one, self.spec, self.valves)
        known = (number, self._run, one.kind, int(one.at_rest), len(one), one.transitions, _as_json(one.info))
        self.database.insert("sequences", [known])
        self._insert_marks(number, one.marks)
        self.insert_rows(np.full(len(one), number), one.step, values)

    def insert_rows(self, sequence: NDArray[np.int64], step: NDArray[np.int64], values: NDArray[np.float64]) -> None:
        """Add rows (n,) with their ``values`` (n, columns), within a transaction."""
        lines = list(zip(sequence.tolist(), step.tolist(), *values.T.tolist(), strict=True))
        for k in np.flatnonzero(np.isnan(values).any(axis=1)).tolist():  # rows without a command
            lines[k] = tuple(None if value != value else value for value in lines[k])
        self.database.insert("rows", lines)

    @contextmanager
    def writing(self) -> Iterator[Database]:
        """Give the database within a transaction: durable when this ends well, rolled back when it does not.

        Within another one it is part of that.
        """
        if not self.database.writer:
            raise PneumarmError(f"{self.address}: was opened for reading; open it with Store.append_to to write")
        with self.database.transaction():
            yield self.database

    # ---- checks

    def check(self) -> None:
        """Read everything and check it.

        Raises:
            UnusableInput: something is damaged; the message says what.

        """
        with self.database.translated():
            self.database.check()
            numbers, joined = 0, 0
            for block in self.blocks(marked=True):
                numbers += len(np.unique(block.sequence))
            for block in self.blocks():
                joined += int(((np.diff(block.sequence) == 0) & (np.diff(block.step) == 1)).sum())
            known = self._one('SELECT coalesce(sum("rows"), 0) FROM sequences')
            stray = self._one('SELECT count(*) FROM "rows"') - known
        if numbers != self.sequences or joined != self.transitions or stray:
            raise damaged(self.address, "its catalogue does not agree with its rows")

    def _check_sequences(self) -> None:
        ((count, first, last, shortest, longest),) = self.database.execute(
            'SELECT count(*), min(number), max(number), min("rows"), max("rows") FROM sequences'
        )
        numbers = isinstance(shortest, int) and isinstance(longest, int)  # of SQLite they may be anything
        if count and not (numbers and first == 1 and last == count and shortest >= 2 and longest <= LONGEST_SEQUENCE):
            raise damaged(self.address, "its sequences are not numbered from 1 or are of impossible lengths")

    def _one(self, query: str) -> Any:
        return self.database.query(query)[0][0]


def _kind(address: Address) -> type[Database]:
    """Return what keeps the store at ``address``."""
    if not isinstance(address, ServerAddress):
        return SqliteFile
    extra("sqlalchemy", "server", f"{address}: a store on a server")
    from pneumarm.transitions.server import Server

    return Server


def _as_json(info: Mapping[str, Any]) -> str:
    try:
        return json.dumps(dict(info), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise UnusableInput(
            f"a sequence's or a run's info must be of JSON's types, with finite numbers: {error}"
        ) from error

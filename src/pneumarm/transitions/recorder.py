"""Store what an arm does while it does it: what was recorded is kept however the movement ends.

A sequence grows in the store while the arm moves, so that a process that is killed loses less than a second of it. A
thread of its own writes: no control period waits for the disk.
"""

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from time import monotonic
from typing import Any

from pneumarm.address import StoreAddress
from pneumarm.arm.cycle import Step
from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.transitions.doubtful import with_doubtful_marked
from pneumarm.transitions.rows import Recorded, broken_at
from pneumarm.transitions.store import Store

EVERY = 0.5
"""Time between two transactions, on the computer's clock [s]: with that of a transaction less than a second."""
LONGEST_PART = 10_000
"""Rows after which a longer movement goes on as another sequence; each costs a window's length of transitions."""


class Recorder:
    """Adds movements to a store as they happen; see :func:`recorder`."""

    def __init__(self, store: Store, writer: Executor, info: Mapping[str, Any]) -> None:
        self._store, self._writer, self._info = store, writer, info

    @contextmanager
    def sequence(self, kind: str, info: Mapping[str, Any]) -> Iterator[Callable[[Step], None]]:
        """Give what adds a step to a new sequence of this ``kind``; all of it is durable when this ends.

        Where the movement breaks off, the last row that was stored is marked with why.

        Raises:
            PneumarmError: it cannot be stored any more; raised while the arm moves, too, which ends the movement.

        """
        growing = _Growing(self._store, kind, {**self._info, **info})
        written, due = self._writer.submit(growing.store), monotonic() + EVERY

        def add(step: Step) -> None:
            nonlocal written, due
            growing.waiting.append(step)
            if monotonic() >= due and written.done():
                written.result()  # raises what went wrong
                written, due = self._writer.submit(growing.store), monotonic() + EVERY

        try:
            yield add
        except BaseException as why:
            with suppress(Exception):  # the first failure is the one to tell of
                self._writer.submit(growing.end, why).result()
            raise
        self._writer.submit(growing.end).result()


@contextmanager
def recorder(
    address: StoreAddress | None, spec: ArmSpec, info: Mapping[str, Any] | None = None
) -> Iterator[Recorder | None]:
    """Give what adds movements of the arm ``spec`` to the store at ``address``, made if there is none; else None.

    ``info`` is kept with every sequence, of JSON's types.

    Raises:
        UnusableInput: the store is one of another arm, or cannot be written.

    """
    if address is None:
        yield None
        return
    with ThreadPoolExecutor(1, "recorder") as writer:  # its thread alone uses the database
        store = writer.submit(Store.for_arm, address, spec).result()
        try:
            store.check_arm(spec)
            writer.submit(store.begin_run, "move", {}).result()
            yield Recorder(store, writer, info or {})
        finally:
            writer.submit(store.close).result()


class _Growing:
    """A movement that is stored while it grows; where it gets too long, it goes on as another sequence."""

    def __init__(self, store: Store, kind: str, info: Mapping[str, Any]) -> None:
        self.waiting: list[Step] = []
        """Steps that are not stored yet, after the last one that is; the arm's thread adds, the writing one takes."""
        self._store, self._kind, self._info = store, kind, dict(info)
        self._number: int | None = None  # of the sequence; None while none of its rows is stored
        self._stored: list[Step] = []  # what it holds
        self._before = self._step = 0  # its rows before the first that waits, and the step of that

    def store(self, *, ends: bool = False) -> None:
        """Store what is new; unless the movement ``ends``, a row that may be alone in the next sequence waits."""
        while self._before + len(self.waiting) > LONGEST_PART + 1:
            self._write(LONGEST_PART - self._before)
            del self.waiting[0]
            self._mark_doubtful()
            self._number, self._stored, self._before, self._step = None, [], 0, 0
        rows = len(self.waiting)
        self._write(rows if ends else min(rows, LONGEST_PART - self._before))

    def end(self, why: BaseException | None = None) -> None:
        """Store the rest, and mark the last row where the movement broke off, with ``why``."""
        try:
            self.store(ends=True)
        finally:
            self._mark_doubtful()
            if why is not None and self._number is not None:
                self._store.mark(self._number, [broken_at(self._step, why)])

    def _write(self, rows: int) -> None:
        """Store the first ``rows`` of those that wait; where one of them cannot be stored, those before it."""
        if rows < 2:  # nothing is new, or nothing to learn from
            return
        try:
            part = Recorded.from_steps(self.waiting[:rows], self._store.spec, kind=self._kind, info=self._info)
            if self._number is None:
                self._number = self._store.append(part, grows=True)
                self._info.setdefault("began", float(part.time[0]))  # by which what follows in other parts is placed
            else:
                self._store.extend(self._number, part)
        except UnusableInput:
            for _ in range(rows - 1 if rows > 2 else 0):
                self._write(2)
            raise
        self._stored[-1:] = self.waiting[:rows]
        del self.waiting[: rows - 1]
        self._before, self._step = self._before + rows - 1, self._step + int(part.step[-1])

    def _mark_doubtful(self) -> None:
        """Mark the rows that no sound sensor gives, now that the sequence is complete."""
        if self._number is not None:
            whole = Recorded.from_steps(self._stored, self._store.spec)
            marks = with_doubtful_marked(whole, self._store.spec, valves=True).marks
            if marks:
                self._store.mark(self._number, marks)

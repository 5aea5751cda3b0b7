"""Reading the rows of a store, block by block, checked, in bounded memory."""

from collections.abc import Callable, Collection, Iterator
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pneumarm.transitions.possible import are_possible
from pneumarm.transitions.rows import Rows, unmarked
from pneumarm.transitions.schema import LONGEST_SEQUENCE, damaged, row_columns, translated

if TYPE_CHECKING:
    from pneumarm.transitions.store import Store

Predicate = Callable[[NDArray[np.int64]], NDArray[np.bool_]]
"""Maps numbers of sequences (n,) to which of them are meant (n,)."""


class Blocks:
    """Rows of a store as blocks of whole sequences; every iteration reads them anew."""

    def __init__(
        self, store: "Store", rows: int, sequences: Predicate | None, kinds: Collection[str] | None, marked: bool
    ) -> None:
        self._store, self._rows, self._sequences, self._kinds = store, rows, sequences, kinds
        self._marked = marked

    def __iter__(self) -> Iterator[Rows]:
        number, length, at_rest = self._chosen()
        before = np.concatenate([[0], np.cumsum(length)])  # rows before each sequence, and all at the end
        begin = 0
        while begin < len(number):
            end = int(np.searchsorted(before, before[begin] + self._rows, "right")) - 1
            part = slice(begin, max(end, begin + 1))
            if len(block := self._read(number[part], length[part], at_rest[part])):
                yield block
            begin = part.stop

    def _chosen(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Return number, rows and at_rest of the sequences to read."""
        query = "SELECT number, rows, at_rest FROM sequences"
        kinds = list(self._kinds) if self._kinds is not None else []
        if self._kinds is not None:
            query += f" WHERE kind IN ({', '.join('?' * len(kinds))})"
        with translated(self._store.path):
            found = self._store._connection.execute(query + " ORDER BY number", kinds)
            table = np.fromiter(chain.from_iterable(found), np.int64).reshape(-1, 3)
        if self._sequences is not None:
            table = table[self._sequences(table[:, 0])]
        return table[:, 0], table[:, 1], table[:, 2].astype(bool)

    def _read(self, number: NDArray[np.int64], length: NDArray[np.int64], at_rest: NDArray[np.bool_]) -> Rows:
        store, joints = self._store, self._store.joints
        columns = ["step", *row_columns(joints, store.further)]
        query = f"SELECT {', '.join(columns)} FROM rows WHERE sequence = ? ORDER BY step LIMIT {LONGEST_SEQUENCE + 1}"
        execute = store._connection.execute
        total = int(length.sum())
        with translated(store.path):
            values = chain.from_iterable(chain.from_iterable(execute(query, (n,)) for n in number.tolist()))
            try:
                table = np.fromiter(values, np.float64, count=total * len(columns)).reshape(total, -1)
            except (ValueError, TypeError) as error:
                raise damaged(store.path, f"rows are missing or not numbers: {error}") from error
            surplus = next(values, None) is not None
        per_joint = table[:, 2 : 2 + 5 * joints].reshape(total, joints, 5)
        rows = Rows(
            sequence=np.repeat(number, length),
            step=np.nan_to_num(table[:, 0]).astype(np.int64),
            time=table[:, 1].copy(),
            angle=per_joint[:, :, 0].copy(),
            pressure=per_joint[:, :, 1:3].copy(),
            command=per_joint[:, :, 3:5].copy(),
            at_rest=np.repeat(at_rest, length),
            measured=dict(zip(store.further, table[:, 2 + 5 * joints :].T.copy(), strict=True)),
        )
        first = np.concatenate([[0], np.cumsum(length)[:-1]])
        if surplus or not are_possible(rows, first, store.spec, store.valves):
            raise damaged(store.path, f"impossible values in sequences {number[0]} to {number[-1]}")
        return rows if self._marked else self._without_marked(rows)

    def _without_marked(self, rows: Rows) -> Rows:
        """Return the rows that are not marked."""
        first, last = int(rows.sequence[0]), int(rows.sequence[-1])
        marks = self._store._marks("sequence BETWEEN ? AND ?", (first, last))
        if not marks:
            return rows
        kept = np.ones(len(rows), bool)
        for sequence, mark in marks:
            kept &= (rows.sequence != sequence) | unmarked(rows.step, [mark])
        return rows.where(kept)

"""Reading the rows of a store, block by block, checked, in bounded memory."""

from collections.abc import Callable, Collection, Iterator
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.transitions.database import Database, damaged, row_columns
from pneumarm.transitions.possible import are_possible
from pneumarm.transitions.rows import Mark, Rows

STEPS = 1 << 32
"""More than any step of a sequence."""
Predicate = Callable[[NDArray[np.int64]], NDArray[np.bool_]]
"""Maps numbers of sequences (n,) to which of them are meant (n,)."""


class Blocks:
    """Rows of a store as blocks of whole sequences; every iteration reads them anew."""

    def __init__(
        self, database: Database, rows: int, sequences: Predicate | None, kinds: Collection[str] | None, marked: bool
    ) -> None:
        self._database, self._rows, self._sequences, self._kinds = database, rows, sequences, kinds
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
        kinds = {f"kind_{k}": kind for k, kind in enumerate(self._kinds or ())}
        where = "" if self._kinds is None else f"kind IN ({', '.join(f':{name}' for name in kinds) or 'NULL'})"
        found = self._database.pages("sequences", ("rows", "at_rest"), where=where, values=kinds)
        table = np.fromiter(chain.from_iterable(found), np.int64).reshape(-1, 3)
        if self._sequences is not None:
            table = table[self._sequences(table[:, 0])]
        return table[:, 0], table[:, 1], table[:, 2].astype(bool)

    def _read(self, number: NDArray[np.int64], length: NDArray[np.int64], at_rest: NDArray[np.bool_]) -> Rows:
        database, joints, further = self._database, self._database.spec.joints, self._database.further
        columns = ["step", *row_columns(joints, further)]
        total = int(length.sum())
        query = (
            f'SELECT {", ".join(columns)} FROM "rows" WHERE sequence BETWEEN :first AND :last '
            "ORDER BY sequence, step LIMIT :most"
        )
        stretches = np.split(number, np.flatnonzero(np.diff(number) != 1) + 1)
        ends = [{"first": int(one[0]), "last": int(one[-1]), "most": total + 1} for one in stretches]
        with database.translated():
            values = chain.from_iterable(chain.from_iterable(database.execute(query, one) for one in ends))
            try:
                table = np.fromiter(values, np.float64, count=total * len(columns)).reshape(total, -1)
            except (ValueError, TypeError) as error:
                raise damaged(database.address, f"rows are missing or not numbers: {error}") from error
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
            measured=dict(zip(further, table[:, 2 + 5 * joints :].T.copy(), strict=True)),
        )
        first = np.concatenate([[0], np.cumsum(length)[:-1]])
        if surplus or not are_possible(rows, first, database.spec, database.valves):
            raise damaged(database.address, f"impossible values in sequences {number[0]} to {number[-1]}")
        return rows if self._marked else self._without_marked(rows)

    def _without_marked(self, rows: Rows) -> Rows:
        """Return the rows that are not marked."""
        first, last = int(rows.sequence[0]), int(rows.sequence[-1])
        marks = stored_marks(self._database, first, last)
        if not marks:
            return rows
        # A row is marked if, of the marks that begin at it or before, the one that ends last ends at it or after.
        ends = np.array([(n, min(one.first, STEPS - 1), n, min(one.last, STEPS - 1)) for n, one in marks], np.int64)
        begin, end = (ends.reshape(-1, 2, 2) @ [STEPS, 1]).T
        order, place = np.argsort(begin), rows.sequence * STEPS + rows.step
        latest = np.concatenate([[-1], np.maximum.accumulate(end[order])])
        return rows.where(latest[np.searchsorted(begin[order], place, "right")] < place)


def stored_marks(database: Database, first: int, last: int) -> list[tuple[int, Mark]]:
    """Return the marks of the sequences from ``first`` to ``last``, in the order of marking."""
    if database.version == 1:
        return []
    found = database.query(
        "SELECT sequence, first, last, reason FROM marks WHERE sequence BETWEEN :first AND :last "
        "GROUP BY sequence, first, last, reason ORDER BY sequence, min(rowid)",
        {"first": first, "last": last},
    )
    try:
        return [(int(sequence), Mark(begin, end, reason)) for sequence, begin, end, reason in found]
    except (UnusableInput, TypeError, ValueError) as error:
        raise damaged(database.address, f"an impossible mark: {error}") from error

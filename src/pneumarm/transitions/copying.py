"""Copy a store to another address, whole or not at all: a file to a server, or the other way round."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, islice, zip_longest
from typing import Any

import numpy as np

from pneumarm.address import StoreAddress
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.transitions.database import PAGE, Line
from pneumarm.transitions.rows import values_of
from pneumarm.transitions.store import Store

_ROWS = 20_000  # of a block, which is in memory as Python's numbers


@dataclass(frozen=True)
class CopyResult:
    """What was copied."""

    transitions: int
    sequences: int
    rows: int
    runs: int


_KEYS = {"runs": "number", "sequences": "number", "marks": "rowid", "state": "name"}
"""Tables besides that of the rows, and what their lines are copied in order of."""


def copy_store(source: StoreAddress, target: StoreAddress) -> CopyResult:
    """Copy the store at ``source``, as it is at one moment, to ``target``, where there is none yet.

    In bounded memory. What was written is read again and compared before it counts.

    Raises:
        UnusableInput: one cannot be opened or the other cannot be made.
        PneumarmError: reading or writing failed; there is nothing at ``target``.

    """
    with Store.open(source) as original, original.snapshot():
        if original.spec.further and not original.further:
            raise UnusableInput(
                f"{original.address}: is of an earlier version that kept no readings of {original.spec.further[0]}; "
                "copy it as the file that it is"
            )
        with Store.made_whole(target, original.spec, original.valves) as made:
            rows = _fill(made, original)
            for one, other in zip_longest(_content(original), _content(made)):
                if one != other:
                    raise PneumarmError(
                        f"{made.address}: what was written is not what {original.address} holds; nothing was copied, "
                        "try again"
                    )
            return CopyResult(made.transitions, made.sequences, rows, len(made.runs()))


def _fill(made: Store, original: Store) -> int:
    """Write all that ``original`` holds into ``made``; return how many rows these are."""
    count = 0
    with made.writing() as database:
        for table in _KEYS:
            lines = _lines(original, table)
            while page := list(islice(lines, _page(table))):
                database.insert(table, page)
        for rows in original.blocks(_ROWS, marked=True):
            made.insert_rows(rows.sequence, rows.step, values_of(rows, made.further))
            count += len(rows)
    return count


def _lines(store: Store, table: str) -> Iterator[Line]:
    if table == "marks" and not store.keeps_marks:
        return iter(())
    database = store.database
    found = database.pages(table, database.columns(table), _KEYS[table], page=_page(table))
    return (tuple(line[1:]) for line in found)


def _page(table: str) -> int:
    """Return how many lines of a table are held at once; a state can be large."""
    return 1 if table == "state" else PAGE


def _content(store: Store) -> Iterator[Any]:
    """Yield all that a store holds, part by part, such that what is equal compares so."""
    yield from chain.from_iterable(_lines(store, table) for table in _KEYS)
    for rows in store.blocks(_ROWS, marked=True):
        numbers = np.column_stack([rows.sequence, rows.step, values_of(rows, store.further)])
        yield np.nan_to_num(numbers, nan=np.inf).tobytes()  # no stored number is infinite

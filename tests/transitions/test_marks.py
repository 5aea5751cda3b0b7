"""Marked rows: kept, shown when asked for, and left out of everything that learns."""

import sqlite3

import numpy as np
import pytest

from pneumarm.arm import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.transitions import Mark, Recorded, Store, Window, transitions
from pneumarm.transitions.rows import joinable


def recorded(marks=(), n=10, begin=0.0):
    command = np.zeros((n, 1, 2))
    command[-1] = np.nan
    angle = np.arange(n, dtype=float)[:, None] + 500
    return Recorded(
        begin + np.arange(n) / 30,
        angle,
        np.full((n, 1, 2), 50.0),
        command,
        np.arange(n),
        at_rest=True,
        marks=tuple(marks),
    )


def test_marked_rows_are_left_out_and_no_transition_spans_them(address):
    with Store.create(address, ArmSpec()) as store:
        store.append(recorded([Mark(4, 5, "a stuck valve")]))
        store.append(recorded())
        assert store.transitions == 3 + 3 + 9
        (rows,) = store.blocks()
        assert rows.step[rows.sequence == 1].tolist() == [0, 1, 2, 3, 6, 7, 8, 9]
        (whole,) = store.blocks(marked=True)
        assert len(whole) == 20
        found = transitions(rows, Window(1, 1))
        assert found.step[found.sequence == 1].tolist() == [0, 1, 2, 7, 8]
        assert store.marks() == {1: [Mark(4, 5, "a stuck valve")]}
        assert store.percentiles((100.0,)).item() == 509
        store.check()


def test_rows_can_be_marked_later(address):
    with Store.create(address, ArmSpec()) as store:
        run = store.begin_run("test", {})
        for begin in (0.0, 1.0):
            store.append(recorded(begin=begin))
        store.mark(2, [Mark(0, 9, "all of it")])
        assert store.transitions == 9
        assert [set(rows.sequence.tolist()) for rows in store] == [{1}]
        store.mark_since(5 / 30 - 1e-9, "late", run)
        store.mark_since(5 / 30 - 1e-9, "late", run)
        assert store.marks()[1] == [Mark(5, 9, "late")]
        assert store.transitions == 4
        with pytest.raises(UnusableInput, match="no sequence 3"):
            store.mark(3, [Mark(0, 1, "x")])
        store.check()


def test_a_store_of_version_1_is_read_and_upgraded_by_a_writer(tmp_path):
    path = tmp_path / "db"
    with Store.create(path, ArmSpec()) as store:
        store.append(recorded())
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute("DROP TABLE marks")
    connection.execute("PRAGMA user_version = 1")
    connection.close()
    with Store.open(path) as store:
        assert store.marks() == {}
        assert len(next(iter(store))) == 10
    with Store.append_to(path) as store:
        store.mark(1, [Mark(0, 3, "why not")])
    with Store.open(path) as store:
        assert len(next(iter(store))) == 6


@pytest.mark.parametrize("mark", [(3, 2, "x"), (-1, 2, "x"), (1, 2, ""), (1, 2, "x" * 2000)])
def test_impossible_marks_are_refused(mark):
    with pytest.raises(UnusableInput, match="mark"):
        Mark(*mark)


def test_joinable_counts_pairs_without_marks_or_gaps():
    assert joinable(np.array([0, 1, 2, 4, 5]), ()) == 3
    assert joinable(np.array([0, 1, 2, 4, 5]), [Mark(1, 1, "x")]) == 1

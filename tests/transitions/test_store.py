"""The store gives back what was put in, refuses what is impossible, and serves readers while it is written."""

import itertools
import json
import os
import socket
import sqlite3
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stand_ins import make_recorded

from pneumarm.arm import ArmSpec, Reading, Step
from pneumarm.errors import ArmFailure, PneumarmError, UnusableInput
from pneumarm.transitions import Mark, Recorded, Store, lock
from pneumarm.transitions.lock import WriterLock
from pneumarm.transitions.quantiles import Quantiles
from pneumarm.transitions.rows import broken_off, join_rows


@pytest.fixture
def path(tmp_path):
    return tmp_path / "transitions.db"


def all_rows(store, **options):
    rows = vars(join_rows(store.blocks(**options)))
    return rows | rows.pop("measured")


@pytest.mark.parametrize("joints", [1, 2, 3])
@pytest.mark.parametrize("valves", [True, False])
def test_what_is_appended_comes_back_exactly(address, recorded, joints, valves):
    sequences = [recorded(i, n=5 + i, joints=joints, valves=valves, at_rest=i % 2 == 0) for i in range(7)]
    with Store.create(address, ArmSpec(joints=joints), valves) as store:
        assert [store.append(one) for one in sequences] == [1, 2, 3, 4, 5, 6, 7]
    with Store.open(address) as store:
        assert (store.joints, store.valves, store.spec) == (joints, valves, ArmSpec(joints=joints))
        assert store.sequences == 7
        assert store.transitions == sum(len(one) - 1 for one in sequences)
        rows = all_rows(store)
        for name in ("time", "angle", "pressure", "command", "step"):
            np.testing.assert_array_equal(rows[name], np.concatenate([getattr(one, name) for one in sequences]))
        np.testing.assert_array_equal(rows["sequence"], np.repeat(np.arange(1, 8), [len(one) for one in sequences]))
        np.testing.assert_array_equal(rows["at_rest"], rows["sequence"] % 2 == 1)
        store.check()


def test_pulses_are_kept_of_arms_that_can_do_them(place, address, recorded):
    command = np.array([[[1.0, -0.25]], [[0.1, 0.0]], [[np.nan, np.nan]]])
    one = recorded(n=3, command=command)
    with Store.create(address, ArmSpec()) as store:
        store.append(one)
        np.testing.assert_array_equal(all_rows(store)["command"], command)
        with pytest.raises(UnusableInput, match="pulses in between"):
            store.append(replace(one, command=1.01 * command))
    with (
        Store.create(place(), ArmSpec(pulses=False)) as store,
        pytest.raises(UnusableInput, match="commands must be -1, 0 or"),
    ):
        store.append(one)


@given(st.integers(1, 60), st.lists(st.integers(2, 30), min_size=1, max_size=12))
@settings(max_examples=25, deadline=None)
def test_blocks_hold_whole_sequences_and_no_more_rows_than_asked(tmp_path_factory, size, lengths):
    path = tmp_path_factory.mktemp("blocks") / "s.db"
    with Store.create(path, ArmSpec()) as store:
        store.append_all(make_recorded(i, n=n) for i, n in enumerate(lengths))
        blocks = list(store.blocks(rows=size))
        seen = [set(block.sequence.tolist()) for block in blocks]
        assert sum(len(one) for one in seen) == len(set.union(*seen)) == len(lengths)
        for block, numbers in zip(blocks, seen, strict=True):
            assert len(block) == sum(lengths[n - 1] for n in numbers)
            assert len(block) <= size or len(numbers) == 1
        # and each is as full as it can be
        for block, after in itertools.pairwise(blocks):
            assert len(block) + lengths[after.sequence[0] - 1] > size


def test_blocks_are_chosen_by_predicate_and_kind_and_can_be_read_again(address, recorded):
    with Store.create(address, ArmSpec()) as store:
        for i in range(10):
            store.append(recorded(i, kind="velocity" if i % 2 else "episode"))
        odd = store.blocks(sequences=lambda number: number % 2 == 1)
        for _ in range(2):
            assert {n for block in odd for n in block.sequence.tolist()} == {1, 3, 5, 7, 9}
        kinds = store.blocks(kinds=["velocity"], sequences=lambda number: number > 5)
        assert {n for block in kinds for n in block.sequence.tolist()} == {6, 8, 10}
        assert list(store.blocks(kinds=["none such"])) == []


def test_a_lost_period_leaves_a_gap_that_no_transition_spans(address, recorded):
    step = np.arange(21) + (np.arange(21) > 7)
    with Store.create(address, ArmSpec()) as store:
        store.append(recorded(step=step))
        assert store.transitions == 19
        np.testing.assert_array_equal(next(iter(store)).step, step)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"angle": np.full((21, 1), np.nan)}, "angle is far outside"),
        ({"angle": np.full((21, 1), 5000.0)}, "angle is far outside"),
        ({"pressure": np.full((21, 1, 2), np.inf)}, "pressure is over"),
        ({"pressure": np.full((21, 2, 2), 1.0)}, r"pressure must have shape \(21, 1, 2\), got \(21, 2, 2\)"),
        ({"time": np.zeros(21)}, "times must be finite and rise"),
        ({"time": np.append(np.arange(20.0), np.inf)}, "times must be finite and rise"),
        ({"step": np.arange(21) + 1}, "steps must begin at 0"),
        ({"step": np.zeros(21, int)}, "steps must begin at 0"),
        ({"command": np.zeros((21, 1, 2))}, "NaN after the last reading"),
        ({"command": np.full((21, 1, 2), np.nan)}, "commands must be valves"),
        ({"command": np.append(np.full((20, 1, 2), 1.5), np.full((1, 1, 2), np.nan), axis=0)}, "must be valves"),
        ({"info": {"goal": float("nan")}}, "info must be"),
    ],
)
def test_impossible_sequences_are_refused_and_leave_nothing(path, recorded, change, message):
    with Store.create(path, ArmSpec()) as store:
        store.append(recorded(1))
        with pytest.raises(UnusableInput, match=message):
            store.append(recorded(2, **change))
        assert store.append(recorded(3)) == 2
        store.check()


@pytest.mark.parametrize("n", [0, 1, 100_001])
def test_sequences_of_impossible_lengths_are_refused(path, recorded, n):
    with Store.create(path, ArmSpec()) as store, pytest.raises(UnusableInput, match="2 to 100000 rows"):
        store.append(recorded(n=n) if n else empty())


def empty():
    one = make_recorded(n=2)
    return Recorded(one.time[:0], one.angle[:0], one.pressure[:0], one.command[:0], one.step[:0])


def test_many_are_appended_all_or_none(address, recorded):
    with Store.create(address, ArmSpec()) as store:
        with pytest.raises(UnusableInput):
            store.append_all([recorded(1), recorded(2), recorded(3, time=np.zeros(21))])
        assert store.sequences == 0
        assert store._one("SELECT count(*) FROM sequences") == 0


def test_a_sequence_that_grew_is_the_one_that_was_appended_at_once(address, recorded):
    step = np.append(np.arange(20), np.arange(22, 32))  # two periods were lost
    whole = recorded(3, n=30, step=step, time=step / 30)

    def part(begin, end):
        command = whole.command[begin:end].copy()
        command[-1] = np.nan
        values = {name: getattr(whole, name)[begin:end] for name in ("time", "angle", "pressure")}
        return replace(whole, **values, command=command, step=step[begin:end] - step[begin])

    with Store.create(address, ArmSpec()) as store:
        store.append(whole)
        number = store.append(part(0, 10))
        for begin, end in ((9, 11), (10, 25), (24, 30)):
            store.extend(number, part(begin, end))
        for wrong in (number, number + 1):
            with pytest.raises(UnusableInput, match=f"sequence {wrong} does not end where this goes on"):
                store.extend(wrong, part(9, 11))
        with pytest.raises(UnusableInput, match="commands must be"):
            store.extend(number, replace(recorded(4, n=2), time=np.array([31, 32]) / 30, command=np.zeros((2, 1, 2))))
        store.check()
        first, second = (entry._replace(number=0) for entry in store.catalogue())
        assert first == second
        at_once, grown = (join_rows(store.blocks(sequences=lambda n, k=k: n == k)) for k in (1, 2))
    for name in ("step", "time", "angle", "pressure", "command"):
        np.testing.assert_array_equal(getattr(grown, name), getattr(at_once, name), err_msg=name)


def test_state_is_written_with_the_sequence_or_not_at_all(address, recorded):
    with Store.create(address, ArmSpec()) as store:
        assert store.state() is None
        store.append(recorded(1), {"arm": b"one", "other": b"\x00\xff"})
        with pytest.raises(UnusableInput):
            store.append(recorded(2, time=np.zeros(21)), {"arm": b"two"})
        with pytest.raises(PneumarmError):
            store._one("not SQL")
        assert (store.state(), store.state("other")) == (b"one", b"\x00\xff")
        store.append(recorded(2), {"arm": b"two"})
    with Store.open(address) as store:
        assert store.state() == b"two"


def test_runs_keep_their_settings_and_sequences_their_run(address, recorded):
    with Store.create(address, ArmSpec(name="left")) as store:
        store.append(recorded(0))
        assert store.begin_run("collect", {"seed": 3}) == 1
        store.append(recorded(1, kind="velocity", info={"goal": [512.0]}))
        assert store.begin_run("transfer", {}) == 2
        store.append(recorded(2, kind="episode", at_rest=False))
        assert store.resume_run("collect", {"seed": 3}) == 1
        store.append(recorded(3))
        with pytest.raises(UnusableInput, match="seed was 3, is 4"):
            store.resume_run("collect", {"seed": 4})
        runs = store.runs()
        assert runs[1]["settings"] == {"seed": 3}
        assert runs[1]["arm"]["name"] == "left"
        assert runs[1]["started"].endswith("Z")
        assert runs[1]["version"]
        entries = list(store.catalogue())
        assert [entry.run for entry in entries] == [None, 1, 2, 1]
        assert [entry.number for entry in store.catalogue(run=1)] == [2, 4]
        assert entries[1].info == {"goal": [512.0]}
        assert (entries[2].kind, entries[2].at_rest, entries[2].rows, entries[2].transitions) == (
            "episode",
            0,
            21,
            20,
        )


def test_percentiles_equal_those_of_numpy(place, address, recorded):
    with Store.create(address, ArmSpec(joints=2)) as store:
        store.append_all(recorded(i, n=50, joints=2) for i in range(8))
        angle = all_rows(store)["angle"]
        np.testing.assert_allclose(
            store.percentiles((0, 1, 37.5, 99, 100)),
            np.percentile(angle, (0, 1, 37.5, 99, 100), axis=0).T,
            rtol=1e-12,
        )
    with Store.create(place(), ArmSpec()) as store, pytest.raises(UnusableInput, match="no rows"):
        store.percentiles()


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=50), st.floats(0, 1))
@settings(deadline=None)
def test_quantiles_of_any_numbers_are_within_a_part_in_4096(values, share):
    counted = Quantiles(1)
    for value in values:
        counted.add([[value]])
    expected = np.quantile(values, share)
    at_most = np.abs(values).max() / 4096 + 2.0**-23
    assert counted([share])[0, 0] == pytest.approx(expected, rel=0, abs=at_most)


def test_a_reader_sees_what_is_acknowledged_while_the_writer_goes_on(address, recorded):
    with Store.create(address, ArmSpec()) as writer, Store.open(address) as reader:
        for i in range(5):
            writer.append(recorded(i))
            assert reader.sequences == i + 1
        blocks = iter(reader.blocks(rows=21))
        next(blocks)
        writer.append(recorded(5))  # a reading in progress does not hold it up
        assert sum(1 for _ in blocks) == 4
        with pytest.raises(PneumarmError, match="opened for reading"):
            reader.append(recorded(6))


def test_the_writer_syncs_every_commit_and_only_it_can_checkpoint(path, recorded):
    with Store.create(path, ArmSpec()) as writer:
        writer.append(recorded(0))
        assert writer._one("PRAGMA journal_mode") == "wal"
        assert writer._one("PRAGMA synchronous") == 2  # FULL
        with Store.open(path) as reader:
            log = path.with_name(path.name + "-wal")
            before = (path.read_bytes(), log.read_bytes())
            with suppress(sqlite3.OperationalError):
                reader.database.connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
            assert (path.read_bytes(), log.read_bytes()) == before


def test_a_second_writer_is_refused_by_name(path, recorded, python):
    script = "import sys; from pneumarm.transitions import Store; Store.append_to(sys.argv[1]).close()"
    with Store.create(path, ArmSpec()) as store:
        store.append(recorded(0))
        other = python(script, path)
        assert other.returncode == 1
        assert f"process {os.getpid()} on {socket.gethostname()} is writing to it" in other.stderr
        with pytest.raises(UnusableInput, match="is writing to it"):
            Store.append_to(path)
    assert python(script, path).returncode == 0
    assert not path.with_name(path.name + "-writer").exists()


def test_a_lock_whose_file_was_removed_while_it_was_taken_is_no_lock(path, monkeypatch):
    """The holder before us removes it between our opening and our locking; whoever comes next makes another one."""
    take, before = lock.lock_descriptor, path.with_name(path.name + "-writer")

    def taken(file, blocking):
        before.unlink()
        monkeypatch.setattr(lock, "lock_descriptor", take)
        return take(file, blocking=blocking)

    monkeypatch.setattr(lock, "lock_descriptor", taken)
    mine = WriterLock(path)
    assert before.exists()
    with pytest.raises(UnusableInput, match="is writing to it"):
        WriterLock(path)
    mine.release()
    WriterLock(path).release()
    assert not before.exists()


def test_a_place_that_is_taken_or_missing_is_refused(path, tmp_path):
    Store.create(path, ArmSpec()).close()
    with pytest.raises(UnusableInput, match="exists already"):
        Store.create(path, ArmSpec())
    with pytest.raises(UnusableInput, match="does not exist; create it first"):
        Store.create(tmp_path / "none" / "s.db", ArmSpec())
    with pytest.raises(UnusableInput, match="no such file"):
        Store.open(tmp_path / "none.db")
    with pytest.raises(UnusableInput, match="no such file"):
        Store.append_to(tmp_path / "none.db")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["transitions.db"]


def test_a_log_that_outlived_its_store_is_not_replayed(path, recorded):
    with Store.create(path, ArmSpec()) as store:
        store.append(recorded(0))
        log = path.with_name(path.name + "-wal").read_bytes()
    path.unlink()
    path.with_name(path.name + "-wal").write_bytes(log)
    with Store.create(path, ArmSpec()) as store:
        assert store.sequences == 0
        store.check()


def test_names_that_mean_something_in_a_uri_are_just_names(tmp_path, recorded):
    path = tmp_path / "50%20 a?mode=rw#x.db"
    with Store.create(path, ArmSpec()) as store:
        store.append(recorded(0))
    with Store.open(path) as store:
        assert store.sequences == 1
        with pytest.raises(sqlite3.OperationalError):
            store.database.connection.execute("DELETE FROM rows")


def test_what_broke_off_is_kept_with_its_last_row_marked():
    spec = ArmSpec(period=0.1)
    steps = [Step(Reading(k / 10, np.array([500.0]), np.zeros((1, 2))), np.zeros((1, 2), np.int8)) for k in range(4)]
    kept = broken_off(steps, spec, ArmFailure("the plug fell out"), kind="k")
    assert kept.step.tolist() == [0, 1, 2, 3]
    assert kept.marks == (Mark(3, 3, "broke off here: the plug fell out"),)
    assert kept.transitions == 2
    assert broken_off(steps[:1], spec, ArmFailure("at once"), kind="k") is None


def test_a_store_is_of_one_arm(path):
    with Store.create(path, ArmSpec()) as store:
        store.check_arm(ArmSpec())
        with pytest.raises(UnusableInput, match=r"made for another arm \(period was .*; max_pressure was"):
            store.check_arm(ArmSpec(period=0.05, max_pressure=0.9))


def test_from_steps_takes_the_valves_as_applied_and_counts_periods(recorded):
    spec = ArmSpec(joints=2, period=0.1)
    times = [0.0, 0.101, 0.2, 0.4, 0.49]  # one period is lost after the third
    readings = [Reading(t, np.array([t, 2 * t]), np.full((2, 2), t)) for t in times]
    valves = [np.full((2, 2), v, np.int8) for v in (1, 0, -1, 1)]
    one = Recorded.from_steps([Step(r, v) for r, v in zip(readings, [*valves, None], strict=True)], spec, kind="k")
    assert one.step.tolist() == [0, 1, 2, 4, 5]
    assert one.command[:, 1, 0].tolist()[:4] == [1, 0, -1, 1]
    assert np.isnan(one.command[4]).all()
    assert one.angle[3].tolist() == [0.4, 0.8]
    assert json.dumps(dict(one.info)) == "{}"

"""Movements are stored as they happen: nothing is lost, doubled or joined falsely, however they end."""

from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pneumarm.arm import Arm, ArmSpec, Reading
from pneumarm.arm.cycle import Step
from pneumarm.arm.reference import Reference, constant
from pneumarm.errors import ArmFailure, PneumarmError, UnusableInput
from pneumarm.moving import MoveSettings, Tracked, move, track
from pneumarm.report.shown import read_shown
from pneumarm.transitions import Store, Window, transitions
from pneumarm.transitions import recorder as module
from pneumarm.transitions.recorder import Recorder, recorder
from pneumarm.transitions.rows import Rows, join_rows

CLOSED = np.zeros((1, 2), np.int8)


class Counting(Arm):
    """An arm whose angle counts its turns, tenth by tenth from 0.1 on; ``seen`` is given a turn before it is read."""

    def __init__(self, seen: Callable[[int], object] = lambda turn: None) -> None:
        self.spec = ArmSpec(period=0.1, counts_per_degree=10.0, angle_range=(0.0, 1e5))
        self.seen, self.time, self.valves, self.closed = seen, 0.0, CLOSED, False

    @property
    def turn(self) -> int:
        return round(self.time / self.spec.period)

    def read(self) -> Reading:
        self.seen(self.turn)
        return Reading(self.time, np.array([(self.turn + 1) / 10]), np.full((1, 2), float(self.turn % 100)))

    def set_valves(self, valves: NDArray[Any]) -> None:
        self.valves = np.array(valves)

    def wait(self, seconds: float) -> None:
        self.time += seconds

    def close(self) -> None:
        self.closed = True


class Alternating:
    """Opens one valve after the other; fails as ``failing`` does."""

    def __init__(self, failing: Callable[[], object] = lambda: None) -> None:
        self.turn, self.failing = 0, failing

    def reset(self, goal: NDArray[np.float64]) -> None:
        self.turn = 0

    def track(self, reference: Reference) -> None:
        self.turn = 0

    def act(self, reading: Reading) -> NDArray[np.int8]:
        self.turn += 1
        if self.turn > 20:
            self.failing()
        return np.array([[(1, 0, -1)[self.turn % 3], 0]], np.int8)


def followed(arm: Arm, record: Recorder | None, turns: int, controller: Alternating | None = None) -> Tracked:
    period = arm.spec.period
    seconds = (turns - 1) * period
    return track(arm, controller or Alternating(), constant([500.0]), seconds, lead_in=0.0, record=record)


def stored(path: Path) -> Rows:
    """Return all rows of a store, marked or not, after checking it."""
    with Store.open(path) as store:
        store.check()
        return join_rows(store.blocks(marked=True))


def reasons(path: Path) -> dict[int, tuple[int, str]]:
    """Return the last marked step of every sequence that has a mark, and why."""
    with Store.open(path) as store:
        return {number: (marks[-1].first, marks[-1].reason) for number, marks in store.marks().items()}


class Inline(Executor):
    """Does at once, in the calling thread, what is submitted."""

    def submit(self, do: Callable[..., Any], /, *arguments: Any, **named: Any) -> "Future[Any]":
        done: Future[Any] = Future()
        try:
            done.set_result(do(*arguments, **named))
        except Exception as error:
            done.set_exception(error)
        return done


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have every step stored as soon as the writer gets to it."""
    monkeypatch.setattr(module, "EVERY", 0.0)


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("turns", [2, 3, 49, 50, 51, 52, 53, 100, 101, 102, 103, 152])
def test_parts_hold_the_same_rows_and_no_transition_across_their_joint(
    turns: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "LONGEST_PART", 50)
    monkeypatch.setattr(module, "ThreadPoolExecutor", lambda *_: Inline())  # each row in a transaction of its own
    path = tmp_path / "parts.db"
    arm = Counting()
    with recorder(path, arm.spec) as record:
        whole = followed(arm, record, turns).recorded
    rows = stored(path)
    assert len(rows) == len(whole) == turns
    np.testing.assert_array_equal(rows.time, whole.time)
    np.testing.assert_array_equal(rows.angle, whole.angle)
    np.testing.assert_array_equal(rows.pressure, whole.pressure)
    ends = np.append(np.diff(rows.sequence) != 0, True)
    np.testing.assert_array_equal(rows.command[~ends], whole.command[~ends])
    lengths = np.bincount(rows.sequence)[1:].tolist()
    assert lengths[:-1] == [50] * (len(lengths) - 1)
    assert 2 <= lengths[-1] <= 51
    made = transitions(rows, Window())
    np.testing.assert_allclose(made.interval, arm.spec.period, rtol=1e-5)
    assert (np.diff(np.concatenate([made.observation[:, :1], made.target[:, :1]], axis=1)) > 0.05).all()
    assert reasons(path) == {}


def test_an_hour_is_stored_to_the_last_row(tmp_path: Path) -> None:
    spec, rows = ArmSpec(), 3600 * 30 + 1
    readings = [Reading(0.0, np.array([float(abs(k - 500))]), np.full((1, 2), 5.0)) for k in range(1000)]
    with recorder(tmp_path / "hour.db", spec) as record:
        assert record is not None
        with record.sequence("movement", {}) as add:
            for k in range(rows):
                add(Step(replace(readings[k % 1000], time=k / 30), CLOSED))
    with Store.open(tmp_path / "hour.db") as store:
        total = 0
        for block in store:
            total += len(block)
        assert total == rows
        assert store.transitions == rows - store.sequences


def test_never_more_than_a_second_of_a_movement_is_not_durable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm, missing = Counting(), []
    monkeypatch.setattr(module, "monotonic", lambda: arm.time)
    with Store.create(tmp_path / "s.db", arm.spec) as store:
        store.begin_run("move", {})

        def look(turn: int) -> None:
            with Store.open(tmp_path / "s.db") as read:
                missing.append(turn - sum(one.rows for one in read.catalogue()))

        arm.seen = look
        followed(arm, Recorder(store, Inline(), {}), 100)
    assert len(missing) >= 100
    assert max(missing) * arm.spec.period <= 1.0


def test_no_turn_waits_for_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written, append, in_time = Event(), Store.append, []

    def slow(self: Store, *given: Any, **named: Any) -> int:
        in_time.append(written.wait(60))
        return append(self, *given, **named)

    monkeypatch.setattr(Store, "append", slow)
    monkeypatch.setattr(module, "EVERY", 0.0)
    arm = Counting(lambda turn: written.set() if turn == 90 else None)
    with recorder(tmp_path / "s.db", arm.spec) as record:
        followed(arm, record, 100)
    assert in_time == [True]
    assert len(stored(tmp_path / "s.db")) == 100


def die(turn: int) -> None:
    if turn == 60:
        raise OSError("no answer from the board")


def interrupt(turn: int) -> None:
    if turn == 60:
        raise KeyboardInterrupt


def give_up() -> None:
    raise PneumarmError("the controller gave up")


@pytest.mark.parametrize(
    ("arm", "controller", "rows", "error", "why"),
    [
        (Counting(die), Alternating(), 60, (OSError, ArmFailure), "no answer from the board"),
        (Counting(interrupt), Alternating(), 60, KeyboardInterrupt, "KeyboardInterrupt"),
        (Counting(), Alternating(give_up), 20, PneumarmError, "the controller gave up"),
        (Counting(), Alternating(lambda: 1 / 0), 30, PneumarmError, "decisions in a row"),
    ],
)
@pytest.mark.parametrize("every", [0.0, 1e9])
def test_what_breaks_off_is_kept_and_its_last_row_marked(
    every: float, arm: Counting, controller: Alternating, rows: int, error: Any, why: str, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(module, "EVERY", every)
    arm.time, controller.turn = 0.0, 0
    with pytest.raises(error), recorder(tmp_path / "s.db", arm.spec, {"reference": "mine"}) as record:
        followed(arm, record, 1000, controller)
    kept = stored(tmp_path / "s.db")
    assert len(kept) == rows
    np.testing.assert_allclose(kept.angle[:, 0], np.arange(1, rows + 1) / 10)
    ((step, reason),) = reasons(tmp_path / "s.db").values()
    assert step == kept.step[-1] == rows - 1
    assert reason.startswith("broke off here: ")
    assert why in reason
    assert (arm.valves == 0).all()
    with Store.open(tmp_path / "s.db") as store:
        assert [one.info for one in store.catalogue()] == [{"reference": "mine"}]
        assert store.transitions == rows - 2


@pytest.mark.usefixtures("at_once")
def test_a_reading_that_cannot_be_stored_costs_none_before_it(tmp_path: Path) -> None:
    class Leaping(Counting):
        def read(self) -> Reading:
            reading = super().read()
            return replace(reading, angle=np.array([3e5])) if self.turn == 40 else reading

    arm = Leaping()
    with pytest.raises(UnusableInput, match="far outside"), recorder(tmp_path / "s.db", arm.spec) as record:
        followed(arm, record, 10**5)
    assert len(stored(tmp_path / "s.db")) == 40
    assert (arm.valves == 0).all()


@pytest.mark.usefixtures("at_once")
def test_a_full_disk_ends_the_movement_and_keeps_what_is_there(tmp_path: Path) -> None:
    arm = Counting()
    with recorder(tmp_path / "s.db", arm.spec) as record:
        assert record is not None
        record._writer.submit(record._store.database.execute, "PRAGMA max_page_count = 20").result()
        with pytest.raises(PneumarmError, match="the disk is full"):
            followed(arm, record, 500_000)
    assert arm.turn < 500_000 - 1
    assert (arm.valves == 0).all()
    kept = stored(tmp_path / "s.db")
    assert len(kept) > 100
    np.testing.assert_allclose(kept.angle[:, 0], np.arange(1, len(kept) + 1) / 10)


def test_every_try_is_stored_with_its_goal(tmp_path: Path) -> None:
    arm = Counting()
    with recorder(tmp_path / "s.db", arm.spec) as record:
        settings = MoveSettings(hold=1.0, tries=2, pause=0.5)
        made = list(move(arm, Alternating(), [[500.0], [400.0]], settings, record=record))
    assert [one.tries for one in made] == [2, 2]
    with Store.open(tmp_path / "s.db") as store:
        found = [(one.kind, one.rows, one.info, one.at_rest) for one in store.catalogue()]
    assert found == [("movement", 11, {"goal": [goal]}, False) for goal in (500.0, 500.0, 400.0, 400.0)]
    kept = stored(tmp_path / "s.db")
    np.testing.assert_array_equal(kept.time[-11:], made[-1].recorded.time)


def test_what_was_asked_for_is_shown_in_parts_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LONGEST_PART", 50)
    arm = Counting()
    arm.spec = replace(arm.spec, angle_range=(0.0, 1000.0))
    with recorder(tmp_path / "s.db", arm.spec, {"reference": "sine:0.13Hz,10deg"}) as record:
        followed(arm, record, 95)
    wanted = read_shown(tmp_path / "s.db").wanted
    assert wanted is not None
    time = 0.1 * np.arange(95)
    np.testing.assert_allclose(wanted[:, 0], 500 + 100 * np.sin(2 * np.pi * 0.13 * time), atol=1e-6)


@pytest.mark.usefixtures("at_once")
def test_a_sensor_that_froze_is_marked_where_a_movement_is_stored_as_it_grows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Frozen(Counting):
        def read(self) -> Reading:
            return replace(super().read(), pressure=np.full((1, 2), 40.0))

    monkeypatch.setattr(module, "LONGEST_PART", 50)
    arm = Frozen()
    with recorder(tmp_path / "s.db", arm.spec) as record:
        followed(arm, record, 120)
    found = {reason for _, reason in reasons(tmp_path / "s.db").values()}
    assert found == {"pressure 1 reads one constant while valves act"}
    with Store.open(tmp_path / "s.db") as store:
        store.check()
        assert store.transitions == 0

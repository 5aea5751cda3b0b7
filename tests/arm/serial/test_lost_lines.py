"""What must hold when a line is lost and found again: the arm is vented, and whoever moves it goes on."""

import os
import pty
import tty
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.arm.serial.wired import WatchedArm, WatchedLine, Wired, all_valves, stalling, wired

from pneumarm.arm import Reading, guarded, open_arm
from pneumarm.arm.reference import Reference
from pneumarm.arm.serial import EmulatedBoard, FaultyLine, SerialArm, board
from pneumarm.arm.serial.port import SerialPort
from pneumarm.arm.serial.protocol import DEAD_MAN_MS, Cause
from pneumarm.arm.valves import Command
from pneumarm.arm.virtual import VirtualArm
from pneumarm.checkup import CheckupSettings, diagnose, fill_alone, measure
from pneumarm.control import TransferSettings, transfer
from pneumarm.errors import ArmFailure, LineLost, UnusableInput
from pneumarm.learning import Agent
from pneumarm.moving import MoveSettings, move, track
from pneumarm.transitions import CollectBegin, CollectSettings, Mark, Recorded, Store, collect
from pneumarm.transitions.recorder import recorder
from soak import Attack, amount

QUICK = CollectSettings(actions=60, begin=CollectBegin(deflate=0.5, inflate=0.3, settle=0.3))


@pytest.fixture
def w() -> Iterator[Wired]:
    found = wired()
    with found.arm:
        yield found


def after(w: Wired, seconds: float, happens: Callable[[], None]) -> None:
    """Have something happen ``seconds`` from now, at the next look at the line."""
    due, line = w.line.now() + seconds, w.line.line
    read, sleep_until, waits = line.read, line.sleep_until, [happens]

    def look() -> None:
        if waits and line.now() >= due:
            waits.pop()()

    def read_and_look(timeout: float) -> bytes:
        look()
        return read(timeout)

    def sleep_and_look(time: float) -> None:
        if waits and due < time:
            sleep_until(due)
            look()
        sleep_until(time)

    line.read, line.sleep_until = read_and_look, sleep_and_look  # type: ignore[method-assign]


def unplug(w: Wired, seconds: float, meanwhile: Callable[[], None] = lambda: None) -> None:
    """Pull the plug now, and put it in again after some time; something may happen to the board ``meanwhile``."""

    def plug_in() -> None:
        w.line.unplugged = False
        meanwhile()

    w.line.unplugged = True
    after(w, seconds, plug_in)


def goes_on(w: Wired) -> list[float]:
    """Inflate the arm for two seconds, again where the line is lost; return when each attempt began [s]."""
    guard, begun = guarded(w.arm), []

    def inflate() -> None:
        begun.append(w.line.now())
        guard.make_ready()
        guard.read()
        guard.set_valves(all_valves(w.arm, 1))
        guard.wait(2.0)

    guard.despite_losses(inflate)
    assert w.arm.read().pressure.min() > 0.5 * w.arm.spec.max_pressure_counts
    return begun


@pytest.mark.parametrize("seconds", [0.3, 1.0, 10.0, 100.0])
def test_a_plug_that_is_out_is_waited_for_with_the_arm_vented(
    w: Wired, seconds: float, caplog: pytest.LogCaptureFixture
) -> None:
    after(w, 1.0, lambda: unplug(w, seconds))
    out = w.line.now() + 1.0
    first, again = goes_on(w)
    assert seconds - 0.01 < again - out < seconds + 1.1
    vented = [time for time, valves in w.muscles.set if valves == [[-1, -1]] and time > first + 0.5]
    assert vented[0] <= out + 0.251
    assert w.arm.link_counts()["losses"] == 1
    assert "looking for the board" in caplog.text
    assert "taken up again" in caplog.text


def test_a_cable_that_is_cut_without_anybody_being_told_is_waited_for_too(w: Wired) -> None:
    def cut() -> None:
        w.line.cut = True
        after(w, 10.0, lambda: setattr(w.line, "cut", False))

    after(w, 1.0, cut)
    assert len(goes_on(w)) == 2


@pytest.mark.parametrize("stall", [0.3, 0.6, 5.0])
def test_a_board_or_a_host_that_stalls_is_taken_up_again(w: Wired, stall: float) -> None:
    after(w, 0.5, lambda: stalling(w, stall))
    assert len(goes_on(w)) == 2
    after(w, 0.5, lambda: w.board.run_until(w.board.time + stall))  # the process was stopped
    assert len(goes_on(w)) == 2
    assert w.arm.link_counts()["losses"] == 2


@pytest.mark.parametrize("cause", [Cause.POWER_ON, Cause.EXTERNAL, Cause.POWER_ON | Cause.BROWN_OUT, Cause(0)])
def test_a_board_that_was_without_power_as_long_is_taken_up(w: Wired, cause: Cause) -> None:
    after(w, 1.0, lambda: unplug(w, 10.0, lambda: w.board.reset(cause)))
    assert len(goes_on(w)) == 2


@pytest.mark.parametrize(
    ("happens", "words"),
    [
        (lambda w: w.board.reset(Cause.WATCHDOG), r"restarted by itself \(its program hung\)"),
        (lambda w: w.board.reset(Cause.BROWN_OUT), r"restarted by itself \(supply too low\)"),
        (lambda w: setattr(w.board, "boots", w.board.boots + 1000), "another board, or one with other firmware"),
        (lambda w: setattr(w.board, "boots", w.board.boots - 1), "another board, or one with other firmware"),
        (lambda w: w.board._vent(board.OVER_PRESSURE[0]), "cut off muscle 1 of joint 1"),
        (lambda w: w.board._vent(board.Flag.CONVERTER), "converter stopped"),
    ],
)
def test_what_a_person_has_to_look_at_is_not_taken_up(w: Wired, happens: Callable[[Wired], None], words: str) -> None:
    after(w, 1.0, lambda: unplug(w, 3.0, lambda: happens(w)))
    with pytest.raises(ArmFailure, match=words) as failed:
        goes_on(w)
    assert not isinstance(failed.value, LineLost)
    assert not w.board.armed
    known = len(w.muscles.set)
    with pytest.raises(ArmFailure):
        goes_on(w)
    assert all(valves == [[-1, -1]] for _, valves in w.muscles.set[known:])
    if "restarted" in words or "another" in words:
        w.arm.rearm()  # somebody has looked
        goes_on(w)


def test_other_firmware_is_not_taken_up(w: Wired, monkeypatch: pytest.MonkeyPatch) -> None:
    after(w, 1.0, lambda: unplug(w, 3.0, lambda: monkeypatch.setattr(board, "FIRMWARE", 7)))
    with pytest.raises(ArmFailure, match="other firmware"):
        goes_on(w)


def test_a_hang_that_the_watchdog_ends_is_not_taken_up(w: Wired) -> None:
    after(w, 1.0, w.board.hang)
    with pytest.raises(ArmFailure, match="its program hung"):
        goes_on(w)
    assert w.is_vented


def test_over_pressure_is_not_taken_up() -> None:
    with (w := wired(cut_off=0.1)).arm, pytest.raises(ArmFailure, match="cut off muscle") as failed:
        goes_on(w)
    assert not isinstance(failed.value, LineLost)


@pytest.mark.parametrize("losses", [0, 2])
def test_too_many_losses_within_a_minute_are_given_up(losses: int) -> None:
    w = wired(losses=losses)
    with w.arm:
        guard, attempts = guarded(w.arm), []

        def work() -> None:
            attempts.append(w.line.now())
            after(w, 0.5, lambda: unplug(w, 0.3))
            guard.make_ready()
            guard.wait(2.0)

        with pytest.raises(ArmFailure, match=rf"lost {losses + 1} times within a minute .*,losses=N; now {losses}"):
            guard.despite_losses(work)
        assert len(attempts) == losses + 1
        with pytest.raises(ArmFailure, match="within a minute"):
            guard.read()
        w.line.sleep_until(w.line.now() + 61)
        w.arm.rearm()
        guard.read()


def test_losses_that_are_minutes_apart_are_never_too_many() -> None:
    w = wired(losses=1)
    with w.arm:
        for _ in range(4):
            after(w, 0.5, lambda: unplug(w, 0.3))
            assert len(goes_on(w)) == 2
            guarded(w.arm).wait(60.0)


def test_a_board_that_stays_away_is_given_up_in_words(w: Wired) -> None:
    after(w, 0.5, lambda: setattr(w.line, "unplugged", True))
    begun = w.line.now()
    with pytest.raises(ArmFailure, match="not found again within 10 min") as failed:
        goes_on(w)
    assert not isinstance(failed.value, LineLost)
    assert 600 < w.line.now() - begun < 610


def test_how_many_losses_are_allowed_is_part_of_the_name_of_an_arm() -> None:
    with open_arm("emulated:virtual:seed=3,losses=2") as arm:
        assert isinstance(arm, SerialArm)
        assert arm._losses == 2
    with pytest.raises(UnusableInput, match="losses is a number from 0 up"):
        open_arm("emulated:virtual,losses=often")
    with pytest.raises(UnusableInput, match="losses"):
        open_arm("virtual:losses=2")


def test_a_usb_board_is_found_at_another_port_and_no_other_board_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The list of ports is the only thing made up here: a pseudo-terminal is no USB device."""
    place, listed = tmp_path / "ttyACM0", []
    monkeypatch.setattr("pneumarm.arm.serial.port.list_ports.comports", lambda: listed)

    def plugged_in(number: str) -> tuple[int, int]:
        master, slave = pty.openpty()
        tty.setraw(slave)
        listed[:] = [
            SimpleNamespace(device=path, vid=0x2341, pid=0x43, serial_number=known, location="1-2")
            for path, known in ((os.ttyname(slave), number), ("/dev/pts/none", "another"))
        ]
        return master, slave

    first = plugged_in("7543")
    place.symlink_to(os.ttyname(first[1]))
    port = SerialPort(str(place))
    for end in first:
        os.close(end)
    stranger = plugged_in("1111")
    with pytest.raises(OSError, match="is at no port"):
        port.reopen()
    second = plugged_in("7543")
    port.reopen()
    port.write(b"\5\0")
    assert os.read(second[0], 10) == b"\5\0"
    port.close()
    for end in (*stranger, *second):
        with suppress(OSError):
            os.close(end)


# ---- what is done with an arm goes on


@dataclass
class Seen:
    """A watch that keeps what it sees, by sequence."""

    times: list[list[float]] = field(default_factory=list)

    def begin(self, *, at_rest: bool) -> None:
        self.times.append([])

    def see(self, reading: Reading, valves: Command | None) -> None:
        self.times[-1].append(reading.time)

    def marks(self, recorded: Recorded) -> tuple[Mark, ...]:
        return ()

    def spoiled_since(self) -> None:
        return None

    def reasons(self) -> str:
        return ""

    def get_state(self) -> bytes:
        return b"seen"

    def set_state(self, state: bytes) -> None:
        pass

    def __deepcopy__(self, memo: object) -> "Seen":
        return Seen()


@dataclass
class Silence:
    """A stretch of the line's time in which the board does nothing with what comes, or the plug is out [s]."""

    begin: float
    end: float
    unplugged: bool


class TroubledLine(FaultyLine):
    """A line with silences at times that are known ahead."""

    def __init__(self, line: WatchedLine, silences: list[Silence]) -> None:
        super().__init__(line)
        self.silences = silences
        receive, kept = line.board.receive, list[bytes]()

        def heard(data: bytes) -> bytes:
            kept.append(data)
            if any(one.begin <= line.now() < one.end for one in silences):
                return b""
            whole = b"".join(kept)
            kept.clear()
            return receive(whole)

        line.board.receive = heard  # type: ignore[method-assign]

    def _check(self) -> None:
        if any(one.unplugged and one.begin <= self.now() < one.end for one in self.silences):
            raise OSError("no such device")


def collect_in_silences(folder: Path, seconds: float, silences: list[Silence], seed: int) -> dict[str, int]:
    """Collect for so long [s] on a line with ``silences``, and check all that must hold; return what was counted.

    No run ends, the valves close within the dead-man's time, all that was read is stored, and no transition bridges a
    gap.
    """
    muscles = WatchedArm(seed)
    line = TroubledLine(WatchedLine(EmulatedBoard(muscles), muscles), silences)
    arm, seen, wanted = SerialArm(line, replace(muscles.spec)), Seen(), 1_000
    period = arm.spec.period
    with arm, Store.for_arm(folder / "arm.db", arm.spec) as store:
        while line.now() < seconds:
            result = collect(arm, store, wanted, seed, settings=QUICK, watch=seen)
            wanted = result.transitions + 1_000
        store.check()
        rows = [one for block in store.blocks(marked=True) for one in block.time]
        lost = {time for times in seen.times if len(times) > 1 for time in times}.difference(rows)
        gaps = 0
        for block in store.blocks():
            follows = (np.diff(block.step) == 1) & (np.diff(block.sequence) == 0)
            gaps += int((np.abs(np.diff(block.time)[follows] / period - 1) > 0.5).sum())
        broken = sum("broke off here" in mark.reason for marks in store.marks().values() for mark in marks)
    assert (len(lost), gaps) == (0, 0)
    times, valves = zip(*muscles.set, strict=True)
    passed = [one for one in silences if one.end < line.now() and one.end - one.begin > LONGEST_FED]
    for one in passed:
        then = valves[int(np.searchsorted(times, one.begin + LONGEST_FED)) - 1]
        assert then == [[-1, -1]], f"not vented {LONGEST_FED} s after {one}"
    assert result.link["losses"] >= len(passed)
    return {"losses": result.link["losses"], "sequences broken off": broken, "rows": len(rows)}


LONGEST_FED = DEAD_MAN_MS / 1e3 + 0.001
"""A board that was fed last before this time [s] has vented its arm."""


def drawn_silences(seconds: float, every: float, seed: int) -> list[Silence]:
    """Return silences for so long [s], one ``every`` so often: stalls of 40 to 600 ms, every fifth a plug pulled."""
    random, found = np.random.default_rng(seed), list[Silence]()
    for number in range(round(seconds / every)):
        begin, unplugged = every * (number + random.uniform(0.1, 0.6)), number % 5 == 4
        found.append(Silence(begin, begin + (10.0 if unplugged else random.uniform(0.04, 0.6)), unplugged))
    return found


def test_collecting_goes_on_whatever_the_line_does(tmp_path: Path) -> None:
    counted = collect_in_silences(tmp_path, 240.0, drawn_silences(240.0, 20.0, seed=1), seed=1)
    assert counted["losses"] >= 6
    assert counted["sequences broken off"] >= 2


@pytest.mark.soak
def test_three_hours_with_ten_losses_an_hour(tmp_path: Path) -> None:
    hours = amount("LOSS_HOURS", 3)
    attack = Attack("hours with stalls and a cable out", hours)
    counted = collect_in_silences(tmp_path, 3600.0 * hours, drawn_silences(3600.0 * hours, 360.0, seed=2), seed=2)
    attack.advance(hours)
    attack.summarise(", ".join(f"{what} {count:,}" for what, count in counted.items()))


class Leaning:
    """Fills one muscle and vents the other: all that a controller needs here."""

    def reset(self, goal: np.ndarray) -> None:
        pass

    def track(self, reference: Reference) -> None:
        pass

    def act(self, reading: Reading) -> np.ndarray:
        return np.array([[1, -1]], np.int8)


def test_movements_are_made_again_and_what_was_recorded_of_them_is_kept(w: Wired, tmp_path: Path) -> None:
    goals, settings = [np.array([600.0]), np.array([500.0])], MoveSettings(hold=2.0, tries=1)
    with recorder(tmp_path / "moves.db", w.arm.spec) as record:
        after(w, 1.0, lambda: unplug(w, 3.0))
        moved = list(move(w.arm, Leaning(), goals, settings, record=record))
        after(w, 1.0, lambda: unplug(w, 3.0))  # while it moves to where the reference begins
        tracked = track(w.arm, Leaning(), Reference(lambda time: goals[0]), 2.0, record=record)
    assert [len(one.recorded) for one in moved] == [61, 61]
    assert len(tracked.recorded) == 61
    with Store.open(tmp_path / "moves.db") as store:
        rows = [entry.rows for entry in store.catalogue()]
        assert len(rows) == 4
        assert 25 < rows[0] < 32
        assert list(store.marks()) == [1]


def test_a_check_up_and_a_calibration_go_on(w: Wired) -> None:
    short = CheckupSettings(rest=4.0, settle=2.0, sweep_steps=8)
    for seconds in (0.5, 9.0, 25.0, 45.0):
        after(w, seconds, lambda: unplug(w, 2.0))
    checkup = measure(w.arm, short)
    assert w.arm.link_counts()["losses"] == 4
    assert [one.kind for one in diagnose(checkup)] == []
    after(w, 2.5, lambda: stalling(w, 0.4))
    fill_alone(w.arm, 0, 0)
    assert w.arm.read().pressure[0, 0] > 0.7 * w.arm.spec.max_pressure_counts


class Unheard(VirtualArm):
    """An arm of a user's own whose line is lost once."""

    connected = 0

    def wait(self, seconds: float) -> None:
        if self.time > 1.0 and not self.connected:
            raise LineLost("no answer")
        super().wait(seconds)

    def regain(self) -> None:
        self.connected += 1


def test_an_arm_of_one_s_own_says_by_an_error_that_its_line_is_lost(tmp_path: Path) -> None:
    arm = Unheard(seed=1)
    arm.spec = replace(arm.spec, name="mine")
    with guarded(arm) as guard:
        [moved] = move(guard, Leaning(), [np.array([600.0])], MoveSettings(hold=2.0, tries=1))
    assert arm.connected == 1
    assert len(moved.recorded) == 61


def test_a_transfer_goes_on_and_its_broken_movement_is_kept(w: Wired, small_run: Path, tmp_path: Path) -> None:
    agent = Agent.load(small_run / "agent.safetensors")
    with Store.for_arm(tmp_path / "arm.db", w.arm.spec) as store:
        after(w, 4.9, lambda: unplug(w, 2.0))
        moved = transfer(agent, w.arm, store, TransferSettings(episodes=1, test_episodes=1), seed=1)
        kinds = [entry.kind for entry in store.catalogue()]
    assert [one.n for one in moved.movements.values()] == [1, 1, 1]
    assert kinds == ["broken episode", "episode", "episode", "episode"]
    assert w.arm.link_counts()["losses"] == 1

"""What must hold when the line, the host or the controller fails: faults injected, consequences measured."""

import re
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from tests.arm.serial.wired import Wired, all_valves, stalling, wired

from pneumarm.arm import ControlCycle, Reading, guarded
from pneumarm.arm.serial import LineFaults
from pneumarm.arm.serial.arm import BOOT
from pneumarm.arm.serial.protocol import VERSION, Cause, Request
from pneumarm.errors import ArmFailure, UnusableInput
from pneumarm.transitions import CollectBegin, CollectSettings, Recorded, Store, collect
from soak import Attack, amount

PERIOD = 1 / 30


@pytest.fixture
def w() -> Iterator[Wired]:
    found = wired()
    with found.arm:
        yield found


def in_motion(w: Wired, turns: int = 30) -> None:
    """Have the arm move for some control periods."""
    rng = np.random.default_rng(turns)
    for _ in range(turns):
        begun = w.arm.read().time
        w.arm.set_valves(rng.integers(-1, 2, (1, 2)).astype(np.int8))
        w.arm.wait_until(begun + PERIOD)
    w.arm.set_valves(all_valves(w.arm, 1))


def until_failure(w: Wired) -> tuple[float, str]:
    """Go on in the control cycle; return when [s] it failed after now, and why."""
    begun, turns = w.line.now(), ControlCycle(guarded(w.arm)).run(lambda reading: all_valves(w.arm, 1))
    with pytest.raises(ArmFailure) as failed:
        deque(islice(turns, 150), maxlen=0)
    return w.line.now() - begun, str(failed.value)


def vented_after(w: Wired, begun: float) -> float:
    """Return the time [s] from ``begun`` until all muscles were vented."""
    w.wire.sleep_until(begun + 0.4)
    assert w.is_vented
    return w.muscles.set[-1][0] - begun


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.9])
@pytest.mark.parametrize("fault", ["unplugged", "cut"])
def test_line_that_goes_in_an_episode(w: Wired, fault: str, phase: float, monkeypatch: pytest.MonkeyPatch) -> None:
    in_motion(w)
    fed = w.line.now()
    w.arm.wait(phase * PERIOD)
    gone = w.line.now()
    setattr(w.line, fault, True)
    w.line.sleep_until(fed + PERIOD)  # the turn under way
    noticed: list[float] = []
    monkeypatch.setattr(w.arm.link, "_note_silence", lambda: noticed.append(w.line.now() - gone))
    took, why = until_failure(w)
    if fault == "unplugged":
        assert took <= PERIOD + 2e-3
        assert "gone" in why
    else:
        assert noticed[0] <= 2 * PERIOD + 2e-3
        assert took <= PERIOD + 0.25
        assert "not answered for 0.2" in why
    assert vented_after(w, fed) <= 0.251
    setattr(w.line, fault, False)
    known = len(w.muscles.set)
    for use in (w.arm.read, w.arm.make_ready, lambda: w.arm.set_valves(all_valves(w.arm, 1))):
        with pytest.raises(ArmFailure, match="Look at plug and power"):
            use()
    w.wire.sleep_until(w.line.now() + 1)
    assert len(w.muscles.set) == known  # nothing moved
    w.arm.rearm()
    w.arm.set_valves(all_valves(w.arm, 1))
    assert w.applied == [[1, 1]]


def test_line_that_stays_gone_is_said_to_be(w: Wired) -> None:
    in_motion(w)
    w.line.unplugged = True
    begun = w.line.now()
    for _ in range(3):
        with pytest.raises(ArmFailure, match="gone"):
            w.arm.rearm()
    assert w.line.now() == begun  # at once
    w.line.unplugged, w.line.cut = False, True
    with pytest.raises(ArmFailure, match="nobody answered"):
        w.arm.rearm()
    assert w.line.now() - begun <= BOOT + 0.2


KINDS = ("dropped", "doubled", "late")
CASES = [(kind, share) for kind in KINDS for share in (0.05, 0.2, 0.5)]


@pytest.mark.parametrize(("faults", "share"), [*CASES, ("all", 0.05), ("all", 0.2)])
def test_bad_line(w: Wired, faults: str, share: float) -> None:
    """Nothing stale acts, nothing is acknowledged that was not done, the loop keeps its rate, gaps stay gaps."""
    w.line.faults = LineFaults(**dict.fromkeys(KINDS if faults == "all" else (faults,), share), seed=5)
    rng, turns, steps = np.random.default_rng(1), 300, []
    cycle = ControlCycle(guarded(w.arm))

    def decide(reading):
        assert reading.time <= w.line.now()
        return rng.integers(-1, 2, (1, 2)).astype(np.int8) if len(steps) < turns else None

    for step in cycle.run(decide):
        if step.valves is not None:
            assert w.applied == step.valves.tolist()  # what was acknowledged is so
        steps.append(step)
    assert (w.wire.stale > 0) == (faults != "dropped")
    assert w.wire.stale_applied == 0
    # With half of the frames lost each way a quarter of the attempts is answered: until a turn counts as missed
    # there is time for twelve, and for as many when the valves are set.
    halved = share == 0.5 and faults != "doubled"
    assert cycle.missed_deadlines <= (0.05 * turns if halved else 0)
    at = np.array([step.reading.time - steps[0].reading.time for step in steps]) / PERIOD
    assert cycle.missed_deadlines + len(steps) == np.rint(at[-1]) + 1  # each tick had its turn or was counted
    off = at - np.rint(at)
    assert np.quantile(off[-turns // 10 :], 0.2) * PERIOD < 2e-3  # and to the end they lie on the grid of the first
    recorded = Recorded.from_steps(steps, w.arm.spec)
    joined = np.diff(recorded.step) == 1
    assert (np.abs(np.diff(recorded.time)[joined] / PERIOD - 1) < 0.5).all()
    assert recorded.transitions == joined.sum()


_LINE = 500
"""Exchanges until the line gets other faults."""


def exchange_on_bad_lines(attack: Attack, seed: int) -> dict[str, int]:
    """Exchange random valves for readings on lines with all faults at once; return how often what came of it.

    No valves are ever set but those asked for, or all exhausts open; what is acknowledged is so; nothing stale acts;
    readings are of the past and have times that rise. A line that is given up leaves the arm vented, and once the arm
    is armed again it goes on.
    """
    rng, w, given_up = np.random.default_rng(seed), wired(seed), 0
    vented = all_valves(w.arm, -1).tolist()
    asked, told, known = vented, -np.inf, len(w.muscles.set)

    def check_valves() -> None:
        nonlocal known
        assert all(one in (asked, vented) for _, one in w.muscles.set[known:])
        known = len(w.muscles.set)

    with w.arm:
        while attack.done < attack.total:
            if attack.done % _LINE == 0:
                shares = rng.uniform(0, rng.choice((0.05, 0.2, 0.4)), 5)
                w.line.faults = LineFaults(*shares, lateness=rng.uniform(0.002, 0.1), seed=attack.done)
            attack.advance()
            try:
                reading = w.arm.read()
                check_valves()
                assert told < reading.time <= w.line.now()
                told, asked = reading.time, rng.integers(-1, 2, (1, 2)).astype(np.int8).tolist()
                w.arm.set_valves(np.array(asked, np.int8))
                assert w.applied == asked
                check_valves()
                w.arm.wait_until(reading.time + PERIOD)
            except ArmFailure as error:
                if not re.search("has not answered|heard nothing", str(error)):
                    raise
                given_up += 1
                w.wire.sleep_until(w.line.now() + 0.3)
                check_valves()
                assert w.is_vented
                w.line.faults = replace(w.line.faults, dropped=0.0, corrupted=0.0)
                w.arm.rearm()
                known = len(w.muscles.set)
    assert w.wire.stale_applied == 0
    return {"stale": w.wire.stale, "corrupt": w.arm.link.counts.corrupt, "given up": given_up}


def test_exchanges_on_bad_lines() -> None:
    tally = exchange_on_bad_lines(Attack("exchanges", 1_500), seed=1)
    assert min(tally["stale"], tally["corrupt"]) > 50


@pytest.mark.soak
def test_many_exchanges_on_bad_lines() -> None:
    attack = Attack("exchanges on bad lines", amount("EXCHANGES", 100_000))
    tally = exchange_on_bad_lines(attack, seed=2)
    attack.summarise(", ".join(f"{what} {count:,}" for what, count in tally.items()))


def test_times_of_readings_are_true_on_a_bad_line(w: Wired) -> None:
    w.line.faults = LineFaults(dropped=0.2, late=0.3, lateness=0.015)
    booted, errors = w.board._booted, []
    for _ in range(300):
        answer = w.arm.link.ask(Request.READ)
        mapped = w.arm._reading(answer).time
        errors.append(mapped - (booted + 1e-6 * answer.frame.values[0]))
        w.arm.wait(PERIOD)
    assert np.median(np.abs(errors)) < 1e-4
    assert np.abs(errors).max() < 2e-3


def test_waiting_on_a_bad_line_keeps_the_arm_alive() -> None:
    for seed in range(10):
        w = wired(seed=1)
        w.line.faults = LineFaults(dropped=0.3, late=0.2, seed=seed)
        w.arm.set_valves(all_valves(w.arm, 0))
        w.arm.wait(20.0)
        assert w.board.armed


def test_driver_that_claims_an_empty_buffer_costs_time_only(w: Wired) -> None:
    w.line.faults = LineFaults(claims_empty=0.5)
    in_motion(w, 100)
    assert w.applied == [[1, 1]]


def test_a_wire_that_corrupts_never_sets_other_valves(w: Wired) -> None:
    w.line.faults = LineFaults(corrupted=0.3, seed=2)
    rng = np.random.default_rng(3)
    for _ in range(1000):
        valves = rng.integers(-1, 2, (1, 2)).astype(np.int8)
        known = len(w.muscles.set)
        w.arm.set_valves(valves)
        assert all(one == valves.tolist() for _, one in w.muscles.set[known:])
        w.arm.wait(0.005)
    assert w.arm.link.counts.corrupt > 200


@pytest.mark.parametrize("turn", [0.0, 0.5])
@pytest.mark.parametrize("stall", [0.04, 0.06, 0.1, 0.2])
def test_board_that_stalls_is_noticed_and_goes_on(
    w: Wired, stall: float, turn: float, caplog: pytest.LogCaptureFixture
) -> None:
    in_motion(w)
    steps, noticed, cycle = [], [], ControlCycle(guarded(w.arm))
    for step in cycle.run(lambda reading: all_valves(w.arm, len(steps) % 2) if len(steps) < 60 else None):
        steps.append(step)
        if len(steps) == 20:
            w.arm.wait(turn * PERIOD)
            stalling(w, stall)
        noticed.append(w.arm.link.counts.silences)
    assert len(steps) == 61
    assert noticed[-1] == (stall > 1.6 * PERIOD) or (noticed[-1] == 1 and stall == 0.04)
    assert sum("the board is late" in one.getMessage() for one in caplog.records) == noticed[-1]
    assert w.board.armed
    assert cycle.missed_deadlines <= stall / PERIOD + 1


def test_board_that_stalls_again_and_again_is_given_up_and_what_was_recorded_is_kept(
    w: Wired, tmp_path: Path
) -> None:
    settings = CollectSettings(actions=50, begin=CollectBegin(deflate=0.5, inflate=0.3, settle=0.3))
    sensed = iter(range(300))
    read = w.arm.read

    def read_then_stall() -> Reading:
        if next(sensed, None) is None:
            stalling(w, 0.3)
        return read()

    w.arm.read = read_then_stall  # type: ignore[method-assign]
    with Store.for_arm(tmp_path / "arm.db", w.arm.spec) as store:
        with pytest.raises(ArmFailure, match=r"lost 6 times within a minute \(the board has not answered for 0\.2"):
            collect(w.arm, store, 3_000, 1, settings=settings)
        assert store.sequences > 2
    assert not (np.array(w.applied) > 0).any()


@pytest.mark.parametrize("stall", [0.1, 0.24, 0.26, 1.0, 10.0])
def test_host_that_stalls(w: Wired, stall: float) -> None:
    in_motion(w)
    fed = w.line.now()
    w.wire.sleep_until(fed + stall)  # no line's business: the process was stopped
    if stall < 0.249:
        w.arm.set_valves(all_valves(w.arm, -1))
        return
    vented = next(time for time, valves in w.muscles.set if valves == [[-1, -1]] and time > fed)
    assert vented - fed <= 0.251
    for _ in range(2):
        with pytest.raises(ArmFailure, match="heard nothing for a quarter of a second"):
            w.arm.set_valves(all_valves(w.arm, 1))
    assert w.is_vented
    w.arm.make_ready()
    w.arm.set_valves(all_valves(w.arm, 1))
    assert w.applied == [[1, 1]]


@pytest.fixture
def cut_off() -> Iterator[Wired]:
    """Return an arm whose board has cut off muscle 1, which its host does not know yet, and is empty again."""
    with (w := wired(cut_off=0.1)).arm:
        w.arm.set_valves(np.array([[1, 0]], np.int8))
        begun = w.line.now()
        while w.applied != [[-1, 0]]:
            assert w.line.now() - begun < 0.24, "its muscle does not fill"
            w.wire.sleep_until(w.line.now() + 0.001)
        w.wire.sleep_until(begun + 2.0)
        assert not w.board.armed  # the dead-man has vented it besides
        yield w


def test_a_latch_that_nobody_has_seen_is_not_ended_by_making_ready(cut_off: Wired) -> None:
    """Only a silence of this host may be; a muscle over its limit is for a person to look at."""
    w, known = cut_off, len(cut_off.muscles.set)
    for _ in range(2):
        with pytest.raises(ArmFailure, match="cut off muscle 1 of joint 1"):
            w.arm.make_ready()
    assert len(w.muscles.set) == known  # nothing moved
    w.arm.rearm()
    w.arm.make_ready()
    w.arm.set_valves(all_valves(w.arm, 0))
    assert w.applied == [[0, 0]]


def test_a_latch_is_told_of_though_the_valves_are_as_they_were_asked_for() -> None:
    with (w := wired(cut_off=0.1)).arm:
        w.arm.set_valves(np.array([[1, 0]], np.int8))
        begun = w.line.now()
        while w.applied != [[-1, 0]]:
            assert w.line.now() - begun < 0.24, "its muscle does not fill"
            w.wire.sleep_until(w.line.now() + 0.001)
        with pytest.raises(ArmFailure, match="cut off muscle 1 of joint 1"):
            w.arm.set_valves(all_valves(w.arm, -1))


@pytest.mark.parametrize("done", [[[1, 0]], [[1, 1]], [[-1, -1]], [[0, -1]]])
@pytest.mark.parametrize("as_pulses", [False, True])
def test_valves_that_are_not_as_they_were_asked_for_are_a_failure(
    w: Wired, done: list[list[int]], as_pulses: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Such as a board sets whose program is not the one that it should be."""
    monkeypatch.setattr(w.board, "_applied", lambda: np.array(done, np.int8))
    if not as_pulses:
        with pytest.raises(ArmFailure, match="were asked for"):
            w.arm.set_valves(np.array([[1, -1]], np.int8))
    elif done == [[0, -1]]:
        assert w.arm.set_pulses(np.array([[0.5, -1.0]]))  # the pulse is over by now
    else:
        with pytest.raises(ArmFailure, match="were asked for"):
            w.arm.set_pulses(np.array([[0.5, -1.0]]))


@pytest.mark.parametrize(
    ("cause", "words"),
    [(Cause.EXTERNAL, "reset pin"), (Cause.BROWN_OUT, "supply too low"), (Cause.POWER_ON, "power on")],
)
def test_board_that_restarts(w: Wired, cause: Cause, words: str) -> None:
    in_motion(w)
    w.board.reset(cause)
    assert w.is_vented
    took, why = until_failure(w)
    assert took <= 2 * PERIOD
    assert f"restarted while in use ({words})" in why
    with pytest.raises(ArmFailure, match="restarted"):
        w.arm.make_ready()
    assert w.is_vented
    begun = w.line.now()
    w.arm.rearm()
    assert w.line.now() - begun < 2
    assert w.arm.reset_causes() == [words]
    w.arm.set_valves(all_valves(w.arm, 1))
    assert w.applied == [[1, 1]]


def test_closing_vents_at_once_and_disarms(w: Wired) -> None:
    in_motion(w)
    known = len(w.muscles.set)
    w.arm.close()
    assert w.muscles.set[known][1] == [[-1, -1]]
    assert not w.board.armed


def test_controller_that_hangs(w: Wired) -> None:
    in_motion(w)
    hung = w.line.now()
    w.board.hang()
    took, why = until_failure(w)
    assert w.arm.link.counts.silences == 1
    assert took <= PERIOD + 0.150
    assert "restarted while in use (its program hung)" in why
    w.wire.sleep_until(hung + 0.2)
    vented = next(time for time, valves in w.muscles.set if valves == [[-1, -1]] and time > hung)
    assert vented - hung <= 0.150
    begun = w.line.now()
    w.arm.rearm()
    assert w.line.now() - begun < 2
    assert w.arm.reset_causes() == ["its program hung"]


def test_controller_that_still_boots_is_waited_for(w: Wired) -> None:
    in_motion(w)
    w.line.cut = True
    until_failure(w)
    begun = w.line.now()
    line_read = w.line.line.read

    def read(timeout: float) -> bytes:
        w.line.cut = w.line.now() < begun + 1.8
        return line_read(timeout)

    w.line.line.read = read  # type: ignore[method-assign]
    w.arm.rearm()
    assert 1.8 <= w.line.now() - begun < 2.0


def test_a_board_of_another_version_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pneumarm.arm.serial.board.OLDEST_VERSION", VERSION + 1)
    with pytest.raises(UnusableInput, match="flash the firmware"):
        wired()


def test_shares_are_shares() -> None:
    with pytest.raises(UnusableInput, match=r"dropped cannot be 1\.5; expected a number, 1 or less"):
        LineFaults(dropped=1.5)


def test_the_same_seed_gives_the_same_faults_again(w: Wired) -> None:
    def lost() -> list[float]:
        w.line.faults = LineFaults(dropped=0.5, seed=7)
        return [w.line._random.random() for _ in range(20)]

    assert lost() == lost()

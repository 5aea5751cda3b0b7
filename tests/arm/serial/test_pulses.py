"""Pulses over a line on which everything can go wrong: as long as asked for, or the arm has failed and is vented."""

from itertools import pairwise

import numpy as np
import pytest
from tests.arm.serial.wired import DELAY, Wired, all_valves, wired

from pneumarm.arm import ControlCycle, GuardedArm, guarded
from pneumarm.arm.serial import LineFaults
from pneumarm.arm.serial.protocol import OLDEST_VERSION, PULSE_UNIT_US, VERSION, Cause
from pneumarm.errors import ArmFailure

PERIOD = 1 / 30
EXACT = 1e-6 * PULSE_UNIT_US
"""By how much a pulse may be longer or shorter than asked for [s]."""


def opened(w: Wired, muscle: int = 0, since: int = 0) -> list[tuple[int, float]]:
    """Return how a muscle's valves were opened since a change, and for how long [s] each time."""
    changes = [(time, valves[0][muscle]) for time, valves in w.muscles.set[since:]]
    changes = [now for before, now in pairwise([(0.0, 0), *changes]) if now[1] != before[1]]
    return [(valve, after - time) for (time, valve), (after, _) in pairwise(changes) if valve]


def random_pulses(w: Wired, turns: int, seed: int = 3) -> tuple[ControlCycle, list[np.ndarray]]:
    """Have a controller give random pulses, each of both muscles; return them as applied."""
    rng, left = np.random.default_rng(seed), iter(range(turns))
    cycle = ControlCycle(guarded(w.arm))

    def decide(reading):
        sign = rng.choice([-1.0, 1.0], (1, 2))
        return None if next(left, None) is None else sign * rng.uniform(0.1, 0.4, (1, 2))

    return cycle, [np.asarray(step.valves) for step in cycle.run(decide) if step.valves is not None]


@pytest.mark.parametrize("share", [0.0, 0.05, 0.2, 0.5])
@pytest.mark.parametrize("fault", ["dropped", "doubled", "late"])
def test_pulses_are_as_long_as_applied_on_a_bad_line(fault: str, share: float) -> None:
    """A request that is sent again, because it or its reply was lost, makes no pulse longer and none begin again."""
    with (w := wired()).arm:
        since = len(w.muscles.set)
        w.line.faults = LineFaults(**{fault: share}, seed=5)
        cycle, applied = random_pulses(w, 90)
        assert w.wire.stale_applied == 0
        assert cycle.missed_deadlines <= (5 if share == 0.5 else 0)
        for muscle in range(2):
            found = opened(w, muscle, since)
            assert len(found) == len(applied)
            for command, (valve, seconds) in zip(applied, found, strict=True):
                assert valve == np.sign(command[0, muscle])
                assert seconds == pytest.approx(abs(command[0, muscle]) * PERIOD, abs=EXACT)


def test_an_older_board_leaves_pulses_to_the_host() -> None:
    with (w := wired(version=OLDEST_VERSION)).arm:
        assert w.arm.version == OLDEST_VERSION
        assert not w.arm.set_pulses(np.array([[0.5, 0.0]]))
        since = len(w.muscles.set)
        _, applied = random_pulses(w, 30)
        found = opened(w, 0, since)
        assert len(found) == len(applied) == 30
        for command, (valve, seconds) in zip(applied, found, strict=True):
            assert valve == np.sign(command[0, 0])
            assert seconds == pytest.approx(abs(command[0, 0]) * PERIOD, abs=5 * DELAY)
        w.arm.rearm()
        assert w.arm.version == OLDEST_VERSION


def test_a_board_of_this_version_times_them_without_the_host() -> None:
    """The host asks twice a turn, to read and to open, as it does for whole periods."""
    with (w := wired()).arm:
        assert w.arm.version == VERSION
        before = w.arm.link.counts.requests
        random_pulses(w, 30)
        assert w.arm.link.counts.requests - before <= 2 * 30 + 2


def test_a_long_pulse_is_fed_and_not_begun_again() -> None:
    """At five hertz the host has to tell that it is there in the middle of a pulse."""
    with (w := wired(period=0.2)).arm:
        guard, since = GuardedArm(w.arm), len(w.muscles.set)
        guard.read()
        for share in (0.9, -0.6):
            guard.decide(np.array([[share, 0.0]]))
            guard.wait(0.2)
        assert opened(w, 0, since) == [(1, pytest.approx(0.18, abs=EXACT)), (-1, pytest.approx(0.12, abs=EXACT))]


def test_a_pulse_longer_than_the_dead_man_waits_is_left_to_the_host() -> None:
    with (w := wired(period=0.5)).arm:
        assert w.arm.set_pulses(np.array([[0.49, 1.0]]))
        assert not w.arm.set_pulses(np.array([[0.51, 0.0]]))
        guard, since = GuardedArm(w.arm), len(w.muscles.set)
        guard.read()
        guard.decide(np.array([[0.8, 0.0]]))
        guard.wait(0.5)
        assert opened(w, 0, since) == [(1, pytest.approx(0.4, abs=3 * DELAY))]


@pytest.mark.parametrize("what", ["cut", "unplugged"])
def test_line_that_goes_in_a_pulse(what: str) -> None:
    """The pulse ends when it was to end, then the dead-man vents."""
    with (w := wired()).arm:
        since, begun = len(w.muscles.set), w.line.now()
        assert w.arm.set_pulses(np.array([[0.5, 0.0]]))
        setattr(w.line, what, True)
        w.wire.sleep_until(begun + 0.2)
        assert opened(w, 0, since) == [(1, pytest.approx(PERIOD / 2, abs=EXACT))]
        w.wire.sleep_until(begun + 0.4)
        assert w.is_vented
        assert w.muscles.set[-1][0] - begun <= 0.251
        setattr(w.line, what, False)


def test_board_that_restarts_in_a_pulse_forgets_it() -> None:
    with (w := wired()).arm:
        assert w.arm.set_pulses(np.array([[0.5, 0.0]]))
        w.board.reset(Cause.BROWN_OUT)
        w.wire.sleep_until(w.line.now() + 0.1)
        assert w.is_vented
        with pytest.raises(ArmFailure, match="restarted while in use"):
            w.arm.set_pulses(np.array([[0.5, 0.0]]))
        w.arm.rearm()
        since = len(w.muscles.set)
        assert w.arm.set_pulses(np.array([[0.5, -0.25]]))
        w.arm.wait(0.3)
        assert opened(w, 0, since) == [(1, pytest.approx(PERIOD / 2, abs=EXACT))]
        assert opened(w, 1, since) == [(-1, pytest.approx(PERIOD / 4, abs=EXACT))]
        assert w.board.armed


def test_what_follows_ends_a_pulse() -> None:
    with (w := wired()).arm:
        since = len(w.muscles.set)
        assert w.arm.set_pulses(np.array([[0.5, 1.0]]))
        w.arm.wait(0.005)
        w.arm.set_valves(all_valves(w.arm, 1))
        w.arm.wait(0.3)
        assert w.applied == [[1, 1]]
        w.arm.set_valves(all_valves(w.arm, 0))
        ((_, seconds),) = opened(w, 0, since)
        assert seconds == pytest.approx(0.305, abs=6 * DELAY)

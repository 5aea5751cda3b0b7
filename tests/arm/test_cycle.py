from time import monotonic, sleep

import numpy as np
import pytest

from pneumarm.arm import BeginState, ControlCycle, GuardedArm
from pneumarm.arm.guard import HELD, REPLACED, Interventions
from pneumarm.arm.virtual import VirtualArm
from pneumarm.errors import ControllerFailure, UnusableInput

OPEN = np.array([[1, -1]], np.int8)


def kinds(arm):
    return [call if isinstance(call, str) else call[0] for call in arm.calls]


def deciding(*decisions):
    """A decision that gives these one after the other, then None."""
    remaining = list(decisions)
    return lambda reading: remaining.pop(0) if remaining else None


def test_a_turn_is_read_decide_wait_act_wait(smallest_arm):
    arm = smallest_arm(latency=0.007)
    steps = list(ControlCycle(GuardedArm(arm)).run(deciding(OPEN)))
    # wait_until is made of a reading and a wait on an arm that does not bring its own.
    assert kinds(arm) == ["read", "wait", "valves", "read", "wait", "read", "valves"]
    assert arm.calls[1] == ("wait", 0.007)
    assert arm.calls[4][1] == pytest.approx(1 / 30 - 0.007)
    assert [s.valves is None for s in steps] == [False, True]
    assert steps[0].valves.tolist() == [[1, -1]]
    assert arm.valves == [[0, 0]]


def test_an_arm_without_latency_acts_at_once(smallest_arm):
    arm = smallest_arm()
    list(ControlCycle(GuardedArm(arm)).run(deciding(OPEN)))
    assert kinds(arm)[:2] == ["read", "valves"]


def test_valves_can_be_closed_while_computing(smallest_arm):
    arm = smallest_arm(latency=0.007)
    list(ControlCycle(GuardedArm(arm), close_while_computing=True).run(deciding(OPEN, OPEN)))
    set_ = [call[1] for call in arm.calls if call[0] == "valves"]
    # The last two: closed while it was decided to stop, and on leaving.
    assert set_ == [[[0, 0]], [[1, -1]], [[0, 0]], [[1, -1]], [[0, 0]], [[0, 0]]]


def test_what_is_reported_is_what_was_applied(smallest_arm):
    arm = smallest_arm(max_pressure=0.5)
    arm.pressure = [[100, 0]]
    cycle = ControlCycle(GuardedArm(arm))
    steps = list(cycle.run(deciding(OPEN)))
    assert steps[0].valves.tolist() == cycle.applied.tolist() == [[0, -1]]


@pytest.mark.parametrize(("late", "missed", "turn"), [(0.3, 0, 3), (0.6, 1, 4), (1.4, 1, 4), (3.2, 3, 6)])
def test_a_late_turn_does_not_move_the_grid(smallest_arm, late, missed, turn):
    arm = smallest_arm()
    period = arm.spec.period
    cycle = ControlCycle(GuardedArm(arm))
    times = []
    for step in cycle.run(deciding(*[OPEN * 0] * 6)):
        times.append(step.reading.time)
        if len(times) == 3:
            arm.time += (1 + late) * period  # whoever looks at the steps took their time
    assert cycle.missed_deadlines == missed
    expected = [0, 1, 2, 3 + late, *(turn + 1 + k for k in range(3))]
    assert np.array(times) - times[0] == pytest.approx(period * np.array(expected))


def test_lateness_does_not_add_up(smallest_arm):
    arm, random = smallest_arm(), np.random.default_rng(0)
    period = arm.spec.period
    cycle = ControlCycle(GuardedArm(arm))
    times = []
    for step in cycle.run(deciding(*[OPEN * 0] * 300)):
        times.append(step.reading.time / period)
        if random.random() < 0.3:
            arm.time += random.exponential(period)
    ticks = np.array(times) - times[0]
    assert np.abs(ticks - np.rint(ticks)).max() <= 0.5
    on_time = np.abs(ticks - np.rint(ticks)) < 1e-6
    assert on_time.mean() > 0.5
    assert on_time[-50:].any()  # no drift: also in the end turns lie on the first one's grid
    assert cycle.missed_deadlines > 10
    assert cycle.missed_deadlines + len(times) == pytest.approx(np.rint(ticks[-1]) + 1)


def test_an_error_in_deciding_is_held_then_vented_then_told(smallest_arm):
    arm = smallest_arm()

    def decide(reading):
        if reading.time > 0:
            raise RuntimeError("no idea")
        return OPEN

    applied = []
    with pytest.raises(ControllerFailure, match=r"31 decisions in a row .*RuntimeError: no idea"):
        applied.extend(step.valves.tolist() for step in ControlCycle(GuardedArm(arm)).run(decide))
    held, most = round(30 * HELD), round(30 * REPLACED)
    assert applied == [[[1, -1]]] * (1 + held) + [[[-1, -1]]] * (most - held)
    assert arm.valves == [[0, 0]]


def test_an_error_on_purpose_ends_at_once_with_closed_valves(smallest_arm):
    arm = smallest_arm()

    def decide(reading):
        if reading.time > 0:
            raise UnusableInput("another arm, please")
        return OPEN

    with pytest.raises(UnusableInput):
        list(ControlCycle(GuardedArm(arm)).run(decide))
    assert arm.valves == [[0, 0]]


def real_time(smallest):
    """Return an arm whose clock runs while somebody computes, as hardware's does, at a period of 50 ms."""

    class RealTime(smallest):
        def read(self):
            now = monotonic()
            super().wait(max(0.0, now - self.time) if self.time else 0.0)
            self.time = now
            return super().read()

        def wait(self, seconds):
            sleep(seconds)

    return RealTime(period=0.05)


def test_late_decisions_are_held_then_vented_and_the_arm_goes_on_when_they_are_in_time(smallest_arm):
    arm = real_time(smallest_arm)
    # In periods: in time, a little late, in time, lost in thought, in time.
    thoughts = [0.0, 1.5, 0.0, HELD / 0.05 + 2.0, 0.0]
    remaining = list(thoughts)
    decisions = [OPEN, -OPEN, -OPEN, OPEN, OPEN]

    def decide(reading):
        if not remaining:
            return None
        sleep(remaining.pop(0) * 0.05)
        return decisions[len(thoughts) - len(remaining) - 1]

    guard = GuardedArm(arm)
    cycle = ControlCycle(guard)
    applied = [step.valves.tolist() for step in cycle.run(decide) if step.valves is not None]
    assert applied[1] == applied[0] == OPEN.tolist()
    assert applied[2] == (-OPEN).tolist()
    assert applied[3] == [[-1, -1]]
    assert applied[4] == OPEN.tolist()
    assert guard.interventions == Interventions(late=2, vented=1)
    assert cycle.missed_deadlines >= 1


def test_computing_takes_no_time_of_an_arm_whose_clock_stands_still():
    guard = GuardedArm(VirtualArm())
    plain = [s.reading.angle for s in ControlCycle(GuardedArm(VirtualArm())).run(deciding(OPEN, OPEN, OPEN))]

    def slow(reading, quick=deciding(OPEN, OPEN, OPEN)):
        sleep(0.05)
        return quick(reading)

    assert [s.reading.angle for s in ControlCycle(guard).run(slow)] == plain
    assert guard.interventions == Interventions()


def test_stopping_early_closes_the_valves(smallest_arm):
    arm = smallest_arm()
    steps = ControlCycle(GuardedArm(arm)).run(lambda reading: OPEN)
    next(steps)
    assert arm.valves == [[1, -1]]
    steps.close()
    assert arm.valves == [[0, 0]]


def test_begin_states_are_random_and_at_rest(smallest_arm):
    reached = []
    for seed in range(40):
        arm = smallest_arm(joints=2)
        arm.pressure = [[120, 40], [0, 160]]
        BeginState(deflate=2.0, inflate=0.9, settle=1.0).reach(GuardedArm(arm), np.random.default_rng(seed))
        assert arm.valves == [[0, 0], [0, 0]]
        assert arm.calls[-1] == ("wait", 1.0)
        assert 3.0 <= arm.time <= 3.9 + 1e-9
        reached.append(np.ravel(arm.pressure))
    # Each muscle is inflated for a time of its own, uniform in 0..0.9 s.
    assert np.min(reached, axis=0) == pytest.approx(np.zeros(4), abs=25)
    assert np.max(reached, axis=0) == pytest.approx(np.full(4, 0.9 * 166), abs=25)
    assert np.abs(np.corrcoef(np.transpose(reached)) - np.eye(4)).max() < 0.5


def test_begin_states_respect_the_pressure_limit(smallest_arm):
    arm = smallest_arm(max_pressure=0.3)
    BeginState().reach(GuardedArm(arm), np.random.default_rng(1))
    assert np.max(arm.pressure) < 0.3 * 166 + 166 / 30 + 1

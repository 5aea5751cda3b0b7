"""A controller that does not come back: the arm is held, then vented, and the controller is stopped."""

import gc
import math
import signal
from threading import Thread
from threading import enumerate as threads
from time import monotonic, sleep

import numpy as np
import pytest

from children import LIMIT, wait_until
from pneumarm.arm import Reading
from pneumarm.arm.cycle import ControlCycle
from pneumarm.arm.guard import HELD, GuardedArm, Interventions
from pneumarm.arm.virtual import VirtualArm
from pneumarm.errors import ArmFailure, ControllerFailure

PERIOD = 0.05
OPEN = np.array([[1, 0]], np.int8)
VENTED = [[-1, -1]]


@pytest.fixture
def arm(smallest_arm):
    """Return an arm whose clock runs while somebody computes, and that notes when which valves were set."""

    class RealTime(smallest_arm):
        def __init__(self):
            super().__init__(period=PERIOD)
            self.begun, self.set = monotonic(), []

        def read(self):
            super().wait(monotonic() - self.begun - self.time)
            return super().read()

        def wait(self, seconds):
            sleep(seconds)

        def set_valves(self, valves):
            self.set.append((monotonic() - self.begun, valves.tolist()))
            super().set_valves(valves)

    return RealTime()


@pytest.fixture(autouse=True)
def fresh_interrupts():
    """The command line's handler takes interrupts within 2 s for the same one; other tests may have installed it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def endless(reading):
    while True:
        pass


def asleep(reading):
    sleep(1000)


def stubborn(reading):
    """Go on whatever happens, twice."""
    for _ in range(2):
        try:
            sleep(1000)
        except BaseException:
            continue
    return OPEN


def after(turns, hang):
    """Return what opens an inlet for some turns, and then does not come back."""
    remaining = iter(range(turns))
    return lambda reading: OPEN if next(remaining, None) is not None else hang(reading)


@pytest.mark.parametrize("hang", [endless, asleep])
def test_a_controller_that_never_comes_back_is_held_then_vented_then_stopped(arm, hang):
    guard, steps, asked = GuardedArm(arm), [], []
    decide = after(3, hang)

    def noted(reading):
        asked.append(reading.time)
        return decide(reading)

    with pytest.raises(ControllerFailure, match=r"had not decided for 0\.4 s"):
        steps.extend(ControlCycle(guard, patience=0.4).run(noted))
    assert len(steps) == 3
    first = next(time for time, valves in arm.set if valves == VENTED)
    # Held up to the last moment: other programs may be busy.
    assert first - asked[-1] >= HELD - 1e-3
    assert [valves for time, valves in arm.set if time < first] == [OPEN.tolist()] * 3
    assert [valves for _, valves in arm.set].count(VENTED) > 1  # a dead-man is fed
    assert guard.interventions == Interventions(late=1, vented=1)
    assert arm.valves == [[0, 0]]


def test_one_that_comes_back_late_finds_the_arm_vented_and_goes_on(arm):
    guard = GuardedArm(arm)
    thoughts = iter([0.0, 0.5, 0.0, 0.0])

    def decide(reading):
        thought = next(thoughts, None)
        if thought is None:
            return None
        sleep(thought)
        return OPEN

    steps = list(ControlCycle(guard).run(decide))
    assert [step.valves.tolist() for step in steps[:-1]] == [OPEN.tolist(), VENTED, OPEN.tolist(), OPEN.tolist()]
    vented = [time for time, valves in arm.set if valves == VENTED]
    assert vented[0] >= steps[1].reading.time + HELD - 1e-3
    assert len(vented) > 1
    assert steps[2].reading.pressure.max() == 0.0
    assert guard.interventions == Interventions(late=1, vented=1)


def test_limits_hold_while_a_decision_is_out(smallest_arm):
    arm = smallest_arm(period=PERIOD)
    guard = GuardedArm(arm)
    reading = guard.read()
    guard.decide(OPEN)
    arm.wait(1.5 * PERIOD)
    arm.pressure = [[guard.spec.max_pressure_counts + 1, 0]]
    assert guard.stand_in(reading)
    assert arm.valves == [[0, 0]]
    assert guard.interventions == Interventions(pressure=1)


def test_who_is_not_the_main_thread_is_stopped_too(arm):
    told = []

    def job():
        try:
            list(ControlCycle(GuardedArm(arm), patience=0.2).run(after(1, endless)))
        except BaseException as error:
            told.append(error)

    thread = Thread(target=job)
    thread.start()
    thread.join(LIMIT)
    assert isinstance(told[0], ControllerFailure)


def test_one_that_goes_on_is_interrupted_again(arm, monkeypatch):
    monkeypatch.setattr("pneumarm.arm.watchdog._AGAIN", 0.1)
    with pytest.raises(ControllerFailure):
        list(ControlCycle(GuardedArm(arm), patience=0.2).run(after(1, stubborn)))


def test_an_arm_that_fails_meanwhile_is_told_of(arm):
    def decide(reading):
        arm.read = lambda: 1 / 0
        sleep(0.4)
        return OPEN

    with pytest.raises(ArmFailure, match=r"RealTime\.read failed: ZeroDivisionError"):
        list(ControlCycle(GuardedArm(arm)).run(decide))
    assert arm.valves == [[0, 0]]


def test_an_arm_that_fails_only_once_meanwhile_is_told_of_too(arm):
    """A clock that went back is said once; whoever went on would wait for a time of the old clock."""

    def decide(reading):
        arm.begun += 0.5 * PERIOD + reading.time
        arm.time = 0.0
        sleep(0.4)
        return OPEN

    guard = GuardedArm(arm)
    arm.begun -= 100.0
    with pytest.raises(ArmFailure, match="its clock went back"):
        list(ControlCycle(guard).run(decide))
    assert arm.valves == [[0, 0]]


def test_an_interrupt_before_the_controller_is_asked_leaves_nothing_to_look_after(arm, monkeypatch):
    guard = GuardedArm(arm)
    begin = guard.watchdog.begin

    def interrupted(*args):
        begin(*args)
        raise KeyboardInterrupt

    monkeypatch.setattr(guard.watchdog, "begin", interrupted)
    with pytest.raises(KeyboardInterrupt):
        list(ControlCycle(guard).run(lambda reading: OPEN))
    touched = len(arm.set)
    sleep(HELD + 3 * PERIOD)
    assert arm.valves == [[0, 0]]
    assert len(arm.set) == touched


@pytest.mark.parametrize("states", [True, False])
def test_an_arm_whose_clock_stands_still_meanwhile_is_left_alone_until_patience_ends(states):
    class LockStep(VirtualArm):
        readings = 0

        def read(self) -> Reading:
            self.readings += 1
            return super().read()

        def get_state(self):
            return super().get_state() if states else None

    arm = LockStep(seed=3)
    guard = GuardedArm(arm)
    with pytest.raises(ControllerFailure, match=r"had not decided for 0\.5 s"):
        list(ControlCycle(guard, patience=0.5).run(after(2, asleep)))
    assert arm.readings == 3 + (not states)  # one look shows that its clock stands still
    assert arm.time == pytest.approx(2 * guard.spec.period, abs=1e-3)


def test_the_thread_ends_when_nothing_is_to_be_looked_at(arm):
    def running():
        return [thread for thread in threads() if thread.name == "pneumarm watchdog"]

    turns = iter(range(5))
    list(ControlCycle(GuardedArm(arm)).run(lambda reading: OPEN if next(turns, None) is not None else None))
    wait_until("the end of the thread", lambda: not running())


def test_nobody_sees_to_an_arm_that_nobody_holds(arm):
    """Such as that of an environment which was dropped and not closed."""
    guard = GuardedArm(arm)
    guard.watchdog.begin(guard.read(), math.inf)
    thread = guard.watchdog._thread
    wait_until("venting", lambda: arm.valves == VENTED)
    assert thread.is_alive()
    del guard
    gc.collect()
    thread.join(LIMIT)
    assert not thread.is_alive()


def test_an_arm_whose_clock_goes_back_has_failed_and_can_be_used_again(smallest_arm):
    arm = smallest_arm()
    guard = GuardedArm(arm)
    arm.time = 100.0
    guard.read()
    arm.time = 0.5
    with pytest.raises(Exception, match=r"went back from 100\.00 to 0\.50 s"):
        guard.read()
    assert guard.read().time == 0.5

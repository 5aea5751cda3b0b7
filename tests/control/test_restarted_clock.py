"""The clock of an arm begins anew, as when its controller was reset: times, marks and findings stay right."""

from dataclasses import replace

import numpy as np
import pytest

from pneumarm.arm import ControlCycle, Reading, Step, guarded
from pneumarm.arm.valves import to_valves
from pneumarm.arm.virtual import SupplyLoss, VirtualArm, draw_parameters
from pneumarm.control import Monitor
from pneumarm.errors import ArmFailure
from pneumarm.task.movements import LONGEST_PAUSE, running_time
from pneumarm.transitions import CollectBegin, CollectSettings, Store, collect
from pneumarm.transitions.rows import Recorded

QUICK = CollectSettings(actions=100, begin=CollectBegin(deflate=0.5, inflate=0.5, settle=0.3))


def test_running_time_leaves_out_what_lies_between_the_clocks_and_long_pauses():
    start, end = [100.0, 108.0, 3.0, 12.0, 12.0 + 5 + LONGEST_PAUSE + 1], [103.0, 110.0, 5.0, 17.0, 150.0]
    #   3 s, a pause of 5 s and 2 s; another clock: 2 s, a pause of 7 s and 5 s; too long a pause: 150 - 138 s
    np.testing.assert_allclose(running_time(start, end), [3, 10, 12, 24, 36])
    assert running_time([], []).shape == (0,)


class Resettable(VirtualArm):
    """A virtual arm without a state, whose controller begins anew at a reading: its clock then shows 0."""

    left = 10**9
    origin = 0.0

    def read(self) -> Reading:
        self.left -= 1
        if self.left == 0:
            self.origin = self.time
        reading = super().read()
        return Reading(reading.time - self.origin, reading.angle, reading.pressure)

    def wait_until(self, time):
        super().wait_until(time + self.origin)

    def get_state(self):
        return None


def test_collecting_goes_on_after_the_clock_began_anew_and_marks_nothing_sound(tmp_path):
    arm = Resettable(draw_parameters(3), seed=3, faults=[SupplyLoss(begin=60.0, end=70.0)])
    arm.left = 2_000
    with Store.for_arm(tmp_path / "arm.db", arm.spec) as store:
        with pytest.raises(ArmFailure, match="its clock went back"):
            collect(arm, store, 3_000, 1, settings=QUICK, watch=Monitor(arm.spec))
        before, stored = store.marked_rows(1), store.sequences
        assert 100 < sum(before.values()) < 700
        watch = Monitor(arm.spec)
        result = collect(arm, store, 3_000, 1, settings=QUICK, watch=watch)
        assert store.marked_rows(1) == before == result.marked
        assert result.sequences > stored + 5
        assert {number for number in store.marks() if number > stored} == set()


def test_what_is_wrong_when_the_clock_begins_anew_stays_wrong_and_is_told_on_both_clocks():
    arm = VirtualArm(draw_parameters(3), seed=2, faults=[SupplyLoss(begin=40.0, end=90.0)])
    turns, draw = iter(range(3_000)), np.random.default_rng(2)

    def decide(reading):
        return to_valves(draw.integers(9, size=1)) if next(turns, None) is not None else None

    steps = list(ControlCycle(guarded(arm)).run(decide))
    period, monitor = arm.spec.period, Monitor(arm.spec)

    def seen(first, last, clock):
        """Let the monitor see these seconds, of which the first is at ``clock`` [s]."""
        part = [step for step in steps if first <= step.reading.time < last]
        shifted = [replace(step.reading, time=step.reading.time - first + clock) for step in part]
        monitor.begin(at_rest=False)
        for reading, step in zip(shifted, part, strict=True):
            monitor.see(reading, step.valves)
        return Recorded.from_steps([Step(r, s.valves) for r, s in zip(shifted, part, strict=True)], arm.spec)

    seen(1.0, 65.0, 500.0)
    (old,) = monitor.now
    assert old.spoils
    assert 530.0 < old.since < 550.0
    state, monitor = monitor.get_state(), Monitor(arm.spec)
    monitor.set_state(state)

    still = seen(65.0, 75.0, 2.0)
    ended, lasting = monitor.findings[-2:]
    assert (ended.since, ended.until) == (old.since, pytest.approx(564.0, abs=2 * period))
    assert (lasting.kind, lasting.until) == (old.kind, None)
    assert lasting.since == pytest.approx(2.0, abs=2 * period)
    assert monitor.now == [lasting]
    (mark,) = monitor.marks(still)
    assert (mark.first, mark.last) == (0, still.step[-1])

    seen(55.0, 95.0, 20.0)
    assert monitor.now == []
    sound = seen(1.0, 19.0, old.since)  # the new clock comes by where the old one was then
    assert monitor.marks(sound) == ()


def test_marking_stops_where_the_clock_began_anew(tmp_path):
    arm = VirtualArm(seed=3)
    with Store.for_arm(tmp_path / "arm.db", arm.spec) as store:
        run = store.begin_run("test", {})
        for begin in (1000.0, 1010.0, 5.0, 20.0):
            time = begin + np.arange(30) / 30
            pressure, command = np.full((30, 1, 2), 80.0), np.zeros((30, 1, 2))
            command[-1] = np.nan
            store.append(Recorded(time, np.full((30, 1), 500.0), pressure, command, np.arange(30)))
        store.mark_since(5.5, "something", run)
        assert {n: [(m.first, m.last) for m in marks] for n, marks in store.marks().items()} == {
            3: [(15, 29)],
            4: [(0, 29)],
        }
        assert store.marked_rows(run) == {"something": 45}
        assert store.marked_rows(run + 1) == {}

import numpy as np
import pytest

from children import python
from pneumarm.arm import GuardedArm, Reading
from pneumarm.arm.guard import HELD, REPLACED, Interventions
from pneumarm.arm.virtual import VirtualArm
from pneumarm.errors import ArmFailure, ControllerFailure, PneumarmError


def test_only_the_muscle_over_the_limit_is_blocked(smallest_arm):
    arm = smallest_arm(joints=2, max_pressure=1.0)
    safe = GuardedArm(arm)
    arm.pressure = [[167, 166], [10, 300]]
    safe.read()
    safe.set_valves([[1, 1], [1, -1]])
    assert safe.applied.tolist() == [[0, 1], [1, -1]]
    assert arm.valves == [[0, 1], [1, -1]]
    assert safe.interventions == Interventions(pressure=1)
    assert safe.peak_pressure.tolist() == [[167, 166], [10, 300]]


def test_a_muscle_that_fell_below_the_limit_is_free_again(smallest_arm):
    arm = smallest_arm(max_pressure=1.0)
    safe = GuardedArm(arm)
    for pressure, expected in ((170, 0), (165, 1)):
        arm.pressure = [[pressure, 0]]
        safe.read()
        safe.set_valves([[1, 0]])
        assert safe.applied[0, 0] == expected
    assert safe.peak_pressure[0, 0] == 170


def test_what_was_over_the_limit_says_nothing_of_a_state_that_is_restored():
    with GuardedArm(VirtualArm(seed=1)) as safe:
        state = safe.get_state()
        safe.set_valves([[1, 0]])
        safe.wait(5.0)
        safe.read()
        safe.set_valves([[1, 0]])
        assert safe.applied.tolist() == [[0, 0]]
        safe.set_state(state)
        safe.set_valves([[1, 0]])
        assert safe.applied.tolist() == [[1, 0]]


def test_a_long_inflation_is_watched_every_period(smallest_arm):
    arm = smallest_arm(max_pressure=0.5)
    safe = GuardedArm(arm)
    safe.set_valves([[1, 0]])
    safe.wait(3.0)
    assert arm.time == pytest.approx(3.0)
    assert arm.pressure[0][0] <= 0.5 * 166 + 166 / 30 + 1e-9
    assert arm.pressure[0][0] > 0.5 * 166
    assert safe.applied.tolist() == [[0, 0]]
    # With nothing to watch, the rest of the wait is one piece.
    assert [call for call in arm.calls if call[0] == "wait"][-1][1] > 2


def test_a_wait_without_open_inlets_is_one_piece(smallest_arm):
    arm = smallest_arm()
    GuardedArm(arm).wait(3600.0)
    assert arm.calls == [("wait", 3600.0)]


def test_applied_valves_are_not_changed_by_what_comes_later(smallest_arm):
    safe = GuardedArm(smallest_arm())
    asked = np.array([[1, 0]])
    safe.set_valves(asked)
    kept = safe.applied
    asked[0, 0] = -1
    safe.set_valves([[-1, -1]])
    assert kept.tolist() == [[1, 0]]
    assert kept.dtype == np.int8


@pytest.mark.parametrize("valves", [[[0, 2]], [[np.nan, 0]], [0, 0], [[0, 0, 0]], [["1", "0"]], None])
def test_impossible_valves_never_reach_the_arm(smallest_arm, valves):
    arm = smallest_arm()
    with pytest.raises(PneumarmError, match=r"valves must be \(1, 2\) of -1, 0 or \+1, got"):
        GuardedArm(arm).set_valves(valves)
    assert arm.calls == []


@pytest.mark.parametrize(
    ("reading", "message"),
    [
        (Reading(0.0, [np.nan], [[0, 0]]), "finite numbers"),
        (Reading(np.inf, [1], [[0, 0]]), "finite numbers"),
        (Reading(0.0, [1], [[0, -np.inf]]), "finite numbers"),
        (Reading(0.0, [1, 2], [[0, 0]]), "1 angle"),
        (Reading(0.0, [1], [[0]]), "1 x 2 pressures"),
        (Reading("soon", [1], [[0, 0]]), "needs a time"),
        (Reading(0.0, None, [[0, 0]]), "finite numbers"),
        (None, "needs a time"),
    ],
)
def test_nonsense_readings_are_a_failure_of_the_arm(smallest_arm, monkeypatch, reading, message):
    arm = smallest_arm()
    monkeypatch.setattr(arm, "read", lambda: reading)
    with pytest.raises(ArmFailure, match=f"smallest: .*{message}"):
        GuardedArm(arm).read()


def test_closing_closes_the_arm_behind(smallest_arm):
    arm = smallest_arm()
    with GuardedArm(arm):
        pass
    assert arm.closed == 1


OPEN = [[1, -1]]
HELD_TURNS, MOST_REPLACED = round(30 * HELD), round(30 * REPLACED)


class Hostile:
    """What no array can be made of."""

    def __array__(self, *_args, **_kwargs):
        raise RuntimeError("boo")


@pytest.mark.parametrize(
    "nonsense", [[[0, 2]], [[np.nan, 0]], [[np.inf, 0]], [0, 0], [[1], [1, 0]], "up", {}, [[{}, 0]], None, Hostile()]
)
def test_a_decision_that_is_nonsense_is_held_then_vented_then_stopped(smallest_arm, nonsense):
    arm = smallest_arm()
    safe = GuardedArm(arm)
    safe.decide(OPEN)
    for count in range(1, MOST_REPLACED + 1):
        safe.decide(nonsense)
        assert arm.valves == (OPEN if count <= HELD_TURNS else [[-1, -1]])
    assert safe.interventions == Interventions(nonsense=MOST_REPLACED, vented=MOST_REPLACED - HELD_TURNS)
    assert safe.interventions.total == MOST_REPLACED
    with pytest.raises(ControllerFailure, match="smallest: stopped and vented"):
        safe.decide(nonsense)
    assert arm.valves == safe.applied.tolist() == [[-1, -1]]


@pytest.mark.parametrize(("rate", "held", "most"), [(200, 20, 200), (30, 3, 30), (5, 1, 5), (0.5, 1, 1)])
def test_decisions_are_held_and_replaced_for_times_not_for_periods(smallest_arm, rate, held, most):
    arm = smallest_arm(period=1 / rate)
    safe = GuardedArm(arm)
    safe.decide(OPEN)
    vented = []
    for _ in range(most):
        safe.decide(None)
        vented.append(arm.valves == [[-1, -1]])
    assert vented == [False] * held + [True] * (most - held)
    with pytest.raises(ControllerFailure):
        safe.decide(None)


@pytest.mark.parametrize(("rate", "late"), [(200, 0.09), (30, 0.09), (200, 0.11), (30, 0.11)])
def test_the_watchdog_holds_for_the_same_time_at_any_rate(smallest_arm, rate, late):
    arm = smallest_arm(period=1 / rate)
    safe = GuardedArm(arm)
    reading = safe.read()
    safe.decide(OPEN)
    arm.wait(late)
    assert safe.stand_in(reading)
    assert (arm.valves == [[-1, -1]]) == (late > HELD)


def test_one_good_decision_makes_the_guard_patient_again(smallest_arm):
    arm = smallest_arm()
    safe = GuardedArm(arm)
    for _ in range(MOST_REPLACED):
        for _ in range(HELD_TURNS):
            safe.decide(None)
        safe.decide(OPEN)
    assert arm.valves == OPEN
    assert safe.interventions == Interventions(nonsense=HELD_TURNS * MOST_REPLACED)


def test_what_is_held_keeps_to_the_limits(smallest_arm):
    arm = smallest_arm(max_pressure=0.5)
    safe = GuardedArm(arm)
    safe.decide(OPEN)
    arm.pressure = [[100, 0]]
    safe.read()
    safe.decide("hold on")
    assert arm.valves == [[0, -1]]
    assert safe.interventions == Interventions(pressure=1, nonsense=1)


def test_an_inlet_that_was_open_for_too_long_rests_as_long(smallest_arm):
    arm = smallest_arm(joints=2, max_inflation=2.0, max_pressure=1e6)
    safe = GuardedArm(arm)
    asked = np.array([[1, 0], [0, -1]])
    opened = []
    for _ in range(300):
        safe.read()
        safe.set_valves(asked)
        arm.wait(0.1)
        opened.append(safe.applied[0, 0])
    # 2 s in, 2 s of rest, and so on; nothing of this concerns the other muscles.
    changes = np.flatnonzero(np.diff(opened))
    assert np.diff(changes) == pytest.approx(20, abs=1)
    assert safe.interventions == Interventions(inflation=opened.count(0))


def test_pulses_count_as_inflation_too_and_venting_ends_it(smallest_arm):
    arm = smallest_arm(max_inflation=2.0, max_pressure=1e6)
    safe = GuardedArm(arm)
    for turn in range(100):
        safe.read()
        safe.set_valves([[1 if turn % 4 else 0, 0]])
        arm.wait(0.1)
    assert safe.interventions.inflation > 0
    safe.set_valves([[-1, -1]])
    arm.wait(0.25)
    safe.read()
    safe.set_valves(OPEN)
    assert arm.valves == OPEN


@pytest.mark.parametrize(("vented", "free"), [(0.15, 0), (0.25, 1)])
def test_an_inlet_that_was_open_for_too_long_is_vented_for_a_tenth_of_that(smallest_arm, vented, free):
    arm = smallest_arm(max_inflation=2.0, max_pressure=1e6)
    safe = GuardedArm(arm)
    for valve, seconds in ((1, 2.1), (-1, vented), (1, 0.0)):
        safe.read()
        safe.set_valves([[valve, 0]])
        safe.wait(seconds)
    assert arm.valves == [[free, 0]]


@pytest.mark.parametrize("how", ["wait", "wait_until"])
def test_long_waits_keep_to_pressure_and_time(smallest_arm, how):
    for limits, opened in (({"max_pressure": 0.5}, 0.5), ({"max_inflation": 2.0, "max_pressure": 1e6}, 2.0)):
        arm = smallest_arm(**limits)
        safe = GuardedArm(arm)
        safe.read()
        safe.set_valves([[1, 0]])
        getattr(safe, how)(60.0)
        assert arm.time == pytest.approx(60.0)
        assert arm.pressure[0][0] / 166 == pytest.approx(opened, abs=0.1)
        assert safe.interventions.total == 1


def test_at_an_end_of_the_angle_nothing_pushes_further_out(smallest_arm):
    arm = smallest_arm(joints=3, angle_limits=(100.0, 900.0))
    safe = GuardedArm(arm)
    arm.angle = [950, 500, 100]
    safe.read()
    for asked, applied in ((1, [[0, 1], [1, 1], [1, 0]]), (-1, [[-1, -1]] * 3)):
        safe.set_valves(np.full((3, 2), asked))
        assert arm.valves == applied
    safe.set_valves([[1, -1]] * 3)
    assert arm.valves == [[0, 0], [1, -1], [1, -1]]
    safe.set_valves([[-1, 1]] * 3)
    assert arm.valves == [[-1, 1], [-1, 1], [0, 0]]
    assert safe.interventions == Interventions(angle=2 + 2 + 2)
    arm.angle = [500, 500, 500]
    safe.read()
    safe.set_valves([[1, -1]] * 3)
    assert arm.valves == [[1, -1]] * 3


def test_a_muscle_that_is_not_there_is_given_nothing(smallest_arm):
    arm = smallest_arm(joints=2, muscles=1)
    safe = GuardedArm(arm)
    for command, applied in (([[1, 1], [-1, -1]], [[1, 0], [-1, 0]]), ([[0.5, 0.5], [1.0, -0.5]], [[1, 0], [1, 0]])):
        safe.decide(np.array(command))
        assert arm.valves == applied


def test_interventions_are_counted_apart_and_can_be_told():
    first, second = Interventions(pressure=3, late=1), Interventions(pressure=1, vented=2)
    assert (first + second) - second == first
    assert str(first) == "3 x pressure, 1 x late"
    assert str(Interventions()) == "none"
    assert second.total == 1


def test_what_nobody_closed_is_closed_when_the_interpreter_ends(tmp_path):
    program = (
        "import sys; from pathlib import Path; from pneumarm.arm import ArmSpec, Arm, Reading, guarded\n"
        "class Logged(Arm):\n"
        "    spec = ArmSpec()\n"
        "    def read(self): return Reading(0.0, [0], [[0, 0]])\n"
        "    def set_valves(self, valves): pass\n"
        "    def wait(self, seconds): pass\n"
        "    def close(self): print('closed', sys.argv[1])\n"
        "arm = Logged()\n"
        "guarded(arm).set_valves([[1, 1]])\n"
        "if sys.argv[1] == 'failing': raise ValueError\n"
    )
    for how in ("well", "failing"):
        done = python("-c", program, how)
        assert done.stdout == f"closed {how}\n"


def test_the_guard_times_the_pulses_of_an_arm_that_cannot(smallest_arm):
    arm = smallest_arm(joints=2, period=0.1, shortest_pulse=0.01)
    safe = GuardedArm(arm)
    safe.read()
    arm.calls.clear()
    safe.decide(np.array([[0.25, -0.5], [1.0, 0.25]]))
    safe.wait(0.1)
    waits = pytest.approx(0.025), pytest.approx(0.025), pytest.approx(0.05)
    assert arm.calls == [
        ("valves", [[1, -1], [1, 1]]),
        ("wait", waits[0]),
        ("valves", [[0, -1], [1, 0]]),
        ("wait", waits[1]),
        ("valves", [[0, 0], [1, 0]]),
        ("wait", waits[2]),
    ]
    assert safe.applied.tolist() == [[0.25, -0.5], [1.0, 0.25]]
    safe.decide(np.array([[0.5, 0.0], [-0.5, 0.0]]))
    safe.wait_until(0.12)  # in the middle of a pulse
    assert arm.valves == [[1, 0], [-1, 0]]
    safe.read()
    safe.wait_until(0.2)
    assert arm.valves == [[0, 0], [0, 0]]
    assert arm.time == pytest.approx(0.2)


def test_pulses_of_the_whole_period_are_valves(smallest_arm):
    arm = smallest_arm()
    safe = GuardedArm(arm)
    safe.decide(np.array([[1.0, -1.0]]))
    assert safe.applied.dtype == np.int8
    assert arm.calls == [("valves", [[1, -1]])]


def test_an_arm_without_pulses_gets_whole_periods(smallest_arm):
    arm = smallest_arm(pulses=False)
    safe = GuardedArm(arm)
    for command, applied in (([[0.6, -0.4]], [[1, 0]]), ([[0.5, -0.5]], [[1, -1]])):
        safe.decide(np.array(command))
        assert safe.applied.tolist() == arm.valves == applied
        assert safe.applied.dtype == np.int8


@pytest.mark.parametrize(
    "nonsense", [[[1.001, 0.0]], [[np.nan, 0.5]], [[0.5, 0.5, 0.5]], [["0.5", "0"]], [[0.5j, 0]]]
)
def test_impossible_pulses_never_reach_the_arm(smallest_arm, nonsense):
    arm = smallest_arm()
    safe = GuardedArm(arm)
    safe.decide(nonsense)
    assert safe.interventions == Interventions(nonsense=1)
    assert arm.valves == [[0, 0]]


def test_limits_hold_for_pulses(smallest_arm):
    arm = smallest_arm(max_pressure=1.0, angle_limits=(100.0, 900.0))
    safe = GuardedArm(arm)
    arm.pressure, arm.angle = [[170, 10]], [500]
    safe.read()
    safe.decide(np.array([[0.5, 0.25]]))
    assert safe.applied.tolist() == [[0.0, 0.25]]
    arm.pressure, arm.angle = [[10, 10]], [950]
    safe.read()
    safe.decide(np.array([[0.5, -0.25]]))
    assert arm.valves == [[0, 0]]
    assert safe.interventions == Interventions(pressure=1, angle=2)


def test_the_time_of_pulses_counts_as_inflation(smallest_arm):
    arm = smallest_arm(max_inflation=1.0, max_pressure=1e6, period=0.1)
    safe = GuardedArm(arm)
    turns = 0
    while not safe.interventions.inflation:
        safe.read()
        safe.decide(np.array([[0.8, -0.5]]))
        safe.wait(0.1)
        turns += 1
    # 80 ms in and 20 ms of rest a turn, until 1 s is full and the next decision is limited.
    assert turns - 1 == pytest.approx(1.0 / 0.06, abs=1)


def test_a_pulse_is_held_as_it_was_given_and_ends_while_a_controller_thinks(smallest_arm):
    arm = smallest_arm(period=0.1)
    safe = GuardedArm(arm)
    reading = safe.read()
    safe.decide(np.array([[0.5, 0.0]]))
    arm.wait(0.1)  # nobody looks, as while a controller computes
    assert arm.valves == [[1, 0]]
    assert safe.stand_in(reading)
    assert arm.valves == [[0, 0]]
    safe.replace("late", "late")
    assert safe.applied.tolist() == [[0.5, 0.0]]
    assert arm.valves == [[1, 0]]
    safe.wait(0.1)
    assert arm.valves == [[0, 0]]

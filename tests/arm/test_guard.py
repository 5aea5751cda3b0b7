import numpy as np
import pytest

from pneumarm.arm import GuardedArm, Reading
from pneumarm.errors import ArmFailure, PneumarmError


def test_only_the_muscle_over_the_limit_is_blocked(smallest_arm):
    arm = smallest_arm(joints=2, max_pressure=1.0)
    safe = GuardedArm(arm)
    arm.pressure = [[167, 166], [10, 300]]
    safe.read()
    safe.set_valves([[1, 1], [1, -1]])
    assert safe.applied.tolist() == [[0, 1], [1, -1]]
    assert arm.valves == [[0, 1], [1, -1]]
    assert safe.interventions == 1
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

"""A simulation behind the seam of an arm."""

import numpy as np
import pytest

from pneumarm.arm import Arm
from pneumarm.arm.cycle import ControlCycle
from pneumarm.arm.guard import guarded
from pneumarm.errors import UnusableInput
from pneumarm.simulation.arm import SimulationArm
from simple_simulation import PERIOD, QUIET, simulation


def moved(arm: Arm, valves: list[list[int]], waits: list[float]) -> np.ndarray:
    arm.set_valves(np.array(valves, np.int8))
    for wait in waits:
        arm.wait(wait)
    return arm.read().pressure


def test_begins_at_rest_in_the_middle_of_the_goals() -> None:
    arm = SimulationArm(simulation(), noise=QUIET)
    before = arm.read()
    assert before.angle == pytest.approx([500], abs=1)
    arm.wait(1.0)
    np.testing.assert_allclose(arm.read().angle, before.angle, atol=0.01)


def test_valves_move_pressures_and_these_the_angle() -> None:
    arm = SimulationArm(simulation(joints=2), noise=QUIET)
    pressure = moved(arm, [[1, 0], [0, -1]], [PERIOD] * 3)
    np.testing.assert_allclose(pressure, [[130, 100], [100, 70]], atol=1e-3)
    assert (arm.read().angle > 500).all()
    assert arm.read().time == pytest.approx(3 * PERIOD)


@pytest.mark.parametrize("waits", [[0.007, 0.033], [0.01] * 4, [0.039999, 0.000001], [0.0, 0.04]])
def test_time_passes_by_whole_periods(waits: list[float]) -> None:
    """Split waits add up; nothing happens before the end of a period, one step happens there."""
    arm = SimulationArm(simulation(), noise=QUIET)
    arm.set_valves(np.array([[1, 0]], np.int8))
    for wait in waits[:-1]:
        arm.wait(wait)
        np.testing.assert_allclose(arm.read().pressure, [[100, 100]], atol=1e-3)
    arm.wait(waits[-1])
    np.testing.assert_allclose(arm.read().pressure, [[110, 100]], atol=1e-3)


def test_a_long_wait_is_many_steps() -> None:
    together = moved(SimulationArm(simulation(), seed=3), [[1, -1]], [0.4])
    apart = moved(SimulationArm(simulation(), seed=3), [[1, -1]], [PERIOD] * 10)
    np.testing.assert_array_equal(together, apart)


@pytest.mark.parametrize("latency", [0.0, 0.007])
def test_a_control_cycle_cannot_tell(latency: float) -> None:
    """Each turn of the cycle sees exactly one step of the simulation, whatever its latency."""
    arm = guarded(SimulationArm(simulation(latency=latency), noise=QUIET))
    seen = []

    def decide(reading):  # type: ignore[no-untyped-def]
        seen.append((reading.time, *reading.pressure[0]))
        return None if len(seen) > 5 else np.array([[1 if len(seen) % 2 else 0, 0]], np.int8)

    cycle = ControlCycle(arm)
    list(cycle.run(decide))
    times, pressures = np.array(seen)[:, 0], np.array(seen)[:, 1]
    np.testing.assert_allclose(np.diff(times), PERIOD, atol=1e-9)
    np.testing.assert_allclose(pressures, [100, 110, 110, 120, 120, 130], atol=1e-3)
    assert cycle.missed_deadlines == 0


def test_saved_state_goes_on_bit_for_bit() -> None:
    arm, other = SimulationArm(simulation(), seed=1), SimulationArm(simulation(), seed=2)
    moved(arm, [[1, 0]], [PERIOD] * 3 + [0.013])
    other.set_state(arm.get_state())
    for valves in ([[0, 1]], [[-1, 0]]):
        np.testing.assert_array_equal(moved(arm, valves, [0.05]), moved(other, valves, [0.05]))
    assert other.read().time == arm.read().time
    assert other.get_state() == arm.get_state()


@pytest.mark.parametrize("state", [b"", b"{}", b"\xff\xfe", b"[1]", b'{"x": [1], "average": [], "random": []}'])
def test_a_strange_state_is_refused(state: bytes) -> None:
    arm = SimulationArm(simulation())
    before = arm.get_state()
    with pytest.raises(UnusableInput, match="made up"):
        arm.set_state(state)
    assert arm.get_state() == before


def test_seeds_make_the_noise() -> None:
    readings = [moved(SimulationArm(simulation(), seed=seed), [[1, 1]], [0.4]) for seed in (1, 1, 2)]
    np.testing.assert_array_equal(readings[0], readings[1])
    assert (readings[0] != readings[2]).any()


def test_continuous_commands_are_refused() -> None:
    with pytest.raises(UnusableInput, match="continuous"):
        SimulationArm(simulation(commands="continuous"))


def test_closing_closes_the_valves() -> None:
    with SimulationArm(simulation(), noise=QUIET) as arm:
        moved(arm, [[1, 1]], [PERIOD])
    before = arm.read().pressure
    arm.wait(PERIOD)
    np.testing.assert_allclose(arm.read().pressure, before, atol=1e-3)


def test_a_pulse_counts_for_its_period_and_is_over_then() -> None:
    arm = SimulationArm(simulation(commands="pulses"), noise=QUIET)
    begin = arm.read().pressure
    assert arm.set_pulses(np.array([[0.5, -0.25]]))
    arm.wait(3 * PERIOD)
    np.testing.assert_allclose(arm.read().pressure - begin, [[5.0, -2.5]], atol=1e-3)


def test_of_pulses_that_it_has_not_seen_it_says_nothing() -> None:
    arm = guarded(SimulationArm(simulation(), noise=QUIET))
    assert not arm.spec.pulses
    arm.decide(np.array([[0.6, -0.25]]))
    assert arm.applied.tolist() == [[1, 0]]

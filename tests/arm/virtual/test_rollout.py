"""Rollouts are the arm's own future, bit for bit, and leave the arm alone."""

from dataclasses import replace

import numpy as np
import pytest

from pneumarm.arm import BeginState, ControlCycle, guarded
from pneumarm.arm.valves import VALVES
from pneumarm.arm.virtual import ArmParameters, VirtualArm, draw_parameters, without_noise
from pneumarm.arm.virtual.rollout import (
    PhysicsStates,
    advance_physics,
    capture,
    copy_physics,
    physics_of,
    physics_states,
)

TURNS = 25
BEGIN = BeginState(deflate=0.3, inflate=0.4, settle=0.3)


def arm_at_rest(parameters: ArmParameters, seed: int) -> VirtualArm:
    arm = VirtualArm(without_noise(parameters), seed=seed)
    BEGIN.reach(guarded(arm), np.random.default_rng(seed))
    return arm


def own_stepping(arm: VirtualArm, actions: np.ndarray) -> tuple[list, list[tuple[bytes, ...]]]:
    """Return the readings of the arm's own control cycle, and its records after each turn."""
    remaining = iter(actions)
    records = []

    def decide(reading):  # type: ignore[no-untyped-def]
        body = arm.body
        parts = (body.muscles, body.joints, body.surroundings, body.supply_random)
        records.append(tuple(part.tobytes() for part in parts))
        action = next(remaining, None)
        return None if action is None else VALVES[action].reshape(1, 2)

    return [step.reading for step in ControlCycle(guarded(arm)).run(decide)], records


def records_of(states: PhysicsStates, i: int) -> tuple[bytes, ...]:
    parts = (states.muscles, states.joints, states.surroundings, states.random)
    return tuple(part[i].tobytes() for part in parts)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_rollout_is_the_arms_own_future_bit_for_bit(seed: int) -> None:
    arm = arm_at_rest(draw_parameters(seed), seed)
    actions = np.random.default_rng(seed).integers(0, 9, TURNS)
    physics = physics_of(arm)
    states = physics_states(physics, 1)
    capture(arm, physics, states, 0)
    readings, records = own_stepping(arm, actions)
    assert records_of(states, 0) == records[0]
    before = readings[0]
    for action, reading, record in zip(actions, readings[1:], records[1:], strict=True):
        advance_physics(physics, states, 0, VALVES[action].reshape(1, 2))
        assert records_of(states, 0) == record
        np.testing.assert_array_equal(states.angle[0], reading.angle)
        np.testing.assert_array_equal(states.pressure[0], reading.pressure)
        velocity = (reading.angle - before.angle) / (1e3 * (reading.time - before.time))
        np.testing.assert_array_equal(states.velocity[0], velocity)
        before = reading


def test_rollouts_leave_the_arm_and_each_other_alone() -> None:
    arm = arm_at_rest(ArmParameters(), 4)
    physics = physics_of(arm)
    states = physics_states(physics, 3)
    before = arm.get_state()
    capture(arm, physics, states, 0)
    copy_physics(states, 2, 0)
    copy_physics(states, 1, 0)
    begin = records_of(states, 0)
    assert records_of(states, 1) == records_of(states, 2) == begin
    for _ in range(5):
        advance_physics(physics, states, 1, VALVES[6].reshape(1, 2))
        advance_physics(physics, states, 2, VALVES[2].reshape(1, 2))
    assert arm.get_state() == before
    assert records_of(states, 0) == begin
    assert states.angle[1] > states.angle[0] > states.angle[2]
    assert states.due[1] == states.due[2] == pytest.approx(states.due[0] + 5 / 30)


def test_readings_are_quantised_and_without_noise() -> None:
    parameters = draw_parameters(5)
    arm = VirtualArm(parameters, seed=0)
    physics = physics_of(arm)
    states = physics_states(physics, 1)
    capture(arm, physics, states, 0)
    expected = 511.5 + arm.spec.counts_per_degree * np.degrees(arm.angle)
    np.testing.assert_array_equal(states.angle[0], np.floor(expected + 0.5))
    bar = np.floor(arm.spec.counts_per_bar * arm.pressure[0] / 1e5 + 0.5)
    np.testing.assert_array_equal(states.pressure[0, 0], np.maximum(bar, 0))


def test_a_quiet_arm_differs_from_its_model_in_noise_alone() -> None:
    parameters = draw_parameters(6)
    quiet = without_noise(replace(parameters, sensors=replace(parameters.sensors, dropout=0.1)))
    assert (quiet.sensors.angle_noise, quiet.sensors.pressure_noise, quiet.sensors.dropout) == (0, 0, 0)
    assert quiet.jitter == 0
    assert (quiet.joints, quiet.air, quiet.room) == (parameters.joints, parameters.air, parameters.room)
    arm = VirtualArm(quiet, seed=1)
    arm.wait_until(1.0)
    assert arm.time == 1.0
    np.testing.assert_array_equal(arm.read().angle, arm.read().angle)

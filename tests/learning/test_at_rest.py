"""What a servo does near a goal that stays: what it foresees, how long a pulse is, what becomes of a swing."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from learning.synthetic_arm import synthetic_begin_states, synthetic_simulation
from pneumarm.arm import Reading
from pneumarm.learning.servo import ServoAgent, ServoSettings, train_servo
from pneumarm.learning.servo.at_rest import drift_of, extent_of, mean_of, variance_of
from pneumarm.learning.servo.controller import ServoController
from pneumarm.learning.servo.foresight import Foresight
from pneumarm.learning.servo.two_ways import TwoWays
from pneumarm.simulation.kernel import scaled_state

GOAL = 512.0
PERIOD = 1 / 30


@pytest.fixture(scope="module")
def agent() -> ServoAgent:
    """An agent of an arm that pulses were recorded of; what it learned does not matter here."""
    simulation = synthetic_simulation()
    simulation = replace(simulation, error_std=simulation.error_std / 4, commands="pulses")
    settings = ServoSettings(arms=8, updates=2, agents=1, duration=0.3, hidden=(8, 8), validation_movements=8)
    return train_servo(simulation, synthetic_begin_states(simulation), settings).agent


def read(controller: ServoController, angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the commands (n, 2) of a controller that is to hold the goal, after readings of the ``angle`` (n,)."""
    controller.reset(np.array([GOAL]))
    time = controller.spec.period * np.arange(len(angle))
    readings = [Reading(t, np.array([a]), np.full((1, 2), 90.0)) for t, a in zip(time, angle, strict=True)]
    return np.array([controller.act(one)[0] for one in readings])


@pytest.mark.parametrize(("joints", "history"), [(1, 3), (2, 2)])
def test_it_foresees_what_the_simulation_says(joints: int, history: int):
    simulation = synthetic_simulation(joints, history)
    window, random = simulation.window, np.random.default_rng(1)
    observation = np.tile([500.0, 0.0, 80.0, 110.0], joints) + random.normal(0, 3, 4 * joints)
    sigma = np.concatenate([np.tile(observation, history), np.zeros((history - 1) * window.command_size)])
    commands = np.vstack([np.zeros(2 * joints), random.uniform(-1, 1, 2 * joints)])
    foreseen = Foresight(simulation).angles(scaled_state(sigma, window, simulation.scaling), commands, 4)
    for command, angles in zip(commands, foreseen, strict=True):
        state, given = sigma.copy(), command
        for angle in angles:
            following = simulation.predict(np.concatenate([state, given])[None])[0]
            np.testing.assert_allclose(angle, window.of_joints(following)[:, 0], rtol=1e-4)
            observations, before = np.split(state, [history * window.observation_size])
            state = np.concatenate(
                [following, observations[: -len(following)], given, before[: -len(given)] if history > 1 else before]
            )
            given = np.zeros(2 * joints)


def test_a_pulse_of_a_joint_at_rest_is_as_long_as_its_error_takes(agent: ServoAgent, monkeypatch: pytest.MonkeyPatch):
    """However much a policy asks for that would stop the joint in the next periods."""
    first = []
    for degrees in 0.5, 1.0, 2.0:
        controller = agent.controller()
        monkeypatch.setattr(controller._actor, "pulses", lambda *_: np.array([[0.7, -0.7]]))
        command = read(controller, np.full(90, GOAL - degrees * agent.spec.counts_per_degree))
        np.testing.assert_array_equal(command[:, 0], -command[:, 1])
        pulses = command[command[:, 0] > 0, 0]
        first.append(pulses[np.flatnonzero(pulses < 0.7)[0]])  # before it is at rest, what the policy says
        assert pulses[-1] > first[-1]  # where that does nothing, longer ones follow
    assert first[0] < first[1] < first[2]


def test_a_joint_is_not_at_rest_where_it_turns(agent: ServoAgent, monkeypatch: pytest.MonkeyPatch):
    asked = []
    controller = agent.controller()
    monkeypatch.setattr(
        controller._actor, "pulses", lambda state, preview, underway: asked.append(underway) or np.zeros((1, 2))
    )
    wave = np.sin(4 * np.pi * PERIOD * np.arange(45))
    swing = GOAL + 1.5 * agent.spec.counts_per_degree * wave
    read(controller, swing)
    assert np.array(asked)[np.abs(wave) > 0.8].all()
    read(controller, np.full(90, swing[0] + 5))
    assert not np.array(asked[-30:]).any()


def test_of_two_ways_the_second_is_taken_where_it_is_seen_to_be_nearer():
    def seconds(ways: TwoWays, first: float, second: float, seconds: float) -> list[bool]:
        taken = []
        for _ in range(round(seconds / PERIOD)):
            ways.see(second if ways.second else first)
            taken.append(ways.second)
        return taken

    assert not any(seconds(TwoWays(PERIOD, 0.7), 0.5, 0.1, 30))  # near enough: nothing else is tried
    nearer = TwoWays(PERIOD, 0.7)
    assert seconds(nearer, 3.0, 0.5, 30)[-1]
    nearer.leave()
    assert nearer.second  # with the next goal, too
    worse = seconds(TwoWays(PERIOD, 0.7), 1.5, 4.0, 120)
    assert any(worse)
    assert np.mean(worse) < 0.1
    late = [TwoWays(PERIOD, 0.7, most=most) for most in (5.0, 1.5)]
    assert [seconds(ways, 4.0, 0.5, 1.0)[-1] for ways in late] == [True, False]  # one goal come to late is not enough
    assert all(seconds(ways, 4.0, 0.5, 5.0)[-1] for ways in late)


def test_what_was_before_does_not_count_in_a_try():
    ways = TwoWays(PERIOD, 0.7)
    for turn in range(30):
        ways.see(5.0 if turn < 15 else 0.5)
    assert not ways.is_tried
    assert ways.known[0] == pytest.approx(0.3 * 0.5)


def test_where_single_pulses_leave_a_joint_off_its_policy_acts_in_every_period(
    agent: ServoAgent, monkeypatch: pytest.MonkeyPatch
):
    asked = []

    def pulses(state: object, preview: NDArray[np.float64], underway: object) -> NDArray[np.float64]:
        asked.append(preview[0, 0])
        return np.array([[0.5, -0.5]])

    degree = agent.spec.counts_per_degree
    controller = agent.controller()
    monkeypatch.setattr(controller._actor, "pulses", pulses)
    calm = read(controller, np.full(90, GOAL - 0.6 * degree))
    assert not calm[10:].any(axis=1).all()  # looks at what each pulse did, and learns that this stays off
    read(controller, np.full(90, GOAL - 0.6 * degree))
    asked.clear()
    active = read(controller, np.full(90, GOAL - 0.3 * degree))
    np.testing.assert_array_equal(active, [[0.5, -0.5]] * 90)
    assert GOAL < asked[45] < asked[89] <= GOAL + 4 * degree  # integral action goes on, and is bounded
    again = agent.knowing(controller.ways).controller()  # another one need not learn that again
    monkeypatch.setattr(again._actor, "pulses", pulses)
    np.testing.assert_array_equal(read(again, np.full(90, GOAL - 0.3 * degree)), active)
    assert agent.controller().ways == agent.knowing((1.0,) * 8).controller().ways  # of an arm with two joints
    near = agent.controller()
    monkeypatch.setattr(near._actor, "pulses", pulses)
    for _ in range(4):
        command = read(near, np.full(90, GOAL - 0.1 * degree))
        assert not command[20:].any()  # near enough


def test_a_joint_that_is_pumped_far_from_its_goal_is_left_alone(agent: ServoAgent, monkeypatch: pytest.MonkeyPatch):
    controller = agent.controller()
    monkeypatch.setattr(controller._actor, "pulses", lambda *_: np.array([[1.0, -1.0]]))
    degree, time = agent.spec.counts_per_degree, PERIOD * np.arange(90)
    command = read(controller, GOAL + 12 * degree * np.sin(4 * np.pi * time))
    assert command[5:15].any()
    assert not command[25:50].any()  # for a second; then it is tried whether damping it brings it nearer
    still = np.concatenate([12 * np.sin(4 * np.pi * time), np.full(30, 12.0)])
    assert read(controller, GOAL + degree * still)[-1].any()  # until it lies still: then it is moved on


def test_being_thrown_far_off_counts_while_it_is_tried_and_another_goal_ends_that():
    ways = TwoWays(PERIOD, 0.7)
    ways.see(0.1)
    assert ways.is_tried
    ways.leave()
    assert not ways.is_tried


@pytest.mark.parametrize("joints", [1, 2])
@pytest.mark.parametrize("seen", [4, 7, 12])
def test_readings_are_averaged_as_numpy_does(joints: int, seen: int) -> None:
    readings, look = np.random.default_rng(0).normal(500.0, 20.0, (seen, joints)), 4
    older = np.full((3, joints), np.nan)  # what is kept from before, and is not to count
    mean, drift, span, scatter = (
        np.array([of(np.vstack([older, readings]), seen, most, j) for j in range(joints)])
        for of, most in ((mean_of, look), (drift_of, look), (extent_of, 20), (variance_of, 20))
    )
    read = readings[-look:]
    np.testing.assert_allclose(mean, read.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(drift, np.abs(read[-2:].mean(axis=0) - read[:2].mean(axis=0)), atol=1e-12)
    np.testing.assert_array_equal(span, np.ptp(readings, axis=0))
    np.testing.assert_allclose(scatter, readings.var(axis=0), rtol=1e-12)

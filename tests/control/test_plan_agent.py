"""A simulation that is planned in acts, is tested and is saved like any agent."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.arm import ControlCycle, Reading, guarded
from pneumarm.arm.valves import VALVES, to_valves
from pneumarm.control import move
from pneumarm.errors import UnusableInput
from pneumarm.learning import Agent, Learns, TrainSettings, fingerprint, test, train
from pneumarm.learning.online.testing import run_test
from pneumarm.learning.planned.agent import PlanAgent
from pneumarm.planning import simulated_planner
from pneumarm.simulation import SimulationArm
from pneumarm.task import StateTracker
from pneumarm.task.acting import test_acting
from pneumarm.task.environment import environment
from pneumarm.task.movements import TEST

SIMULATION = synthetic_simulation()
BEGIN = synthetic_begin_states(SIMULATION)


class ThroughActor:
    """The actor as a controller of an arm."""

    def __init__(self, agent: PlanAgent) -> None:
        self.actor, self.tracker = agent.actor(), StateTracker(agent.window, agent.scaling)

    def reset(self, goal: np.ndarray) -> None:
        self.goal, self.first = goal, True
        self.tracker.reset()

    def act(self, reading: Reading) -> np.ndarray:
        state = self.tracker.reading(reading)
        if self.first:
            self.actor.begin(state, self.goal)
        else:
            self.actor.follow(state)
        self.first = False
        assert self.actor.act() is not self.actor.act()
        valves = to_valves(self.actor.act())
        self.tracker.commanded(valves)
        return valves


def test_the_actor_decides_as_the_planner() -> None:
    movements = []
    for controller in (ThroughActor(PlanAgent(SIMULATION)), simulated_planner(SIMULATION)):
        cycle = ControlCycle(guarded(SimulationArm(SIMULATION, seed=3)))
        movements.append([move(cycle, controller, np.array([goal])) for goal in (400.0, 650.0, 510.0)])
    for one, two in zip(*movements, strict=True):
        np.testing.assert_array_equal(one.recorded.command, two.recorded.command)
        assert one.reward == two.reward


def test_it_is_tested_with_everybodys_begin_states_and_goals() -> None:
    agent = PlanAgent(SIMULATION)
    tested = test(agent, SIMULATION, BEGIN, 60, seed=7)
    assert tested.success.mean() > 0.95
    np.testing.assert_array_equal(
        tested.reward, 51.0 * tested.success - tested.actions - 8.0 * tested.switches.sum(axis=1)
    )
    again = test(agent, SIMULATION, BEGIN, 60, seed=7)
    np.testing.assert_array_equal(again.reward, tested.reward)
    baseline = train(
        SIMULATION, BEGIN, TrainSettings(agents=1, max_episodes=100, validation_episodes=10), seed=0
    ).agent
    env = environment(SIMULATION, BEGIN, baseline.settings)
    other = run_test(env, baseline.weights(), baseline.settings, 60, (7, TEST))
    np.testing.assert_array_equal(other.goal, tested.goal)
    np.testing.assert_array_equal(other.angle_begin, tested.angle_begin)
    assert other.reward.mean() < tested.reward.mean()


def test_a_test_step_by_step_is_the_compiled_test() -> None:
    """The same agent, noise and all: movement by movement the same figures."""
    agent: Agent = train(
        SIMULATION, BEGIN, TrainSettings(agents=1, max_episodes=300, validation_episodes=10), seed=1
    ).agent
    env = environment(SIMULATION, BEGIN, agent.settings)

    class Acting:
        def __init__(self) -> None:
            from pneumarm.learning import OnlineLearner

            self.learner = OnlineLearner(agent)

        def begin(self, state: np.ndarray, goal: np.ndarray) -> None:
            self.goal = goal.copy()
            self.learner.begin(state, goal)

        def follow(self, state: np.ndarray) -> None:
            self.learner.begin(state, self.goal)

        def act(self) -> np.ndarray:
            return self.learner.act()

    compiled = run_test(env, agent.weights(), agent.settings, 40, (2, TEST))
    stepped = test_acting(Acting(), env, 40, (2, TEST))
    for name in ("goal", "angle_begin", "angle_end", "velocity_end", "actions", "switches", "reward", "success"):
        np.testing.assert_array_equal(getattr(stepped, name), getattr(compiled, name), err_msg=name)


def test_its_file_is_that_of_its_simulation(tmp_path: Path) -> None:
    agent = PlanAgent(SIMULATION)
    agent.save(tmp_path / "arm.sim")
    loaded = PlanAgent.load(tmp_path / "arm.sim")
    assert fingerprint(loaded) == fingerprint(agent)
    np.testing.assert_array_equal(loaded.goal_range, SIMULATION.goal_range)
    assert (loaded.window, loaded.spec) == (agent.window, agent.spec)
    assert not isinstance(loaded, Learns)
    replace(SIMULATION, commands="continuous").save(tmp_path / "other.sim")
    with pytest.raises(UnusableInput, match="continuous"):
        PlanAgent.load(tmp_path / "other.sim")


def test_nothing_is_remembered_between_movements() -> None:
    actor = PlanAgent(SIMULATION).actor()
    first = BEGIN.states[100]
    actor.begin(first, [600.0])
    chosen = actor.act()
    actor.follow(BEGIN.states[900])
    actor.act()
    actor.begin(first, [600.0])
    np.testing.assert_array_equal(actor.act(), chosen)
    assert VALVES[chosen[0]].any()


def test_an_empty_test_is_refused() -> None:
    with pytest.raises(UnusableInput, match="at least one"):
        test(PlanAgent(SIMULATION), SIMULATION, BEGIN, 0)

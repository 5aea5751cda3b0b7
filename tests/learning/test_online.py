"""Acting and learning step by step from Python, as on a real arm."""

import numpy as np
import pytest
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.learning import Agent, Exploration, OnlineLearner, TrainSettings
from pneumarm.learning.online.loop import loop_workspace, train_episode
from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.online.values import draw_networks, learner
from pneumarm.random import random_state
from pneumarm.simulation.noise import NoiseSettings
from pneumarm.simulation.simulation import Simulation
from pneumarm.task import BeginStates
from pneumarm.task.environment import begin_episode, environment, episode, reached, take
from pneumarm.task.reward import paid


def an_agent(simulation: Simulation, **settings: object) -> Agent:
    chosen = TrainSettings(noise=NoiseSettings(kind="none"), **settings)  # type: ignore[arg-type]
    networks = draw_networks(simulation.window, chosen, np.random.default_rng(4))
    return Agent(simulation.spec, simulation.window, simulation.scaling, simulation.goal_range, networks, chosen)


@pytest.mark.parametrize("joints", [1, 2])
@pytest.mark.parametrize(
    "settings", [{}, {"method": "q-learning", "trace_decay": 0.3}, {"team": "own"}, {"team": "one"}]
)
def test_learns_what_the_training_loop_learns(joints: int, settings: dict) -> None:
    """Twenty greedy episodes, once in the compiled loop, once step by step: the same weights bit for bit."""
    simulation = synthetic_simulation(joints)
    agent = an_agent(simulation, cutoff=12, **settings)
    env = environment(simulation, synthetic_begin_states(simulation), agent.settings)
    weights = agent.weights()
    one = episode(env, random_state(7))
    work = learner(weights, agent.settings)
    for _ in range(20):
        train_episode(env, work, Schedule(60.0, 0.0, 1.0, 0.0), one, loop_workspace(work, one.goal.size))

    online = OnlineLearner(agent, agent.settings.learning_rate)
    other, size = episode(env, random_state(7)), simulation.window.state_size
    agents = 1 if agent.settings.team == "one" else joints
    for _ in range(20):
        begin_episode(env, other, 60.0, other.state.random)
        online.begin(other.state.x[:size], other.goal)
        other.state.random[:] = _draws(other.state.random, agents)  # the loop draws whether to explore
        for _ in range(12):
            is_reached = take(env, other, online.act())
            assert is_reached == reached(env.task, other)
            rewards = [paid(env.task.reward, is_reached, switched) for switched in other.switched]
            online.observe(rewards, other.state.x[:size], is_reached)
            if is_reached:
                break
            other.state.random[:] = _draws(other.state.random, agents)
    np.testing.assert_array_equal(online.agent.weights(), weights)
    assert (weights != agent.weights()).any()


def _draws(random: np.ndarray, count: int) -> np.ndarray:
    from pneumarm.random import uniform

    random = random.copy()
    for _ in range(count):
        uniform(random)
    return random


@pytest.fixture
def states(begin: BeginStates) -> np.ndarray:
    return begin.states[::50]


def test_is_a_pure_controller_by_default(simulation: Simulation, states: np.ndarray) -> None:
    agent = an_agent(simulation)
    online = OnlineLearner(agent)
    online.begin(states[0], [500.0])
    for state in states[1:]:
        assert online.act().tolist() == online.greedy().tolist() == [int(online.values()[0].argmax())]
        online.observe(-1.0, state, False)
    np.testing.assert_array_equal(online.agent.weights(), agent.weights())
    assert online.valves().shape == (1, 2)


def test_explores_and_learns(simulation: Simulation, states: np.ndarray) -> None:
    agent = an_agent(simulation)
    online = OnlineLearner(agent, 0.05, Exploration(0.5, 20.0), seed=1)
    online.begin(states[0], [500.0])
    for i in range(600):
        before = online.act()
        assert np.array_equal(before, online.act())
        online.observe(-1.0, states[i % len(states)], False)
    assert (online.agent.weights() != agent.weights()).any()
    chosen = []
    for _ in range(600):
        online.begin(states[3], [500.0])
        chosen.append(online.act()[0] != online.greedy()[0])
    assert np.mean(chosen) == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize("decay", [0.0, 0.3])
def test_saved_state_goes_on_bit_for_bit(simulation: Simulation, states: np.ndarray, decay: float) -> None:
    agent = an_agent(simulation, trace_decay=decay)
    one, other = (OnlineLearner(agent, 0.05, Exploration(0.3, 5.0), seed=seed) for seed in (1, 2))
    one.begin(states[0], [450.0])
    for state in states[1:10]:
        one.observe(-1.0, state, False)
    other.set_state(one.get_state())
    for state in states[10:]:
        assert one.act().tolist() == other.act().tolist()
        for each in (one, other):
            each.observe(-9.0, state, False)
    assert one.get_state() == other.get_state()
    np.testing.assert_array_equal(one.agent.weights(), other.agent.weights())


@pytest.mark.parametrize("state", [b"", b"{}", b"[]", b'{"weights": [1]}', b"\xff"])
def test_a_strange_state_is_refused(simulation: Simulation, state: bytes) -> None:
    with pytest.raises(UnusableInput, match="learner"):
        OnlineLearner(an_agent(simulation)).set_state(state)


def test_misuse(simulation: Simulation, states: np.ndarray) -> None:
    online = OnlineLearner(an_agent(simulation))
    with pytest.raises(PneumarmError, match="begin an episode"):
        online.act()
    with pytest.raises(PneumarmError, match="shape"):
        online.begin(states[0][:-1], [500.0])
    with pytest.raises(UnusableInput, match="learning rate"):
        OnlineLearner(an_agent(simulation), -0.1)

"""The compiled loop: what ends an episode, what is learned from its end, and whether compiling changes it."""

import json
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from children import python
from pneumarm.learning import TrainSettings
from pneumarm.learning.online.loop import loop_workspace, train_episode, train_episodes
from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.online.values import draw_networks, learner, network_shapes, pack, unpack
from pneumarm.random import random_state
from pneumarm.simulation.noise import NoiseSettings
from pneumarm.simulation.simulation import Simulation
from pneumarm.task import BeginStates
from pneumarm.task.environment import environment, episode

QUIET = NoiseSettings(kind="none")
GREEDY = Schedule(np.inf, 0.0, 1.0, 0.002)


def one_episode(
    simulation: Simulation, begin: BeginStates, goal: float, settings: TrainSettings, biases: dict[int, float]
) -> tuple[tuple[int, float, bool], np.ndarray]:
    """Run an episode towards ``goal`` from 500 counts, of an agent whose values are 50 b; return them afterwards."""
    nearest = np.abs(begin.angle[:, 0] - 500).argmin()
    begin = BeginStates(begin.window, begin.states[[nearest]], begin.angle[[nearest]])
    simulation = replace(simulation, goal_range=np.array([[goal, goal]]))
    networks = network_shapes(simulation.window, settings.hidden)
    for action, bias in biases.items():
        networks.output_bias[0, action] = bias
    weights = pack(networks, simulation.window)
    env = environment(simulation, begin, settings)
    one = episode(env, random_state(0))
    work = learner(weights, settings)
    outcome = train_episode(env, work, GREEDY, one, loop_workspace(work, one.goal.size))
    return outcome, 50 * unpack(weights, simulation.window, settings.hidden).output_bias[0]


def test_goal_is_terminal(simulation: Simulation, begin: BeginStates) -> None:
    """Standing in the goal with closed valves (action 4): one action, +50, and its target is 50 alone."""
    settings = TrainSettings(noise=QUIET)
    outcome, values = one_episode(simulation, begin, 500.0, settings, {4: 0.2})
    assert outcome == (1, 50.0, True)
    assert values[4] == pytest.approx(10 + 0.05 * (50 - 10), abs=1e-4)


@pytest.mark.parametrize(("method", "cutoff"), [("sarsa", 1), ("q-learning", 1), ("sarsa", 3)])
def test_cut_off_is_not_terminal(simulation: Simulation, begin: BeginStates, method: str, cutoff: int) -> None:
    """Standing far from the goal: the last update looks ahead as the others do."""
    settings = TrainSettings(noise=QUIET, cutoff=cutoff, method=method)  # type: ignore[arg-type]
    outcome, values = one_episode(simulation, begin, 900.0, settings, {4: 0.2})
    assert outcome == (cutoff, -float(cutoff), False)
    value = 10.0
    for _ in range(cutoff):
        value += 0.05 * (-1 + 0.98 * value - value)
    assert values[4] == pytest.approx(value, abs=1e-4)


def test_switches_are_paid_for(simulation: Simulation, begin: BeginStates) -> None:
    """Action 4 loses its lead after one update of -5, then 3 does: -1, then -1 - 8; the first action is none."""
    settings = TrainSettings(noise=QUIET, cutoff=3, learning_rate=1.0, discount=0.0)
    outcome, values = one_episode(simulation, begin, 900.0, settings, {4: 0.02, 3: 0.01})
    # a' is chosen before the update, so action 4 is taken twice; then 3 has the higher value and is a switch.
    assert outcome == (3, -1.0 - 1.0 - 9.0, False)
    np.testing.assert_allclose(values[[4, 3]], [-1.0, -9.0], atol=1e-4)


def _chunk(joints: int, count: int, method: str = "q-learning") -> dict[str, list[float]]:
    simulation = synthetic_simulation(joints)
    settings = TrainSettings(cutoff=6, trace_decay=0.3, method=method)  # type: ignore[arg-type]
    env = environment(simulation, synthetic_begin_states(simulation), settings)
    weights = pack(draw_networks(simulation.window, settings, np.random.default_rng(0)), simulation.window)
    one = episode(env, random_state(4))
    work = learner(weights, settings)
    performance, steps, _ = train_episodes(
        env, work, Schedule(150.0, 0.5, 20.0, 0.002), one, loop_workspace(work, one.goal.size), count, 0.5
    )
    return {
        "weights": weights.ravel().tolist(),
        "x": one.state.x.tolist(),
        "random": one.state.random.tolist(),
        "numbers": [performance, steps],
    }


@pytest.mark.parametrize("joints", [1, 2])
def test_compiled_and_plain_python_agree(joints: int) -> None:
    """The same episodes in the interpreter: the same random numbers drawn, the same weights but for rounding."""
    folder = Path(__file__).parent
    code = f"import json, test_loop; print(json.dumps(test_loop._chunk({joints}, 4)))"
    environment_ = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    environment_["PYTHONPATH"] = os.pathsep.join([str(folder), *sys.path])
    done = python("-W", "ignore", "-c", code, env=environment_, check=True)
    plain, compiled = json.loads(done.stdout), _chunk(joints, 4)
    assert plain["random"] == compiled["random"]
    assert plain["numbers"] == pytest.approx(compiled["numbers"])
    for name in ("weights", "x"):
        np.testing.assert_allclose(plain[name], compiled[name], atol=2e-5)


def test_performance_is_the_moving_average_of_successes(simulation: Simulation, begin: BeginStates) -> None:
    """Thesis eq. 4.14 with 500 episodes that all succeed, from p = 0.2."""
    settings = TrainSettings(noise=QUIET)
    simulation = replace(simulation, goal_range=np.array([[500.0, 500.0]]))
    nearest = np.abs(begin.angle[:, 0] - 500).argmin()
    begin = BeginStates(begin.window, begin.states[[nearest]], begin.angle[[nearest]])
    networks = network_shapes(simulation.window, 5)
    networks.output_bias[0, 4] = 0.5
    env = environment(simulation, begin, settings)
    one = episode(env, random_state(0))
    work = learner(pack(networks, simulation.window), settings)
    performance, steps, _ = train_episodes(env, work, GREEDY, one, loop_workspace(work, one.goal.size), 500, 0.2)
    assert steps == 500
    assert performance == pytest.approx(1 - 0.8 * 0.998**500, rel=1e-9)


def test_training_ends_with_the_episode_in_which_the_performance_is_enough(
    simulation: Simulation, begin: BeginStates
) -> None:
    """From p = 0.2 with successes only: 1 - 0.8 * 0.998^n reaches 0.5 after n = 235 episodes, of one action each."""
    settings = TrainSettings(noise=QUIET)
    simulation = replace(simulation, goal_range=np.array([[500.0, 500.0]]))
    nearest = np.abs(begin.angle[:, 0] - 500).argmin()
    begin = BeginStates(begin.window, begin.states[[nearest]], begin.angle[[nearest]])
    networks = network_shapes(simulation.window, 5)
    networks.output_bias[0, 4] = 0.5
    env = environment(simulation, begin, settings)
    one = episode(env, random_state(0))
    work = learner(pack(networks, simulation.window), settings)
    performance, steps, count = train_episodes(
        env, work, GREEDY._replace(enough=0.5), one, loop_workspace(work, one.goal.size), 500, 0.2
    )
    assert (steps, count) == (235, 235)
    assert 0.5 <= performance < 0.5 + 0.002

"""Policies of other libraries as agents."""

from pathlib import Path

import numpy as np
import pytest
from synthetic_arm import synthetic_simulation

from pneumarm.errors import UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.learning import fingerprint, test
from pneumarm.learning.imported import KIND, ImportedPolicy
from pneumarm.simulation import Simulation
from pneumarm.task import BeginStates
from pneumarm.task.acting import test_acting
from pneumarm.task.environment import environment
from pneumarm.task.movements import TEST


def policy(joints: int = 1, sizes: tuple[int, ...] = (8, 5), activation: str = "tanh") -> ImportedPolicy:
    simulation, random = synthetic_simulation(joints), np.random.default_rng(0)
    inputs = [simulation.window.state_size + joints, *sizes]
    layers = tuple(
        (random.normal(size=(n, m)).astype(np.float32), random.normal(size=m).astype(np.float32))
        for n, m in zip(inputs, [*sizes, 9 * joints], strict=True)
    )
    return ImportedPolicy(
        simulation.spec, simulation.window, simulation.scaling, simulation.goal_range, layers, activation
    )  # type: ignore[arg-type]


@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_values_are_those_of_the_layers(activation: str) -> None:
    agent = policy(activation=activation)
    x = np.random.default_rng(1).normal(size=(20, 17)).astype(np.float32)
    bend = np.tanh if activation == "tanh" else lambda v: np.where(v > 0, v, 0)
    (w1, b1), (w2, b2), (w3, b3) = agent.layers
    expected = bend(bend(x @ w1 + b1) @ w2 + b2) @ w3 + b3
    np.testing.assert_allclose(agent.values(x)[:, 0], expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("joints", [1, 2])
def test_it_acts_greedily_on_the_scaled_state_with_the_goal(joints: int) -> None:
    agent = policy(joints)
    actor, random = agent.actor(), np.random.default_rng(2)
    state = random.normal(size=agent.window.state_size).astype(np.float32)
    goal = np.linspace(400.0, 600.0, joints)
    actor.begin(state, goal)
    inputs = np.concatenate([state, (goal - 512.0) / 400.0])
    chosen = actor.act()
    np.testing.assert_array_equal(chosen, agent.values(inputs).argmax(axis=-1))
    assert chosen.shape == (joints,)
    seen = set()
    for _ in range(30):
        state = random.normal(size=agent.window.state_size)
        actor.follow(state)
        np.testing.assert_array_equal(
            actor.act(), agent.values(np.concatenate([state, inputs[-joints:]])).argmax(axis=-1)
        )
        seen.add(int(actor.act()[0]))
    assert len(seen) > 1


def test_a_wise_policy_reaches_its_goals(simulation: Simulation, begin: BeginStates) -> None:
    """Layers by hand: inflate the muscle that turns towards the goal, vent the other."""
    size = simulation.window.state_size
    error = np.zeros((size + 1, 2), np.float32)
    error[[0, 1, size]] = [[-3, 3], [-6, 6], [3, -3]]  # goal - angle, damped by the velocity
    outputs = np.zeros((2, 9), np.float32)
    outputs[0, 6], outputs[1, 2] = 1, 1
    bias = np.zeros(9, np.float32)
    bias[4] = 0.1
    agent = ImportedPolicy(
        simulation.spec,
        simulation.window,
        simulation.scaling,
        simulation.goal_range,
        ((error, np.zeros(2, np.float32)), (outputs, bias)),
        "relu",
    )
    tested = test(agent, simulation, begin, 100)
    assert tested.success.mean() > 0.9
    idle = test_acting(policy().actor(), environment(simulation, begin, agent.settings), 100, (0, TEST))
    np.testing.assert_array_equal(idle.goal, tested.goal)
    assert idle.reward.mean() < tested.reward.mean()


@pytest.mark.parametrize("joints", [1, 2])
def test_saved_and_loaded_it_is_the_same(tmp_path: Path, joints: int) -> None:
    agent = policy(joints, activation="relu")
    agent.save(tmp_path / "agent")
    loaded = ImportedPolicy.load(tmp_path / "agent")
    assert fingerprint(loaded) == fingerprint(agent)
    x = np.random.default_rng(3).normal(size=agent.window.state_size + joints)
    np.testing.assert_array_equal(loaded.values(x), agent.values(x))
    assert (loaded.spec, loaded.window, loaded.settings) == (agent.spec, agent.window, agent.settings)


@pytest.mark.parametrize("damage", ["missing", "shape", "scale", "layers", "more outputs", "settings"])
def test_a_damaged_file_is_refused(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "agent"
    policy().save(path)
    settings, arrays = read_arrays(path, KIND)
    if damage == "missing":
        del arrays["bias_1"]
    elif damage == "shape":
        arrays["weights_1"] = arrays["weights_1"][1:]
    elif damage == "scale":
        arrays["observation_scale"] = -arrays["observation_scale"]
    elif damage == "layers":
        settings["layers"] = 10**9
    elif damage == "more outputs":
        arrays["weights_2"], arrays["bias_2"] = np.zeros((5, 10), np.float32), np.zeros(10, np.float32)
    else:
        settings["activation"] = "exec"
    write_arrays(path, KIND, settings, arrays)
    with pytest.raises(UnusableInput, match="imported policy"):
        ImportedPolicy.load(path)

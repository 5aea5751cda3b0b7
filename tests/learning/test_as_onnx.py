"""Agents as ONNX decide as the originals do, on 10,000 states."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from synthetic_arm import in_steps, synthetic_simulation

from pneumarm.errors import UnusableInput
from pneumarm.learning.as_onnx import as_onnx
from pneumarm.learning.policy.acting import judge_all, lanes
from pneumarm.learning.policy.agent import PolicyAgent, policy_sizes
from pneumarm.learning.policy.settings import PolicySettings
from pneumarm.learning.servo.actor import ServoActor
from pneumarm.learning.servo.agent import ServoAgent
from pneumarm.learning.servo.settings import ServoSettings
from pneumarm.learning.servo.task import servo_sizes
from pneumarm.networks.layers import initial_weights
from pneumarm.random import random_states

STATES = 10_000


def raw_of(agent: ServoAgent | PolicyAgent, scaled: np.ndarray) -> np.ndarray:
    """Return scaled states (n, state_size) in sensor units."""
    window, scaling = agent.window, agent.scaling
    observed = window.history * window.observation_size
    raw = scaled.astype(np.float64)
    raw[:, :observed] *= np.tile(scaling.observation_scale, window.history)
    raw[:, :observed] += np.tile(scaling.observation_offset, window.history)
    raw[:, observed : window.state_size - window.memory_size] *= np.tile(scaling.command_scale, window.history - 1)
    raw[:, window.state_size - window.memory_size :] *= np.tile(window.hysteresis, window.joints)
    return raw.astype(np.float32)


@pytest.mark.parametrize(("joints", "history", "steps"), [(1, 3, 0), (2, 3, 0), (1, 1, 0), (1, 3, 3)])
def test_a_servo_as_onnx_decides_as_the_original(joints: int, history: int, steps: int) -> None:
    pytest.importorskip("onnx")
    runtime = pytest.importorskip("onnxruntime")
    simulation = synthetic_simulation(joints, history, hysteresis=(15.0, 60.0) if joints > 1 else ())
    settings = ServoSettings()
    if steps:
        simulation = in_steps(simulation, steps)
    random = np.random.default_rng(joints)
    agent = ServoAgent(simulation, initial_weights(servo_sizes(simulation, settings), 3.0, random), settings)
    actor, previews = ServoActor(agent), len(agent.task.inputs.steps)
    scaled = random.uniform(-1.2, 1.2, (STATES, agent.window.state_size)).astype(np.float32)
    low, high = simulation.goal_range.T
    wanted = low + (high - low) * random.random((STATES, previews, joints))
    expected = np.array([actor.pulses(one, ahead) for one, ahead in zip(scaled, wanted, strict=True)])
    session = runtime.InferenceSession(as_onnx(agent))
    (found,) = session.run(["pulses"], {"state": raw_of(agent, scaled), "reference": wanted.astype(np.float32)})
    difference = np.abs(found - expected)
    assert (expected != 0).mean() > 0.2
    assert (difference < 1e-3).mean() > 0.999
    assert difference.max() <= agent.task.commands.shortest + 1e-3  # where a pulse is rounded up here and down there


@pytest.mark.parametrize("joints", [1, 2])
def test_a_policy_as_onnx_decides_as_the_original(joints: int) -> None:
    """With last actions, arms that are stuck, and muscles that are full."""
    pytest.importorskip("onnx")
    runtime = pytest.importorskip("onnxruntime")
    simulation, random = synthetic_simulation(joints), np.random.default_rng(joints)
    settings = replace(PolicySettings(), hold=0.5)
    weights = initial_weights(policy_sizes(simulation.window, settings), 1.0, random)
    agent = PolicyAgent(simulation, weights, settings)
    mind, window = agent.mind(), agent.window
    scaled = random.uniform(-1.5, 1.5, (STATES, window.state_size)).astype(np.float32)
    low, high = simulation.goal_range.T
    goal = low + (high - low) * random.random((STATES, joints))
    last = random.integers(0, 9, (STATES, joints))
    last[: STATES // 4] = -1
    still = random.integers(0, 5, (STATES, joints)) * (last >= 0)
    arms = lanes(mind, agent.sizes, random_states(0, STATES))
    fleet, task = arms.fleet, mind.environment.task
    fleet.x[: window.state_size] = scaled.T
    fleet.x[task.layout.goal : task.layout.goal + joints] = ((goal - task.unit[:, 0]) / task.unit[:, 1]).T
    fleet.actions[:], fleet.still[:] = last, still
    judge_all(mind, arms)
    session = runtime.InferenceSession(as_onnx(agent))
    given = {"state": raw_of(agent, scaled), "goal": goal, "last_action": last, "still": still}
    (found,) = session.run(["action"], {name: np.asarray(value, np.float32) for name, value in given.items()})
    allowed = arms.bias > -1e8
    assert 0.05 < 1 - allowed.mean() < 0.8  # many actions were forbidden, so that this is tried too
    assert np.unique(found).size == 9
    assert (found == arms.actions).mean() > 0.999  # equal but for ties of single precision
    chosen = np.take_along_axis(arms.units[-1].T.reshape(STATES, joints, 9), found[..., None], axis=2)[..., 0]
    best = arms.units[-1].T.reshape(STATES, joints, 9).max(axis=2)
    assert np.abs(chosen - best).max() < 1e-3


def test_it_says_what_goes_in_and_what_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    onnx = pytest.importorskip("onnx")
    simulation, settings = synthetic_simulation(), ServoSettings()
    weights = initial_weights(servo_sizes(simulation, settings), 1.0, np.random.default_rng(0))
    agent = ServoAgent(simulation, weights, settings)
    model = onnx.load_from_string(as_onnx(agent))
    assert "control periods from now [counts]" in model.graph.doc_string
    assert {one.key for one in model.metadata_props} == {"arm", "period", "ahead"}
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(UnusableInput, match=r"needs onnx: pip install 'pneumarm\[onnx\]'"):
        as_onnx(agent)

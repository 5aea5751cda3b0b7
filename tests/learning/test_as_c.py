"""A servo as C is compiled, and decides as the original does."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from synthetic_arm import in_steps, synthetic_simulation

from pneumarm.learning.servo.actor import ServoActor
from pneumarm.learning.servo.agent import ServoAgent
from pneumarm.learning.servo.as_c import as_c
from pneumarm.learning.servo.settings import ServoSettings
from pneumarm.learning.servo.task import servo_sizes
from pneumarm.networks.layers import initial_weights

STATES = 10_000
COMPILER = shutil.which("cc")


@pytest.mark.skipif(COMPILER is None, reason="needs a C compiler")
@pytest.mark.parametrize(("joints", "steps"), [(1, 0), (2, 0), (1, 3)])
def test_c_decides_as_the_original_on_10_000_states(joints: int, steps: int, tmp_path: Path) -> None:
    simulation, settings, random = synthetic_simulation(joints), ServoSettings(), np.random.default_rng(joints)
    if steps:
        simulation = in_steps(simulation, steps)
    weights = initial_weights(servo_sizes(simulation, settings), 3.0, random)
    agent = ServoAgent(simulation, weights, settings)
    source, library = tmp_path / "agent.c", tmp_path / "agent.so"
    source.write_text(as_c(agent))
    strict = ("-std=c99", "-Wall", "-Wextra", "-Wdouble-promotion", "-Werror", "-pedantic", "-O1", "-shared", "-fPIC")
    subprocess.run([str(COMPILER), *strict, str(source), "-o", str(library)], check=True, timeout=120)
    act = ctypes.CDLL(str(library)).servo_act
    pointer = np.ctypeslib.ndpointer(np.float32, flags="C_CONTIGUOUS")
    act.argtypes, act.restype = [pointer] * 3, None

    window, scaling, actor = agent.window, agent.scaling, ServoActor(agent)
    size, previews = window.state_size, len(agent.task.inputs.steps)
    scaled = random.uniform(-1.2, 1.2, (STATES, size)).astype(np.float32)
    observed = window.history * window.observation_size
    raw = scaled.astype(np.float64)
    raw[:, :observed] *= np.tile(scaling.observation_scale, window.history)
    raw[:, :observed] += np.tile(scaling.observation_offset, window.history)
    raw[:, observed:] *= np.tile(scaling.command_scale, window.history - 1)
    low, high = simulation.goal_range.T
    wanted = low + (high - low) * random.random((STATES, previews, joints))
    expected = np.array([actor.pulses(one, ahead) for one, ahead in zip(scaled, wanted, strict=True)])
    found = np.zeros((STATES, joints, 2), np.float32)
    for number in range(STATES):
        act(raw[number].astype(np.float32), wanted[number].astype(np.float32), found[number])

    shortest = agent.task.commands.shortest
    difference = np.abs(found - expected)
    assert (expected != 0).mean() > 0.2
    assert (difference < 1e-3).mean() > 0.999
    assert difference.max() <= shortest + 1e-3  # where a pulse is rounded up here and down there


def test_a_name_cannot_end_the_comment() -> None:
    from pneumarm.learning.servo.as_c import _safe

    assert "*/" not in _safe("arm */ int main")

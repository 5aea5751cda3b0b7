"""A servo as C decides as the original does, to the last bit where nothing contracts products and sums."""

import shutil
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from in_c import CHECKED, STRICT, InC, Turn, turns_of
from numpy.typing import NDArray
from synthetic_arm import in_steps, synthetic_simulation

from pneumarm.arm import Reading
from pneumarm.arm.reference import Reference
from pneumarm.errors import PneumarmError
from pneumarm.learning.servo.agent import ServoAgent
from pneumarm.learning.servo.as_c import as_c
from pneumarm.learning.servo.board import BoardController, quantised
from pneumarm.learning.servo.controller import ServoController
from pneumarm.learning.servo.quantised import BLOCK, ONE, Quantised, quantised_of, run_quantised, units_of
from pneumarm.learning.servo.settings import ServoSettings
from pneumarm.learning.servo.task import servo_sizes
from pneumarm.learning.servo.translate import Array, Constant, Translator
from pneumarm.networks.layers import initial_weights, split

COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
needs_compiler = pytest.mark.skipif(not COMPILERS, reason="needs a C compiler")


def agent_of(joints: int = 1, steps: int = 0, hidden: tuple[int, ...] = (48, 48), **spec: object) -> ServoAgent:
    """Return an agent that was recorded with pulses; what it learned does not matter here."""
    simulation = synthetic_simulation(joints, hysteresis=(15.0, 60.0) if joints > 1 else ())
    settings = ServoSettings(hidden=hidden, planned=0, coarse=0.2)
    if steps:
        simulation = in_steps(simulation, steps)
    simulation = replace(simulation, error_std=simulation.error_std / 4, commands="pulses")
    simulation = replace(simulation, spec=replace(simulation.spec, **spec))
    weights = initial_weights(servo_sizes(simulation, settings), 3.0, np.random.default_rng(joints))
    return ServoAgent(simulation, weights, settings)


def turns_for(agent: ServoAgent, movements: int, steps: int, follows: bool) -> list[Turn]:
    path = BoardController(agent).path_length
    return turns_of(np.random.default_rng(7), agent.spec, agent.goal_range, path, movements, steps, follows)


def decided(
    agent: ServoAgent, turns: list[Turn], follows: bool, small: Quantised | None = None
) -> NDArray[np.float64]:
    """Return the commands (n, joints, 2) that the original gives."""
    controller, middle = BoardController(agent, small), agent.goal_range.mean(axis=1)
    found = []
    for turn in turns:
        if turn.begins:
            controller.reset(middle)
            controller.track(Reference(lambda time: middle, stays=not follows))
        found.append(controller.step(turn.angle, turn.pressure, turn.path))
    return np.array(found)


def in_plain_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let kernels be the plain functions that they are compiled from."""
    for name, module in list(sys.modules.items()):
        if name.startswith("pneumarm."):
            for one, value in list(vars(module).items()):
                if callable(getattr(value, "py_func", None)):
                    monkeypatch.setattr(module, one, value.py_func)


KINDS = [(1, 0, {}), (2, 0, {}), (1, 3, {}), (1, 0, {"muscles": 1}), (1, 0, {"pulses": False})]


@needs_compiler
@pytest.mark.parametrize("follows", [False, True])
@pytest.mark.parametrize(("joints", "steps", "spec"), KINDS)
def test_c_decides_as_the_original_on_9000_states(
    joints: int, steps: int, spec: dict[str, object], follows: bool, tmp_path: Path
) -> None:
    agent = agent_of(joints, steps, **spec)
    turns = turns_for(agent, 100, 90, follows)
    expected = decided(agent, turns, follows)
    found = InC(agent, tmp_path, compiler=COMPILERS[0]).command(turns, follows)
    assert 0.02 < (expected != 0).mean() < 0.99
    assert (np.abs(found - expected) < 1e-5).mean() > 0.999
    assert (expected == 0).all(axis=(1, 2)).any() or follows  # joints are left alone at rest


@needs_compiler
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("follows", [False, True])
def test_c_agrees_to_the_last_bit_with_plain_python(
    compiler: str, follows: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Compiled kernels may contract a product and a sum in single precision; plain Python and this C do not."""
    agent = agent_of(hidden=(8, 8))
    turns = turns_for(agent, 25, 60, follows)
    found = InC(agent, tmp_path, compiler=compiler, flags=CHECKED).command(turns, follows)
    in_plain_python(monkeypatch)
    np.testing.assert_array_equal(found, decided(agent, turns, follows))


@needs_compiler
@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_example_of_the_file_runs_under_sanitizers(compiler: str, tmp_path: Path) -> None:
    source, program = tmp_path / "agent.c", tmp_path / "agent"
    source.write_text(as_c(agent_of(2)))
    flags = [one for one in STRICT if one not in ("-shared", "-fPIC")]
    checked = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-DSERVO_EXAMPLE"]
    subprocess.run([compiler, *flags, *checked, str(source), "-o", str(program)], check=True, timeout=120)
    done = subprocess.run([str(program)], capture_output=True, text=True, check=True, timeout=60)
    numbers = np.array([[float(one) for one in line.split()] for line in done.stdout.splitlines()])
    assert numbers.shape == (10, 4)
    assert (np.abs(numbers) <= 1).all()


@needs_compiler
def test_in_single_precision_it_decides_much_the_same(tmp_path: Path) -> None:
    agent = agent_of()
    turns = turns_for(agent, 100, 60, False)
    found, exactly = (InC(agent, tmp_path, single=single).command(turns, False) for single in (True, False))
    assert (np.abs(found - exactly) < 1e-3).mean() > 0.99


@needs_compiler
@pytest.mark.parametrize("compiler", COMPILERS)
def test_in_whole_numbers_c_agrees_to_the_last_bit(
    compiler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    agent = agent_of(hidden=(10, 6))
    small, turns = quantised(agent), turns_for(agent, 25, 60, False)
    found = InC(agent, tmp_path, small, compiler=compiler, flags=CHECKED).command(turns, False)
    in_plain_python(monkeypatch)
    np.testing.assert_array_equal(found, decided(agent, turns, False, small))


def test_whole_numbers_are_those_of_numpy_and_near_the_floats() -> None:
    agent, random = agent_of(), np.random.default_rng(0)
    inputs = random.normal(0.0, [[0.5] * 22 + [2.0] * (agent.sizes[0] - 22)], (3000, agent.sizes[0])).astype(
        np.float32
    )
    small = quantised_of(agent, inputs)
    units, said = units_of(agent.sizes), np.zeros((agent.sizes[-1], 1), np.float32)
    found = []
    for one in inputs:
        run_quantised(small, one[:, None], units, said)
        found.append(said[:, 0].copy())
    np.testing.assert_array_equal(found, said_by_numpy(small, inputs))
    exactly = inputs.astype(np.float64)
    for number, layer in enumerate(split(agent.policy, agent.sizes)):
        exactly = np.tanh(exactly) if number else exactly
        exactly = exactly @ layer[:-1] + layer[-1]
    scatter = exactly.std(axis=0)
    assert (np.abs(found - exactly).std(axis=0) < 0.05 * scatter).all()


def said_by_numpy(small: Quantised, inputs: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what a network in whole numbers says (n, outputs), worked out with NumPy's for all inputs at once."""
    u = (np.clip(inputs * small.into, -8191, 8191) + np.float32(8192.5)).astype(np.int64) - 8192
    place = row = 0
    for number, (count, wide) in enumerate(pairwise(small.sizes.tolist())):
        padded = -(-count // BLOCK) * BLOCK
        n = small.weights[place : place + wide * padded].astype(np.int64).reshape(wide, padded)[:, :count]
        high = np.clip((u @ n.T) >> (3 if number else 8), -32767, 32767)
        z = ((high * small.factor[row : row + wide]) >> 8) + small.bias[row : row + wide]
        size = np.minimum(np.abs(z), 96 * 256)
        low, after = (small.bent.astype(np.int64)[(size >> 8) + k] for k in (0, 1))
        u = np.sign(z) * ((low + (((after - low) * (size & 255)) >> 8) + 16) >> 5)
        place, row = place + wide * padded, row + wide
    return (z / ONE).astype(np.float32)


def test_a_board_decides_as_the_controller_that_neither_plans_nor_looks_ahead() -> None:
    agent = agent_of(2)
    controller, board = ServoController(agent), BoardController(agent)
    controller._rest._foresight = None
    for movement in range(20):
        random, middle = np.random.default_rng(movement), agent.goal_range.mean(axis=1)
        swing = Reference(lambda time, at=middle: at + 60 * np.sin(5 * time + np.arange(len(at))))
        goal = agent.goal_range[:, 0] + (agent.goal_range[:, 1] - agent.goal_range[:, 0]) * random.random(2)
        for one in (controller, board):
            if movement % 3 == 2:
                one.track(swing)
            else:
                one.reset(goal)
        for step in range(60):
            angle = np.round(goal + 200 * np.exp(-step / 5) * np.cos(step) + random.normal(0, 1, 2))
            reading = Reading(step / 30 + 0.001 * random.random(), angle, np.round(90 + random.normal(0, 5, (2, 2))))
            np.testing.assert_allclose(board.act(reading), controller.act(reading), atol=1e-4)


def test_what_c_has_not_is_refused_in_words() -> None:
    array = Array("float32", (4,))
    for function, words in (
        (_with_a_list, "an expression that C has not"),
        (_of_two_kinds, "say np.float32"),
        (_with_while, "a statement that C has not"),
        (_swapping, "one value after the other"),
    ):
        with pytest.raises(PneumarmError, match=words):
            Translator().function(function, array)


def _with_a_list(x):  # type: ignore[no-untyped-def]
    x[0] = [1.0]


def _of_two_kinds(x):  # type: ignore[no-untyped-def]
    for i in range(4):
        x[i] = x[i] * i


def _with_while(x):  # type: ignore[no-untyped-def]
    while x[0] > np.float32(1.0):
        x[0] = np.float32(0.0)


def _swapping(x):  # type: ignore[no-untyped-def]
    x[0], x[1] = x[1], x[0]


def test_known_numbers_are_written_as_such() -> None:
    whole = Translator()
    whole.function(_weighted, Array("float64", (2,)), Constant(np.array([0.1, 2.0]), "weights"))
    assert "static const real weights[2] IN_FLASH = {" in whole.text()
    assert "REAL(0.1), REAL(2.0)" in whole.text()


def _weighted(x, weights):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(weights.shape[0]):
        total += weights[i] * x[i]
    return total


def test_a_name_cannot_end_the_comment() -> None:
    from pneumarm.learning.servo.as_c import _safe

    assert "*/" not in _safe("arm */ int main")

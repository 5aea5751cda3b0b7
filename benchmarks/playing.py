"""Movements of a learning agent on a virtual arm: one compiled loop beside the guard, the control cycle and ``move``.

python -m benchmarks playing

Both make the same movements, which is checked: an agent of the thesis' kind with random weights learns on
``virtual:seed=1``. Times are of the processor, the shortest of three, made in turns.
"""

import time
from collections.abc import Callable, Iterator

import numpy as np

from benchmarks.learning import _synthetic
from pneumarm.arm import ControlCycle, guarded
from pneumarm.arm.virtual import VirtualArm, draw_parameters
from pneumarm.control.agent import AgentController
from pneumarm.control.movement import BEGIN, drawn, evaluate
from pneumarm.control.playing import Player
from pneumarm.learning import Agent, Exploration, TrainSettings
from pneumarm.learning.online.agent import OnlineLearner
from pneumarm.learning.online.values import draw_networks

MOVEMENTS, REPEATS, SEED = 100, 3, 7
RANGE = np.array([[150.0, 850.0]])
EXPLORATION, SETTINGS = Exploration(), TrainSettings()


def measure() -> Iterator[str]:
    """Yield a line with the time of a movement either way, and how many times as fast the loop is."""
    simulation = _synthetic().synthetic_simulation()
    networks = draw_networks(simulation.window, SETTINGS, np.random.default_rng(2))
    agent = Agent(VirtualArm().spec, simulation.window, simulation.scaling, RANGE, networks, SETTINGS)
    _played(agent, 2), _by_the_cycle(agent, 2)  # compiles, or loads what was compiled
    ways: tuple[Callable[[Agent], tuple[float, float, float]], ...] = (_by_the_cycle, _played)
    found = np.array([[way(agent) for way in ways] for _ in range(REPEATS)])
    assert (found[:, :, 1:] == found[0, 0, 1:]).all(), "the loop and move differ"
    (slow, fast), (_, arm_time) = found[:, :, 0].min(axis=0), found[0, 0, 1:]
    yield (
        f"a movement, one compiled loop: {1e3 * fast / MOVEMENTS:.2f} ms, {arm_time / fast:,.0f} times real time; "
        f"through move and the guard: {1e3 * slow / MOVEMENTS:.2f} ms; the loop is {slow / fast:.1f} times as fast"
    )


def _played(agent: Agent, count: int = MOVEMENTS) -> tuple[float, float, float]:
    """Return the processor time [s], the sum of rewards and the arm's time at the end [s]."""
    draws = list(drawn(RANGE, SEED, range(count), test=False))
    goals = np.array([draw.goal for draw in draws])
    durations = np.array([draw.random.uniform(0.0, BEGIN.inflate, (1, 2)) for draw in draws])
    arm = VirtualArm(draw_parameters(1), seed=SEED)
    player = Player(agent, arm, SETTINGS.learning_rate, EXPLORATION, seed=SEED, begin=BEGIN)
    began = time.process_time()
    made = player.play(goals, durations)
    return time.process_time() - began, float(made.reward.sum()), float(made.time_end[-1])


def _by_the_cycle(agent: Agent, count: int = MOVEMENTS) -> tuple[float, float, float]:
    """Return the same of movements through the guard and the control cycle."""
    learning = OnlineLearner(agent, SETTINGS.learning_rate, EXPLORATION, seed=SEED)
    cycle = ControlCycle(guarded(VirtualArm(draw_parameters(1), seed=SEED)))
    controller = AgentController(agent, learning)
    began = time.process_time()
    made = evaluate(cycle, controller, SETTINGS, drawn(RANGE, SEED, range(count), test=False))
    return time.process_time() - began, float(made.reward.sum()), float(made.time_end[-1])

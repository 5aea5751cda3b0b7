"""What experiments on the arm share: agents trained in its simulation, their movements on it, their settings."""

import functools
import threading
from contextlib import nullcontext
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import Arm, open_arm
from pneumarm.arm.virtual import ArmParameters, VirtualArm
from pneumarm.control.movement import BEGIN, drawn
from pneumarm.control.turns import player
from pneumarm.experiments.experiment import Experiment, LaboratorySettings, run_seed
from pneumarm.experiments.preparation import Simulated, simulated
from pneumarm.learning import Agent, Exploration, TrainSettings
from pneumarm.learning.online.testing import GREEDY, run_test
from pneumarm.learning.online.training import train_online
from pneumarm.progress import Report
from pneumarm.simulation.kernel import scaled_state
from pneumarm.simulation.noise import NoiseSettings
from pneumarm.task import BeginStates
from pneumarm.task.environment import environment
from pneumarm.task.movements import TEST, Movements

Array = NDArray[np.float64]

THESIS = TrainSettings(learning_rate=0.10, agents=8, validation_episodes=1000)
"""Trial 10 of table 5.3, whose agent was transferred (section 5.5); of eight agents the best.

The thesis took the best of 128 agents, which it had anyway.
"""
_TEST_SEED = 0  # the same begin states and goals for every agent in the simulation
TEST_MOVEMENTS, MOVEMENTS = 0, 1
"""Streams of random numbers of goals and begin states on the arm."""
SIMULATION = "simulation: "
"""Prefix of the figures of a test in the simulation; those on the arm have none."""


@dataclass(frozen=True)
class TestSizes:
    """How much agents are tested in a row."""

    test: int = 300
    """Movements on the arm."""


@dataclass(frozen=True)
class OnTheArm(Experiment):
    """An experiment in which agents move the arm, by default that of a run in all its trials."""

    agent: TrainSettings = THESIS
    """How it learned."""
    sizes: Any = TestSizes()
    """How much is moved in a row, by default a test; a dataclass."""

    records = True

    def settings(self) -> Any:
        """Return the trials in words, the settings of the agent and the sizes."""
        return {"trials": dict(self.trials), "agent": msgspec.to_builtins(self.agent), "sizes": asdict(self.sizes)}

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> Simulated:
        """Return the arm's simulation."""
        return simulated(arm, folder, settings, progress)

    def movements(self, trial: int, arm: str, settings: LaboratorySettings) -> int:
        """Return those of the test."""
        return int(self.sizes.test)


def parameters_of(arm: str) -> ArmParameters | None:
    """Return what the arm of this name is made of, if that is known: it is of a virtual arm."""
    if not arm.startswith("virtual"):
        return None
    with open_arm(arm) as opened:
        return opened.parameters if isinstance(opened, VirtualArm) else None


def new_arm(of: Simulated, run: int, laboratory: LaboratorySettings, parameters: ArmParameters | None = None) -> Arm:
    """Return the arm: a virtual one as it is in the morning, after a night of rest, any other as it is.

    All trials of a run on a virtual arm meet the same noise. ``parameters`` are others than its own.
    """
    seed = run_seed(laboratory, run)
    arm = open_arm(of.arm, seed)
    if parameters is None:
        return arm
    assert isinstance(arm, VirtualArm)
    return arm.like(seed, parameters)


def clock(arm: Arm) -> float:
    """Return the time on the clock of ``arm`` [s]; asking a virtual arm draws no noise."""
    return arm.time if isinstance(arm, VirtualArm) else arm.read().time


_locks: dict[Any, threading.Lock] = {}
_guard = threading.Lock()


def agent_of(of: Simulated, settings: TrainSettings, run: int, laboratory: LaboratorySettings) -> Agent:
    """Return the agent of ``run``, the best of ``settings.agents``; trained once in a process.

    All trials of a run that train alike begin on the arm with the same agent.
    """
    chosen = replace(settings, max_episodes=laboratory.max_episodes or settings.max_episodes)
    key = of, chosen, run_seed(laboratory, run)
    with _guard:
        lock = _locks.setdefault(key, threading.Lock())
    with lock:
        return _trained(*key)


@functools.lru_cache(maxsize=64)
def _trained(of: Simulated, settings: TrainSettings, seed: int) -> Agent:
    return train_online(of.simulation, of.begin, settings, seed, threads=1).agent


def draws(agent: Agent, seed: int, count: int, stream: int, first: int = 0) -> tuple[Array, Array]:
    """Return goals (count, joints) [counts] and times of inflation (count, joints, 2) [s] of movements.

    Args:
        agent: whose goals they are.
        seed: of the run.
        count: how many.
        stream: ``TEST_MOVEMENTS`` or ``MOVEMENTS``.
        first: number of the first of them.

    """
    shape = agent.spec.joints, 2
    numbers = range(first, first + count)
    draws = list(drawn(agent.goal_range, seed, numbers, test=stream == TEST_MOVEMENTS))
    goals = np.array([draw.goal for draw in draws]).reshape(count, shape[0])
    return goals, np.array([one.random.uniform(0.0, BEGIN.inflate, shape) for one in draws]).reshape(count, *shape)


def simulated_test(
    of: Simulated,
    agent: Agent,
    episodes: int,
    *,
    exploration: Exploration = GREEDY,
    noise: NoiseSettings | None = None,
    prefix: str = "",
) -> dict[str, float]:
    """Return the means of a test in the simulation, by default with the noise that the agent was trained with.

    Their names are preceded by ``prefix``.
    """
    settings = agent.settings if noise is None else replace(agent.settings, noise=noise)
    env = environment(of.simulation, of.begin, settings)
    tested = run_test(env, agent.weights(), agent.settings, episodes, (_TEST_SEED, TEST), exploration)
    return means(tested, prefix)


def greedy_test(
    of: Simulated,
    agent: Agent,
    episodes: int,
    run: int,
    laboratory: LaboratorySettings,
    arm: Arm | None = None,
) -> Movements:
    """Let ``agent`` move greedily on the arm, by default as it is in the morning; the same goals in all trials."""
    with nullcontext(arm) if arm else new_arm(of, run, laboratory) as where:
        return player(agent, where).play(*draws(agent, run_seed(laboratory, run), episodes, TEST_MOVEMENTS))


def from_visits(agent: Agent, angle: Array, pressure: Array) -> BeginStates:
    """Return begin states of what :meth:`Player.visit` saw: ``angle`` (n, joints), ``pressure`` (n, joints, 2)."""
    window = agent.window
    observed = np.concatenate([angle[..., None], np.zeros_like(angle)[..., None], pressure], axis=-1)
    newest = observed.reshape(len(angle), window.observation_size)
    closed = np.zeros((len(angle), (window.history - 1) * window.command_size + window.memory_size))
    sigma = np.concatenate([np.tile(newest, window.history), closed], axis=1)
    order = np.argsort(angle[:, 0], kind="stable")
    states = scaled_state(sigma[order], window, agent.scaling)
    return BeginStates(window, states, np.ascontiguousarray(angle[order]))


def means(made: Movements, prefix: str = "") -> dict[str, float]:
    """Return the means of movements; actions and switches of successful ones, as in the thesis (5.5.1)."""
    won, switches = made.success, made.all_switches
    figures = {"reward": float(made.reward.mean()), "success_rate": float(won.mean())}
    if won.any():  # else there is nothing to take the mean of, and the row does not have it
        figures |= {"actions": float(made.actions[won].mean()), "switches": float(switches[won].mean())}
    return {prefix + name: value for name, value in figures.items()}


def course(made: Movements, block: int) -> dict[str, float]:
    """Return the means of every ``block`` of movements, as ``NAME @BLOCK``, blocks from 1."""
    found: dict[str, float] = {}
    for k in range(made.n // block):
        part = means(made.part(slice(k * block, (k + 1) * block)))
        found |= {f"{name} @{k + 1}": value for name, value in part.items()}
    return found

"""The testing phase of section 5.2: many greedy movements in the noisy simulation, nothing learned."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.learning.agent import Agent
from pneumarm.learning.begin import BeginStates
from pneumarm.learning.environment import Environment, environment, episode
from pneumarm.learning.loop import movements, room, test_episodes
from pneumarm.learning.settings import TrainSettings
from pneumarm.learning.values import learner
from pneumarm.random import random_state
from pneumarm.simulation.simulation import Simulation
from pneumarm.statistics import summarise

TEST, NOISE = 3, 4
"""Streams of random numbers of tests; training uses others."""


@dataclass(frozen=True)
class TestResult:
    """Movements of a test, an entry an episode, and their means."""

    __test__ = False  # no test case, whatever pytest thinks of the name

    goal: NDArray[np.float64]
    """Shape (episodes, joints) [counts]."""
    angle_begin: NDArray[np.float64]
    """Shape (episodes, joints) [counts]."""
    angle_end: NDArray[np.float64]
    """Shape (episodes, joints) [counts]."""
    velocity_end: NDArray[np.float64]
    """Shape (episodes, joints) [counts/ms]."""
    actions: NDArray[np.int64]
    """Shape (episodes,)."""
    switches: NDArray[np.int64]
    """Shape (episodes, joints)."""
    reward: NDArray[np.float64]
    """Sum of the rewards of an episode, shape (episodes,)."""
    success: NDArray[np.bool_]
    """Shape (episodes,)."""

    def results(self) -> dict[str, Any]:
        """Return what ``results.json`` holds of a test; ``switches`` is a list where there are several joints."""
        return summarise(self.reward, self.success, self.actions, self.switches)


def test(
    agent: Agent,
    simulation: Simulation,
    begin_states: BeginStates,
    episodes: int = 10_000,
    seed: int = 0,
) -> TestResult:
    """Let ``agent`` move greedily and without learning, from all begin states to all goals.

    Begin states and goals depend on ``seed`` alone, not on what the agent does, so rivals get the same ones.

    Raises:
        UnusableInput: the agent was made for an arm or a window of another kind, or there is no episode.

    """
    if agent.window != simulation.window:
        raise UnusableInput(f"an agent for {agent.window} cannot be tested on a simulation of {simulation.window}")
    scaling, other = agent.scaling, simulation.scaling
    if not all(np.array_equal(getattr(scaling, name), getattr(other, name)) for name in vars(scaling)):
        raise UnusableInput("the agent was trained in another simulation: its inputs are scaled differently")
    env = environment(simulation, begin_states, agent.settings)
    return run_test(env, agent.weights(), agent.settings, episodes, (seed, TEST))


test.__test__ = False  # type: ignore[attr-defined]


def run_test(
    env: Environment, weights: NDArray[np.float32], settings: TrainSettings, episodes: int, seed: tuple[int, ...]
) -> TestResult:
    """Test the networks ``weights`` in ``env``; begin states and goals are drawn by ``seed``, and so is the noise."""
    if episodes < 1:
        raise UnusableInput(f"a test needs at least one episode, got {episodes}")
    one = episode(env, random_state((*seed, NOISE)))
    record = movements(episodes, one.goal.size)
    test_episodes(env, learner(weights, settings), one, room(one), random_state(seed), record)
    return TestResult(*record)

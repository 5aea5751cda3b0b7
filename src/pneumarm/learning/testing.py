"""The testing phase of section 5.2: many greedy movements in the noisy simulation, nothing learned."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.learning.environment import Environment, episode
from pneumarm.learning.loop import Schedule, movements, room, test_episodes
from pneumarm.learning.settings import Exploration, TrainSettings
from pneumarm.learning.values import learner
from pneumarm.random import random_state
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


GREEDY = Exploration(epsilon=0.0)
"""No exploration."""


def run_test(
    env: Environment,
    weights: NDArray[np.float32],
    settings: TrainSettings,
    episodes: int,
    seed: tuple[int, ...],
    exploration: Exploration = GREEDY,
) -> TestResult:
    """Test the networks ``weights`` in ``env``; begin states and goals are drawn by ``seed``, and so is the noise."""
    if episodes < 1:
        raise UnusableInput(f"a test needs at least one episode, got {episodes}")
    one = episode(env, random_state((*seed, NOISE)))
    record = movements(episodes, one.goal.size)
    schedule = Schedule(np.inf, float(exploration.epsilon), float(exploration.temperature), 0.0)
    test_episodes(env, learner(weights, settings), schedule, one, room(one), random_state(seed), record)
    return TestResult(*record)

"""The testing phase of section 5.2: many greedy movements in the noisy simulation, nothing learned."""

import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.learning.online.loop import loop_workspace, test_episodes
from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.online.settings import Exploration, TrainSettings
from pneumarm.learning.online.values import learner
from pneumarm.random import random_state
from pneumarm.task.environment import Environment, episode
from pneumarm.task.movements import NOISE, Movements, movements

GREEDY = Exploration(epsilon=0.0)
"""No exploration."""


def run_test(
    env: Environment,
    weights: NDArray[np.float32],
    settings: TrainSettings,
    episodes: int,
    seed: tuple[int, ...],
    exploration: Exploration = GREEDY,
) -> Movements:
    """Test the networks ``weights`` in ``env``; begin states and goals are drawn by ``seed``, and so is the noise."""
    if episodes < 1:
        raise UnusableInput(f"a test needs at least one episode, got {episodes}")
    one = episode(env, random_state((*seed, NOISE)))
    record = movements(episodes, one.goal.size)
    schedule = Schedule(np.inf, float(exploration.epsilon), float(exploration.temperature), 0.0)
    acts = learner(weights, settings)
    test_episodes(env, acts, schedule, one, loop_workspace(acts, one.goal.size), random_state(seed), record)
    return record

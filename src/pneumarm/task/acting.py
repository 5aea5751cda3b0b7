"""The testing phase of section 5.2 for whatever acts step by step, compiled or not."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.errors import UnusableInput
from pneumarm.kernels import kernel
from pneumarm.random import random_state
from pneumarm.task.environment import Environment, angle, begin_episode, episode, take, velocity
from pneumarm.task.movements import NOISE, TestResult, movements


class Acting(Protocol):
    """What acts step by step."""

    def begin(self, state: ArrayLike, goal: ArrayLike) -> None:
        """Begin an episode at rest in the scaled ``state`` (state_size,) towards ``goal`` (joints,) [counts]."""

    def act(self) -> NDArray[np.int64]:
        """Return the actions (joints,) of the current state."""

    def follow(self, next_state: ArrayLike) -> None:
        """Go on in ``next_state`` without learning."""


@kernel
def _begin(environment, episode, random, angles):  # type: ignore[no-untyped-def]
    begin_episode(environment, episode, np.inf, random)
    for joint in range(angles.shape[0]):
        angles[joint] = angle(environment.task, episode, joint)


@kernel
def _take(environment, episode, actions, angles, velocities):  # type: ignore[no-untyped-def]
    is_reached = take(environment, episode, actions)
    for joint in range(angles.shape[0]):
        angles[joint] = angle(environment.task, episode, joint)
        velocities[joint] = velocity(environment.task, episode, joint)
    return is_reached


def test_acting(actor: Acting, env: Environment, episodes: int, seed: tuple[int, ...]) -> TestResult:
    """Return movements of ``actor`` in ``env`` with the begin states and goals that any agent gets by ``seed``.

    Raises:
        UnusableInput: there is no episode.

    """
    if episodes < 1:
        raise UnusableInput(f"a test needs at least one episode, got {episodes}")
    one, random, task = episode(env, random_state((*seed, NOISE))), random_state(seed), env.task
    record = movements(episodes, one.goal.size)
    size = env.begin.states.shape[1]
    for e in range(episodes):
        _begin(env, one, random, record.angle_begin[e])
        record.goal[e] = one.goal
        actor.begin(one.state.x[:size], one.goal)
        while not record.success[e] and record.actions[e] < task.cutoff:
            actions = actor.act()
            is_reached = _take(env, one, actions, record.angle_end[e], record.velocity_end[e])
            record.success[e] = is_reached
            record.actions[e] += 1
            record.switches[e] += one.switched
            record.reward[e] += task.reward_goal if is_reached else task.reward_action
            record.reward[e] += task.reward_switch * one.switched.sum()
            actor.follow(one.state.x[:size])
    return TestResult(*record)


test_acting.__test__ = False  # type: ignore[attr-defined]

"""The training loop and the test, compiled as one but made of parts.

The environment's step (:mod:`.environment`), the choice of the action (:mod:`.exploration`) and the learner's update
(:mod:`.values`) are functions of their own; another learner writes another loop of this size and copies nothing.

    begin an episode; choose a
    repeat: take a, see r and s'; choose a' in s'; update Q(s, a); s, a = s', a'
    until s' is a goal or the episode is cut off
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import ACTIONS
from pneumarm.kernels import part
from pneumarm.learning.online.exploration import choose, greedy
from pneumarm.learning.online.values import action_values, forget_traces, td_target, update
from pneumarm.task.environment import Episode, begin_episode, gained, take
from pneumarm.task.noting import goes_on, note_action, note_begin, note_end
from pneumarm.task.reward import paid


class Workspace(NamedTuple):
    """What a loop needs to remember from one step to the next. Made by :func:`workspace`."""

    before: NDArray[np.float32]
    """State vector before the action, shape (inputs,)."""
    values: NDArray[np.float32]
    """Action values, shape (9,)."""
    odds: NDArray[np.float32]
    """For exploring, shape (9,)."""
    actions: NDArray[np.int64]
    """Actions to take, shape (joints,)."""
    next_values: NDArray[np.float64]
    """Value that the target looks ahead to, shape (joints,)."""
    cut: NDArray[np.int64]
    """Whether the traces are cut, shape (joints,)."""
    next_actions: NDArray[np.int64]
    """Shape (joints,)."""


def workspace(episode: Episode) -> Workspace:
    """Return workspace for a loop on ``episode``."""
    return workspace_of(episode.goal.size, episode.state.x.size)


def workspace_of(joints: int, inputs: int) -> Workspace:
    """Return workspace for so many joints and inputs."""
    return Workspace(
        before=np.zeros(inputs, np.float32),
        values=np.zeros(ACTIONS, np.float32),
        odds=np.zeros(ACTIONS, np.float32),
        actions=np.full(joints, -1, np.int64),
        next_values=np.zeros(joints),
        cut=np.zeros(joints, np.int64),
        next_actions=np.full(joints, -1, np.int64),
    )


class Schedule(NamedTuple):
    """What shaping decides for the next episodes."""

    deviation: float
    """[counts]; infinite for all begin states alike."""
    epsilon: float
    temperature: float
    performance_rate: float
    """Weight of the newest episode in the performance."""
    enough: float = np.inf
    """Performance at which training episodes end early, looked at after every one of them."""


@part
def look_ahead(learner, schedule, x, workspace, random):  # type: ignore[no-untyped-def]
    """Choose the next actions in ``x`` and find the values that the targets look ahead to."""
    for joint in range(workspace.actions.shape[0]):
        action_values(learner, joint, x, workspace.values)
        chosen = choose(workspace.values, schedule.epsilon, schedule.temperature, workspace.odds, random)
        workspace.next_actions[joint] = chosen
        workspace.next_values[joint] = workspace.values[chosen]
        workspace.cut[joint] = 0
        if learner.off_policy:
            best = greedy(workspace.values)
            workspace.next_values[joint] = workspace.values[best]
            workspace.cut[joint] = 1 if chosen != best else 0


@part
def train_episode(environment, learner, schedule, episode, workspace):  # type: ignore[no-untyped-def]
    """Run one episode, learning; return actions taken, sum of rewards, and whether the goal was reached."""
    x, random, total = episode.state.x, episode.state.random, 0.0
    begin_episode(environment, episode, schedule.deviation, random)
    for joint in range(workspace.actions.shape[0]):
        forget_traces(learner, joint)
    look_ahead(learner, schedule, x, workspace, random)
    for k in range(environment.task.cutoff):
        for i in range(x.shape[0]):
            workspace.before[i] = x[i]
        for joint in range(workspace.actions.shape[0]):
            workspace.actions[joint] = workspace.next_actions[joint]
        is_reached = take(environment, episode, workspace.actions)
        if not is_reached:
            look_ahead(learner, schedule, x, workspace, random)
        total += gained(environment.task, episode, is_reached)
        for joint in range(workspace.actions.shape[0]):
            reward = paid(environment.task.reward, is_reached, episode.switched[joint])
            target = td_target(reward, learner.discount, workspace.next_values[joint], is_reached)
            update(learner, joint, workspace.before, workspace.actions[joint], target)
            if workspace.cut[joint]:
                forget_traces(learner, joint)
        if is_reached:
            return k + 1, total, True
    return environment.task.cutoff, total, False


@part
def train_episodes(environment, learner, schedule, episode, workspace, count, performance):  # type: ignore[no-untyped-def]
    """Run at most ``count`` episodes; return the performance (thesis eq. 4.14) after them, actions, and episodes."""
    steps = 0
    for e in range(count):
        actions, _, success = train_episode(environment, learner, schedule, episode, workspace)
        steps += actions
        performance += schedule.performance_rate * ((1.0 if success else 0.0) - performance)
        if performance >= schedule.enough:
            return performance, steps, e + 1
    return performance, steps, count


@part
def test_episodes(environment, learner, schedule, episode, workspace, random, record):  # type: ignore[no-untyped-def]
    """Fill ``record`` with episodes over all begin states and goals, drawn from ``random``.

    Actions are greedy where the epsilon of ``schedule`` is 0; else they explore, by random numbers of the episode.
    """
    task, x = environment.task, episode.state.x
    for e in range(record.actions.shape[0]):
        begin_episode(environment, episode, np.inf, random)
        note_begin(task, episode, record, e)
        is_reached = False
        while goes_on(task, is_reached, record, e):
            for joint in range(episode.goal.shape[0]):
                action_values(learner, joint, x, workspace.values)
                if schedule.epsilon == 0.0:
                    workspace.actions[joint] = greedy(workspace.values)
                else:
                    epsilon, temperature = schedule.epsilon, schedule.temperature
                    workspace.actions[joint] = choose(
                        workspace.values, epsilon, temperature, workspace.odds, episode.state.random
                    )
            is_reached = take(environment, episode, workspace.actions)
            note_action(task.reward, episode.switched, is_reached, record, e)
        note_end(task, episode, is_reached, record, e)

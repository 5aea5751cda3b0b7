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
from pneumarm.kernels import borrowed, kernel, part
from pneumarm.learning.online.exploration import choose, greedy
from pneumarm.learning.online.schedule import (
    Retry,
    begin_training,
    end_training,
    farthest,
    no_retry,
    note_distances,
    pay,
    schedule_here,
)
from pneumarm.learning.online.values import ActionValues, action_values, forget_traces, td_target, update
from pneumarm.task.environment import at_goal, begin_episode, gained, take
from pneumarm.task.noting import goes_on, note_action, note_begin, note_end


class Workspace(NamedTuple):
    """What a loop needs to remember from one step to the next. Made by :func:`loop_workspace`."""

    before: NDArray[np.float32]
    """State vector before the action, shape (inputs,)."""
    values: NDArray[np.float32]
    """Action values of an agent, shape (choices,)."""
    odds: NDArray[np.float32]
    """For exploring, same shape."""
    chosen: NDArray[np.int64]
    """What agents have chosen to be done now, shape (agents,)."""
    next_values: NDArray[np.float64]
    """Value that the target looks ahead to, shape (agents,)."""
    cut: NDArray[np.int64]
    """Whether the traces are cut, shape (agents,)."""
    next_chosen: NDArray[np.int64]
    """What agents have chosen to be done next, shape (agents,)."""
    next_actions: NDArray[np.int64]
    """The same as actions, shape (joints,)."""
    paid: NDArray[np.float64]
    """What each joint was paid for its last action, shape (joints,)."""
    there: NDArray[np.bool_]
    """Whether each joint is at its goal, shape (joints,); of interest only to agents with goals of their own."""
    retry: Retry


def loop_workspace(learner: ActionValues, joints: int) -> Workspace:
    """Return workspace for a loop in which ``learner`` moves so many joints."""
    agents, choices = learner.traced.shape
    return Workspace(
        before=np.zeros(learner.weights.shape[1] - 2, np.float32),
        values=np.zeros(choices, np.float32),
        odds=np.zeros(choices, np.float32),
        chosen=np.full(agents, -1, np.int64),
        next_values=np.zeros(agents),
        cut=np.zeros(agents, np.int64),
        next_chosen=np.full(agents, -1, np.int64),
        next_actions=np.full(joints, -1, np.int64),
        paid=np.zeros(joints),
        there=np.zeros(joints, np.bool_),
        retry=no_retry(joints),
    )


@part
def look_ahead(learner, schedule, x, workspace, random):  # type: ignore[no-untyped-def]
    """Choose the next actions in ``x`` and find the values that the targets look ahead to."""
    decide(learner, schedule, x, workspace, random)
    spread(workspace.next_chosen, workspace.next_actions)


@part
def decide(learner, schedule, x, workspace, random):  # type: ignore[no-untyped-def]
    """Let agents choose what to do next in ``x``."""
    for agent in range(workspace.next_chosen.shape[0]):
        action_values(learner, agent, x, workspace.values)
        chosen = choose(workspace.values, schedule.epsilon, schedule.temperature, workspace.odds, random)
        workspace.next_chosen[agent] = chosen
        workspace.next_values[agent] = workspace.values[chosen]
        workspace.cut[agent] = 0
        if learner.off_policy:
            best = greedy(workspace.values)
            workspace.next_values[agent] = workspace.values[best]
            workspace.cut[agent] = 1 if chosen != best else 0


@part(entry=True)
def spread(chosen, actions):  # type: ignore[no-untyped-def]
    """Set ``actions`` (joints,) to what their agents have ``chosen`` (agents,), see :mod:`.values`."""
    each = actions.shape[0] // chosen.shape[0]
    for agent in range(chosen.shape[0]):
        left = chosen[agent]
        for joint in range(agent * each, (agent + 1) * each):
            actions[joint] = left % ACTIONS
            left //= ACTIONS


@part
def learn(learner, workspace, is_reached):  # type: ignore[no-untyped-def]
    """Move the values of what was chosen towards their targets; the goal of all joints ``is_reached`` or not."""
    each = workspace.paid.shape[0] // workspace.chosen.shape[0]
    usual = learner.reward.goal if is_reached else learner.reward.action
    for agent in range(workspace.chosen.shape[0]):
        reward, is_over = workspace.paid[agent * each], is_reached
        for joint in range(agent * each + 1, (agent + 1) * each):
            reward += workspace.paid[joint] - usual  # the goal is paid for once, switches of all joints
        if learner.own and workspace.there[agent] and not is_reached:
            reward, is_over = reward + learner.reward.goal - learner.reward.action, True
        target = td_target(reward, learner.discount, workspace.next_values[agent], is_over)
        update(learner, agent, workspace.before, workspace.chosen[agent], target)
        if workspace.cut[agent]:
            forget_traces(learner, agent)


@part
def remember(workspace, x):  # type: ignore[no-untyped-def]
    """Remember the state ``x`` (inputs,) and what was chosen there."""
    for i in range(x.shape[0]):
        workspace.before[i] = x[i]
    for agent in range(workspace.chosen.shape[0]):
        workspace.chosen[agent] = workspace.next_chosen[agent]


@kernel(inline="always")
def train_episode(environment, learner, schedule, episode, workspace):  # type: ignore[no-untyped-def]
    """Run one episode, learning; return actions taken, sum of rewards, and whether the goal was reached."""
    x, random, total = episode.state.x, episode.state.random, 0.0
    task = environment.task
    begin_training(environment, episode, schedule, workspace.retry)
    for agent in range(workspace.chosen.shape[0]):
        forget_traces(learner, agent)
    look_ahead(learner, schedule_here(schedule, task, episode), x, workspace, random)
    for k in range(task.cutoff):
        remember(workspace, x)
        note_distances(task, episode, workspace.paid)
        is_reached = take(environment, episode, workspace.next_actions)
        if not is_reached:
            look_ahead(learner, schedule_here(schedule, task, episode), x, workspace, random)
        total += gained(task, episode, is_reached)
        pay(task, schedule, episode, is_reached, workspace.paid)
        for joint in range(episode.goal.shape[0]):
            workspace.there[joint] = at_goal(task, episode, joint)
        learn(learner, workspace, is_reached)
        if is_reached or farthest(task, episode) > schedule.stray:
            return k + 1, total, is_reached
    return task.cutoff, total, False


@part(entry=True)
def train_episodes(environment, learner, schedule, episode, workspace, count, performance):  # type: ignore[no-untyped-def]
    """Run at most ``count`` episodes; return the performance (thesis eq. 4.14) after them, actions, and episodes."""
    environment, learner, episode, workspace = borrowed((environment, learner, episode, workspace))
    steps = 0
    for e in range(count):
        actions, _, success = train_episode(environment, learner, schedule, episode, workspace)
        end_training(environment.task, episode, schedule, workspace.retry, success)
        steps += actions
        performance += schedule.performance_rate * ((1.0 if success else 0.0) - performance)
        if performance >= schedule.enough:
            return performance, steps, e + 1
    return performance, steps, count


@part(entry=True)
def test_episodes(environment, learner, schedule, episode, workspace, random, record):  # type: ignore[no-untyped-def]
    """Fill ``record`` with episodes over all begin states and goals, drawn from ``random``.

    Actions are greedy where the epsilon of ``schedule`` is 0; else they explore, by random numbers of the episode.
    """
    environment, learner, episode = borrowed(environment), borrowed(learner), borrowed(episode)
    workspace, random, record = borrowed(workspace), borrowed(random), borrowed(record)
    task, x = environment.task, episode.state.x
    for e in range(record.actions.shape[0]):
        begin_episode(environment, episode, np.inf, random)
        note_begin(task, episode, record, e)
        is_reached = False
        while goes_on(task, is_reached, record, e):
            for agent in range(workspace.chosen.shape[0]):
                action_values(learner, agent, x, workspace.values)
                if schedule.epsilon == 0.0:
                    workspace.chosen[agent] = greedy(workspace.values)
                else:
                    epsilon, temperature = schedule.epsilon, schedule.temperature
                    workspace.chosen[agent] = choose(
                        workspace.values, epsilon, temperature, workspace.odds, episode.state.random
                    )
            spread(workspace.chosen, workspace.next_actions)
            is_reached = take(environment, episode, workspace.next_actions)
            note_action(task.reward, episode.switched, is_reached, record, e)
        note_end(task, episode, is_reached, record, e)

"""The loops of training and testing on the simulated arm, compiled as one for all rules and approximators."""

import numpy as np

from pneumarm.kernels import borrowed, kernel, part
from pneumarm.learning.online.exploration import greedy
from pneumarm.learning.values.learner import begin_acting, decide, end_episode, learn, remember, weigh
from pneumarm.task.environment import begin_episode, take
from pneumarm.task.noting import goes_on, note_action, note_begin, note_end
from pneumarm.task.reward import paid


@part
def train_episode(environment, learner, schedule, episode, memory):  # type: ignore[no-untyped-def]
    """Run one episode, learning; return actions taken and whether the goal was reached."""
    x, random = episode.state.x, episode.state.random
    begin_episode(environment, episode, schedule.deviation, random)
    begin_acting(learner, schedule, x, memory, random)
    for k in range(environment.task.cutoff):
        remember(memory, x)
        is_reached = take(environment, episode, memory.next_chosen)
        if not is_reached:
            decide(learner, schedule, x, memory, random)
        for joint in range(episode.goal.shape[0]):
            memory.paid[joint] = paid(environment.task.reward, is_reached, episode.switched[joint])
        learn(learner, schedule, memory, is_reached)
        if is_reached:
            return k + 1, True
    end_episode(learner, memory)
    return environment.task.cutoff, False


@kernel
def train_episodes(environment, learner, schedule, episode, memory, count, performance):  # type: ignore[no-untyped-def]
    """Run at most ``count`` episodes; return the performance (thesis eq. 4.14) after them, actions, and episodes."""
    environment, learner, episode, memory = borrowed((environment, learner, episode, memory))
    steps = 0
    for e in range(count):
        actions, success = train_episode(environment, learner, schedule, episode, memory)
        steps += actions
        performance += schedule.performance_rate * ((1.0 if success else 0.0) - performance)
        if performance >= schedule.enough:
            return performance, steps, e + 1
    return performance, steps, count


@kernel
def test_episodes(environment, learner, episode, memory, random, record):  # type: ignore[no-untyped-def]
    """Fill ``record`` with greedy episodes over all begin states and goals, drawn from ``random``."""
    environment, learner, episode = borrowed(environment), borrowed(learner), borrowed(episode)
    memory, random, record = borrowed(memory), borrowed(random), borrowed(record)
    task, x, values = environment.task, episode.state.x, memory.values
    for e in range(record.actions.shape[0]):
        begin_episode(environment, episode, np.inf, random)
        note_begin(task, episode, record, e)
        is_reached = False
        while goes_on(task, is_reached, record, e):
            for agent in range(memory.chosen.shape[0]):
                weigh(learner, agent, x, episode.actions, memory.z, values)
                memory.chosen[agent] = greedy(values)
            is_reached = take(environment, episode, memory.chosen)
            note_action(task.reward, episode.switched, is_reached, record, e)
        note_end(task, episode, is_reached, record, e)


test_episodes.__test__ = False

"""The loops of training and testing on the simulated arm, compiled as one for all rules and approximators."""

import numpy as np

from pneumarm.kernels import borrowed, kernel
from pneumarm.learning.online.exploration import greedy
from pneumarm.learning.online.schedule import (
    begin_training,
    end_training,
    farthest,
    note_distances,
    pay,
    schedule_here,
)
from pneumarm.learning.values.learner import begin_learning, decide, end_episode, learn, remember, weigh
from pneumarm.task.environment import begin_episode, take
from pneumarm.task.noting import goes_on, note_action, note_begin, note_end


@kernel
def train_episodes(environment, learner, schedule, episode, memory, count, performance):  # type: ignore[no-untyped-def]
    """Run at most ``count`` episodes; return the performance (thesis eq. 4.14) after them, actions, and episodes.

    What is long to compile stands here once: an episode begins, and goes on, with a choice.
    """
    environment, learner, episode, memory = borrowed((environment, learner, episode, memory))
    x, random, steps, episodes, task = episode.state.x, episode.state.random, 0, 0, environment.task
    for _ in range(count):
        begin_training(environment, episode, schedule, memory.retry)
        memory.next_actions[:] = -1
        begin_learning(learner, memory)
        is_reached, taken = False, 0
        while True:
            if not is_reached:
                decide(learner, schedule_here(schedule, task, episode), x, memory, random)
            if taken > 0:
                learn(learner, schedule, memory, is_reached)
            if is_reached or taken == task.cutoff or farthest(task, episode) > schedule.stray:
                break
            remember(memory, x)
            note_distances(task, episode, memory.paid)
            is_reached = take(environment, episode, memory.next_actions)
            pay(task, schedule, episode, is_reached, memory.paid)
            taken += 1
        end_training(task, episode, schedule, memory.retry, is_reached)
        steps, episodes = steps + taken, episodes + 1
        performance += schedule.performance_rate * ((1.0 if is_reached else 0.0) - performance)
        if performance >= schedule.enough:
            break
    end_episode(learner, memory)
    return performance, steps, episodes


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

"""What is decided for the next training episodes, and the help that it gives (sections 4.2.2, 4.3.2, 4.3.3).

    begin as the last failed episode began, now and then
    explore less where the arm is near to its goal than where it has strayed
    pay for what an action brings nearer; cut off who strays too far

Both training loops, of the thesis' networks and of all other values, are made of these parts. Without help they are
what they were: the same random numbers are drawn, and the same is paid.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import part
from pneumarm.random import uniform
from pneumarm.task.environment import angle, at_goal, begin_episode
from pneumarm.task.reward import paid


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
    near_epsilon: float = -1.0
    """What ``epsilon`` is within the deviation of the goal; negative where it is the same everywhere."""
    stray: float = np.inf
    """Distance from the goal at which an episode is cut off [counts]."""
    local: float = 0.0
    """Paid to a joint for each count that it comes nearer to its goal."""
    retry: float = 0.0
    """Probability that what failed is begun again."""


class Retry(NamedTuple):
    """How an episode began that may be begun again, and how each joint does. Made by :func:`no_retry`."""

    random: NDArray[np.uint64]
    """The random numbers that its goal and begin state were drawn by, and workspace, shape (2, 4)."""
    is_failed: NDArray[np.bool_]
    """Whether it failed, shape (1,)."""
    performance: NDArray[np.float64]
    """Moving average by joint of being at its goal in the end, shape (joints,)."""


def no_retry(joints: int) -> Retry:
    """Return that no episode has failed, of an arm with so many ``joints``."""
    return Retry(np.zeros((2, 4), np.uint64), np.zeros(1, np.bool_), np.zeros(joints))


@part
def begin_training(environment, episode, schedule, retry):  # type: ignore[no-untyped-def]
    """Begin an episode, or if the last one failed, with the probability of ``schedule`` that one again."""
    random = episode.state.random
    if schedule.retry > 0.0 and retry.is_failed[0] and uniform(random) < schedule.retry:
        retry.random[1] = retry.random[0]
        begin_episode(environment, episode, schedule.deviation, retry.random[1])
        return
    retry.random[0] = random
    begin_episode(environment, episode, schedule.deviation, random)


@part
def end_training(task, episode, schedule, retry, is_reached):  # type: ignore[no-untyped-def]
    """Note how an episode ended: whether it failed, and which joints are at their goals."""
    retry.is_failed[0] = not is_reached
    for joint in range(retry.performance.shape[0]):
        there = 1.0 if at_goal(task, episode, joint) else 0.0
        retry.performance[joint] += schedule.performance_rate * (there - retry.performance[joint])


@part
def schedule_here(schedule, task, episode):  # type: ignore[no-untyped-def]
    """Return ``schedule`` with the exploration where the arm is: in full at twice the deviation (section 4.3.3)."""
    if schedule.near_epsilon < 0.0:
        return schedule
    beyond = max(0.0, farthest(task, episode) / schedule.deviation - 1.0)
    epsilon = schedule.near_epsilon + min(1.0, beyond) * (schedule.epsilon - schedule.near_epsilon)
    return Schedule(
        schedule.deviation,
        epsilon,
        schedule.temperature,
        schedule.performance_rate,
        schedule.enough,
        schedule.near_epsilon,
        schedule.stray,
        schedule.local,
        schedule.retry,
    )


@part
def farthest(task, episode):  # type: ignore[no-untyped-def]
    """Return how far the joint that is farthest from its goal is from it [counts]."""
    most = 0.0
    for joint in range(episode.goal.shape[0]):
        most = max(most, abs(angle(task, episode, joint) - episode.goal[joint]))
    return most


@part
def note_distances(task, episode, distances):  # type: ignore[no-untyped-def]
    """Set ``distances`` (joints,) to how far joints are from their goals [counts], for :func:`pay`."""
    for joint in range(distances.shape[0]):
        distances[joint] = abs(angle(task, episode, joint) - episode.goal[joint])


@part
def pay(task, schedule, episode, is_reached, distances):  # type: ignore[no-untyped-def]
    """Set the ``distances`` (joints,) before the last action to what each joint is paid for it."""
    for joint in range(distances.shape[0]):
        nearer = distances[joint] - abs(angle(task, episode, joint) - episode.goal[joint])
        distances[joint] = paid(task.reward, is_reached, episode.switched[joint]) + schedule.local * nearer

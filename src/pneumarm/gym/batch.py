"""Many simulated movements in one compiled step."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import kernel, part
from pneumarm.random import random_state
from pneumarm.simulation.kernel import SimulationState
from pneumarm.task.environment import (
    CUT_OFF,
    GOES_ON,
    REACHED,
    Environment,
    Episode,
    begin_episode,
    ending,
    episode,
    gained,
    take,
)


class SimulatedArms(NamedTuple):
    """``n`` movements, and workspace for as many threads as work on them. Made by :func:`simulated_arms`."""

    x: NDArray[np.float32]
    """State vectors, see :mod:`pneumarm.simulation.kernel`, shape (n, inputs)."""
    average: NDArray[np.float32]
    """Moving averages of the noise, shape (n, outputs)."""
    random: NDArray[np.uint64]
    """Shape (n, 4)."""
    goal: NDArray[np.float64]
    """Shape (n, joints) [counts]."""
    actions: NDArray[np.int64]
    """The last actions, -1 before the first, shape (n, joints)."""
    switched: NDArray[np.int64]
    """Whether the last action of each joint was a switch, shape (n, joints)."""
    taken: NDArray[np.int64]
    """Actions taken in the running movement, -1 where it ended and none was begun, shape (n,)."""
    hidden: NDArray[np.float32]
    """Workspace, shape (threads, units)."""
    second: NDArray[np.float32]
    """Workspace, shape (threads, second units)."""
    change: NDArray[np.float32]
    """Workspace, shape (threads, outputs)."""
    command: NDArray[np.float32]
    """Workspace, shape (threads, 2 joints)."""


class Outcome(NamedTuple):
    """What a step led to. Made by :func:`outcome`."""

    observation: NDArray[np.float32]
    """Scaled states with goals, shape (n, state_size + joints)."""
    reward: NDArray[np.float64]
    """Shape (n,)."""
    terminated: NDArray[np.bool_]
    """Whether the goal is reached, shape (n,)."""
    truncated: NDArray[np.bool_]
    """Whether the movement was cut off, shape (n,)."""
    final: NDArray[np.float32]
    """Observations at the end of movements that were followed by a new one in the same step, as ``observation``."""


def simulated_arms(environment: Environment, n: int, threads: int) -> SimulatedArms:
    """Return workspace for ``n`` movements in ``environment``; none has begun."""
    one = episode(environment, random_state(0))
    joints = one.goal.size
    return SimulatedArms(
        x=np.tile(one.state.x, (n, 1)),
        average=np.zeros((n, one.state.average.size), np.float32),
        random=np.zeros((n, 4), np.uint64),
        goal=np.zeros((n, joints)),
        actions=np.full((n, joints), -1, np.int64),
        switched=np.zeros((n, joints), np.int64),
        taken=np.full(n, -1, np.int64),
        hidden=np.zeros((threads, one.state.hidden.size), np.float32),
        second=np.zeros((threads, one.state.second.size), np.float32),
        change=np.zeros((threads, one.state.change.size), np.float32),
        command=np.zeros((threads, one.command.size), np.float32),
    )


def outcome(n: int, size: int) -> Outcome:
    """Return workspace for the outcome of a step of ``n`` movements with observations of ``size``."""
    return Outcome(
        observation=np.zeros((n, size), np.float32),
        reward=np.zeros(n),
        terminated=np.zeros(n, bool),
        truncated=np.zeros(n, bool),
        final=np.zeros((n, size), np.float32),
    )


@part
def as_episode(many, e, thread):  # type: ignore[no-untyped-def]
    """Return movement ``e`` as an episode; for other parts only, because no references are counted."""
    state = SimulationState(
        many.x[e], many.average[e], many.random[e], many.hidden[thread], many.second[thread], many.change[thread]
    )
    return Episode(state, many.goal[e], many.actions[e], many.switched[e], many.command[thread])


@part
def write_observation(environment, many, e, observations):  # type: ignore[no-untyped-def]
    """Write state and goal of movement ``e`` into ``observations`` (n, state_size + joints)."""
    joints = many.goal.shape[1]
    size = observations.shape[1] - joints
    for i in range(size):
        observations[e, i] = many.x[e, i]
    for j in range(joints):
        observations[e, size + j] = many.x[e, environment.task.layout.goal + j]


@part
def begin_movement(environment, many, e, thread):  # type: ignore[no-untyped-def]
    """Begin movement ``e`` at any begin state, with any goal."""
    one = as_episode(many, e, thread)
    begin_episode(environment, one, np.inf, one.state.random)
    many.taken[e] = 0


@part
def act(environment, many, e, thread, actions, result):  # type: ignore[no-untyped-def]
    """Take ``actions`` (n, joints) in movement ``e``; return whether it ended."""
    one, task = as_episode(many, e, thread), environment.task
    is_reached = take(environment, one, actions[e])
    many.taken[e] += 1
    ended = ending(task, is_reached, many.taken[e])
    result.reward[e] = gained(task, one, is_reached)
    result.terminated[e] = ended == REACHED
    result.truncated[e] = ended == CUT_OFF
    return ended != GOES_ON


@part
def act_or_begin(environment, many, e, thread, actions, same_step, result):  # type: ignore[no-untyped-def]
    """Let movement ``e`` act, or begin anew if it has ended."""
    if many.taken[e] < 0:
        begin_movement(environment, many, e, thread)
        result.reward[e] = 0.0
        result.terminated[e] = result.truncated[e] = False
    elif act(environment, many, e, thread, actions, result):
        if same_step:
            write_observation(environment, many, e, result.final)
            begin_movement(environment, many, e, thread)
        else:
            many.taken[e] = -1
    write_observation(environment, many, e, result.observation)


@kernel
def begin_batch(environment, many, first, last, thread, chosen, observations):  # type: ignore[no-untyped-def]
    """Begin those movements of ``first`` to ``last`` that are ``chosen`` (n,)."""
    for e in range(first, last):
        if chosen[e]:
            begin_movement(environment, many, e, thread)
            write_observation(environment, many, e, observations)


@kernel
def step_batch(environment, many, first, last, thread, actions, same_step, result):  # type: ignore[no-untyped-def]
    """Take ``actions`` (n, joints) in the movements ``first`` to ``last``.

    A movement that ended is followed by a new one in the same step, its last observation going to ``result.final``,
    or with ``same_step`` false in the next step, whose action is ignored then.
    """
    for e in range(first, last):
        act_or_begin(environment, many, e, thread, actions, same_step, result)

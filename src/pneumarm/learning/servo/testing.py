"""A servo's test in the simulation, to reach goals: those of every baseline, many movements side by side."""

import numpy as np

from pneumarm.errors import UnusableInput
from pneumarm.kernels import kernel
from pneumarm.learning.network_agent import NetworkAgent
from pneumarm.learning.servo.actor import ServoNetwork
from pneumarm.random import random_state, random_states
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import begin_episode, environment, order_pulses, reached
from pneumarm.task.fleet import advance_alive, fleet, one
from pneumarm.task.movements import NOISE, Movements, movements
from pneumarm.task.noting import goes_on, note_action, note_begin, note_end

_TOGETHER = 64
"""Arms that move at once; where one has ended a movement it begins the next."""


def run_servo(
    agent: NetworkAgent, simulation: Simulation, begin: BeginStates, episodes: int, seed: tuple[int, ...]
) -> Movements:
    """Return ``episodes`` greedy movements of ``agent`` in ``simulation``.

    ``seed`` decides begin states and goals alone, as in :func:`pneumarm.learning.test`.
    """
    if episodes < 1:
        raise UnusableInput(f"a test needs at least one episode, got {episodes}")
    env, n = environment(simulation, begin, agent.settings), min(episodes, _TOGETHER)
    random, arms = random_state(seed), fleet(env, random_states((*seed, NOISE), n))
    network, joints, place = ServoNetwork(agent, n), simulation.window.joints, env.task.layout.goal
    underway = np.zeros((joints, n), bool)
    previews = np.zeros((network.task.inputs.steps.size, joints, n), np.float32)
    record, number = movements(episodes, joints), np.full(n, -1)
    begun = _begin(env, arms, random, record, number, 0)
    while (number >= 0).any():
        previews[:] = arms.x[place : place + joints]
        pulses = network.command(arms.x, previews, underway).T.reshape(n, joints, 2)
        _take(env, arms, pulses.astype(np.float64), record, number)
        begun = _begin(env, arms, random, record, number, begun)
    return record


@kernel
def _begin(environment, arms, random, record, number, begun):  # type: ignore[no-untyped-def]
    """Let arms begin movements from ``begun`` on where they make none; return how many have begun then.

    ``number`` (n,) tells which movement each arm makes, -1 being none.
    """
    for e in range(number.shape[0]):
        if number[e] < 0 and begun < record.success.shape[0]:
            arm = one(arms, e)
            begin_episode(environment, arm, np.inf, random)
            note_begin(environment.task, arm, record, begun)
            number[e] = begun
            begun += 1
    return begun


@kernel
def _take(environment, arms, pulses, record, number):  # type: ignore[no-untyped-def]
    """Take ``pulses`` (n, joints, 2) for a period where there is a movement, and note which end."""
    task, alive = environment.task, number >= 0
    for e in range(number.shape[0]):
        if alive[e]:
            order_pulses(task, one(arms, e), pulses[e])
    advance_alive(environment, arms, alive)
    for e in range(number.shape[0]):
        if alive[e]:
            arm = one(arms, e)
            is_reached = reached(task, arm)
            note_action(task.reward, arm.switched, is_reached, record, number[e])
            if not goes_on(task, is_reached, record, number[e]):
                note_end(task, arm, is_reached, record, number[e])
                number[e] = -1

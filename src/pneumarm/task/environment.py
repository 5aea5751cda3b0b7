"""The simulated task that an agent learns: begin states, goals, the effect of actions, and when a goal is reached.

Any learner can be run on it: it knows nothing of action values. ``begin_episode`` and ``take`` are all that a
learner calls; both work on one :class:`Episode`, of which there can be as many as one wants.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import ACTIONS, VALVES
from pneumarm.errors import UnusableInput
from pneumarm.kernels import part
from pneumarm.random import RandomState, uniform
from pneumarm.simulation.kernel import (
    SimulationParameters,
    SimulationState,
    begin,
    simulation_parameters,
    simulation_state,
    step,
)
from pneumarm.simulation.layout import Layout, angle_at, layout_of, velocity_at
from pneumarm.simulation.noise import NoiseParameters, noise_parameters
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginParameters, BeginStates, begin_parameters, draw_begin
from pneumarm.task.reward import RewardParameters, has_reached, is_switch, paid
from pneumarm.task.settings import TaskSettings

_TRIES = 100  # draws until a goal is taken whatever it is
GOES_ON, REACHED, CUT_OFF = 0, 1, 2
"""How an episode is after an action."""


class Task(NamedTuple):
    """What is asked of the arm, in sensor units unless it says scaled."""

    goal_range: NDArray[np.float64]
    """Goals are uniform between these, shape (joints, 2) [counts] ..."""
    goal_ways: NDArray[np.float64]
    """... and keep the limits of these sums, see :class:`~pneumarm.transitions.goals.Goals`, shape (k, joints)."""
    goal_limits: NDArray[np.float64]
    """Shape (k, 2)."""
    unit: NDArray[np.float64]
    """Offset and scale of angle and velocity, shape (joints, 4): angle, angle, velocity, velocity."""
    commands: NDArray[np.float32]
    """Scaled commands by action, shape (joints, 9, 2)."""
    layout: Layout
    """Of the state vector."""
    reward: RewardParameters
    cutoff: int


class Environment(NamedTuple):
    """Everything about the simulated arm and the task that does not change."""

    simulation: SimulationParameters
    noise: NoiseParameters
    begin: BeginParameters
    task: Task


class Episode(NamedTuple):
    """What changes during an episode."""

    state: SimulationState
    goal: NDArray[np.float64]
    """Shape (joints,) [counts]."""
    actions: NDArray[np.int64]
    """The last actions, -1 before the first, shape (joints,)."""
    switched: NDArray[np.int64]
    """Whether the last action of each joint was a switch, shape (joints,)."""
    command: NDArray[np.float32]
    """Workspace, shape (2 joints,)."""


def environment(simulation: Simulation, begin: BeginStates, settings: TaskSettings) -> Environment:
    """Return the task of ``settings`` on ``simulation``.

    Raises:
        UnusableInput: the begin states are not of this simulation, or it has no valves.

    """
    if not simulation.valves:
        raise UnusableInput(
            "the simulation was fitted to continuous commands; an agent needs one fitted to valves (-1, 0, +1)"
        )
    if begin.window != simulation.window:
        raise UnusableInput(f"begin states of {begin.window} cannot be used with a simulation of {simulation.window}")
    window, scaling = simulation.window, simulation.scaling
    offset, scale = window.of_joints(scaling.observation_offset), window.of_joints(scaling.observation_scale)
    commands = VALVES[None] / scaling.command_scale.reshape(window.joints, 1, 2)
    commands[..., simulation.spec.muscles :] = 0.0
    goals = settings.goals_in(simulation)
    task = Task(
        goal_range=np.ascontiguousarray(goals.range, np.float64),
        goal_ways=np.ascontiguousarray(goals.ways, np.float64),
        goal_limits=np.ascontiguousarray(goals.limits, np.float64),
        unit=np.ascontiguousarray(np.stack([offset[:, 0], scale[:, 0], offset[:, 1], scale[:, 1]], axis=1)),
        commands=np.ascontiguousarray(commands, np.float32),
        layout=layout_of(simulation.window),
        reward=settings.reward.on(simulation.spec).parameters,
        cutoff=int(settings.cutoff),
    )
    return Environment(
        simulation=simulation_parameters(simulation),
        noise=noise_parameters(settings.noise, simulation),
        begin=begin_parameters(begin, simulation.spec.angle_range, settings.begin_weights, settings.by_length),
        task=task,
    )


def episode(environment: Environment, random: RandomState) -> Episode:
    """Return workspace for episodes in ``environment`` that draw from ``random``."""
    joints = environment.simulation.layout.joints
    return Episode(
        state=simulation_state(environment.simulation, random),
        goal=np.zeros(joints),
        actions=np.full(joints, -1, np.int64),
        switched=np.zeros(joints, np.int64),
        command=np.zeros(2 * joints, np.float32),
    )


@part
def begin_episode(environment, episode, deviation, random):  # type: ignore[no-untyped-def]
    """Draw goals and a begin state within ``deviation`` [counts] of them from ``random``, and put the arm there."""
    task = environment.task
    for _ in range(_TRIES):
        for joint in range(episode.goal.shape[0]):
            low, high = task.goal_range[joint, 0], task.goal_range[joint, 1]
            episode.goal[joint] = low + (high - low) * uniform(random)
        if is_goal(task.goal_ways, task.goal_limits, episode.goal):
            break
    for joint in range(episode.goal.shape[0]):
        episode.actions[joint] = -1
        scaled = (episode.goal[joint] - task.unit[joint, 0]) / task.unit[joint, 1]
        episode.state.x[task.layout.goal + joint] = np.float32(scaled)
    index = draw_begin(environment.begin, episode.goal, deviation, random)
    begin(environment.simulation, environment.noise, episode.state, environment.begin.states[index])


@part
def is_goal(ways, limits, goal):  # type: ignore[no-untyped-def]
    """Return whether ``goal`` (joints,) keeps all ``limits`` (k, 2) of sums by ``ways`` (k, joints)."""
    for k in range(ways.shape[0]):
        total = 0.0
        for joint in range(goal.shape[0]):
            total += ways[k, joint] * goal[joint]
        if total < limits[k, 0] or total > limits[k, 1]:
            return False
    return True


@part
def order(task, episode, actions):  # type: ignore[no-untyped-def]
    """Make ``actions`` (joints,) the command of ``episode``. Notes who switched."""
    for joint in range(actions.shape[0]):
        action = actions[joint]
        episode.switched[joint] = 1 if is_switch(episode.actions[joint], action) else 0
        episode.actions[joint] = action
        episode.command[2 * joint] = task.commands[joint, action, 0]
        episode.command[2 * joint + 1] = task.commands[joint, action, 1]


@part
def take(environment, episode, actions):  # type: ignore[no-untyped-def]
    """Take ``actions`` (joints,) for a period; return whether the goals are reached."""
    order(environment.task, episode, actions)
    step(environment.simulation, environment.noise, episode.state, episode.command)
    return reached(environment.task, episode)


@part
def order_pulses(task, episode, pulses):  # type: ignore[no-untyped-def]
    """Do what :func:`order` does with ``pulses`` (joints, 2); a switch is a joint's other pulses than before."""
    for joint in range(pulses.shape[0]):
        differs = False
        for muscle in range(2):
            whole = task.commands[joint, ACTIONS - 1, muscle]  # both inlets open for the whole period
            command = np.float32(pulses[joint, muscle]) * whole
            differs = differs or command != episode.command[2 * joint + muscle]
            episode.command[2 * joint + muscle] = command
        episode.switched[joint] = 1 if episode.actions[joint] >= 0 and differs else 0
        episode.actions[joint] = 0  # no longer the first


@part
def take_pulses(environment, episode, pulses):  # type: ignore[no-untyped-def]
    """Do what :func:`take` does with ``pulses`` (joints, 2)."""
    order_pulses(environment.task, episode, pulses)
    step(environment.simulation, environment.noise, episode.state, episode.command)
    return reached(environment.task, episode)


@part
def angle(task, episode, joint):  # type: ignore[no-untyped-def]
    """Return the angle of ``joint`` [counts]."""
    return task.unit[joint, 0] + task.unit[joint, 1] * episode.state.x[angle_at(task.layout, 0, joint)]


@part
def velocity(task, episode, joint):  # type: ignore[no-untyped-def]
    """Return the velocity of ``joint`` [counts/ms]."""
    return task.unit[joint, 2] + task.unit[joint, 3] * episode.state.x[velocity_at(task.layout, 0, joint)]


@part
def at_goal(task, episode, joint):  # type: ignore[no-untyped-def]
    """Return whether ``joint`` is at its goal and slow (thesis eq. 5.1, 5.2)."""
    return has_reached(task.reward, angle(task, episode, joint), velocity(task, episode, joint), episode.goal[joint])


@part
def reached(task, episode):  # type: ignore[no-untyped-def]
    """Return whether every joint is at its goal and slow."""
    are_all = True
    for joint in range(episode.goal.shape[0]):
        are_all = are_all and at_goal(task, episode, joint)
    return are_all


@part
def gained(task, episode, is_reached):  # type: ignore[no-untyped-def]
    """Return what all joints together are paid for the last action of ``episode``."""
    switches = 0
    for joint in range(episode.switched.shape[0]):
        switches += episode.switched[joint]
    return paid(task.reward, is_reached, switches)


@part
def ending(task, is_reached, taken):  # type: ignore[no-untyped-def]
    """Return how an episode is after ``taken`` actions: :data:`GOES_ON`, :data:`REACHED` or :data:`CUT_OFF`."""
    if is_reached:
        return REACHED
    return CUT_OFF if taken >= task.cutoff else GOES_ON

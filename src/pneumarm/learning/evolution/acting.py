"""Recurrent networks moving simulated arms: what they see, which valves they open, and what they earn."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import action_of
from pneumarm.kernels import inner, kernel, part
from pneumarm.learning.evolution.recurrent import forget, memory_of, recur
from pneumarm.learning.evolution.settings import EvolutionSettings
from pneumarm.networks.tansig import tansig
from pneumarm.simulation.layout import angle_at, layout_of
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import GOES_ON, Environment, begin_episode, ending, environment
from pneumarm.task.fleet import Fleet, Limits, begin_one, fleet, gained_by, limits, one, take_alive
from pneumarm.task.noting import note_alive, note_begin
from pneumarm.transitions.window import Window

_OPEN = np.float32(1 / 3)  # output beyond which a valve is open: inlet, closed and outlet get a third each
_action_of = part(action_of)


class World(NamedTuple):
    """The task, and what networks see and do in it. Made by :func:`world`."""

    environment: Environment
    limits: Limits
    seen: NDArray[np.int64]
    """Places in the state vector that networks see, shape (n,)."""
    gain: NDArray[np.float32]
    """Of the errors that they see, tansig(gain (goal - angle)), shape (joints, errors) [by scaled angle]."""
    muscles: int
    """Muscles of each joint."""
    recurrent: bool


class Arms(NamedTuple):
    """Simulated arms that networks move, so many each, side by side. Made by :func:`arms_of`."""

    fleet: Fleet
    seen: NDArray[np.float32]
    """What the networks see, see :func:`~.recurrent.memory_of`, shape (networks, inputs + units, arms)."""
    units: NDArray[np.float32]
    """Shape (networks, units, arms)."""
    actions: NDArray[np.int64]
    """Shape (networks arms, joints)."""
    is_reached: NDArray[np.bool_]
    """Shape (networks arms,)."""
    alive: NDArray[np.bool_]
    """Whether the episode goes on, same shape."""


def seen_places(window: Window, settings: EvolutionSettings) -> NDArray[np.int64]:
    """Return the places in the state vector that networks see: of sigma as the settings say, and the goals."""
    layout = layout_of(window)
    joint_size, observed = window.joint_size, window.observation_size
    places = []
    for place in range(layout.command):
        lag, quantity = divmod(place, observed)
        is_command = lag >= window.history
        if (lag > 0 or is_command) and not settings.history:
            continue
        if not is_command and quantity < joint_size:
            kind = quantity % 4
            if (kind == 1 and not settings.velocity) or (kind > 1 and not settings.pressures):
                continue
        places.append(place)
    return np.array([*places, *range(layout.goal, layout.goal + window.joints)], np.int64)


def input_count(window: Window, settings: EvolutionSettings) -> int:
    """Return how many inputs networks have: what they see of the state, errors, and a 1."""
    return len(seen_places(window, settings)) + window.joints * len(settings.squash) + 1


def world(simulation: Simulation, begin: BeginStates | None, settings: EvolutionSettings) -> World:
    """Return the task of ``settings`` on ``simulation``; without ``begin`` states no episode can begin by itself."""
    window, spec = simulation.window, simulation.spec
    nowhere = BeginStates(window, np.zeros((0, window.state_size), np.float32), np.zeros((0, window.joints)))
    scale = window.of_joints(simulation.scaling.observation_scale)[:, :1]
    return World(
        environment=environment(simulation, begin or nowhere, settings),
        limits=limits(simulation, settings.reward.angle_tolerance, patience=0),
        seen=seen_places(window, settings),
        gain=np.ascontiguousarray(scale / (np.array(settings.squash) * spec.angle_unit), np.float32),
        muscles=int(spec.muscles),
        recurrent=settings.recurrent,
    )


def arms_of(world: World, networks: int, units: int, arms: int) -> Arms:
    """Return workspace for so many ``networks`` of so many ``units`` in so many ``arms`` each."""
    joints = world.environment.simulation.layout.joints
    inputs, total = len(world.seen) + world.gain.size + 1, networks * arms
    seen, hidden = memory_of(networks, inputs, units, arms)
    return Arms(
        fleet=fleet(world.environment, np.zeros((total, 4), np.uint64)),
        seen=seen,
        units=hidden,
        actions=np.zeros((total, joints), np.int64),
        is_reached=np.zeros(total, np.bool_),
        alive=np.zeros(total, np.bool_),
    )


@inner
def choose_valves(world, network, arms, g):  # type: ignore[no-untyped-def]
    """Let ``network`` (units, genes), the one at place ``g``, choose the actions of its ``arms``."""
    seen, units, x, layout = arms.seen[g], arms.units[g], arms.fleet.x, world.limits.layout
    n = units.shape[1]
    first, row = g * n, 0
    for place in world.seen:
        seen[row] = x[place, first : first + n]
        row += 1
    for joint in range(world.gain.shape[0]):
        angle, goal = x[angle_at(layout, 0, joint)], x[layout.goal + joint]
        for error in range(world.gain.shape[1]):
            for e in range(n):
                seen[row, e] = world.gain[joint, error] * (goal[first + e] - angle[first + e])
            tansig(seen[row])
            row += 1
    if not world.recurrent:
        forget(seen, units.shape[0])
    recur(network, seen, units)
    for joint in range(world.gain.shape[0]):
        unit = joint * world.muscles
        for e in range(n):
            second = valve(units[unit + 1, e]) if world.muscles > 1 else 0
            arms.actions[first + e, joint] = _action_of(valve(units[unit, e]), second)


@inner
def valve(output):  # type: ignore[no-untyped-def]
    """Return what the valves of a muscle do by an ``output``: 1 lets air in, -1 out."""
    if output > _OPEN:
        return 1
    return -1 if output < -_OPEN else 0


@kernel
def measure_fitness(world, networks, arms, seeds, fitness):  # type: ignore[no-untyped-def]
    """Set ``fitness`` (networks,) to the mean reward of ``networks`` (networks, units, genes); return their steps.

    Each has an episode in each of its arms; ``seeds`` (arms, 4) decide begin states, goals and noise, the same for
    all networks. There may be fewer of them than ``arms`` have room for.
    """
    task, fleet, n = world.environment.task, arms.fleet, seeds.shape[0]
    left, steps = 0, 0
    for place in range(arms.alive.shape[0]):
        arms.alive[place] = False
    for g in range(networks.shape[0]):
        forget(arms.seen[g], arms.units.shape[1])
        fitness[g] = 0.0
        for e in range(n):
            place = g * n + e
            fleet.random[place] = seeds[e]
            begin_one(world.environment, fleet, place)
            arms.alive[place] = True
            left += 1
    while left > 0:
        steps += left
        for g in range(networks.shape[0]):
            choose_valves(world, networks[g], arms, g)
        take_alive(world.environment, world.limits, fleet, arms.actions, arms.alive, arms.is_reached)
        for place in range(arms.alive.shape[0]):
            if arms.alive[place]:
                is_reached = arms.is_reached[place]
                fitness[place // n] += gained_by(task, fleet, place, is_reached) / n
                if ending(task, is_reached, fleet.taken[place]) != GOES_ON:
                    arms.alive[place] = False
                    left -= 1
    return steps


@kernel
def begin_together(world, arms, random, record, first, count):  # type: ignore[no-untyped-def]
    """Let ``count`` arms of one network begin episodes one after another, as a single environment does."""
    forget(arms.seen[0], arms.units.shape[1])
    for e in range(count):
        begin_episode(world.environment, one(arms.fleet, e), np.inf, random)
        arms.fleet.taken[e] = 0
        note_begin(world.environment.task, one(arms.fleet, e), record, first + e)


@kernel
def move_together(world, network, arms, record, first, count):  # type: ignore[no-untyped-def]
    """Let one ``network`` move ``count`` arms that have begun; write entries from ``first`` on into ``record``."""
    task, fleet, left = world.environment.task, arms.fleet, count
    for e in range(arms.alive.shape[0]):
        arms.alive[e] = e < count
    while left > 0:
        choose_valves(world, network, arms, 0)
        take_alive(world.environment, world.limits, fleet, arms.actions, arms.alive, arms.is_reached)
        left -= note_alive(task, fleet, arms.alive, arms.is_reached, record, first)


@kernel
def begin_movement(world, arms, state, goal):  # type: ignore[no-untyped-def]
    """Let the only arm of ``arms`` rest in the scaled ``state`` (state_size,), its ``goal`` (joints,) [counts]."""
    task = world.environment.task
    forget(arms.seen[0], arms.units.shape[1])
    for joint in range(goal.shape[0]):
        scaled = (goal[joint] - task.unit[joint, 0]) / task.unit[joint, 1]
        arms.fleet.x[task.layout.goal + joint, 0] = np.float32(scaled)
    put_state(arms, state)


@kernel
def put_state(arms, state):  # type: ignore[no-untyped-def]
    """Let the only arm of ``arms`` be in the scaled ``state`` (state_size,)."""
    for i in range(state.shape[0]):
        arms.fleet.x[i, 0] = state[i]


@kernel
def choose_once(world, network, arms):  # type: ignore[no-untyped-def]
    """Let ``network`` choose the actions of its only arm."""
    choose_valves(world, network, arms, 0)

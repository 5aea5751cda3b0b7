"""Many simulated arms in one compiled step: the environment of :mod:`pneumarm.task.environment`, side by side.

Each arm has its column in arrays ``[quantity][arm]``, random numbers of its own, and goes on bit for bit the same
whatever its neighbours do. What is decided arm by arm (begin states, noise, the window, when a goal is reached) is
done by the functions of the single environment on views of a column; only the networks, which take nearly all of the
time, are evaluated over all columns together.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import CLOSED, VALVES
from pneumarm.kernels import inner, kernel, part
from pneumarm.random import RandomState
from pneumarm.simulation.gradient import predict_all
from pneumarm.simulation.kernel import SimulationState, put_command, settle
from pneumarm.simulation.layout import Layout, angle_at, layout_of, pressure_at, reading_at
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.environment import (
    Environment,
    Episode,
    begin_episode,
    order,
    reached,
)
from pneumarm.task.reward import paid


class Fleet(NamedTuple):
    """What changes of ``n`` simulated arms. Made by :func:`fleet`."""

    x: NDArray[np.float32]
    """State vectors, shape (inputs, n), see :mod:`pneumarm.simulation.layout`."""
    average: NDArray[np.float32]
    """Moving averages of the noise, shape (outputs, n)."""
    random: RandomState
    """Shape (n, 4)."""
    hidden: NDArray[np.float32]
    """Workspace, shape (units, n)."""
    second: NDArray[np.float32]
    """Workspace, shape (second units, n)."""
    change: NDArray[np.float32]
    """Workspace, shape (outputs, n)."""
    goal: NDArray[np.float64]
    """Shape (n, joints) [counts]."""
    actions: NDArray[np.int64]
    """The last actions, -1 before the first, shape (n, joints)."""
    switched: NDArray[np.int64]
    """Whether the last action was a switch, shape (n, joints)."""
    command: NDArray[np.float32]
    """Workspace, shape (n, 2 joints)."""
    still: NDArray[np.int64]
    """How many steps in a row the last action has changed nothing, shape (n, joints)."""
    before: NDArray[np.float32]
    """Angle and pressures before the last action, shape (n, joints, 3) [scaled]."""
    taken: NDArray[np.int64]
    """Actions in this episode, shape (n,)."""


def fleet(environment: Environment, random: RandomState) -> Fleet:
    """Return workspace for as many arms in ``environment`` as there are random states in ``random`` (n, 4)."""
    inputs, units = environment.simulation.hidden.shape
    outputs, joints, n = environment.simulation.output_bias.size, environment.simulation.layout.joints, len(random)
    x = np.zeros((inputs, n), np.float32)
    x[environment.simulation.layout.one] = 1
    return Fleet(
        x=x,
        average=np.zeros((outputs, n), np.float32),
        random=random,
        hidden=np.zeros((units, n), np.float32),
        second=np.zeros((environment.simulation.second_bias.size, n), np.float32),
        change=np.zeros((outputs, n), np.float32),
        goal=np.zeros((n, joints)),
        actions=np.full((n, joints), -1, np.int64),
        switched=np.zeros((n, joints), np.int64),
        command=np.zeros((n, 2 * joints), np.float32),
        still=np.zeros((n, joints), np.int64),
        before=np.zeros((n, joints, 3), np.float32),
        taken=np.zeros(n, np.int64),
    )


class Limits(NamedTuple):
    """Which actions are of no use. Made by :func:`limits`."""

    inlet: NDArray[np.float32]
    """Pressure over which an inlet stays closed, shape (joints, 2) [scaled]."""
    outlet: NDArray[np.float32]
    """Pressure below which a muscle has nothing to let out, shape (joints, 2) [scaled]; as a rule none does."""
    still: NDArray[np.float32]
    """Largest change of angle and of pressures that counts as none, shape (joints, 3) [scaled]."""
    tolerance: NDArray[np.float32]
    """Distance from the goal within which a joint may stand still, shape (joints,) [scaled]."""
    layout: Layout
    """Of the state vector."""
    patience: int
    """Steps without change after which an action is not taken again; 0: it always may."""


def limits(simulation: Simulation, tolerance: float, still: float = 2.5, patience: int = 2) -> Limits:
    """Return the limits of an arm by its ``simulation``.

    ``still`` is the largest change that counts as none, ``tolerance`` the distance from the goal within which a joint
    may stand still [both in counts of the thesis' sensors], ``patience`` the steps without change after which another
    action is taken.
    """
    window, scaling, spec = simulation.window, simulation.scaling, simulation.spec
    offset, scale = window.of_joints(scaling.observation_offset), window.of_joints(scaling.observation_scale)
    units = np.array([spec.angle_unit, spec.pressure_unit, spec.pressure_unit])
    return Limits(
        inlet=np.ascontiguousarray((spec.max_pressure_counts - offset[:, 2:]) / scale[:, 2:], np.float32),
        outlet=np.full((window.joints, 2), -np.inf, np.float32),
        still=np.ascontiguousarray(still * units / scale[:, [0, 2, 3]], np.float32),
        tolerance=(tolerance * spec.angle_unit / scale[:, 0]).astype(np.float32),
        layout=layout_of(window),
        patience=patience,
    )


@part
def is_useful(limits, x, actions, still, joint, action):  # type: ignore[no-untyped-def]
    """Return whether ``joint`` may take ``action`` in the state ``x`` (inputs,).

    Not useful is an action that would open the inlet of a muscle over its limit (the guard would keep it closed), one
    that would open nothing but outlets of muscles with nothing to let out, and one that has changed nothing for some
    steps: an arm that sticks near its goal would stick for ever.
    """
    is_stuck = limits.patience > 0 and action == actions[joint] and still[joint] >= limits.patience
    if (
        is_stuck
        and abs(x[limits.layout.goal + joint] - x[angle_at(limits.layout, 0, joint)]) > limits.tolerance[joint]
    ):
        return False
    does_something = action == CLOSED
    for muscle in range(2):
        valve, pressure = VALVES[action, muscle], x[pressure_at(limits.layout, 0, joint, muscle)]
        if valve > 0 and pressure > limits.inlet[joint, muscle]:
            return False
        if valve > 0 or (valve < 0 and pressure >= limits.outlet[joint, muscle]):
            does_something = True
    return does_something


@inner
def one(fleet, e):  # type: ignore[no-untyped-def]
    """Return arm ``e`` as a single episode; it is a view."""
    state = SimulationState(
        fleet.x[:, e],
        fleet.average[:, e],
        fleet.random[e],
        fleet.hidden[:, e],
        fleet.second[:, e],
        fleet.change[:, e],
    )
    return Episode(state, fleet.goal[e], fleet.actions[e], fleet.switched[e], fleet.command[e])


@inner
def begin_one(environment, fleet, e):  # type: ignore[no-untyped-def]
    """Let arm ``e`` begin an episode anywhere."""
    begin_episode(environment, one(fleet, e), np.inf, fleet.random[e])
    fleet.taken[e] = 0
    for joint in range(fleet.still.shape[1]):
        fleet.still[e, joint] = 0


@kernel
def begin_all(environment, fleet):  # type: ignore[no-untyped-def]
    """Let all arms begin episodes anywhere."""
    for e in range(fleet.taken.shape[0]):
        begin_one(environment, fleet, e)


@part
def gained_by(task, fleet, e, is_reached):  # type: ignore[no-untyped-def]
    """Return what all joints of arm ``e`` together are paid for its last action."""
    switches = 0
    for joint in range(fleet.switched.shape[1]):
        switches += fleet.switched[e, joint]
    return paid(task.reward, is_reached, switches)


@inner
def take_all(environment, limits, fleet, actions, is_reached):  # type: ignore[no-untyped-def]
    """Take ``actions`` (n, joints) for a period; set ``is_reached`` (n,) to whether the goals are reached."""
    take_alive(environment, limits, fleet, actions, np.ones(actions.shape[0], np.bool_), is_reached)


@inner
def take_alive(environment, limits, fleet, actions, alive, is_reached):  # type: ignore[no-untyped-def]
    """Do what :func:`take_all` does, in the arms that are ``alive`` (n,) alone."""
    for e in range(actions.shape[0]):
        if alive[e]:
            order(environment.task, one(fleet, e), actions[e])
            look(limits.layout, fleet.x[:, e], fleet.before[e])
    advance_alive(environment, fleet, alive)
    for e in range(actions.shape[0]):
        if alive[e]:
            note_still(limits, fleet.x[:, e], fleet.before[e], fleet.switched[e], fleet.still[e])
            fleet.taken[e] += 1
            is_reached[e] = reached(environment.task, one(fleet, e))


@inner
def advance_alive(environment, fleet, alive):  # type: ignore[no-untyped-def]
    """Let a control period pass in the arms that are ``alive`` (n,), under their commands."""
    simulation = environment.simulation
    for e in range(alive.shape[0]):
        if alive[e]:
            put_command(simulation, fleet.x[:, e], fleet.command[e])
    predict_all(simulation, fleet.x, fleet)
    for e in range(alive.shape[0]):
        if alive[e]:
            settle(simulation, environment.noise, one(fleet, e).state, fleet.command[e])


@part
def look(layout, x, before):  # type: ignore[no-untyped-def]
    """Set ``before`` (joints, 3) to the angle and the pressures in the state ``x`` (inputs,)."""
    for joint in range(before.shape[0]):
        before[joint, 0] = x[angle_at(layout, 0, joint)]
        before[joint, 1] = x[pressure_at(layout, 0, joint, 0)]
        before[joint, 2] = x[pressure_at(layout, 0, joint, 1)]


@part
def note_still(limits, x, before, switched, still):  # type: ignore[no-untyped-def]
    """Count in ``still`` (joints,) the steps in which the same action has changed nothing."""
    for joint in range(still.shape[0]):
        count = still[joint] + 1 if switched[joint] == 0 else 1
        for quantity in range(3):
            skipped = 1 if quantity > 0 else 0  # the velocity
            now = x[reading_at(limits.layout, 0, joint, quantity + skipped)]
            if abs(now - before[joint, quantity]) > limits.still[joint, quantity]:
                count = 0
        still[joint] = count

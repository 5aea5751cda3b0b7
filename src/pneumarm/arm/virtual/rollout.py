"""What a virtual arm would do: its physics on copies of its state, without noise, jitter or the arm noticing.

A rollout lets a copy of the arm's whole state pass through turns of the control cycle: the latency with the valves
as they are, the new valves, and the rest of the period. Readings are those of sensors without noise, quantised as
the converter does; the fluctuation of the supply is what it will be on the arm, because its random state is copied
too. On an arm without noise and jitter the rollout and the arm's own stepping are the same bit for bit.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.velocity import derived_velocity
from pneumarm.arm.virtual.arm import VirtualArm
from pneumarm.arm.virtual.body import Body
from pneumarm.arm.virtual.parameters import ATMOSPHERE
from pneumarm.arm.virtual.passing import pass_time
from pneumarm.arm.virtual.sensors import convert, worn
from pneumarm.arm.virtual.state import JOINT, MUSCLE, SURROUNDINGS
from pneumarm.arm.virtual.valve import command
from pneumarm.errors import UnusableInput
from pneumarm.kernels import inner, kernel, part

_velocity = part(derived_velocity)


class Physics(NamedTuple):
    """What does not change in rollouts of an arm. Made by :func:`physics_of`."""

    body: Body
    """The arm's own; of it only the constants are used."""
    period: float
    """Control period [s]."""
    latency: float
    """Time between reading and acting [s]."""
    limit: float
    """Inlets stay closed while their muscle reads over this [counts]."""


class PhysicsStates(NamedTuple):
    """``n`` copies of an arm's state, each after a reading. Made by :func:`physics_states`."""

    muscles: NDArray[Any]
    """MUSCLE, shape (n, joints, 2)."""
    joints: NDArray[Any]
    """JOINT, shape (n, joints)."""
    surroundings: NDArray[Any]
    """SURROUNDINGS, shape (n, 1)."""
    random: NDArray[np.uint64]
    """Of the supply's fluctuation, shape (n, 4)."""
    due: NDArray[np.float64]
    """When the turn that led to the reading was to end, shape (n,) [s]."""
    angle: NDArray[np.float64]
    """As read, shape (n, joints) [counts]."""
    velocity: NDArray[np.float64]
    """Derived from the last two readings, shape (n, joints) [counts/ms]."""
    pressure: NDArray[np.float64]
    """As read, shape (n, joints, 2) [counts]."""


def physics_of(arm: VirtualArm) -> Physics:
    """Return the physics of ``arm`` for rollouts.

    Raises:
        UnusableInput: the arm plays faults, which a rollout does not.

    """
    if arm.faults:
        raise UnusableInput(f"{arm.spec.name}: no rollouts of an arm with faults; remove them")
    spec = arm.spec
    return Physics(arm.body, spec.period, spec.latency, spec.max_pressure_counts)


def physics_states(physics: Physics, n: int) -> PhysicsStates:
    """Return room for ``n`` states of an arm."""
    joints = len(physics.body.joints)
    return PhysicsStates(
        muscles=np.empty((n, joints, 2), MUSCLE),
        joints=np.empty((n, joints), JOINT),
        surroundings=np.empty((n, 1), SURROUNDINGS),
        random=np.empty((n, 4), np.uint64),
        due=np.empty(n),
        angle=np.empty((n, joints)),
        velocity=np.empty((n, joints)),
        pressure=np.empty((n, joints, 2)),
    )


def capture(arm: VirtualArm, physics: Physics, states: PhysicsStates, i: int) -> None:
    """Copy the state of ``arm``, at rest and due now, into place ``i`` of ``states``."""
    body = arm.body
    states.muscles[i], states.joints[i], states.surroundings[i] = body.muscles, body.joints, body.surroundings
    states.random[i] = body.supply_random
    states.due[i] = arm.time
    look(physics, states, i)
    states.velocity[i] = 0.0


@inner
def body_at(physics, states, i):  # type: ignore[no-untyped-def]
    """Return the body of state ``i``."""
    own = physics.body
    return Body(
        states.muscles[i],
        states.joints[i],
        states.surroundings[i],
        own.constants,
        states.random[i],
        own.sensor_random,
        own.jitter_random,
        own.conversions,
        own.lateness,
    )


@kernel
def look(physics, states, i):  # type: ignore[no-untyped-def]
    """Set the readings of state ``i`` to what sensors without noise say."""
    c = physics.body.constants.sensors[0]
    for j in range(states.angle.shape[1]):
        value = c.middle + c.counts_per_radian * states.joints[i, j].angle
        if c.wear > 0.0:
            value = worn(value, c)
        states.angle[i, j] = convert(value, 0.0, c, states.random[i])
        for m in range(2):
            value = c.counts_per_pascal * (states.muscles[i, j, m].pressure - ATMOSPHERE)
            states.pressure[i, j, m] = convert(value, 0.0, c, states.random[i])


@kernel
def copy_physics(states, to, source):  # type: ignore[no-untyped-def]
    """Copy state ``source`` to the place ``to``."""
    for j in range(states.joints.shape[1]):
        states.joints[to, j] = states.joints[source, j]
        states.angle[to, j] = states.angle[source, j]
        states.velocity[to, j] = states.velocity[source, j]
        for m in range(2):
            states.muscles[to, j, m] = states.muscles[source, j, m]
            states.pressure[to, j, m] = states.pressure[source, j, m]
    states.surroundings[to, 0] = states.surroundings[source, 0]
    for w in range(4):
        states.random[to, w] = states.random[source, w]
    states.due[to] = states.due[source]


@kernel
def advance_physics(world, states, i, valves):  # type: ignore[no-untyped-def]
    """Let one turn of the control cycle pass in state ``i``: latency, ``valves`` (joints, 2), rest of the period."""
    body = body_at(world, states, i)
    begin = body.surroundings[0].time
    states.due[i] += world.period
    acted = begin + world.latency
    pass_time(body, acted)
    command(body, valves, world.period)
    pass_time(body, max(states.due[i], acted))
    for j in range(states.angle.shape[1]):
        states.velocity[i, j] = states.angle[i, j]  # kept until the new angle is read
    look(world, states, i)
    elapsed = body.surroundings[0].time - begin
    for j in range(states.angle.shape[1]):
        states.velocity[i, j] = _velocity(states.angle[i, j], states.velocity[i, j], elapsed)

"""What a policy does in vain in a movement on an arm, and what is done about it.

A joint that passes its goal again and again is one that its policy keeps swinging: its valves stay closed until it
has come to rest, and it goes on from there. A joint that is off its goal while its policy has long been venting empty
muscles, of which the simulation knows least, is vented no longer: noise hides from the policy that this changes
nothing.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import CLOSED, VALVES
from pneumarm.kernels import kernel, part
from pneumarm.learning.policy.settings import PolicySettings
from pneumarm.simulation.layout import angle_at, pressure_at
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.fleet import look, note_still
from pneumarm.task.reward import is_switch

_EMPTY = 0.03  # of the range of pressures: a muscle with less has nothing to let out
_IDLE = 0.35  # s in which valves do nothing, after which that does not go on


class Vain(NamedTuple):
    """What was done in vain until now, joint by joint, and how much of it may be. Made by :func:`vain`."""

    side: NDArray[np.int64]
    """On which side of its goal each joint was last, -1 or 1, or 0 where it was always within the tolerance."""
    passes: NDArray[np.int64]
    """How often it has passed its goal since its valves were last kept closed."""
    resting: NDArray[np.int64]
    """For how many periods its valves stay closed."""
    idle: NDArray[np.int64]
    """For how many periods its valves have done nothing while it was off its goal."""
    empty: NDArray[np.float64]
    """Pressure below which a muscle has nothing to let out, shape (joints, 2) [scaled]."""
    most_passes: int
    """0: any number."""
    rest: int
    """For how many periods the valves of a joint that swings stay closed."""
    longest_idle: int
    """Periods."""


def vain(simulation: Simulation, settings: PolicySettings) -> Vain:
    """Return what a movement on the arm of ``simulation`` begins with."""
    window, scaling, period = simulation.window, simulation.scaling, simulation.spec.period
    offset, scale = window.of_joints(scaling.observation_offset), window.of_joints(scaling.observation_scale)
    lowest, highest = np.moveaxis(simulation.pressure_range, -1, 0)
    side, passes, resting, idle = np.zeros((4, window.joints), np.int64)
    return Vain(
        side=side,
        passes=passes,
        resting=resting,
        idle=idle,
        empty=np.ascontiguousarray((lowest + _EMPTY * (highest - lowest) - offset[:, 2:]) / scale[:, 2:]),
        most_passes=settings.passes,
        rest=round(settings.rest / period),
        longest_idle=round(_IDLE / period),
    )


@part
def side_of(limits, x, joint):  # type: ignore[no-untyped-def]
    """Return on which side of its goal ``joint`` is in ``x`` (inputs,): -1, 1, or 0 within the tolerance."""
    beyond = x[angle_at(limits.layout, 0, joint)] - x[limits.layout.goal + joint]
    if abs(beyond) <= limits.tolerance[joint]:
        return 0
    return 1 if beyond > 0 else -1


@kernel
def begin(mind, single, vain, state, goal):  # type: ignore[no-untyped-def]
    """Begin a movement at rest in the scaled ``state`` towards ``goal`` (joints,) [counts]."""
    arm, task = single.fleet, mind.environment.task
    for i in range(state.shape[0]):
        arm.x[i, 0] = state[i]
    for joint in range(goal.shape[0]):
        arm.goal[0, joint] = goal[joint]
        arm.x[task.layout.goal + joint, 0] = (goal[joint] - task.unit[joint, 0]) / task.unit[joint, 1]
        arm.actions[0, joint] = -1
        arm.still[0, joint] = 0
        vain.side[joint] = side_of(mind.limits, arm.x[:, 0], joint)
        vain.passes[joint] = vain.resting[joint] = vain.idle[joint] = 0
        for muscle in range(2):
            mind.limits.outlet[joint, muscle] = -np.inf


@kernel
def take_up(single, vain):  # type: ignore[no-untyped-def]
    """Let ``single.actions`` (1, joints) be what the arm does now, with the valves of joints at rest closed."""
    arm = single.fleet
    for joint in range(single.actions.shape[1]):
        if vain.resting[joint] > 0:
            single.actions[0, joint] = CLOSED
        arm.switched[0, joint] = is_switch(arm.actions[0, joint], single.actions[0, joint])
        arm.actions[0, joint] = single.actions[0, joint]


@kernel
def follow(mind, single, vain, state):  # type: ignore[no-untyped-def]
    """Go on in the scaled ``state``, and note what was done in vain."""
    arm = single.fleet
    look(mind.limits.layout, arm.x[:, 0], arm.before[0])
    for i in range(state.shape[0]):
        arm.x[i, 0] = state[i]
    note_still(mind.limits, arm.x[:, 0], arm.before[0], arm.switched[0], arm.still[0])
    for joint in range(vain.side.shape[0]):
        side = side_of(mind.limits, arm.x[:, 0], joint)
        _note_pass(vain, side, joint)
        _note_idle(mind.limits, vain, arm.x[:, 0], side, single.actions[0, joint], joint)


@part
def _note_pass(vain, side, joint):  # type: ignore[no-untyped-def]
    """Count the passes of a joint that is on this ``side`` of its goal, and let it rest where it swings."""
    vain.resting[joint] = max(vain.resting[joint] - 1, 0)
    if vain.resting[joint] > 0:
        vain.passes[joint] = 0
    elif side * vain.side[joint] < 0:
        vain.passes[joint] += 1
    if side != 0:
        vain.side[joint] = side
    if vain.most_passes > 0 and vain.passes[joint] >= vain.most_passes:
        vain.resting[joint] = vain.rest


@part
def _note_idle(limits, vain, x, side, action, joint):  # type: ignore[no-untyped-def]
    """Count for how long the valves of a joint off its goal do nothing; after long that is ruled out."""
    works = side == 0
    for muscle in range(2):
        valve = VALVES[action, muscle]
        pressure = x[pressure_at(limits.layout, 0, joint, muscle)]
        works = works or valve > 0 or (valve < 0 and pressure >= vain.empty[joint, muscle])
    vain.idle[joint] = 0 if works else vain.idle[joint] + 1
    for muscle in range(2):
        is_over = vain.idle[joint] >= vain.longest_idle
        limits.outlet[joint, muscle] = vain.empty[joint, muscle] if is_over else -np.inf

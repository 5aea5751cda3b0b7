"""Letting time pass: substeps of at most half a millisecond between valve edges and slow ticks.

The substep is a semi-implicit Euler step of the joints, then of the muscles at their new lengths. Its error is of
the first order, because valve edges fall on its boundaries exactly; in 5 s of random valves it stays below one
count in the nominal arm, and below half a count rms in any of 20 drawn ones (largest: 2.3 counts).
"""

import math

from pneumarm.arm.virtual.joint import accelerate, muscle_direction, muscle_length
from pneumarm.arm.virtual.muscle import move
from pneumarm.arm.virtual.slow import surround, tick_muscle
from pneumarm.arm.virtual.state import SLOW_TICK
from pneumarm.arm.virtual.valve import toggle_due
from pneumarm.kernels import kernel

SUBSTEP = 0.5e-3
"""Longest substep [s]."""
_ROUNDING = 1e-6  # of a substep: a segment that is longer by less is not cut further


@kernel
def substep(muscles, muscle_c, joints, joint_c, supply, polytropic, dt):  # type: ignore[no-untyped-def]
    """Advance joints and muscles by ``dt`` [s] with the valves as they are."""
    accelerate(joints, joint_c, muscles, dt)
    for j in range(len(joints)):
        joint, c = joints[j], joint_c[j]
        for m in range(2):
            length = muscle_length(c, muscle_c[j, m], m, joint.angle)
            speed = muscle_direction(m) * c.radius * joint.speed
            move(muscles[j, m], muscle_c[j, m], length, speed, supply, polytropic, dt)


@kernel
def slow_tick(muscles, muscle_c, surroundings, surroundings_c, random):  # type: ignore[no-untyped-def]
    """Let one slow tick pass in everything that changes slowly."""
    surroundings.tick = surroundings.time
    surround(surroundings, surroundings_c, random, SLOW_TICK)
    for j in range(muscles.shape[0]):
        for m in range(2):
            tick_muscle(muscles[j, m], muscle_c[j, m], surroundings.temperature)


@kernel
def integrate(muscles, muscle_c, joints, joint_c, air, air_c, random, until, longest):  # type: ignore[no-untyped-def]
    """Advance everything until the clock shows ``until`` [s], in substeps of at most ``longest`` [s]."""
    surroundings, constants = air[0], air_c[0]
    while surroundings.time < until:
        now = surroundings.time
        tick = surroundings.tick + SLOW_TICK
        end = min(until, tick)
        for j in range(muscles.shape[0]):
            for m in range(2):
                end = min(end, toggle_due(muscles[j, m], now))
        count = max(1, math.ceil((end - now) / longest - _ROUNDING))
        dt = (end - now) / count
        supply = surroundings.supply
        for _ in range(count):
            substep(muscles, muscle_c, joints, joint_c, supply, constants.polytropic, dt)
        surroundings.time = end
        if end >= tick:
            slow_tick(muscles, muscle_c, surroundings, constants, random)

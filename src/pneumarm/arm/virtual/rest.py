"""Rest: a long wait of an arm that stands still, in milliseconds.

At rest only slow things change: air leaks, rubber creeps, muscles and room change temperature. Between two
moments the arm goes from one equilibrium to the next, and because the stretch of dry friction and the pressure
of closed muscles depend on that path, the path is followed in steps that grow with the time passed.
"""

import math

import numpy as np

from pneumarm.arm.virtual.joint import gravity_torque, muscle_direction, muscle_length, stop_torque
from pneumarm.arm.virtual.muscle import move, static_tension
from pneumarm.arm.virtual.parameters import ATMOSPHERE, BAR, FREE_AIR
from pneumarm.arm.virtual.slow import relax_muscle, surround
from pneumarm.arm.virtual.state import INLET, OUTLET
from pneumarm.arm.virtual.step import SUBSTEP, integrate
from pneumarm.kernels import kernel

LONG = 10.0
"""A wait longer than this may be fast-forwarded [s]."""
CALM_SPEED = 5e-3
"""The arm is at rest when it stays slower than this [rad/s] ..."""
CALM_SAMPLES = 20
"""... in so many samples ..."""
SAMPLE = 0.05
"""... taken so far apart [s]."""
LAST = 1.0
"""The end of a rest that is integrated as usual [s]."""
FIRST_STEP = 0.02
"""First step of the fast-forward [s]."""
GROWTH = 0.05
"""Share of the time passed by which a step may be long."""
LONGEST_STEP = 60.0
"""Longest step of the fast-forward [s]."""
VENTED = 0.001 * BAR
"""A muscle whose outlet is open counts as vented below this gauge pressure [Pa]."""
_TOLERANCE = 1e-9  # of the equilibrium [rad]
_LARGEST = 0.05  # an equilibrium farther away than this was no rest [rad]


@kernel
def pass_time(muscles, muscle_c, joints, joint_c, air, air_c, random, until):  # type: ignore[no-untyped-def]
    """Let time pass until the clock shows ``until`` [s], by fast-forward where the arm rests."""
    surroundings, constants = air[0], air_c[0]
    calm = 0
    while until - surroundings.time > LONG:
        if calm >= CALM_SAMPLES and steady(muscles):
            rested = fast_forward(muscles, muscle_c, joints, joint_c, surroundings, constants, random, until - LAST)
            calm = CALM_SAMPLES if rested else 0
        soon = surroundings.time + SAMPLE
        integrate(muscles, muscle_c, joints, joint_c, air, air_c, random, min(until, soon), SUBSTEP)
        calm = calm + 1 if fastest(joints) < CALM_SPEED else 0
    integrate(muscles, muscle_c, joints, joint_c, air, air_c, random, until, SUBSTEP)


@kernel
def fastest(joints):  # type: ignore[no-untyped-def]
    """Return the speed of the fastest joint [rad/s]."""
    speed = 0.0
    for j in range(len(joints)):
        speed = max(speed, abs(joints[j].speed))
    return speed


@kernel
def steady(muscles):  # type: ignore[no-untyped-def]
    """Return whether every muscle is closed or vented, with no valve about to switch."""
    for j in range(muscles.shape[0]):
        for m in range(2):
            muscle = muscles[j, m]
            if muscle.open[INLET] or muscle.pending[INLET] or muscle.pending[OUTLET]:
                return False
            if muscle.open[OUTLET] and muscle.pressure - ATMOSPHERE > VENTED:
                return False
    return True


@kernel
def fast_forward(muscles, muscle_c, joints, joint_c, surroundings, c, random, until):  # type: ignore[no-untyped-def]
    """Bring a resting arm to ``until`` [s]; return False, before that, where it would not stay at rest."""
    start = surroundings.time
    trial = np.empty_like(muscles)
    for j in range(len(joints)):
        joints[j].speed = 0.0
    while surroundings.time < until:
        longest = min(LONGEST_STEP, FIRST_STEP + GROWTH * (surroundings.time - start))
        end = min(until, surroundings.time + longest)
        elapsed = end - surroundings.time
        surroundings.time = end
        surroundings.tick = end
        surround(surroundings, c, random, elapsed)
        for j in range(len(joints)):
            for m in range(2):
                relax_muscle(muscles[j, m], muscle_c[j, m], surroundings.temperature, elapsed)
                leak(muscles[j, m], muscle_c[j, m], c, elapsed)
            if not settle(
                muscles[j], muscle_c[j], trial[j], joints[j], joint_c[j], surroundings.supply, c.polytropic
            ):
                return False
    return True


@kernel
def leak(muscle, c, surroundings_c, elapsed):  # type: ignore[no-untyped-def]
    """Let air leak for ``elapsed`` [s] at a constant volume; a vented muscle keeps its pressure.

    The leaks are linear in the pressure, so that it decays to where they balance; the supply's mean is used.
    """
    conductance = c.leak + c.seat_leak
    if muscle.open[OUTLET] or conductance == 0.0:
        return
    balance = (c.leak * ATMOSPHERE + c.seat_leak * surroundings_c.supply) / conductance
    rate = surroundings_c.polytropic * FREE_AIR * conductance / (muscle.volume + c.dead_volume)
    muscle.pressure += (muscle.pressure - balance) * math.expm1(-rate * elapsed)


@kernel
def resting_torque(muscles, muscle_c, trial, c, angle, supply, polytropic):  # type: ignore[no-untyped-def]
    """Return the torque [N m] after an infinitely slow move to ``angle`` [rad]; ``trial`` holds the muscles then."""
    torque = gravity_torque(c, angle) + stop_torque(c, angle, 0.0)
    for m in range(2):
        trial[m] = muscles[m]
        if trial[m].open[OUTLET]:
            trial[m].engagement = 0.0  # an open muscle is not compressed
        move(trial[m], muscle_c[m], muscle_length(c, muscle_c[m], m, angle), 0.0, supply, polytropic, 0.0)
        torque -= muscle_direction(m) * c.radius * trial[m].tension
    return torque


@kernel
def settle(muscles, muscle_c, trial, joint, c, supply, polytropic):  # type: ignore[no-untyped-def]
    """Move a joint to its equilibrium near by; return False if there is none.

    The torque falls with the angle, so the equilibrium is bracketed by growing steps and found by the Illinois
    variant of regula falsi.
    """
    near = joint.angle
    torque_near = resting_torque(muscles, muscle_c, trial, c, near, supply, polytropic)
    step = 1e-6 if torque_near > 0.0 else -1e-6
    far, torque_far = near, torque_near
    while torque_far * torque_near > 0.0:
        near, torque_near = far, torque_far
        far += step
        step *= 3.0
        if abs(far - joint.angle) > _LARGEST:
            return False
        torque_far = resting_torque(muscles, muscle_c, trial, c, far, supply, polytropic)
    while abs(far - near) > _TOLERANCE and torque_far != 0.0:
        middle = far - torque_far * (far - near) / (torque_far - torque_near)
        torque = resting_torque(muscles, muscle_c, trial, c, middle, supply, polytropic)
        if torque * torque_far < 0.0:
            near, torque_near = far, torque_far
        else:
            torque_near *= 0.5
        if abs(middle - far) < _TOLERANCE:
            far, torque_far = middle, torque
            break
        far, torque_far = middle, torque
    joint.angle = far
    resting_torque(muscles, muscle_c, trial, c, far, supply, polytropic)
    for m in range(2):
        muscles[m] = trial[m]
    return True


@kernel
def static_angle(muscle_c, c, pressures, with_stops):  # type: ignore[no-untyped-def]
    """Return the angle [rad] at which a joint rests at gauge ``pressures`` (2,) [Pa] without friction or creep."""
    low, high = -1.5, 1.5
    for _ in range(60):
        angle = 0.5 * (low + high)
        torque = gravity_torque(c, angle)
        if with_stops:
            torque += stop_torque(c, angle, 0.0)
        for m in range(2):
            length = muscle_length(c, muscle_c[m], m, angle)
            torque -= muscle_direction(m) * c.radius * static_tension(muscle_c[m], pressures[m], length)
        if torque > 0.0:
            low = angle
        else:
            high = angle
    return 0.5 * (low + high)

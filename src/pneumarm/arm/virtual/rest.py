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
def fastest(body):  # type: ignore[no-untyped-def]
    """Return the speed of the fastest joint [rad/s]."""
    speed = 0.0
    for j in range(len(body.joints)):
        speed = max(speed, abs(body.joints[j].speed))
    return speed


@kernel
def steady(body):  # type: ignore[no-untyped-def]
    """Return whether every muscle is closed or vented, with no valve about to switch."""
    for j in range(len(body.joints)):
        for m in range(2):
            muscle = body.muscles[j, m]
            if muscle.open[INLET] or muscle.pending[INLET] or muscle.pending[OUTLET]:
                return False
            if muscle.open[OUTLET] and muscle.pressure - ATMOSPHERE > VENTED:
                return False
    return True


@kernel
def fast_forward(body, until):  # type: ignore[no-untyped-def]
    """Bring a resting arm to ``until`` [s]; return False, before that, where it would not stay at rest."""
    surroundings = body.surroundings[0]
    start = surroundings.time
    trial = np.empty_like(body.muscles)
    for j in range(len(body.joints)):
        body.joints[j].speed = 0.0
    while surroundings.time < until:
        longest = min(LONGEST_STEP, FIRST_STEP + GROWTH * (surroundings.time - start))
        end = min(until, surroundings.time + longest)
        elapsed = end - surroundings.time
        surroundings.time = end
        surroundings.tick = end
        surround(body, elapsed)
        for j in range(len(body.joints)):
            for m in range(2):
                muscle, c = body.muscles[j, m], body.constants.muscles[j, m]
                relax_muscle(muscle, c, surroundings.temperature, elapsed)
                leak(muscle, c, body.constants.surroundings[0], elapsed)
            if not settle(body, j, trial[j]):
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
def resting_torque(body, j, trial, angle):  # type: ignore[no-untyped-def]
    """Return the torque [N m] of joint ``j`` after an infinitely slow move to ``angle`` [rad].

    ``trial`` (2,) holds its muscles then.
    """
    c, supply = body.constants.joints[j], body.surroundings[0].supply
    polytropic = body.constants.surroundings[0].polytropic
    torque = gravity_torque(c, angle) + stop_torque(c, angle, 0.0)
    for m in range(2):
        muscle_c = body.constants.muscles[j, m]
        trial[m] = body.muscles[j, m]
        if trial[m].open[OUTLET]:
            trial[m].engagement = 0.0  # an open muscle is not compressed
        move(trial[m], muscle_c, muscle_length(c, muscle_c, m, angle), 0.0, supply, polytropic, 0.0)
        torque -= muscle_direction(m) * c.radius * trial[m].tension
    return torque


@kernel
def settle(body, j, trial):  # type: ignore[no-untyped-def]
    """Move joint ``j`` to its equilibrium near by; return False if there is none. ``trial`` (2,) is workspace.

    The torque falls with the angle, so the equilibrium is bracketed by growing steps and found by the Illinois
    variant of regula falsi.
    """
    joint = body.joints[j]
    near = joint.angle
    torque_near = resting_torque(body, j, trial, near)
    step = 1e-6 if torque_near > 0.0 else -1e-6
    far, torque_far = near, torque_near
    while torque_far * torque_near > 0.0:
        near, torque_near = far, torque_far
        far += step
        step *= 3.0
        if abs(far - joint.angle) > _LARGEST:
            return False
        torque_far = resting_torque(body, j, trial, far)
    while abs(far - near) > _TOLERANCE and torque_far != 0.0:
        middle = far - torque_far * (far - near) / (torque_far - torque_near)
        torque = resting_torque(body, j, trial, middle)
        if torque * torque_far < 0.0:
            near, torque_near = far, torque_far
        else:
            torque_near *= 0.5
        if abs(middle - far) < _TOLERANCE:
            far, torque_far = middle, torque
            break
        far, torque_far = middle, torque
    joint.angle = far
    resting_torque(body, j, trial, far)
    for m in range(2):
        body.muscles[j, m] = trial[m]
    return True


@kernel
def static_angle(constants, j, pressures, with_stops):  # type: ignore[no-untyped-def]
    """Return at which angle [rad] joint ``j`` rests at gauge ``pressures`` (2,) [Pa], without friction or creep."""
    c = constants.joints[j]
    low, high = -1.5, 1.5
    for _ in range(60):
        angle = 0.5 * (low + high)
        torque = gravity_torque(c, angle)
        if with_stops:
            torque += stop_torque(c, angle, 0.0)
        for m in range(2):
            muscle_c = constants.muscles[j, m]
            length = muscle_length(c, muscle_c, m, angle)
            torque -= muscle_direction(m) * c.radius * static_tension(muscle_c, pressures[m], length)
        if torque > 0.0:
            low = angle
        else:
            high = angle
    return 0.5 * (low + high)

"""Rest: a long wait of an arm that stands still, in milliseconds.

At rest only slow things change: air leaks, rubber creeps, muscles and room change temperature. Between two
moments the arm goes from one equilibrium to the next, and because the stretch of dry friction and the pressure
of closed muscles depend on that path, the path is followed in steps that grow with the time passed.
"""

import math

import numpy as np

from pneumarm.arm.virtual.chain import hanging_torque
from pneumarm.arm.virtual.joint import cable_run, muscle_direction, muscle_length, stop_torque
from pneumarm.arm.virtual.muscle import bring_to_length, static_tension
from pneumarm.arm.virtual.parameters import ATMOSPHERE, BAR, FREE_AIR
from pneumarm.arm.virtual.slow import relax_muscle, surround
from pneumarm.arm.virtual.state import INLET, OUTLET
from pneumarm.kernels import inner, kernel

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
_MOST_SWEEPS = 100  # over the joints of a chain, until each stands where the others let it
_LARGEST = 0.05  # an equilibrium farther away than this was no rest [rad]


@inner
def fastest(body):  # type: ignore[no-untyped-def]
    """Return the speed of the fastest joint [rad/s]."""
    speed = 0.0
    for j in range(len(body.joints)):
        speed = max(speed, abs(body.joints[j].speed))
    return speed


@inner
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


@inner
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
        if not find_equilibrium(body, trial):
            return False
    return True


@inner
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


@inner
def resting_torque(body, trial, j):  # type: ignore[no-untyped-def]
    """Return the torque [N m] of joint ``j`` after an infinitely slow move from the muscles' lengths to the angles.

    ``trial`` (joints, 2) holds the muscles then whose cables run over the joint.
    """
    joint, supply = body.joints[j], body.surroundings[0].supply
    polytropic = body.constants.surroundings[0].polytropic
    torque = hanging_torque(body.constants, body.joints, j)
    torque += stop_torque(body.constants.joints[j], joint.angle, 0.0)
    for i in range(j, len(body.joints)):
        if body.constants.joints[i].cables[j] != 0.0:
            run, _ = cable_run(body.constants, body.joints, i)
            for m in range(2):
                muscle_c = body.constants.muscles[i, m]
                trial[i, m] = body.muscles[i, m]
                if trial[i, m].open[OUTLET]:
                    trial[i, m].engagement = 0.0  # an open muscle is not compressed
                bring_to_length(trial[i, m], muscle_c, muscle_length(muscle_c, m, run), 0.0, supply, polytropic, 0.0)
                torque -= muscle_direction(m) * body.constants.joints[i].cables[j] * trial[i, m].tension
    return torque


@inner
def torque_at(body, trial, j, angle):  # type: ignore[no-untyped-def]
    """Return :func:`resting_torque` with joint ``j`` at ``angle`` [rad]."""
    body.joints[j].angle = angle
    return resting_torque(body, trial, j)


@inner
def find_equilibrium(body, trial):  # type: ignore[no-untyped-def]
    """Move the joints to their equilibrium near by; False where there is none. ``trial`` (joints, 2) is workspace.

    One joint after the other, with the others held, until none moves: they stand on each other only weakly.
    """
    begin = np.empty(len(body.joints))
    for j in range(len(body.joints)):
        begin[j] = body.joints[j].angle
    for _ in range(_MOST_SWEEPS):
        moved = 0.0
        for j in range(len(body.joints)):
            before = body.joints[j].angle
            if not settle_joint(body, trial, j):
                for i in range(len(body.joints)):
                    body.joints[i].angle = begin[i]
                return False
            moved = max(moved, abs(body.joints[j].angle - before))
        if len(body.joints) == 1 or moved <= 2.0 * _TOLERANCE:
            break
    for j in range(len(body.joints)):
        resting_torque(body, trial, j)
    for j in range(len(body.joints)):
        for m in range(2):
            body.muscles[j, m] = trial[j, m]
    return True


@inner
def settle_joint(body, trial, j):  # type: ignore[no-untyped-def]
    """Move joint ``j`` to its equilibrium near by; return False if there is none.

    The torque falls with the angle, so the equilibrium is bracketed by growing steps and found by the Illinois
    variant of regula falsi.
    """
    begin = body.joints[j].angle
    near = begin
    torque_near = torque_at(body, trial, j, near)
    step = 1e-6 if torque_near > 0.0 else -1e-6
    far, torque_far = near, torque_near
    while torque_far * torque_near > 0.0:
        near, torque_near = far, torque_far
        far += step
        step *= 3.0
        if abs(far - begin) > _LARGEST:
            return False
        torque_far = torque_at(body, trial, j, far)
    while abs(far - near) > _TOLERANCE and torque_far != 0.0:
        middle = far - torque_far * (far - near) / (torque_far - torque_near)
        torque = torque_at(body, trial, j, middle)
        if torque * torque_far < 0.0:
            near, torque_near = far, torque_far
        else:
            torque_near *= 0.5
        if abs(middle - far) < _TOLERANCE:
            far, torque_far = middle, torque
            break
        far, torque_far = middle, torque
    body.joints[j].angle = far
    return True


@kernel
def static_torque(constants, pressures, with_stops, joints, j):  # type: ignore[no-untyped-def]
    """Return the torque [N m] of joint ``j`` at gauge ``pressures`` (joints, 2) [Pa], without friction or creep."""
    torque = hanging_torque(constants, joints, j)
    if with_stops:
        torque += stop_torque(constants.joints[j], joints[j].angle, 0.0)
    for i in range(j, len(joints)):
        if constants.joints[i].cables[j] != 0.0:
            run, _ = cable_run(constants, joints, i)
            for m in range(2):
                muscle_c = constants.muscles[i, m]
                tension = static_tension(muscle_c, pressures[i, m], muscle_length(muscle_c, m, run))
                torque -= muscle_direction(m) * constants.joints[i].cables[j] * tension
    return torque


@kernel
def stand(constants, pressures, with_stops, joints):  # type: ignore[no-untyped-def]
    """Set the angles of ``joints`` (JOINT) to where they rest at gauge ``pressures`` (joints, 2) [Pa].

    Without friction and after all creep. One joint after the other, as in :func:`find_equilibrium`.
    """
    for _ in range(_MOST_SWEEPS):
        moved = 0.0
        for j in range(len(joints)):
            before, low, high = joints[j].angle, -1.5, 1.5
            for _ in range(60):
                joints[j].angle = 0.5 * (low + high)
                if static_torque(constants, pressures, with_stops, joints, j) > 0.0:
                    low = joints[j].angle
                else:
                    high = joints[j].angle
            joints[j].angle = 0.5 * (low + high)
            moved = max(moved, abs(joints[j].angle - before))
        if len(joints) == 1 or moved <= _TOLERANCE:
            break

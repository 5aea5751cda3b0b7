"""The hinge: end stops, bearings, the cables of the muscles, and what all of it does to the angles."""

from pneumarm.arm.virtual.chain import hanging_torque, solve, swing
from pneumarm.kernels import inner, part


@inner
def muscle_direction(which):  # type: ignore[no-untyped-def]
    """Return -1 for muscle 0, which shortens as the angle grows, and +1 for muscle 1."""
    return 2.0 * which - 1.0


@part
def cable_run(constants, joints, j):  # type: ignore[no-untyped-def]
    """Return how far [m] the cables of joint ``j`` have run from where all angles are 0, and how fast they run [m/s].

    They run over the joint's own pulley and, where its muscles sit further in, over the hinges that they pass.
    """
    run, speed = 0.0, 0.0
    for k in range(j + 1):
        run += constants.joints[j].cables[k] * joints[k].angle
        speed += constants.joints[j].cables[k] * joints[k].speed
    return run, speed


@inner
def muscle_length(c, which, run):  # type: ignore[no-untyped-def]
    """Return the length l = lc -+ run [m] of muscle ``which`` (0 or 1) whose cable has run so far, ``run`` [m]."""
    return c.length_at_zero + muscle_direction(which) * run


@inner
def stop_torque(c, angle, speed):  # type: ignore[no-untyped-def]
    """Return the torque of the end stops [N m]; they push and never hold back."""
    if angle > c.stop_angle:
        return min(0.0, -c.stop_stiffness * (angle - c.stop_angle) - c.stop_damping * speed)
    if angle < -c.stop_angle:
        return max(0.0, -c.stop_stiffness * (angle + c.stop_angle) - c.stop_damping * speed)
    return 0.0


@part
def joint_torque(body, j, torque):  # type: ignore[no-untyped-def]
    """Return the sum of all torques on joint ``j`` [N m]: ``torque`` of the links, end stop, bearing and cables."""
    joint, c = body.joints[j], body.constants.joints[j]
    torque += stop_torque(c, joint.angle, joint.speed)
    torque -= c.viscosity * joint.speed
    for i in range(j, len(body.joints)):
        for m in range(2):
            torque -= muscle_direction(m) * body.constants.joints[i].cables[j] * body.muscles[i, m].tension
    return torque


@part
def turn(joint, change, dt):  # type: ignore[no-untyped-def]
    """Give ``joint`` a ``change`` of its speed [rad/s], and let it turn for ``dt`` [s]."""
    joint.acceleration = change / dt
    joint.speed += change
    joint.angle += dt * joint.speed


@part
def accelerate(body, dt):  # type: ignore[no-untyped-def]
    """Sum the torques, and move all joints by one semi-implicit Euler step: speeds first, then angles."""
    joints = body.joints
    if len(joints) == 1:  # a pendulum needs no matrix, which would take a tenth more time
        torque = joint_torque(body, 0, hanging_torque(body.constants, joints, 0))
        turn(joints[0], dt * torque / body.constants.joints[0].inertias[0], dt)
        return
    swing(body)
    for j in range(len(joints)):
        joints[j].torque = dt * joint_torque(body, j, joints[j].torque)
    solve(joints)
    for j in range(len(joints)):
        turn(joints[j], joints[j].torque, dt)

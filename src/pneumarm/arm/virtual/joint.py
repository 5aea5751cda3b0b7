"""The hinge: gravity, end stops, bearings, and where its angle puts the muscles."""

import math

from pneumarm.kernels import kernel, part


@kernel
def muscle_length(c, muscle_c, which, angle):  # type: ignore[no-untyped-def]
    """Return the length [m] of muscle ``which`` (0 or 1) at ``angle`` [rad]: l = lc -+ r theta."""
    return muscle_c.length_at_zero + muscle_direction(which) * c.radius * angle


@kernel
def muscle_direction(which):  # type: ignore[no-untyped-def]
    """Return -1 for muscle 0, which shortens as the angle grows, and +1 for muscle 1."""
    return 2.0 * which - 1.0


@kernel
def gravity_torque(c, angle):  # type: ignore[no-untyped-def]
    """Return the torque of the hanging weight [N m]."""
    return -c.weight * math.sin(angle + c.tilt)


@kernel
def stop_torque(c, angle, speed):  # type: ignore[no-untyped-def]
    """Return the torque of the end stops [N m]; they push and never hold back."""
    if angle > c.stop_angle:
        return min(0.0, -c.stop_stiffness * (angle - c.stop_angle) - c.stop_damping * speed)
    if angle < -c.stop_angle:
        return max(0.0, -c.stop_stiffness * (angle + c.stop_angle) - c.stop_damping * speed)
    return 0.0


@part
def accelerate(body, dt):  # type: ignore[no-untyped-def]
    """Sum the torques, and move all joints by one semi-implicit Euler step: speed first, then angle."""
    for j in range(len(body.joints)):
        joint, c = body.joints[j], body.constants.joints[j]
        torque = gravity_torque(c, joint.angle) + stop_torque(c, joint.angle, joint.speed)
        torque -= c.viscosity * joint.speed
        for m in range(2):
            torque -= muscle_direction(m) * c.radius * body.muscles[j, m].tension
        joint.torque = torque
        joint.speed += dt * torque / c.inertia
        joint.angle += dt * joint.speed

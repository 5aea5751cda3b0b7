"""The links: a planar chain of rigid bodies that hang on each other, with full coupling.

Link i hangs at the hinge of joint i and turns with it; joint i + 1 is at its other end. With the absolute angles
phi_i, the sums of the angles of joints 1 to i, and 0 where everything hangs straight down,

    sum_k A_ik cos(phi_i - phi_k) phi_k'' + sum_k A_ik sin(phi_i - phi_k) phi_k'^2 + g h_i sin(phi_i) = Q_i

where the constants A and h gather all masses m at their lever arms x along the links (``hang`` in constants.py): A is
the sum of m x x^T with each link's own inertia on the diagonal, and h the sum of m x. What moves joint j moves all
links from j on, so torques and inertias about joints are sums over these. One link is a pendulum.

Coupling can be turned down to a share kappa of what it is (:attr:`ArmParameters.coupling`): mass matrix and potential
are then kappa times the coupled ones plus 1 - kappa times those of joints that turn alone, the others at 0.
"""

import math

from pneumarm.kernels import part


@part
def swing(body):  # type: ignore[no-untyped-def]
    """Set ``torque`` of the joints to that of the weight and of the swinging of all links, and their ``inertia``."""
    joints, c = body.joints, body.constants.joints
    n = len(joints)
    hanging, swinging = 0.0, 0.0
    for i in range(n):
        hanging += joints[i].angle + c[i].tilt
        swinging += joints[i].speed
        joints[i].hanging, joints[i].swinging = hanging, swinging
        joints[i].torque = -c[i].weight * math.sin(hanging)
        joints[i].inertia[i] = c[i].inertias[i]
    for i in range(n):
        for k in range(i + 1, n):
            apart = joints[k].hanging - joints[i].hanging
            across = c[i].inertias[k] * math.sin(apart)
            joints[i].torque += across * joints[k].swinging ** 2
            joints[k].torque -= across * joints[i].swinging ** 2
            joints[i].inertia[k] = joints[k].inertia[i] = c[i].inertias[k] * math.cos(apart)
    about_joints(joints)
    for j in range(n):
        joints[j].inertia[j] += c[j].own_inertia
        joints[j].torque += own_torque(c[j], joints[j].angle)


@part
def about_joints(joints):  # type: ignore[no-untyped-def]
    """Turn torques and mass matrix of the links by absolute angles into those by the joints' angles."""
    n = len(joints)
    for i in range(n - 2, -1, -1):
        joints[i].torque += joints[i + 1].torque
    for i in range(n):
        for k in range(n - 2, -1, -1):
            joints[i].inertia[k] += joints[i].inertia[k + 1]
    for i in range(n - 2, -1, -1):
        for k in range(n):
            joints[i].inertia[k] += joints[i + 1].inertia[k]


@part
def own_torque(c, angle):  # type: ignore[no-untyped-def]
    """Return the torque [N m] of weight on a joint at ``angle`` [rad] of what pushes it, and its own weight."""
    return c.push - (c.own_weight * math.sin(angle + c.tilt) if c.own_weight > 0.0 else 0.0)


@part
def solve(joints):  # type: ignore[no-untyped-def]
    """Divide ``torque`` by the mass matrix in ``inertia``: elimination, stable as that is positive definite."""
    n = len(joints)
    for i in range(1, n):
        for k in range(i):
            factor = joints[i].inertia[k] / joints[k].inertia[k]
            for column in range(k + 1, n):
                joints[i].inertia[column] -= factor * joints[k].inertia[column]
            joints[i].torque -= factor * joints[k].torque
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            joints[i].torque -= joints[i].inertia[k] * joints[k].torque
        joints[i].torque = joints[i].torque / joints[i].inertia[i]


@part
def hanging_torque(constants, joints, j):  # type: ignore[no-untyped-def]
    """Return the torque [N m] of all that hangs on joint ``j``, with the ``joints`` (joints,) at rest."""
    c, torque, hanging = constants.joints, 0.0, 0.0
    for i in range(len(joints)):
        hanging += joints[i].angle + c[i].tilt
        if i >= j:
            torque -= c[i].weight * math.sin(hanging)
    return torque + own_torque(c[j], joints[j].angle)

"""A spring in place of a joint's second muscle.

It is made to fit the arm, as a person chooses one: with muscle 1 full the joint stands near one end, with muscle 1
vented near the other. Its pull rises from one to the other by a fifth of what it is in the middle, or by more where
muscle and weight ask for that; a spring that rose by less would be longer than people put up with.

For the physics it is a muscle without air, friction and creep, whose bladder alone pulls
(:func:`pneumarm.arm.virtual.muscle.passive_pull`).
"""

from dataclasses import replace

import numpy as np

from pneumarm.arm.virtual.constants import constants
from pneumarm.arm.virtual.parameters import BAR, ELEMENTS, ArmParameters, MuscleParameters
from pneumarm.arm.virtual.rest import static_torque
from pneumarm.arm.virtual.state import JOINT

_STROKE = 0.9  # of the way to the end stops, where the joint is to stand with muscle 1 full or vented
_RISE = 0.2  # of the pull in the middle, from one end of the stroke to the other


def with_springs(parameters: ArmParameters) -> ArmParameters:
    """Return the arm with a spring in place of muscle 2 of every joint."""
    slack = tuple(
        replace(one, muscles=(one.muscles[0], _spring(one.muscles[0], 0.0, 1.0))) for one in parameters.joints
    )
    slack_arm = constants(replace(parameters, joints=slack))
    full = min(parameters.air.supply, parameters.max_pressure)
    made = []
    for j, joint in enumerate(slack):
        reach = _STROKE * joint.stop_angle
        pulls = []
        for angle, pressure in ((-reach, 0.0), (reach, full)):
            joints, pressures = np.zeros(len(slack), JOINT), np.zeros((len(slack), 2))
            joints[j]["angle"], pressures[j, 0] = angle, pressure
            pulls.append(float(static_torque(slack_arm, pressures, False, joints, j)) / joint.radius)
        middle = max(sum(pulls) / 2, 1.0)
        stiffness = max(pulls[1] - pulls[0], _RISE * middle) / (2 * reach * joint.radius)
        made.append(
            replace(joint, muscles=(joint.muscles[0], _spring(joint.muscles[0], stiffness, middle / stiffness)))
        )
    return replace(parameters, joints=tuple(made))


def _spring(like: MuscleParameters, stiffness: float, stretch: float) -> MuscleParameters:
    """Return a spring of ``stiffness`` [N/m] that is stretched by ``stretch`` [m] with the joint in the middle.

    It is as long as the muscle that was ``like`` it, or as much as it is stretched.
    """
    length = max(stretch, like.rest_length)
    return replace(
        like,
        rest_length=length + stretch,  # where the air in a braid has a sound volume
        bladder_length=length,
        length_at_zero=length + stretch,
        stop_length=10 * (length + stretch),
        bladder_stiffness=stiffness,
        stop_stiffness=0.0,
        threshold=100 * BAR,
        friction=0.0,
        friction_per_pressure=0.0,
        viscosity=0.0,
        viscosity_per_pressure=0.0,
        creep_stiffness=(0.0,) * ELEMENTS,
        seat_leak=0.0,
    )

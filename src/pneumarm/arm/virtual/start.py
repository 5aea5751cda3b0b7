"""The begin of a virtual arm's life: vented, relaxed and cold, as after a night."""

import numpy as np

from pneumarm.arm.virtual.joint import muscle_length
from pneumarm.arm.virtual.muscle import braid, move
from pneumarm.arm.virtual.parameters import ATMOSPHERE, ELEMENTS
from pneumarm.arm.virtual.rest import static_angle
from pneumarm.arm.virtual.slow import adapt, surround
from pneumarm.kernels import kernel


@kernel
def start(muscles, muscle_c, joints, joint_c, air, air_c, random):  # type: ignore[no-untyped-def]
    """Put all records into the begin state."""
    surroundings = air[0]
    surroundings.temperature = air_c[0].cold
    surround(surroundings, air_c[0], random, 1e9)  # so late that the fluctuation has forgotten its begin
    surroundings.temperature = air_c[0].cold
    for j in range(len(joints)):
        joints[j].angle = static_angle(muscle_c[j], joint_c[j], np.zeros(2), True)
        for m in range(2):
            place(muscles[j, m], muscle_c[j, m], muscle_length(joint_c[j], muscle_c[j, m], m, joints[j].angle))
            muscles[j, m].temperature = air_c[0].cold
            adapt(muscles[j, m], muscle_c[j, m])
            move(muscles[j, m], muscle_c[j, m], muscles[j, m].length, 0.0, surroundings.supply, 1.0, 0.0)


@kernel
def place(muscle, c, length):  # type: ignore[no-untyped-def]
    """Put a muscle at ``length`` [m], vented and with all creep and friction relaxed."""
    muscle.pressure = ATMOSPHERE
    muscle.length = length
    _, muscle.volume = braid(c, length)
    for i in range(ELEMENTS):
        muscle.creep[i] = length - c.length_at_zero
        muscle.slip[i] = 0.0

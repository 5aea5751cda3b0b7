"""The begin of a virtual arm's life: vented, relaxed and cold, as after a night."""

import numpy as np

from pneumarm.arm.virtual.joint import cable_run, muscle_length
from pneumarm.arm.virtual.muscle import braid, bring_to_length
from pneumarm.arm.virtual.parameters import ATMOSPHERE, ELEMENTS
from pneumarm.arm.virtual.rest import stand
from pneumarm.arm.virtual.slow import adapt, surround
from pneumarm.kernels import inner, kernel


@kernel
def start(body):  # type: ignore[no-untyped-def]
    """Put everything into the begin state."""
    surroundings, fixed = body.surroundings[0], body.constants
    cold = fixed.surroundings[0].cold
    surroundings.temperature = cold
    surround(body, 1e9)  # so late that the fluctuation has forgotten its begin
    surroundings.temperature = cold
    stand(fixed, np.zeros(body.muscles.shape), True, body.joints)
    for j in range(len(body.joints)):
        run, _ = cable_run(fixed, body.joints, j)
        for m in range(2):
            muscle, c = body.muscles[j, m], fixed.muscles[j, m]
            place(muscle, c, muscle_length(c, m, run))
            muscle.temperature = cold
            adapt(muscle, c)
            bring_to_length(muscle, c, muscle.length, 0.0, surroundings.supply, 1.0, 0.0)


@inner
def place(muscle, c, length):  # type: ignore[no-untyped-def]
    """Put a muscle at ``length`` [m], vented and with all creep and friction relaxed."""
    muscle.pressure = ATMOSPHERE
    muscle.length = length
    _, muscle.volume = braid(c, length)
    for i in range(ELEMENTS):
        muscle.creep[i] = length - c.length_at_zero
        muscle.slip[i] = 0.0

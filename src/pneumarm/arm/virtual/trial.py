"""Small trials with a joint, on a body of their own, that tell what kind of arm it is."""

import math

import numpy as np

from pneumarm.arm.virtual.joint import cable_run, muscle_length
from pneumarm.arm.virtual.muscle import bring_to_length
from pneumarm.arm.virtual.parameters import ATMOSPHERE, REFERENCE_TEMPERATURE
from pneumarm.arm.virtual.rest import stand
from pneumarm.arm.virtual.slow import adapt
from pneumarm.arm.virtual.start import place
from pneumarm.arm.virtual.state import INLET, JOINT, OUTLET
from pneumarm.arm.virtual.step import SUBSTEP, substep
from pneumarm.kernels import inner, kernel

LONGEST_FILL = 10.0
"""A muscle that is not full by then never is [s]."""
RING_TIME = 2.5
"""Time in which the closed arm has to swing to and fro [s]."""
RELEASE = math.radians(4)
"""How far the closed arm is moved before it is let go [rad]."""
_PATH = 16  # steps in which the arm is moved there, slowly
_TURNS = 4  # turning points that make a frequency


@kernel
def range_of_motion(constants, j, pressure, with_stops):  # type: ignore[no-untyped-def]
    """Return the lowest and highest angle [rad] of joint ``j``, and its shortest and longest muscle [m].

    One muscle of each joint is at gauge ``pressure`` [Pa], the other vented. Angles are those that are reached at
    least, whichever muscles of the other joints are full.
    """
    n = len(constants.joints)
    joints, pressures = np.zeros(n, JOINT), np.zeros((n, 2))
    lowest, highest, shortest, longest = -math.inf, math.inf, math.inf, 0.0
    for ends in range(1 << n):
        for i in range(n):
            high = (ends >> i) & 1
            pressures[i, 0], pressures[i, 1] = high * pressure, (1 - high) * pressure
        stand(constants, pressures, with_stops, joints)
        if (ends >> j) & 1:
            highest = min(highest, joints[j].angle)
        else:
            lowest = max(lowest, joints[j].angle)
        run, _ = cable_run(constants, joints, j)
        for m in range(2):
            length = muscle_length(constants.muscles[j, m], m, run)
            shortest, longest = min(shortest, length), max(longest, length)
    return lowest, highest, shortest, longest


@inner
def prepare(muscle, c, length, pressure):  # type: ignore[no-untyped-def]
    """Put a muscle at ``length`` [m] and gauge ``pressure`` [Pa], closed, relaxed, at the reference temperature."""
    place(muscle, c, length)
    muscle.open[INLET] = muscle.open[OUTLET] = 0
    muscle.temperature = REFERENCE_TEMPERATURE
    adapt(muscle, c)
    muscle.pressure = ATMOSPHERE + pressure
    bring_to_length(muscle, c, length, 0.0, ATMOSPHERE, 1.0, 0.0)


@kernel
def fill_time(body, j, m, target):  # type: ignore[no-untyped-def]
    """Return the time [s] from the command to ``target`` [Pa gauge] in muscle ``m`` of joint ``j``, at angle 0."""
    muscle, c, air = body.muscles[j, m], body.constants.muscles[j, m], body.constants.surroundings[0]
    prepare(muscle, c, c.length_at_zero, 0.0)
    muscle.open[INLET] = 1
    time = 0.0
    while muscle.pressure - ATMOSPHERE < target:
        if time > LONGEST_FILL:
            return math.inf
        time += SUBSTEP
        bring_to_length(muscle, c, c.length_at_zero, 0.0, air.supply, air.polytropic, SUBSTEP)
    return time + air.opening_delay


@inner
def pose(body, j, pressure, away):  # type: ignore[no-untyped-def]
    """Close all muscles at gauge ``pressure`` [Pa] and move joint ``j`` slowly ``away`` [rad] from where it rests."""
    joints, fixed, polytropic = body.joints, body.constants, body.constants.surroundings[0].polytropic
    stand(fixed, np.full(body.muscles.shape, pressure), True, joints)
    rest = joints[j].angle
    for i in range(_PATH + 1):
        joints[j].angle = rest + away * i / _PATH
        for k in range(len(joints)):
            joints[k].speed = 0.0
            run, _ = cable_run(fixed, joints, k)
            for m in range(2):
                muscle, c = body.muscles[k, m], fixed.muscles[k, m]
                length = muscle_length(c, m, run)
                if i == 0:
                    prepare(muscle, c, length, pressure)
                bring_to_length(muscle, c, length, 0.0, ATMOSPHERE, polytropic, 0.0)


@kernel
def ring_frequency(body, j, pressure):  # type: ignore[no-untyped-def]
    """Return the frequency [Hz] at which joint ``j`` swings when let go; 0 if it does not.

    All valves are closed, at gauge ``pressure`` [Pa]; the other joints begin at rest.
    """
    pose(body, j, pressure, RELEASE)
    turns, first, last, before = 0, 0.0, 0.0, 0.0
    for i in range(int(RING_TIME / SUBSTEP)):
        substep(body, ATMOSPHERE, body.constants.surroundings[0].polytropic, SUBSTEP)
        if body.joints[j].speed * before < 0.0:
            turns += 1
            last = i * SUBSTEP
            if turns == 1:
                first = last
            if turns == _TURNS:
                break
        before = body.joints[j].speed
    return 0.5 * (turns - 1) / (last - first) if turns > 1 else 0.0

"""Small trials with one joint that tell what kind of arm it is."""

import math

import numpy as np

from pneumarm.arm.virtual.joint import muscle_length
from pneumarm.arm.virtual.muscle import move
from pneumarm.arm.virtual.parameters import ATMOSPHERE, BAR, REFERENCE_TEMPERATURE
from pneumarm.arm.virtual.rest import static_angle
from pneumarm.arm.virtual.slow import adapt
from pneumarm.arm.virtual.start import place
from pneumarm.arm.virtual.state import INLET, JOINT, MUSCLE
from pneumarm.arm.virtual.step import SUBSTEP, substep
from pneumarm.kernels import kernel

LONGEST_FILL = 3.0
"""A muscle that is not full by then never is [s]."""
RING_TIME = 2.5
"""Time in which the closed arm has to swing to and fro [s]."""
RELEASE = math.radians(4)
"""How far the closed arm is moved before it is let go [rad]."""
_PATH = 16  # steps in which the arm is moved there, slowly
_TURNS = 4  # turning points that make a frequency


@kernel
def sweep(muscle_c, c):  # type: ignore[no-untyped-def]
    """Return the lowest and highest angle [rad] at 1 bar, and the shortest and longest muscle between [m]."""
    full = np.zeros(2)
    full[1] = 1.0 * BAR
    low = static_angle(muscle_c, c, full, False)
    full[0], full[1] = full[1], 0.0
    high = static_angle(muscle_c, c, full, False)
    shortest, longest = math.inf, 0.0
    for m in range(2):
        for angle in (low, high):
            length = muscle_length(c, muscle_c[m], m, angle)
            shortest, longest = min(shortest, length), max(longest, length)
    return low, high, shortest, longest


@kernel
def prepare(muscle, c, length, pressure):  # type: ignore[no-untyped-def]
    """Put a muscle at ``length`` [m] and gauge ``pressure`` [Pa], relaxed and at the reference temperature."""
    place(muscle, c, length)
    muscle.temperature = REFERENCE_TEMPERATURE
    adapt(muscle, c)
    muscle.pressure = ATMOSPHERE + pressure
    move(muscle, c, length, 0.0, ATMOSPHERE, 1.0, 0.0)


@kernel
def fill_time(muscle_c, joint_c, air_c, which, target):  # type: ignore[no-untyped-def]
    """Return the time [s] from the command to ``target`` [Pa gauge] in muscle ``which``, held at the angle 0."""
    muscle, c = np.zeros(1, MUSCLE)[0], muscle_c[0, which]
    prepare(muscle, c, c.length_at_zero, 0.0)
    muscle.open[INLET] = 1
    time = 0.0
    while muscle.pressure - ATMOSPHERE < target:
        if time > LONGEST_FILL:
            return math.inf
        time += SUBSTEP
        move(muscle, c, c.length_at_zero, 0.0, air_c[0].supply, air_c[0].polytropic, SUBSTEP)
    return time + air_c[0].opening_delay


@kernel
def ring_frequency(muscle_c, joint_c, air_c, pressure):  # type: ignore[no-untyped-def]
    """Return the frequency [Hz] at which the closed arm at gauge ``pressure`` [Pa] swings when let go; 0 if not."""
    muscles, joints = np.zeros((1, 2), MUSCLE), np.zeros(1, JOINT)
    pressures = np.full(2, pressure)
    rest = static_angle(muscle_c[0], joint_c[0], pressures, True)
    polytropic = air_c[0].polytropic
    for i in range(_PATH + 1):
        joints[0].angle = rest + RELEASE * i / _PATH
        for m in range(2):
            length = muscle_length(joint_c[0], muscle_c[0, m], m, joints[0].angle)
            if i == 0:
                prepare(muscles[0, m], muscle_c[0, m], length, pressure)
            move(muscles[0, m], muscle_c[0, m], length, 0.0, ATMOSPHERE, polytropic, 0.0)
    turns, first, last, before = 0, 0.0, 0.0, 0.0
    for i in range(int(RING_TIME / SUBSTEP)):
        substep(muscles, muscle_c, joints, joint_c, ATMOSPHERE, polytropic, SUBSTEP)
        if joints[0].speed * before < 0.0:
            turns += 1
            last = i * SUBSTEP
            if turns == 1:
                first = last
            if turns == _TURNS:
                break
        before = joints[0].speed
    return 0.5 * (turns - 1) / (last - first) if turns > 1 else 0.0

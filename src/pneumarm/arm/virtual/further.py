"""Further sensors of a virtual arm: velocity from faster samples, accelerometers of joints, thermometers of muscles.

    velocity        (median angle now - median angle 16 ms ago) / 16 ms, sampled every millisecond, as the
                    controller's firmware does it (thesis sections 5.1 and 7.3)
    acceleration    r d2phi/dt2 + g sin(phi) across the link, at r from its hinge, phi from where it hangs straight
                    down, and that of its hinge: an accelerometer cannot tell gravity from acceleration
    temperature     that of the muscle as a whole, without a delay of the thermometer's own

What an accelerometer or a thermometer says goes through the same converter as the other sensors. They draw their
noise from a random state of their own: angles and pressures are those of an arm without further sensors, but for the
rounding of substeps, which here end at the samples too.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec, Sensor
from pneumarm.arm.virtual.constants import GRAVITY
from pneumarm.arm.virtual.passing import pass_time
from pneumarm.arm.virtual.sensors import median_conversion, potentiometer
from pneumarm.errors import UnusableInput
from pneumarm.kernels import inner, kernel
from pneumarm.random import RandomState, random_state

KINDS = ("velocity", "acceleration", "temperature")
"""Kinds of further sensors."""
VELOCITY_MS = 16
"""Time over which the velocity is averaged [ms], as in the controller by default."""
MOUNTED = 0.2
"""Distance of an accelerometer from its hinge [m] (assumption)."""
NOISE = 0.7
"""Standard deviation of the converter's noise on an extra channel [counts] (assumption: as of the pressures)."""
ACCELEROMETER = 5 / 1023 / 0.3 * GRAVITY
"""What a count of an ADXL335 at 3 V, 300 mV a g, is worth on a converter of 5 V [m/s2]."""
MIDDLE = 1.5 / 5 * 1023
"""Counts of it at rest on a level table."""
MOST_ACCELERATION = 3.6 * GRAVITY
"""Largest acceleration that it tells [m/s2]."""
THERMOMETER = 5 / 1023 / 0.01
"""What a count of an LM35, 10 mV a degree, is worth on a converter of 5 V [Celsius]."""

_PAST = VELOCITY_MS + 1
_TICK = 1e-3  # s between two samples
_ROUNDING = 1e-6  # of a tick
_FEELER = np.dtype(
    [
        ("acceleration", "i8"),  # 1 for an accelerometer, 0 for a thermometer
        ("joint", "i8"),
        ("muscle", "i8"),
        ("scale", "f8"),
        ("offset", "f8"),
    ]
)


def usual_sensors(kinds: Iterable[str], joints: int = 1) -> tuple[bool, tuple[Sensor, ...]]:
    """Return whether velocity is among ``kinds``, and usual sensors of the others, on channels from 1 in this order.

    An ADXL335 a joint, an LM35 a muscle.

    Raises:
        UnusableInput: a kind that there is not, or one twice.

    """
    wanted = list(kinds)
    if not set(wanted) <= set(KINDS) or len(set(wanted)) < len(wanted):
        raise UnusableInput(f"expected further sensors of {', '.join(KINDS)}, joined by +, got {'+'.join(wanted)!r}")
    sensors: list[Sensor] = []
    for kind in wanted:
        for joint in range(1, joints + 1):
            if kind == "acceleration":
                channel = len(sensors) + 1
                sensors.append(Sensor("acceleration", joint, None, channel, ACCELEROMETER, -MIDDLE * ACCELEROMETER))
            elif kind == "temperature":
                sensors += [Sensor("temperature", joint, m, len(sensors) + m, THERMOMETER) for m in (1, 2)]
    return "velocity" in wanted, tuple(sensors)


class Further(NamedTuple):
    """Further sensors for kernels. Made by :func:`further_sensors`."""

    past: NDArray[np.float64]
    """Angles of the last milliseconds, a ring, shape (joints, VELOCITY_MS + 1) [counts]; (0, ...) if not needed."""
    tick: NDArray[np.int64]
    """Number of the newest of them: milliseconds of the arm's clock, shape (1,)."""
    random: RandomState
    feelers: NDArray[Any]
    """Accelerometers and thermometers, shape (n,)."""


def further_sensors(spec: ArmSpec, seed: int) -> Further:
    """Return the further sensors of ``spec``; nothing is sampled yet."""
    feelers = np.zeros(len(spec.sensors), _FEELER)
    for feeler, one in zip(feelers, spec.sensors, strict=True):
        place = one.kind == "acceleration", one.joint - 1, (one.muscle or 1) - 1
        for name, value in zip(_FEELER.names or (), (*place, one.scale, one.offset), strict=True):
            feeler[name] = value
    past = np.zeros((spec.joints if spec.velocity_sensor else 0, _PAST))
    return Further(past, np.full(1, -1, np.int64), random_state((seed, 1)), feelers)


def changing(further: Further) -> Sequence[NDArray[Any]]:
    """Return what of it changes while time passes."""
    return further.past, further.tick, further.random


@kernel
def begin_sampling(body, further):  # type: ignore[no-untyped-def]
    """Take the arm to have been at rest where it is now."""
    further.tick[0] = math.floor(body.surroundings[0].time / _TICK + _ROUNDING)
    for j in range(further.past.shape[0]):
        now = potentiometer(body, j, further.random)
        for i in range(further.past.shape[1]):
            further.past[j, i] = now


@kernel
def pass_sampling(body, further, until):  # type: ignore[no-untyped-def]
    """Let time pass until ``until`` [s], sampling the angle in the last milliseconds; earlier ones are forgotten."""
    last = math.floor(until / _TICK + _ROUNDING)
    for tick in range(max(further.tick[0] + 1, last - further.past.shape[1] + 1), last + 1):
        pass_time(body, min(tick * _TICK, until))
        further.tick[0] = tick
        for j in range(further.past.shape[0]):
            further.past[j, tick % further.past.shape[1]] = potentiometer(body, j, further.random)
    pass_time(body, until)


@inner
def felt_along(body, j):  # type: ignore[no-untyped-def]
    """Return what an accelerometer across link ``j`` feels [m/s2]."""
    joints, c = body.joints, body.constants.joints
    angle = 0.0
    for i in range(j + 1):
        angle += joints[i].angle + c[i].tilt
    turned, speed, acceleration, felt = 0.0, 0.0, 0.0, 0.0
    for i in range(j):  # how the hinges move that are further in
        turned += joints[i].angle + c[i].tilt
        speed += joints[i].speed
        acceleration += joints[i].acceleration
        apart = turned - angle
        felt += c[i].length * (acceleration * math.cos(apart) - speed * speed * math.sin(apart))
    return felt + MOUNTED * (acceleration + joints[j].acceleration) + GRAVITY * math.sin(angle)


@kernel
def sense_further(body, further, values):  # type: ignore[no-untyped-def]
    """Write what the further sensors say now into ``values``, in the order of :attr:`ArmSpec.further`."""
    c = body.constants.sensors[0]
    velocities, ring = further.past.shape
    for j in range(velocities):
        newest, oldest = further.tick[0] % ring, (further.tick[0] + 1) % ring
        values[j] = (further.past[j, newest] - further.past[j, oldest]) / VELOCITY_MS
    for i in range(further.feelers.shape[0]):
        feeler = further.feelers[i]
        if feeler.acceleration:
            felt = min(max(felt_along(body, feeler.joint), -MOST_ACCELERATION), MOST_ACCELERATION)
        else:
            felt = body.muscles[feeler.joint, feeler.muscle].temperature
        converted = (felt - feeler.offset) / feeler.scale
        counts = median_conversion(converted, NOISE, c, further.random, body.conversions)
        values[velocities + i] = feeler.offset + feeler.scale * counts

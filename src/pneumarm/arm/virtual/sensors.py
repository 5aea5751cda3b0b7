"""What the sensors say: noise, 10-bit conversion, and the median of several conversions (thesis A.1.3)."""

import math

import numpy as np

from pneumarm.arm.virtual.constants import BUMPS
from pneumarm.arm.virtual.parameters import ATMOSPHERE
from pneumarm.kernels import kernel
from pneumarm.random import normal, uniform

MOST_CONVERSIONS = 9
"""Most conversions of which a median is taken."""
BUMP_WIDTH = 6.0
"""Standard deviation of a worn place, about half a degree [counts]."""
TRACK = np.dtype(
    [
        ("rail", "f8"),  # the reading of a broken potentiometer, NaN for a whole one [counts]
        ("frozen", "f8"),  # the reading of one that slips, NaN for one that does not [counts]
        ("bend", "f8"),  # exponent of a logarithmic track, 0 for a linear one
        ("worn_at", "f8"),  # [counts]
        ("worn_width", "f8"),  # [counts]
        ("worn_height", "f8"),  # [counts]
        ("worn_contact", "f8"),  # [counts]
    ]
)
"""What faults have made of a potentiometer."""
_RIPPLES = (17.0, 7.0)  # lengths of the lasting errors of a worn track, in counts


@kernel
def convert(value, noise, c, random):  # type: ignore[no-untyped-def]
    """Return one conversion of ``value`` [counts]: with noise, rounded, within the converter's range."""
    disturbance = min(max(noise * normal(random), -c.noise_limit), c.noise_limit) if noise > 0.0 else 0.0
    return min(max(math.floor(value + disturbance + 0.5), 0.0), c.highest)


@kernel
def median_conversion(value, noise, c, random, sorted_):  # type: ignore[no-untyped-def]
    """Return the median of several conversions of ``value``, sorted by insertion into the scratch ``sorted_``."""
    for i in range(c.conversions):
        converted = convert(value, noise, c, random)
        place = i
        while place > 0 and sorted_[place - 1] > converted:
            sorted_[place] = sorted_[place - 1]
            place -= 1
        sorted_[place] = converted
    return sorted_[c.conversions // 2]


@kernel
def worn(value, c):  # type: ignore[no-untyped-def]
    """Return the angle [counts] as a worn track shows it."""
    bump = 0.0
    for i in range(BUMPS):
        distance = (value - c.bump_places[i]) / BUMP_WIDTH
        bump += c.bump_heights[i] * math.exp(-0.5 * distance * distance)
    return value + c.wear * bump


@kernel
def sense(muscles, joints, surroundings, sensors_c, random, scratch, angle, pressure):  # type: ignore[no-untyped-def]
    """Write the readings into ``angle`` (joints,) and ``pressure`` (joints, 2) [counts]; return the time [s]."""
    c = sensors_c[0]
    for j in range(len(joints)):
        value = c.middle + c.counts_per_radian * joints[j].angle
        if c.wear > 0.0:
            value = worn(value, c)
        angle[j] = median_conversion(value, c.angle_noise, c, random, scratch)
        if c.dropout > 0.0 and uniform(random) < c.dropout:
            angle[j] = 0.0
        for m in range(2):
            value = c.counts_per_pascal * (muscles[j, m].pressure - ATMOSPHERE)
            pressure[j, m] = median_conversion(value, c.pressure_noise, c, random, scratch)
    return surroundings[0].time


@kernel
def sense_with_faults(  # type: ignore[no-untyped-def]
    muscles, joints, surroundings, sensors_c, random, scratch, track, leap, angle, pressure
):
    """As :func:`sense`, with potentiometers ``track`` (joints,) and ``leap`` (joints, 2) [Pa] added to pressures."""
    c = sensors_c[0]
    for j in range(len(joints)):
        angle[j] = potentiometer(joints[j], track[j], c, random, scratch)
        for m in range(2):
            value = c.counts_per_pascal * (muscles[j, m].pressure - ATMOSPHERE + leap[j, m])
            pressure[j, m] = median_conversion(value, c.pressure_noise, c, random, scratch)
    return surroundings[0].time


@kernel
def potentiometer(joint, track, c, random, scratch):  # type: ignore[no-untyped-def]
    """Return what the potentiometer ``track`` says of ``joint`` [counts]."""
    value = c.middle + c.counts_per_radian * joint.angle
    if c.wear > 0.0:
        value = worn(value, c)
    value = shown(value, track, c, random)
    angle = median_conversion(value, c.angle_noise, c, random, scratch)
    if c.dropout > 0.0 and uniform(random) < c.dropout:
        angle = 0.0
    if not math.isnan(track.frozen):
        angle = track.frozen
    if not math.isnan(track.rail):
        angle = track.rail
    return angle


@kernel
def shown(value, track, c, random):  # type: ignore[no-untyped-def]
    """Return what a potentiometer with faults shows at the angle ``value`` [counts]."""
    if track.bend > 0.0:
        inside = min(max(value / c.highest, 0.0), 1.0)
        value = c.highest * math.expm1(track.bend * inside) / math.expm1(track.bend)
    if track.worn_height > 0.0 or track.worn_contact > 0.0:
        distance = (value - track.worn_at) / track.worn_width
        depth = math.exp(-0.5 * distance * distance)
        ripple = 0.5 * (math.sin(value / _RIPPLES[0]) + math.sin(value / _RIPPLES[1]))
        value += depth * (track.worn_height * ripple + track.worn_contact * normal(random))
    return value

"""What the sensors say: noise, 10-bit conversion, and the median of several conversions (thesis A.1.3)."""

import math

from pneumarm.arm.virtual.constants import BUMPS
from pneumarm.arm.virtual.parameters import ATMOSPHERE
from pneumarm.kernels import borrowed, inner, kernel
from pneumarm.random import normal, uniform

MOST_CONVERSIONS = 9
"""Most conversions of which a median is taken."""
BUMP_WIDTH = 6.0
"""Standard deviation of a worn place, about half a degree [counts]."""
_RIPPLES = (17.0, 7.0)  # lengths of the lasting errors of a worn track, in counts


@inner
def convert(value, noise, c, random):  # type: ignore[no-untyped-def]
    """Return one conversion of ``value`` [counts]: with noise, rounded, within the converter's range."""
    disturbance = min(max(noise * normal(random), -c.noise_limit), c.noise_limit) if noise > 0.0 else 0.0
    return min(max(math.floor(value + disturbance + 0.5), 0.0), c.highest)


@inner
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


@inner
def worn(value, c):  # type: ignore[no-untyped-def]
    """Return the angle [counts] as a worn track shows it."""
    bump = 0.0
    for i in range(BUMPS):
        distance = (value - c.bump_places[i]) / BUMP_WIDTH
        bump += c.bump_heights[i] * math.exp(-0.5 * distance * distance)
    return value + c.wear * bump


@kernel
def sense(body, angle, pressure):  # type: ignore[no-untyped-def]
    """Write the readings into ``angle`` (joints,) and ``pressure`` (joints, 2) [counts]; return the time [s]."""
    body, angle, pressure = borrowed((body, angle, pressure))
    c = body.constants.sensors[0]
    for j in range(len(body.joints)):
        angle[j] = potentiometer(body, j, body.sensor_random)
        for m in range(2):
            muscle = body.muscles[j, m]
            value = c.counts_per_pascal * (muscle.pressure - ATMOSPHERE + muscle.leap)
            pressure[j, m] = median_conversion(value, c.pressure_noise, c, body.sensor_random, body.conversions)
    return body.surroundings[0].time


@inner
def potentiometer(body, j, random):  # type: ignore[no-untyped-def]
    """Return what the potentiometer of joint ``j`` says [counts], with noise from ``random``."""
    c, track = body.constants.sensors[0], body.constants.joints[j]
    value = c.middle + c.counts_per_radian * body.joints[j].angle
    if c.wear > 0.0:
        value = worn(value, c)
    value = shown(value, track, c, random)
    angle = median_conversion(value, c.angle_noise, c, random, body.conversions)
    if c.dropout > 0.0 and uniform(random) < c.dropout:
        angle = 0.0
    if not math.isnan(track.frozen):
        angle = track.frozen
    if not math.isnan(track.rail):
        angle = track.rail
    return angle


@inner
def shown(value, track, c, random):  # type: ignore[no-untyped-def]
    """Return what a potentiometer with faults shows at the angle ``value`` [counts]; ``track``: JOINT_CONSTANTS."""
    if track.bend > 0.0:
        inside = min(max(value / c.highest, 0.0), 1.0)
        value = c.highest * math.expm1(track.bend * inside) / math.expm1(track.bend)
    if track.worn_height > 0.0 or track.worn_contact > 0.0:
        distance = (value - track.worn_at) / track.worn_width
        depth = math.exp(-0.5 * distance * distance)
        ripple = 0.5 * (math.sin(value / _RIPPLES[0]) + math.sin(value / _RIPPLES[1]))
        value += depth * (track.worn_height * ripple + track.worn_contact * normal(random))
    return value

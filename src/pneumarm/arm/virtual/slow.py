"""What changes slowly: creep of the rubber, heat of work and of the room, the supply. All updates are exact."""

import math

from pneumarm.arm.virtual.parameters import ATMOSPHERE, ELEMENTS, REFERENCE_TEMPERATURE
from pneumarm.kernels import inner
from pneumarm.random import normal

BLADDER_PER_DEGREE = 0.003
"""Relative change of the bladder's stiffness [1/K] (assumption, as all of these; no source was found)."""
BLADDER_LENGTH_PER_DEGREE = 0.0003
"""Relative change of the bladder's length [1/K]: a warm muscle stretches slightly (Shadow's manual)."""
FRICTION_PER_DEGREE = -0.015
"""Relative change of the dry friction [1/K]."""
VISCOSITY_PER_DEGREE = -0.025
"""Relative change of the viscous resistance [1/K]."""
THRESHOLD_PER_DEGREE = -0.005
"""Relative change of the threshold pressure [1/K]."""
DAY = 86400.0
"""Seconds of a day."""


@inner
def adapt(muscle, c):  # type: ignore[no-untyped-def]
    """Bring the parameters that depend on the muscle's temperature, and the creep's pull, up to date."""
    warmth = muscle.temperature - REFERENCE_TEMPERATURE
    muscle.bladder_stiffness = c.bladder_stiffness * (1.0 + BLADDER_PER_DEGREE * warmth)
    muscle.bladder_length = c.bladder_length * (1.0 + BLADDER_LENGTH_PER_DEGREE * warmth)
    muscle.threshold = c.threshold * (1.0 + THRESHOLD_PER_DEGREE * warmth)
    friction = max(0.0, 1.0 + FRICTION_PER_DEGREE * warmth)
    muscle.friction = c.friction * friction
    muscle.friction_per_pressure = c.friction_per_pressure * friction
    viscous = max(0.0, 1.0 + VISCOSITY_PER_DEGREE * warmth)
    muscle.viscosity = c.viscosity * viscous
    muscle.viscosity_per_pressure = c.viscosity_per_pressure * viscous
    muscle.creep_pull = 0.0
    for i in range(ELEMENTS):
        muscle.creep_pull += c.creep_stiffness[i] * muscle.creep[i]


@inner
def tick_muscle(muscle, c, room):  # type: ignore[no-untyped-def]
    """Let one slow tick pass in a muscle, in a room of the temperature ``room`` [Celsius]."""
    stretch = muscle.length - c.length_at_zero
    for i in range(ELEMENTS):
        muscle.creep[i] += (stretch - muscle.creep[i]) * c.creep_shares[i]
    muscle.temperature += muscle.heat / c.heat_capacity - (muscle.temperature - room) * c.cooling_share
    muscle.heat = 0.0
    adapt(muscle, c)


@inner
def relax_muscle(muscle, c, room, elapsed):  # type: ignore[no-untyped-def]
    """Let ``elapsed`` [s] pass in a muscle that rests: as :func:`tick_muscle`, for any time."""
    stretch = muscle.length - c.length_at_zero
    for i in range(ELEMENTS):
        muscle.creep[i] -= (stretch - muscle.creep[i]) * math.expm1(-elapsed / c.creep_times[i])
    cooling = math.expm1(-elapsed * c.heat_transfer / c.heat_capacity)
    muscle.temperature += muscle.heat / c.heat_capacity + (muscle.temperature - room) * cooling
    muscle.heat = 0.0
    adapt(muscle, c)


@inner
def sag(body, elapsed):  # type: ignore[no-untyped-def]
    """Let the supply give way for ``elapsed`` [s] to the air that all muscles took meanwhile."""
    surroundings, c, taken = body.surroundings[0], body.constants.surroundings[0], 0.0
    for j in range(len(body.joints)):
        for m in range(2):
            taken += body.muscles[j, m].taken
    fallen = c.droop * (taken - surroundings.drawn) / elapsed
    surroundings.sag += (surroundings.sag - fallen) * math.expm1(-elapsed / c.droop_time)
    surroundings.drawn = taken


@inner
def surround(body, elapsed):  # type: ignore[no-untyped-def]
    """Let ``elapsed`` [s] before the clock's time pass in the supply and in the room."""
    surroundings, c = body.surroundings[0], body.constants.surroundings[0]
    now = surroundings.time
    kept = math.exp(-elapsed / c.fluctuation_time)
    noise = c.fluctuation * math.sqrt(1.0 - kept * kept) * normal(body.supply_random)
    surroundings.deviation = surroundings.deviation * kept + noise
    phase = now / c.compressor_period
    saw = c.compressor * (1.0 - 2.0 * (phase - math.floor(phase)))  # the vessel empties until the compressor starts
    surroundings.supply = min(c.supply + surroundings.deviation + saw, c.safety_valve)
    if c.droop > 0.0:
        sag(body, elapsed)
        surroundings.supply = max(surroundings.supply - surroundings.sag, ATMOSPHERE)
    heated = now - DAY * math.floor(now / DAY) < c.day
    target = c.warm if heated else c.cold
    surroundings.temperature += (surroundings.temperature - target) * math.expm1(-elapsed / c.room_time)

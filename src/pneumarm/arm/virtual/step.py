"""Letting time pass: substeps of at most half a millisecond between valve edges and slow ticks.

The substep is a semi-implicit Euler step of the joints, then of the muscles at their new lengths. Its error is of
the first order, because valve edges fall on its boundaries exactly; in 5 s of random valves it stays below one
count in the nominal arm, and below half a count rms in any of 20 drawn ones (largest: 2.3 counts).
"""

import math

from pneumarm.arm.virtual.joint import accelerate, cable_run, muscle_direction, muscle_length
from pneumarm.arm.virtual.muscle import bring_to_length
from pneumarm.arm.virtual.parameters import ATMOSPHERE
from pneumarm.arm.virtual.slow import surround, tick_muscle
from pneumarm.arm.virtual.state import INLET, OUTLET, SLOW_TICK
from pneumarm.arm.virtual.valve import toggle_due
from pneumarm.kernels import inner, part

SUBSTEP = 0.5e-3
"""Longest substep [s]."""
_SETTLED = 3.0  # time constants in which 95 % are gone
_ROUNDING = 1e-6  # of a substep: a segment that is longer by less is not cut further


@part
def substep(body, supply, polytropic, dt):  # type: ignore[no-untyped-def]
    """Advance joints and muscles by ``dt`` [s] with the valves as they are."""
    accelerate(body, dt)
    for j in range(len(body.joints)):
        run, speed = cable_run(body.constants, body.joints, j)
        for m in range(2):
            muscle, c = body.muscles[j, m], body.constants.muscles[j, m]
            length = muscle_length(c, m, run)
            bring_to_length(muscle, c, length, muscle_direction(m) * speed, supply, polytropic, dt)


@part
def follow_sensors(body, supply, elapsed):  # type: ignore[no-untyped-def]
    """Let what sensors towards the valve read too much follow the air for ``elapsed`` [s]."""
    for j in range(len(body.joints)):
        for m in range(2):
            muscle, c = body.muscles[j, m], body.constants.muscles[j, m]
            if c.sensor_share > 0.0 or muscle.leap != 0.0:
                drop = (supply - muscle.pressure) * muscle.open[INLET]
                drop += (ATMOSPHERE - muscle.pressure) * muscle.open[OUTLET]
                followed = math.expm1(-_SETTLED * elapsed / c.sensor_settling)
                muscle.leap += (muscle.leap - c.sensor_share * drop) * followed


@inner
def slow_tick(body):  # type: ignore[no-untyped-def]
    """Let one slow tick pass in everything that changes slowly."""
    surroundings = body.surroundings[0]
    surroundings.tick = surroundings.time
    surround(body, SLOW_TICK)
    for j in range(len(body.joints)):
        for m in range(2):
            tick_muscle(body.muscles[j, m], body.constants.muscles[j, m], surroundings.temperature)


@inner
def integrate(body, until, longest):  # type: ignore[no-untyped-def]
    """Advance everything until the clock shows ``until`` [s], in substeps of at most ``longest`` [s]."""
    surroundings, polytropic = body.surroundings[0], body.constants.surroundings[0].polytropic
    while surroundings.time < until:
        now = surroundings.time
        tick = surroundings.tick + SLOW_TICK
        end = min(until, tick)
        for j in range(len(body.joints)):
            for m in range(2):
                end = min(end, toggle_due(body.muscles[j, m], now))
        count = max(1, math.ceil((end - now) / longest - _ROUNDING))
        dt = (end - now) / count
        supply = surroundings.supply
        for _ in range(count):
            substep(body, supply, polytropic, dt)
        follow_sensors(body, supply, end - now)
        surroundings.time = end
        if end >= tick:
            slow_tick(body)

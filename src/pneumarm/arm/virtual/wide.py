"""The wide distribution of virtual arms: sound arms that people might build, far from the thesis' one.

Most ranges are log-uniform around the nominal arm: inlets of 0.3 to 3 times the conductance, hoses of 0.3 to 8 m
with their delay and volume, lighter and heavier links. The supply has 1 to 3 bar gauge and may give way to what all
inlets take; gravity pulls from any side; the stroke is 40 to 140 degrees, by pulleys to match; muscles are up to
twice as strong; the control rate is 20 to 100 Hz; sensors have 8 to 16 bits, counts and noise of their own, and
pressures may be measured towards the valve.

An arm that no one would call sound is drawn again. :func:`is_sound` holds the rules.
"""

import math
from dataclasses import replace

import numpy as np

from pneumarm.arm.virtual.body import body_of
from pneumarm.arm.virtual.distribution import LENGTHS
from pneumarm.arm.virtual.parameters import (
    BAR,
    AirParameters,
    ArmParameters,
    JointParameters,
    MuscleParameters,
    RoomParameters,
    SensorParameters,
)
from pneumarm.arm.virtual.trial import fill_time, range_of_motion, ring_frequency
from pneumarm.errors import UnusableInput

LEAST_SWEEP = 0.7
"""Part of the way to each end stop that an arm must reach with one muscle full and the other vented."""
LEAST_RING = 0.8
"""Lowest frequency of the closed arm's oscillation [Hz]: a slower one hangs more than it is held."""
LONGEST_FILL = 4.0
"""Longest time from empty to 0.9 of the highest pressure [s]."""
SHORTEST_FILL = 3.0
"""Shortest, in control periods: a muscle that is full sooner cannot be controlled."""
MOST_SENSED = 0.6
"""What a sensor towards the valve reads too much with the inlet open, at most, as a part of the highest pressure."""
SPEED_OF_SOUND = 343.0
"""In air of 20 degrees Celsius [m/s]."""
_NOMINAL = MuscleParameters()
_STREAM = 10_2  # keeps these draws apart from those of the other distribution
_MOST_DRAWS = 1000


def draw_wide(seed: int) -> ArmParameters:
    """Return arm number ``seed`` of the wide distribution; the same number is always the same arm.

    Raises:
        UnusableInput: ``seed`` is negative.

    """
    if seed < 0:
        raise UnusableInput(f"the seed of a virtual arm must be 0 or more, got {seed}")
    random = np.random.default_rng([seed, _STREAM])
    for _ in range(_MOST_DRAWS):
        parameters = _Draw(random).arm()
        if is_sound(parameters):
            return parameters
    raise AssertionError("the wide distribution of arms holds no sound arm")


def is_sound(parameters: ArmParameters) -> bool:
    """Return whether such an arm can do what is asked of an arm; computed with the supply at its mean."""
    body, limit, air = body_of(parameters), parameters.max_pressure, parameters.air
    full = min(limit, air.supply)
    for j, joint in enumerate(parameters.joints):
        low, high, shortest, longest = range_of_motion(body.constants, j, full, True)
        fill = [fill_time(body, j, m, 0.9 * full) for m in range(2)]
        sensed = max(muscle.sensor_share for muscle in joint.muscles) * air.supply
        if not (
            min(-low, high) >= LEAST_SWEEP * joint.stop_angle
            and LENGTHS[0] <= shortest
            and longest <= LENGTHS[1]
            and SHORTEST_FILL * parameters.period <= min(fill)
            and max(fill) <= LONGEST_FILL
            and sensed <= MOST_SENSED * limit
            and ring_frequency(body, j, 0.1 * BAR) >= LEAST_RING
        ):
            return False
    return True


class _Draw:
    """One draw of a whole arm."""

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random

    def between(self, low: float, high: float) -> float:
        return float(self._random.uniform(low, high))

    def times(self, low: float, high: float) -> float:
        """Return a factor, log-uniform."""
        return math.exp(self.between(math.log(low), math.log(high)))

    def arm(self) -> ArmParameters:
        stroke, hose = math.radians(self.between(40, 140)), self.times(0.3, 8.0)
        supply = self.between(1.0, 3.0) * BAR
        limit = self.between(0.9, max(1.0, min(2.0, supply / BAR))) * BAR
        muscle = self.muscle(hose)
        one, other = (self.alike(muscle) for _ in range(2))
        return ArmParameters(
            joints=(
                JointParameters(
                    muscles=(one, other),
                    radius=0.034 * math.radians(90) / stroke * self.between(0.9, 1.1),
                    mass=self.times(0.1, 1.2),
                    distance=self.between(0.12, 0.3),
                    link_inertia=self.times(0.001, 0.01),
                    tilt=self.between(-math.pi, math.pi),
                    stop_angle=stroke / 2,
                    viscosity=self.between(0, 0.01),
                ),
            ),
            air=self.air(supply, hose, one.inlet),
            room=RoomParameters(cold=self.between(10, 20), warm=self.between(20, 26), time=self.between(3600, 7200)),
            sensors=self.sensors(stroke, limit),
            jitter=self.between(0.0, 2e-3),
            max_pressure=limit + 0.05 * BAR,
            period=1 / self.times(20.0, 100.0),
        )

    def muscle(self, hose: float) -> MuscleParameters:
        """Return what both muscles of a joint have in common, with a ``hose`` of so many metres."""
        strength = self.between(1.0, 2.0)
        wider, bore = math.sqrt(strength), self.between(2.5e-3, 4e-3)
        sensed = self._random.random() < 0.4
        return replace(
            _NOMINAL,
            diameter=_NOMINAL.diameter * wider,
            bladder_diameter=_NOMINAL.bladder_diameter * wider,
            bladder_stiffness=self.between(60, 150) * strength,
            threshold=self.between(0.02, 0.1) * BAR,
            viscosity=self.between(5, 13) * strength,
            viscosity_per_pressure=self.between(4, 13) * strength / BAR,
            friction=self.between(0.2, 1.0) * strength,
            friction_per_pressure=self.between(3, 10) * strength / BAR,
            dead_volume=10e-6 + math.pi / 4 * bore**2 * hose,
            inlet=_NOMINAL.inlet * self.times(0.3, 3.0),
            outlet=_NOMINAL.outlet * self.times(0.4, 2.0),
            critical_ratio=self.between(0.2, 0.4),
            leak=_NOMINAL.leak * self.times(0.2, 5.0),
            heat_transfer=self.between(0.14, 0.26),
            sensor_share=self.between(0.5, 1.0) * hose / (hose + 4.0) if sensed else 0.0,
            sensor_settling=0.010 * (1.0 + hose),
        )

    def alike(self, muscle: MuscleParameters) -> MuscleParameters:
        """Return a muscle that is much like ``muscle``."""
        return replace(
            muscle,
            diameter=muscle.diameter * self.between(0.97, 1.03),
            length_at_zero=muscle.length_at_zero + self.between(-0.004, 0.004),
            bladder_stiffness=muscle.bladder_stiffness * self.between(0.9, 1.1),
            threshold=muscle.threshold * self.between(0.9, 1.1),
            inlet=muscle.inlet * self.between(0.85, 1.15),
            outlet=muscle.outlet * self.between(0.85, 1.15),
            leak=muscle.leak * self.times(0.5, 2.0),
        )

    def air(self, supply: float, hose: float, inlet: float) -> AirParameters:
        sags = self._random.random() < 0.5
        taken = inlet * (supply + BAR)  # by one open inlet, choked
        return AirParameters(
            supply=supply,
            fluctuation=self.between(0.0, 0.04) * supply,
            fluctuation_time=self.between(2, 10),
            compressor=self.between(0.0, 0.02) * supply,
            compressor_period=self.between(60, 300),
            safety_valve=1.3 * supply,
            polytropic=self.between(1.1, 1.35),
            pipe_delay=0.001 + hose / SPEED_OF_SOUND,
            opening_time=self.between(0.001, 0.006),
            closing_time=self.between(0.001, 0.006),
            droop=self.between(0.03, 0.2) * supply / taken if sags else 0.0,
            droop_time=self.between(0.05, 0.5),
        )

    def sensors(self, stroke: float, limit: float) -> SensorParameters:
        bits = int(self._random.integers(8, 17))
        highest = 2.0**bits - 1
        noise = self.times(0.0003, 0.0025) * highest
        return SensorParameters(
            counts_per_degree=highest / (math.degrees(stroke) * self.between(1.15, 3.0)),
            counts_per_bar=highest / (limit / BAR * self.between(1.5, 5.0)),
            bits=bits,
            angle_noise=noise,
            pressure_noise=noise * self.between(0.5, 1.5),
            noise_limit=2.5 * noise,
            conversions=int(self._random.choice([1, 5, 9])),
        )

"""The distribution of virtual arms: no two are alike, and neither are the two muscles of a joint.

Every parameter is drawn independently from its range (uniform, or log-normal for conductances and leaks), and
an arm that could not do the job is drawn again: a sweep of less than 44 degrees either side, muscles beyond
150 to 246 mm, a ring of less than 1.8 Hz, or a fill time outside 0.55 to 1.3 s.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pneumarm.arm.virtual.body import body_of
from pneumarm.arm.virtual.parameters import (
    BAR,
    AirParameters,
    ArmParameters,
    JointParameters,
    MuscleParameters,
    RoomParameters,
    SensorParameters,
)
from pneumarm.arm.virtual.trial import fill_time, ring_frequency, sweep
from pneumarm.errors import UnusableInput

LEAST_SWEEP = math.radians(44)
"""Sweep that an arm must have either side [rad]."""
LENGTHS = (0.150, 0.246)
"""Range of a muscle's length over the sweep [m]."""
LEAST_RING = 1.8
"""Lowest frequency of the closed arm's oscillation [Hz]."""
FILL_TIMES = (0.55, 1.3)
"""Range of the time from 0 to 0.95 bar [s]."""
_STREAM = 10_1  # keeps the draws of an arm apart from the noise that has the same seed
_MOST_DRAWS = 1000


class Figures(NamedTuple):
    """Figures of one joint that decide whether an arm can do the job."""

    sweep: tuple[float, float]
    """Angles at rest with one muscle at 1 bar and the other vented, without end stops [rad]."""
    lengths: tuple[float, float]
    """Shortest and longest muscle over the sweep [m]."""
    ring: float
    """Frequency of the oscillation with all valves closed at 0.1 bar [Hz]."""
    fill: tuple[float, float]
    """Time in which each muscle is filled from 0 to 0.95 bar at the angle 0 [s]; inf if never."""

    @property
    def usable(self) -> bool:
        """Whether such an arm can do the job."""
        return (
            -self.sweep[0] >= LEAST_SWEEP
            and self.sweep[1] >= LEAST_SWEEP
            and LENGTHS[0] <= self.lengths[0]
            and self.lengths[1] <= LENGTHS[1]
            and all(FILL_TIMES[0] <= time <= FILL_TIMES[1] for time in self.fill)
            and self.ring >= LEAST_RING
        )


def figures(parameters: ArmParameters, joint: int = 0) -> Figures:
    """Return the figures of ``joint``, computed with the supply at its mean."""
    body = body_of(parameters)
    low, high, shortest, longest = sweep(body.constants, joint, 1.0 * BAR, False)
    first, second = (fill_time(body, joint, m, 0.95 * BAR) for m in range(2))
    ring = ring_frequency(body, joint, 0.1 * BAR)
    return Figures((low, high), (shortest, longest), ring, (first, second))


def draw_parameters(seed: int) -> ArmParameters:
    """Return arm number ``seed`` of the distribution; the same number is always the same arm.

    Raises:
        UnusableInput: ``seed`` is negative.

    """
    if seed < 0:
        raise UnusableInput(f"the seed of a virtual arm must be 0 or more, got {seed}")
    random = np.random.default_rng([seed, _STREAM])
    for _ in range(_MOST_DRAWS):
        parameters = _draw(random)
        if all(figures(parameters, joint).usable for joint in range(len(parameters.joints))):
            return parameters
    raise AssertionError("the distribution of arms holds no usable arm")


def _draw(random: np.random.Generator) -> ArmParameters:
    def between(low: float, high: float) -> float:
        return float(random.uniform(low, high))

    length_at_zero = between(0.190, 0.197)
    return ArmParameters(
        joints=(
            JointParameters(
                muscles=(_draw_muscle(random, length_at_zero), _draw_muscle(random, length_at_zero)),
                radius=between(0.031, 0.037),
                mass=between(0.28, 0.46),
                distance=between(0.19, 0.24),
                tilt=math.radians(between(-5, 5)),
                viscosity=between(0, 0.004),
            ),
        ),
        air=AirParameters(
            supply=between(0.98, 1.06) * BAR,
            fluctuation=between(0.02, 0.05) * BAR,
            fluctuation_time=between(2, 10),
            compressor_period=between(60, 300),
            polytropic=between(1.1, 1.3),
            pipe_delay=between(0.007, 0.013),
            opening_time=between(0.0015, 0.0025),
            closing_time=between(0.0015, 0.0025),
        ),
        room=RoomParameters(cold=between(16, 18), warm=between(20, 22), time=between(3600, 7200)),
        sensors=SensorParameters(angle_noise=between(1.3, 2.0), pressure_noise=between(1.3, 2.0)),
    )


def _draw_muscle(random: np.random.Generator, length_at_zero: float) -> MuscleParameters:
    def between(low: float, high: float) -> float:
        return float(random.uniform(low, high))

    def around(median: float, spread: float) -> float:
        return float(median * random.lognormal(0, spread))

    nominal = MuscleParameters()
    bladder_stiffness = between(60, 150)
    creep = bladder_stiffness / nominal.bladder_stiffness * between(0.5, 3)
    slip = between(0.8, 1.25)
    return replace(
        nominal,
        diameter=between(0.0288, 0.0312),
        weave_angle=math.radians(between(44, 46)),
        rest_length=between(0.176, 0.184),
        tip=between(1.0, 1.05),
        length_at_zero=length_at_zero + between(-0.003, 0.003),
        bladder_stiffness=bladder_stiffness,
        bladder_length=between(0.174, 0.186),
        threshold=between(0.025, 0.085) * BAR,
        bladder_diameter=between(0.0205, 0.0235),
        viscosity=between(5, 13),
        viscosity_per_pressure=between(4, 13) / BAR,
        friction=between(0.25, 0.6),
        friction_per_pressure=between(4, 7.5) / BAR,
        slip_lengths=tuple(slip * length for length in nominal.slip_lengths),
        creep_stiffness=tuple(creep * stiffness for stiffness in nominal.creep_stiffness),
        dead_volume=between(8e-6, 25e-6),
        inlet=around(8.8e-10, 0.12),
        outlet=around(2.5e-9, 0.15),
        critical_ratio=between(0.2, 0.4),
        leak=around(3e-8, 0.7) / BAR,
        seat_leak=between(0, 0.5e-8) / BAR,
        heat_transfer=between(0.14, 0.26),
    )

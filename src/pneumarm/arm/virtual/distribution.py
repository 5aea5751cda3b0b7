"""The distribution of virtual arms: no two are alike, and neither are the two muscles of a joint.

Every parameter is drawn independently from its range (uniform, or log-normal for conductances and leaks), and
an arm that could not do the job is drawn again: a sweep of less than 44 degrees either side, muscles beyond
150 to 246 mm, a ring of less than 1.8 Hz, or a fill time outside 0.55 to 1.3 s.

An arm of several joints is a chain about as long as two arms of one, its links lighter and shorter the more there
are. The muscles of an outer joint sit on the link before it, or at the base with cables that pass all joints between.
Its joints disturb each other, so each must sweep 35 degrees either side wherever the others are, and ring at 1.2 Hz.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pneumarm.arm.virtual.body import body_of
from pneumarm.arm.virtual.parameters import (
    BAR,
    MOST_JOINTS,
    AirParameters,
    ArmParameters,
    JointParameters,
    MuscleParameters,
    RoomParameters,
    SensorParameters,
)
from pneumarm.arm.virtual.trial import fill_time, range_of_motion, ring_frequency
from pneumarm.errors import UnusableInput

LEAST_SWEEP = math.radians(44)
"""Sweep that an arm must have either side [rad]."""
LENGTHS = (0.150, 0.246)
"""Range of a muscle's length over the sweep [m]."""
LEAST_RING = 1.8
"""Lowest frequency of the closed arm's oscillation [Hz]."""
LEAST_SWEEP_IN_CHAIN = math.radians(35)
"""The same of a joint among several, wherever the others are [rad]."""
LEAST_RING_IN_CHAIN = 1.2
"""The same of a joint among several [Hz]; the first carries all."""
FILL_TIMES = (0.55, 1.3)
"""Range of the time from 0 to 0.95 bar [s]."""
_STREAM = 10_1  # keeps the draws of an arm apart from the noise that has the same seed
_MOST_DRAWS = 1000
_DROOP = (0.3e7, 1.5e7)  # by which the one supply of all muscles gives way: 5 to 27 mbar an open inlet [Pa s/m3]
_PASSING = (0.003, 0.008)  # radii at which cables pass inner joints [m]


class Figures(NamedTuple):
    """Figures of one joint that decide whether an arm can do the job."""

    sweep: tuple[float, float]
    """Angles at rest with one muscle at 1 bar and the other vented, without end stops [rad]; of several joints what
    is reached at least, whichever ends the others are at."""
    lengths: tuple[float, float]
    """Shortest and longest muscle over the sweep [m]."""
    ring: float
    """Frequency of the oscillation with all valves closed at 0.1 bar [Hz]."""
    fill: tuple[float, float]
    """Time in which each muscle is filled from 0 to 0.95 bar at the angle 0 [s]; inf if never."""

    def usable(self, joints: int = 1) -> bool:
        """Return whether an arm of so many ``joints`` can do the job, as far as this one is concerned."""
        least = (LEAST_SWEEP, LEAST_RING) if joints == 1 else (LEAST_SWEEP_IN_CHAIN, LEAST_RING_IN_CHAIN)
        return (
            -self.sweep[0] >= least[0]
            and self.sweep[1] >= least[0]
            and LENGTHS[0] <= self.lengths[0]
            and self.lengths[1] <= LENGTHS[1]
            and all(FILL_TIMES[0] <= time <= FILL_TIMES[1] for time in self.fill)
            and self.ring >= least[1]
        )


def figures(parameters: ArmParameters, joint: int = 0) -> Figures:
    """Return the figures of ``joint``, computed with the supply at its mean."""
    body = body_of(parameters)
    low, high, shortest, longest = range_of_motion(body.constants, joint, 1.0 * BAR, False)
    first, second = (fill_time(body, joint, m, 0.95 * BAR) for m in range(2))
    ring = ring_frequency(body, joint, 0.1 * BAR)
    return Figures((low, high), (shortest, longest), ring, (first, second))


def draw_parameters(seed: int, joints: int = 1) -> ArmParameters:
    """Return arm number ``seed`` of the distribution of arms of so many ``joints``; a number is always the same arm.

    Raises:
        UnusableInput: ``seed`` is negative, or there are no arms of so many joints.

    """
    if seed < 0:
        raise UnusableInput(f"the seed of a virtual arm must be 0 or more, got {seed}")
    _require_joints(joints)
    random = np.random.default_rng([seed, _STREAM, *([joints] if joints > 1 else [])])
    for _ in range(_MOST_DRAWS):
        parameters = _draw(random, joints)
        if all(figures(parameters, joint).usable(joints) for joint in range(joints)):
            return parameters
    raise AssertionError("the distribution of arms holds no usable arm")


def nominal_parameters(joints: int = 1) -> ArmParameters:
    """Return the nominal arm of so many ``joints``: of several, the middle of what is drawn, muscles on the links.

    Raises:
        UnusableInput: there are no arms of so many joints.

    """
    _require_joints(joints)
    if joints == 1:
        return ArmParameters()
    links = [_link_ranges(j, joints) for j in range(joints)]
    return ArmParameters(joints=tuple(_with(JointParameters(), link, _middle) for link in links))


def _require_joints(joints: int) -> None:
    if not 1 <= joints <= MOST_JOINTS:
        raise UnusableInput(f"a virtual arm has 1 to {MOST_JOINTS} joints, got {joints}")


_Ranges = dict[str, tuple[float, float]]


def _link_ranges(j: int, joints: int) -> _Ranges:
    """Return the ranges of the parameters of joint ``j`` of a chain that are not those of a single joint.

    Outer pulleys are smaller, so that the light links on them swing at a few hertz too. With those the stops are what
    ends the stroke, and they end it where the sensor still sees the joint, pressed against them or not.
    """
    share = 2 / joints  # of what a link of two is
    mass, distance = ((0.20, 0.30), (0.09, 0.13)) if j < joints - 1 else ((0.12, 0.20), (0.16, 0.20))
    scaled = {"mass": mass, "distance": distance, "length": (0.19, 0.23)}
    return {
        **{name: (low * share, high * share) for name, (low, high) in scaled.items()},
        "link_inertia": (0.003, 0.005) if j == 0 else (0.006, 0.009),
        "radius": (0.031, 0.037) if j == 0 else (0.024, 0.029),
        "stop_angle": (math.radians(42.5), math.radians(42.5)),
    }


def _with(joint: JointParameters, link: _Ranges, choose: Callable[[float, float], float]) -> JointParameters:
    """Return ``joint`` with what ``choose`` picks from the ranges of ``link``."""
    chosen: dict[str, Any] = {name: choose(low, high) for name, (low, high) in link.items()}
    return replace(joint, **chosen)


def _middle(low: float, high: float) -> float:
    return (low + high) / 2


def _draw(random: np.random.Generator, joints: int = 1) -> ArmParameters:
    def between(low: float, high: float) -> float:
        return float(random.uniform(low, high))

    return ArmParameters(
        joints=tuple(_draw_joint(random, j, joints) for j in range(joints)),
        air=AirParameters(
            supply=between(0.98, 1.06) * BAR,
            fluctuation=between(0.02, 0.05) * BAR,
            fluctuation_time=between(2, 10),
            compressor_period=between(60, 300),
            polytropic=between(1.1, 1.3),
            pipe_delay=between(0.007, 0.013),
            opening_time=between(0.0015, 0.0025),
            closing_time=between(0.0015, 0.0025),
            droop=between(*_DROOP) if joints > 1 else 0.0,
        ),
        room=RoomParameters(cold=between(16, 18), warm=between(20, 22), time=between(3600, 7200)),
        sensors=SensorParameters(angle_noise=between(1.3, 2.0), pressure_noise=between(1.3, 2.0)),
    )


def _draw_joint(random: np.random.Generator, j: int, joints: int) -> JointParameters:
    def between(low: float, high: float) -> float:
        return float(random.uniform(low, high))

    length_at_zero = between(0.190, 0.197)
    joint = JointParameters(
        muscles=(_draw_muscle(random, length_at_zero), _draw_muscle(random, length_at_zero)),
        radius=between(0.031, 0.037),
        mass=between(0.28, 0.46),
        distance=between(0.19, 0.24),
        tilt=math.radians(between(-5, 5)),
        viscosity=between(0, 0.004),
    )
    if joints == 1:
        return joint
    joint = _with(joint, _link_ranges(j, joints), between)
    passes = random.random() < 0.5
    return replace(joint, passing=tuple(between(*_PASSING) for _ in range(j))) if passes else joint


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

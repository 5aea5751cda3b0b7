"""The parameters of a virtual arm as records for the kernels, with what can be computed once computed once."""

import math
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.virtual.parameters import ATMOSPHERE, BAR, ELEMENTS, MOST_JOINTS, ArmParameters, MuscleParameters
from pneumarm.arm.virtual.state import SLOW_TICK

BUMPS = 12
"""Worn places in the potentiometer's track."""

_ONLY_DERIVED = {"diameter", "weave_angle", "bladder_diameter", "slip_lengths"}
_SAME_NAME = [field.name for field in fields(MuscleParameters) if field.name not in _ONLY_DERIVED]
_VECTORS = {"slip_weights", "creep_times", "creep_stiffness"}

MUSCLE_CONSTANTS = np.dtype(
    [(name, "f8", (ELEMENTS,)) if name in _VECTORS else (name, "f8") for name in _SAME_NAME]
    + [
        ("per_rest_length", "f8"),  # 1 / l0 [1/m]
        ("per_tip", "f8"),  # 1 / k
        ("per_subsonic", "f8"),  # 1 / (1 - b)
        ("area", "f8"),  # A0 = pi D0^2 / 4 [m2]
        ("a", "f8"),  # 3 / tan^2 theta0
        ("b", "f8"),  # 1 / sin^2 theta0
        ("cosine_squared", "f8"),  # cos^2 theta0
        ("contact", "f8"),  # D0 / (sin theta0 (D0 - Db)): relative gap = contact sin theta - contact_offset
        ("contact_offset", "f8"),  # Db / (D0 - Db)
        ("slip_rates", "f8", (ELEMENTS,)),  # w_i / Delta_i [1/m]
        ("creep_total", "f8"),  # sum of G_k [N/m]
        ("creep_shares", "f8", (ELEMENTS,)),  # 1 - exp(-tick / tau_k)
        ("laminar_slope", "f8"),  # phi(beta) / (1 - beta)
        ("cooling_share", "f8"),  # 1 - exp(-tick hA / C)
    ]
)
JOINT_CONSTANTS = np.dtype(
    [
        ("inertias", "f8", (MOST_JOINTS,)),  # row of the links' A (see pneumarm.arm.virtual.chain) [kg m2]
        ("cables", "f8", (MOST_JOINTS,)),  # radii at which its cables run over it and over inner joints [m]
    ]
    + [
        (name, "f8")
        for name in (
            "length",  # of the link, to the next hinge [m]
            "weight",  # g h [N m]
            "own_inertia",  # what the mass matrix has besides where coupling is turned down [kg m2]
            "own_weight",  # and gravity [N m]
            "push",  # torque of what pushes the joint [N m]
            "tilt",
            "stop_angle",
            "stop_stiffness",
            "stop_damping",
            "viscosity",
            # what faults have made of its potentiometer:
            "rail",  # the reading of a broken one, NaN for a whole one [counts]
            "frozen",  # the reading of one that slips, NaN for one that does not [counts]
            "bend",  # exponent of a logarithmic track, 0 for a linear one
            "worn_at",  # [counts]
            "worn_width",  # [counts]
            "worn_height",  # [counts]
            "worn_contact",  # [counts]
        )
    ]
)
SURROUNDINGS_CONSTANTS = np.dtype(
    [
        (name, "f8")
        for name in (
            "supply",  # absolute [Pa]
            "fluctuation",
            "fluctuation_time",
            "compressor",
            "compressor_period",
            "safety_valve",  # absolute [Pa]
            "polytropic",
            "opening_delay",
            "closing_delay",
            "droop",  # [Pa s/m3]
            "droop_time",
            "cold",
            "warm",
            "room_time",
            "day",
        )
    ]
)
SENSOR_CONSTANTS = np.dtype(
    [
        ("counts_per_radian", "f8"),
        ("middle", "f8"),
        ("counts_per_pascal", "f8"),
        ("highest", "f8"),
        ("angle_noise", "f8"),
        ("pressure_noise", "f8"),
        ("noise_limit", "f8"),
        ("conversions", "i8"),
        ("wear", "f8"),
        ("dropout", "f8"),
        ("bump_places", "f8", (BUMPS,)),  # [counts]
        ("bump_heights", "f8", (BUMPS,)),  # relative, the highest is 1
    ]
)

GRAVITY = 9.81
"""Acceleration of gravity [m/s2]."""


class Constants(NamedTuple):
    """All records of an arm's constants, in the order in which the kernels take them."""

    muscles: NDArray[Any]
    """MUSCLE_CONSTANTS, shape (joints, 2)."""
    joints: NDArray[Any]
    """JOINT_CONSTANTS, shape (joints,)."""
    surroundings: NDArray[Any]
    """SURROUNDINGS_CONSTANTS, shape (1,)."""
    sensors: NDArray[Any]
    """SENSOR_CONSTANTS, shape (1,)."""


def constants(parameters: ArmParameters) -> Constants:
    """Return the records for ``parameters``."""
    joints = len(parameters.joints)
    muscles = np.zeros((joints, 2), MUSCLE_CONSTANTS)
    hinges = np.zeros(joints, JOINT_CONSTANTS)
    for j, joint in enumerate(parameters.joints):
        for m, muscle in enumerate(joint.muscles):
            _fill_muscle(muscles[j, m], muscle)
        for name in ("length", "tilt", "stop_angle", "stop_stiffness", "stop_damping", "viscosity"):
            hinges[j][name] = getattr(joint, name)
        for k, radius in enumerate(joint.passing):
            hinges[j]["cables"][k] = parameters.coupling * radius
        hinges[j]["cables"][j] = joint.radius
    hinges["rail"] = hinges["frozen"] = math.nan
    hinges["worn_width"] = 1.0
    made = Constants(muscles, hinges, _surroundings(parameters), _sensors(parameters))
    for j, joint in enumerate(parameters.joints):
        hang(made, j, joint.distance, joint.mass, parameters.coupling)
        _spread(made, j, joint.link_inertia, parameters.coupling)
    return made


def hang(constants: Constants, link: int, distance: float, mass: float, coupling: float) -> None:
    """Hang a ``mass`` [kg] on ``link``, ``distance`` [m] from its hinge; ``coupling`` is the arm's."""
    joints = constants.joints
    arms = np.where(np.arange(len(joints)) < link, joints["length"], 0.0)
    arms[link] = distance
    joints["inertias"][:, : len(joints)] += coupling * (mass * np.outer(arms, arms))
    joints["weight"] += coupling * (mass * GRAVITY * arms)
    reach = _outward(arms)  # of the mass about each joint, with the others at 0
    joints["own_inertia"] += (1 - coupling) * mass * reach**2
    joints["own_weight"] += (1 - coupling) * mass * GRAVITY * reach


def _spread(constants: Constants, link: int, inertia: float, coupling: float) -> None:
    """Give ``link`` a moment of ``inertia`` [kg m2] about its own centre."""
    constants.joints["inertias"][link, link] += coupling * inertia
    constants.joints["own_inertia"][: link + 1] += (1 - coupling) * inertia


def _outward(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return for each link the sum of ``values`` from there on."""
    return values[::-1].cumsum()[::-1]


def _fill_muscle(record: Any, muscle: MuscleParameters) -> None:
    for name in _SAME_NAME:
        record[name] = getattr(muscle, name)
    sine, cosine = math.sin(muscle.weave_angle), math.cos(muscle.weave_angle)
    record["per_rest_length"] = 1 / muscle.rest_length
    record["per_tip"] = 1 / muscle.tip
    record["per_subsonic"] = 1 / (1 - muscle.critical_ratio)
    record["area"] = math.pi * muscle.diameter**2 / 4
    record["a"] = 3 * (cosine / sine) ** 2
    record["b"] = 1 / sine**2
    record["cosine_squared"] = cosine**2
    gap = muscle.diameter - muscle.bladder_diameter
    record["contact"] = muscle.diameter / (sine * gap)
    record["contact_offset"] = muscle.bladder_diameter / gap
    record["slip_rates"] = np.divide(muscle.slip_weights, muscle.slip_lengths)
    record["creep_total"] = sum(muscle.creep_stiffness)
    record["creep_shares"] = -np.expm1(-SLOW_TICK / np.array(muscle.creep_times))
    b, beta = muscle.critical_ratio, muscle.laminar_ratio
    record["laminar_slope"] = math.sqrt(1 - ((beta - b) / (1 - b)) ** 2) / (1 - beta)
    record["cooling_share"] = -math.expm1(-SLOW_TICK * muscle.heat_transfer / muscle.heat_capacity)


def _surroundings(parameters: ArmParameters) -> NDArray[Any]:
    air, room = parameters.air, parameters.room
    record = np.zeros(1, SURROUNDINGS_CONSTANTS)
    for name in ("fluctuation", "fluctuation_time", "compressor", "compressor_period", "polytropic"):
        record[name] = getattr(air, name)
    record["droop"], record["droop_time"] = air.droop, air.droop_time
    record["supply"] = air.supply + ATMOSPHERE
    record["safety_valve"] = air.safety_valve + ATMOSPHERE
    record["opening_delay"] = air.pipe_delay + air.opening_time
    record["closing_delay"] = air.pipe_delay + air.closing_time
    record["cold"], record["warm"], record["room_time"], record["day"] = room.cold, room.warm, room.time, room.day
    return record


def _sensors(parameters: ArmParameters) -> NDArray[Any]:
    sensors = parameters.sensors
    record = np.zeros(1, SENSOR_CONSTANTS)
    for name in ("angle_noise", "pressure_noise", "noise_limit", "conversions", "wear", "dropout"):
        record[name] = getattr(sensors, name)
    record["counts_per_radian"] = math.degrees(sensors.counts_per_degree)
    record["middle"] = sensors.highest / 2
    record["counts_per_pascal"] = sensors.counts_per_bar / BAR
    record["highest"] = sensors.highest
    random = np.random.default_rng(sensors.wear_seed)
    record["bump_places"] = random.uniform(0, sensors.highest, BUMPS)
    heights = random.uniform(0.2, 1.0, BUMPS) * random.choice([-1.0, 1.0], BUMPS)
    record["bump_heights"] = heights / np.abs(heights).max()
    return record

"""The body of a virtual arm: all that kernels need to move it and to read its sensors, in one named tuple."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.virtual.constants import Constants, constants
from pneumarm.arm.virtual.parameters import ArmParameters
from pneumarm.arm.virtual.sensors import MOST_CONVERSIONS
from pneumarm.arm.virtual.state import JOINT, MUSCLE, SURROUNDINGS
from pneumarm.random import RandomState, random_states


class Body(NamedTuple):
    """State, constants and random states of a virtual arm. Made by :func:`body_of`."""

    muscles: NDArray[Any]
    """MUSCLE, shape (joints, 2)."""
    joints: NDArray[Any]
    """JOINT, shape (joints,)."""
    surroundings: NDArray[Any]
    """SURROUNDINGS, shape (1,)."""
    constants: Constants
    """What does not change but by faults."""
    supply_random: RandomState
    """Of the supply's fluctuation, shape (4,)."""
    sensor_random: RandomState
    """Of the sensors' noise, shape (4,)."""
    jitter_random: RandomState
    """Of the control cycle's lateness, shape (4,)."""
    conversions: NDArray[np.float64]
    """Workspace for the conversions of a reading, shape (MOST_CONVERSIONS,)."""
    lateness: float
    """Mean lateness of the control cycle [s]."""


def body_of(parameters: ArmParameters, seed: int = 0) -> Body:
    """Return the body of an arm, everything in it 0; see :func:`pneumarm.arm.virtual.start.start`."""
    joints = len(parameters.joints)
    supply_random, sensor_random, jitter_random = random_states(seed, 3)
    return Body(
        np.zeros((joints, 2), MUSCLE),
        np.zeros(joints, JOINT),
        np.zeros(1, SURROUNDINGS),
        constants(parameters),
        supply_random,
        sensor_random,
        jitter_random,
        np.zeros(MOST_CONVERSIONS),
        parameters.jitter / math.sqrt(2),  # an interval has two ends
    )

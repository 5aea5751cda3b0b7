"""The virtual arm: real pneumatics without an arm."""

from pneumarm.arm.virtual.arm import VirtualArm, resting_angle
from pneumarm.arm.virtual.distribution import Figures, draw_parameters, figures
from pneumarm.arm.virtual.parameters import (
    AirParameters,
    ArmParameters,
    JointParameters,
    MuscleParameters,
    RoomParameters,
    SensorParameters,
    preset_parameters,
    without_noise,
)

__all__ = [
    "AirParameters",
    "ArmParameters",
    "Figures",
    "JointParameters",
    "MuscleParameters",
    "RoomParameters",
    "SensorParameters",
    "VirtualArm",
    "draw_parameters",
    "figures",
    "preset_parameters",
    "resting_angle",
    "without_noise",
]

"""The arm: the seam that every arm implements, the guard, the control cycle, and the arms themselves."""

from pneumarm.arm.controller import Controller
from pneumarm.arm.cycle import BeginState, ControlCycle, Step
from pneumarm.arm.guard import GuardedArm, guarded
from pneumarm.arm.open import open_arm
from pneumarm.arm.seam import Arm, ArmSpec, Reading, Sensor

__all__ = [
    "Arm",
    "ArmSpec",
    "BeginState",
    "ControlCycle",
    "Controller",
    "GuardedArm",
    "Reading",
    "Sensor",
    "Step",
    "guarded",
    "open_arm",
]

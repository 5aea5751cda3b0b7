"""The check-up of an arm: what its sensors, valves and muscles do, what is wrong with them, and its calibration."""

from pneumarm.checkup.calibrate import Calibration, Known, calibrate
from pneumarm.checkup.diagnose import Finding, diagnose, joint_figures
from pneumarm.checkup.measure import Checkup, CheckupSettings, Trace, measure

__all__ = [
    "Calibration",
    "Checkup",
    "CheckupSettings",
    "Finding",
    "Known",
    "Trace",
    "calibrate",
    "diagnose",
    "joint_figures",
    "measure",
]

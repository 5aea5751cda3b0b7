"""The check-up of an arm: what its sensors, valves and muscles do, what is wrong with them, and its calibration."""

from pneumarm.checkup.calibrate import ArmCalibration, Known, calibrate
from pneumarm.checkup.diagnose import Complaint, diagnose
from pneumarm.checkup.figures import ends, joint_figures, quickening
from pneumarm.checkup.leaks import LeakRates, LeakTest, leak_test, leaking
from pneumarm.checkup.measure import Checkup, CheckupSettings, Trace, fill_alone, measure

__all__ = [
    "ArmCalibration",
    "Checkup",
    "CheckupSettings",
    "Complaint",
    "Known",
    "LeakRates",
    "LeakTest",
    "Trace",
    "calibrate",
    "diagnose",
    "ends",
    "fill_alone",
    "joint_figures",
    "leak_test",
    "leaking",
    "measure",
    "quickening",
]

"""Classical controllers, tuned on the arm: cascaded PID, gain-scheduled PID, PID with pulse-width modulation, and
sliding mode over the nine actions. None of them has a model of the arm but a calibrated static map and filling rates.
"""

from pneumarm.classical.tuned import KINDS, Tuned, is_tuned, load_tuned
from pneumarm.classical.tuning import TuneSettings, require_time, tune

__all__ = ["KINDS", "TuneSettings", "Tuned", "is_tuned", "load_tuned", "require_time", "tune"]

"""The monitor: what is wrong with an arm, found while it moves."""

from pneumarm.control.monitor.findings import Finding, marks_of
from pneumarm.control.monitor.monitor import Monitor
from pneumarm.control.monitor.settings import Mode, MonitorSettings, Weighing

__all__ = ["Finding", "Mode", "Monitor", "MonitorSettings", "Weighing", "marks_of"]

"""The monitor: what is wrong with an arm, found while it moves."""

from pneumarm.control.monitor.monitor import Finding, Monitor, MonitorSettings, marks_of

__all__ = ["Finding", "Monitor", "MonitorSettings", "marks_of"]

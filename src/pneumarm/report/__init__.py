"""The report: figures of one style, and a self-contained page of a run."""

from pneumarm.report.data import (
    CoverageData,
    Episodes,
    LearningData,
    MarkedData,
    Movement,
    QualityData,
    TrainingData,
    TransferData,
    read_episodes,
)
from pneumarm.report.page import Picture, Section, Table, render
from pneumarm.report.run_report import read_run, run_page, save_movement, save_spec, write_analysis, write_report
from pneumarm.report.sections import RunData

__all__ = [
    "CoverageData",
    "Episodes",
    "LearningData",
    "MarkedData",
    "Movement",
    "Picture",
    "QualityData",
    "RunData",
    "Section",
    "Table",
    "TrainingData",
    "TransferData",
    "read_episodes",
    "read_run",
    "render",
    "run_page",
    "save_movement",
    "save_spec",
    "write_analysis",
    "write_report",
]

"""The report: figures of one style, and a self-contained page of a run."""

from pneumarm.report.data import (
    CoverageData,
    Demonstration,
    MarkedData,
    QualityData,
    TrainingData,
    TransferData,
)
from pneumarm.report.page import Picture, Section, Table, render
from pneumarm.report.run_report import read_run, run_page, save_demonstration, save_spec, write_analysis, write_report
from pneumarm.report.sections import RunData

__all__ = [
    "CoverageData",
    "Demonstration",
    "MarkedData",
    "Picture",
    "QualityData",
    "RunData",
    "Section",
    "Table",
    "TrainingData",
    "TransferData",
    "read_run",
    "render",
    "run_page",
    "save_demonstration",
    "save_spec",
    "write_analysis",
    "write_report",
]

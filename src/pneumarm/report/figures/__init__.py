"""The figures of the report: pure functions from arrays to a figure that carries its text alternative."""

from pneumarm.report.figures.adaptation import CurveMark, adaptation_curves
from pneumarm.report.figures.baselines import Baseline, baselines
from pneumarm.report.figures.coverage import cells, new_share, projections
from pneumarm.report.figures.displacement import against_displacement
from pneumarm.report.figures.episodes import distributions
from pneumarm.report.figures.film import movement
from pneumarm.report.figures.importance import input_importance
from pneumarm.report.figures.isoplots import isoplot
from pneumarm.report.figures.marked import marked_rows
from pneumarm.report.figures.propagation import error_propagation, expectation
from pneumarm.report.figures.residues import Classification, residue_by_class, residues
from pneumarm.report.figures.training import spread_of_agents, training_curves
from pneumarm.report.figures.transfer import Phase, transfer_curves

__all__ = [
    "Baseline",
    "Classification",
    "CurveMark",
    "Phase",
    "adaptation_curves",
    "against_displacement",
    "baselines",
    "cells",
    "distributions",
    "error_propagation",
    "expectation",
    "input_importance",
    "isoplot",
    "marked_rows",
    "movement",
    "new_share",
    "projections",
    "residue_by_class",
    "residues",
    "spread_of_agents",
    "training_curves",
    "transfer_curves",
]

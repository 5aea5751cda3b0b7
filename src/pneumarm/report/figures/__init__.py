"""The figures of the report: pure functions from arrays to a figure, and the words that go with it.

Beside every function ``name`` that draws stands a function ``name_alt`` that says in words what it shows, with its
main numbers, for those who do not see it.
"""

from pneumarm.report.figures.adaptation import CurveMark, adaptation_curves, adaptation_curves_alt
from pneumarm.report.figures.baselines import Baseline, baselines, baselines_alt
from pneumarm.report.figures.coverage import cells, cells_alt, new_share, projections, projections_alt
from pneumarm.report.figures.displacement import against_displacement, against_displacement_alt
from pneumarm.report.figures.episodes import distributions, distributions_alt
from pneumarm.report.figures.importance import input_importance, input_importance_alt
from pneumarm.report.figures.isoplots import isoplot, isoplot_alt
from pneumarm.report.figures.marked import marked_rows, marked_rows_alt
from pneumarm.report.figures.movements import movement, movement_alt
from pneumarm.report.figures.propagation import error_propagation, error_propagation_alt, expectation
from pneumarm.report.figures.residues import (
    Classification,
    residue,
    residue_alt,
    residue_by_class,
    residue_by_class_alt,
)
from pneumarm.report.figures.training import (
    spread_of_agents,
    spread_of_agents_alt,
    training_curves,
    training_curves_alt,
)
from pneumarm.report.figures.transfer import Phase, transfer_curves, transfer_curves_alt

__all__ = [
    "Baseline",
    "Classification",
    "CurveMark",
    "Phase",
    "adaptation_curves",
    "adaptation_curves_alt",
    "against_displacement",
    "against_displacement_alt",
    "baselines",
    "baselines_alt",
    "cells",
    "cells_alt",
    "distributions",
    "distributions_alt",
    "error_propagation",
    "error_propagation_alt",
    "expectation",
    "input_importance",
    "input_importance_alt",
    "isoplot",
    "isoplot_alt",
    "marked_rows",
    "marked_rows_alt",
    "movement",
    "movement_alt",
    "new_share",
    "projections",
    "projections_alt",
    "residue",
    "residue_alt",
    "residue_by_class",
    "residue_by_class_alt",
    "spread_of_agents",
    "spread_of_agents_alt",
    "training_curves",
    "training_curves_alt",
    "transfer_curves",
    "transfer_curves_alt",
]

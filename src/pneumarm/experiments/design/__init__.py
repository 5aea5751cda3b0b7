"""Design of experiments: orthogonal arrays, and what results of their trials say (thesis section 5.3).

In the order of use: :mod:`.arrays`, :mod:`.assignment` of factors to columns, a :mod:`.table` of results, their
:mod:`.loss`, its :mod:`.effects`, tests of these by :mod:`.half_normal` plots and :mod:`.anova`, the :mod:`.best`
settings and their confirmation; :mod:`.analysis` does it all.
"""

from pneumarm.experiments.design.analysis import TableAnalysis, analyse_table
from pneumarm.experiments.design.arrays import NAMES, OrthogonalArray, orthogonal_array
from pneumarm.experiments.design.assignment import Design, Factor, WantedFactor, assign, load_design, thesis_design
from pneumarm.experiments.design.table import ResultTable, read_table

__all__ = [
    "NAMES",
    "Design",
    "Factor",
    "OrthogonalArray",
    "ResultTable",
    "TableAnalysis",
    "WantedFactor",
    "analyse_table",
    "assign",
    "load_design",
    "orthogonal_array",
    "read_table",
    "thesis_design",
]

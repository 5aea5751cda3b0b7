"""The empirical simulation: networks fitted to transitions, and how good they are."""

from pneumarm.simulation.fit import FitResult, FitSettings, StoreFit, by_quantity, fit, fit_store, refiltered
from pneumarm.simulation.quality import Statistics
from pneumarm.simulation.simulation import Scaling, Simulation

__all__ = [
    "FitResult",
    "FitSettings",
    "Scaling",
    "Simulation",
    "Statistics",
    "StoreFit",
    "by_quantity",
    "fit",
    "fit_store",
    "refiltered",
]

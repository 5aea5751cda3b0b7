"""The empirical simulation: networks fitted to transitions, and how good they are."""

from pneumarm.simulation.fit import FitResult, FitSettings, by_quantity, fit
from pneumarm.simulation.quality import Statistics
from pneumarm.simulation.simulation import Scaling, Simulation

__all__ = ["FitResult", "FitSettings", "Scaling", "Simulation", "Statistics", "by_quantity", "fit"]

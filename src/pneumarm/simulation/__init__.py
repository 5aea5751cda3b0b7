"""The empirical simulation: networks fitted to transitions, and how good they are."""

from pneumarm.simulation.arm import SimulationArm
from pneumarm.simulation.fit import FitResult, FitSettings, by_quantity, fit
from pneumarm.simulation.noise import NoiseSettings
from pneumarm.simulation.quality import Statistics
from pneumarm.simulation.simulation import Scaling, Simulation
from pneumarm.simulation.stored import StoredFit, fit_store

__all__ = [
    "FitResult",
    "FitSettings",
    "NoiseSettings",
    "Scaling",
    "Simulation",
    "SimulationArm",
    "Statistics",
    "StoredFit",
    "by_quantity",
    "fit",
    "fit_store",
]

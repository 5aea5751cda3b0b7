"""The empirical simulation: networks fitted to transitions, and how good they are."""

from pneumarm.simulation.arm import SimulationArm
from pneumarm.simulation.fit import (
    SINGLE_STEPS,
    FitResult,
    FitSettings,
    StoreFit,
    by_quantity,
    fit,
    fit_store,
    fitted_on,
    refiltered,
)
from pneumarm.simulation.noise import NoiseSettings
from pneumarm.simulation.quality import Statistics
from pneumarm.simulation.simulation import Scaling, Simulation

__all__ = [
    "SINGLE_STEPS",
    "FitResult",
    "FitSettings",
    "NoiseSettings",
    "Scaling",
    "Simulation",
    "SimulationArm",
    "Statistics",
    "StoreFit",
    "by_quantity",
    "fit",
    "fit_store",
    "fitted_on",
    "refiltered",
]

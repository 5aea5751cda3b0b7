"""From a store to a simulation: the filter, the fit, and its errors on what was kept apart."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from pneumarm.simulation.fit import FitResult, FitSettings, by_quantity, fit
from pneumarm.simulation.simulation import Simulation
from pneumarm.transitions import Filtered, GridSettings, Store, Window, filter_transitions


@dataclass(frozen=True)
class StoredFit:
    """A simulation fitted to a store."""

    fit: FitResult
    filtered: Filtered

    @property
    def simulation(self) -> Simulation:
        """The simulation."""
        return self.fit.simulation

    def results(self) -> dict[str, Any]:
        """Return the figures of the fit as ``results.json`` holds them."""
        generalisation = self.fit.generalisation
        return {
            "std": self.fit.std,
            "relative_error": self.fit.relative_error,
            "training_std": by_quantity(self.fit.training.std),
            "generalisation_std": None if generalisation is None else by_quantity(generalisation.std),
            "rows": self.fit.rows,
            "epochs": [len(curve) - 1 for curve in self.fit.curves],
            "seconds": self.fit.seconds,
        }


def fit_store(
    store: Store,
    settings: FitSettings | None = None,
    grid: GridSettings | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> StoredFit:
    """Filter the transitions in ``store`` and fit a simulation to them, in bounded memory.

    Raises:
        UnusableInput: the store holds too little, or the settings do not fit it.

    """
    settings = settings or FitSettings()
    window = Window(store.joints, settings.history)
    filtered = filter_transitions(store, window, grid, seed=settings.seed, hold_out=settings.held_out)
    fitted = fit(
        filtered.transitions,
        filtered.stream("held-out"),
        spec=store.spec,
        goal_range=store.percentiles(),
        valves=store.valves,
        generalisation=filtered.sample("generalisation"),
        settings=settings,
        progress=progress,
    )
    simulation = replace(fitted.simulation, hold_out=settings.held_out, hold_out_seed=settings.seed)
    return StoredFit(fitted._replace(simulation=simulation), filtered)

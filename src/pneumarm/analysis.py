"""What a store covers and how good a simulation of it is, gathered for the report (thesis sections 3.2.3 and 3.3)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.networks import importance, least_squares
from pneumarm.report.data import CoverageData, QualityData
from pneumarm.simulation import Simulation, by_quantity, refiltered
from pneumarm.simulation.fit import remarks
from pneumarm.simulation.quality import Resynchronisation, Statistics, propagation, statistics, validity
from pneumarm.transitions import Filtered, Store, Transitions, transitions
from pneumarm.transitions.choice import join_transitions, picked
from pneumarm.transitions.grid import CellCounts

Floats = NDArray[np.float64]

STEPS = 30
"""Steps that the error is propagated over: a second at 30 Hz (thesis section 3.3)."""
RESYNCHRONISE = 10
"""Steps between two resynchronisations with the database (thesis section 3.4)."""
_POINTS = 20_000  # transitions that figures are drawn from
_GROWTH = 20  # points of the curve of occupied cells
_IN_A_ROW = 200  # transitions in order of time, for the plot of the residue
_MOST_IN_CELL = 10_000  # cells that hold more are counted with these
_FEWEST = 50  # held-out transitions that say something


@dataclass(frozen=True)
class SimulationAnalysis:
    """Figures and data of an analysis."""

    coverage: CoverageData
    quality: QualityData
    figures: dict[str, Any]
    """Numbers by name: one-step errors, error propagation, invalid predictions, coverage; remarks where there are
    any."""

    def save(self, folder: Path) -> None:
        """Write the records that the report is drawn from to ``folder``."""
        self.coverage.save(folder)
        self.quality.save(folder)


def analyse(store: Store, simulation: Simulation, filtered: Filtered | None = None) -> SimulationAnalysis:
    """Analyse ``simulation`` on the sequences of ``store`` that it was not fitted to.

    Args:
        store: what it was fitted to, or another store of the same arm.
        simulation: any.
        filtered: the outcome of the filter where it is known already.

    Raises:
        UnusableInput: store and simulation do not fit, or too little is stored.

    """
    if store.valves != simulation.valves:
        raise UnusableInput(
            f"{store.address}: holds {_commands(store.valves)}, the simulation is of {_commands(simulation.valves)}"
        )
    store = store.drawn()
    filtered = filtered or refiltered(store, simulation)
    apart = _in_order(filtered)
    errors = statistics(simulation, apart)
    steps = _longest(apart, STEPS)
    spread = propagation(simulation, apart, steps)
    valid = validity(simulation, apart, filtered.filter.holds_data, steps)
    states = filtered.transitions.inputs[:, : simulation.window.state_size]
    remedy = Resynchronisation(states[:: max(1, len(states) // 10_000)], RESYNCHRONISE)
    remedied = propagation(simulation, apart, steps, resynchronisation=remedy)
    window = simulation.window
    figures: dict[str, Any] = {
        "held_out": _errors(errors, window.further),
        "propagation": {
            "steps": steps,
            "measured": by_quantity(spread.measured[-1], window.further),
            "expected": by_quantity(spread.expected[-1], window.further),
            "resynchronised": by_quantity(remedied.measured[-1], window.further),
        },
        "invalid": {"simulated": float(valid.simulated[-1]), "recorded": float(valid.recorded[-1])},
        "filter": filtered.coverage.summary(),
    }
    if said := [*store.used, *remarks(errors, simulation)]:
        figures["remarks"] = said
    return SimulationAnalysis(
        coverage=_coverage(store, filtered),
        quality=_quality(simulation, filtered, apart, window.of_joints(spread.measured)),
        figures=figures,
    )


def _commands(valves: bool) -> str:
    return "valves" if valves else "continuous commands"


def _in_order(filtered: Filtered, most: int = 300_000) -> Transitions:
    """Return held-out transitions in the order of their recording, whole blocks until there are ``most``."""
    parts, count = [], 0
    for block in filtered.stream("held-out"):
        parts.append(block)
        count += len(block.sequence)
        if count >= most:
            break
    if count < _FEWEST:
        raise UnusableInput(
            f"{count} transitions of sequences that were kept out of the fit are too few to judge by; collect more"
        )
    return join_transitions(parts)


def _longest(apart: Transitions, steps: int) -> int:
    """Return the most steps, up to ``steps``, that follow on each other in at least one sequence."""
    _, lengths = np.unique(apart.sequence, return_counts=True)
    return int(min(steps, max(1, lengths.max())))


def _errors(errors: Statistics, further: Sequence[str]) -> dict[str, Any]:
    return {
        "std": by_quantity(errors.std, further),
        "relative_error": by_quantity(errors.relative, further),
        "mean": by_quantity(errors.mean, further),
        "slope": by_quantity(errors.slope, further),
        "calibration": by_quantity(errors.calibration, further),
    }


def _coverage(store: Store, filtered: Filtered) -> CoverageData:
    grid = filtered.filter.grid
    counts, growth = CellCounts(), [(0, 0)]
    for block in store.blocks(rows=max(1, store.transitions // _GROWTH)):
        counts.add(grid.cells(transitions(block, grid.window).inputs))
        held = counts.arrays()[1]
        growth.append((int(held.sum()), len(held)))
    apart = filtered.sample("generalisation", _POINTS)
    kept = filtered.transitions
    # Where nearly every transition has a cell of its own, nearly all of them are kept.
    sample = kept if apart is None or len(apart.sequence) < min(len(kept.sequence), _POINTS) else apart
    return CoverageData(
        observation=grid.window.of_joints(sample.observation).astype(np.float64),
        cells_holding=np.bincount(np.minimum(filtered.filter.counts.arrays()[1], _MOST_IN_CELL)),
        cells=grid.size,
        per_cell=filtered.filter.settings.per_cell,
        growth=np.array(growth),
    )


def _quality(simulation: Simulation, filtered: Filtered, apart: Transitions, measured: Floats) -> QualityData:
    """Return the first transitions in a row, then a sample of all held-out ones, with a linear fit's weights."""
    count = len(apart.sequence)
    head = np.arange(min(_IN_A_ROW, count))
    rest = np.random.default_rng(0).permutation(np.arange(len(head), count))[: _POINTS - len(head)]
    shown = picked(apart, np.concatenate([head, np.sort(rest)]))
    window, places = simulation.window, simulation.outputs
    kept = filtered.transitions
    x = simulation.scaling.inputs(kept.inputs, window)
    y = kept.target[:, places].astype(np.float64) - kept.observation[:, places]
    names = window.input_names()
    outputs = [names[place].removesuffix("[k]") for place in places]
    weights = importance(least_squares(x, y), x, y, names, outputs)
    return QualityData(
        observation=window.of_joints(shown.observation).astype(np.float64),
        target=window.of_joints(shown.target).astype(np.float64),
        predicted=window.of_joints(simulation.predict(shown.inputs)),
        command=shown.inputs[:, window.state_size :].reshape(-1, window.joints, 2).astype(np.float64),
        time=shown.time - apart.time.min(),
        propagation=measured,
        weights=weights.weight,
        inputs=tuple(names),
        outputs=tuple(outputs),
    )

"""What the rows say of the settings of shaping: differences from the thesis' within runs."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec
from pneumarm.drawing.colours import DARK, GREY, MIDDLE
from pneumarm.experiments.analysis import analysed, filled_words
from pneumarm.experiments.comparison import mean_and_spread
from pneumarm.experiments.design.table import packaged_results
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import Array, difference, mean
from pneumarm.experiments.pictures import dots
from pneumarm.experiments.shaping_settings.shapings import ShapingSettings
from pneumarm.experiments.trainings import CRITERIA, LEARNING
from pneumarm.experiments.verdict import Interval, interval
from pneumarm.learning import TrainSettings
from pneumarm.learning.online.shaping import initial_deviation, stage
from pneumarm.report.page import Picture, Table
from pneumarm.report.style import panels, styled

_CRITERIA = ("reward", "success_rate", LEARNING, "actions", "switches", "episodes", "met")
_SHOWN = ("reward", "success_rate", "episodes")
_SMALLEST = 1e-9

Tables = Mapping[str, NDArray[np.float64]]
"""Tables by figure, shapes (trials, runs)."""
Differences = Mapping[str, list[Interval | None]]
"""Differences of the trials from their references by figure, None for a reference itself."""


def analysis(experiment: ShapingSettings, rows: TrialRows) -> Analysis:
    """Return every trial's results and its difference from the thesis' settings within runs."""
    tables = {name: rows.table(name, list(experiment.trials)) for name in _CRITERIA}
    references = {n: experiment.reference(n) for n in experiment.trials}
    differences = {
        name: [None if n == of else difference(rows, name, n, of) for n, of in references.items()]
        for name in _CRITERIA
    }
    words, found = filled_words(experiment, rows, **shaping_evidence(experiment, tables, len(rows.arms)))
    strategy, results = words.sections
    drawn = Picture(
        strategy_figure(experiment.train_settings(1), ArmSpec()),
        strategy.figure,
        "Exploration falls from 0.5 to 0.05 and temperature from 20 to 1; the criterion rises to 0.95.",
    )
    shown = {CRITERIA[name]: [mean(rows, name, trial) for trial in experiment.trials] for name in _SHOWN}
    changes = {
        name: [[each.mean, each.half] if each else None for each in ones] for name, ones in differences.items()
    }
    means = {name: table.mean(axis=1).tolist() for name, table in tables.items()}
    return analysed(
        experiment,
        rows,
        words,
        found,
        figures={"rows": len(rows.rows), "results": means, "differences": changes},
        pictures={0: [drawn], 1: [dots(list(experiment.trials.values()), shown, results.figure, reference=0)]},
        tables={1: [_results(experiment, tables, differences, results.table)]},
    )


def shaping_evidence(experiment: ShapingSettings, tables: Tables, arms: int) -> dict[str, Any]:
    """Return what claims are judged by, and the thesis' numbers beside it."""
    by_name = {name: number - 1 for number, name in experiment.trials.items()}
    shaped, without = by_name["as in the thesis"], by_name["no shaping"]
    worn, worn_without = by_name["worn, as in the thesis"], by_name["worn, no shaping"]
    # The thesis made runs 1 to 3 with shaping and without.
    with_it, without_it = (
        {name: table[:, :3] for name, table in packaged_results(f"pneumarm.experiments.{one}", *_THEIRS).items()}
        for one in ("all_goals", "no_shaping")
    )
    spreads = (one["reward"].std(axis=1, ddof=1).mean() for one in (with_it, without_it))
    in_words, spread = _spread(tables["reward"][shaped], tables["reward"][without], arms)
    return {
        "in_words": in_words,
        "spread": spread,
        "share": _share(tables["met"][without]),
        "share_worn": _share(tables["met"][worn_without]),
        "share_shaped": _share(tables["met"][worn]),
        "their_reward": interval((with_it["reward"] - without_it["reward"]).ravel()),
        "their_episodes": -float((with_it["episodes"] - without_it["episodes"]).mean()),
        "their_spread": " against ".join(f"{one:.2f}" for one in spreads),
    }


_THEIRS = ("reward", "episodes")


def _results(experiment: ShapingSettings, tables: Tables, differences: Differences, caption: str) -> Table:
    header = ["settings", "reward", "difference within runs", "greedy success", "success, learning on"]
    header += ["episodes", "difference within runs", "criterion met"]
    lines = [
        [
            f"{trial} {name}",
            mean_and_spread(tables["reward"][place]),
            str(differences["reward"][place] or "reference"),
            *(f"{100 * tables[n][place].mean():.1f} %" for n in ("success_rate", LEARNING)),
            mean_and_spread(tables["episodes"][place]),
            _whole(differences["episodes"][place]),
            f"{100 * tables['met'][place].mean():.0f} %",
        ]
        for place, (trial, name) in enumerate(experiment.trials.items())
    ]
    return Table(header, lines, caption)


def _spread(shaped: Array, without: Array, arms: int) -> tuple[str, Interval]:
    """Return both standard deviations on an arm in words, and the logarithm of their ratio, over arms."""
    tables = [values.reshape(arms, -1) for values in (shaped, without)]
    if tables[0].shape[1] < 2:
        return "one run", Interval(math.nan, math.inf, 0)
    x, y = (np.maximum(values.std(axis=1, ddof=1), _SMALLEST) for values in tables)
    return " against ".join(f"{math.sqrt((v * v).mean()):.2f}" for v in (x, y)), interval(np.log(x / y), arms)


def _share(met: NDArray[np.float64]) -> str:
    return f"{int(met.sum())} of {len(met)} agents"


def _whole(found: Interval | None) -> str:
    return "reference" if found is None else f"{found:+.0f}"


@styled
def strategy_figure(settings: TrainSettings, spec: ArmSpec) -> Figure:
    """Draw exploration, temperature and criterion against the deviation (thesis fig. 4.3)."""
    low, high = spec.angle_range
    deviations = np.linspace(initial_deviation(settings, spec), high - low, 50)
    stages = [stage(float(d), settings, spec) for d in deviations]
    figure, axes = panels(1, 3, 2.2)
    for axis, values, label, colour in (
        (axes[0, 0], [s.schedule.epsilon for s in stages], "exploration ε", DARK),
        (axes[0, 1], [s.schedule.temperature for s in stages], "temperature T [reward]", MIDDLE),
        (axes[0, 2], [s.criterion for s in stages], "criterion (success rate)", GREY),
    ):
        axis.plot(deviations, values, color=colour)
        axis.set_xlabel("deviation [counts]")
        axis.set_ylabel(label)
        axis.set_ylim(0, None)
    return figure

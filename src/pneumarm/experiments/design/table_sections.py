"""An analysis as sections of a page."""

from collections.abc import Mapping, Sequence
from functools import partial
from types import MappingProxyType

import numpy as np

from pneumarm.experiments.design.analysis import TableAnalysis
from pneumarm.experiments.design.assignment import Level
from pneumarm.experiments.design.effect_plots import effects_figure, half_normal_figure, half_normal_runs_figure
from pneumarm.experiments.design.effects import Effects
from pneumarm.report.page import Picture, Section, Table

_MOST_RUNS = 8  # side by side; of more only the losses are shown


def table_sections(
    analysis: TableAnalysis, quantity: str, prefix: str = "", cited: Mapping[str, str] = MappingProxyType({})
) -> list[Section]:
    """Return the sections on one table of results of a ``quantity``; ``prefix`` keeps titles of several apart.

    ``cited`` names the thesis' counterparts of the parts, for experiments that are its own: of ``results``, ``runs``,
    ``half-normal runs``, ``mean``, ``std``, ``half-normal`` and ``ranking``. Without factors there are effects of
    columns, and no best settings.
    """
    factors = analysis.design.factors
    meant = "; ".join(f"{factor.label}: {factor.name}" for factor in factors)
    sections = [
        Section(
            _title(prefix, "results"),
            [f"{analysis.goal.capitalize()} is better. Losses are of all runs of a trial."],
            tables=[_results(analysis, quantity, cited)],
        ),
        Section(
            _title(prefix, "effects"),
            [f"{meant}. {_significance(analysis)}" if factors else _significance(analysis)],
            _pictures(analysis, quantity, cited),
            [_rankings(analysis, cited)],
        ),
        Section(
            _title(prefix, "analysis of variance"),
            [
                "Runs are blocks: in each, all trials begin with the same weights."
                if analysis.results.shape[1] > 1
                else ""
            ],
            tables=[_variance(analysis)],
        ),
    ]
    return [*sections, Section(_title(prefix, "best settings"), _derivation(analysis))] if factors else sections


def _title(prefix: str, title: str) -> str:
    whole = f"{prefix}: {title}" if prefix else title
    return whole[0].upper() + whole[1:]


def _caption(text: str, part: str, cited: Mapping[str, str]) -> str:
    """Return the caption ``text`` of a part, with its counterpart in the thesis if there is one."""
    return f"{text} (as thesis {cited[part]})." if part in cited else f"{text}."


def _results(analysis: TableAnalysis, quantity: str, cited: Mapping[str, str]) -> Table:
    """Return the loss table: trials with their settings, results and losses."""
    factors = analysis.design.factors
    runs = analysis.results.shape[1] if analysis.results.shape[1] <= _MOST_RUNS else 0
    losses = list(analysis.losses)
    rows = []
    for trial, results in enumerate(analysis.results, 1):
        settings = analysis.design.settings(trial)
        rows.append(
            [
                str(trial),
                *(f"{settings[f.label]}" for f in factors),
                *(f"{value:.2f}" for value in results[:runs]),
                *(f"{analysis.losses[name][trial - 1]:.2f}" for name in losses),
            ]
        )
    header = ["trial", *(f"{f.label}: {f.name}" for f in factors), *(f"run {r + 1}" for r in range(runs)), *losses]
    caption = f"Loss table: {quantity} by trial and run, and its losses"
    return Table(header, rows, _caption(caption, "results", cited))


def _pictures(analysis: TableAnalysis, quantity: str, cited: Mapping[str, str]) -> list[Picture]:
    """Return the effects plots and the half-normal plots."""
    largest = _column(analysis, analysis.effects["mean"].ranking[0])
    drawn = []
    if len(analysis.runs) > 1:
        lines = {f"run {number}": found for number, found in enumerate(analysis.runs, 1)}
        drawn.append(
            Picture(
                partial(effects_figure, analysis, lines, quantity),
                _caption(f"Effects on the {quantity} for all runs apart, a line a run", "runs", cited),
                f"{len(lines)} lines in {analysis.design.array.columns} columns.",
            )
        )
        drawn.append(
            Picture(
                partial(half_normal_runs_figure, analysis, quantity),
                _caption("Half-normal probability plots for all runs apart, a line a run", "half-normal runs", cited),
                f"Largest effects by run: {', '.join(f'{found.sizes.max():.2f}' for found in analysis.runs)}.",
            )
        )
    names = tuple(name for name in ("mean", "std") if name in analysis.effects)
    for name in names:
        largest = _column(analysis, analysis.effects[name].ranking[0])
        drawn.append(
            Picture(
                partial(effects_figure, analysis, {name: analysis.effects[name]}, f"{name} of {quantity}"),
                _caption(f"Effects on the {name} of the {quantity}", name, cited),
                f"The largest effect is that of column {largest}.",
            )
        )
    drawn.append(
        Picture(
            partial(half_normal_figure, analysis, names, quantity),
            _caption("Half-normal probability plots of the effects, with Lenth's margins", "half-normal", cited),
            "; ".join(f"{name}: beyond the margin {_listed(analysis, name)}" for name in names),
        )
    )
    return drawn


def _derivation(analysis: TableAnalysis) -> list[str]:
    """Return in words how the best settings were derived."""
    design, best = analysis.design, analysis.best
    steps = [
        f"{design.factor(s.factor).name} {design.factor(s.factor).levels[s.level]} "
        f"(column {_column(analysis, s.column)}, rank {s.rank} of the {s.criterion})"
        for s in best.steps
    ]
    text = [
        f"Fixed in this order: {'; '.join(steps)}.",
        f"The best settings are {_described(best.settings, analysis)}.",
    ]
    if best.trial is None:
        text.append("No trial has them: a confirmation run is needed.")
    else:
        results = analysis.results[best.trial - 1]
        spread = f", standard deviation {results.std(ddof=1):.2f}" if len(results) > 1 else ""
        rank = int((np.sort(analysis.losses["mean"])[::-1] > results.mean()).sum()) + 1
        text.append(
            f"Trial {best.trial} has them: mean {results.mean():.2f}{spread}, "
            f"the {_ordinal(rank)} highest mean of {design.array.trials}."
        )
    return text


def _described(settings: Mapping[str, Level], analysis: TableAnalysis) -> str:
    """Return ``settings`` in words."""
    return ", ".join(f"{analysis.design.factor(label).name} {level}" for label, level in settings.items())


def _significance(analysis: TableAnalysis) -> str:
    names = [name for name in ("mean", "std") if name in analysis.lenth]
    return " ".join(f"Beyond Lenth's margin for the {name}: {_listed(analysis, name)}." for name in names)


def _listed(analysis: TableAnalysis, name: str) -> str:
    return ", ".join(_column(analysis, column) for column in analysis.significant(name)) or "none"


def _column(analysis: TableAnalysis, column: int) -> str:
    label = analysis.design.label(column)
    return f"{column} ({label})" if label else str(column)


def _rankings(analysis: TableAnalysis, cited: Mapping[str, str]) -> Table:
    names = [name for name in ("mean", "std") if name in analysis.effects]
    found: Sequence[Effects] = [analysis.effects[name] for name in names]
    rows = []
    for rank in range(analysis.design.array.columns):
        row = [str(rank + 1)]
        for effect in found:
            column = effect.ranking[rank]
            row += [_column(analysis, column), f"{effect.sizes[column - 1]:.2f}"]
        rows.append(row)
    header = ["rank", *(part for name in names for part in (name, "effect"))]
    caption = _caption("Columns by the size of their effects", "ranking", cited)
    return Table(header, rows, caption)


def _variance(analysis: TableAnalysis) -> Table:
    rows = [
        [
            source.name,
            f"{source.squares:.1f}",
            str(source.freedom),
            *(
                "" if np.isnan(v) else form(v)
                for v, form in ((source.ratio, _two), (source.p, _p), (source.share, _share))
            ),
        ]
        for source in analysis.variance
    ]
    return Table(
        ["source", "sum of squares", "freedom", "F", "p", "share"], rows, "Analysis of variance of the results."
    )


def _two(value: float) -> str:
    return f"{value:.2f}"


def _p(value: float) -> str:
    return "< 0.0001" if value < 1e-4 else f"{value:.4f}"


def _share(value: float) -> str:
    return f"{100 * value:.1f} %"


def _ordinal(rank: int) -> str:
    if rank == 1:
        return "very"
    suffix = "th" if 10 <= rank % 100 <= 20 else {1: "st", 2: "nd", 3: "rd"}.get(rank % 10, "th")
    return f"{rank}{suffix}"

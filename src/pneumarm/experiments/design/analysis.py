"""The whole analysis of a table of trials by runs: losses, effects, rankings, tests, best settings."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.errors import UnusableInput
from pneumarm.experiments.design.anova import Source, anova, smallest
from pneumarm.experiments.design.assignment import Design, Level
from pneumarm.experiments.design.best import Aim, Best, Confirmation, confirm, derive
from pneumarm.experiments.design.distributions import t_quantile
from pneumarm.experiments.design.effects import Effects, effects
from pneumarm.experiments.design.half_normal import Lenth, lenth
from pneumarm.experiments.design.loss import Loss, loss

Array = NDArray[np.float64]
Goal = Literal["larger", "smaller"]
"""Which results are good."""
SIGNAL_TO_NOISE: tuple[Loss, ...] = ("larger", "smaller", "nominal")


@dataclass(frozen=True)
class TableAnalysis:
    """What a table of results says about the factors of its design."""

    design: Design
    goal: Goal
    results: Array
    """Shape (trials, runs)."""
    losses: Mapping[str, Array]
    """Losses by name, shapes (trials,): mean, std where there are two runs, and the signal-to-noise ratios."""
    effects: Mapping[str, Effects]
    """Effects on these losses."""
    runs: tuple[Effects, ...]
    """Effects on the results of each run."""
    lenth: Mapping[str, Lenth]
    """Margins of error of these losses; empty for arrays of fewer than three columns or with more than two levels."""
    variance: tuple[Source, ...]
    """Analysis of variance of the results with the runs as blocks; of one run, half the columns pooled as error."""
    best: Best
    """Best settings by the rankings of mean and std together."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns: number and label."""
        return tuple(f"{c} {label}".strip() for c, label in enumerate(self.design.labels(), 1))

    @property
    def error(self) -> tuple[float, int]:
        """Mean square of the error and its degrees of freedom."""
        source = self.variance[-2]
        return source.mean_square, source.freedom

    def margin(self, loss_name: str) -> float:
        """Return how large the effect of a two-level column on a loss may be by chance, with 95 % confidence.

        On the mean half its confidence interval, t sqrt(4 V_error / results); on other losses Lenth's margin of
        error. Infinite where neither is known.
        """
        if loss_name == "mean":
            square, freedom = self.error
            return t_quantile(0.95, freedom) * math.sqrt(4 * square / self.results.size)
        return self.lenth[loss_name].margin if loss_name in self.lenth else math.inf

    def significant(self, loss_name: str) -> tuple[int, ...]:
        """Return the columns whose effect on a loss is beyond Lenth's margin of error, largest first."""
        if loss_name not in self.lenth:
            return ()
        found, margin = self.effects[loss_name], self.lenth[loss_name].margin
        return tuple(column for column in found.ranking if found.sizes[column - 1] > margin)

    def confirm(self, observed: ArrayLike, settings: Mapping[str, Level] | None = None) -> Confirmation:
        """Compare runs (runs,) at ``settings``, by default the best, with what the larger half of effects predict."""
        levels = self.best.levels if settings is None else self.levels(settings)
        columns = self.effects["mean"].ranking[: self.design.array.columns // 2]
        return confirm(self.design, self.results, levels, columns, observed, self.error)

    def levels(self, settings: Mapping[str, Level]) -> dict[str, int]:
        """Return the numbers of the levels of ``settings`` (by label).

        Raises:
            UnusableInput: a factor is missing, or has no such level.

        """
        numbers = {}
        for factor in self.design.factors:
            if factor.label not in settings or settings[factor.label] not in factor.levels:
                raise UnusableInput(
                    f"factor {factor.label}: expected one of {', '.join(map(str, factor.levels))}, "
                    f"got {settings.get(factor.label)!r}"
                )
            numbers[factor.label] = factor.levels.index(settings[factor.label])
        return numbers

    def figures(self) -> dict[str, Any]:
        """Return what ``taguchi analyse --json`` says."""
        return {
            "ranking": {name: list(self.effects[name].ranking) for name in ("mean", "std") if name in self.effects},
            "effects": {name: found.sizes.tolist() for name, found in self.effects.items()},
            "averages": {name: [a.tolist() for a in found.averages] for name, found in self.effects.items()},
            "losses": {name: values.tolist() for name, values in self.losses.items()},
            "lenth": {name: found._asdict() for name, found in self.lenth.items()},
            "significant": {name: list(self.significant(name)) for name in self.lenth},
            "anova": [
                {
                    "source": s.name,
                    "squares": s.squares,
                    "freedom": s.freedom,
                    "f": s.ratio,
                    "p": s.p,
                    "share": s.share,
                }
                for s in self.variance
            ],
            "columns": dict(
                zip(map(str, range(1, self.design.array.columns + 1)), self.design.labels(), strict=True)
            ),
            "best": {
                "settings": dict(self.best.settings),
                "trial": self.best.trial,
                "steps": [
                    {"factor": s.factor, "level": s.level, "column": s.column, "by": s.criterion, "rank": s.rank}
                    for s in self.best.steps
                ],
            },
        }


def analyse_table(design: Design, results: ArrayLike, goal: Goal = "larger") -> TableAnalysis:
    """Return the analysis of ``results`` (trials, runs), of which ``goal`` ones are good.

    Raises:
        UnusableInput: the results do not fit the design, or are not finite.

    """
    y, array = np.asarray(results, np.float64), design.array
    if y.ndim != 2 or y.shape[0] != array.trials or y.shape[1] < 1:
        raise UnusableInput(f"{array.name} needs {array.trials} trials of at least one run, got {y.shape}")
    if not np.isfinite(y).all():
        raise UnusableInput("results must be finite numbers; there are others or missing ones")
    losses = {"mean": loss(y, "mean")} | ({"std": loss(y, "std")} if y.shape[1] > 1 else {})
    for kind in SIGNAL_TO_NOISE:
        try:
            losses[f"signal to noise, {kind}"] = loss(y, kind)
        except UnusableInput:
            continue  # not defined for these results
    found = {name: effects(array, values) for name, values in losses.items()}
    criteria = [Aim("mean", found["mean"], goal == "larger")]
    if "std" in found:
        criteria.append(Aim("std", found["std"], larger=False))
    testable = array.columns >= 3 and bool((array.counts == 2).all())
    pooled = smallest(found["mean"].sizes, -(-array.columns // 2)) if y.shape[1] == 1 else ()
    return TableAnalysis(
        design=design,
        goal=goal,
        results=y,
        losses=losses,
        effects=found,
        runs=tuple(effects(array, y[:, run]) for run in range(y.shape[1])),
        lenth={name: lenth(values.sizes) for name, values in found.items()} if testable else {},
        variance=anova(array, y, [f"{c} {label}".strip() for c, label in enumerate(design.labels(), 1)], pooled),
        best=derive(design, criteria),
    )

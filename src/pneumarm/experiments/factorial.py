"""Experiments with the thesis' agent: its settings varied by a design, every trial trained and tested (section 5.4).

The same class does all of them; what they are is data, in the folder of each.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.experiments.comparison import side_by_side
from pneumarm.experiments.design.analysis import Goal, TableAnalysis, analyse_table
from pneumarm.experiments.design.assignment import Design, Factor
from pneumarm.experiments.design.loss import loss
from pneumarm.experiments.experiment import ARMS, Analysis, Claim, Figures, LaboratorySettings, TrialRows, claims_of
from pneumarm.experiments.means import at_limit, over_arms
from pneumarm.experiments.preparation import Simulated
from pneumarm.experiments.trainings import CRITERIA, EXPLORING, LEARNING, Trainings, train_and_test, with_settings
from pneumarm.experiments.verdict import Criterion, Interval, interval
from pneumarm.experiments.words import Words
from pneumarm.learning import TrainSettings

Array = NDArray[Any]
ALL = tuple(part for name in ("reward", "actions", "switches") for part in (name, EXPLORING + name))
"""What a test gives, greedy and exploring."""


def _goal(criterion: str) -> Goal:
    return "larger" if criterion.removeprefix(EXPLORING) in ("reward", "gain", "success_rate") else "smaller"


_IN_WORDS = {**CRITERIA, "gain": "change of the reward by training on"}
Analyses = Mapping[str, TableAnalysis]
"""Analyses by criterion."""
Finding = Callable[["Factorial", TrialRows, Analyses, Analyses], dict[str, Any]]
"""Returns what claims are judged by, from the rows, their analyses and the thesis'."""


MATTERS = {"reward": 2.0, "gain": 2.0, "actions": 1.0, "switches": 0.5, "episodes": 1000.0}
"""Sizes that matter, of effects and differences: of the reward two actions, a quarter of what a switch costs."""
Spread = Literal["mean", "std"]
"""The losses that the thesis ranks by."""


class EffectClaim(NamedTuple):
    """What the thesis says of the effect of a column of two levels on a criterion."""

    criterion: str
    column: int
    raises: bool
    """Whether it is the higher level that gives more."""
    about: str
    """See :attr:`~.experiment.Claim.about`."""
    loss: Spread = "mean"
    """Loss that the effect is on; ``std`` for the spread of the runs."""
    slight: float | None = None
    """Size that it does not reach, where the thesis calls it slight."""


@dataclass(frozen=True, kw_only=True)
class Factorial(Trainings):
    """Trainings by an orthogonal array, each tested; all criteria of section 5.2."""

    name: str
    words: Words
    runs: int
    arms = ARMS
    design: Design
    base: TrainSettings
    """What no factor sets."""
    thesis: Mapping[str, Array]
    """The thesis' results by criterion, shapes (trials, its runs)."""
    goal: float | None = None
    """The only angle to learn [counts]; None for all."""
    continued: int | None = None
    """Episodes until which training goes on after the criterion is met; then ``gain`` is what it changed."""
    criteria: tuple[str, ...] = (*ALL, "episodes")
    """What is analysed."""
    effect_claims: tuple[EffectClaim, ...] = ()
    """What the thesis concludes of single effects."""
    cited: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    """The thesis' counterparts of what is shown of each criterion (:func:`~.table_sections.table_sections`)."""
    findings: tuple["Finding", ...] = ()
    """What its words' claims are judged by (:mod:`.findings`)."""

    @property
    def trials(self) -> Mapping[int, str]:
        """Trials of the array."""
        return {
            trial: ", ".join(f"{label} {_level(level)}" for label, level in self.design.settings(trial).items())
            for trial in range(1, self.design.array.trials + 1)
        }

    def settings(self) -> Any:
        """Return the settings of every trial, the goal, and how long training goes on."""
        return {"trials": super().settings(), "goal": self.goal, "continued": self.continued}

    def train_settings(self, trial: int) -> TrainSettings:
        """Return the settings of the training of ``trial``."""
        levels = self.design.settings(trial)
        return with_settings(self.base, {factor.setting: levels[factor.label] for factor in self.design.factors})

    def measure(self, material: Simulated, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train and test one agent."""
        wanted = self.train_settings(trial)
        found = dict(train_and_test(material, wanted, run, settings, self.goal))
        if self.continued is None:
            return found
        # The same seed: the first episodes of this training are those of the one above.
        longer = replace(wanted, stops=False, max_episodes=self.continued)
        later = train_and_test(material, longer, run, settings, self.goal)
        tests = [test for test in ("", EXPLORING) if f"{test}reward" in found]
        gains = {f"{test}gain": later[f"{test}reward"] - found[f"{test}reward"] for test in tests}
        return {**later, **gains, "episodes": found["episodes"]}

    def analyse(self, rows: TrialRows) -> Analysis:
        """Return rankings, effects and tests of every criterion, beside the thesis'."""
        from pneumarm.experiments.design.table_sections import table_sections

        ours, theirs = self.analyses(rows)
        results = {n: a.results for n, a in ours.items()}
        sections = [side_by_side(self.trials, results, self.thesis, _IN_WORDS, self.labels)]
        for name, analysis in ours.items():
            if name.startswith(EXPLORING):
                continue  # these are in the table above; their pictures would double the page
            sections += table_sections(analysis, _IN_WORDS.get(name, name), name, self.cited.get(name, {}))
        return Analysis(
            summary=[self.words.question, *self._answer(rows, ours)],
            figures={
                "rows": len(rows.rows),
                "arms": list(rows.arms),
                **{
                    name: float(rows.table(name, list(self.trials)).mean())
                    for name in ("success_rate", EXPLORING + "success_rate", LEARNING)
                    if name in rows.figures
                },
                "ours": {name: analysis.figures() for name, analysis in ours.items()},
                "thesis": {name: analysis.figures() for name, analysis in theirs.items()},
            },
            sections=sections,
            claims=self.claims(rows, ours, theirs),
        )

    @property
    def labels(self) -> str:
        """What the letters of the factors mean."""
        return "; ".join(f"{factor.label}: {factor.name}" for factor in self.design.factors) + "."

    def analyses(self, rows: TrialRows) -> tuple[Analyses, Analyses]:
        """Return the analyses of ``rows`` and of the thesis' tables."""
        names = [name for name in self.criteria if name in rows.figures]
        tables = {name: rows.table(name, list(self.trials)) for name in names}
        ours, theirs = (
            {name: analyse_table(self.design, table, _goal(name)) for name, table in given.items()}
            for given in (tables, self.thesis)
        )
        return ours, theirs

    def claims(self, rows: TrialRows, ours: Analyses, theirs: Analyses) -> tuple[Claim, ...]:
        """Return what the thesis says of single effects, its effect next to ours, and what else it concludes."""
        found = []
        for claim in self.effect_claims:
            for name in (claim.criterion, EXPLORING + claim.criterion):
                # One run says nothing of the spread.
                if name in ours and (claim.loss == "mean" or rows.runs > 1):
                    effect = self.effect(rows, name, claim.column, ours[name], claim.loss)
                    found.append(_effect_claim(claim, _IN_WORDS[name], theirs[claim.criterion], self.design, effect))
        known = {name: one for find in self.findings for name, one in find(self, rows, ours, theirs).items()}
        return (*found, *claims_of(self.words.filled(known), known))

    def effect(
        self, rows: TrialRows, criterion: str, column: int, analysis: TableAnalysis, loss_name: Spread = "mean"
    ) -> Interval:
        """Return the signed effect of a column of two levels with its interval over arms.

        Beside it, as its median, stands the difference of the medians: over all runs at each level, or of the spread
        over all trials. No trial that diverges decides it. Of one arm the analysis knows the margin.
        """
        tables = [rows.table(criterion, list(self.trials), arm) for arm in rows.arms]
        limited = at_limit(*tables)
        if len(rows.arms) == 1:
            signed = float(analysis.effects[loss_name].signed[column - 1])
            runs = analysis.results.shape[1]
            return Interval(signed, analysis.margin(loss_name), runs, arms=1, limited=limited)
        level = self.design.array.column(column)
        high, low = level == level.max(), level == level.min()
        losses = [table if loss_name == "mean" else loss(table, loss_name) for table in tables]
        plain, robust = (
            interval([reduced(one[high]) - reduced(one[low]) for one in losses], len(losses))
            for reduced in (np.mean, np.median)
        )
        return plain._replace(median=robust, limited=limited)

    def _answer(self, rows: TrialRows, ours: Analyses) -> list[str]:
        """Return in words which factors matter, how much is due to one trial, and which settings are best."""
        judged_alike = not any(factor.setting.startswith("reward.") for factor in self.design.factors)
        name = next(iter(ours)) if judged_alike else "switches"
        analysis, text = ours[name], []
        if all(len(factor.levels) == _TWO for factor in self.design.factors):
            found = {f.label: self.effect(rows, name, f.column, analysis) for f in self.design.factors}
            significant = [
                f"{self.design.factor(label).name} {_step(self.design.factor(label))} ({effect})"
                for label, effect in found.items()
                if all(abs(one.mean) > one.half for one in (effect, effect.median or effect))
            ]
            said = ", ".join(significant) or "none of the factors"
            text.append(f"Significant effects on the {_IN_WORDS[name]}, by mean and median: {said}.")
        text[:0] = [self._averages(rows, ours) + self._met(rows), *self.diverged(rows)]
        best = "reward" if "reward" in ours else name
        return [*text, self._best(ours[best], _IN_WORDS[best])] if judged_alike else text

    @property
    def worst(self) -> float:
        """What an agent earns that does nothing; one that earns less has diverged."""
        return self.base.reward.action * self.base.cutoff

    def diverged(self, rows: TrialRows) -> list[str]:
        """Return in words which agents have diverged: a result of its own."""
        lost = {trial: int((rows.table("reward", [trial]) < self.worst).sum()) for trial in self.trials}
        where = ", ".join(f"{count} of trial {trial}" for trial, count in lost.items() if count)
        if not where:
            return []
        said = (
            f"{sum(lost.values())} of {len(rows.rows)} agents earn less than one that does nothing ({self.worst:g})"
        )
        return [f"Diverged: {said}: {where}. Effects by the medians do not rest on them."]

    def _averages(self, rows: TrialRows, ours: Analyses) -> str:
        """Return in words the means over all trials, and beside them the thesis' where it has some."""
        said = []
        for name in [name for name in ours if name in self.thesis or not self.thesis]:
            found = over_arms(rows.pooled(name, list(self.trials)))
            digits = 0 if abs(found.mean) >= _THOUSANDS else 2
            theirs = f" ({self.thesis[name].mean():,.{digits}f})" if self.thesis else ""
            said.append(f"{_IN_WORDS[name]} {found:.{digits}f}{theirs}")
        beside = ", in brackets the thesis'" if self.thesis else ""
        return f"Means over all trials{beside}: {'; '.join(said)}."

    def _met(self, rows: TrialRows) -> str:
        """Return in words how many agents met the criterion; with longer training, how the slow ones ended."""
        if "met" not in rows.figures:
            return ""
        if self.continued is None:
            met = rows.table("met", list(self.trials))
            return f" {int(met.sum())} of {met.size} agents met the criterion."
        trials = list(self.trials)
        found = interval(
            [
                rank_correlation(rows.table("episodes", trials, arm), rows.table("reward", trials, arm))
                for arm in rows.arms
            ]
        )
        ended = "better" if found.low > 0 else "worse" if found.high < 0 else "neither significantly better nor worse"
        return (
            f" Agents that needed more episodes to meet the criterion are {ended} in the end: the rank correlation "
            f"of these episodes with the last reward is {found} within arms."
        )

    def _best(self, first: TableAnalysis, words: str) -> str:
        settings = ", ".join(
            f"{self.design.factor(f).name} {_level(level)}" for f, level in first.best.settings.items()
        )
        return f"Best settings for the {words} by the ranked effects here, significant or not: {settings}" + (
            f" (trial {first.best.trial})." if first.best.trial else " (not among the trials)."
        )


_TWO, _THOUSANDS = 2, 1000


def rank_correlation(first: Array, second: Array) -> float:
    """Return Spearman's rank correlation, alike values sharing their mean rank; 0 where all are alike."""

    def ranks(values: Array) -> Array:
        _, place, counts = np.unique(values.ravel(), return_inverse=True, return_counts=True)
        return np.asarray((np.cumsum(counts) - (counts - 1) / 2)[place])

    x, y = ranks(first), ranks(second)
    return float(np.corrcoef(x, y)[0, 1]) if x.std() > 0 and y.std() > 0 else 0.0


def _step(factor: Factor) -> str:
    return f"{_level(factor.levels[-1])} instead of {_level(factor.levels[0])}"


def _level(level: Any) -> str:
    return f"{level:g}" if isinstance(level, float) else str(level)


def _effect_claim(claim: EffectClaim, quantity: str, their: TableAnalysis, design: Design, effect: Interval) -> Claim:
    """Return the claim that an effect has the sign, and where it is called slight the size, that the thesis says."""
    column = claim.column
    theirs = float(their.effects[claim.loss].signed[column - 1])
    factor = design.on(column)
    if factor:
        what = f"{factor.name[0].upper()}{factor.name[1:]} {_step(factor)}"
    else:
        what = (
            f"That {' and '.join(design.factor(label).name for label in design.label(column))} are at unlike levels"
        )
    of = "" if claim.loss == "mean" else "standard deviation of the "
    said = f"{'raises' if claim.raises else 'lowers'} the {of}{quantity}"
    low, high = (0.0, None) if claim.raises else (None, 0.0)
    if claim.slight is not None:
        said += f" slightly: by less than {claim.slight:g}"
        low, high = -claim.slight, claim.slight
    return Claim(
        f"{what} (column {column}) {said}",
        str(Interval(theirs, their.margin(claim.loss), their.results.shape[1])),
        str(effect),
        claim.about,
        Criterion(above=low, below=high, matters=MATTERS[claim.criterion]),
        {"found": effect},
    )

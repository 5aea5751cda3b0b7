"""Experiments with the thesis' agent: its settings varied by a design, every trial trained and tested (section 5.4).

The same class does all of them; what they are is data, in the folder of each.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.experiments.comparison import side_by_side
from pneumarm.experiments.design.analysis import Goal, TableAnalysis, analyse_table
from pneumarm.experiments.design.assignment import Design
from pneumarm.experiments.experiment import Analysis, Claim, Experiment, Figures, LaboratorySettings, Report, Rows
from pneumarm.experiments.preparation import Simulated, simulated
from pneumarm.experiments.trainings import CRITERIA, train_and_test, with_settings
from pneumarm.learning import TrainSettings

Array = NDArray[np.float64]
SURE = 0.05
"""Probability by chance below which an effect is taken as real."""


@dataclass(frozen=True)
class Factorial(Experiment):
    """Trainings by an orthogonal array, each tested; all criteria of section 5.2."""

    name: str
    title: str
    question: str
    source: str
    runs: int
    design: Design
    base: TrainSettings
    """What no factor sets."""
    thesis: Mapping[str, Array]
    """The thesis' results by criterion, shapes (trials, its runs)."""
    goal: float | None = None
    """The only angle to learn [counts]; None for all."""
    continued: int | None = None
    """Episodes until which training goes on after the criterium is met; then ``gain`` is what it changed."""
    criteria: Mapping[str, Goal] = field(
        default_factory=lambda: {
            "reward": "larger",
            "actions": "smaller",
            "switches": "smaller",
            "episodes": "smaller",
        }
    )
    """What is analysed, and which way it is good."""

    @property
    def trials(self) -> Mapping[int, str]:
        """Trials of the array."""
        return {
            trial: ", ".join(f"{label} {level}" for label, level in self.design.settings(trial).items())
            for trial in range(1, self.design.array.trials + 1)
        }

    def settings(self) -> Any:
        """Return the settings of every trial, the goal, and how long training goes on."""
        return {
            "trials": {str(trial): msgspec.to_builtins(self.train_settings(trial)) for trial in self.trials},
            "goal": self.goal,
            "continued": self.continued,
        }

    def train_settings(self, trial: int) -> TrainSettings:
        """Return the settings of the training of ``trial``."""
        levels = self.design.settings(trial)
        return with_settings(self.base, {factor.setting: levels[factor.label] for factor in self.design.factors})

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> Simulated:
        """Return the arm's simulation."""
        return simulated(arm, folder, settings, progress)

    def measure(self, material: Simulated, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train and test one agent."""
        wanted = self.train_settings(trial)
        found = dict(train_and_test(material, wanted, run, settings, self.goal))
        if self.continued is None:
            return found
        # The same seed: the first episodes of this training are those of the one above.
        longer = replace(wanted, stops=False, max_episodes=self.continued)
        later = train_and_test(material, longer, run, settings, self.goal)
        return {**later, "gain": later["reward"] - found["reward"], "episodes": found["episodes"]}

    def analyse(self, rows: Rows) -> Analysis:
        """Return rankings, effects and tests of every criterion, beside the thesis'."""
        from pneumarm.experiments.design.page import table_sections

        ours = {
            name: analyse_table(self.design, rows.table(name, list(self.trials)), goal)
            for name, goal in self.criteria.items()
        }
        theirs = {name: analyse_table(self.design, table, self.criteria[name]) for name, table in self.thesis.items()}
        sections = [side_by_side(self.trials, {n: a.results for n, a in ours.items()}, self.thesis, self.words)]
        for name, analysis in ours.items():
            sections += table_sections(analysis, self.words.get(name, name), name)
        return Analysis(
            summary=[self.question, self._best(ours)],
            figures={
                "rows": len(rows.rows),
                "arms": list(rows.arms),
                "success_rate": float(rows.table("success_rate", list(self.trials)).mean()),
                "ours": {name: analysis.figures() for name, analysis in ours.items()},
                "thesis": {name: analysis.figures() for name, analysis in theirs.items()},
            },
            sections=sections,
            claims=self.claims(ours, theirs),
        )

    @property
    def words(self) -> Mapping[str, str]:
        """Criteria in words."""
        return {**CRITERIA, "gain": "change of the reward by training on"}

    def claims(self, ours: Mapping[str, TableAnalysis], theirs: Mapping[str, TableAnalysis]) -> tuple[Claim, ...]:
        """Return what can be said of the effects of single factors: the thesis' sign next to ours with its p."""
        found = []
        for name, their in theirs.items():
            our = ours[name]
            for column in their.significant("mean"):
                found.append(_effect_claim(self.words[name], their, our, column))
        return tuple(found)

    def _best(self, ours: Mapping[str, TableAnalysis]) -> str:
        first = next(iter(ours.values()))
        settings = ", ".join(f"{self.design.factor(f).name} {level}" for f, level in first.best.settings.items())
        return f"Best settings by the ranked effects here: {settings}" + (
            f" (trial {first.best.trial})." if first.best.trial else " (not among the trials)."
        )


def _effect_claim(quantity: str, their: TableAnalysis, our: TableAnalysis, column: int) -> Claim:
    """Return whether an effect that is beyond Lenth's margin in the thesis has the same sign here, surely."""
    name = their.names[column - 1]
    theirs, ours = (float(a.effects["mean"].signed[column - 1]) for a in (their, our))
    p = next(source.p for source in our.variance if source.name == name)
    same = "holds" if np.sign(theirs) == np.sign(ours) else "does not hold"
    return Claim(
        f"{name}: the higher level {'raises' if theirs > 0 else 'lowers'} the {quantity}",
        f"{theirs:+.2f}",
        f"{ours:+.2f} (p {p:.2g})",
        same if p < SURE else "open",  # type: ignore[arg-type]
    )

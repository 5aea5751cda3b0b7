"""The settings of shaping (sections 4.3.2 and 5.4.4): which matter, and when is shaping indispensable?

One setting at a time is changed from the thesis': how much the deviation grows and shrinks, how often, which begin
states are drawn, how much is explored; then no shaping at all (epsilon 0.09 and T 10, as in 5.4.4). The thesis says
that shaping was indispensable while the potentiometer was worn: both are done again with a worn one.

    pneumarm experiment shaping-settings

Trials are data (``trials.toml``), and so is the wear (``worn.toml``). All use SARSA, 5 neurons, lambda 0, gamma 0.98
and the learning rate 0.05 (section 5.4.2); differences are taken within runs, which begin with the same weights.

On arms 1 to 5, four runs each, shaping raises the reward by 27 ± 17 and halves its spread, and without it all agents
meet the criterion 8,800 episodes earlier, also where wear makes the fit's error of the angle ten times as large (26
instead of 2.6 counts). Adjusting every 100 episodes saves 7,700 episodes and costs 27 ± 21 of reward; how much the
deviation shrinks does not matter, because it hardly ever does.
"""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec
from pneumarm.experiments.all_goals import BASE
from pneumarm.experiments.comparison import mean_and_spread
from pneumarm.experiments.design.table import packaged_table
from pneumarm.experiments.differences import Interval, Verdict, above, below, interval
from pneumarm.experiments.evidence import signed
from pneumarm.experiments.experiment import (
    ARMS,
    Analysis,
    Claim,
    Experiment,
    Figures,
    LaboratorySettings,
    Report,
    Rows,
)
from pneumarm.experiments.pictures import dots
from pneumarm.experiments.preparation import Simulated, simulated
from pneumarm.experiments.trainings import CRITERIA, LEARNING, train_and_test, with_settings
from pneumarm.learning import Exploration, TrainSettings
from pneumarm.learning.online.shaping import initial_deviation, stage
from pneumarm.report.page import Picture, Section, Table
from pneumarm.report.style import DARK, GREY, MIDDLE, panels, styled

_CRITERIA = ("reward", "success_rate", LEARNING, "actions", "switches", "episodes", "met")
_WORDS = {**CRITERIA, "met": "share of agents that met the criterion at the whole range of angles"}
_SHOWN = ("reward", "success_rate", "episodes")
_WITHOUT = Exploration(0.09, 10.0)
_NEVER_MET = 0.5  # share of agents below which a method does not solve the task


Tables = Mapping[str, NDArray[np.float64]]
"""By figure, shapes (trials, runs)."""


class Trial(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a trial changes."""

    name: str
    settings: dict[str, Any] = {}
    """New values by the place of the setting."""
    shaping: bool = True
    worn: bool = False
    """Whether the potentiometer is."""


class _Trials(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    trials: tuple[Trial, ...]


@dataclass(frozen=True)
class Material:
    """The simulation of an arm, and of the same arm with a worn potentiometer."""

    whole: Simulated
    worn: Simulated


def _packaged(name: str) -> str:
    return (resources.files(__name__) / name).read_text(encoding="utf-8")


@dataclass(frozen=True)
class ShapingSettings(Experiment):
    """Trainings that differ in their shaping."""

    name: str = "shaping-settings"
    title: str = "The settings of shaping"
    question: str = "Which settings of shaping matter, and is shaping indispensable where the potentiometer is worn?"
    source: str = "Thesis sections 4.3.2, 5.2 and 5.4.4"
    runs: int = 4
    arms: tuple[str, ...] = ARMS
    plan: tuple[Trial, ...] = field(
        default_factory=lambda: msgspec.convert(tomllib.loads(_packaged("trials.toml")), _Trials).trials
    )
    wear: str = field(default_factory=lambda: _packaged("worn.toml"))

    @property
    def trials(self) -> Mapping[int, str]:
        """Trials of ``trials.toml``."""
        return {number: trial.name for number, trial in enumerate(self.plan, 1)}

    def train_settings(self, trial: int) -> TrainSettings:
        """Return the settings of the training of ``trial``."""
        chosen = self.plan[trial - 1]
        base = BASE if chosen.shaping else replace(BASE, shaping=None, exploration=_WITHOUT)
        places = {k: tuple(v) if isinstance(v, list) else v for k, v in chosen.settings.items()}
        return with_settings(base, places)

    def settings(self) -> Any:
        """Return the settings of every trial and the wear."""
        trials = {str(trial): msgspec.to_builtins(self.train_settings(trial)) for trial in self.trials}
        return {
            "trials": trials,
            "worn": [number for number in self.trials if self.plan[number - 1].worn],
            "wear": self.wear,
        }

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> Material:
        """Return the arm's simulation, and that of the arm with the worn potentiometer."""
        whole = simulated(arm, folder, settings, progress)
        return Material(whole, simulated(arm, folder / "worn", settings, progress, faults=self.wear))

    def measure(self, material: Material, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train and test one agent."""
        chosen = material.worn if self.plan[trial - 1].worn else material.whole
        return train_and_test(chosen, self.train_settings(trial), run, settings)

    def analyse(self, rows: Rows) -> Analysis:
        """Return every trial's results and its difference from the thesis' settings within runs."""
        tables = {name: rows.table(name, list(self.trials)) for name in _CRITERIA}
        # From here on columns are samples: runs where there is one arm, else the arms.
        samples = {name: np.stack([rows.samples(line) for line in table]) for name, table in tables.items()}
        differences = {name: self._differences(table) for name, table in samples.items()}
        return Analysis(
            summary=[self.question, *self._found(differences)],
            figures={
                "rows": len(rows.rows),
                "results": {name: table.mean(axis=1).tolist() for name, table in tables.items()},
                "differences": {
                    name: [[each.mean, each.half] if each else None for each in found]
                    for name, found in differences.items()
                },
            },
            sections=[self._strategy(), self._results(tables, samples, differences)],
            claims=self._claims(tables, samples, len(rows.arms)),
        )

    def reference(self, trial: int) -> int:
        """Return the trial with the thesis' settings on the same kind of arm."""
        worn = self.plan[trial - 1].worn
        return next(
            n for n, other in enumerate(self.plan, 1) if other.worn == worn and other.shaping and not other.settings
        )

    def _differences(self, table: NDArray[np.float64]) -> list[Interval | None]:
        """Return each trial's difference from its reference, none for a reference itself."""
        return [
            None if self.reference(n) == n else interval(table[n - 1] - table[self.reference(n) - 1])
            for n in self.trials
        ]

    def _found(self, differences: Mapping[str, list[Interval | None]]) -> list[str]:
        """Return in words what matters beyond chance."""
        text = []
        for name in ("reward", "episodes"):
            surely = [
                f"{self.trials[n]} ({each if name == 'reward' else _whole(each)})"
                for n, each in zip(self.trials, differences[name], strict=True)
                if each and abs(each.mean) > each.half
            ]
            text.append(
                f"Surely other than with the thesis' settings: {_WORDS[name]}: {'; '.join(surely) or 'none'}."
            )
        return text

    def _results(self, tables: Tables, samples: Tables, differences: Mapping[str, list[Interval | None]]) -> Section:
        header = ["settings", "reward", "difference within runs", "greedy success", "success, learning on"]
        header += ["episodes", "difference within runs", "criterion met"]
        rows = []
        for place, (trial, name) in enumerate(self.trials.items()):
            rows.append(
                [
                    f"{trial} {name}",
                    mean_and_spread(tables["reward"][place]),
                    str(differences["reward"][place] or "reference"),
                    *(f"{100 * tables[n][place].mean():.1f} %" for n in ("success_rate", LEARNING)),
                    mean_and_spread(tables["episodes"][place]),
                    _whole(differences["episodes"][place]),
                    f"{100 * tables['met'][place].mean():.0f} %",
                ]
            )
        table = Table(header, rows, "Mean ± standard deviation over runs; differences with 95 % intervals.")
        shown = {name: [interval(values) for values in samples[name]] for name in _SHOWN}
        picture = dots(
            list(self.trials.values()),
            {_WORDS[name]: found for name, found in shown.items()},
            "Results by settings of shaping, means with their 95 % intervals; the line is the thesis' settings.",
            reference=0,
        )
        return Section("Results", figures=[picture], tables=[table])

    def _strategy(self) -> Section:
        settings, spec = self.train_settings(1), ArmSpec()
        return Section(
            "The strategy",
            [
                "The deviation begins small, grows where the performance exceeds the criterion and shrinks where it "
                "does not; exploration, temperature and criterion follow it."
            ],
            [
                Picture(
                    strategy_figure(settings, spec),
                    "Exploration, temperature and criterion as functions of the deviation (thesis fig. 4.3).",
                    "Exploration falls from 0.5 to 0.05 and temperature from 20 to 1; the criterion rises to 0.95.",
                )
            ],
        )

    def _claims(self, tables: Tables, samples: Tables, arms: int) -> list[Claim]:
        by_name = {name: number - 1 for number, name in self.trials.items()}
        shaped, without = by_name["as in the thesis"], by_name["no shaping"]
        worn, worn_without = by_name["worn, as in the thesis"], by_name["worn, no shaping"]
        reward, episodes, met = (samples[name] for name in ("reward", "episodes", "met"))
        theirs = {kind: _thesis(kind) for kind in ("all_goals", "no_shaping")}
        their = {name: theirs["all_goals"][name] - theirs["no_shaping"][name] for name in ("reward", "episodes")}
        gain = interval(reward[shaped] - reward[without])
        solved, worn_solved = (interval(met[place]) for place in (without, worn_without))
        fewer = interval(episodes[by_name["adjusted every 100 episodes"]] - episodes[shaped])
        return [
            Claim(
                "Shaping raises the reward",
                f"{interval(their['reward'].ravel())} (tables C.7 and C.21, runs 1 to 3, all trials)",
                str(gain),
                above(gain),
                "shaping-improves",
            ),
            Claim(
                "Shaping lowers the standard deviation of the reward over runs",
                f"{theirs['all_goals']['reward'].std(axis=1, ddof=1).mean():.2f} against "
                f"{theirs['no_shaping']['reward'].std(axis=1, ddof=1).mean():.2f}, mean over trials",
                *_spread(tables["reward"][shaped], tables["reward"][without], arms),
                "shaping-improves",
            ),
            Claim(
                "Shaping is not indispensable: without it agents meet the criterion",
                "all 48 agents (table C.22)",
                _share(tables["met"][without]),
                above(solved, _NEVER_MET),
                "shaping-not-indispensable",
            ),
            Claim(
                "Without shaping fewer episodes are needed",
                f"{-interval(their['episodes'].ravel()).mean:+.0f} (tables C.10 and C.22, runs 1 to 3, all trials)",
                _whole(interval(episodes[without] - episodes[shaped])),
                below(interval(episodes[without] - episodes[shaped])),
                "shaping-not-indispensable",
            ),
            Claim(
                "With a worn potentiometer shaping is indispensable: agents without it do not meet the criterion",
                "no agent reached the whole deviation (section 5.4.4, no numbers)",
                f"{_share(tables['met'][worn_without])}; with shaping {_share(tables['met'][worn])}",
                below(worn_solved, _NEVER_MET),
                "shaping-worn",
            ),
            Claim(
                "Adjusting the deviation more often than every 500 episodes saves episodes",
                "supposed (section 5.4.4, no numbers)",
                _whole(fewer),
                below(fewer),
                "shaping-period",
            ),
        ]


def _thesis(kind: str) -> Tables:
    """Return the thesis' rewards and episodes in runs 1 to 3, which it made with shaping and without."""
    package = f"pneumarm.experiments.{kind}"
    return {name: packaged_table(package, f"thesis_{name}")[:, :3] for name in ("reward", "episodes")}


def _spread(shaped: NDArray[np.float64], without: NDArray[np.float64], arms: int) -> tuple[str, Verdict]:
    """Return both standard deviations on an arm, and whether the first is surely smaller (Pitman and Morgan).

    Runs are pairs; the variances differ where sum and difference of the pairs are correlated.
    """
    apart = [values.reshape(arms, -1) for values in (shaped, without)]
    x, y = ((values - values.mean(axis=1, keepdims=True)).ravel() for values in apart)
    freedom = len(x) - arms
    if freedom < 1:
        return "one run", "open"
    text = " against ".join(f"{np.sqrt((v * v).sum() / freedom):.2f}" for v in (x, y))
    less, more = x - y, x + y
    if freedom < 4 or less.std() == 0 or more.std() == 0:
        return text, "open"
    correlation = np.clip(np.corrcoef(less, more)[0, 1], -1 + 1e-12, 1 - 1e-12)
    # Fisher's transform makes the correlation about normal, with this standard deviation.
    return text, below(Interval(float(np.arctanh(correlation)), 1.96 / math.sqrt(freedom - 2), freedom))


def _share(met: NDArray[np.float64]) -> str:
    return f"{int(met.sum())} of {len(met)} agents"


def _whole(found: Interval | None) -> str:
    return "reference" if found is None else signed(found, 0)


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


EXPERIMENT = ShapingSettings()

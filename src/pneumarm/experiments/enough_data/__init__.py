"""How many minutes of collecting does an agent need?

Factor: the time on the arm's clock that collecting may take, from what 2,000 transitions take, the fewest that can be
fitted, to 220 minutes. One collection is cut short after each of these; from each part alone a simulation is fitted
and the thesis' agent trained and moved on the arm. Goals and begin states are the same for all parts.

    pneumarm experiment enough-data --out laboratory

Answer here: the errors of a step fall until some 10 to 20 minutes, while cells go on being filled anew at 220; on
five arms more minutes earned the thesis' agent nothing that can be told from chance. ``python -m benchmarks
minutes`` asks the same of the agent that pneumarm trains by default, which varies less.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from pneumarm.experiments.differences import above, below
from pneumarm.experiments.evidence import Column, difference, mean, numbers, plain, signed, table, thesis
from pneumarm.experiments.experiment import Analysis, Claim, Figures, LaboratorySettings, Report, Rows
from pneumarm.experiments.pictures import Axis, against
from pneumarm.experiments.preparation import STORE
from pneumarm.experiments.there_and_back import (
    AFTER_A_SECOND,
    MOVEMENTS,
    TRAINING,
    Prepared,
    Recipe,
    ThereAndBack,
    agent_columns,
    collected,
    place,
    quality,
    trained_and_moved,
)
from pneumarm.files import write_json
from pneumarm.report.page import Section
from pneumarm.simulation import FitSettings, Simulation, fit_store
from pneumarm.task import begin_states
from pneumarm.transitions import KINDS, Store, enough_data

_MINUTES = (1.7, 5.0, 10.0, 20.0, 50.0, 110.0, 220.0)
_MARGIN = 2.0  # reward that does not matter: two actions of some seventeen
_MUCH = 0.1  # share of cells filled anew from which on the distribution has improved


@dataclass(frozen=True)
class EnoughData(ThereAndBack):
    """The whole job after more and more minutes of collecting."""

    minutes: tuple[float, ...] = _MINUTES
    """That collecting may take, in ascending order [min]."""
    name: str = "enough-data"
    title: str = "How much data is enough"
    question: str = "From how many minutes of collecting on do more of them not matter to the agent on the arm?"
    source: str = "Thesis sections 3.2.2, 3.2.3 and 6.1.4"

    @property
    def trials(self) -> Mapping[int, str]:
        """The minutes."""
        return {trial: f"{minutes:g} min" for trial, minutes in enumerate(self.minutes, 1)}

    def settings(self) -> Any:
        """Return minutes and training."""
        return {"minutes": list(self.minutes), "movements": MOVEMENTS, "training": msgspec.to_builtins(TRAINING)}

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> list[Prepared]:
        """Return a simulation of every part of one collection, which goes on between the fits.

        Minutes that the laboratory's number of transitions does not reach are not shortened by it: they are the
        question.
        """
        seed = settings.seed
        whole = place(folder, {"arm": arm, "seed": seed, "minutes": list(self.minutes)})
        made = []
        for number, minutes in enumerate(self.minutes):
            recipe = Recipe(minutes=minutes)
            kept, file = whole / f"{number}.json", whole / f"{number}.safetensors"
            if not kept.exists():
                transitions, took = collected(whole / STORE, arm, seed, recipe, progress)
                with Store.open(whole / STORE) as store:
                    fitted = fit_store(store, FitSettings(seed=seed))
                    enough = enough_data(store, fitted.simulation.window, much=_MUCH)
                    sequences = store.sequences
                    judged = quality(fitted)
                fitted.simulation.save(file)
                figures = {"transitions": transitions, "minutes": took, "new": enough.share, **judged}
                write_json(kept, {"sequences": sequences, "figures": figures})
            found = json.loads(kept.read_text(encoding="utf-8"))
            simulation = Simulation.load(file)
            with Store.open(whole / STORE) as store:
                first = [entry.number for entry in store.catalogue()][: found["sequences"]]
                part = store.blocks(kinds=KINDS, sequences=partial(np.isin, test_elements=first))
                begin = begin_states(part, simulation.window, simulation.scaling)
            made.append(Prepared(arm, recipe, whole, simulation, begin, found["figures"]))
        return made

    def measure(self, material: list[Prepared], trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train an agent on the part of ``trial`` and move the arm with it, to goals in the range of all data."""
        chosen = material[trial - 1]
        goals = material[-1].simulation.goal_range
        return {**chosen.figures, **trained_and_moved(chosen, TRAINING, run, settings, goals)}

    def analyse(self, rows: Rows) -> Analysis:
        """Return coverage, fit and performance by minutes."""
        said = thesis(__name__)
        coverage = [
            Column("transitions", "transitions [-]", 0, thesis={self._usual: said["transitions"]}),
            Column("occupied", "cells with data [-]", 0),
            Column("rows", "filtered set [-]", 0, thesis={self._usual: said["filtered"]}),
            Column("new", "cells new in the second half [%]", 1, 100.0),
            Column("unseen", "further transitions in empty cells [%]", 2, 100.0),
        ]
        fit = [
            Column("std angle", "error of the angle [counts]"),
            Column("std velocity", "of the velocity [counts/ms]", 4),
            Column("std pressure_1", "of pressure 1 [counts]"),
            Column("std pressure_2", "of pressure 2 [counts]"),
            Column(f"measured angle{AFTER_A_SECOND}", "of the angle after a second [counts]"),
        ]
        agent = agent_columns("actions", "switches")
        trials, axis = self.trials, Axis("collecting [min]", self.minutes, log=True)

        def section(title: str, columns: list[Column], caption: str) -> Section:
            shown = against(rows, trials, axis, columns, f"{caption} against the minutes of collecting.")
            return Section(title, tables=[table(rows, trials, columns, f"{caption}.")], figures=[shown])

        enough = self._enough(rows)
        return Analysis(
            summary=[
                self.question,
                f"The thesis collected 200,000 transitions in two hours. Here {enough}. Values are means over arms "
                "with 95 % intervals.",
            ],
            figures=numbers(rows, trials, [*coverage, *fit, *agent]),
            sections=[
                section("Coverage", coverage, "How the grid of section 3.2.3 is filled"),
                section("The simulation", fit, "Errors on sequences that were not fitted"),
                section("The agent on the arm", agent, "What agents make of it"),
            ],
            claims=self.claims(rows),
        )

    @property
    def _usual(self) -> int:
        """The trial that is nearest to the thesis' two hours."""
        wanted = thesis(__name__)["minutes"]
        return int(np.argmin([abs(minutes - wanted) for minutes in self.minutes])) + 1

    def _fewest(self, rows: Rows) -> int | None:
        """Return the first trial from which on no reward is shown to be worse than the last by the margin or more."""
        last = len(self.minutes)
        good = [difference(rows, "reward", trial, last).low > -_MARGIN for trial in range(1, last)]
        for trial in range(1, last):
            if all(good[trial - 1 :]):
                return trial
        return None

    def _enough(self, rows: Rows) -> str:
        found = self._fewest(rows)
        last = self.trials[len(self.minutes)]
        if found is None:
            return f"nothing less than {last} is shown to be as good, within {_MARGIN:g} of its reward"
        return f"from {self.trials[found]} on the reward is that of {last}, within {_MARGIN:g}"

    def _shown(self, rows: Rows, trial: int) -> str:
        last = len(self.minutes)
        less = signed(difference(rows, "reward", trial, last))
        return f": {mean(rows, 'transitions', trial).mean:.0f} transitions; reward less that of the longest: {less}"

    def claims(self, rows: Rows) -> list[Claim]:
        """Return what the thesis says, and what the rows say to it."""
        said = thesis(__name__)
        last = len(self.minutes)
        usual = self._usual
        new = mean(rows, "new", last)
        gain = difference(rows, "reward", last, usual)
        fewest = self._fewest(rows)
        return [
            Claim(
                f"{self.trials[usual]} are enough: {self.trials[last]} give no more than {_MARGIN:g} more reward",
                f"{said['transitions']:,} transitions in two hours were enough",
                f"reward more: {signed(gain)}",
                below(gain, _MARGIN),
                "data",
            ),
            Claim(
                f"As much again fills few more cells: fewer than {100 * _MUCH:g} % are new in the second half",
                "a way to check it (section 3.2.3); no number",
                f"of {self.trials[last]}: {plain(new, 1, 100)} %",
                below(new, _MUCH),
                "coverage",
            ),
            Claim(
                "Fewer transitions would do",
                "this number might decrease (section 6.1.4)",
                self._enough(rows) + (self._shown(rows, fewest) if fewest else ""),
                "open" if fewest is None else "holds" if fewest < usual else "does not hold",
                "data",
            ),
            Claim(
                "What fits better moves better: the least data gives less reward on the arm",
                "follows from section 3.4; no number",
                f"{self.trials[last]} less {self.trials[1]}: {signed(difference(rows, 'reward', last, 1))}",
                above(difference(rows, "reward", last, 1)),
                "data",
            ),
        ]


EXPERIMENT = EnoughData()
"""``pneumarm experiment``."""

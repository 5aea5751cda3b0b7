"""An experiment without an arm: every row is a few sums, so that sweeps can be tested on their own."""

import os
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pneumarm.experiments.experiment import (
    Analysis,
    Experiment,
    Figures,
    LaboratorySettings,
    TrialRows,
    run_seed,
)
from pneumarm.experiments.words import Words
from pneumarm.progress import Report


@dataclass(frozen=True)
class Toy(Experiment):
    """Six trials whose figures are numbers of the trial, the run and the arm."""

    name = "toy"
    words = Words("A toy", "Does every row come once?", "Nowhere")
    runs: int = 2
    factor: float = 10.0
    pause: float = 0.0
    fails: int = 0
    """Trial that fails."""

    @property
    def trials(self) -> Mapping[int, str]:
        return {trial: f"trial {trial}" for trial in range(1, 7)}

    def settings(self) -> Any:
        return {"factor": self.factor}

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> float:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / "prepared").open("a") as file:
            file.write(f"{arm}\n")
        progress(1, 1)
        return float(len(arm))

    def measure(self, material: float, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        if trial == self.fails:
            raise ArithmeticError(f"trial {trial} fails")
        time.sleep(self.pause)
        return {
            "sum": self.factor * trial + run + 1000 * material,
            "seed": run_seed(settings, run),
            "process": os.getpid(),
        }

    def analyse(self, rows: TrialRows) -> Analysis:
        table = rows.table("sum", list(self.trials))
        return Analysis(["It does."], {"shape": list(table.shape)}, [])

"""Minutes of collecting: parts of one collection, each with its simulation."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from pneumarm.experiments.experiment import Axis, Experiment, Figures, LaboratorySettings
from pneumarm.experiments.preparation import PROCEDURES, STORE
from pneumarm.experiments.there_and_back import (
    DECISIVE,
    TRAINING,
    Prepared,
    Recipe,
    collect_until,
    quality,
    train_and_move,
    trial_folder,
)
from pneumarm.experiments.words import words_of
from pneumarm.files import read_json, write_json
from pneumarm.progress import Report
from pneumarm.simulation import SINGLE_STEPS, Simulation, fit_store
from pneumarm.task import begin_states
from pneumarm.transitions import KINDS, Store, new_cells

_MINUTES = (1.7, 5.0, 10.0, 20.0, 50.0, 110.0, 220.0)


@dataclass(frozen=True)
class EnoughData(Experiment):
    """The whole job after more and more minutes of collecting."""

    minutes: tuple[float, ...] = _MINUTES
    """Times of collecting, in ascending order [min]."""
    name = "enough-data"
    words = words_of(__package__)

    @property
    def trials(self) -> Mapping[int, str]:
        """The minutes."""
        return {trial: f"{minutes:g} min" for trial, minutes in enumerate(self.minutes, 1)}

    @property
    def axis(self) -> Axis:
        """The minutes."""
        return Axis("collecting [min]", self.minutes, log=True)

    def settings(self) -> Any:
        """Return minutes and training."""
        return {**DECISIVE, "minutes": list(self.minutes)}

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> list[Prepared]:
        """Return a simulation of every part of one collection, which goes on between the fits.

        Minutes that the laboratory's number of transitions does not reach are not shortened by it: they are the
        question.
        """
        seed = settings.seed
        collecting = PROCEDURES[settings.collecting]
        way = msgspec.to_builtins(collecting)
        whole = trial_folder(folder, {"arm": arm, "seed": seed, "minutes": list(self.minutes), "collect": way})
        made = []
        for number, minutes in enumerate(self.minutes):
            recipe = Recipe(minutes=minutes, collect=collecting)
            kept, file = whole / f"{number}.json", whole / f"{number}.safetensors"
            if not kept.exists():
                transitions, took = collect_until(whole / STORE, arm, seed, recipe, progress)
                with Store.open(whole / STORE) as store:
                    fitted = fit_store(store, replace(SINGLE_STEPS, seed=seed))
                    found = new_cells(store, fitted.simulation.window)
                    sequences = store.sequences
                    judged = quality(fitted)
                fitted.simulation.save(file)
                figures = {"transitions": transitions, "minutes": took, "new": found.share, **judged}
                write_json(kept, {"sequences": sequences, "figures": figures})
            known = read_json(kept, "figures of a part of a recording")
            simulation = Simulation.load(file)
            with Store.open(whole / STORE) as store:
                first = [entry.number for entry in store.catalogue()][: known["sequences"]]
                part = store.blocks(kinds=KINDS, sequences=partial(np.isin, test_elements=first))
                begin = begin_states(part, simulation.window, simulation.scaling, simulation.spec)
            made.append(Prepared(arm, recipe, whole, simulation, begin, known["figures"]))
        return made

    def measure(self, material: list[Prepared], trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train an agent on the part of ``trial`` and move the arm with it, to goals in the range of all data."""
        chosen = material[trial - 1]
        goals = material[-1].simulation.goal_range
        return {**chosen.figures, **train_and_move(chosen, TRAINING, run, settings, goals)}

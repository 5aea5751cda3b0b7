"""An experiment of one's own, from a file: any factors over any settings, analysed as the thesis does (section 5.3).

    title, question, method, array ("L16", or "full"), interactions, runs
    [train], [fit]: what no factor sets
    [[factors]]: label, name, levels, and the setting, such as train.hidden, fit.grid.per_cell or arm.frequency

Every trial is recorded, fitted, trained and tested, and its agent then moves the arm, which is what it is judged by:
so factors of the fit and of the recording can be compared.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from pneumarm.errors import UnusableInput
from pneumarm.experiments.design.arrays import OrthogonalArray, linear, orthogonal_array
from pneumarm.experiments.design.assignment import Design, WantedFactor, assign
from pneumarm.experiments.experiment import Figures, LaboratorySettings
from pneumarm.experiments.factorial import Factorial
from pneumarm.experiments.preparation import STORE
from pneumarm.experiments.there_and_back import (
    MOVEMENTS,
    Prepared,
    Recipe,
    fitted,
    prepared,
    train_and_move,
    usual_recipe,
)
from pneumarm.experiments.words import Words
from pneumarm.files import read_toml
from pneumarm.learning import find_method
from pneumarm.progress import Report
from pneumarm.simulation import SINGLE_STEPS, FitSettings

FULL = "full"
"""In place of an array's name: all combinations of all levels."""
_PARTS = "train", "fit", "arm"
_MOST_TRIALS = 1024
_PRIMES = 2, 3
_EXPECTED = (
    "a design: title, question, method, array (such as 'L8', or 'full'), perhaps interactions, runs, [train] and "
    "[fit], and for each factor a table [[factors]] with label, name, levels and setting"
)


class _File(msgspec.Struct, forbid_unknown_fields=True):
    title: str
    factors: tuple[WantedFactor, ...]
    question: str = "Which of the settings matter, and which are best?"
    method: str = "sarsa"
    array: str = FULL
    interactions: tuple[str, ...] = ()
    runs: int = 2
    train: dict[str, Any] = {}
    fit: dict[str, Any] = {}


@dataclass(frozen=True, kw_only=True)
class OwnDesign(Factorial):
    """Trials of a design of one's own."""

    method: str
    """Which learns, see :func:`~pneumarm.learning.methods.find_method`."""
    fit: FitSettings
    """What no factor sets of the fit."""
    criteria: tuple[str, ...] = ("reward", "success_rate", "actions", "switches", "episodes")

    def settings(self) -> Any:
        """Return the settings of every trial, and the movements that it is judged by."""
        trials = {
            str(trial): {"train": msgspec.to_builtins(self.train_settings(trial)), **self._recipe(trial)}
            for trial in self.trials
        }
        return {"method": self.method, "movements": MOVEMENTS, "trials": trials}

    def _of(self, trial: int, part: str) -> dict[str, Any]:
        """Return the levels in ``trial`` of the factors of one ``part``, by the place of their setting in it."""
        levels = self.design.settings(trial)
        placed = [(*one.setting.partition(".")[::2], levels[one.label]) for one in self.design.factors]
        return {place: level for of, place, level in placed if of == part}

    def train_settings(self, trial: int) -> Any:
        """Return the settings of the training of ``trial``, those of any method."""
        return _with(self.base, self._of(trial, "train"))

    def _recipe(self, trial: int) -> dict[str, Any]:
        fit = _with(self.fit, self._of(trial, "fit"))
        return {"fit": asdict(fit), "arm": self._of(trial, "arm")}

    def recipe(self, trial: int, settings: LaboratorySettings) -> Recipe:
        """Return how the arm is recorded and its simulation fitted in ``trial``."""
        recipe = usual_recipe(settings, fit=_with(self.fit, self._of(trial, "fit")))
        return _with(recipe, self._of(trial, "arm"))

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> Any:
        """Return by trial what its recipe makes of ``arm``; it is recorded once for all fits of a recording."""
        made: dict[str, Prepared] = {}
        recipes = {trial: self.recipe(trial, settings) for trial in self.trials}
        for recipe in recipes.values():
            if repr(recipe) not in made:
                first = prepared(arm, folder, replace(recipe, fit=SINGLE_STEPS), settings, progress)
                fit, begin = fitted(first.folder / STORE, replace(recipe.fit, seed=settings.seed))
                made[repr(recipe)] = replace(first, recipe=recipe, simulation=fit.simulation, begin=begin)
        return {trial: made[repr(recipe)] for trial, recipe in recipes.items()}

    def measure(self, material: Any, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train, test, and move the arm: all trials of a run make the same movements."""
        goals = material[1].simulation.goals
        method = find_method(self.method)
        return train_and_move(material[trial], self.train_settings(trial), run, settings, goals, method)

    def movements(self, trial: int, arm: str, settings: LaboratorySettings) -> int:
        """Return how many movements are made on ``arm``."""
        return min(MOVEMENTS, settings.test_episodes)


def _with(settings: Any, places: Mapping[str, Any]) -> Any:
    """Return ``settings`` with the values at all ``places`` at once, so that only the whole has to be valid."""
    tables = msgspec.to_builtins(settings)
    for place, value in places.items():
        *outer, name = place.split(".")
        table = tables
        for one in outer:
            table = table.get(one) if isinstance(table, dict) else None
        if not isinstance(table, dict) or name not in table:
            raise UnusableInput(f"{type(settings).__name__} has no setting {place!r}")
        table[name] = value
    return msgspec.convert(tables, type(settings))


def _places(table: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Return the values in a ``table`` of a file, tables in it included, by the places of their settings."""
    found: dict[str, Any] = {}
    for name, value in table.items():
        place = f"{before}{name}"
        found |= _places(value, f"{place}.") if isinstance(value, dict) else {place: value}
    return found


def full_array(counts: Sequence[int]) -> tuple[OrthogonalArray, tuple[int, ...]]:
    """Return the array of all combinations of so many levels of each factor, and the columns of the factors.

    Where all factors have two levels, or all three, it has columns for all their interactions too.

    Raises:
        UnusableInput: there are more than 1,024.

    """
    trials = int(np.prod(counts))
    if trials > _MOST_TRIALS:
        raise UnusableInput(f"{trials:,} combinations of all levels are more than {_MOST_TRIALS:,}; take an array")
    prime = counts[0]
    if prime in _PRIMES and set(counts) == {prime}:
        columns = tuple((prime**digit - 1) // (prime - 1) + 1 for digit in range(len(counts)))
        return OrthogonalArray(FULL, linear(prime, len(counts))), columns
    levels = np.array(list(itertools.product(*map(range, counts))), np.int64)
    return OrthogonalArray(FULL, levels), tuple(range(1, len(counts) + 1))


def load_own_design(path: Path) -> OwnDesign:
    """Return the experiment in the TOML file ``path``; it is called as the file is.

    Raises:
        UnusableInput: it cannot be read, is no design, or names a setting that there is not.

    """
    try:
        read = msgspec.convert(read_toml(path, _EXPECTED), _File)
    except msgspec.ValidationError as error:
        raise UnusableInput(f"{path}: expected {_EXPECTED}; {error}") from error
    if not read.factors:
        raise UnusableInput(f"{path}: expected {_EXPECTED}; it has no factor")
    for factor in read.factors:
        if factor.setting.partition(".")[0] not in _PARTS:
            raise UnusableInput(
                f"{path}: factor {factor.label}: expected a setting of {', '.join(_PARTS)}, such as train.hidden, "
                f"got {factor.setting!r}"
            )
    try:
        method = find_method(read.method)
        if "settle" in method.tasks:
            raise UnusableInput(f"method {read.method}: its agents settle; expected one whose agents reach goals")
        made = OwnDesign(
            name=path.stem,
            words=Words(read.title, read.question, f"Design {path.name}"),
            runs=read.runs,
            design=_design(read),
            base=_with(method.settings(**method.fixed), _places(read.train)),
            thesis={},
            method=read.method,
            fit=_with(SINGLE_STEPS, _places(read.fit)),
        )
        for trial in made.trials:  # so that what cannot be is said before anything moves
            made.train_settings(trial)
            made.recipe(trial, LaboratorySettings())
    except (msgspec.ValidationError, UnusableInput) as error:
        raise UnusableInput(f"{path}: {error}") from error
    return made


def _design(read: _File) -> Design:
    if read.array != FULL:
        return assign(orthogonal_array(read.array), read.factors, read.interactions)
    array, columns = full_array([len(factor.levels) for factor in read.factors])
    return assign(array, [replace(one, column=c) for one, c in zip(read.factors, columns, strict=True)])

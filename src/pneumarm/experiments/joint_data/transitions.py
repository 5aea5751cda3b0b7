"""Numbers of transitions, each with its simulation."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pneumarm.arm.open import with_options
from pneumarm.experiments.experiment import Axis, Figures, LaboratorySettings
from pneumarm.experiments.several_joints import (
    FIT,
    POLICY,
    TRANSITIONS,
    Lesson,
    SeveralJoints,
    lesson_results,
    of_several,
)
from pneumarm.experiments.there_and_back import Prepared, Recipe, prepared
from pneumarm.experiments.words import words_of
from pneumarm.progress import Report


@dataclass(frozen=True, kw_only=True)
class JointData(SeveralJoints):
    """Simulations of more and more transitions, and one of one joint."""

    sizes: tuple[int, ...]
    """Transitions, in ascending order; the laboratory's number does not shorten them: they are the question."""

    @property
    def alone(self) -> int:
        """Number of the trial with one joint."""
        return len(self.sizes) + 1

    @property
    def trials(self) -> Mapping[int, str]:
        """The transitions, and one joint."""
        return {**super().trials, self.alone: f"one joint, {self.sizes[-1]:,}"}

    @property
    def axis(self) -> Axis:
        """The transitions."""
        return Axis("transitions [1000]", [size / 1000 for size in self.sizes], log=True)

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> Any:
        """Return a simulation of each number of transitions, and of a virtual arm one of an arm of one joint."""
        recipes = [replace(self.recipe, transitions=size) for size in self.sizes]
        made = [of_several(arm, folder, recipe, settings, progress) for recipe in recipes]
        if arm.startswith("virtual"):
            single = with_options(arm, joints=None, coupling=None)
            made.append(prepared(single, folder, recipes[-1], settings, progress))
        return made

    def measure(self, material: list[Prepared], trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Return how good the simulation of ``trial`` is, and of several joints what its policy does."""
        if trial > len(material):
            return {}
        chosen = material[trial - 1]
        if trial == self.alone:
            return chosen.figures
        return {**chosen.figures, **lesson_results(chosen, self.lessons[self.trials[trial]], run, settings)}


def joint_data(name: str, *sizes: int) -> JointData:
    """Return the experiment called ``name`` with these numbers of transitions, in ascending order.

    Networks of two joints have one layer too and are fitted by Levenberg-Marquardt, so that only the joints differ.
    """
    lessons = {f"{size:,}": Lesson(POLICY) for size in sizes}
    recipe = Recipe(TRANSITIONS, fit=replace(FIT, layers=1))
    return JointData(name=name, words=words_of(__package__), lessons=lessons, sizes=sizes, recipe=recipe)

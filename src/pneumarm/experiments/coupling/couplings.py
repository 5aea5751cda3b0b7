"""Arms whose joints act on each other less."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pneumarm.arm.open import with_options
from pneumarm.experiments.experiment import Axis, Figures, LaboratorySettings
from pneumarm.experiments.several_joints import POLICY, THESIS, Lesson, SeveralJoints, lesson_results, of_several
from pneumarm.experiments.there_and_back import Prepared
from pneumarm.experiments.words import words_of
from pneumarm.progress import Report


@dataclass(frozen=True, kw_only=True)
class Coupling(SeveralJoints):
    """A policy with all goals and thesis' agents with one, on arms of more and more coupling."""

    shares: tuple[float, ...]
    """Shares of the arm's coupling, in ascending order."""

    @property
    def axis(self) -> Axis:
        """The shares."""
        return Axis("share of the coupling [-]", self.shares)

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> Any:
        """Return a simulation of the arm with each share of its coupling.

        Raises:
            UnusableInput: it is not a virtual arm.

        """
        names = [arm if share == 1 else with_options(arm, coupling=f"{share:g}") for share in self.shares]
        return [of_several(name, folder, self.within(settings), settings, progress) for name in names]

    def measure(self, material: list[Prepared], trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Learn with the share of ``trial``, and move that arm."""
        chosen = material[(trial - 1) % len(self.shares)]
        return {**chosen.figures, **lesson_results(chosen, self.lessons[self.trials[trial]], run, settings)}


def coupling(*shares: float) -> Coupling:
    """Return the experiment with these shares of the coupling, in ascending order."""
    learners = {"policy, all goals": Lesson(POLICY), "thesis' agents, one goal": Lesson(THESIS, goals="middle")}
    lessons = {f"{who}, {share:g}": lesson for who, lesson in learners.items() for share in shares}
    return Coupling(name="coupling", words=words_of(__package__), lessons=lessons, shares=shares)

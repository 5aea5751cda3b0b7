"""One pair of goal angles, or all."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from pneumarm.experiments.several_joints import Lesson, SeveralJoints
from pneumarm.experiments.words import words_of

GOALS: Mapping[str, Literal["all", "one", "middle"]] = {"middle goal": "middle", "a goal": "one", "all goals": "all"}


@dataclass(frozen=True)
class GoalPairs(SeveralJoints):
    """The thesis' agents and a policy, each with the middle goal, with one anywhere, and with all."""

    name = "goal-pairs"
    words = words_of(__package__)

    @property
    def lessons(self) -> Mapping[str, Lesson]:
        """By who learns and what."""
        return {
            f"{who}, {what}": Lesson(learning, goals=goals)
            for who, learning in (("thesis' agents", self.thesis), ("policy", self.policy))
            for what, goals in GOALS.items()
        }

"""One pair of goal angles, or all."""

from collections.abc import Mapping
from dataclasses import dataclass

from pneumarm.experiments.several_joints import Lesson, SeveralJoints
from pneumarm.experiments.words import words_of


@dataclass(frozen=True)
class GoalPairs(SeveralJoints):
    """The thesis' agents and a policy, each with one goal and with all."""

    name = "goal-pairs"
    words = words_of(__package__)

    @property
    def lessons(self) -> Mapping[str, Lesson]:
        """By who learns and what."""
        return {
            f"{who}, {what}": Lesson(learning, one_goal=what == "one goal")
            for who, learning in (("thesis' agents", self.thesis), ("policy", self.policy))
            for what in ("one goal", "all goals")
        }

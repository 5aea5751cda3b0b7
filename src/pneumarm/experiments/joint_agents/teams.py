"""Who acts for the joints of an arm."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from pneumarm.experiments.several_joints import Lesson, SeveralJoints
from pneumarm.experiments.words import words_of

WHO = ("common goal", "own goals", "one agent", "policy")


@dataclass(frozen=True)
class JointAgents(SeveralJoints):
    """Teams of agents, each with one goal and with all."""

    episodes: int = 50_000
    """Of the thesis' agents, at most: half of what it needed for a single goal."""
    name = "joint-agents"
    words = words_of(__package__)

    @property
    def lessons(self) -> Mapping[str, Lesson]:
        """By what is learned and who acts."""
        thesis = replace(self.thesis, max_episodes=self.episodes)
        teams = (thesis, replace(thesis, team="own"), replace(thesis, team="one"), self.policy)
        return {
            f"{who}, {what}": Lesson(learning, goals="middle" if what == "one goal" else "all")
            for what in ("one goal", "all goals")
            for who, learning in zip(WHO, teams, strict=True)
        }

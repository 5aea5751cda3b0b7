"""What a user can choose about hierarchical learning."""

import math
from dataclasses import dataclass
from typing import Literal

from pneumarm.learning.online.settings import Team, TrainSettings
from pneumarm.settings import Valid

UpperState = Literal["angles", "whole"]


@dataclass(frozen=True)
class HierarchySettings(TrainSettings):
    """Thesis' agents one a joint, whose goals an upper agent sets."""

    team: Team = "own"
    """Lower agents have goals of their own: those that the upper one sets them."""
    ways: tuple[float, ...] = (0.0, 0.5, 1.0)
    """Subgoals that the upper agent can set a joint, as shares of the way from where it is to its goal."""
    period: int = 15
    """Actions after which it sets others, if not all joints are at theirs before."""
    subgoal: float = 50.0
    """Paid to a lower agent that reaches its subgoal, besides what is paid for the goal of all joints."""
    upper_hidden: int = 5
    """Hidden units of each of its networks, one for each combination of subgoals."""
    upper_state: UpperState = "angles"
    """What it sees: angles and goals alone, or all that the lower agents see."""

    def _valid(self) -> Valid:
        return {
            "team": self.team == "own",
            "ways": 1 <= len(self.ways) <= 16 and all(0 <= way <= 1 for way in self.ways),
            "period": self.period >= 1,
            "subgoal": math.isfinite(self.subgoal),
            "upper_hidden": 1 <= self.upper_hidden <= 1024,
            "upper_state": self.upper_state in ("angles", "whole"),
        }

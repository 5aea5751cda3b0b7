"""What a user can choose about hierarchical learning."""

from dataclasses import dataclass
from typing import Annotated, Literal

from msgspec import Meta

from pneumarm.learning.online.settings import Help, TrainSettings
from pneumarm.settings import PositiveInt, Share, Units, Valid

UpperState = Literal["angles", "whole"]


@dataclass(frozen=True)
class HierarchySettings(TrainSettings):
    """Thesis' agents one a joint, whose goals an upper agent sets."""

    team: Literal["own"] = "own"
    """Lower agents have goals of their own: those that the upper one sets them."""
    ways: Annotated[tuple[Share, ...], Meta(min_length=1, max_length=16)] = (0.0, 0.5, 1.0)
    """Subgoals that the upper agent can set a joint, as shares of the way from where it is to its goal."""
    period: PositiveInt = 15
    """Actions after which it sets others, if not all joints are at theirs before."""
    subgoal: float = 50.0
    """Paid to a lower agent that reaches its subgoal, besides what is paid for the goal of all joints."""
    upper_hidden: Units = 5
    """Hidden units of each of its networks, one for each combination of subgoals."""
    upper_state: UpperState = "angles"
    """What it sees: angles and goals alone, or all that the lower agents see."""

    def _valid(self) -> Valid:
        return {
            "help": self.help == Help() or "none: a hierarchy has its subgoals",
            "shaping": not self.shaping or not self.shaping.each or "one deviation for all joints",
        }

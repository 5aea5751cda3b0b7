"""Two days of movements with a night between, or without one."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pneumarm.arm import Arm, BeginState, guarded
from pneumarm.arm.virtual import VirtualArm
from pneumarm.control.turns import player
from pneumarm.experiments.experiment import Figures, LaboratorySettings, run_seed
from pneumarm.experiments.moving import MOVEMENTS, OnTheArm, agent_of, course, draws, new_arm
from pneumarm.experiments.preparation import Simulated
from pneumarm.experiments.words import words_of
from pneumarm.task.movements import join_movements


class Days(NamedTuple):
    """What is done on the first day and on the second."""

    words: str
    first: bool
    """Whether the agent learns on the first day."""
    second: bool
    night: bool = True
    """Whether there is a night between them."""


LEARNING, FIRST_DAY, FROZEN, NO_NIGHT = range(1, 5)
DAYS = {
    LEARNING: Days("learning on both days", True, True),
    FIRST_DAY: Days("learning on the first day", True, False),
    FROZEN: Days("never learning", False, False),
    NO_NIGHT: Days("learning, no night between", True, True, night=False),
}


@dataclass(frozen=True)
class OvernightSizes:
    """How much is moved in a row."""

    first: int = 1000
    """Movements before the night."""
    second: int = 1000
    """Movements after it."""
    block: int = 100
    """Movements in a point of the courses."""
    hours: float = 14.0
    """Hours of rest [h]."""
    learning_rate: float = 0.05
    """Learning rate of agents that learn (thesis: 0.05)."""


@dataclass(frozen=True)
class Overnight(OnTheArm):
    """Two days with a night between."""

    name = "overnight"
    words = words_of(__package__)
    sizes: OvernightSizes = OvernightSizes()

    @property
    def trials(self) -> Mapping[int, str]:
        """Who learns when."""
        return {trial: days.words for trial, days in DAYS.items()}

    def measure(self, material: Simulated, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Move for two days, exploring as at the end of training on both."""
        sizes, days, seed = self.sizes, DAYS[trial], run_seed(settings, run)
        agent = agent_of(material, self.agent, run, settings)
        explores, rate = self.agent.exploration, sizes.learning_rate
        with new_arm(material, run, settings) as arm:
            first = player(agent, arm, rate if days.first else 0.0, explores, seed)
            day = first.play(*draws(agent, seed, sizes.first, MOVEMENTS))
            if days.night:
                _rest(arm, 3600 * sizes.hours)
            second = player(first.learned, arm, rate if days.second else 0.0, explores, seed + 1)
            next_day = second.play(*draws(agent, seed, sizes.second, MOVEMENTS, sizes.first))
        return course(join_movements([day, next_day]), sizes.block)

    def movements(self, trial: int, arm: str, settings: LaboratorySettings) -> int:
        """Return those of both days."""
        return self.sizes.first + self.sizes.second

    def rest(self, trial: int) -> float:
        """Return how long the night is [s]."""
        return 3600 * self.sizes.hours if DAYS[trial].night else 0.0


def _rest(arm: Arm, seconds: float) -> None:
    """Leave the arm vented for ``seconds`` [s]; a virtual one in no time."""
    if isinstance(arm, VirtualArm):
        arm.rest(seconds)
    else:
        BeginState(settle=seconds).inflated(guarded(arm), np.zeros((arm.spec.joints, 2)))

"""What is asked of a movement, as a person chooses it."""

from dataclasses import dataclass, field
from typing import Annotated

from pneumarm.settings import PositiveInt, PythonOnly, Settings
from pneumarm.simulation.noise import NoiseSettings
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.reward import Reward
from pneumarm.transitions.goals import Goals


@dataclass(frozen=True)
class TaskSettings(Settings):
    """What is asked of a movement; who learns to make movements has settings that add to these."""

    reward: Annotated[Reward, PythonOnly] = field(default_factory=Reward)
    """What is paid for an action, and when a goal is reached."""
    cutoff: PositiveInt = 100
    """Actions after which a movement that has not reached its goal is cut off (thesis section 5.4.2: 100)."""
    noise: Annotated[NoiseSettings, PythonOnly] = field(default_factory=NoiseSettings)
    """Noise on the predictions of a simulation in which movements are made."""

    def goals_in(self, simulation: Simulation) -> Goals:
        """Return the goals that movements in ``simulation`` are made to."""
        return simulation.goals

    @property
    def by_length(self) -> bool:
        """Whether the side of a goal to begin on is drawn by the length that the deviation leaves it."""
        return False

    @property
    def begin_weights(self) -> tuple[float, ...]:
        """Weights of the sub-intervals of begin states on each side of the goal, the farthest first."""
        return (1.0,)

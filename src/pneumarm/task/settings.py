"""What is asked of a movement, as a person chooses it."""

from dataclasses import dataclass, field
from typing import Annotated

from pneumarm.settings import PositiveInt, PythonOnly, Settings
from pneumarm.simulation.noise import NoiseSettings
from pneumarm.task.reward import Reward


@dataclass(frozen=True)
class TaskSettings(Settings):
    """What is asked of a movement; who learns to make movements has settings that add to these."""

    reward: Annotated[Reward, PythonOnly] = field(default_factory=Reward)
    """What is paid for an action, and when a goal is reached."""
    cutoff: PositiveInt = 100
    """Actions after which a movement that has not reached its goal is cut off (thesis section 5.4.2: 100)."""
    noise: Annotated[NoiseSettings, PythonOnly] = field(default_factory=NoiseSettings)
    """Noise on the predictions of a simulation in which movements are made."""

    @property
    def begin_weights(self) -> tuple[float, ...]:
        """Weights of the sub-intervals of begin states on each side of the goal, the farthest first."""
        return (1.0,)

"""What a user can choose about evolution."""

from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta

from pneumarm.learning.evolution.populations import SubPopulationSettings
from pneumarm.settings import PositiveFloat, PositiveInt, PythonOnly, Units
from pneumarm.task.settings import TaskSettings


@dataclass(frozen=True)
class EvolutionSettings(TaskSettings, SubPopulationSettings):
    """A recurrent network, evolved in simulated arms, and what it sees of them."""

    agents: Annotated[int, Meta(ge=1, le=256)] = 2
    """Evolutions at once from different neurons, of which the best network is kept; one a core takes no longer."""
    generations: PositiveInt = 100
    """Generations of each."""
    hidden: Units = 8
    """Units of the network, of which the first are its outputs, one a muscle."""
    episodes: Annotated[int, Meta(ge=1, le=65_536)] = 32
    """Episodes in which the fitness of a network is measured: its mean reward. All networks of a generation have the
    same begin states, goals and noise."""
    history: bool = False
    """Whether it sees the observations and commands of earlier steps, too, as the state holds them (thesis eq. 3.5);
    by default its units have to remember what matters of these."""
    velocity: bool = True
    """Whether it sees velocities."""
    pressures: bool = True
    """Whether it sees pressures."""
    recurrent: bool = True
    """Whether its units see each other as they were in the step before."""
    squash: Annotated[tuple[PositiveFloat, ...], Meta(max_length=16), PythonOnly] = (25.0, 100.0)
    """Errors of the angle at which the inputs that tell them bend, finely and coarsely [counts of the thesis']."""
    champion_episodes: Annotated[PositiveInt, PythonOnly] = 512
    """Episodes by which the best network of a generation is compared with the best so far, always the same."""
    validation_episodes: Annotated[PositiveInt, PythonOnly] = 2_000
    """Episodes on which the best of the agents is chosen."""

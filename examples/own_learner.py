"""A learner of your own: its settings, a function that trains, one that loads. Needs arm.db and arm.sim of first.py.

It pushes towards the goal until that is near, and tries at random how near that should be. On the command line it is
``pneumarm train arm.sim arm.db --out push.agent --method own_learner:MINE --own.trials 8``.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import msgspec
import numpy as np

import pneumarm
from pneumarm.files import read_arrays, write_arrays
from pneumarm.learning import LearnSettings, Method, SimulationAgent, Training, test
from pneumarm.simulation import Simulation
from pneumarm.task import BeginStates, TaskSettings

KIND = "own_learner:MINE"
DOWN, CLOSED, UP = 2, 4, 6  # actions


@dataclass(frozen=True)
class PushSettings(TaskSettings):
    """How it learns."""

    trials: int = 4


@dataclass(frozen=True, repr=False)
class PushAgent(SimulationAgent):
    """Pushes until the goal is ``near`` [counts]."""

    near: float
    settings: PushSettings

    def actor(self) -> "PushActor":
        """Return it acting state by state."""
        return PushActor(self)

    def save(self, path: Path) -> None:
        """Write it to ``path``."""
        header, arrays = self.simulation.parts()
        settings = {"simulation": header, "settings": msgspec.to_builtins(self.settings)}
        write_arrays(path, KIND, settings, {**arrays, "near": np.array([self.near])})

    @classmethod
    def load(cls, path: Path) -> Self:
        """Return the agent in ``path``."""
        header, arrays = read_arrays(path, KIND)
        near, settings = float(arrays.pop("near")[0]), msgspec.convert(header["settings"], PushSettings)
        return cls(Simulation.of_parts(header["simulation"], arrays), near, settings)


class PushActor:
    """A push agent that acts."""

    def __init__(self, agent: PushAgent) -> None:
        self.offset, self.scale = agent.scaling.observation_offset[0], agent.scaling.observation_scale[0]
        self.near = agent.near

    def begin(self, state: np.ndarray, goal: np.ndarray) -> None:
        """Begin in the scaled ``state`` towards ``goal`` (1,) [counts]."""
        self.goal = float(goal[0])
        self.follow(state)

    def follow(self, next_state: np.ndarray) -> None:
        """Go on in ``next_state``."""
        self.error = self.goal - (self.offset + self.scale * float(next_state[0]))

    def act(self) -> np.ndarray:
        """Return the action (1,)."""
        return np.array([CLOSED if abs(self.error) < self.near else UP if self.error > 0 else DOWN])


def train(
    simulation: Simulation, begin: BeginStates, settings: PushSettings, seed: int = 0, **how: Any
) -> Training[PushAgent]:
    """Return the best of some agents that are drawn at random."""
    drawn = np.random.default_rng(seed).uniform(5.0, 60.0, settings.trials)
    agents = [PushAgent(simulation, float(near), settings) for near in drawn]
    tested = tuple(test(one, simulation, begin, 100, seed) for one in agents)
    best = int(np.argmax([one.reward.mean() for one in tested]))
    return Training(agents[best], best, tested)


MINE = Method(PushSettings, train, PushAgent.load)

if __name__ == "__main__":
    chosen = LearnSettings(method=KIND, own={"trials": 6})
    training = pneumarm.train("arm.sim", "arm.db", "push.agent", settings=chosen)
    print(f"near: {training.agent.near:.1f} counts")
    print(pneumarm.test(training.agent, "arm.sim", "arm.db", episodes=500))

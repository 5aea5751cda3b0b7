"""Learning in many simulated arms at once, whatever is learned: its settings, and what its learners share."""

import time
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Generic, TypeVar

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from pneumarm.learning.training import Learner, Progress, Training, identity_of, train_side_by_side
from pneumarm.networks.layers import Trainable
from pneumarm.settings import PositiveFloat, PositiveInt, PythonOnly, Share
from pneumarm.task.environment import Environment
from pneumarm.task.fleet import Fleet
from pneumarm.task.settings import TaskSettings

_ROW = 10  # updates between two rows of the curves
_NETWORK = ("flat", "mean", "square")
_FLEET = ("x", "average", "random", "goal", "actions", "still", "taken")
AgentT = TypeVar("AgentT")
SettingsT = TypeVar("SettingsT", bound="FleetSettings")


@dataclass(frozen=True)
class FleetSettings(TaskSettings):
    """What learning in many simulated arms at once needs, whatever is learned."""

    agents: Annotated[int, Meta(ge=1, le=256)] = 2
    """Agents trained at once from different weights, of which the best is kept; one a core takes no longer."""
    updates: PositiveInt = 90
    """How often experience is collected and learned from."""
    arms: Annotated[int, Meta(ge=1, le=65_536)] = 128
    """Simulated arms that move at once."""
    steps: Annotated[int, Meta(ge=1, le=4096)] = 64
    """Steps of each arm in a batch of experience."""
    learning_rate: PositiveFloat = 4e-3
    """Of Adam at the start; falls linearly to 0."""
    epochs: PositiveInt = 6
    """How often each batch is learned from."""
    discount: Share = 0.99
    """gamma (thesis: 0.98)."""
    trace_decay: Share = 0.95
    """lambda (thesis: 0)."""
    largest_gradient: Annotated[PositiveFloat, PythonOnly] = 0.5
    """Longer gradients are cut to this length."""
    return_scale: Annotated[PositiveFloat, PythonOnly] = 50.0
    """Return that a network's output of 1 stands for."""
    validation_episodes: Annotated[PositiveInt, PythonOnly] = 2_000
    """Greedy episodes, without lookahead, on which the best agent is chosen."""


class FleetLearner(Learner[AgentT], Generic[AgentT, SettingsT]):
    """One learner with its simulated arms; its curve tells what they earn, exploring, since the row before."""

    columns = ("episodes", "reward", "success")
    networks: ClassVar[tuple[str, ...]]
    """Names of the attributes that are networks."""

    def __init__(
        self, settings: SettingsT, environment: Environment, fleet: Fleet, random: NDArray[np.uint64]
    ) -> None:
        super().__init__()
        self.environment, self.fleet = environment, fleet
        self.random = random
        self.settings = settings
        self.counts = np.zeros(3, np.int64)
        """Batches learned from, updates by Adam, episodes."""

    @abstractmethod
    def update(self) -> tuple[int, int, float]:
        """Collect and learn once; return the episodes that ended, the successes and the sum of rewards."""

    @property
    def ended(self) -> bool:
        """Whether it has learned from as many batches as the settings say."""
        return int(self.counts[0]) >= self.settings.updates

    @property
    def share(self) -> float:
        """How far it is, 0 to 1."""
        return float(self.counts[0]) / self.settings.updates

    @property
    def episodes(self) -> int:
        """Training episodes so far."""
        return int(self.counts[2])

    @property
    def steps(self) -> int:
        """Steps of all its arms."""
        return int(self.counts[0]) * self.settings.arms * self.settings.steps

    def warm_up(self) -> None:
        """Collect and learn once."""
        self.update()

    def learn_on(self) -> None:
        """Learn from the next ten batches."""
        self.learn(min(_ROW, self.settings.updates - int(self.counts[0])))

    def learn(self, updates: int) -> None:
        """Collect and learn so many times, and add a row to the curve."""
        began, seen = time.thread_time(), np.zeros(3)
        for _ in range(updates):
            seen += self.update()
            self.counts[0] += 1
        self.counts[2] += int(seen[0])
        each = max(seen[0], 1.0)
        self.add_row((self.counts[2], seen[2] / each, seen[1] / each), time.thread_time() - began)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all that its future depends on, by name."""
        found: dict[str, NDArray[Any]] = {"random": self.random, "counts": self.counts}
        for part in self.networks:
            network: Trainable = getattr(self, part)
            found |= {f"{part}.{name}": getattr(network, name) for name in _NETWORK}
        return found | {f"fleet.{name}": getattr(self.fleet, name) for name in _FLEET}


def train_fleet(
    make: Callable[[int], FleetLearner[AgentT, Any]],
    settings: FleetSettings,
    seed: int = 0,
    *,
    progress: Callable[[Progress], None] | None = None,
    checkpoint: Path | None = None,
    threads: int | None = None,
) -> Training[AgentT]:
    """Train ``settings.agents`` learners, of which ``make`` makes each by its number, see :func:`train_side_by_side`.

    ``seed`` is the one that the learners are made with.

    Raises:
        UnusableInput: the checkpoint is of another training.

    """
    identity = identity_of(make(0).environment, settings, seed)
    return train_side_by_side(
        make, settings.agents, settings.validation_episodes, identity,
        progress=progress, checkpoint=checkpoint, threads=threads,
    )  # fmt: skip

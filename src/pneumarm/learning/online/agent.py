"""A trained agent and its file, which holds all that is needed to use it: neither simulation nor store."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.learning.agents import ReachesGoals
from pneumarm.learning.online.settings import TrainSettings
from pneumarm.learning.online.testing import run_test
from pneumarm.learning.online.values import Networks, network_shapes, pack, unpack
from pneumarm.simulation.simulation import Scaling, Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import environment
from pneumarm.task.movements import Movements
from pneumarm.transitions.window import Window

if TYPE_CHECKING:
    from pneumarm.learning.online.learner import OnlineLearner

KIND = "pneumarm agent"
_MOST_JOINTS, _MOST_HISTORY = 16, 64  # beyond these a file is damaged, not ambitious


class AgentHeader(msgspec.Struct, forbid_unknown_fields=True):
    """What the file of an agent says besides its arrays."""

    spec: ArmSpec
    window: Window
    settings: TrainSettings


@dataclass(frozen=True)
class Agent(ReachesGoals):
    """Action values by state, goal and action, and how they were learned."""

    spec: ArmSpec
    window: Window
    scaling: Scaling
    goal_range: NDArray[np.float64]
    """Goals that it has learned to reach, shape (joints, 2) [counts]."""
    networks: Networks
    settings: TrainSettings
    """How it was trained; ``settings.exploration`` holds the end-of-shaping values to go on learning with."""

    def weights(self) -> NDArray[np.float32]:
        """Return a fresh copy of the networks as a kernel uses them, see :class:`~.values.ActionValues`."""
        return pack(self.networks, self.window)

    def with_weights(self, weights: NDArray[np.float32]) -> Self:
        """Return the agent with other ``weights``, as of :meth:`weights`."""
        return replace(self, networks=unpack(weights, self.window, self.settings.hidden, self.settings.team))

    def actor(self) -> "OnlineLearner":
        """Return the agent acting step by step, greedily."""
        from pneumarm.learning.online.learner import OnlineLearner  # which imports this module

        return OnlineLearner(self)

    def learner(self, learning_rate: float, seed: int = 0) -> "OnlineLearner":
        """Return the agent acting and learning step by step, exploring as at the end of its training."""
        from pneumarm.learning.online.learner import OnlineLearner  # which imports this module

        return OnlineLearner(self, learning_rate, self.settings.exploration, seed)

    def test(self, simulation: Simulation, begin: BeginStates, episodes: int, seed: tuple[int, ...]) -> Movements:
        """Let the agent move greedily in ``simulation``."""
        env = environment(simulation, begin, self.settings)
        return run_test(env, self.weights(), self.settings, episodes, seed)

    def save(self, path: Path) -> None:
        """Write the agent to ``path``, whole or not at all.

        Raises:
            UnusableInput: ``path`` cannot be written.

        """
        settings = msgspec.to_builtins(AgentHeader(self.spec, self.window, self.settings))
        scaling = {name: getattr(self.scaling, name) for name in _SCALING}
        write_arrays(path, KIND, settings, self.networks._asdict() | scaling | {"goal_range": self.goal_range})

    @classmethod
    def load(cls, path: Path) -> Self:
        """Return the agent in ``path``.

        Raises:
            UnusableInput: ``path`` is no agent, is damaged, or does not fit together.

        """
        read, arrays = read_arrays(path, KIND)
        try:
            known = msgspec.convert(read, AgentHeader)
        except (msgspec.ValidationError, UnusableInput) as error:
            raise UnusableInput(f"{path}: expected the settings of an agent; {error}") from error
        window = known.window
        sizes_fit = 1 <= window.joints <= _MOST_JOINTS and 1 <= window.history <= _MOST_HISTORY
        if not sizes_fit or window.joints != known.spec.joints:
            raise UnusableInput(f"{path}: {window} and an arm of {known.spec.joints} joint(s) are no agent's")
        expected = _expected(window, known.settings)
        if arrays.keys() != expected.keys():
            raise UnusableInput(f"{path}: expected the arrays {sorted(expected)}, got {sorted(arrays)}")
        for name, like in expected.items():
            if arrays[name].shape != like.shape or arrays[name].dtype != like.dtype:
                raise UnusableInput(
                    f"{path}: expected {name} of shape {like.shape} and type {like.dtype}, "
                    f"got {arrays[name].shape} of {arrays[name].dtype}"
                )
        if not ((arrays["observation_scale"] > 0).all() and (arrays["command_scale"] > 0).all()):
            raise UnusableInput(f"{path}: scales must be positive")
        if not (arrays["goal_range"][:, 0] <= arrays["goal_range"][:, 1]).all():
            raise UnusableInput(f"{path}: goal_range must hold lower and upper ends in this order")
        return cls(
            spec=known.spec,
            window=window,
            scaling=Scaling(*(arrays[name] for name in _SCALING)),
            goal_range=arrays["goal_range"],
            networks=Networks(*(arrays[name] for name in Networks._fields)),
            settings=known.settings,
        )


_SCALING = ("observation_offset", "observation_scale", "command_scale")


def _expected(window: Window, settings: TrainSettings) -> dict[str, NDArray[Any]]:
    observed, commanded = np.zeros(window.observation_size), np.zeros(window.command_size)
    scaling = dict(zip(_SCALING, (observed, observed, commanded), strict=True))
    return (
        network_shapes(window, settings.hidden, settings.team)._asdict()
        | scaling
        | {"goal_range": np.zeros((window.joints, 2))}
    )

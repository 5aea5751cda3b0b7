"""An agent that is a network, and its file: the network and the simulation of its arm, all that it needs to act."""

from abc import abstractmethod
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Self

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.learning.agents import SimulationAgent
from pneumarm.networks.layers import weight_count
from pneumarm.simulation.simulation import Simulation

_WEIGHTS = "policy_weights"


@dataclass(frozen=True, repr=False)
class NetworkAgent(SimulationAgent):
    """A policy in a network, and the simulation that it was trained in."""

    kind: ClassVar[str]
    """Of its file."""
    settings_type: ClassVar[type[Any]]
    """Class of its settings."""

    policy: NDArray[np.float32]
    """Weights of its network, layer after layer, shape (size,)."""
    settings: Any
    """How it was trained, and for which task."""

    @property
    @abstractmethod
    def sizes(self) -> tuple[int, ...]:
        """Units of each layer of the policy, inputs first."""

    @property
    def size(self) -> int:
        """Number of weights of the policy."""
        return weight_count(self.sizes)

    def weights(self) -> NDArray[np.float32]:
        """Return a copy of the policy's weights."""
        return self.policy.copy()

    def revised(self, simulation: Simulation, weights: NDArray[np.float32]) -> Self:
        """Return the agent with another ``simulation`` of its arm and other ``weights``."""
        return replace(self, simulation=simulation, policy=weights)

    def save(self, path: Path) -> None:
        """Write the agent to ``path``, whole or not at all.

        Raises:
            UnusableInput: ``path`` cannot be written.

        """
        header, arrays = self.simulation.parts()
        settings = {"simulation": header, "settings": msgspec.to_builtins(self.settings)}
        write_arrays(path, self.kind, settings, arrays | {_WEIGHTS: self.policy})

    @classmethod
    def load(cls, path: Path) -> Self:
        """Return the agent in ``path``.

        Raises:
            UnusableInput: ``path`` is no such agent, is damaged, or does not fit together.

        """
        read, arrays = read_arrays(path, cls.kind)
        try:
            settings = msgspec.convert(read["settings"], cls.settings_type)
            policy = arrays.pop(_WEIGHTS)
            agent = cls(Simulation.of_parts(read["simulation"], arrays), policy, settings)
        except (msgspec.ValidationError, UnusableInput, ValueError, KeyError, TypeError) as error:
            raise UnusableInput(f"{path}: is no usable agent ({error}); train it again") from error
        if policy.shape != (agent.size,) or policy.dtype != np.float32:
            raise UnusableInput(
                f"{path}: expected {agent.size} policy weights of type float32, got {policy.shape} of {policy.dtype}"
            )
        return agent

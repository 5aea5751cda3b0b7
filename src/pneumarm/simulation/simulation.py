"""The empirical simulation: networks fitted to transitions, and what is needed to use them (thesis chapter 3)."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.networks.network import Network
from pneumarm.transitions.window import Window


@dataclass(frozen=True)
class Scaling:
    """Pre-processing: scaled = (raw - offset) / scale, so that the data lie within about -1 to 1."""

    observation_offset: NDArray[np.float64]
    """Shape (4 joints,) [sensor units]."""
    observation_scale: NDArray[np.float64]
    """Shape (4 joints,) [sensor units]."""
    command_scale: NDArray[np.float64]
    """Shape (2 joints,); ones for valves. Commands have no offset: 0 is a closed valve."""


@dataclass(frozen=True)
class Simulation:
    """A simulation of an arm: one step is ``o_{k+1} = o_k + networks(sigma_k, a_k)``.

    The networks read scaled inputs and give scaled *changes*, in the order angle, pressure 1, pressure 2 joint
    after joint; with ``velocity == "network"`` angle, velocity, pressure 1, pressure 2.
    """

    spec: ArmSpec
    window: Window
    scaling: Scaling
    networks: tuple[Network, ...]
    """One network an output, or a single network with all outputs (thesis section 3.4)."""
    velocity: Literal["derived", "network"]
    """Whether the velocity is derived from the predicted angle with the nominal period (section 3.2.4)."""
    error_std: NDArray[np.float64]
    """Standard deviation of the one-step error on held-out transitions, shape (joints, 4) [sensor units]."""
    goal_range: NDArray[np.float64]
    """1st and 99th percentile of the stored angles, shape (joints, 2) [counts]."""
    valves: bool = True
    """Whether the commands are valves; with continuous commands no agent of ours can be trained."""

    def predict(self, inputs: ArrayLike) -> NDArray[np.float64]:
        """Return o_{k+1} (n, 4 joints) for sigma_k and a_k (n, input_size), both in sensor units."""
        raise NotImplementedError

"""A policy that was learned with another library on the same observations: dense layers, and the highest output wins.

The file holds plain numbers, as all files here, so that nothing of that library is needed to use it. Actions are
taken greedily; it does not go on learning on an arm.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Self

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.arm.valves import possible_actions
from pneumarm.errors import UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.learning.agents import ReachesGoals
from pneumarm.learning.online.settings import TrainSettings
from pneumarm.simulation.simulation import Scaling
from pneumarm.transitions.window import QUANTITIES, Window

KIND = "pneumarm imported policy"
Activation = Literal["tanh", "relu"]
Array = NDArray[np.float32]

_SCALING = ("observation_offset", "observation_scale", "command_scale")
_MOST_LAYERS = 64


class ImportedHeader(msgspec.Struct, forbid_unknown_fields=True):
    """What the file of an imported policy says besides its arrays."""

    spec: ArmSpec
    window: Window
    activation: Activation
    layers: int
    settings: TrainSettings


@dataclass(frozen=True)
class ImportedPolicy(ReachesGoals):
    """Dense layers from the scaled state with the goal (thesis eq. 4.12) to a value for each action of each joint."""

    spec: ArmSpec
    window: Window
    scaling: Scaling
    goal_range: NDArray[np.float64]
    """Goals that it has learned to reach, shape (joints, 2) [counts]."""
    layers: tuple[tuple[Array, Array], ...]
    """Weights (inputs, outputs) and biases (outputs,); the last has an output for each action a joint has, 9 or 3."""
    activation: Activation = "tanh"
    """Between the layers."""
    settings: TrainSettings = field(default_factory=TrainSettings)
    """Of these the reward, the cut-off and the noise of a test are used: nothing is trained here."""

    def __post_init__(self) -> None:
        sizes = [self.window.state_size + self.window.joints]
        for weights, bias in self.layers:
            if weights.shape != (sizes[-1], bias.size):
                raise UnusableInput(
                    f"a layer of {weights.shape} with {bias.size} biases does not fit to {sizes[-1]} inputs"
                )
            sizes.append(bias.size)
        if len(sizes) == 1 or sizes[-1] != len(self.actions) * self.window.joints:
            raise UnusableInput(f"a policy needs {len(self.actions)} outputs a joint, this one has {sizes[-1]}")

    @property
    def actions(self) -> NDArray[np.int64]:
        """Actions that a joint has, of 0..8, in the order of the outputs."""
        return np.flatnonzero(possible_actions(self.spec.muscles))

    def values(self, inputs: ArrayLike) -> Array:
        """Return a value for each action (..., joints, actions) of states with goals ``inputs`` (..., inputs)."""
        x = np.asarray(inputs, np.float32)
        for number, (weights, bias) in enumerate(self.layers):
            x = x @ weights + bias
            if number < len(self.layers) - 1:
                x = np.tanh(x) if self.activation == "tanh" else np.maximum(x, np.float32(0))
        values: Array = x.reshape(*x.shape[:-1], self.window.joints, len(self.actions))
        return values

    def actor(self) -> "ImportedActor":
        """Return it acting greedily; it neither learns nor explores."""
        return ImportedActor(self)

    def save(self, path: Path) -> None:
        """Write it to ``path``, whole or not at all.

        Raises:
            UnusableInput: ``path`` cannot be written.

        """
        settings = ImportedHeader(self.spec, self.window, self.activation, len(self.layers), self.settings)
        arrays: dict[str, NDArray[np.floating]] = {name: getattr(self.scaling, name) for name in _SCALING}
        arrays["goal_range"] = self.goal_range
        for number, (weights, bias) in enumerate(self.layers):
            arrays[f"weights_{number}"], arrays[f"bias_{number}"] = weights, bias
        write_arrays(path, KIND, msgspec.to_builtins(settings), arrays)

    @classmethod
    def load(cls, path: Path) -> Self:
        """Return the policy in ``path``.

        Raises:
            UnusableInput: ``path`` is no such policy, is damaged, or does not fit together.

        """
        read, arrays = read_arrays(path, KIND)
        try:
            known = msgspec.convert(read, ImportedHeader)
            joints, size = known.window.joints, known.window.observation_size
            if known.spec.joints != joints or not 1 <= known.layers <= _MOST_LAYERS:
                raise UnusableInput(f"{known.layers} layers for {joints} of {known.spec.joints} joints are no policy")
            expected = {"goal_range": (joints, 2), "command_scale": (2 * joints,)}
            expected |= {"observation_offset": (size,), "observation_scale": (size,)}
            for name, shape in expected.items():
                if arrays[name].shape != shape or arrays[name].dtype != np.float64:
                    raise UnusableInput(f"{name} must be {shape} of float64, it is {arrays[name].shape}")
            if not all((arrays[name] > 0).all() for name in ("observation_scale", "command_scale")):
                raise UnusableInput("scales must be positive")
            layers = tuple(
                (_layer(arrays, "weights", k, 2), _layer(arrays, "bias", k, 1)) for k in range(known.layers)
            )
            scaling = Scaling(*(arrays[name] for name in _SCALING))
            return cls(
                known.spec, known.window, scaling, arrays["goal_range"], layers, known.activation, known.settings
            )
        except (msgspec.ValidationError, UnusableInput, KeyError) as error:
            raise UnusableInput(f"{path}: expected an imported policy; {error}") from error


def _layer(arrays: dict[str, NDArray[np.generic]], name: str, number: int, dimensions: int) -> Array:
    array = arrays[f"{name}_{number}"]
    if array.ndim != dimensions or array.dtype != np.float32:
        raise UnusableInput(f"{name}_{number} must have {dimensions} dimensions of float32")
    return array.astype(np.float32)


class ImportedActor:
    """An :class:`ImportedPolicy` acting step by step, greedily."""

    def __init__(self, policy: ImportedPolicy) -> None:
        self._policy, self._actions = policy, policy.actions
        self._inputs = np.zeros(policy.window.state_size + policy.window.joints, np.float32)

    def begin(self, state: ArrayLike, goal: ArrayLike) -> None:
        """Begin an episode at rest in the scaled ``state`` (state_size,) towards ``goal`` (joints,) [counts]."""
        scaling = self._policy.scaling
        angles = slice(0, self._policy.window.joint_size, len(QUANTITIES))
        scaled = (np.asarray(goal) - scaling.observation_offset[angles]) / scaling.observation_scale[angles]
        self._inputs[self._policy.window.state_size :] = scaled
        self.follow(state)

    def act(self) -> NDArray[np.int64]:
        """Return the actions (joints,) of the current state."""
        return self._actions[self._policy.values(self._inputs).argmax(axis=-1)]

    def follow(self, next_state: ArrayLike) -> None:
        """Go on in ``next_state``."""
        self._inputs[: self._policy.window.state_size] = next_state

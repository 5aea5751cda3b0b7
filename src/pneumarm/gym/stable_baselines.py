"""Agents of stable-baselines3 and sb3-contrib: trained on our simulation, used by our commands.

    from stable_baselines3 import PPO
    from pneumarm.gym.stable_baselines import StableVector, imported

    many = point_to_point_vector("simulation:arm.sim", "arm.db", 8, autoreset_mode=AutoresetMode.SAME_STEP)
    model = PPO("MlpPolicy", StableVector(many, 1 / 50), gamma=0.98, n_steps=256, batch_size=256, ent_coef=0.01)
    model.learn(450_000)
    imported(model, Simulation.load("arm.sim")).save("ppo.agent")

Needs the extra ``pneumarm[stable-baselines]``.
"""

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.gym.spaces import numbered
from pneumarm.gym.vector import PointToPointVector
from pneumarm.learning.imported import Activation, ImportedPolicy
from pneumarm.learning.online.settings import TrainSettings
from pneumarm.simulation.simulation import Simulation

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise UnusableInput(
        "pneumarm.gym.stable_baselines needs stable-baselines3: pip install 'pneumarm[stable-baselines]'"
    ) from error

Array = NDArray[Any]


class StableVector(VecEnv):  # type: ignore[misc, unused-ignore]
    """Our vectorised environment as stable-baselines3 wants it."""

    def __init__(self, many: PointToPointVector, reward_scale: float = 1.0) -> None:
        """Wrap ``many``, which has to reset in the same step, as all environments of stable-baselines3 do.

        Args:
            many: the movements.
            reward_scale: rewards are multiplied by it. With 1/50 returns are about 1; as they are, the error of the
                value is in the thousands at first and uses up the gradient that PPO allows: after 100,000 steps on
                arm 1 of the distribution the reward was -50 without it and 33 with it.

        Raises:
            UnusableInput: it resets in the next step, or the scale is not positive.

        """
        if not 0 < reward_scale < np.inf:
            raise UnusableInput(f"reward_scale must be positive and finite, got {reward_scale}")
        if many.metadata["autoreset_mode"] != AutoresetMode.SAME_STEP:
            raise UnusableInput("stable-baselines3 needs autoreset_mode=AutoresetMode.SAME_STEP")
        self._many = many
        self._reward_scale = reward_scale
        self._actions: Array = np.zeros(0, np.int64)
        self.render_mode = None
        self._given: list[int] | None = None
        super().__init__(many.num_envs, many.single_observation_space, many.single_action_space)

    def reset(self) -> Array:
        """Begin all movements; seeds of :meth:`seed` are used once."""
        observed, _ = self._many.reset(seed=self._given)
        self._given = None
        return observed

    def seed(self, seed: int | None = None) -> list[int]:
        """Have the next reset begin from ``seed``, one drawn unless it is given, and those after it."""
        first = int(np.random.default_rng().integers(2**32)) if seed is None else seed
        self._given = list(range(first, first + self.num_envs))
        return self._given

    def step_async(self, actions: Array) -> None:
        """Remember ``actions``."""
        self._actions = actions

    def step_wait(self) -> tuple[Array, Array, Array, list[dict[str, Any]]]:
        """Take the actions; the last observation of a movement that ended is in its info."""
        observed, reward, terminated, truncated, more = self._many.step(self._actions)
        ended = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for e in np.flatnonzero(ended).tolist():
            infos[e] = {
                "terminal_observation": more["final_obs"][e],
                "TimeLimit.truncated": bool(truncated[e]),
                "is_success": bool(terminated[e]),
            }
        return observed, (self._reward_scale * reward).astype(np.float32), ended, infos

    def close(self) -> None:
        """Let the threads go."""
        self._many.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the whole for each movement; AttributeError where it has none of this name."""
        return [getattr(self._many, attr_name) for _ in range(self._count(indices))]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse: movements have no attributes of their own."""
        raise UnusableInput(f"{attr_name} cannot be set: the movements are one")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Refuse: movements have no methods of their own."""
        raise UnusableInput(f"{method_name} cannot be called: the movements are one")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return that none is wrapped."""
        return [False for _ in range(self._count(indices))]

    def _count(self, indices: Any) -> int:
        return self.num_envs if indices is None else np.size(indices)


def imported(model: Any, simulation: Simulation, settings: TrainSettings | None = None) -> ImportedPolicy:
    """Return the policy of ``model`` as an agent of ours.

    Args:
        model: a PPO, A2C, DQN or QR-DQN with an ``MlpPolicy``, trained on ``simulation``.
        simulation: its state window, scaling and goals are the agent's.
        settings: of the task that it was trained for; the thesis' by default.

    Raises:
        UnusableInput: another kind of model, or one that was trained on other observations.

    """
    policy = model.policy
    if hasattr(policy, "action_net"):
        modules = [*policy.mlp_extractor.policy_net, policy.action_net]
    elif hasattr(policy, "q_net"):
        modules = list(policy.q_net.q_net)
    elif hasattr(policy, "quantile_net"):
        modules = list(policy.quantile_net.quantile_net)
    else:
        raise UnusableInput(f"expected a PPO, A2C, DQN or QR-DQN with an MlpPolicy, got {type(model).__name__}")
    layers, activations = [], set()
    for module in modules:
        kind = type(module).__name__
        if kind == "Linear":
            weights, bias = (p.detach().cpu().numpy().astype(np.float32) for p in (module.weight, module.bias))
            layers.append((np.ascontiguousarray(weights.T), bias))
        else:
            activations.add(kind)
    known: dict[str, Activation] = {"Tanh": "tanh", "ReLU": "relu"}
    if len(activations) > 1 or not activations <= known.keys():
        raise UnusableInput(f"expected layers with Tanh or with ReLU between them, got {sorted(activations)}")
    outputs = len(numbered(simulation.spec)) * simulation.window.joints
    if hasattr(policy, "quantile_net"):
        # The value of an action is the mean of its quantiles, which is a layer of fewer outputs.
        weights, bias = layers[-1]
        layers[-1] = weights.reshape(len(weights), -1, outputs).mean(axis=1), bias.reshape(-1, outputs).mean(axis=0)
    return ImportedPolicy(
        spec=simulation.spec,
        window=simulation.window,
        scaling=simulation.scaling,
        goal_range=simulation.goal_range,
        layers=tuple(layers),
        activation=known[activations.pop()] if activations else "tanh",
        settings=settings or TrainSettings(),
    )

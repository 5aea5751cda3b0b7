"""Agents of stable-baselines3 train on our simulation and become agents of ours; only where it is installed."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm import learning
from pneumarm.errors import UnusableInput
from pneumarm.gym import PointToPointVector, point_to_point

WANTED = "stable-baselines3, which brings torch, is not installed: pip install --editable '.[stable-baselines]'"
stable_baselines3 = pytest.importorskip("stable_baselines3", reason=WANTED)
sb3_contrib = pytest.importorskip("sb3_contrib", reason=WANTED)

from pneumarm.gym.stable_baselines import StableVector, imported  # noqa: E402 - needs what may be missing

SIMULATION = synthetic_simulation()
BEGIN = synthetic_begin_states(SIMULATION)


def vector(n: int = 8) -> StableVector:
    return StableVector(PointToPointVector(SIMULATION, BEGIN, n, autoreset_mode=AutoresetMode.SAME_STEP))


@pytest.mark.parametrize("kind", ["PPO", "A2C", "DQN", "QRDQN"])
def test_an_imported_agent_decides_as_its_model(kind: str) -> None:
    model_of = getattr(stable_baselines3, kind, None) or getattr(sb3_contrib, kind)
    model = model_of("MlpPolicy", vector(), seed=0, device="cpu")
    model.learn(600)
    policy = imported(model, SIMULATION)
    observations = np.random.default_rng(0).uniform(-1, 1, (300, 17)).astype(np.float32)
    expected, _ = model.predict(observations, deterministic=True)
    np.testing.assert_array_equal(policy.values(observations)[:, 0].argmax(axis=-1), expected)
    assert learning.test(policy, SIMULATION, BEGIN, 5).actions.sum() > 0


def test_a_single_environment_passes_their_checker() -> None:
    from stable_baselines3.common.env_checker import check_env

    check_env(point_to_point(SIMULATION, BEGIN))


def test_the_vector_tells_how_movements_ended() -> None:
    many = vector(4)
    many.seed(3)
    many.reset()
    kinds = set()
    for _ in range(250):
        observed, _, ended, infos = many.step(np.random.default_rng(1).integers(0, 9, 4))
        assert observed.shape == (4, 17)
        for over, info in zip(ended, infos, strict=True):
            assert over == bool(info)
            if over:
                kinds.add(info["is_success"])
                assert info["TimeLimit.truncated"] != info["is_success"]
                assert info["terminal_observation"].shape == (17,)
    assert False in kinds


def test_rewards_are_scaled_and_nothing_else_changes() -> None:
    def rewards(scale: float) -> np.ndarray:
        many = StableVector(PointToPointVector(SIMULATION, BEGIN, 3, autoreset_mode=AutoresetMode.SAME_STEP), scale)
        many.seed(1)
        many.reset()
        random = np.random.default_rng(0)
        return np.array([many.step(random.integers(0, 9, 3))[1] for _ in range(50)])

    np.testing.assert_allclose(rewards(0.5), 0.5 * rewards(1.0))
    with pytest.raises(UnusableInput, match="reward_scale"):
        rewards(0.0)


def test_what_cannot_be_imported_is_refused() -> None:
    with pytest.raises(UnusableInput, match="SAME_STEP"):
        StableVector(PointToPointVector(SIMULATION, BEGIN, 2))
    odd = stable_baselines3.PPO("MlpPolicy", vector(2), policy_kwargs={"activation_fn": _elu()}, device="cpu")
    with pytest.raises(UnusableInput, match="Tanh"):
        imported(odd, SIMULATION)


def _elu() -> type:
    import torch

    return torch.nn.ELU

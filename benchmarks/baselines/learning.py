"""How baselines learn: ours by our commands, those of other libraries through our Gymnasium environment."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pneumarm.learning import AnyAgent, LearnSettings, TrainSettings, test, train
from pneumarm.learning.online.settings import Team
from pneumarm.learning.planned.agent import PlanAgent
from pneumarm.simulation import Simulation
from pneumarm.task import BeginStates

PLANNING = "planning"
"""In the learned simulation: needs no training."""
OURS = ("policy", "batched", "sarsa")
TEAMS: dict[str, Team] = {"sarsa own": "own", "sarsa one": "one"}
"""The thesis' agents of several joints, each paid for its own joint, or one for all."""
STABLE = ("ppo", "dqn", "qr-dqn")
"""Of stable-baselines3 and sb3-contrib."""
QUANTILES = 25
"""Of QR-DQN; its loss takes their square, with the 200 that are usual some hours."""
EVALUATE_EVERY, EVALUATED = 50_000, 300
"""Steps between two points of a learning curve, and the movements of each."""


@dataclass(frozen=True)
class Learned:
    """An agent that has learned, what that took, and the curve it left: (steps, processor seconds, reward)."""

    agent: AnyAgent
    wall: float
    cpu: float
    curve: list[tuple[int, float, float]]


def learn(method: str, simulation: Simulation, begin: BeginStates, seed: int, steps: int) -> Learned:
    """Train an agent; everything is compiled before the clock runs."""
    if method == PLANNING:
        return Learned(PlanAgent(simulation), 0.0, 0.0, [])
    if method in (*OURS, *TEAMS):
        settings = settings_of(method)
        train(simulation, begin, shortened(settings), seed)
        return timed(lambda: train(simulation, begin, settings, seed).agent)
    return learn_stable(method, simulation, begin, seed, steps)


def settings_of(method: str) -> Any:
    """Return the settings that a method of ours trains with."""
    if method in TEAMS:
        return TrainSettings(team=TEAMS[method])
    return LearnSettings(method=method).chosen


def shortened(settings: Any) -> Any:
    """Return settings of the same training, hardly begun: it compiles all that the whole one needs."""
    if isinstance(settings, TrainSettings):
        return replace(settings, agents=1, max_episodes=100, validation_episodes=10)
    return replace(settings, agents=1, updates=1, validation_episodes=10)


def timed(work: Callable[[], AnyAgent]) -> Learned:
    wall, cpu = time.perf_counter(), time.process_time()
    agent = work()
    return Learned(agent, time.perf_counter() - wall, time.process_time() - cpu, [])


def learn_stable(method: str, simulation: Simulation, begin: BeginStates, seed: int, steps: int) -> Learned:
    """Train an agent of another library with the settings that were best on arms 1 and 2 of the distribution.

    PPO by the reward in the simulation after 450,000 steps, arm 1 and arm 2: 36.6 and 34.8 with these; 34.5 and 34.2
    with a constant learning rate of 3e-4, 35.1 with one that falls from there, 35.4 with 32 environments. With the
    rewards as they are, -50 instead of 33 after 100,000 steps (see StableVector). DQN on arm 1: 38.6. Of several
    joints goals are easier at first, as they are for our policy; without that PPO learns to switch no more, and 26 of
    1,000 movements succeed (two joints, arm 1).
    """
    import torch
    from gymnasium.vector import AutoresetMode
    from sb3_contrib import QRDQN
    from stable_baselines3 import DQN, PPO

    from benchmarks.baselines.easier import EasierFirst
    from pneumarm.gym.stable_baselines import StableVector, imported

    torch.set_num_threads(1)
    kind = {"ppo": PPO, "dqn": DQN, "qr-dqn": QRDQN}[method]
    many = EasierFirst(simulation, begin, 8, threads=1, autoreset_mode=AutoresetMode.SAME_STEP)
    vector = StableVector(many, 1 / 50)
    vector.reset()
    vector.step(np.zeros((8, simulation.window.joints), np.int64))  # compiles
    networks = {"net_arch": [64, 64], **({"n_quantiles": QUANTILES} if method == "qr-dqn" else {})}
    model = kind("MlpPolicy", vector, seed=seed, device="cpu", policy_kwargs=networks, **_STABLE[method])
    test(imported(model, simulation), simulation, begin, 1)
    curve: list[tuple[int, float, float]] = []
    aside = {"wall": 0.0, "cpu": 0.0}

    def evaluate(local: dict[str, Any], _: dict[str, Any]) -> bool:
        """Let goals be as easy as they are now; note the reward from time to time, while the clock stands still."""
        many.ease(model.num_timesteps / steps)
        if model.num_timesteps // EVALUATE_EVERY > len(curve):
            wall, cpu = time.perf_counter(), time.process_time()
            reward = test(imported(model, simulation), simulation, begin, EVALUATED).reward.mean()
            curve.append((model.num_timesteps, cpu - began - aside["cpu"], float(reward)))
            aside["wall"] += time.perf_counter() - wall
            aside["cpu"] += time.process_time() - cpu
        return True

    began = time.process_time()
    learned = timed(lambda: imported(model.learn(steps, callback=evaluate), simulation))
    vector.close()
    return replace(learned, wall=learned.wall - aside["wall"], cpu=learned.cpu - aside["cpu"], curve=curve)


def falling(share_left: float) -> float:
    """Return the learning rate where a share of the training is left."""
    return 1e-3 * share_left


_OFF_POLICY: dict[str, Any] = {
    "gamma": 0.98,
    "learning_rate": falling,
    "batch_size": 256,
    "buffer_size": 200_000,
    "learning_starts": 5_000,
    "train_freq": 4,
    "gradient_steps": 4,
    "target_update_interval": 2_000,
    "exploration_fraction": 0.3,
    "exploration_final_eps": 0.02,
}
_STABLE: dict[str, dict[str, Any]] = {
    "ppo": {"gamma": 0.98, "learning_rate": falling, "n_steps": 256, "batch_size": 256, "ent_coef": 0.01},
    "dqn": _OFF_POLICY,
    "qr-dqn": _OFF_POLICY,
}

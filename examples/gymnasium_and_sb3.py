"""Train an agent of stable-baselines3 in the simulation of first.py, and have pneumarm test it like its own.

Needs arm.db and arm.sim of first.py, and ``pip install 'pneumarm[stable-baselines]'``.
"""

import sys

try:
    import gymnasium
    from stable_baselines3 import PPO
except ImportError as error:
    sys.exit(f"{error}: pip install 'pneumarm[stable-baselines]'")

import pneumarm
import pneumarm.gym  # registers the environments
from pneumarm.gym.stable_baselines import imported
from pneumarm.simulation import Simulation

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
env = gymnasium.make("pneumarm/PointToPoint-v0", arm="simulation:arm.sim", transitions="arm.db")
model = PPO("MlpPolicy", env, device="cpu").learn(steps)
agent = imported(model, Simulation.load("arm.sim"))
print(pneumarm.test(agent, "arm.sim", "arm.db", episodes=500))

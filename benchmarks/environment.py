"""Steps a second of the Gymnasium environment over a simulation: single, and many at once.

python -m benchmarks environment

The simulation has the thesis' sizes (three networks of ten hidden units, a history of three) and random weights;
actions are random, and movements that end are begun anew within the time.
"""

from collections.abc import Iterator
from time import perf_counter

import gymnasium
import numpy as np

import pneumarm.gym
from pneumarm.arm import ArmSpec
from pneumarm.networks.network import Network
from pneumarm.simulation.simulation import Scaling, Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.transitions.window import Window

STEPS = 1_000_000
HIDDEN = 10
_MIDDLE = np.array([511.5, 0.0, 90.0, 90.0])
_SPREAD = np.array([400.0, 5.0, 90.0, 90.0])


def thesis_simulation() -> tuple[Simulation, BeginStates]:
    """Return a simulation of the thesis' sizes, and states to begin in."""
    window, random = Window(), np.random.default_rng(0)

    def network() -> Network:
        return Network(
            random.normal(0, 0.3, (window.input_size, HIDDEN)),
            random.normal(0, 0.3, HIDDEN),
            random.normal(0, 0.03, (HIDDEN, 1)),
            np.zeros(1),
            None,
        )

    simulation = Simulation(
        spec=ArmSpec(),
        window=window,
        scaling=Scaling(_MIDDLE, _SPREAD, np.ones(2)),
        networks=(network(), network(), network()),
        velocity="derived",
        error_std=np.array([[3.0, 0.09, 1.3, 1.3]]),
        goal_range=np.array([[150.0, 870.0]]),
        pressure_range=np.array([[[0.0, 190.0], [0.0, 190.0]]]),
    )
    states = np.zeros((500, window.state_size), np.float32)
    states[:, : 4 * window.history] = np.tile(random.uniform(-1, 1, (500, 4)) * [1, 0, 1, 1], (1, window.history))
    order = np.argsort(states[:, 0])
    angle = states[order, :1].astype(np.float64) * _SPREAD[0] + _MIDDLE[0]
    return simulation, BeginStates(window, states[order], angle)


def _single(env: gymnasium.Env, steps: int) -> float:  # type: ignore[type-arg]
    actions = np.random.default_rng(1).integers(0, 9, steps).tolist()
    env.reset(seed=0)
    began = perf_counter()
    for action in actions:
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()
    return steps / (perf_counter() - began)


def _vectorised(env: gymnasium.vector.VectorEnv, steps: int) -> float:  # type: ignore[type-arg]
    n = env.num_envs
    actions = np.random.default_rng(1).integers(0, 9, (16, n))
    env.reset(seed=0)
    env.step(actions[0])
    turns = max(steps // n, 16)
    began = perf_counter()
    for k in range(turns):
        env.step(actions[k % 16])
    rate = turns * n / (perf_counter() - began)
    env.close()
    return rate


def measure() -> Iterator[str]:
    """Yield lines with environment steps a second; the best of three."""
    name = pneumarm.gym.ENVIRONMENT
    simulation, begin = thesis_simulation()
    given = {"arm": simulation, "transitions": begin}
    env = gymnasium.make(name, **given, disable_env_checker=True)
    _single(env, 100)  # compiles, or loads what was compiled
    base = max(_single(env, STEPS // 5) for _ in range(3))
    yield f"single, through gymnasium.make: {base:,.0f} steps/s"
    for threads in (1, None):
        for n in (256, 1024, 4096, 16384):
            many = [gymnasium.make_vec(name, n, "vector_entry_point", **given, threads=threads) for _ in range(3)]
            rate = max(_vectorised(each, STEPS) for each in many)
            on = "one thread" if threads == 1 else "all cores"
            yield f"{n} at once on {on}: {rate:,.0f} steps/s, {rate / base:.1f} times single"

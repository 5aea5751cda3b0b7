"""How fast learning is: the compiled step beside plain NumPy and beside a loop fused by hand, and whole trainings.

One learning step is a step of the simulation (three 18-10-1 networks, correlated noise), nine 17-5-1 networks for the
action values, max-Boltzmann exploration and the update of one network. A C version of the networks and the update
alone runs 5.9 million of them a second on the core of the machine that the design was made on.
"""

import importlib.util
import math
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from pneumarm.arm import Reading
from pneumarm.control import AgentController
from pneumarm.kernels import kernel
from pneumarm.learning import TrainSettings, test, train
from pneumarm.learning.online.loop import loop_workspace, train_episode
from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.online.values import Networks, draw_networks, learner, pack, unpack
from pneumarm.random import normal, random_state, uniform
from pneumarm.task.environment import Environment, environment, episode

STEPS = 200_000
EPSILON, TEMPERATURE = 0.05, 1.0
C_STEPS = 5.9e6  # a second, measured for the design


def _synthetic() -> ModuleType:
    path = Path(__file__).parents[1] / "tests" / "learning" / "synthetic_arm.py"
    specification = importlib.util.spec_from_file_location("synthetic_arm", path)
    assert specification
    assert specification.loader
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@kernel(fastmath={"contract", "reassoc", "nsz", "arcp"})
def _fused(w_sim, v_sim, b_sim, limits, rate, noise, commands, x, w, random, steps):  # type: ignore[no-untyped-def]
    """Do what ``steps`` of one episode that never ends do, written out for one joint and a history of three."""
    hs, h, q = np.zeros(32, np.float32), np.zeros(48, np.float32), np.zeros(9, np.float32)
    odds, z, slope = np.zeros(9, np.float32), np.zeros(5, np.float32), np.zeros(5, np.float32)
    before, change, average = np.zeros(20, np.float32), np.zeros(3, np.float32), np.zeros(3, np.float32)
    for o in range(3):
        average[o] = normal(random)
    action, last, total = -1, -1, 0.0
    for k in range(steps + 1):
        if k > 0:
            for i in range(20):
                before[i] = x[i]
            total += -9.0 if last >= 0 and last != action else -1.0
            paid = -9.0 if last >= 0 and last != action else -1.0
            x[16], x[17] = commands[action, 0], commands[action, 1]
            _layer(w_sim, x, hs)
            for o in range(3):
                s = np.float32(0.0)
                for u in range(32):
                    s += hs[u] * v_sim[o, u]
                change[o] = s + b_sim[o]
            x[16] = x[17] = np.float32(0.0)
            share = noise[3] + noise[4] * max(abs(noise[5] * change[0]) - noise[6], np.float32(0.0))
            share = min(share, np.float32(1.0))
            for o in range(3):
                average[o] = 0.8 * average[o] + 0.6 * normal(random)
                change[o] += share * noise[o] * average[o]
            for i in range(11, 3, -1):
                x[i] = x[i - 4]
            x[14], x[15], x[12], x[13] = x[12], x[13], commands[action, 0], commands[action, 1]
            for o in range(3):
                place = 0 if o == 0 else o + 1
                x[place] = min(max(x[place] + change[o], limits[0, o]), limits[1, o])
            x[1] = (x[0] - x[4]) * rate[0] + rate[1]
        _layer(w, x, h)
        for u in range(48):
            h[u] *= w[20, u]
        for a in range(9):
            q[a] = w[21, a]
        for j in range(5):
            for a in range(9):
                q[a] += h[9 * j + a]
        best = 0
        for a in range(9):
            q[a] *= np.float32(50.0)
            if q[a] > q[best]:
                best = a
        chosen = best
        if uniform(random) < EPSILON:
            second, odd = -math.inf, np.float32(0.0)
            for a in range(9):
                odds[a] = np.float32(-math.inf) if a == best else q[a]
                second = max(second, odds[a])
            for a in range(9):
                odds[a] = math.exp((odds[a] - np.float32(second)) * np.float32(1.0 / TEMPERATURE))
                odd += odds[a]
            left = np.float32(uniform(random)) * odd
            for a in range(9):
                if a != best:
                    chosen = a
                    left -= odds[a]
                    if left < 0.0:
                        break
        if k > 0:
            for j in range(5):
                s = np.float32(0.0)
                for i in range(20):
                    s += before[i] * w[i, 9 * j + action]
                z[j] = s
            _tansig(z)
            y = w[21, action]
            for j in range(5):
                y += z[j] * w[20, 9 * j + action]
                slope[j] = w[20, 9 * j + action] * (np.float32(1.0) - z[j] * z[j])
            factor = np.float32(0.05 * (paid + 0.98 * float(q[chosen]) - y * np.float32(50.0)) / 50.0)
            for j in range(5):
                by = factor * slope[j]
                for i in range(20):
                    w[i, 9 * j + action] += by * before[i]
                w[20, 9 * j + action] += factor * z[j]
            w[21, action] += factor
        last, action = action, chosen
    return total


@kernel(fastmath={"contract", "reassoc", "nsz", "arcp"}, forceinline=True, _nrt=False)
def _layer(w, x, h):  # type: ignore[no-untyped-def]
    for u in range(h.shape[0]):
        h[u] = np.float32(0.0)
    for first in range(0, x.shape[0], 4):
        i, j, k, m = np.uint64(first), np.uint64(first + 1), np.uint64(first + 2), np.uint64(first + 3)
        for u in range(h.shape[0]):
            h[u] += (x[i] * w[i, u] + x[j] * w[j, u]) + (x[k] * w[k, u] + x[m] * w[m, u])
    _tansig(h)


@kernel(fastmath={"contract", "reassoc", "nsz", "arcp"}, forceinline=True, _nrt=False)
def _tansig(h):  # type: ignore[no-untyped-def]
    for u in range(h.shape[0]):
        v = min(max(h[u], np.float32(-6.29701)), np.float32(6.29701))
        s = v * v
        a = np.float32(135135) + s * (np.float32(990) + s)
        b = np.float32(945945) + s * (np.float32(13860) + s * np.float32(45))
        a = np.float32(34459425) + s * (np.float32(4729725) + s * a)
        b = np.float32(34459425) + s * (np.float32(16216200) + s * b)
        h[u] = v * a / b


def _numpy_steps(simulation: Any, env: Environment, weights: Any, steps: int) -> None:
    """Do ``steps`` of learning as one writes them in NumPy."""
    random, networks = np.random.default_rng(0), unpack(weights, simulation.window, 5)
    w1, b1, w2, b2 = (array[0].astype(np.float64) for array in networks)
    noise, average = env.noise, np.zeros(3)
    lowest, highest = env.simulation.lowest, env.simulation.highest
    sigma, goal = np.zeros(16), np.array([5.0])

    def values(x: Any) -> Any:
        hidden = np.tanh(np.einsum("i,aih->ah", x, w1) + b1)
        return 50 * ((hidden * w2).sum(axis=1) + b2), hidden

    x = np.concatenate([sigma, goal])
    q, hidden = values(x)
    action, last = int(q.argmax()), -1
    for _ in range(steps):
        command = env.task.commands[0, action]
        inputs = np.concatenate([sigma, command])[None]
        change = np.array([network(inputs)[0, 0] for network in simulation.networks])
        average = 0.8 * average + 0.6 * random.standard_normal(3)
        speed = abs(noise.speed[0, 0] * change[0])
        change += min(noise.ramp[0] + noise.ramp[2] * max(speed - noise.ramp[1], 0), 1) * noise.std * average
        new = sigma[:4].copy()
        new[[0, 2, 3]] = np.clip(new[[0, 2, 3]] + change, lowest, highest)
        new[1] = (new[0] - sigma[0]) * env.simulation.velocity[0, 0]
        sigma = np.concatenate([new, sigma[:8], command, sigma[12:14]])
        x_next = np.concatenate([sigma, goal])
        q_next, hidden_next = values(x_next)
        chosen = int(q_next.argmax())
        if random.random() < EPSILON:
            odds = np.exp((q_next - q_next.max()) / TEMPERATURE)
            odds[chosen] = 0
            chosen = int(random.choice(9, p=odds / odds.sum()))
        reward = -9 if last >= 0 and last != action else -1
        delta = 0.05 * (reward + 0.98 * q_next[chosen] - q[action]) / 50
        slope = w2[action] * (1 - hidden[action] ** 2)
        w2[action] += delta * hidden[action]
        b2[action] += delta
        w1[action] += delta * np.outer(x, slope)
        b1[action] += delta * slope
        x, q, hidden, last, action = x_next, q_next, hidden_next, action, chosen


def _by_unit(networks: Networks) -> np.ndarray:
    """Return nine networks of five units for :func:`_fused`: unit h of action a in column 9 h + a, shape (22, 48)."""
    w1, b1, w2, b2 = (array[0] for array in networks)
    weights = np.zeros((22, 48), np.float32)
    weights[:16, :45] = w1[:, :16].transpose(1, 2, 0).reshape(16, 45)
    weights[18, :45], weights[19, :45] = w1[:, 16].T.ravel(), b1.T.ravel()
    weights[20, :45], weights[21, :9] = w2.T.ravel(), b2
    return weights


def _best(run: Any, repeats: int = 5) -> float:
    """Return the shortest processor time of ``run`` [s]."""
    times = []
    for _ in range(repeats):
        began = time.thread_time()
        run()
        times.append(time.thread_time() - began)
    return min(times)


def measure() -> Iterator[str]:
    synthetic = _synthetic()
    simulation = synthetic.synthetic_simulation()
    states = synthetic.synthetic_begin_states(simulation)
    settings = TrainSettings(cutoff=STEPS)
    env = environment(simulation, states, settings)
    endless = env._replace(task=env.task._replace(goal_range=np.array([[5000.0, 5000.0]])))
    start = pack(draw_networks(simulation.window, settings, np.random.default_rng(0)), simulation.window)
    schedule = Schedule(np.inf, EPSILON, TEMPERATURE, 0.002)

    def composed(steps: int = STEPS) -> Any:
        weights, one = start.copy(), episode(endless, random_state(1))
        task, learns = endless.task._replace(cutoff=steps), learner(weights, settings)
        outcome = train_episode(
            endless._replace(task=task), learns, schedule, one, loop_workspace(learns, one.goal.size)
        )
        return weights, outcome[1]

    one = episode(endless, random_state(1))
    sigma = env.begin.states
    noise = np.array([*env.noise.std, env.noise.ramp[0], env.noise.ramp[2], env.noise.speed[0, 0], env.noise.ramp[1]])

    def fused(steps: int = STEPS) -> Any:
        weights, random = _by_unit(unpack(start, simulation.window, 5)), random_state(1)
        x = one.state.x.copy()
        uniform(random)  # the goal
        x[:16] = sigma[int(uniform(random) * len(sigma))]
        x[18], x[19] = (5000.0 - env.task.unit[0, 0]) / env.task.unit[0, 1], 1
        total = _fused(
            env.simulation.hidden, env.simulation.output, env.simulation.output_bias,
            np.stack([env.simulation.lowest, env.simulation.highest]), env.simulation.velocity[0],
            noise.astype(np.float32), env.task.commands[0], x, weights, random, steps,
        )  # fmt: skip
        return weights, total

    (composed_weights, composed_total), (fused_weights, fused_total) = composed(200), fused(200)
    assert composed_total == fused_total
    expected = _by_unit(unpack(composed_weights, simulation.window, 5))
    np.testing.assert_allclose(fused_weights, expected, atol=1e-3)

    # In turns, so that what else the machine does bears on both.
    seconds = np.array([[_best(composed, 1), _best(fused, 1)] for _ in range(15)]).min(axis=0)
    rates = STEPS / seconds
    cost = 100 * (rates[1] / rates[0] - 1)
    yield f"learning steps, compiled: {rates[0] / 1e6:.2f} M/s a core, {rates[0] / C_STEPS:.2f} of the C version"
    yield f"learning steps, fused by hand: {rates[1] / 1e6:.2f} M/s; composing costs {cost:+.1f} %"
    plain = 2_000 / _best(lambda: _numpy_steps(simulation, env, start, 2_000), 3)
    yield f"learning steps, plain NumPy: {plain / 1e3:.1f} k/s; compiled is {rates[0] / plain:.0f} times as fast"

    trained = train(simulation, states, TrainSettings(), seed=1)
    results = trained.results()
    tested = _best(lambda: test(trained.agent, simulation, states, 10_000), 3)
    agents = trained.steps.size
    yield (
        f"training of {agents} agents: {results['episodes']} episodes, {results['steps'] / 1e6:.1f} M steps, "
        f"{results['steps_per_second_per_core'] / 1e6:.2f} M steps/s a core; an agent takes "
        f"{trained.core_seconds / agents:.2f} s of a core, its test of 10,000 movements {tested:.2f} s"
    )
    yield _decisions(trained.agent)


def _decisions(agent: Any) -> str:
    """Time decisions from a reading to valves, as a controller on an arm makes them."""
    controller, random = AgentController(agent), np.random.default_rng(0)
    controller.reset(np.array([500.0]))
    times = np.empty(5_000)
    for k in range(len(times)):
        reading = Reading(k / 30, random.uniform(400, 600, 1), random.uniform(0, 100, (1, 2)))
        began = time.perf_counter()
        controller.act(reading)
        times[k] = time.perf_counter() - began
    half, most = np.percentile(1e6 * times[100:], (50, 99))
    return f"a decision from reading to valves: {half:.0f} us, 99 % within {most:.0f} us"

"""The training phase: many agents at once from different weights, of which the best is kept (sections 5.2, 5.4.2).

Every agent has its own weights, random numbers and shaping, so the result is the same however many threads there
are. Between two adjustments of the deviation an agent's whole state is a few arrays; a checkpoint keeps them, and a
killed training goes on bit for bit. No episode is running then, so the state window, the noise and the traces, all
set at the start of every episode, need not be kept.
"""

import hashlib
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.learning.online.agent import Agent
from pneumarm.learning.online.loop import train_episodes, workspace
from pneumarm.learning.online.settings import TrainSettings
from pneumarm.learning.online.shaping import adjusted, initial_deviation, stage
from pneumarm.learning.online.testing import run_test
from pneumarm.learning.online.values import draw_networks, learner, pack, unpack
from pneumarm.random import random_state
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import Environment, environment, episode
from pneumarm.task.movements import Movements

_WEIGHTS, _TRAINING, _VALIDATION = 0, 1, 2  # streams of random numbers
_CHECKPOINT = "pneumarm training"
_CHECKPOINT_EVERY = 2.0  # s
_CACHE_LINE = 128  # bytes; processors that fetch lines in pairs need two of 64
_CHUNK_WITHOUT_SHAPING = 500  # episodes
CURVES = ("episodes", "deviation", "criterion", "performance", "epsilon", "temperature")
"""Columns of the training curves."""


class Progress(NamedTuple):
    """What a caller is told after every round of 500 episodes an agent."""

    finished: int
    """Agents that have ended their training."""
    agents: int
    episodes: int
    """Of all agents together."""
    share: float
    """How far training is, 0 to 1, by the mean of the logarithms of the deviations."""


@dataclass(frozen=True)
class Training:
    """A training phase: its best agent and all that it took."""

    agent: Agent
    best: int
    """Index of the best agent, by mean reward in its validation."""
    validation: tuple[Movements, ...]
    """Validation of every agent, with seeds of its own."""
    curves: tuple[NDArray[np.float64], ...]
    """By agent a row every 500 episodes, columns as in ``CURVES``; the deviation [counts] as it was until then."""
    met: NDArray[np.bool_]
    """Which agents met the criterion at the whole deviation; the others ended at ``max_episodes``; (agents,)."""
    episodes: NDArray[np.int64]
    """Training episodes by agent, shape (agents,)."""
    steps: NDArray[np.int64]
    """Learning steps by agent, shape (agents,)."""
    seconds: float
    """Wall time of training and validation [s], without compiling."""
    core_seconds: float
    """Processor time of the learning steps, all threads together [s], without compiling and validation."""

    def results(self) -> dict[str, Any]:
        """Return what ``train --json`` says."""
        steps = int(self.steps.sum())
        return {
            "episodes": int(self.episodes.sum()),
            "steps": steps,
            "seconds": self.seconds,
            "steps_per_second": steps / max(self.seconds, 1e-9),
            "steps_per_second_per_core": steps / max(self.core_seconds, 1e-9),
            "best": self.best,
            "met": [bool(met) for met in self.met],
            "validation": [result.results() for result in self.validation],
        }


@dataclass
class _Agents:
    """The state of all agents between two chunks of episodes, arrays by agent."""

    weights: NDArray[np.float32]
    random: NDArray[np.uint64]
    deviation: NDArray[np.float64]
    performance: NDArray[np.float64]
    episodes: NDArray[np.int64]
    steps: NDArray[np.int64]
    met: NDArray[np.bool_]
    curves: NDArray[np.float64]
    """Shape (rows so far of the agent that has most, agents, columns); rows of an agent that has ended are 0."""
    seconds: NDArray[np.float64]
    """Wall and processor time spent, shape (2,)."""


def train(
    simulation: Simulation,
    begin_states: BeginStates,
    settings: TrainSettings | None = None,
    seed: int = 0,
    *,
    progress: Callable[[Progress], None] | None = None,
    checkpoint: Path | None = None,
    threads: int | None = None,
) -> Training:
    """Train ``settings.agents`` agents in ``simulation`` and return the best, with what it took.

    Training of an agent ends when its deviation is the whole range of angles and its performance meets the
    criterion (section 5.2), or after ``settings.max_episodes`` (difference from the thesis, where some seed might
    train for ever); where ``settings.stops`` is false, only then. The same seed gives the same agents, bit for bit,
    with any number of ``threads`` (default: one a core). With a ``checkpoint`` a killed training goes on from there;
    the file is left when training is done.

    Raises:
        UnusableInput: begin states and simulation do not fit, or the checkpoint is of another training.

    """
    settings = settings or TrainSettings()
    env = environment(simulation, begin_states, settings)
    identity = _identity(env, settings, seed)
    agents = None
    if checkpoint is not None and checkpoint.exists():
        agents = _read_checkpoint(checkpoint, identity, simulation, settings)
    if agents is None:
        agents = _fresh(simulation, settings, seed)
    _compile(env, agents, settings, simulation)

    began, before = time.perf_counter(), agents.seconds[0]
    saved = began
    with ThreadPoolExecutor(min(threads or cores(), settings.agents)) as pool:
        while (running := np.flatnonzero(~_ended(agents, settings))).size:
            done = list(pool.map(lambda a: _chunk(env, agents, settings, simulation, int(a)), running))
            row = np.zeros((1, settings.agents, len(CURVES)))
            row[0, running] = [curve for curve, _ in done]
            agents.curves = np.concatenate([agents.curves, row])
            agents.seconds[1] += sum(spent for _, spent in done)
            now = time.perf_counter()
            agents.seconds[0] = before + now - began
            if checkpoint is not None and now - saved > _CHECKPOINT_EVERY:
                _write_checkpoint(checkpoint, identity, agents)
                saved = time.perf_counter()
            if progress is not None:
                progress(_progress(agents, settings, simulation))
        validation = tuple(pool.map(lambda a: _validate(env, agents, settings, seed, a), range(settings.agents)))
    agents.seconds[0] = before + time.perf_counter() - began
    if checkpoint is not None:
        _write_checkpoint(checkpoint, identity, agents)
    best = int(np.argmax([result.reward.mean() for result in validation]))
    return Training(
        agent=Agent(
            spec=simulation.spec,
            window=simulation.window,
            scaling=simulation.scaling,
            goal_range=simulation.goal_range,
            networks=unpack(agents.weights[best], simulation.window, settings.hidden),
            settings=settings,
        ),
        best=best,
        validation=validation,
        curves=tuple(curve[curve[:, 0] > 0] for curve in agents.curves.transpose(1, 0, 2)),
        met=agents.met,
        episodes=agents.episodes,
        steps=agents.steps,
        seconds=float(agents.seconds[0]),
        core_seconds=float(agents.seconds[1]),
    )


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _fresh(simulation: Simulation, settings: TrainSettings, seed: int) -> _Agents:
    n = settings.agents
    draws = [np.random.default_rng([seed, _WEIGHTS, a]) for a in range(n)]
    return _Agents(
        weights=np.stack([pack(draw_networks(simulation.window, settings, d), simulation.window) for d in draws]),
        random=np.stack([random_state((seed, _TRAINING, a)) for a in range(n)]),
        deviation=np.full(n, initial_deviation(settings, simulation.spec)),
        performance=np.zeros(n),
        episodes=np.zeros(n, np.int64),
        steps=np.zeros(n, np.int64),
        met=np.zeros(n, bool),
        curves=np.zeros((0, n, len(CURVES))),
        seconds=np.zeros(2),
    )


def _ended(agents: _Agents, settings: TrainSettings) -> NDArray[np.bool_]:
    return (agents.met & settings.stops) | (agents.episodes >= settings.max_episodes)


def _chunk(
    env: Environment, agents: _Agents, settings: TrainSettings, simulation: Simulation, a: int
) -> tuple[list[float], float]:
    """Train agent ``a`` until its deviation is adjusted; return its row of the curves and the processor time."""
    now = stage(agents.deviation[a], settings, simulation.spec)
    most = settings.shaping.episodes if settings.shaping else _CHUNK_WITHOUT_SHAPING
    count = min(most, settings.max_episodes - int(agents.episodes[a]))
    # What threads write must not lie on a cache line together, or each slows the other down.
    one = _apart(episode(env, agents.random[a]))
    worker = _apart(learner(agents.weights[a], settings))
    remembered = _apart(workspace(one))
    began = time.thread_time()
    performance, steps, count = train_episodes(
        env, worker, now.schedule, one, remembered, count, float(agents.performance[a])
    )
    spent = time.thread_time() - began
    agents.random[a], agents.weights[a] = one.state.random, worker.weights
    agents.performance[a] = performance
    agents.episodes[a] += count
    agents.steps[a] += steps
    agents.met[a] |= now.whole and performance >= now.criterion
    row = [agents.episodes[a], agents.deviation[a], now.criterion, performance, *now.schedule[1:3]]
    agents.deviation[a] = adjusted(agents.deviation[a], performance, settings, simulation.spec)
    return row, spent


def _apart(value: Any) -> Any:
    """Return a copy of ``value``, an array or named tuples of them, each with a cache line of nothing around it."""
    if isinstance(value, tuple):
        return type(value)(*(_apart(part) for part in value))
    if not isinstance(value, np.ndarray):
        return value
    line = _CACHE_LINE // value.itemsize
    spacious = np.zeros(value.size + 2 * line, value.dtype)
    copy = spacious[line : line + value.size].reshape(value.shape)
    copy[...] = value
    return copy


def _validate(env: Environment, agents: _Agents, settings: TrainSettings, seed: int, a: int) -> Movements:
    return run_test(env, agents.weights[a], settings, settings.validation_episodes, (seed, _VALIDATION))


def _compile(env: Environment, agents: _Agents, settings: TrainSettings, simulation: Simulation) -> None:
    """Run the kernels on copies, so that compiling them is not counted as training."""
    one = episode(env, agents.random[0].copy())
    weights = agents.weights[0].copy()
    schedule = stage(agents.deviation[0], settings, simulation.spec).schedule
    train_episodes(env, learner(weights, settings), schedule, one, workspace(one), 0, 0.0)
    run_test(env, weights, settings, 1, (0,))


def _progress(agents: _Agents, settings: TrainSettings, simulation: Simulation) -> Progress:
    low, high = simulation.spec.angle_range
    first = initial_deviation(settings, simulation.spec)
    ended = _ended(agents, settings)
    shares = agents.episodes / settings.max_episodes
    if first < high - low:
        shares = np.maximum(shares, 0.95 * np.log(agents.deviation / first) / np.log((high - low) / first))
    return Progress(
        int(ended.sum()), len(ended), int(agents.episodes.sum()), float(np.where(ended, 1.0, shares).mean())
    )


def _identity(env: Environment, settings: TrainSettings, seed: int) -> dict[str, Any]:
    """Return what a checkpoint must agree on: the settings, the seed, the simulation and the begin states."""
    digest = hashlib.sha256()
    for part in env:
        for value in part:
            digest.update(np.ascontiguousarray(value).tobytes())
    return {"settings": msgspec.to_builtins(settings), "seed": seed, "environment": digest.hexdigest()}


def _write_checkpoint(path: Path, identity: dict[str, Any], agents: _Agents) -> None:
    write_arrays(path, _CHECKPOINT, identity, vars(agents))


def _read_checkpoint(
    path: Path, identity: dict[str, Any], simulation: Simulation, settings: TrainSettings
) -> _Agents:
    found, arrays = read_arrays(path, _CHECKPOINT)
    if found != msgspec.json.decode(msgspec.json.encode(identity)):
        raise UnusableInput(
            f"{path}: the checkpoint of another training; remove it, or train with its settings and seed"
        )
    expected = vars(_fresh(simulation, settings, 0))
    for name, like in expected.items():
        array = arrays.get(name)
        first = 1 if name == "curves" else 0  # there are as many rows of curves as there were rounds
        fits = array is not None and array.dtype == like.dtype and array.ndim == like.ndim
        if array is None or not fits or array.shape[first:] != like.shape[first:]:
            raise UnusableInput(f"{path}: a damaged checkpoint ({name}); remove it")
    return _Agents(**{name: arrays[name].copy() for name in expected})

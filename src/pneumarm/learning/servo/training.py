"""Training servos: several at once from different weights, of which the best is kept."""

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.learning.online.training import Progress, cores
from pneumarm.learning.servo.agent import ServoAgent, servo_sizes, servo_task
from pneumarm.learning.servo.gradient import ServoTask, errors_of, learn_once, tape
from pneumarm.learning.servo.references import draw_references
from pneumarm.learning.servo.settings import ServoSettings
from pneumarm.networks.layers import adam, initial_weights, trainable
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates

_WEIGHTS, _MOVEMENTS, _VALIDATION = 0, 1, 2  # streams of random numbers
_CHUNK = 25  # updates between two rows of the curves
_FIRST_OUTPUT = 1.0
_RENEWED = 0.5  # share of arms that begin anew at rest; the others go on from where they are
_FREE = 0.6  # share of the updates in which the price of changes rises to what it is
_FASTEST = 4.0  # highest speed of a reference, in scaled velocities
SERVO_CURVES = ("updates", "price", "settled")
"""Columns of the training curves: updates so far, mean price of a step, share of the last third within tolerance."""


@dataclass(frozen=True)
class ServoTraining:
    """A training of servos: its best agent and all that it took."""

    agent: ServoAgent
    best: int
    """Index of the best agent, by mean price in its validation."""
    validation: tuple[dict[str, float], ...]
    """Price and share settled of every agent, the same movements for all."""
    curves: NDArray[np.float64]
    """Columns as in ``SERVO_CURVES``, shape (agents, rows, columns)."""
    episodes: int
    """Movements of all agents together."""
    steps: int
    """Steps of all simulated arms of all agents together."""
    seconds: float
    """Wall time of training and validation [s], without compiling."""
    core_seconds: float
    """Processor time of learning, all threads together [s], without compiling and validation."""

    def results(self) -> dict[str, Any]:
        """Return what ``train --json`` says."""
        return {
            "episodes": self.episodes,
            "steps": self.steps,
            "seconds": self.seconds,
            "steps_per_second": self.steps / max(self.seconds, 1e-9),
            "steps_per_second_per_core": self.steps / max(self.core_seconds, 1e-9),
            "best": self.best,
            "validation": list(self.validation),
        }


class ServoLearner:
    """One servo that learns, with its simulated arms and random numbers."""

    def __init__(self, simulation: Simulation, begin: BeginStates, settings: ServoSettings, seed: int, number: int):
        self.simulation, self.settings, self._begin, self._seed = simulation, settings, begin, seed
        self.task = servo_task(simulation, settings)
        sizes = servo_sizes(simulation, settings)
        weights = initial_weights(sizes, _FIRST_OUTPUT, np.random.default_rng([seed, _WEIGHTS, number]))
        self.net = trainable(weights, sizes, settings.arms)
        self._steps = max(round(settings.duration / simulation.spec.period), 2)
        self._tape = tape(self.task, self._steps, settings.arms)
        self._random = np.random.default_rng([seed, _MOVEMENTS, number])
        self.updates = 0
        self.curve = np.zeros((0, len(SERVO_CURVES)))
        self.seconds = 0.0
        self._draw_states(self._random, np.ones(settings.arms, bool))

    def learn_until(self, updates: int) -> None:
        """Move and learn until there have been so many ``updates``, and add a row to the curve."""
        began, price, wanted = time.thread_time(), 0.0, self.settings
        updates -= self.updates
        for _ in range(updates):
            self._prepare(self._random)
            price += learn_once(self._task_now(), self.net, self._tape)
            rate = wanted.learning_rate * (1 - self.updates / wanted.updates)
            self.updates += 1
            adam(self.net, rate, wanted.largest_gradient, self.updates)
        self.seconds += time.thread_time() - began
        row = [self.updates, price / updates, self._settled()]
        self.curve = np.concatenate([self.curve, [row]])

    def validate(self, movements: int) -> dict[str, float]:
        """Return price and share settled of movements that are the same for all learners."""
        random, prices, settled = np.random.default_rng([self._seed, _VALIDATION]), [], []
        for _ in range(-(-movements // self.settings.arms)):
            self._draw_states(random, np.ones(self.settings.arms, bool))
            self._prepare(random)
            gradient = self.net.gradient.copy()
            prices.append(learn_once(self.task, self.net, self._tape))
            self.net.gradient[:] = gradient
            settled.append(self._settled())
        return {"price": float(np.mean(prices)), "settled": float(np.mean(settled))}

    def _task_now(self) -> ServoTask:
        """Return the task with the price of changes of this update: who pays for them first never learns to move."""
        paid = min(self.updates / (_FREE * self.settings.updates), 1.0) * self.settings.change
        return self.task._replace(prices=self.task.prices._replace(change=paid))

    def agent(self) -> ServoAgent:
        """Return the servo as it is now."""
        return ServoAgent(self.simulation, self.net.flat.copy(), self.settings)

    def _settled(self) -> float:
        late = errors_of(self.task, self._tape)[-self._steps // 3 :]
        return float((np.abs(late) <= 1).mean())

    def _draw_states(self, random: np.random.Generator, renewed: NDArray[np.bool_]) -> None:
        chosen = self._begin.states[random.integers(len(self._begin), size=int(renewed.sum()))]
        x = self._tape.x[0]
        x[: chosen.shape[1], renewed] = chosen.T
        x[self._one] = 1

    @property
    def _one(self) -> int:
        window = self.simulation.window
        return window.input_size + window.joints

    def _prepare(self, random: np.random.Generator) -> None:
        """Put states, noise, references and previews of the next movements on the tape."""
        tape, wanted, simulation = self._tape, self.settings, self.simulation
        window, scaling, joints = simulation.window, simulation.scaling, simulation.window.joints
        n, size = wanted.arms, window.state_size
        if self.updates:
            tape.x[0, :size] = tape.x[-1, :size]
        self._draw_states(random, random.random(n) < _RENEWED)
        offset, scale = window.of_joints(scaling.observation_offset), window.of_joints(scaling.observation_scale)
        noise = wanted.reading_noise * simulation.error_std[:, [0, 2, 3]] / scale[:, [0, 2, 3]]
        tape.noise[...] = random.standard_normal(tape.noise.shape, np.float32) * noise.reshape(-1, 1)
        angle = tape.x[0, 0 : 4 * joints : 4] * scale[:, :1] + offset[:, :1]
        ahead = self.task.inputs.steps
        fastest = _FASTEST * 1e3 * scale[:, 1]
        length = self._steps + 1 + int(ahead.max())
        drawn = draw_references(random, simulation.goal_range, angle, length, simulation.spec, fastest)
        reference = ((drawn - offset[:, :1]) / scale[:, :1]).astype(np.float32)
        tape.reference[...] = reference[: self._steps + 1]
        steps = np.arange(self._steps)
        slope = np.diff(reference[: self._steps], axis=0, prepend=reference[:1])
        line = reference[: self._steps, None] + ahead[:, None, None] * slope[:, None]
        known = random.random(n) < wanted.known
        tape.preview[...] = np.where(known, reference[steps[:, None] + ahead], line)


def train_servo(
    simulation: Simulation,
    begin_states: BeginStates,
    settings: ServoSettings | None = None,
    seed: int = 0,
    *,
    progress: Callable[[Progress], None] | None = None,
    checkpoint: Path | None = None,
    threads: int | None = None,
) -> ServoTraining:
    """Train ``settings.agents`` servos in ``simulation`` and return the best.

    The same seed gives the same agents, bit for bit, with any number of ``threads`` (default: one a core). Training
    takes seconds, so a ``checkpoint`` is not needed and not written: a killed one begins anew.
    """
    settings = settings or ServoSettings()
    compiled = ServoLearner(simulation, begin_states, settings, seed, 0)
    compiled.learn_until(1)  # on a learner that is thrown away, so that compiling is not counted as training
    learners = [ServoLearner(simulation, begin_states, settings, seed, a) for a in range(settings.agents)]
    began, done = time.perf_counter(), 0
    with ThreadPoolExecutor(min(threads or cores(), settings.agents)) as pool:
        while done < settings.updates:
            done = min(done + _CHUNK, settings.updates)
            list(pool.map(ServoLearner.learn_until, learners, [done] * len(learners)))
            if progress is not None:
                share, ended = done / settings.updates, settings.agents if done == settings.updates else 0
                progress(Progress(ended, settings.agents, done * settings.arms * settings.agents, share))
        validation = tuple(pool.map(lambda one: one.validate(settings.validation_movements), learners))
    best = int(np.argmin([one["price"] for one in validation]))
    movements = settings.updates * settings.arms * settings.agents
    return ServoTraining(
        agent=learners[best].agent(),
        best=best,
        validation=validation,
        curves=np.stack([one.curve for one in learners]),
        episodes=movements,
        steps=movements * learners[0]._steps,
        seconds=time.perf_counter() - began,
        core_seconds=sum(one.seconds for one in learners),
    )


__all__ = ["SERVO_CURVES", "ServoLearner", "ServoTraining", "train_servo"]

"""Training several learners at once, each with weights, arms and random numbers of its own, and keeping the best.

All that a learner's future depends on is in its arrays, so the result is the same however many threads there are,
and a killed training goes on bit for bit from a checkpoint of them.
"""

import hashlib
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.learning.online.training import Progress, cores
from pneumarm.networks.layers import Trainable
from pneumarm.task.environment import Environment
from pneumarm.task.fleet import Fleet
from pneumarm.task.movements import Movements

_CHECKPOINT = "pneumarm fleet training"
_CHECKPOINT_EVERY = 2.0  # s
_CHUNK = 10  # updates between two rows of the curves
_NETWORK = ("flat", "mean", "square")
_FLEET = ("x", "average", "random", "goal", "actions", "still", "taken")

FLEET_CURVES = ("episodes", "reward", "success")
"""Columns of the training curves: episodes so far, then their mean reward and share of successes since the row
before, exploring."""


class Learner(ABC):
    """One learner with its simulated arms."""

    networks: ClassVar[tuple[str, ...]]
    """Names of the attributes that are networks."""

    def __init__(self, fleet: Fleet, random: NDArray[np.uint64]) -> None:
        self.fleet = fleet
        self.random = random
        self.counts = np.zeros(3, np.int64)
        """Batches learned from, updates by Adam, episodes."""
        self.curve = np.zeros((0, len(FLEET_CURVES)))
        self.seconds = np.zeros(1)
        """Processor time of collecting and learning."""

    @abstractmethod
    def update(self) -> tuple[int, int, float]:
        """Collect and learn once; return the episodes that ended, the successes and the sum of rewards."""

    @abstractmethod
    def validate(self, episodes: int) -> Movements:
        """Return ``episodes`` greedy movements, the same begin states and goals for all learners."""

    def learn(self, updates: int) -> None:
        """Collect and learn so many times, and add a row to the curves."""
        began, seen = time.thread_time(), np.zeros(3)
        for _ in range(updates):
            seen += self.update()
            self.counts[0] += 1
        self.counts[2] += int(seen[0])
        each = max(seen[0], 1.0)
        self.curve = np.concatenate([self.curve, [[self.counts[2], seen[2] / each, seen[1] / each]]])
        self.seconds += time.thread_time() - began

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all that its future depends on, by name."""
        found = {name: getattr(self, name) for name in ("random", "counts", "curve", "seconds")}
        for part in self.networks:
            network: Trainable = getattr(self, part)
            found |= {f"{part}.{name}": getattr(network, name) for name in _NETWORK}
        return found | {f"fleet.{name}": getattr(self.fleet, name) for name in _FLEET}

    def restore(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Take up arrays of :meth:`arrays`.

        Raises:
            ValueError: they are of another learner.

        """
        for name, array in self.arrays().items():
            saved = arrays[name]
            if saved.dtype != array.dtype or saved.shape[name == "curve" :] != array.shape[name == "curve" :]:
                raise ValueError(name)
            if name == "curve":
                self.curve = saved.copy()
            else:
                array[...] = saved


class Trained(NamedTuple):
    """What came of a training."""

    best: int
    """Index of the best learner, by mean reward in its validation."""
    validation: tuple[Movements, ...]
    seconds: float
    """Wall time with validation [s]."""


def train_side_by_side(
    learners: Sequence[Learner],
    updates: int,
    validation_episodes: int,
    identity: dict[str, Any],
    *,
    progress: Callable[[Progress], None] | None = None,
    checkpoint: Path | None = None,
    threads: int | None = None,
) -> Trained:
    """Let all learners learn from so many batches, then validate them.

    Raises:
        UnusableInput: the ``checkpoint`` is not of a training of this ``identity``.

    """
    before = 0.0
    if checkpoint is not None and checkpoint.exists():
        before = _read_checkpoint(checkpoint, identity, learners)
    began = saved = time.perf_counter()
    with ThreadPoolExecutor(min(threads or cores(), len(learners))) as pool:
        while (left := updates - int(learners[0].counts[0])) > 0:
            list(pool.map(lambda one: one.learn(min(_CHUNK, left)), learners))
            now = time.perf_counter()
            if checkpoint is not None and now - saved > _CHECKPOINT_EVERY:
                _write_checkpoint(checkpoint, identity, learners, before + now - began)
                saved = time.perf_counter()
            if progress is not None:
                progress(_progress(learners, updates))
        validation = tuple(pool.map(lambda one: one.validate(validation_episodes), learners))
    seconds = before + time.perf_counter() - began
    if checkpoint is not None:
        _write_checkpoint(checkpoint, identity, learners, seconds)
    best = int(np.argmax([result.reward.mean() for result in validation]))
    return Trained(best, validation, seconds)


def identity_of(environment: Environment, settings: Any, seed: int) -> dict[str, Any]:
    """Return what a checkpoint must agree on: the settings, the seed, the simulation and the begin states."""
    digest = hashlib.sha256()
    for part in environment:
        for value in part:
            digest.update(np.ascontiguousarray(value).tobytes())
    return {"settings": msgspec.to_builtins(settings), "seed": seed, "environment": digest.hexdigest()}


def _progress(learners: Sequence[Learner], updates: int) -> Progress:
    done = int(learners[0].counts[0])
    episodes = sum(int(one.counts[2]) for one in learners)
    return Progress(len(learners) if done == updates else 0, len(learners), episodes, done / updates)


def _write_checkpoint(path: Path, identity: dict[str, Any], learners: Sequence[Learner], seconds: float) -> None:
    arrays = {f"{a}.{name}": array for a, one in enumerate(learners) for name, array in one.arrays().items()}
    write_arrays(path, _CHECKPOINT, identity, arrays | {"wall": np.array([seconds])})


def _read_checkpoint(path: Path, identity: dict[str, Any], learners: Sequence[Learner]) -> float:
    """Restore the learners; return the wall time that was spent."""
    found, arrays = read_arrays(path, _CHECKPOINT)
    if found != msgspec.json.decode(msgspec.json.encode(identity)):
        raise UnusableInput(
            f"{path}: the checkpoint of another training; remove it, or train with its settings and seed"
        )
    try:
        for a, one in enumerate(learners):
            one.restore({name: arrays[f"{a}.{name}"] for name in one.arrays()})
        return float(arrays["wall"][0])
    except (KeyError, ValueError, IndexError) as error:
        raise UnusableInput(f"{path}: a damaged checkpoint ({error}); remove it") from error

"""A training: several learners at once, each with weights and random numbers of its own, of which the best is kept.

All that a learner's future depends on is in its arrays, so the result is the same however many threads there are,
and a killed training goes on bit for bit from a checkpoint of them.
"""

import hashlib
import os
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.task.environment import Environment
from pneumarm.task.movements import Movements

CHECKPOINT = "pneumarm training"
"""Kind of the file of a checkpoint."""
_CHECKPOINT_EVERY = 2.0  # s
AgentT = TypeVar("AgentT")


class Progress(NamedTuple):
    """What a caller is told after every round of the learners."""

    finished: int
    """Learners that have ended their training."""
    agents: int
    episodes: int
    """Of all learners together."""
    share: float
    """How far training is, 0 to 1."""
    columns: tuple[str, ...] = ()
    """What the curves tell, as of a :class:`Training`."""
    curves: tuple[NDArray[np.float64], ...] = ()
    """How learning went so far, each of shape (rows, columns)."""


@dataclass(frozen=True)
class Training(Generic[AgentT]):
    """What came of a training: its best agent and all that it took. Entries are by learner."""

    agent: AgentT
    best: int = 0
    """Index of the best learner, by mean reward in its validation."""
    validation: tuple[Movements, ...] = ()
    """Greedy movements, without lookahead, the same begin states and goals for all."""
    columns: tuple[str, ...] = ()
    """What the curves tell, the first of them the episodes so far; the report draws every other one over it."""
    curves: tuple[NDArray[np.float64], ...] = ()
    """How learning went, each of shape (rows, columns)."""
    episodes: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """Training episodes, shape (agents,)."""
    steps: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """Steps of all simulated arms that it learned in, shape (agents,)."""
    met: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))
    """Whether it met the criterion of shaping at the whole deviation, shape (agents,); empty without a criterion."""
    seconds: float = 0.0
    """Wall time of training and validation [s], without compiling."""
    core_seconds: float = 0.0
    """Processor time of learning, all threads together [s], without compiling and validation."""

    def __repr__(self) -> str:
        return f"<Training of {self.agent!r}: {int(self.episodes.sum()):,} episodes in {self.seconds:.1f} s>"

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
            **({"met": self.met.tolist()} if self.met.size else {}),
            "validation": [result.results() for result in self.validation],
        }


class Learner(ABC, Generic[AgentT]):
    """One of several learners of a training."""

    columns: ClassVar[tuple[str, ...]]
    """What its curve tells, the episodes first."""
    met: bool | None = None
    """Whether it met the criterion of shaping; None without one."""

    def __init__(self) -> None:
        self.curve = np.zeros((0, len(self.columns)))
        self.seconds = np.zeros(1)
        """Processor time of learning."""

    @property
    @abstractmethod
    def ended(self) -> bool:
        """Whether its training has ended."""

    @property
    @abstractmethod
    def share(self) -> float:
        """How far it is, 0 to 1."""

    @property
    @abstractmethod
    def episodes(self) -> int:
        """Training episodes so far."""

    @property
    @abstractmethod
    def steps(self) -> int:
        """Learning steps so far."""

    @abstractmethod
    def warm_up(self) -> None:
        """Have everything compiled that learning needs; nobody uses this learner afterwards."""

    @abstractmethod
    def learn_on(self) -> None:
        """Learn until the next row of the curve, and add it."""

    @abstractmethod
    def validate(self, episodes: int) -> Movements:
        """Return ``episodes`` greedy movements, the same begin states and goals for all learners."""

    @abstractmethod
    def agent(self) -> AgentT:
        """Return the agent as it is now."""

    @abstractmethod
    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all that its future depends on, by name; the arrays are those that it changes."""

    def add_row(self, row: Sequence[float], seconds: float) -> None:
        """Add a row to the curve, after so much processor time."""
        self.curve = np.concatenate([self.curve, [row]])
        self.seconds += seconds

    def saved(self) -> dict[str, NDArray[Any]]:
        """Return what a checkpoint holds of it."""
        return {**self.arrays(), "curve": self.curve, "seconds": self.seconds}

    def restore(self, saved: dict[str, NDArray[Any]]) -> None:
        """Take up arrays of :meth:`saved`.

        Raises:
            KeyError, ValueError: they are of another learner.

        """
        for name, array in self.saved().items():
            first = name == "curve"  # there are as many rows as there were rounds
            found = saved[name]
            if found.dtype != array.dtype or found.shape[first:] != array.shape[first:] or found.ndim != array.ndim:
                raise ValueError(name)
            if first:
                self.curve = found.copy()
            else:
                array[...] = found


def train_side_by_side(
    make: Callable[[int], Learner[AgentT]],
    agents: int,
    validation_episodes: int,
    identity: dict[str, Any],
    *,
    progress: Callable[[Progress], None] | None = None,
    checkpoint: Path | None = None,
    threads: int | None = None,
) -> Training[AgentT]:
    """Let ``agents`` learners, of which ``make`` makes each by its number, learn until all have ended; keep the best.

    The result is the same, bit for bit, with any number of ``threads`` (default: one a core). With a ``checkpoint`` a
    killed training goes on from there; the file is left when training is done.

    Raises:
        UnusableInput: the ``checkpoint`` is not of a training of this ``identity``.

    """
    learners = [make(number) for number in range(agents)]
    before = 0.0
    if checkpoint is not None and checkpoint.exists():
        before = _read_checkpoint(checkpoint, identity, learners)
    compiled = make(0)  # and thrown away, so that compiling is not counted as training
    compiled.warm_up()
    compiled.validate(1)
    began = saved = time.perf_counter()
    with ThreadPoolExecutor(min(threads or cores(), agents)) as pool:
        while running := [one for one in learners if not one.ended]:
            list(pool.map(lambda one: one.learn_on(), running))
            now = time.perf_counter()
            if checkpoint is not None and now - saved > _CHECKPOINT_EVERY:
                _write_checkpoint(checkpoint, identity, learners, before + now - began)
                saved = time.perf_counter()
            if progress is not None:
                progress(_progress(learners))
        validation = tuple(pool.map(lambda one: one.validate(validation_episodes), learners))
    seconds = before + time.perf_counter() - began
    if checkpoint is not None:
        _write_checkpoint(checkpoint, identity, learners, seconds)
    best = int(np.argmax([result.reward.mean() for result in validation]))
    return Training(
        agent=learners[best].agent(),
        best=best,
        validation=validation,
        columns=learners[best].columns,
        curves=tuple(one.curve for one in learners),
        episodes=np.array([one.episodes for one in learners]),
        steps=np.array([one.steps for one in learners]),
        met=np.array([one.met for one in learners if one.met is not None], bool),
        seconds=seconds,
        core_seconds=sum(float(one.seconds[0]) for one in learners),
    )


def identity_of(environment: Environment, settings: Any, seed: int) -> dict[str, Any]:
    """Return what a checkpoint must agree on: the settings, the seed, the simulation and the begin states."""
    digest = hashlib.sha256()
    for part in environment:
        for value in part:
            digest.update(np.ascontiguousarray(value).tobytes())
    return {"settings": msgspec.to_builtins(settings), "seed": seed, "environment": digest.hexdigest()}


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _progress(learners: Sequence[Learner[Any]]) -> Progress:
    return Progress(
        finished=sum(one.ended for one in learners),
        agents=len(learners),
        episodes=sum(one.episodes for one in learners),
        share=float(np.mean([1.0 if one.ended else one.share for one in learners])),
        columns=learners[0].columns,
        curves=tuple(one.curve for one in learners),
    )


def _write_checkpoint(path: Path, identity: dict[str, Any], learners: Sequence[Learner[Any]], seconds: float) -> None:
    arrays = {f"{a}.{name}": array for a, one in enumerate(learners) for name, array in one.saved().items()}
    write_arrays(path, CHECKPOINT, identity, arrays | {"wall": np.array([seconds])})


def _read_checkpoint(path: Path, identity: dict[str, Any], learners: Sequence[Learner[Any]]) -> float:
    """Restore the learners; return the wall time that was spent."""
    found, arrays = read_arrays(path, CHECKPOINT)
    if found != msgspec.json.decode(msgspec.json.encode(identity)):
        raise UnusableInput(
            f"{path}: the checkpoint of another training; remove it, or train with its settings and seed"
        )
    try:
        for a, one in enumerate(learners):
            one.restore({name: arrays[f"{a}.{name}"] for name in one.saved()})
        return float(arrays["wall"][0])
    except (KeyError, ValueError, IndexError) as error:
        raise UnusableInput(f"{path}: a damaged checkpoint ({error}); remove it") from error

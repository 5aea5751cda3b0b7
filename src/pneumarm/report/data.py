"""What the report is drawn from: small records that each stage of a run leaves in its folder.

A record is a frozen dataclass of arrays, checked when it is made, and kept as one safetensors file. Where ``n``
may be large the record holds a sample; a few ten thousand rows are plenty for a figure.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.task.movements import Movements

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Record:
    """Base of the records: saving, loading, checking of shapes."""

    file: ClassVar[str]
    """Name of its file in the folder of a run."""
    shapes: ClassVar[dict[str, str]]
    """Shape of every array, such as ``n joints 4``; equal letters must be equal numbers."""

    def __post_init__(self) -> None:
        sizes: dict[str, int] = {}
        for name, shape in self.shapes.items():
            array = np.asarray(getattr(self, name))
            object.__setattr__(self, name, array)
            words = shape.split()
            wanted = tuple(int(w) if w.isdigit() else sizes.get(w, -1) for w in words)
            fits = array.ndim == len(words) and all(w in (-1, s) for w, s in zip(wanted, array.shape, strict=True))
            if not fits:
                raise UnusableInput(
                    f"{type(self).__name__}: {name} must have the shape ({shape.replace(' ', ', ')}) with {sizes}, "
                    f"got {array.shape}"
                )
            if array.dtype.kind not in "biuf" or not np.isfinite(array).all():
                raise UnusableInput(f"{type(self).__name__}: {name} must hold finite numbers")
            sizes.update({w: s for w, s in zip(words, array.shape, strict=True) if not w.isdigit()})

    def save(self, folder: Path, name: str | None = None) -> Path:
        """Write the record to its file in ``folder`` and return the path."""
        path = folder / (name or self.file)
        settings = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in self.shapes}
        write_arrays(path, self._kind(), settings, {k: getattr(self, k) for k in self.shapes})
        return path

    @classmethod
    def load(cls, folder: Path, name: str | None = None) -> Self:
        """Return the record in ``folder``.

        Raises:
            UnusableInput: no such file, or it does not hold this record.

        """
        path = folder / (name or cls.file)
        settings, arrays = read_arrays(path, cls._kind())
        try:
            return cls(**arrays, **{k: tuple(v) if isinstance(v, list) else v for k, v in settings.items()})
        except TypeError as error:
            raise UnusableInput(f"{path}: not a record that this version wrote ({error}); make it again") from error
        except UnusableInput as error:
            raise UnusableInput(f"{path}: {error}") from error

    @classmethod
    def _kind(cls) -> str:
        return f"report {cls.__name__}"


@dataclass(frozen=True)
class CoverageData(Record):
    """What was collected, and what the filter made of it."""

    file = "coverage.safetensors"
    shapes = {"observation": "n joints 4", "cells_holding": "counts", "growth": "points 2"}  # noqa: RUF012

    observation: Array
    """A sample of the observations, shape (n, joints, 4) [sensor units]."""
    cells_holding: NDArray[np.int64]
    """Number of the grid's cells that hold exactly i transitions, shape (most + 1,): ``np.bincount(count)``."""
    cells: int
    """Cells of the grid."""
    per_cell: int
    """Most transitions of a cell that are kept."""
    growth: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 2), np.int64))
    """Transitions collected and cells occupied by then, shape (points, 2), for the test whether data is enough."""


@dataclass(frozen=True)
class QualityData(Record):
    """How well the simulation predicts transitions that it was not fitted to."""

    file = "quality.safetensors"
    shapes = {  # noqa: RUF012
        "observation": "n joints 4",
        "target": "n joints 4",
        "predicted": "n joints 4",
        "command": "n joints 2",
        "time": "n",
        "propagation": "steps joints 4",
        "weights": "inputs outputs",
    }

    observation: Array
    """o_k, shape (n, joints, 4) [sensor units]; the first 200 rows are transitions in order of time."""
    target: Array
    """o_{k+1}, the same shape."""
    predicted: Array
    """sim_{k+1} (eq. 3.1), the same shape."""
    command: Array
    """a_k, shape (n, joints, 2): valves -1, 0, +1 or a continuous command."""
    time: Array
    """Time of o_k since the collecting began, shape (n,) [s]."""
    propagation: Array = field(default_factory=lambda: np.empty((0, 1, 4)))
    """Standard deviation of the error after k+1 steps simulated freely, shape (steps, joints, 4) [sensor units]."""
    weights: Array = field(default_factory=lambda: np.empty((0, 0)))
    """Standardised weights of a least-squares fit, shape (inputs, outputs); none where none was fitted."""
    inputs: Sequence[str] = ()
    """Names of the inputs."""
    outputs: Sequence[str] = ()
    """Names of the outputs."""

    def __post_init__(self) -> None:
        if len(self.propagation) == 0:
            object.__setattr__(self, "propagation", np.empty((0, np.shape(self.observation)[1], 4)))
        super().__post_init__()
        if (len(self.inputs), len(self.outputs)) != self.weights.shape:
            raise UnusableInput(
                f"QualityData: weights need a name for each input and output, got {len(self.inputs)} and "
                f"{len(self.outputs)} for {self.weights.shape}"
            )


@dataclass(frozen=True)
class MarkedData(Record):
    """Which of the stored rows are marked, so that nothing is learned from them."""

    file = "marked.safetensors"
    shapes = {"spans": "n 2", "reason": "n", "ends": "stages"}  # noqa: RUF012

    spans: NDArray[np.int64]
    """First row of each marked stretch and the one after its last, in the order of recording, shape (n, 2)."""
    reason: NDArray[np.int64]
    """Index of its reason, shape (n,)."""
    ends: NDArray[np.int64]
    """Rows recorded by the end of each stage, shape (stages,)."""
    reasons: Sequence[str] = ()
    """Why rows are marked, in words."""
    stages: Sequence[str] = ()
    """What the arm was moved for."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.stages) != len(self.ends) or not np.isin(self.reason, range(len(self.reasons))).all():
            raise UnusableInput("MarkedData: every stage needs its end, and every stretch one of the reasons")


@dataclass(frozen=True)
class TrainingData(Record):
    """How all agents learned, and their validation."""

    file = "training_curves.safetensors"
    shapes = {  # noqa: RUF012
        "curves": "drawn rows columns",
        "evaluated": "drawn",
        "reward": "agents",
        "success": "agents",
    }

    curves: Array
    """Training curves, shape (agents, rows, columns), or none; behind an agent's ``evaluated`` rows is nothing."""
    evaluated: NDArray[np.int64]
    """Rows that each agent took before its training ended, shape (agents,)."""
    reward: Array
    """Mean reward of each agent in the validation, shape (agents,)."""
    success: Array
    """Its success rate, shape (agents,)."""
    chosen: int
    """Index of the agent that is kept."""
    columns: Sequence[str] = ()
    """What the columns are, the first of them the episodes so far, see
    :attr:`pneumarm.learning.Training.columns`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        agents, rows, columns = self.curves.shape
        if not 0 <= self.chosen < len(self.reward):
            raise UnusableInput(f"TrainingData: chosen must be one of {len(self.reward)} agents, got {self.chosen}")
        if agents not in (0, len(self.reward)) or columns != len(self.columns):
            raise UnusableInput(
                f"TrainingData: curves must be of {len(self.reward)} agents and {len(self.columns)} columns, got "
                f"{self.curves.shape}"
            )
        if not ((self.evaluated >= 0) & (self.evaluated <= rows)).all():
            raise UnusableInput(f"TrainingData: evaluated must lie in 0..{rows}, got {self.evaluated}")


@dataclass(frozen=True)
class TransferData:
    """The movements on the arm, phase after phase."""

    before: Movements
    """Greedy, on arrival."""
    learning: Movements
    """While learning."""
    after: Movements
    """Greedy, after adaptation."""
    learning_rate: float = 0.0
    adaptations: int = 0
    """How often a policy adapted to the arm."""

    @property
    def phases(self) -> dict[str, Movements]:
        """The phases by name, in order."""
        return {"before": self.before, "learning": self.learning, "after": self.after}


@dataclass(frozen=True)
class Demonstration(Record):
    """One movement on the arm, with what the arm does after it where that was recorded."""

    file = "demonstration.safetensors"
    shapes = {  # noqa: RUF012
        "time": "n",
        "angle": "n joints",
        "pressure": "n joints 2",
        "valves": "n joints 2",
        "goal": "joints",
    }

    time: Array
    """Of the readings, shape (n,) [s]."""
    angle: Array
    """Shape (n, joints) [counts]."""
    pressure: Array
    """Shape (n, joints, 2) [counts]."""
    valves: Array
    """In force from each reading to the next, shape (n, joints, 2)."""
    goal: Array
    """Shape (joints,) [counts]."""
    end: float | None
    """When the goal was reached [s], None if it was not."""
    name: str
    """What is typical of it, such as "large displacement"."""


@dataclass(frozen=True)
class MovingData(Record):
    """Goals that were moved to and held, one after the other."""

    file = "moving.safetensors"
    shapes = {"time": "n", "angle": "n joints", "wanted": "n joints"}  # noqa: RUF012

    time: Array
    """Of the readings, shape (n,) [s]."""
    angle: Array
    """Shape (n, joints) [counts]."""
    wanted: Array
    """The goal at that time, shape (n, joints) [counts]."""

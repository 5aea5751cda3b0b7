"""What the report is drawn from: small records that each stage of a run leaves in its folder.

A record is a frozen dataclass of arrays, checked when it is made, and kept as one safetensors file. Where ``n``
may be large the record holds a sample; a few ten thousand rows are plenty for a figure.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated, ClassVar, Self, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.drawing.moving_arm import Shown
from pneumarm.errors import UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.task.movements import Movements

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Record:
    """Base of the records: saving, loading, checking of shapes."""

    file: ClassVar[str]
    """Name of its file in the folder of a run."""

    @classmethod
    def shapes(cls) -> dict[str, str]:
        """Return the shapes of the arrays by name, as annotated: ``n joints 4``; equal words are equal numbers."""
        hints = get_type_hints(cls, include_extras=True)
        return {name: hint.__metadata__[0] for name, hint in hints.items() if get_origin(hint) is Annotated}

    def __post_init__(self) -> None:
        sizes: dict[str, int] = {}
        for name, shape in self.shapes().items():
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
        settings = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in self.shapes()}
        write_arrays(path, self._kind(), settings, {k: getattr(self, k) for k in self.shapes()})
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

    observation: Annotated[Array, "n joints 4"]
    """A sample of the observations [sensor units]."""
    cells_holding: Annotated[NDArray[np.int64], "counts"]
    """Number of the grid's cells that hold exactly i transitions: ``np.bincount(count)``."""
    cells: int
    """Cells of the grid."""
    per_cell: int
    """Most transitions of a cell that are kept."""
    growth: Annotated[NDArray[np.int64], "points 2"] = field(default_factory=lambda: np.empty((0, 2), np.int64))
    """Transitions collected and cells occupied by then, for the test whether data is enough."""


@dataclass(frozen=True)
class QualityData(Record):
    """How well the simulation predicts transitions that it was not fitted to."""

    file = "quality.safetensors"

    observation: Annotated[Array, "n joints 4"]
    """o_k [sensor units]; the first 200 rows are transitions in order of time."""
    target: Annotated[Array, "n joints 4"]
    """o_{k+1}, the same shape."""
    predicted: Annotated[Array, "n joints 4"]
    """sim_{k+1} (eq. 3.1), the same shape."""
    command: Annotated[Array, "n joints 2"]
    """a_k: valves -1, 0, +1 or a continuous command."""
    time: Annotated[Array, "n"]
    """Time of o_k since the collecting began [s]."""
    propagation: Annotated[Array, "steps joints 4"] = field(default_factory=lambda: np.empty((0, 1, 4)))
    """Standard deviation of the error after k+1 steps simulated freely [sensor units]."""
    weights: Annotated[Array, "inputs outputs"] = field(default_factory=lambda: np.empty((0, 0)))
    """Standardised weights of a least-squares fit; none where none was fitted."""
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

    spans: Annotated[NDArray[np.int64], "n 2"]
    """First row of each marked stretch and the one after its last, in the order of recording."""
    reason: Annotated[NDArray[np.int64], "n"]
    """Index of its reason."""
    ends: Annotated[NDArray[np.int64], "stages"]
    """Rows recorded by the end of each stage."""
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

    curves: Annotated[Array, "drawn rows columns"]
    """Training curves, or none; behind an agent's ``evaluated`` rows is nothing."""
    evaluated: Annotated[NDArray[np.int64], "drawn"]
    """Rows that each agent took before its training ended."""
    reward: Annotated[Array, "agents"]
    """Mean reward of each agent in the validation."""
    success: Annotated[Array, "agents"]
    """Its success rate."""
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

    time: Annotated[Array, "n"]
    """Times of the readings [s]."""
    angle: Annotated[Array, "n joints"]
    """In counts."""
    pressure: Annotated[Array, "n joints 2"]
    """In counts."""
    valves: Annotated[Array, "n joints 2"]
    """In force from each reading to the next."""
    goal: Annotated[Array, "joints"]
    """In counts."""
    end: float | None
    """When the goal was reached [s], None if it was not."""
    name: str
    """What is typical of it, such as "large displacement"."""

    def shown(self, spec: ArmSpec) -> Shown:
        """Return it as a stretch of movement of the arm ``spec``, that begins at 0 s."""
        wanted = np.tile(self.goal, (len(self.time), 1))
        return Shown(spec, self.time - self.time[:1], self.angle, wanted, self.pressure, self.valves)

    @property
    def seconds(self) -> float | None:
        """How long it took to reach the goal [s], None if it was not reached."""
        return None if self.end is None else self.end - float(self.time[0])


@dataclass(frozen=True)
class MovingData(Record):
    """Goals that were moved to and held, one after the other."""

    file = "moving.safetensors"

    time: Annotated[Array, "n"]
    """Times of the readings [s]."""
    angle: Annotated[Array, "n joints"]
    """[counts]"""
    wanted: Annotated[Array, "n joints"]
    """The goal at that time [counts]."""
    pressure: Annotated[Array, "measured joints 2"] = field(default_factory=lambda: np.empty((0, 1, 2)))
    """[counts]; of records of older versions nothing, else shape (n, joints, 2)."""

    def __post_init__(self) -> None:
        if len(self.pressure) == 0:
            object.__setattr__(self, "pressure", np.empty((0, np.shape(self.angle)[1], 2)))
        super().__post_init__()

    def shown(self, spec: ArmSpec) -> Shown:
        """Return it as a stretch of movement of the arm ``spec``."""
        pressure = self.pressure if len(self.pressure) else None
        return Shown(spec, self.time, self.angle, self.wanted, pressure)

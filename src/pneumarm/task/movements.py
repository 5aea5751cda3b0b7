"""The record of movements, wherever they were made and whoever made them: columns, their summary, and their file."""

import csv
import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.errors import UnusableInput
from pneumarm.files import read_arrays, read_rows, write_arrays, write_text
from pneumarm.statistics import summarise
from pneumarm.transitions.rows import Recorded

Array = NDArray[np.float64]

TEST, NOISE = 3, 4
"""Streams of random numbers of tests; training uses others."""
LONGEST_PAUSE = 120.0
"""Movements that are farther apart on the arm's clock [s] were interrupted: none takes so long to begin."""
_KIND = "pneumarm movements"
_BY_JOINT = ("goal", "angle_begin", "angle_end", "velocity_end", "switches")
_DECIMALS = {"time_start": 4, "time_end": 4, "velocity_end": 4}  # in a file for people


class Movements(NamedTuple):
    """``n`` movements in the order in which they were made, an entry a movement; kernels fill it."""

    goal: Array
    """Shape (n, joints) [counts]."""
    time_start: Array
    """On the arm's clock, shape (n,) [s]; zeros where the movements stand apart, as in the simulation."""
    time_end: Array
    """The same of the end."""
    angle_begin: Array
    """Shape (n, joints) [counts]."""
    angle_end: Array
    """Shape (n, joints) [counts]."""
    velocity_end: Array
    """Shape (n, joints) [counts/ms]."""
    actions: NDArray[np.int64]
    """Shape (n,)."""
    switches: NDArray[np.int64]
    """Shape (n, joints); (n, 1) of all joints together where they were read from a CSV file."""
    reward: Array
    """Sum of the rewards of a movement, shape (n,)."""
    success: NDArray[np.bool_]
    """Shape (n,)."""

    @property
    def n(self) -> int:
        """How many there are."""
        return len(self.reward)

    @property
    def all_switches(self) -> NDArray[np.int64]:
        """Switches of all joints together, shape (n,)."""
        total: NDArray[np.int64] = self.switches.sum(axis=1)
        return total

    @property
    def distance(self) -> Array:
        """|goal - angle at the begin|, shape (n, joints) [counts]."""
        return np.abs(self.goal - self.angle_begin)

    @property
    def seconds(self) -> float:
        """Time from the begin of the first to the end of the last, see :func:`running_time` [s]."""
        return float(running_time(self.time_start, self.time_end)[-1]) if self.n else 0.0

    def part(self, chosen: slice | NDArray[Any]) -> "Movements":
        """Return those that are ``chosen``, by a slice, a mask (n,) or indices."""
        columns: Iterable[Any] = (column[chosen] for column in self)
        return Movements(*columns)

    def __repr__(self) -> str:
        means = ", ".join(f"{name} {value:.3g}" for name, value in self.means().items()) if self.n else "none"
        return f"<{self.n:,} Movements: {means}>"

    def results(self) -> dict[str, Any]:
        """Return the means with their 95 % intervals, as ``results.json`` holds them.

        ``switches`` is a list where there are several joints; ``seconds`` tells the time of movements on an arm.
        """
        figures = summarise(self.reward, self.success, self.actions, self.switches)
        return {**figures, "seconds": self.seconds} if self.time_end.any() else figures

    def means(self) -> dict[str, float]:
        """Return the means of reward, success, actions, and switches of all joints, without intervals."""
        figures = {"reward": self.reward, "success_rate": self.success, "actions": self.actions}
        return {name: float(values.mean()) for name, values in {**figures, "switches": self.all_switches}.items()}

    def rows(self) -> list[dict[str, Any]]:
        """Return each as plain values by the names of the columns, lists (joints,) where it has one a joint."""
        columns = [column.tolist() for column in self]
        return [dict(zip(self._fields, values, strict=True)) for values in zip(*columns, strict=True)]

    def save(self, path: Path) -> None:
        """Write them to ``path``, whole or not at all."""
        write_arrays(path, _KIND, {}, self._asdict())

    @classmethod
    def load(cls, path: Path) -> "Movements":
        """Return the movements in ``path``.

        Raises:
            UnusableInput: no such file, or it holds something else.

        """
        _, arrays = read_arrays(path, _KIND)
        angles = arrays.get("goal", np.empty(0)).shape
        shapes = {name: {angles} if name in _BY_JOINT else {angles[:1]} for name in cls._fields}
        shapes["switches"] |= {(*angles[:1], 1)}
        fits = arrays.keys() == shapes.keys() and all(arrays[name].shape in shapes[name] for name in shapes)
        if len(angles) != 2 or not fits:
            raise UnusableInput(
                f"{path}: expected movements with the columns {', '.join(cls._fields)}; make it again"
            )
        return cls(**arrays)


@dataclass(frozen=True)
class Movement:
    """One movement on an arm: the figures of a row of :class:`Movements`, and all that was read and applied."""

    goal: Array
    """Shape (joints,) [counts]."""
    actions: int
    switches: NDArray[np.int64]
    """Shape (joints,): how often the action of a joint differed from the one before it."""
    reward: float
    success: bool
    velocity_end: Array
    """Velocity where it ended, shape (joints,) [counts/ms]."""
    recorded: Recorded
    """All readings and commands, ready for a store; those after its end too, where the goal was held on."""
    ended: int = -1
    """Number of the reading at which it ended, the last one by default."""

    @property
    def time_start(self) -> float:
        """Arm time of the first reading [s]."""
        return float(self.recorded.time[0])

    @property
    def time_end(self) -> float:
        """Arm time of its end [s]."""
        return float(self.recorded.time[self.ended])

    @property
    def angle_begin(self) -> Array:
        """Angles at the first reading, shape (joints,) [counts]."""
        return self.recorded.angle[0]

    @property
    def angle_end(self) -> Array:
        """Angles at its end, shape (joints,) [counts]."""
        return self.recorded.angle[self.ended]

    def row(self) -> dict[str, Any]:
        """Return its figures as plain values, as one of :meth:`Movements.rows`."""
        return {name: np.asarray(getattr(self, name)).tolist() for name in Movements._fields}


def movements(n: int, joints: int = 1) -> Movements:
    """Return workspace for ``n`` movements."""
    each, all_ = (n, joints), (n,)
    return Movements(
        goal=np.zeros(each),
        time_start=np.zeros(all_),
        time_end=np.zeros(all_),
        angle_begin=np.zeros(each),
        angle_end=np.zeros(each),
        velocity_end=np.zeros(each),
        actions=np.zeros(all_, np.int64),
        switches=np.zeros(each, np.int64),
        reward=np.zeros(all_),
        success=np.zeros(all_, np.bool_),
    )


def of_rows(rows: Iterable[Mapping[str, Any]], joints: int = 1) -> Movements:
    """Return the movements in ``rows``, as of :meth:`Movements.rows`; ``joints`` are those of none at all."""
    listed = list(rows)
    made = movements(len(listed), np.size(listed[0]["goal"]) if listed else joints)
    if not listed:
        return made
    columns: dict[str, Any] = {
        name: np.array([row[name] for row in listed], column.dtype).reshape((len(listed), -1)[: column.ndim])
        for name, column in made._asdict().items()
    }
    for name in ("angle_begin", "angle_end", "velocity_end"):
        if columns[name].shape != made.goal.shape:
            raise ValueError(f"{name} of {columns[name].shape[1]} joint(s), goal of {made.goal.shape[1]}")
    return Movements(**columns)


def join_movements(parts: Iterable[Movements]) -> Movements:
    """Return the movements of all ``parts``, of which there is at least one, one after the other."""
    return Movements(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def running_time(time_start: ArrayLike, time_end: ArrayLike) -> Array:
    """Return the arm time [s] from the begin of the first movement to the end of each, shape (n,).

    Between two movements the arm is brought to a begin state, and an agent may adapt. What lies between them where
    the arm's clock went back (a controller began anew), or where they are more than :data:`LONGEST_PAUSE` apart, was
    an interruption, and is left out.

    Args:
        time_start: when each movement began on the arm's clock, shape (n,) [s].
        time_end: when it ended [s].

    """
    start, end = np.asarray(time_start, np.float64), np.asarray(time_end, np.float64)
    passed = end - start
    pause = start[1:] - end[:-1]
    passed[1:] += np.where((pause >= 0) & (pause <= LONGEST_PAUSE), pause, 0.0)
    return np.cumsum(passed)


COLUMNS = ("phase", *Movements._fields)
"""Columns of ``episodes.csv``; with several joints a cell holds their numbers with spaces between."""


def write_episodes(path: Path, phases: Mapping[str, Movements]) -> None:
    """Write ``episodes.csv``: a row a movement, phase after phase; ``switches`` are those of all joints together."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for phase, made in phases.items():
        rounded = {name: getattr(made, name).round(decimals) for name, decimals in _DECIMALS.items()}
        for row in made._replace(**rounded, switches=made.all_switches).rows():
            writer.writerow([phase, *map(_cell, row.values())])
    write_text(path, text.getvalue())


def _cell(value: Any) -> Any:
    if isinstance(value, list):
        return " ".join(str(number) for number in value)
    return int(value) if isinstance(value, bool) else value


def read_episodes(path: Path) -> dict[str, Movements]:
    """Return the movements of each phase in the CSV file at ``path``.

    Raises:
        UnusableInput: no such file, missing columns, or a cell that is no number.

    """
    table = read_rows(path, "the episodes of a transfer as CSV")
    header = next(table, [])
    if missing := set(COLUMNS) - set(header):
        raise UnusableInput(f"{path}: expected the columns {', '.join(COLUMNS)}; {sorted(missing)} are missing")
    phases: dict[str, list[dict[str, Any]]] = {}
    try:
        for cells in table:
            row = dict(zip(header, cells, strict=True))
            phases.setdefault(row["phase"], []).append({name: _numbers(row[name]) for name in COLUMNS[1:]})
        return {phase: of_rows(rows) for phase, rows in phases.items()}
    except (ValueError, TypeError) as error:
        raise UnusableInput(f"{path}: a cell is not what its column says ({error})") from error


def _numbers(cell: str) -> float | list[float]:
    """Return the number in ``cell``, or its numbers; what is true counts 1."""
    numbers = [float({"true": "1", "false": "0"}.get(word.lower(), word)) for word in cell.split()]
    if not numbers or not np.isfinite(numbers).all():
        raise ValueError(f"{cell!r} is no number")
    return numbers[0] if len(numbers) == 1 else numbers

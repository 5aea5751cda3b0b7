"""Rows of the store as arrays: what was measured, raw, and what was commanded, in order of time."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.cycle import Step
from pneumarm.arm.seam import ArmSpec, measured
from pneumarm.errors import UnusableInput

LONGEST_REASON = 1000
"""Most characters of a mark's reason."""
_SHORTEST = 2  # rows of a sequence: fewer hold no transition


@dataclass(frozen=True)
class Rows:
    """A block of ``n`` rows, whole sequences in order; a row is an observation and the command that followed it.

    Velocity is among them only where a sensor tells it; else it is derived (thesis section 2.3.4), see
    :mod:`pneumarm.transitions.window`.
    """

    sequence: NDArray[np.int64]
    """Number of the sequence, shape (n,)."""
    step: NDArray[np.int64]
    """Step within the sequence, shape (n,); rows whose steps do not follow on each other are never joined."""
    time: NDArray[np.float64]
    """Time of the reading on the arm's clock, shape (n,) [s]."""
    angle: NDArray[np.float64]
    """Shape (n, joints) [counts]."""
    pressure: NDArray[np.float64]
    """Shape (n, joints, 2) [counts]."""
    command: NDArray[np.float64]
    """What was applied after the reading, shape (n, joints, 2): valves -1, 0, +1, or a continuous command in
    an imported recording; NaN in the last row of a sequence, after which nothing was recorded."""
    at_rest: NDArray[np.bool_]
    """Whether the row's sequence began at rest with closed valves, so that rows before its first may be taken
    as copies of it, shape (n,)."""
    measured: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    """What further sensors said, by their names in :attr:`~pneumarm.arm.ArmSpec.further`, each of shape (n,)
    [counts/ms, m/s2 or Celsius]."""

    @property
    def joints(self) -> int:
        """Number of joints."""
        return int(self.angle.shape[1])

    def where(self, kept: NDArray[np.bool_]) -> "Rows":
        """Return the rows that are ``kept`` (n,)."""
        arrays = {name: getattr(self, name)[kept] for name in _ARRAYS}
        return Rows(**arrays, measured={name: values[kept] for name, values in self.measured.items()})

    def __len__(self) -> int:
        return len(self.sequence)


_ARRAYS = tuple(one.name for one in fields(Rows) if one.name != "measured")


def join_rows(blocks: Iterable[Rows]) -> Rows:
    """Return ``blocks`` of one arm, at least one, as a single one."""
    parts = list(blocks)
    arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _ARRAYS}
    further = {name: np.concatenate([part.measured[name] for part in parts]) for name in parts[0].measured}
    return Rows(**arrays, measured=further)


@dataclass(frozen=True)
class Mark:
    """Steps of a sequence that nothing may be learned from, and why."""

    first: int
    """First step."""
    last: int
    """Last step."""
    reason: str
    """What was found, in words."""

    def __post_init__(self) -> None:
        if not (0 <= self.first <= self.last and 0 < len(self.reason) <= LONGEST_REASON):
            raise UnusableInput(
                f"a mark needs a first and a last step in this order and a reason of 1 to {LONGEST_REASON} "
                f"characters, got {self!r}"
            )


def unmarked(step: NDArray[np.int64], marks: Iterable[Mark]) -> NDArray[np.bool_]:
    """Return which of the steps (n,) no mark holds."""
    kept = np.ones(len(step), bool)
    for mark in marks:
        kept &= (step < mark.first) | (step > mark.last)
    return kept


@dataclass(frozen=True)
class Recorded:
    """One sequence of ``n`` readings and the ``n - 1`` commands between them, before it has a number in a store."""

    time: NDArray[np.float64]
    """Times of the readings on the arm's clock, rising, shape (n,) [s]."""
    angle: NDArray[np.float64]
    """Shape (n, joints) [counts]."""
    pressure: NDArray[np.float64]
    """Shape (n, joints, 2) [counts]."""
    command: NDArray[np.float64]
    """What was applied after each reading, shape (n, joints, 2); NaN after the last."""
    step: NDArray[np.int64]
    """Step of each reading, from 0, rising, shape (n,); a lost control period leaves a gap."""
    kind: str = "recorded"
    """What was done: zero-velocity, velocity, controller, episode, imported, ..."""
    at_rest: bool = False
    """Whether it began at rest with closed valves."""
    marks: tuple[Mark, ...] = ()
    """What of it nothing may be learned from."""
    info: Mapping[str, Any] = field(default_factory=dict)
    """Whatever else is to be kept with it, such as the goal: small, and of JSON's types."""
    measured: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    """What further sensors said, by name, each of shape (n,); see :attr:`Rows.measured`."""

    @classmethod
    def from_steps(
        cls,
        steps: Sequence[Step],
        spec: ArmSpec,
        *,
        kind: str = "recorded",
        at_rest: bool = False,
        info: Mapping[str, Any] | None = None,
    ) -> "Recorded":
        """Return what the control cycle yielded as a sequence; the last turn's valves may be None.

        The step counts control periods: after a turn that came more than half a period late the next number is
        left out, so that no transition of a wrong length is made of it.
        """
        time = np.array([step.reading.time for step in steps])
        command = np.full((len(steps), spec.joints, 2), np.nan)
        for k, step in enumerate(steps[:-1]):
            if step.valves is not None:
                command[k] = step.valves
        said = [measured(step.reading, spec.further, spec.name) for step in steps]
        further = np.array(said, np.float64).reshape(len(steps), len(spec.further))
        return cls(
            time=time,
            angle=np.array([step.reading.angle for step in steps], np.float64),
            pressure=np.array([step.reading.pressure for step in steps], np.float64),
            command=command,
            step=steps_of(time, spec.period),
            kind=kind,
            at_rest=at_rest,
            info=info or {},
            measured=dict(zip(spec.further, further.T, strict=True)),
        )

    @property
    def transitions(self) -> int:
        """Transitions to learn from: pairs of rows that follow on each other, none of them marked."""
        return joinable(self.step, self.marks)

    def __len__(self) -> int:
        return len(self.time)


def broken_off(
    steps: Sequence[Step],
    spec: ArmSpec,
    why: BaseException,
    *,
    kind: str,
    at_rest: bool = False,
    info: Mapping[str, Any] | None = None,
) -> Recorded | None:
    """Return what there is of a sequence that broke off, its last row marked with ``why``; None where it is nothing.

    The rows before the last were read, and their valves acknowledged, while all was well.
    """
    if len(steps) < _SHORTEST:
        return None
    recorded = Recorded.from_steps(steps, spec, kind=kind, at_rest=at_rest, info=info)
    return replace(recorded, marks=(broken_at(int(recorded.step[-1]), why),))


def broken_at(step: int, why: BaseException) -> Mark:
    """Return the mark of the last ``step`` of a sequence that broke off, with ``why``."""
    return Mark(step, step, f"broke off here: {str(why) or type(why).__name__}"[:LONGEST_REASON])


def rows_of(recorded: Recorded, sequence: int = 0) -> Rows:
    """Return ``recorded`` as the rows of one sequence, before it is stored."""
    return Rows(
        sequence=np.full(len(recorded), sequence, np.int64),
        step=recorded.step,
        time=recorded.time,
        angle=recorded.angle,
        pressure=recorded.pressure,
        command=recorded.command,
        at_rest=np.full(len(recorded), recorded.at_rest, np.bool_),
        measured=recorded.measured,
    )


def values_of(recorded: "Recorded | Rows", further: Sequence[str]) -> NDArray[np.float64]:
    """Return all that was read and done, shape (n, columns), as a store keeps it; of ``further`` sensors these."""
    n = len(recorded)
    per_joint = np.concatenate([recorded.angle[:, :, None], recorded.pressure, recorded.command], axis=2)
    measured = [recorded.measured[name][:, None] for name in further]
    return np.concatenate([recorded.time[:, None], per_joint.reshape(n, -1), *measured], axis=1)


def joinable(step: NDArray[np.int64], marks: Iterable[Mark]) -> int:
    """Return how many of the steps (n,) of a sequence are followed by the next one, both unmarked."""
    return int((np.diff(step[unmarked(step, marks)]) == 1).sum())


def steps_of(time: NDArray[np.float64], period: float) -> NDArray[np.int64]:
    """Return the steps (n,) of readings at the rising times (n,) [s]: 0, then control periods passed, at least 1."""
    passed = np.maximum(np.rint(np.diff(time) / period), 1.0).astype(np.int64)
    return np.concatenate([[0], np.cumsum(passed)]).astype(np.int64)

"""What `pneumarm view` shows: a stretch of movement out of a store, a run's folder or one of its records."""

import operator
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pneumarm.address import Address
from pneumarm.arm.seam import ArmSpec
from pneumarm.drawing.moving_arm import Shown
from pneumarm.errors import UnusableInput
from pneumarm.report.data import Demonstration, MovingData
from pneumarm.report.files import DEMONSTRATIONS, SPEC, read_spec
from pneumarm.task.reference import parse_reference
from pneumarm.transitions.rows import Rows, join_rows
from pneumarm.transitions.store import SequenceEntry, Store

Array = NDArray[np.float64]

_STORE = "transitions.db"
_PAUSE = 3.0  # s, at most, between two sequences that are shown as one


def read_shown(path: Address, sequence: int | None = None, begin: float = 0.0, seconds: float = 20.0) -> Shown:
    """Return what ``path`` holds, from ``begin`` [s] on for up to ``seconds``.

    Args:
        path: a store, the folder of a run, or a record in it.
        sequence: of a store, from 1; by default the last ones, as far as they follow on each other.
        begin: of what is shown, since the beginning of the sequence or the record [s].
        seconds: for how long.

    Raises:
        UnusableInput: it holds no movement.

    """
    if isinstance(path, Path) and path.is_dir():
        path = _in_folder(path)
    if isinstance(path, Path) and path.suffix == ".safetensors":
        found = _of_record(path)
    else:
        with Store.open(path) as store:
            found = _of_store(store, sequence, seconds)
    return _part(found, begin, seconds, path)


def _in_folder(folder: Path) -> Path:
    """Return the record of movements in the ``folder`` of a run, or its store."""
    choices = [folder / MovingData.file, *sorted(folder.glob(DEMONSTRATIONS)), folder / _STORE]
    found = next((choice for choice in choices if choice.exists()), None)
    if found is None:
        raise UnusableInput(f"{folder}: holds nothing to show; give the folder of a run, or a store")
    return found


def _of_record(path: Path) -> Shown:
    spec = read_spec(path.parent / SPEC)
    if path.name == MovingData.file:
        return MovingData.load(path.parent).shown(spec)
    return Demonstration.load(path.parent, path.name).shown(spec)


def _of_store(store: Store, sequence: int | None, seconds: float) -> Shown:
    entries = {one.number: one for one in store.catalogue()}
    if not entries:
        raise UnusableInput(f"{store.address}: holds no sequence yet")
    if sequence is not None and sequence not in entries:
        raise UnusableInput(
            f"{store.address}: there is no sequence {sequence}; there are {min(entries)} to {max(entries)}"
        )
    numbers = [sequence] if sequence is not None else list(entries)
    parts: list[Rows] = []
    for number in reversed(numbers):
        rows = join_rows(store.blocks(sequences=partial(operator.eq, number), marked=True))
        if parts and not 0 <= parts[0].time[0] - rows.time[-1] <= _PAUSE:
            break
        if parts and parts[-1].time[-1] - rows.time[0] > seconds:
            break
        parts.insert(0, rows)
    wanted = [_wanted(entries[int(rows.sequence[0])], rows, store.spec) for rows in parts]
    rows = join_rows(parts)
    asked = np.concatenate(wanted)
    return Shown(
        store.spec,
        rows.time,
        rows.angle,
        None if np.isnan(asked).all() else asked,
        rows.pressure,
        np.nan_to_num(rows.command) if store.valves else None,
    )


def _wanted(entry: SequenceEntry, rows: Rows, spec: ArmSpec) -> Array:
    """Return what was asked for in a sequence, shape (n, joints) [counts]; NaN where that is not known."""
    goal, reference = entry.info.get("goal"), entry.info.get("reference")
    if isinstance(goal, Sequence) and len(goal) == spec.joints:
        return np.tile(np.asarray(goal, np.float64), (len(rows), 1))
    if isinstance(reference, str):
        try:
            found = parse_reference(reference, spec)
        except UnusableInput:  # a file that is gone
            return np.full(rows.angle.shape, np.nan)
        began = entry.info.get("began")  # of one that goes on from the sequence before
        passed = rows.time - (began if isinstance(began, float) else rows.time[0])
        return np.array([found.at(float(time)) for time in passed])
    return np.full(rows.angle.shape, np.nan)


def _part(shown: Shown, begin: float, seconds: float, path: Address) -> Shown:
    time = shown.time - shown.time[0]
    kept = (time >= begin) & (time <= begin + seconds)
    if kept.sum() < 2:
        raise UnusableInput(f"{path}: lasts {time[-1]:.1f} s, there is nothing to show from {begin:g} s on")

    def cut(values: Array | None) -> Array | None:
        return None if values is None else values[kept]

    return Shown(
        shown.spec,
        time[kept] - time[kept][0],
        shown.angle[kept],
        cut(shown.wanted),
        cut(shown.pressure),
        cut(shown.command),
    )

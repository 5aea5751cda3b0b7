"""What watches an arm while it is recorded, and marks what nothing may be learned from."""

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.cycle import Step
from pneumarm.arm.seam import Reading
from pneumarm.transitions.rows import Mark, Recorded
from pneumarm.transitions.store import Store


class Watch(Protocol):
    """Sees every reading of an arm and what was done after it."""

    def begin(self, *, at_rest: bool) -> None:
        """Begin a new sequence; ``at_rest`` says that the arm stood still with closed valves before."""

    def see(self, reading: Reading, valves: NDArray[np.int8] | None) -> None:
        """Take in a reading and the valves (joints, 2) as applied after it, None after the last one."""

    def marks(self, recorded: Recorded) -> tuple[Mark, ...]:
        """Return what of a sequence, whole in the past, nothing may be learned from, as far as is known now."""

    def spoiled_since(self) -> tuple[float, str] | None:
        """Return since when [s] something is wrong now, and what; None where nothing is."""

    def get_state(self) -> bytes:
        """Return all that its future depends on."""

    def set_state(self, state: bytes) -> None:
        """Take up a state of ``get_state``."""


def watched(steps: Iterator[Step], watch: Watch | None, *, at_rest: bool) -> list[Step]:
    """Return all ``steps`` of a control cycle, each seen by ``watch`` as it happens."""
    if watch is None:
        return list(steps)
    watch.begin(at_rest=at_rest)
    seen: list[Step] = []
    for step in steps:
        watch.see(step.reading, step.valves)
        seen.append(step)
    return seen


def keep_watch(store: Store, watch: Watch, run: int) -> int:
    """Mark the stored rows of ``run`` since when something has been wrong; return the transitions that this costs.

    A fault that takes a while to be found has spoiled what was stored in the meantime.
    """
    found = watch.spoiled_since()
    if found is None:
        return 0
    before = store.transitions
    store.mark_since(found[0], found[1], run)
    return before - store.transitions

"""The loop of a movement, and what watches an arm meanwhile and marks what nothing may be learned from."""

import copy
from collections.abc import Callable, Mapping
from contextlib import closing
from typing import Any, Protocol

import numpy as np

from pneumarm.arm.controller import Controller
from pneumarm.arm.cycle import ControlCycle, Step
from pneumarm.arm.seam import ArmSpec, Reading, with_measured
from pneumarm.arm.valves import Command
from pneumarm.errors import ArmFailure
from pneumarm.transitions.rows import Mark, Recorded
from pneumarm.transitions.store import Store

MOST_SPOILED = 5
"""Sequences in a row in which something may be wrong before whoever moves the arm gives up ..."""
LONGEST_SPOILED = 30.0
"""... and seconds since it began: one that is over after ten is passing trouble, however short movements are."""


class Watch(Protocol):
    """Sees every reading of an arm and what was done after it."""

    def begin(self, *, at_rest: bool) -> None:
        """Begin a new sequence; ``at_rest`` says that the arm stood still with closed valves before."""

    def see(self, reading: Reading, valves: Command | None) -> None:
        """Take in a reading and the command (joints, 2) as applied after it, None after the last one."""

    def marks(self, recorded: Recorded) -> tuple[Mark, ...]:
        """Return what of a sequence, whole in the past, nothing may be learned from, as far as is known now."""

    def spoiled_since(self) -> tuple[float, str] | None:
        """Return since when [s] something is wrong now, and what; None where nothing is."""

    def reasons(self) -> str:
        """Return what was seen of what is wrong now, and what it is judged against, in a sentence for people."""

    def get_state(self) -> bytes:
        """Return all that its future depends on."""

    def set_state(self, state: bytes) -> None:
        """Take up a state of ``get_state``."""


class Patience:
    """Counts the sequences of the arm called ``name`` in a row after which something was wrong with it."""

    def __init__(self, name: str, sequences: str = "sequences") -> None:
        self._name, self._sequences, self._wrong = name, sequences, 0

    def judge(self, watch: Watch, time: float) -> None:
        """Count the sequence that ``watch`` has just seen, which ended at ``time`` [s].

        Raises:
            ArmFailure: it is the :data:`MOST_SPOILED`-th in a row at least, and :data:`LONGEST_SPOILED` have passed,
                so that this is no passing trouble.

        """
        found = watch.spoiled_since()
        self._wrong = 0 if found is None else self._wrong + 1
        if found is not None and self._wrong >= MOST_SPOILED and time - found[0] >= LONGEST_SPOILED:
            raise ArmFailure(
                f"{self._name}: {found[1]}, for {self._wrong} {self._sequences} now; nothing is learned of these: "
                f"{watch.reasons()}. See to the arm and run the same command again; where nothing is wrong with it, "
                "add --monitor warn, which tells of such things, marks no rows and does not stop (or off)"
            )


def act_until(
    cycle: ControlCycle,
    controller: Controller,
    is_over: Callable[[Reading], bool],
    *,
    kind: str,
    at_rest: bool,
    info: Mapping[str, Any] | None = None,
    watch: Watch | None = None,
    keep: Callable[[Step], None] | None = None,
    broken: Callable[[list[Step], BaseException], None] | None = None,
) -> Recorded:
    """Let ``controller`` act, turn by turn, and return all that was read and applied: the loop of every movement.

    Args:
        cycle: the control cycle of the arm.
        controller: what acts, after it was given its goal.
        is_over: told every reading before the controller; where it is, the valves are closed and that was the last.
        kind: of the sequence that is returned.
        at_rest: whether the arm stood still with closed valves before.
        info: kept with the sequence.
        watch: sees every turn as it happens ...
        keep: ... after this was given it.
        broken: given the turns that there were where the cycle breaks off, and why, before that is raised.

    """

    def decide(reading: Reading) -> Command | None:
        return None if is_over(reading) else controller.act(reading)

    if watch is not None:
        watch.begin(at_rest=at_rest)
    steps: list[Step] = []
    try:
        with closing(cycle.run(decide)) as turns:  # the valves are closed now, not when the traceback is forgotten
            for step in turns:
                if keep is not None:
                    keep(step)
                if watch is not None:
                    watch.see(step.reading, step.valves)
                steps.append(step)
    except BaseException as error:
        if broken is not None:
            broken(steps, error)
        raise
    return Recorded.from_steps(steps, cycle.arm.spec, kind=kind, at_rest=at_rest, info=info)


def warm_up_watch(watch: Watch, spec: ArmSpec) -> None:
    """Have a copy of ``watch`` see made-up readings: nothing is to be compiled while an arm waits for its valves."""
    rehearsing = copy.deepcopy(watch)
    rehearsing.begin(at_rest=True)
    closed = np.zeros((spec.joints, 2), np.int8)
    for reading in made_up_readings(spec):
        rehearsing.see(reading, closed)


def made_up_readings(spec: ArmSpec, count: int = 4) -> list[Reading]:
    """Return ``count`` readings of an arm that stands still in the middle, half full."""
    angle = np.full(spec.joints, sum(spec.angle_range) / 2)
    pressure = np.full((spec.joints, 2), spec.max_pressure_counts / 2)
    readings = [Reading(k * spec.period, angle.copy(), pressure.copy()) for k in range(count)]
    return [with_measured(reading, spec, [0.0] * len(spec.further)) for reading in readings]


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

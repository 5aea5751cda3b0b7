"""What the stages of a run leave for its report."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import Arm, ControlCycle, Reading, Step, guarded
from pneumarm.arm.valves import Command
from pneumarm.control import BEGIN, controller_of, move
from pneumarm.learning import AnyAgent, Training, goals_of
from pneumarm.moving.trial import MoveTrial
from pneumarm.report.data import Demonstration, MarkedData, MovingData, TrainingData
from pneumarm.task import Movement
from pneumarm.transitions import Store

DISPLACEMENTS = {"medium displacement": 30.0, "small displacement": 5.0, "large displacement": 70.0}
"""Movements that are shown [degrees] (thesis figures 5.17 to 5.19)."""
_TAIL = 1.0  # s recorded after a movement, in which the arm swings out

_SHOWN_GOALS = 6


def training_record(training: Training[Any]) -> TrainingData:
    """Return the curves and the validation of all learners."""
    rows = [len(curve) for curve in training.curves]
    curves = np.zeros((len(rows), max(rows, default=0), len(training.columns)))
    for learner, curve in enumerate(training.curves):
        curves[learner, : len(curve)] = curve
    return TrainingData(
        curves=curves,
        evaluated=np.array(rows, np.int64),
        reward=np.array([result.reward.mean() for result in training.validation]),
        success=np.array([result.success.mean() for result in training.validation]),
        chosen=training.best,
        columns=training.columns,
    )


def marked_record(store: Store) -> MarkedData:
    """Return which of the stored rows are marked and why, in the order of recording."""
    stages = {number: run["purpose"] for number, run in store.runs().items()}
    rows: dict[str, int] = {}  # by stage
    spans: list[tuple[int, int]] = []
    reason: list[int] = []
    reasons: dict[str, int] = {}
    begin, marks = 0, store.marks()
    for entry in store.catalogue():
        for mark in marks.get(entry.number, []):
            # A lost period leaves a gap in the steps and none in the rows: the difference cannot be seen.
            first, end = (begin + min(step, entry.rows) for step in (mark.first, mark.last + 1))
            why = reasons.setdefault(_in_short(mark.reason), len(reasons))
            if spans and reason[-1] == why and spans[-1][1] == first:
                spans[-1] = (spans[-1][0], end)
            else:
                spans.append((first, end))
                reason.append(why)
        begin += entry.rows
        rows[stages.get(entry.run or 0, entry.kind)] = begin
    return MarkedData(
        spans=np.array(spans, np.int64).reshape(-1, 2),
        reason=np.array(reason, np.int64),
        ends=np.array(list(rows.values()), np.int64),
        reasons=tuple(reasons),
        stages=tuple(rows),
    )


def moving_record(tried: MoveTrial, most: int = _SHOWN_GOALS) -> MovingData:
    """Return the first ``most`` movements of a trial, for the picture of the arm that moves."""
    shown = tried.moved[:most]
    lengths = [len(one.recorded.time) for one in shown]
    return MovingData(
        time=np.concatenate([one.recorded.time for one in shown]),
        angle=np.concatenate([one.recorded.angle for one in shown]),
        wanted=np.concatenate([np.tile(one.goal, (n, 1)) for one, n in zip(shown, lengths, strict=True)]),
        pressure=np.concatenate([one.recorded.pressure for one in shown]),
    )


def _in_short(reason: str) -> str:
    """Return the ``reason`` of a mark without what differs each time: when, and what failed."""
    return reason.split(" since ")[0].split(" here: ")[0].replace("-", " ")


def demonstrate(agent: AnyAgent, arm: Arm, seed: int) -> list[Demonstration]:
    """Make and record typical movements, with a second after each in which the arm swings out.

    The agent itself brings the arm to where a movement begins; a displacement larger than its range is left out.
    """
    cycle = ControlCycle(guarded(arm))
    random = np.random.default_rng([seed, 2])
    goals = goals_of(agent)
    low, high = goals.range.T
    shown = []

    def between(begin: NDArray[np.float64], end: NDArray[np.float64], name: str) -> Demonstration:
        BEGIN.reach(cycle.arm, random)
        _move(agent, cycle, begin)
        cycle.arm.wait(_TAIL)
        return _recorded(agent, cycle, end, name)

    for name, degrees in DISPLACEMENTS.items():
        half = degrees * arm.spec.counts_per_degree / 2
        middle = (low + high) / 2
        if (half < (high - low) / 2).all():
            ends = (goals.within(middle - half), goals.within(middle + half))
            shown.append(cycle.arm.despite_losses(partial(between, *ends, name)))
    return shown


def _move(agent: AnyAgent, cycle: ControlCycle, goal: NDArray[np.float64]) -> Movement:
    return move(cycle, controller_of(agent), goal, agent.settings, velocity=agent.window.velocity)


def _recorded(agent: AnyAgent, cycle: ControlCycle, goal: NDArray[np.float64], name: str) -> Demonstration:
    spec = cycle.arm.spec
    made = _move(agent, cycle, goal)
    tail = list(cycle.run(_closed_for(round(_TAIL / spec.period), cycle.applied)))
    recorded = made.recorded
    closed = np.zeros((len(tail), spec.joints, 2))
    return Demonstration(
        time=np.concatenate([recorded.time[:-1], _times(tail)]),
        angle=np.concatenate([recorded.angle[:-1], [step.reading.angle for step in tail]]),
        pressure=np.concatenate([recorded.pressure[:-1], [step.reading.pressure for step in tail]]),
        valves=np.concatenate([recorded.command[:-1], closed]),
        goal=goal,
        end=made.time_end if made.success else None,
        name=name,
    )


def _times(steps: list[Step]) -> NDArray[np.float64]:
    return np.array([step.reading.time for step in steps])


def _closed_for(turns: int, applied: Command) -> Callable[[Reading], NDArray[np.int8] | None]:
    left = iter(range(turns))

    def decide(reading: Reading) -> NDArray[np.int8] | None:
        return np.zeros(applied.shape, np.int8) if next(left, None) is not None else None

    return decide

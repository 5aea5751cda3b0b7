"""What the stages of a run leave for its report."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import Arm, ControlCycle, Reading, Step, guarded
from pneumarm.arm.valves import Command
from pneumarm.control import BEGIN, AgentController, move
from pneumarm.learning import AnyAgent, FleetTraining, Trained
from pneumarm.report.data import Demonstration, LearningData, MarkedData, TrainingData
from pneumarm.task import Movement
from pneumarm.transitions import Store

DISPLACEMENTS = {"medium displacement": 30.0, "small displacement": 5.0, "large displacement": 70.0}
"""Movements that are shown [degrees] (thesis figures 5.17 to 5.19)."""
_TAIL = 1.0  # s recorded after a movement, in which the arm swings out


def training_record(training: Trained) -> TrainingData | LearningData:
    """Return the curves and the validation of all agents."""
    if isinstance(training, FleetTraining):
        episodes, reward, success = training.curves.transpose(2, 0, 1)
        return LearningData(
            episodes=episodes,
            reward_learning=reward,
            success_learning=success,
            reward=np.array([result.reward.mean() for result in training.validation]),
            success=np.array([result.success.mean() for result in training.validation]),
            chosen=training.best,
        )
    longest = max(training.curves, key=len)
    agents, evaluations = len(training.curves), len(longest)
    curves = np.zeros((6, agents, evaluations))
    for agent, curve in enumerate(training.curves):
        curves[:, agent, : len(curve)] = curve.T
    return TrainingData(
        episodes=longest[:, 0],
        deviation=curves[1],
        criterion=curves[2],
        performance=curves[3],
        epsilon=curves[4],
        temperature=curves[5],
        evaluated=np.array([len(curve) for curve in training.curves]),
        reward=np.array([result.reward.mean() for result in training.validation]),
        success=np.array([result.success.mean() for result in training.validation]),
        chosen=training.best,
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


def _in_short(reason: str) -> str:
    """Return the ``reason`` of a mark without what differs each time: when, and what failed."""
    return reason.split(" since ")[0].split(" here: ")[0].replace("-", " ")


def demonstrate(agent: AnyAgent, arm: Arm, seed: int) -> list[Demonstration]:
    """Make and record typical movements, with a second after each in which the arm swings out.

    The agent itself brings the arm to where a movement begins; a displacement larger than its range is left out.
    """
    cycle = ControlCycle(guarded(arm))
    random = np.random.default_rng([seed, 2])
    low, high = agent.goal_range.T
    shown = []
    for name, degrees in DISPLACEMENTS.items():
        half = degrees * arm.spec.counts_per_degree / 2
        middle = (low + high) / 2
        if (half < (high - low) / 2).all():
            BEGIN.reach(cycle.arm, random)
            _move(agent, cycle, middle - half)
            cycle.arm.wait(_TAIL)
            shown.append(_recorded(agent, cycle, middle + half, name))
    return shown


def _move(agent: AnyAgent, cycle: ControlCycle, goal: NDArray[np.float64]) -> Movement:
    return move(cycle, AgentController(agent), goal, agent.settings, velocity=agent.window.velocity)


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

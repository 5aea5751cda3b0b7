"""Many movements of a learning agent on any arm, turn by turn: what :mod:`~.playing` does for virtual arms alone."""

from typing import Any

import numpy as np

from pneumarm.arm import Arm, BeginState, ControlCycle, guarded
from pneumarm.arm.virtual import VirtualArm
from pneumarm.control.agent import AgentController, warm_up
from pneumarm.control.movement import move
from pneumarm.control.playing import Array, Player
from pneumarm.learning.online.agent import Agent, OnlineLearner
from pneumarm.learning.online.schedule import Schedule
from pneumarm.learning.online.settings import Exploration
from pneumarm.random import random_state
from pneumarm.task.begin import draw_goal_near
from pneumarm.task.movements import Movements, of_rows


class TurnPlayer:
    """``agent`` making movements on any ``arm``, with the arguments of :class:`~.playing.Player`."""

    def __init__(
        self,
        agent: Agent,
        arm: Arm,
        learning_rate: float = 0.0,
        exploration: Exploration | None = None,
        seed: int = 0,
        begin: BeginState = BeginState(),
    ) -> None:
        self.agent, self._begin, self._cycle = agent, begin, ControlCycle(guarded(arm))
        self._learner = OnlineLearner(agent, learning_rate, exploration, seed)
        warm_up(agent, OnlineLearner(agent, learning_rate, exploration, seed))  # no arm waits for a compiler
        self._controller = AgentController(agent, self._learner)
        self._exploring = self._learner.schedule
        self._weights = np.cumsum(agent.settings.begin_weights) / np.sum(agent.settings.begin_weights)
        self._aim_random = random_state((seed, 1))
        self.performance = 0.0

    def play(self, goals: Array, durations: Array, schedule: Schedule | None = None) -> Movements:
        """Make movements, each from a begin state of its own; ends early where the schedule's demand is met."""
        self._learner.schedule = chosen = schedule or self._exploring
        rows = []
        for goal, inflate in zip(goals, durations, strict=True):
            self._reach(inflate)
            near = self._near(chosen.deviation) if chosen.deviation < np.inf else goal
            made = move(self._cycle, self._controller, near, self.agent.settings, velocity=self.agent.window.velocity)
            rows.append(made.row())
            self.performance += chosen.performance_rate * (float(made.success) - self.performance)
            if self.performance >= chosen.enough:
                break
        return of_rows(rows, self.agent.spec.joints)

    def visit(self, durations: Array) -> tuple[Array, Array]:
        """Bring the arm to rest once for each of ``durations`` (n, joints, 2) [s] and only look."""
        readings = []
        for inflate in durations:
            self._reach(inflate)
            readings.append(self._cycle.arm.read())
        return np.array([one.angle for one in readings]), np.array([one.pressure for one in readings])

    @property
    def learned(self) -> Agent:
        """The agent as it is now."""
        return self._learner.agent

    @property
    def time(self) -> float:
        """Time on the arm's clock [s]."""
        return self._cycle.arm.read().time

    def _reach(self, inflate: Array) -> None:
        self._begin.inflated(self._cycle.arm, inflate)

    def _near(self, deviation: float) -> Array:
        """Return a goal near to where the arm stands (joints,) (thesis section 4.3.3)."""
        angle = self._cycle.arm.read().angle
        goal = np.empty(len(angle))
        draw_goal_near(self.agent.goal_range, self._weights, angle, deviation, self._aim_random, goal)
        return goal


def player(agent: Agent, arm: Arm, *settings: Any, **others: Any) -> Player | TurnPlayer:
    """Return what makes movements of ``agent`` on ``arm``: the compiled loop where that can move it."""
    compiled = isinstance(arm, VirtualArm) and arm.is_plain and arm.spec.angle_limits is None
    return (Player if compiled else TurnPlayer)(agent, arm, *settings, **others)  # type: ignore[arg-type]

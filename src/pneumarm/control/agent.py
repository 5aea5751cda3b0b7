"""An agent as a controller of an arm, greedy or learning."""

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.controller import Controller
from pneumarm.arm.seam import Reading, checked
from pneumarm.arm.valves import Command, to_valves
from pneumarm.errors import UnusableInput
from pneumarm.learning import Acts, LearningActor
from pneumarm.task import StateTracker
from pneumarm.task.acting import LATE, Acting, Hurries
from pneumarm.transitions.watch import made_up_readings


class AgentController:
    """Maps readings to valves with an agent of any kind; learns if its ``actor`` does, by default the agent's own.

    ``reset(goal)`` begins a movement with the arm at rest and its valves closed; then every ``act(reading)`` gives
    the valves to set, one control period after the other. ``observe`` says what came of it: the valves as applied.
    """

    def __init__(self, agent: Acts, actor: Acting | None = None) -> None:
        self.agent = agent
        self.actor = agent.actor() if actor is None else actor
        self._learner = self.actor if isinstance(self.actor, LearningActor) else None
        self._tracker = StateTracker(agent.window, agent.scaling)
        self._goal: NDArray[np.float64] | None = None
        self._seen: float | None = None

    def reset(self, goal: NDArray[np.float64]) -> None:
        """Begin a movement to ``goal`` (joints,) [counts]."""
        goal = np.asarray(goal, np.float64).reshape(-1)
        if goal.shape != (self.agent.spec.joints,) or not np.isfinite(goal).all():
            raise UnusableInput(f"a goal needs {self.agent.spec.joints} finite angle(s) in counts, got {goal}")
        self._goal = goal
        self._seen = None
        self._tracker.reset()

    def act(self, reading: Reading) -> Command:
        """Return the valves (joints, 2) to set after ``reading``."""
        if self._goal is None:
            raise UnusableInput("call reset(goal) before act(reading)")
        if reading.time != self._seen:
            reading = checked(reading, self.agent.spec)
            state = self._tracker.reading(reading)
            if self._seen is None:
                self.actor.begin(state, self._goal)
            else:  # a reading that nobody told the actor about: nothing can be learned from the way to it
                self._hurry(reading)
                self.actor.follow(state)
            self._seen = reading.time
        chosen = self.actor.act()
        command: Command = to_valves(chosen) if chosen.ndim == 1 else chosen.astype(np.float64)
        self._tracker.commanded(command)
        return command

    def observe(self, reading: Reading, applied: Command, reward: NDArray[np.float64], terminal: bool) -> None:
        """Go on with ``reading``, to which the valves as ``applied`` led with ``reward`` (joints,); learn from it."""
        self._tracker.commanded(applied)
        state = self._tracker.reading(reading)
        self._hurry(reading)
        if self._learner is None:
            self.actor.follow(state)
        else:
            self._learner.observe(reward, state, terminal)
        self._seen = reading.time

    def _hurry(self, reading: Reading) -> None:
        """Let an actor that can be faster be so where ``reading`` comes late after the one before it."""
        period = self.agent.spec.period
        if self._seen is not None and reading.time - self._seen > LATE * period and isinstance(self.actor, Hurries):
            self.actor.hurry()


def controller_of(agent: Acts) -> Controller:
    """Return the controller with which ``agent`` acts as well as it can: its own where it has one."""
    return agent.controller() or AgentController(agent)


def warm_up(agent: Acts, actor: Acting | None = None) -> None:
    """Have a controller of ``agent`` of its own make some turns with made-up readings; an ``actor`` learns from them.

    The first turns of a kind of agent compile or load its kernels, for up to seconds; an arm that moves would have
    been vented by its dead-man by then.
    """
    controller = AgentController(agent, actor)
    controller.reset(agent.goal_range.mean(axis=1))
    first, *others = made_up_readings(agent.spec)
    valves = controller.act(first)
    for reading in others:
        controller.observe(reading, valves, np.full(agent.spec.joints, -1.0), False)
        valves = controller.act(reading)
    controller.reset(agent.goal_range.mean(axis=1))
    for reading in (first, *others):
        controller.act(reading)

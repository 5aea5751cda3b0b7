"""A single movement on an arm, turn by turn as the control cycle makes them."""

import math
from time import monotonic
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium import Space
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from pneumarm.arm import Arm, BeginState, Reading, guarded
from pneumarm.arm.cycle import missed_turns
from pneumarm.arm.valves import Command, to_valves
from pneumarm.errors import UnusableInput
from pneumarm.gym.spaces import action_space, observation_space, sensor_ranges
from pneumarm.simulation.simulation import Scaling
from pneumarm.task.settings import TaskSettings
from pneumarm.task.tally import Tally
from pneumarm.task.tracker import StateTracker, scaled_goal
from pneumarm.transitions.window import Window

Observation = NDArray[np.float32]


class ArmPointToPoint(gymnasium.Env[Observation, Any]):
    """The task of :func:`pneumarm.gym.point_to_point` on an arm.

    Between movements the arm is brought to a random begin state at rest, which takes some five seconds of its time.
    The guard's limits hold: switches are counted between valves as they are applied. Where the arm's clock goes on
    while an agent thinks, and longer than a control period, its action is replaced as the control cycle does it, by
    holding and then venting; an agent that does not come back at all is waited for with the arm vented.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - as Gymnasium wants it

    def __init__(
        self,
        arm: Arm,
        window: Window,
        scaling: Scaling,
        goals: NDArray[np.float64],
        task: TaskSettings = TaskSettings(),
        begin: BeginState = BeginState(),
    ) -> None:
        """Move ``arm`` to goals within ``goals`` (joints, 2) [counts]; it is closed with the environment."""
        self.arm = guarded(arm)
        self._fresh = self.arm.get_state()
        self._goals, self._task, self._begin = goals, task, begin
        self._tally = Tally(task, window.joints)
        self._tracker, self._scaling = StateTracker(window, scaling), scaling
        self.action_space = action_space(window.joints)
        space = observation_space(window, scaling, sensor_ranges(arm.spec, window), goals)
        self.observation_space = cast("Space[Observation]", space)
        self._low, self._high = space.low, space.high
        self._closed = np.zeros((arm.spec.joints, 2), np.int8)
        self._over = True
        self._goal = goals.mean(axis=1)
        self._reading: Reading
        self._asked = 0.0  # when the agent was last asked for an action [s]
        self._due = 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Bring the arm to a begin state; ``options={"goal": [counts]}`` chooses the goal.

        The seed decides where the arm begins and the goal. An arm that can be put into a saved state is then as it
        was when the environment was made, so that its movements repeat; no seed decides a real arm's noise.
        """
        super().reset(seed=seed)
        self.arm.watchdog.end()
        if seed is not None and self._fresh is not None:
            self.arm.set_state(self._fresh)
        low, high = self._goals.T
        goal = self.np_random.uniform(low, high)
        if options and "goal" in options:
            goal = np.asarray(options["goal"], np.float64).reshape(-1)
            if goal.shape != low.shape or not ((low <= goal) & (goal <= high)).all():
                raise UnusableInput(f"a goal needs {low.size} angle(s) in counts within {low} to {high}, got {goal}")
        self._goal = goal
        self._begin.reach(self.arm, self.np_random)
        self._reading = self.arm.read()
        self._due, self._over, self._tally = self._reading.time, False, Tally(self._task, goal.size)
        self._tracker.reset()
        observation = self._observation(self._reading)
        self._ask()
        return observation, {"goal": goal.copy()}

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Take ``action`` for a control period."""
        if self._over:
            raise ResetNeeded("the movement is over; call reset() to begin another")
        actions = np.asarray(action)
        if not self.action_space.contains(actions if actions.ndim else int(actions)):
            raise UnusableInput(f"actions must be in {self.action_space}, got {action!r}")
        self.arm.watchdog.end()
        applied = self._turn(to_valves(actions.reshape(-1)))
        self._reading = reading = self.arm.read()
        self._due += missed_turns(reading.time - self._due, self.arm.spec.period) * self.arm.spec.period
        self._tracker.commanded(applied)
        observation = self._observation(reading)
        self._tally.count(applied, reading.angle, self._tracker.velocity, self._goal)
        reached, self._over = self._tally.reached, self._tally.over
        if self._over:
            self.arm.set_valves(self._closed)
        else:
            self._ask()
        return observation, self._tally.paid, reached, self._over and not reached, {"is_success": reached}

    def _turn(self, valves: Command) -> Command:
        """Let a turn pass with ``valves`` (joints, 2); return them as applied."""
        spec = self.arm.spec
        late = self.arm.lateness(self._reading) if monotonic() - self._asked > spec.period else 0.0
        self._due += spec.period
        if spec.latency:
            self.arm.wait(spec.latency)
        if late > 1:
            self.arm.replace("late", f"{late:.1f} periods after its reading", late)
        else:
            self.arm.decide(valves)
        self.arm.wait_until(self._due)
        return self.arm.applied

    def _ask(self) -> None:
        """Have the arm looked after until the agent comes with an action: for as long as it takes."""
        self._asked = monotonic()
        self.arm.watchdog.begin(self._reading, math.inf)

    def _observation(self, reading: Reading) -> Observation:
        state = self._tracker.reading(reading)
        observed = np.concatenate([state, scaled_goal(self._goal, self._scaling)]).astype(np.float32)
        return np.clip(observed, self._low, self._high)

    def close(self) -> None:
        """Close the arm."""
        self.arm.watchdog.end()
        self.arm.close()

"""A single movement on an arm, turn by turn as the control cycle makes them."""

from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium import Space
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from pneumarm.arm import Arm, BeginState, Reading
from pneumarm.arm.valves import to_valves
from pneumarm.errors import UnusableInput
from pneumarm.gym.options import chosen_goal
from pneumarm.gym.spaces import View, action_space, numbered, observation_space, sensor_ranges
from pneumarm.gym.turns import Turns
from pneumarm.task.settings import TaskSettings
from pneumarm.task.tally import Tally
from pneumarm.task.tracker import StateTracker, scaled_goal

Observation = NDArray[np.float32]


class ArmPointToPoint(gymnasium.Env[Observation, Any]):
    """The task of :func:`pneumarm.gym.point_to_point` on an arm.

    Between movements the arm is brought to a random begin state at rest, which takes some five seconds of its time.
    The guard's limits hold: switches are counted between valves as they are applied. See
    :class:`~pneumarm.gym.turns.Turns` for an agent that is late.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - as Gymnasium wants it

    def __init__(
        self,
        arm: Arm,
        view: View,
        task: TaskSettings = TaskSettings(),
        begin: BeginState = BeginState(),
    ) -> None:
        """Move ``arm`` to goals of the ``view``; it is closed with the environment."""
        window, scaling, goals = view
        self._turns = Turns(arm, begin)
        self.arm = self._turns.arm
        self._goals, self._task = goals, task
        self._tally = Tally(task, arm.spec)
        self._tracker, self._scaling = StateTracker(window, scaling), scaling
        self.action_space = action_space(arm.spec)
        space = observation_space(window, scaling, sensor_ranges(arm.spec, window), goals)
        self.observation_space = cast("Space[Observation]", space)
        self._low, self._high = space.low, space.high
        self._over = True
        self._goal = goals.mean(axis=1)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Bring the arm to a begin state; ``options={"goal": [counts]}`` or ``{"goal_deg": [degrees]}`` is the goal.

        The seed decides where the arm begins and the goal. An arm that can be put into a saved state is then as it
        was when the environment was made, so that its movements repeat; no seed decides a real arm's noise.
        """
        chosen = chosen_goal(options, self.arm.spec, self._goals)
        super().reset(seed=seed)
        low, high = self._goals.T
        drawn = self.np_random.uniform(low, high)
        self._goal = goal = drawn if chosen is None else chosen
        reading = self._turns.begin(self.np_random, fresh=seed is not None)
        self._over, self._tally = False, Tally(self._task, self.arm.spec)
        self._tracker.reset()
        observation = self._observation(reading)
        self._turns.ask()
        return observation, {"goal": goal.copy()}

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Take ``action`` for a control period."""
        if self._over:
            raise ResetNeeded("the movement is over; call reset() to begin another")
        actions = np.asarray(action)
        if not self.action_space.contains(actions if actions.ndim else int(actions)):
            raise UnusableInput(f"actions must be in {self.action_space}, got {action!r}")
        reading, applied = self._turns.turn(to_valves(numbered(self.arm.spec)[actions.reshape(-1)]))
        self._tracker.commanded(applied)
        observation = self._observation(reading)
        self._tally.count(applied, reading.angle, self._tracker.velocity, self._goal)
        reached, self._over = self._tally.reached, self._tally.over
        if self._over:
            self._turns.rest()
        else:
            self._turns.ask()
        return observation, self._tally.paid, reached, self._over and not reached, {"is_success": reached}

    def _observation(self, reading: Reading) -> Observation:
        state = self._tracker.reading(reading)
        observed = np.concatenate([state, scaled_goal(self._goal, self._scaling)]).astype(np.float32)
        return np.clip(observed, self._low, self._high)

    def close(self) -> None:
        """Close the arm."""
        self._turns.close()

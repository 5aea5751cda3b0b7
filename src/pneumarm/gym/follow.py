"""Following a reference on an arm, holding a goal being the case of one that stays."""

from collections.abc import Mapping
from dataclasses import dataclass
from reprlib import repr as shortened
from typing import Annotated, Any, cast

import gymnasium
import numpy as np
from gymnasium import Space
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from msgspec import Meta
from numpy.typing import NDArray

from pneumarm.arm import Arm, BeginState, Reading
from pneumarm.arm.reference import Reference, constant
from pneumarm.arm.valves import Command
from pneumarm.errors import UnusableInput
from pneumarm.gym.options import known_options
from pneumarm.gym.spaces import View, following_space, sensor_ranges
from pneumarm.gym.turns import Turns
from pneumarm.learning.servo.references import draw_references
from pneumarm.learning.servo.settings import Ahead, ServoSettings
from pneumarm.settings import NonNegativeFloat, Settings
from pneumarm.task.changes import changes
from pneumarm.task.goals import goal_in_counts
from pneumarm.task.reference import FORMS, check_reachable, parse_reference
from pneumarm.task.tracker import StateTracker, scaled_goal
from pneumarm.transitions.window import QUANTITIES

Observation = NDArray[np.float32]

_FASTEST = 4.0
"""Highest speed of a drawn reference, in scaled velocities, as a servo learns from."""


@dataclass(frozen=True)
class FollowSettings(Settings):
    """What is asked in an episode of following."""

    seconds: Annotated[float, Meta(gt=0, le=3600)] = 5.0
    """Length of an episode [s]."""
    tolerance: Annotated[float, Meta(gt=0, lt=360)] = 1.0
    """What an error is measured in [degrees]."""
    change: NonNegativeFloat = 0.05
    """Price of a valve change."""
    preview: tuple[Ahead, ...] = ServoSettings().preview
    """How far ahead the reference is seen [s]."""


class ArmFollow(gymnasium.Env[Observation, NDArray[np.float32]]):
    """The task of :func:`pneumarm.gym.follow` on an arm.

    Args:
        arm: is closed with the environment.
        view: its goals are where references are drawn and to which they are held.
        reference: what is to be followed; drawn anew for every episode where it is None.
        settings: what is asked.
        begin: how the arm is brought to where an episode begins.

    """

    metadata = {"render_modes": []}  # noqa: RUF012 - as Gymnasium wants it

    def __init__(
        self,
        arm: Arm,
        view: View,
        reference: str | Reference | None = None,
        settings: FollowSettings = FollowSettings(),
        begin: BeginState = BeginState(),
    ) -> None:
        window, scaling, goals = view
        self._spec, self._goals, self._scaling = arm.spec, goals, scaling
        self._steps = max(1, round(settings.seconds / arm.spec.period))
        ahead = {max(1, round(seconds / arm.spec.period)) for seconds in settings.preview}
        self._ahead = np.array([0, *sorted(ahead)])
        self._given = self._checked(reference)
        self._tolerance, self._change = settings.tolerance * arm.spec.counts_per_degree, settings.change
        self._turns = Turns(arm, begin)
        self.arm = self._turns.arm
        self._tracker = StateTracker(window, scaling)
        self.action_space = Box(-1.0, 1.0, (arm.spec.muscles * window.joints,), np.float32)
        space = following_space(window, scaling, sensor_ranges(arm.spec, window), len(self._ahead))
        self.observation_space = cast("Space[Observation]", space)
        self._low, self._high = space.low, space.high
        self._reference = constant(goals.mean(axis=1))
        self._step, self._over = 0, True
        self._begun = 0.0
        self._applied: Command = np.zeros((arm.spec.joints, 2))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Bring the arm to a begin state and begin a reference.

        ``options={"reference": "sine:0.5Hz,20deg"}`` or ``{"goal_deg": 20}`` chooses it for this episode. The seed
        decides where the arm begins and what is drawn. An arm that can be put into a saved state is then as it was
        when the environment was made.
        """
        super().reset(seed=seed)
        chosen = self._chosen(known_options(options, "goal_deg", "reference"))
        reading = self._turns.begin(self.np_random, fresh=seed is not None)
        self._reference = chosen or self._given or self._drawn(reading)
        self._step, self._over, self._begun = 0, False, reading.time
        self._applied = np.zeros_like(self._applied)
        self._tracker.reset()
        observation = self._observation(reading)
        self._turns.ask()
        return observation, self._info(reading, 0)

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Open the valves for the shares of a control period that ``action`` (muscles,) says."""
        if self._over:
            raise ResetNeeded("the episode is over; call reset() to begin another")
        pulses = np.asarray(action, np.float64)
        muscles = self._spec.muscles
        if pulses.shape != (muscles * self._spec.joints,) or not (np.abs(pulses) <= 1).all():
            raise UnusableInput(f"an action needs {muscles * self._spec.joints} shares of -1 to 1, got {action!r}")
        both = np.zeros((self._spec.joints, 2))
        both[:, :muscles] = pulses.reshape(-1, muscles)
        reading, applied = self._turns.turn(both)
        changed = int(changes(applied, self._applied).sum())
        self._applied = applied
        self._tracker.commanded(applied)
        self._step += 1
        self._over = self._step >= self._steps
        observation = self._observation(reading)
        if self._over:
            self._turns.rest()
        else:
            self._turns.ask()
        off = np.abs(reading.angle - self._wanted(reading, 0))
        reward = -float(off.mean()) / self._tolerance - self._change * changed
        return observation, reward, False, self._over, self._info(reading, changed)

    def close(self) -> None:
        """Close the arm."""
        self._turns.close()

    def _chosen(self, options: Mapping[str, Any]) -> Reference | None:
        if len(options) > 1:
            raise UnusableInput("options= takes one of goal_deg and reference, got both")
        if "goal_deg" in options:
            return constant(goal_in_counts(None, options["goal_deg"], self._spec, self._goals))
        return self._checked(options.get("reference"))

    def _checked(self, reference: str | Reference | None) -> Reference | None:
        if reference is None:
            return None
        found = parse_reference(reference, self._spec) if isinstance(reference, str) else reference
        if not isinstance(found, Reference):
            raise UnusableInput(f"reference {shortened(found)}: expected a Reference, or the name of one: {FORMS}")
        check_reachable(found, self._steps * self._spec.period, self._goals, self._spec)
        return found

    def _drawn(self, reading: Reading) -> Reference:
        """Return a reference as a servo learns from, which begins where the arm is or elsewhere."""
        period, joints = self._spec.period, self._spec.joints
        speed = self._scaling.observation_scale[1 : joints * len(QUANTITIES) : len(QUANTITIES)]
        steps = self._steps + int(self._ahead.max()) + 2
        angle = reading.angle[:, None]
        angles = draw_references(self.np_random, self._goals, angle, steps, self._spec, _FASTEST * 1e3 * speed)[
            ..., 0
        ]

        def at(time: float) -> NDArray[np.float64]:
            place = min(max(time / period, 0.0), steps - 1.001)
            before = int(place)
            return angles[before] + (place - before) * (angles[before + 1] - angles[before])

        return Reference(at)

    def _wanted(self, reading: Reading, ahead: int) -> NDArray[np.float64]:
        return self._reference.at(reading.time - self._begun + ahead * self._spec.period)

    def _observation(self, reading: Reading) -> Observation:
        state = self._tracker.reading(reading)
        wanted = np.array([self._wanted(reading, int(ahead)) for ahead in self._ahead])
        away = scaled_goal(wanted, self._scaling) - scaled_goal(reading.angle, self._scaling)
        observed = np.concatenate([state, away.ravel()]).astype(np.float32)
        return np.clip(observed, self._low, self._high)

    def _info(self, reading: Reading, changed: int) -> dict[str, Any]:
        wanted = self._wanted(reading, 0)
        return {
            "angle_deg": self._spec.degrees(reading.angle),
            "wanted_deg": self._spec.degrees(wanted),
            "error_deg": (reading.angle - wanted) / self._spec.counts_per_degree,
            "valve_changes": changed,
        }

"""A servo that has learned nothing but the simulation: it plans in it, every turn anew, to settle, hold and track.

Model predictive control (:mod:`pneumarm.learning.servo.predictive`); at rest near a goal it does as a servo with a
policy does. Its file is that of its simulation, and it does not learn on an arm.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from pneumarm.learning.agents import SimulationAgent
from pneumarm.learning.planned.agent import simulation_of_valves
from pneumarm.learning.servo import ServoSettings
from pneumarm.learning.servo.controller import ServoController, ready_controller
from pneumarm.learning.servo.gradient import ServoTask
from pneumarm.learning.servo.predictive import PredictiveControl
from pneumarm.learning.servo.task import servo_task


@dataclass(frozen=True, repr=False)
class PlannedServo(SimulationAgent):
    """A simulation that is planned in."""

    settles = True
    settings: ServoSettings = field(default_factory=lambda: ServoSettings(coarse=0.0))
    """Tolerances and prices."""

    @property
    def task(self) -> ServoTask:
        """What it does, for kernels."""
        return servo_task(self.simulation, self.settings)

    def actor(self) -> None:
        """Return no policy."""

    def predictive(self) -> PredictiveControl:
        """Return what plans."""
        return PredictiveControl(self.simulation, self.task, self.settings.planned)

    def controller(self) -> ServoController:
        """Return it as a controller of an arm; all that it needs is compiled."""
        return ready_controller(self)

    @classmethod
    def load(cls, path: Path) -> Self:
        """Return the servo that plans in the simulation in ``path``.

        Raises:
            UnusableInput: ``path`` is no simulation, or one of continuous commands.

        """
        return cls(simulation_of_valves(path))

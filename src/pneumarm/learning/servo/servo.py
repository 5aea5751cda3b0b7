"""What moves an arm that settles, holds and follows: a policy, plans, or both."""

from typing import Protocol

from pneumarm.learning.agents import OfAnArm
from pneumarm.learning.servo.actor import ServoActor
from pneumarm.learning.servo.gradient import ServoTask
from pneumarm.learning.servo.predictive import PredictiveControl
from pneumarm.learning.servo.settings import ServoSettings
from pneumarm.simulation.simulation import Simulation


class Servo(OfAnArm, Protocol):
    """What moves an arm by a :class:`ServoController`: a policy, plans, or both."""

    @property
    def simulation(self) -> Simulation:
        """Of its arm."""

    @property
    def settings(self) -> ServoSettings:
        """Tolerances and prices."""

    @property
    def task(self) -> ServoTask:
        """The same, for kernels."""

    def actor(self) -> ServoActor | None:
        """Return its policy, if it has one."""

    def predictive(self) -> PredictiveControl | None:
        """Return what plans, if it is to."""

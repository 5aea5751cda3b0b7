"""A servo: a policy over pulses that follows references, learned by the gradient through the simulation."""

from pneumarm.learning.servo.agent import ServoAgent, train_servo
from pneumarm.learning.servo.settings import ServoSettings

__all__ = ["ServoAgent", "ServoSettings", "train_servo"]

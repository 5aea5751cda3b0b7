"""A servo: a policy over pulses that follows references, learned by the gradient through the simulation."""

from pneumarm.learning.servo.agent import ServoAgent
from pneumarm.learning.servo.settings import ServoSettings
from pneumarm.learning.servo.training import train_servo

__all__ = ["ServoAgent", "ServoSettings", "train_servo"]

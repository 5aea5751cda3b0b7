"""The values that thesis section 4.2 describes, beside those that it tried: rules, approximators and policies.

pneumarm train arm.sim arm.db --out arm.agent --method q-lambda --own.approximator tiles --own.policy boltzmann
"""

from pneumarm.learning.method import Method
from pneumarm.learning.values.agent import SETTINGS, ValueActor, ValueAgent
from pneumarm.learning.values.settings import ValueSettings
from pneumarm.learning.values.training import train_values

__all__ = ["VALUES", "ValueActor", "ValueAgent", "ValueSettings", "train_values"]

VALUES = {name: Method(settings, train_values, ValueAgent.load) for name, settings in SETTINGS.items()}
"""A method a rule, by their names."""

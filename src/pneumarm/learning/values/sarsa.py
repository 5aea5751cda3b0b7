"""SARSA(lambda): values of actions under the policy that is followed (section 4.2.4, eq. 4.9; 4.2.5).

    choose a in s by the policy
    repeat: take a, see r and s'; choose a' in s' by the policy
        delta = r + gamma Q(s', a') - Q(s, a)
        e(s, a) = e(s, a) + 1, or 1
        Q = Q + beta delta e;  e = gamma lambda e;  s, a = s', a'
    until s' is a goal or the episode is cut off

Source: Sutton and Barto, Reinforcement Learning, section 12.7.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

from pneumarm.kernels import part
from pneumarm.learning.values.settings import ValueSettings
from pneumarm.settings import PythonOnly


@dataclass(frozen=True)
class SarsaSettings(ValueSettings):
    """SARSA(lambda)."""

    rule: Annotated[Literal["sarsa-lambda"], PythonOnly] = "sarsa-lambda"
    """Its name."""


@part
def look_ahead_sarsa(values, chosen):  # type: ignore[no-untyped-def]
    """Return the value of the action that was chosen next, by the ``values`` (choices,) of all."""
    return float(values[chosen]), False

"""Actor and critic: a policy that is stored apart from the values of states (section 4.2.4, eq. 4.11).

    choose a in s with the probability pi(a | s) = exp(p(s, a) / T) / sum_b exp(p(s, b) / T)
    repeat: take a, see r and s'
        delta = r + gamma V(s') - V(s)                                              the critic's error (eq. 4.11)
        V = V + beta delta e;        e = gamma lambda e after adding grad V(s)
        p = p + beta' delta e';      e' likewise, after adding grad log pi(a | s) T;  s = s'
    until s' is a goal or the episode is cut off

Source: Sutton and Barto, Reinforcement Learning, section 13.5. What a switch costs is known, and so is part of p.
"""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from pneumarm.kernels import kernel
from pneumarm.learning.online.settings import FirstExploration, Shaping
from pneumarm.learning.values.approximators.function import add_trace, follow
from pneumarm.learning.values.settings import Approximator, ValueSettings
from pneumarm.settings import PythonOnly


def _one_temperature() -> Shaping:
    return Shaping(exploration=FirstExploration(temperature=1.0))


@dataclass(frozen=True)
class ActorCriticSettings(ValueSettings):
    """Actor and critic; they explore at one temperature, which the preferences grow with."""

    rule: Annotated[Literal["actor-critic"], PythonOnly] = "actor-critic"
    """Its name."""
    approximator: Approximator = "tiles"
    """What holds preferences and values; all preferences have traces, so one with few active features."""
    policy: Annotated[Literal["boltzmann"], PythonOnly] = "boltzmann"
    """The actor is one."""
    traces: Annotated[Literal["accumulating"], PythonOnly] = "accumulating"
    """Traces of a policy are of both signs."""
    shaping: Annotated[Shaping | None, PythonOnly] = field(default_factory=_one_temperature)
    """Shaping, or None: then all begin states from the first episode on."""


@kernel
def move_actor(actor, agent, z, chosen, odds, delta, rate, decay):  # type: ignore[no-untyped-def]
    """Make what ``agent`` has ``chosen`` in ``z``, which it looks at, likelier by the critic's error ``delta``.

    ``odds`` (choices,) are the probabilities with which it chose.
    """
    for action in range(odds.shape[0]):
        add_trace(actor, agent, z, action, (1.0 if action == chosen else 0.0) - odds[action])
    follow(actor, agent, delta, rate, decay)

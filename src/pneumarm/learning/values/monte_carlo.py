"""Monte Carlo: values of actions as the mean of the returns that followed them (section 4.2.3).

    make an episode by the policy: s_0, a_0, r_1, s_1, a_1, ...
    R = 0 at a goal; where the episode was cut off, the value of what would have been done next
    for its steps, the last first:
        R = r_{k+1} + gamma R                                                                         (eq. 4.1)
        Q(s_k, a_k) = Q(s_k, a_k) + beta (R - Q(s_k, a_k))         beta constant or 1/k: the sample average

Every visit counts. Source: Sutton and Barto, Reinforcement Learning, sections 5.1 and 5.4.
"""

from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import kernel, part
from pneumarm.learning.online.values import td_target
from pneumarm.learning.values.approximators.function import update
from pneumarm.learning.values.settings import ValueSettings
from pneumarm.settings import PythonOnly, Share


@dataclass(frozen=True)
class MonteCarloSettings(ValueSettings):
    """Monte Carlo."""

    rule: Annotated[Literal["monte-carlo"], PythonOnly] = "monte-carlo"
    """Its name."""
    trace_decay: Annotated[Share, PythonOnly] = 0.0
    """Returns need no traces."""


class Path(NamedTuple):
    """The steps of the episode that is going on. Made by :func:`path`."""

    seen: NDArray[np.float32]
    """What each agent saw, shape (steps, agents, variables)."""
    chosen: NDArray[np.int64]
    """Shape (steps, agents)."""
    reward: NDArray[np.float64]
    """Shape (steps, agents)."""
    length: NDArray[np.int64]
    """Steps so far, shape (1,)."""


def path(steps: int, agents: int, variables: int) -> Path:
    """Return room for the ``steps`` of an episode."""
    return Path(
        seen=np.zeros((steps, agents, variables), np.float32),
        chosen=np.zeros((steps, agents), np.int64),
        reward=np.zeros((steps, agents)),
        length=np.zeros(1, np.int64),
    )


@part
def note_step(path, agent, z, chosen, reward):  # type: ignore[no-untyped-def]
    """Write what ``agent`` saw, chose, and was paid for it."""
    k = path.length[0]
    for i in range(z.shape[0]):
        path.seen[k, agent, i] = z[i]
    path.chosen[k, agent], path.reward[k, agent] = chosen, reward


@kernel
def learn_path(function, path, rate, discount, following):  # type: ignore[no-untyped-def]
    """Learn from a whole episode and forget it; ``following`` (agents,) is what its end is worth."""
    for agent in range(following.shape[0]):
        later = following[agent]
        for back in range(path.length[0]):
            k = path.length[0] - 1 - back
            later = td_target(path.reward[k, agent], discount, later, False)
            update(function, agent, path.seen[k, agent], path.chosen[k, agent], later, rate, 0.0)
    path.length[0] = 0

"""TD(0): values of states, and a look one step ahead through the simulation (sections 4.2.2, 4.2.3, Algorithm 1).

    repeat: foresee for each action a the reward r_a and the state s_a
        choose a by the policy from r_a + gamma V(s_a); take it, see r and s'
        V(s) = V(s) + beta (r + gamma V(s') - V(s));  s = s'
    until s' is a goal or the episode is cut off

A model makes V suffice (section 4.2.2); it is the simulation, without noise. The state holds the action before it,
as a switch is paid for. Of several joints each foresees what its own action does while the others stay as they are.
Traces make it TD(lambda). Source: Sutton and Barto, Reinforcement Learning, sections 6.1 and 6.8.
"""

from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import CLOSED
from pneumarm.kernels import kernel, part
from pneumarm.learning.online.values import td_target
from pneumarm.learning.values.approximators.coding import NETWORK
from pneumarm.learning.values.approximators.function import look, value
from pneumarm.learning.values.settings import Approximator, ValueSettings
from pneumarm.learning.values.view import see
from pneumarm.random import random_state
from pneumarm.settings import PythonOnly, Share
from pneumarm.simulation.noise import NoiseSettings, noise_parameters
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import Environment, Episode, environment, episode, take
from pneumarm.task.reward import paid
from pneumarm.task.settings import TaskSettings


@dataclass(frozen=True)
class TdSettings(ValueSettings):
    """TD(0)."""

    rule: Annotated[Literal["td"], PythonOnly] = "td"
    """Its name."""
    approximator: Approximator = "tiles"
    """What holds the values; it is asked for those of nine states in every step, so a fast one."""
    trace_decay: Share = 0.0
    """lambda of the eligibility traces (thesis: 0)."""


class Foreseen(NamedTuple):
    """The arm as it is foreseen. Made by :func:`model_of`."""

    environment: Environment
    episode: Episode
    """What is foreseen."""
    actions: NDArray[np.int64]
    """Workspace, shape (joints,)."""


def model_of(simulation: Simulation, settings: TaskSettings) -> Foreseen:
    """Return ``simulation`` without noise as a model of the arm."""
    window = simulation.window
    none = BeginStates(window, np.zeros((0, window.state_size), np.float32), np.zeros((0, window.joints)))
    quiet = environment(simulation, none, settings)._replace(
        noise=noise_parameters(NoiseSettings(kind="none"), simulation)
    )
    return Foreseen(quiet, episode(quiet, random_state(0)), np.zeros(window.joints, np.int64))


@part
def row_of(function, before):  # type: ignore[no-untyped-def]
    """Return which output values a state that the action ``before`` led to, -1 for none; networks see it anyway."""
    return 0 if function.coding.kind == NETWORK or function.weights.shape[1] == 1 else before + 1


@kernel
def foresee(model, x, before, joint, action):  # type: ignore[no-untyped-def]
    """Let ``joint`` take an ``action`` in ``x``, others as ``before`` (joints,); return whether all arrive."""
    task, one, actions = model.environment.task, model.episode, model.actions
    for i in range(x.shape[0]):
        one.state.x[i] = x[i]
    for j in range(actions.shape[0]):
        one.goal[j] = task.unit[j, 0] + task.unit[j, 1] * x[task.layout.goal + j]
        one.actions[j] = before[j]
        actions[j] = before[j] if before[j] >= 0 else CLOSED
    actions[joint] = action
    return take(model.environment, one, actions)


@kernel
def foresee_values(about, joint, x, before, z, values):  # type: ignore[no-untyped-def]
    """Set ``values`` (choices,) to r + gamma V(s') of each action in the state ``x``; ``z`` is workspace.

    ``about`` are the model, what is seen of its states, the function V, and gamma.
    """
    model, variables, function, discount = about
    for action in range(values.shape[0]):
        is_reached = foresee(model, x, before, joint, action)
        reward = paid(model.environment.task.reward, is_reached, model.episode.switched[joint])
        next_value = 0.0
        if not is_reached:
            see(variables, joint, model.episode.state.x, z)
            look(function, joint, z)
            next_value = value(function, joint, row_of(function, action))
        values[action] = np.float32(td_target(reward, discount, next_value, is_reached))

"""What a network sees of an arm: its state, the goal, and how far that is, squashed coarsely and finely."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import inner
from pneumarm.networks.tansig import tansig
from pneumarm.simulation.layout import Layout, angle_at, layout_of
from pneumarm.simulation.simulation import Scaling
from pneumarm.transitions.window import Window


class InputParameters(NamedTuple):
    """Where a network's inputs come from. Made by :func:`input_parameters`.

    The rows are sigma, the goals, tansig(gain (goal - angle)) for every joint and gain, and a last one that is 1
    before the first action of an episode and 0 after it (the first is no switch).
    """

    gain: NDArray[np.float32]
    """Shape (joints, squashes) [by scaled angle]."""
    layout: Layout


def input_parameters(window: Window, scaling: Scaling, squash: tuple[float, ...]) -> InputParameters:
    """Return the inputs for an arm; ``squash`` are the errors at which tansig bends [counts]."""
    scale = window.of_joints(scaling.observation_scale)[:, :1]
    gain = np.ascontiguousarray(scale / np.array(squash), np.float32)
    return InputParameters(gain, layout_of(window))


def policy_input_size(window: Window, squash: tuple[float, ...]) -> int:
    """Return the number of inputs."""
    return window.state_size + window.joints * (1 + len(squash)) + 1


@inner
def write_policy_inputs(inputs, x, actions, rows):  # type: ignore[no-untyped-def]
    """Set ``rows`` (input_size, n) for the states ``x`` (inputs, n) after the last ``actions`` (n, joints)."""
    joints, n = actions.shape[1], actions.shape[0]
    row = inputs.layout.command
    for i in range(row):
        for e in range(n):
            rows[i, e] = x[i, e]
    for joint in range(joints):
        goal = x[inputs.layout.goal + joint]
        for e in range(n):
            rows[row, e] = goal[e]
        row += 1
    for joint in range(joints):
        angle, goal = x[angle_at(inputs.layout, 0, joint)], x[inputs.layout.goal + joint]
        for squash in range(inputs.gain.shape[1]):
            gain = inputs.gain[joint, squash]
            for e in range(n):
                rows[row, e] = gain * (goal[e] - angle[e])
            tansig(rows[row])
            row += 1
    for e in range(n):
        rows[row, e] = np.float32(1.0) if actions[e, 0] < 0 else np.float32(0.0)

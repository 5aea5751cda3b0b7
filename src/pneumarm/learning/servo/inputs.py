"""What a servo sees: the state window in natural units, and how far the reference is from where the joint is.

Of every joint, theta being scaled angles and r_p the reference p steps ahead,

    theta_k,  (theta_k - theta_{k-l}) R,  pressures and their last change,  the commands of the window,
    d_p = (r_p - theta_k) S,  tanh(d_p / 6),  tanh(d_p / 1.2)

with R from scaled angle to scaled velocity and S from scaled angle to tolerances.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import inner, kernel
from pneumarm.networks.tansig import FASTMATH, tansig
from pneumarm.simulation.layout import Layout, angle_at, command_at, layout_of, pressure_at
from pneumarm.simulation.simulation import Simulation

PRESSURE_CHANGE = np.float32(5.0)  # the pressures of a period differ by a fifth of what they differ by in all
FAR = np.float32(0.05)  # tolerances to an input of the usual size
BENDS = np.array([1 / 6, 1 / 1.2], np.float32)
"""Tolerances to inputs that bend, coarsely and finely."""


class SeenParameters(NamedTuple):
    """What the inputs are made by. Made by :func:`seen_parameters`."""

    rate: NDArray[np.float32]
    """R, shape (joints,)."""
    tolerances: NDArray[np.float32]
    """S, shape (joints,)."""
    steps: NDArray[np.int64]
    """Steps ahead at which the reference is looked at, shape (previews,)."""
    layout: Layout


def seen_parameters(simulation: Simulation, preview: tuple[float, ...], tolerance: float) -> SeenParameters:
    """Return the parameters for looking ``preview`` [s] ahead, with a ``tolerance`` in degrees."""
    window, scaling, spec = simulation.window, simulation.scaling, simulation.spec
    scale = window.of_joints(scaling.observation_scale)
    steps = sorted({max(1, round(ahead / spec.period)) for ahead in preview})
    return SeenParameters(
        rate=(scale[:, 0] / (1e3 * spec.period * scale[:, 1])).astype(np.float32),
        tolerances=(scale[:, 0] / (spec.counts_per_degree * tolerance)).astype(np.float32),
        steps=np.array(steps, np.int64),
        layout=layout_of(window),
    )


def input_size(parameters: SeenParameters) -> int:
    """Return how many inputs there are."""
    joints, history, remembered = parameters.rate.size, parameters.layout.history, parameters.layout.remembered
    return joints * (1 + (history - 1) + 4 + 2 * (history - 1) + remembered + 3 * parameters.steps.size)


@kernel(fastmath=FASTMATH)
def write_inputs(parameters, x, noise, now, preview, inputs):  # type: ignore[no-untyped-def]
    """Set ``inputs`` (inputs, n) to what is seen of the states ``x`` (size, n).

    ``noise`` (steps, 3 joints, n) is that of readings of angle and pressures, scaled, the newest being the one
    number ``now``; ``preview`` (previews, joints, n) are scaled references.
    """
    layout, n = parameters.layout, x.shape[1]
    joints, history = layout.joints, layout.history
    row = 0
    for joint in range(joints):
        angle, seen = angle_at(layout, 0, joint), 3 * joint
        for e in range(n):
            inputs[row, e] = x[angle, e] + noise[now, seen, e]
        row += 1
        for lag in range(1, history):
            rate, then = parameters.rate[joint] / np.float32(lag), angle_at(layout, lag, joint)
            for e in range(n):
                moved = x[angle, e] + noise[now, seen, e] - x[then, e] - noise[now - lag, seen, e]
                inputs[row, e] = moved * rate
            row += 1
        for muscle in range(2):
            place, read = pressure_at(layout, 0, joint, muscle), seen + 1 + muscle
            earlier = pressure_at(layout, 1, joint, muscle)
            for e in range(n):
                pressure = x[place, e] + noise[now, read, e]
                inputs[row, e] = pressure
                before = x[earlier, e] + noise[now - 1, read, e] if history > 1 else pressure
                inputs[row + 1, e] = (pressure - before) * PRESSURE_CHANGE
            row += 2
    for i in range(command_at(layout, 1), layout.command):
        for e in range(n):
            inputs[row, e] = x[i, e]
        row += 1
    for joint in range(joints):
        scale, angle = parameters.tolerances[joint], angle_at(layout, 0, joint)
        for p in range(preview.shape[0]):
            for e in range(n):
                here = x[angle, e] + noise[now, 3 * joint, e]
                distance = (preview[p, joint, e] - here) * scale
                inputs[row, e] = distance * FAR
                inputs[row + 1, e] = distance * BENDS[0]
                inputs[row + 2, e] = distance * BENDS[1]
            tansig(inputs[row + 1])
            tansig(inputs[row + 2])
            row += 3


@inner(fastmath=FASTMATH)
def inputs_back(parameters, inputs, slopes, x_slopes):  # type: ignore[no-untyped-def]
    """Add to ``x_slopes`` (size, n) the derivatives by states, ``slopes`` (inputs, n) being those by inputs."""
    layout, n = parameters.layout, inputs.shape[1]
    joints, history = layout.joints, layout.history
    row = 0
    for joint in range(joints):
        angle = angle_at(layout, 0, joint)
        for e in range(n):
            x_slopes[angle, e] += slopes[row, e]
        row += 1
        for lag in range(1, history):
            rate, then = parameters.rate[joint] / np.float32(lag), angle_at(layout, lag, joint)
            for e in range(n):
                x_slopes[angle, e] += slopes[row, e] * rate
                x_slopes[then, e] -= slopes[row, e] * rate
            row += 1
        for muscle in range(2):
            place, earlier = pressure_at(layout, 0, joint, muscle), pressure_at(layout, 1, joint, muscle)
            for e in range(n):
                x_slopes[place, e] += slopes[row, e]
                if history > 1:
                    x_slopes[place, e] += slopes[row + 1, e] * PRESSURE_CHANGE
                    x_slopes[earlier, e] -= slopes[row + 1, e] * PRESSURE_CHANGE
            row += 2
    for i in range(command_at(layout, 1), layout.command):
        for e in range(n):
            x_slopes[i, e] += slopes[row, e]
        row += 1
    for joint in range(joints):
        scale, angle = parameters.tolerances[joint], angle_at(layout, 0, joint)
        for _ in range(parameters.steps.shape[0]):
            for e in range(n):
                total = slopes[row, e] * FAR
                for b in range(2):
                    bent = inputs[row + 1 + b, e]
                    total += slopes[row + 1 + b, e] * BENDS[b] * (np.float32(1.0) - bent * bent)
                x_slopes[angle, e] -= total * scale
            row += 3

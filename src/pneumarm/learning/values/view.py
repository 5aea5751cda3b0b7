"""What of the state of the arm an approximator sees, scaled to lie between 0 and 1.

Cells are of one size, but near a goal it takes finer ones than far from it. So the distance from the goal and the
velocity, d, are seen as (1 + d / (c + |d|)) / 2: half of what is seen lies within c, and no range has to be known.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import kernel
from pneumarm.learning.values.settings import ValueSettings
from pneumarm.simulation.layout import layout_of
from pneumarm.simulation.simulation import Simulation
from pneumarm.transitions.window import QUANTITIES

_NEAR = {"error": 4.0, "velocity": 2.0}
"""c, in tolerances of the goal."""


class Seen(NamedTuple):
    """Where the variables are in a state vector ``x`` and what they are scaled by. Made by :func:`view_of`."""

    place: NDArray[np.int64]
    """Shape (agents, variables); (agents, 0) for the whole state."""
    minus: NDArray[np.int64]
    """Place of what is subtracted, or -1, same shape."""
    low: NDArray[np.float64]
    """What is seen as 0; where ``is_squashed`` what is seen as 1/2, same shape [scaled]."""
    range: NDArray[np.float64]
    """What is seen as 1 less that; where ``is_squashed`` c, same shape [scaled]."""
    is_squashed: NDArray[np.bool_]
    """Shape (variables,)."""


def whole_view(agents: int) -> Seen:
    """Return the view of all of the state, unscaled."""
    none = np.zeros((agents, 0), np.int64)
    return Seen(none, none, np.zeros((agents, 0)), np.zeros((agents, 0)), np.zeros(0, np.bool_))


def view_of(simulation: Simulation, settings: ValueSettings) -> Seen:
    """Return what each joint's agent sees in ``simulation``."""
    window, scaling, layout = simulation.window, simulation.scaling, layout_of(simulation.window)
    if settings.approximator in {"network", "networks"}:
        return whole_view(window.joints)
    offset, scale = window.of_joints(scaling.observation_offset), window.of_joints(scaling.observation_scale)
    limits = window.of_joints(simulation.limits)
    reward = settings.reward.on(simulation.spec)
    near = {"error": reward.angle_tolerance, "velocity": reward.velocity_tolerance}
    shape = window.joints, len(settings.variables)
    place, minus = np.zeros(shape, np.int64), np.full(shape, -1)
    low, range_ = np.zeros(shape), np.ones(shape)
    for joint in range(window.joints):
        for i, name in enumerate(settings.variables):
            quantity = 0 if name == "error" else QUANTITIES.index(name)
            place[joint, i] = len(QUANTITIES) * joint + quantity
            middle, unit = offset[joint, quantity], scale[joint, quantity]
            if name == "error":
                place[joint, i], minus[joint, i] = layout.goal + joint, place[joint, i]
            elif name == "velocity":
                low[joint, i] = -middle / unit
            else:
                low[joint, i], high = (limits[:, joint, quantity] - middle) / unit
                range_[joint, i] = high - low[joint, i]
            if name in near:
                range_[joint, i] = _NEAR[name] * near[name] / unit
    return Seen(place, minus, low, range_, np.array([name in near for name in settings.variables]))


@kernel
def see(view, agent, x, z):  # type: ignore[no-untyped-def]
    """Set ``z`` (variables,) to what ``agent`` sees in the state vector ``x``."""
    if view.is_squashed.shape[0] == 0:
        for i in range(z.shape[0]):
            z[i] = x[i]
        return
    for i in range(z.shape[0]):
        seen = float(x[view.place[agent, i]])
        if view.minus[agent, i] >= 0:
            seen -= x[view.minus[agent, i]]
        seen -= view.low[agent, i]
        if view.is_squashed[i]:
            seen = 0.5 + 0.5 * seen / (view.range[agent, i] + abs(seen))
        else:
            seen /= view.range[agent, i]
        z[i] = np.float32(min(max(seen, 0.0), 1.0))

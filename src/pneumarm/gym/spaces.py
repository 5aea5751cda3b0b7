"""Spaces of observations and actions: the state window of thesis eq. 4.12, scaled, and the actions of every joint."""

from typing import NamedTuple

import numpy as np
from gymnasium.spaces import Box, Discrete, MultiDiscrete
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.arm.valves import possible_actions
from pneumarm.simulation.simulation import Scaling
from pneumarm.task.tracker import scaled_goal
from pneumarm.transitions.window import QUANTITIES, Window

Array = NDArray[np.float64]

_PRESSURE_MARGIN = 2.0  # a closed muscle that is moved reads over the limit, but not twice as much
_TYPICAL_SPEED = 5.0  # counts/ms; twice the standard deviation of an arm that is moved at random
_ROUNDING = 1e-3  # of the scaled unit; observations are float32
_EDGE = 0.1  # of the angle's range, on either side, where no goals lie on an arm of which nothing is recorded


class View(NamedTuple):
    """How an agent sees an arm, and where it is sent. Made by :func:`nominal_view`, or of a simulation."""

    window: Window
    """Which readings and commands are in a state."""
    scaling: Scaling
    """Of the state."""
    goals: Array
    """Lowest and highest, shape (joints, 2) [counts]."""


def action_space(spec: ArmSpec) -> Discrete | MultiDiscrete:
    """Return the valve settings of each joint: nine, or three where it has one muscle."""
    count = len(numbered(spec))
    return Discrete(count) if spec.joints == 1 else MultiDiscrete([count] * spec.joints)


def numbered(spec: ArmSpec) -> NDArray[np.int64]:
    """Return the actions 0..8 of a joint that the numbers of its action space stand for."""
    return np.flatnonzero(possible_actions(spec.muscles))


def nominal_view(spec: ArmSpec) -> View:
    """Return a view by the sensors' ranges, for an arm of which nothing is recorded."""
    return View(Window(spec.joints), nominal_scaling(spec), nominal_goals(spec))


def nominal_scaling(spec: ArmSpec) -> Scaling:
    """Return a scaling by the sensors' ranges, for an arm of which nothing is recorded."""
    low, high = spec.angle_range
    pressure = spec.max_pressure_counts / 2
    offset, scale = (
        [(low + high) / 2, 0.0, pressure, pressure],
        [(high - low) / 2, _TYPICAL_SPEED, pressure, pressure],
    )
    joints = spec.joints
    return Scaling(np.tile(offset, joints), np.tile(scale, joints), np.ones(2 * joints))


def nominal_goals(spec: ArmSpec) -> Array:
    """Return goals (joints, 2) [counts] within the inner part of the angle's range."""
    low, high = spec.angle_range
    edge = _EDGE * (high - low)
    return np.tile([low + edge, high - edge], (spec.joints, 1))


def sensor_ranges(spec: ArmSpec, window: Window) -> Array:
    """Return the lowest and highest of what is in an observation, shape (observation_size, 2) [sensor units].

    Of further sensors but for the velocity nothing is known; they may say anything.
    """
    low, high = spec.angle_range
    fastest = (high - low) / (1e3 * spec.period)
    most = _PRESSURE_MARGIN * spec.max_pressure_counts
    ranges = [[low, high], [-fastest, fastest], [0.0, most], [0.0, most]]
    joints = np.tile(np.array(ranges, np.float64), (spec.joints, 1))
    return np.concatenate([joints, np.tile([-np.inf, np.inf], (len(window.further), 1))])


def observation_space(window: Window, scaling: Scaling, ranges: ArrayLike, goals: ArrayLike) -> Box:
    """Return the space of scaled states with goals.

    Args:
        window: which observations and actions are in a state.
        scaling: of the observations and of the goal, which is scaled as an angle is.
        ranges: of the observations, shape (observation_size, 2) [sensor units].
        goals: lowest and highest, shape (joints, 2) [counts].

    """
    wanted = scaled_goal(np.asarray(goals, np.float64).T, scaling).T
    return _box(np.concatenate([_state_bounds(window, scaling, ranges), wanted]))


def following_space(window: Window, scaling: Scaling, ranges: ArrayLike, looks: int) -> Box:
    """Return the space of scaled states with how far the reference is from every joint at so many times (``looks``).

    The rest is as in :func:`observation_space`. A reference and an angle are at most the sensor's range apart.
    """
    angles = np.asarray(ranges, np.float64)[: window.joint_size : len(QUANTITIES)]
    apart = (angles[:, 1] - angles[:, 0]) / scaling.observation_scale[: window.joint_size : len(QUANTITIES)]
    away = np.tile(np.stack([-apart, apart], axis=1), (looks, 1))
    return _box(np.concatenate([_state_bounds(window, scaling, ranges), away]))


def _state_bounds(window: Window, scaling: Scaling, ranges: ArrayLike) -> Array:
    """Return the lowest and highest of scaled states, shape (state_size, 2)."""
    offset, scale = scaling.observation_offset[:, None], scaling.observation_scale[:, None]
    observed = (np.asarray(ranges, np.float64) - offset) / scale
    commanded = np.array([[-1.0, 1.0]]) / scaling.command_scale[:, None]
    memory = np.tile([-1.0, 1.0], (window.memory_size, 1))
    return np.concatenate([*[observed] * window.history, *[commanded] * (window.history - 1), memory])


def _box(bounds: Array) -> Box:
    return Box((bounds[:, 0] - _ROUNDING).astype(np.float32), (bounds[:, 1] + _ROUNDING).astype(np.float32))

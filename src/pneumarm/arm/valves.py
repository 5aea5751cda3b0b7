"""The coding of valves, actions and commands (thesis table 2.1 and section 2.4.1).

Per muscle -1 lets air out, 0 keeps both valves closed, +1 lets air in. The nine combinations of a joint's two
muscles are its actions 0..8: ``action = 3 * (valve_1 + 1) + (valve_2 + 1)``.

A command is valves, which hold until the next one, or *pulses*: numbers from -1 to +1 whose sign is the valve and
whose magnitude the share of the control period for which it is open; then it closes. +-1 holds until the next one.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Command = NDArray[np.int8] | NDArray[np.float64]
"""Valves (joints, 2) of -1, 0, +1 as integers, or pulses (joints, 2) from -1 to +1 as floating-point numbers."""
ACTIONS = 9
"""Actions of one joint."""
NEVER = -1e9
"""Value, or logit, of an action that an arm does not have: one that is never chosen."""
CLOSED = 4
"""The action that keeps all four valves of a joint closed."""

VALVES: NDArray[np.int8] = np.array([(a // 3 - 1, a % 3 - 1) for a in range(ACTIONS)], np.int8)
"""Valve settings by action, shape (9, 2)."""


def possible_actions(muscles: int) -> NDArray[np.bool_]:
    """Return which actions (9,) a joint with so many ``muscles`` has: all, or those that keep muscle 2 closed."""
    possible: NDArray[np.bool_] = (VALVES[:, muscles:] == 0).all(axis=1)
    return possible


def to_valves(actions: ArrayLike) -> NDArray[np.int8]:
    """Return the valves (..., 2) of ``actions`` (...) in 0..8."""
    valves: NDArray[np.int8] = VALVES[np.asarray(actions)]
    return valves


def to_actions(valves: ArrayLike) -> NDArray[np.int64]:
    """Return the actions (...) of ``valves`` (..., 2) of -1, 0, +1."""
    both = np.asarray(valves).astype(np.int64)
    actions: NDArray[np.int64] = action_of(both[..., 0], both[..., 1])
    return actions


def action_of(valve_1: Any, valve_2: Any) -> Any:
    """Return the action of the valves of a joint's muscles; compiled by :func:`pneumarm.kernels.part` too."""
    return 3 * (valve_1 + 1) + valve_2 + 1

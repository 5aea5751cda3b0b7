"""The coding of valves and actions (thesis table 2.1 and section 2.4.1).

Per muscle -1 lets air out, 0 keeps both valves closed, +1 lets air in. The nine combinations of a joint's two
muscles are its actions 0..8: ``action = 3 * (valve_1 + 1) + (valve_2 + 1)``.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

ACTIONS = 9
"""Actions of one joint."""
CLOSED = 4
"""The action that keeps all four valves of a joint closed."""

VALVES: NDArray[np.int8] = np.array([(a // 3 - 1, a % 3 - 1) for a in range(ACTIONS)], np.int8)
"""Valve settings by action, shape (9, 2)."""


def to_valves(actions: ArrayLike) -> NDArray[np.int8]:
    """Return the valves (..., 2) of ``actions`` (...) in 0..8."""
    valves: NDArray[np.int8] = VALVES[np.asarray(actions)]
    return valves


def to_actions(valves: ArrayLike) -> NDArray[np.int64]:
    """Return the actions (...) of ``valves`` (..., 2) of -1, 0, +1."""
    valves = np.asarray(valves)
    actions: NDArray[np.int64] = 3 * (valves[..., 0].astype(np.int64) + 1) + valves[..., 1].astype(np.int64) + 1
    return actions

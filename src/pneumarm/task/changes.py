"""What a valve change is: on the arm, in simulation and in the price of a plan."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def changes(now: Any, before: Any) -> Any:
    """Return how many valve changes a muscle makes in a control period: changes of the setting of its valves.

    A pulse that begins and ends within the period is two; one for the whole of it is none where the valve was open.
    Numbers and arrays of one shape alike; compiled by :func:`pneumarm.kernels.part` too.

    Args:
        now: the command of the period, from -1 to +1: the sign is the valve, the magnitude the share for which it is
            open.
        before: the command of the period before; 0 where the valves were closed.

    """
    opened = np.sign(now)
    return 1 * (opened != np.trunc(before)) + (np.trunc(now) != opened)


def valve_changes(commands: NDArray[Any]) -> NDArray[np.int64]:
    """Return the valve changes of each muscle from closed valves on, shape (joints, 2) and whatever follows.

    Args:
        commands: as applied, shape (n, joints, 2) and whatever follows, of numbers as in :func:`changes`.

    """
    before = np.concatenate([np.zeros_like(commands[:1]), commands[:-1]])
    counted: NDArray[np.int64] = changes(commands, before).sum(axis=0)
    return counted

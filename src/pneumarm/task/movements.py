"""The record of movements: what was asked, and what came of it, wherever they were made."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.statistics import summarise


class Movements(NamedTuple):
    """What a test records, an entry an episode."""

    goal: NDArray[np.float64]
    """Shape (episodes, joints) [counts]."""
    angle_begin: NDArray[np.float64]
    """Shape (episodes, joints) [counts]."""
    angle_end: NDArray[np.float64]
    """Shape (episodes, joints) [counts]."""
    velocity_end: NDArray[np.float64]
    """Shape (episodes, joints) [counts/ms]."""
    actions: NDArray[np.int64]
    """Shape (episodes,)."""
    switches: NDArray[np.int64]
    """Shape (episodes, joints)."""
    reward: NDArray[np.float64]
    """Sum of the rewards, shape (episodes,)."""
    success: NDArray[np.bool_]
    """Shape (episodes,)."""


def movements(episodes: int, joints: int) -> Movements:
    """Return workspace for ``episodes``."""
    each, all_ = (episodes, joints), (episodes,)
    return Movements(
        goal=np.zeros(each),
        angle_begin=np.zeros(each),
        angle_end=np.zeros(each),
        velocity_end=np.zeros(each),
        actions=np.zeros(all_, np.int64),
        switches=np.zeros(each, np.int64),
        reward=np.zeros(all_),
        success=np.zeros(all_, np.bool_),
    )


TEST, NOISE = 3, 4
"""Streams of random numbers of tests; training uses others."""


@dataclass(frozen=True)
class TestResult:
    """Movements of a test, an entry an episode, and their means."""

    __test__ = False  # no test case, whatever pytest thinks of the name

    goal: NDArray[np.float64]
    """Shape (episodes, joints) [counts]."""
    angle_begin: NDArray[np.float64]
    """Shape (episodes, joints) [counts]."""
    angle_end: NDArray[np.float64]
    """Shape (episodes, joints) [counts]."""
    velocity_end: NDArray[np.float64]
    """Shape (episodes, joints) [counts/ms]."""
    actions: NDArray[np.int64]
    """Shape (episodes,)."""
    switches: NDArray[np.int64]
    """Shape (episodes, joints)."""
    reward: NDArray[np.float64]
    """Sum of the rewards of an episode, shape (episodes,)."""
    success: NDArray[np.bool_]
    """Shape (episodes,)."""

    def results(self) -> dict[str, Any]:
        """Return what ``results.json`` holds of a test; ``switches`` is a list where there are several joints."""
        return summarise(self.reward, self.success, self.actions, self.switches)

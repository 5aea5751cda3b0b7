"""Recordings as other libraries keep them: episodes of observations and the actions that followed them.

An episode is an uninterrupted stretch of a sequence: where rows are marked it ends, and another begins after them.
Numbers are those of the store: counts, counts/ms, m/s2, Celsius, and commands from -1 to 1.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.transitions.rows import Rows
from pneumarm.transitions.store import Store


class EpisodeRows(NamedTuple):
    """An episode of ``n`` actions."""

    time: NDArray[np.float64]
    """On the arm's clock, shape (n + 1,) [s]."""
    observation: NDArray[np.float64]
    """Shape (n + 1, observations), see :func:`observation_names`."""
    action: NDArray[np.float64]
    """Shape (n, 2 joints), see :func:`action_names`."""


def observation_names(store: Store) -> list[str]:
    """Return what the numbers of an observation are."""
    parts = ("angle", "pressure_1", "pressure_2")
    return [f"joint_{joint}_{what}" for joint in range(1, store.joints + 1) for what in parts] + list(store.further)


def action_names(store: Store) -> list[str]:
    """Return what the numbers of an action are."""
    return [f"joint_{joint}_command_{muscle}" for joint in range(1, store.joints + 1) for muscle in (1, 2)]


def episodes(store: Store) -> Iterator[EpisodeRows]:
    """Give the episodes of ``store``, in bounded memory."""
    for rows in store.blocks():
        ends = (np.diff(rows.sequence) != 0) | (np.diff(rows.step) != 1)
        borders = [0, *(np.flatnonzero(ends) + 1).tolist(), len(rows)]
        for begin, end in pairwise(borders):
            if end - begin > 1:
                yield _episode(rows, slice(begin, end), store)


def _episode(rows: Rows, part: slice, store: Store) -> EpisodeRows:
    angle, pressure = rows.angle[part], rows.pressure[part]
    of_joints = np.concatenate([angle[..., None], pressure], axis=2).reshape(len(angle), -1)
    measured = [rows.measured[name][part, None] for name in store.further]
    command = rows.command[part][:-1]
    return EpisodeRows(rows.time[part], np.hstack([of_joints, *measured]), command.reshape(len(command), -1))

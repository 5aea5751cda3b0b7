"""Goals on the command line and on standard input."""

import sys
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.task.goals import goal_of

STANDARD_INPUT = "-"
"""The goal that stands for those on standard input, one a line."""


def read_goals(given: Iterable[str], spec: ArmSpec, goal_range: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    """Yield the goals (joints,) [counts] in ``given``; those on standard input as they come in.

    All that are given are checked before the first is yielded.

    Raises:
        UnusableInput: one is none, or lies outside ``goal_range`` (joints, 2) [counts].

    """
    texts = list(given)
    if not texts:
        raise UnusableInput("no goal: give one or more, such as 20deg or 650, or - for standard input, one a line")
    known = [None if text == STANDARD_INPUT else goal_of(text, spec, goal_range) for text in texts]

    def goals() -> Iterator[NDArray[np.float64]]:
        for goal in known:
            if goal is not None:
                yield goal
                continue
            for line in sys.stdin:
                if line.strip():
                    yield goal_of(line.strip(), spec, goal_range)

    return goals()

"""Goals on the command line and on standard input."""

import sys
from collections.abc import Iterable, Iterator

from pneumarm.arm import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.task.goals import Goal, goal_of
from pneumarm.transitions.goals import Goals

STANDARD_INPUT = "-"
"""The goal that stands for those on standard input, one a line."""


def read_goals(given: Iterable[str], spec: ArmSpec, known: Goals) -> Iterator[Goal]:
    """Yield the goals in ``given``; those on standard input as they come in.

    All that are given are checked before the first is yielded. One in x and y is taken as near to the one before as
    can be.

    Raises:
        UnusableInput: one is none, or none of those that are ``known``.

    """
    texts = list(given)
    if not texts:
        raise UnusableInput(
            "no goal: give one or more, such as 20deg, 650 or 0.20m,-0.30m, or - for standard input, one a line"
        )
    checked: list[Goal | None] = []
    for text in texts:
        before = checked[-1] if checked else None
        checked.append(None if text == STANDARD_INPUT else goal_of(text, spec, known, before))

    def goals() -> Iterator[Goal]:
        before = None
        for goal in checked:
            if goal is not None:
                yield (before := goal)
                continue
            for line in sys.stdin:
                if line.strip():
                    yield (before := goal_of(line.strip(), spec, known, before))

    return goals()

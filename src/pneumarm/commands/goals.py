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
    """Yield the goals in ``given``; those on standard input as they come in, without empty lines and comments (#).

    All that are given are checked before the first is yielded. One in x and y is taken as near to the one before as
    can be.

    Raises:
        UnusableInput: one is none, or none of those that are ``known``; or standard input held none. Of a line there
            it is raised when the goals before it have been moved to.

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
            found = 0
            for number, line in enumerate(sys.stdin, 1):
                text = line.partition("#")[0].strip()
                if not text:
                    continue
                found += 1
                try:
                    before = goal_of(text, spec, known, before)
                except UnusableInput as error:
                    raise UnusableInput(f"line {number} of standard input: {error}") from error
                yield before
            if not found:
                raise UnusableInput("standard input: held no goal; expected one or more lines such as 20deg or 650")

    return goals()

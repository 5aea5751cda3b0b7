"""The attacks of `make soak`: how much of each is done, and what is said while it is and afterwards."""

import os
from time import monotonic

_PAUSE = 15.0
"""Time between two lines of progress [s]."""

summary: list[str] = []
"""A line for each attack of this session; pytest shows them at its end."""


def amount(name: str, full: int) -> int:
    """Return how much of an attack is done: ``full``, or what the environment says, as in ``SOAK_KILLS=3``."""
    text = os.environ.get(f"SOAK_{name}", str(full))
    if not text.isdecimal() or int(text) < 1:
        raise ValueError(f"SOAK_{name}: expected a number from 1 up, got {text!r}")
    return int(text)


class Attack:
    """Tells how far an attack is."""

    def __init__(self, title: str, total: int) -> None:
        self.title, self.total, self.done, self.failed = title, total, 0, 0
        self._begun = self._told = monotonic()

    def advance(self, count: int = 1) -> None:
        """Note that ``count`` more of the total have been done."""
        self.done += count
        if monotonic() - self._told > _PAUSE:
            self._told = monotonic()
            print(f"{self.title}: {self.done:,} of {self.total:,}, {self.seconds:.0f} s", flush=True)

    @property
    def seconds(self) -> float:
        """Time since the attack began [s]."""
        return monotonic() - self._begun

    def summarise(self, result: str) -> None:
        """Say what came of the attack, now and at the end of the session."""
        line = f"{self.title}: {self.done:,} in {self.seconds:.0f} s; {result}"
        summary.append(line)
        print(line, flush=True)

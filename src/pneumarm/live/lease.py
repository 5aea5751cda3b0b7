"""Who controls the arm: one page writes, the others watch."""

import math
from collections.abc import Callable
from time import monotonic

HOLD_AFTER = 1.0
"""An arm whose page was not heard for so long [s] stops where it is ..."""
VENT_AFTER = 3.0
"""... and is vented after this [s]."""


class ControlLease:
    """The pages that are open, which of them controls the arm, and when that was heard last.

    The first page to take control has it. Another that wants it asks, and gets it when it is handed over, or when
    who has it is gone or has not been heard for ``HOLD_AFTER``.
    """

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        self._clock = clock
        self.pages: list[int] = []
        """Numbers of the open pages, in the order in which they came."""
        self.writer: int | None = None
        self.asking: int | None = None
        """Who wants control and was the first to say so."""
        self._heard = -math.inf
        self._last = 0

    def enter(self) -> int:
        """Return the number of a new page."""
        self._last += 1
        self.pages.append(self._last)
        return self._last

    def leave(self, page: int) -> None:
        """Note that ``page`` is gone; the arm it controlled holds at once, and is vented a little later."""
        self.pages.remove(page)
        if self.asking == page:
            self.asking = None
        if self.writer == page:
            self._let_go()

    def hear(self, page: int) -> None:
        """Note that ``page`` is there."""
        if page == self.writer:
            self._heard = self._clock()

    def take(self, page: int) -> bool:
        """Give ``page`` control if nobody else has it, else note that it asks; return whether it has it."""
        if self.writer not in (None, page) and self.silence < HOLD_AFTER:
            self.asking = page if self.asking is None else self.asking
            return False
        self._give(page)
        return True

    def hand_over(self, page: int) -> None:
        """Let ``page``, if it controls the arm, give that to who asked for it, or to nobody."""
        if page != self.writer:
            return
        if self.asking is None:
            self._let_go()
        else:
            self._give(self.asking)

    @property
    def silence(self) -> float:
        """For how long [s] nobody who controls the arm has been heard."""
        return self._clock() - self._heard

    def _give(self, page: int) -> None:
        self.writer, self._heard = page, self._clock()
        self.asking = None if self.asking == page else self.asking

    def _let_go(self) -> None:
        self.writer, self._heard = None, min(self._heard, self._clock() - HOLD_AFTER)

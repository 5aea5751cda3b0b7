"""An arm moved turn by turn, as the control cycle does it, by an agent that is asked from outside."""

import math

import numpy as np

from pneumarm.arm import Arm, BeginState, ControlCycle, Reading, guarded
from pneumarm.arm.valves import Command


class Turns:
    """Brings an arm to rest somewhere and then makes turns of one control period.

    Where the arm's clock goes on while an agent thinks, and longer than a control period, its command is replaced as
    the control cycle does it, by holding and then venting; an agent that does not come back at all is waited for with
    the arm vented.
    """

    def __init__(self, arm: Arm, begin: BeginState) -> None:
        """Move ``arm``, which is guarded here where it is not yet, from where ``begin`` brings it."""
        self.arm = guarded(arm)
        self._fresh = self.arm.get_state()
        self._begin = begin
        self._cycle = ControlCycle(self.arm)

    def begin(self, random: np.random.Generator, *, fresh: bool) -> Reading:
        """Bring the arm to a begin state and return the reading there.

        A ``fresh`` beginning puts an arm that can be put into a saved state back to how it was at first.
        """
        self.arm.watchdog.end()
        if fresh and self._fresh is not None:
            self.arm.set_state(self._fresh)
        self._begin.reach(self.arm, random)
        return self._cycle.start()

    def ask(self) -> None:
        """Have the arm looked after until the agent comes with a command: for as long as it takes."""
        self._cycle.ask(math.inf)

    def turn(self, command: Command) -> tuple[Reading, Command]:
        """Let a control period pass with ``command`` (joints, 2); return the next reading and what was applied."""
        self.arm.watchdog.end()
        self._cycle.act(command)
        return self._cycle.finish(), self._cycle.applied

    def rest(self) -> None:
        """Close all valves: the movement is over."""
        self.arm.set_valves(np.zeros((self.arm.spec.joints, 2), np.int8))

    def close(self) -> None:
        """Close the arm."""
        self.arm.watchdog.end()
        self.arm.close()

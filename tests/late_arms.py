"""Virtual arms whose valves answer late: every setting of a valve has its effect some time after it was asked for.

``python:tests.late_arms:seed_3_by_200`` is ``virtual:seed=3`` with 200 ms of dead time besides its own.
"""

import re
from collections import deque
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import Arm, Reading
from pneumarm.arm.virtual import Fault, VirtualArm, draw_parameters


class LateArm(Arm):
    """A virtual arm that hears ``late`` [s] what its valves are to do."""

    def __init__(self, seed: int, late: float, faults: Sequence[Fault] = ()) -> None:
        self._arm, self._late = VirtualArm(draw_parameters(seed), faults=faults), late
        self.spec = self._arm.spec
        self._under_way = deque[tuple[float, NDArray[np.int8]]]()

    def read(self) -> Reading:
        """Return what the sensors say now."""
        return self._arm.read()

    def set_valves(self, valves: NDArray[np.int8]) -> None:
        """Set the valves (joints, 2), with an effect later."""
        self._under_way.append((self._arm.time + self._late, np.array(valves)))

    def wait(self, seconds: float) -> None:
        """Let time pass [s]."""
        self.wait_until(self._arm.time + seconds)

    def wait_until(self, time: float) -> None:
        """Let time pass until ``time`` on the arm's clock [s]."""
        while self._under_way and self._under_way[0][0] <= time:
            heard, valves = self._under_way.popleft()
            self._arm.wait_until(max(heard, self._arm.time))
            self._arm.set_valves(valves)
        self._arm.wait_until(max(time, self._arm.time))

    def close(self) -> None:
        """Close the valves."""
        self._arm.close()


def __getattr__(name: str) -> Callable[[], LateArm]:
    """Return what makes the arm called ``seed_N_by_MILLISECONDS``."""
    found = re.fullmatch(r"seed_(\d+)_by_(\d+)", name)
    if found is None:
        raise AttributeError(f"arms here are called seed_3_by_200, not {name}")
    seed, milliseconds = map(int, found.groups())
    return lambda: LateArm(seed, milliseconds / 1e3)

"""An arm of a stranger, behind the seam."""

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.strangers import motion
from benchmarks.strangers.air import ATMOSPHERE
from benchmarks.strangers.draw import draw_arm
from benchmarks.strangers.valves import Valves
from pneumarm.arm import Arm, Reading
from pneumarm.errors import UnusableInput
from pneumarm.kernels import direct

_advance = direct(motion.advance)
_COMES_TO_REST = 6.0  # s, before anybody looks


class Stranger(Arm):
    """The arm of a ``number`` with one joint or two, at rest and without air."""

    def __init__(self, number: int, joints: int = 1) -> None:
        self.design = draw_arm(number, joints)
        self.spec = self.design.spec
        self._random = np.random.default_rng([number, joints])
        self._valves = Valves(self.design.opening, self.design.closing)
        self._state = motion.at_atmosphere(joints, self.design.air.full)
        self._time = -_COMES_TO_REST
        self.wait(_COMES_TO_REST)
        self._time = 0.0

    def read(self) -> Reading:
        deviates = self._random.standard_normal((self.spec.joints, 3))
        degrees, design = np.degrees(self._state.angle), self.design
        angle = [one.read(degrees[j], deviates[j, 0]) for j, one in enumerate(design.angles)]
        pressure = design.pressures.read(self._state.line - ATMOSPHERE, deviates[:, 1:])
        return Reading(self._time, np.array(angle), pressure)

    def set_valves(self, valves: NDArray[np.int8]) -> None:
        self._valves.set(self._time, np.asarray(valves, np.float64), self.spec.period)

    def set_pulses(self, command: NDArray[np.float64]) -> bool:
        if not self.spec.pulses:
            return False
        self._valves.set(self._time, command, self.spec.period)
        return True

    def wait(self, seconds: float) -> None:
        if seconds > 0:
            made = self.design
            _advance(
                made.body, made.muscles, made.loops, made.air, self._valves.open, self._state, self._time, seconds
            )
            self._time += seconds

    def close(self) -> None:
        self.set_valves(np.zeros((self.spec.joints, 2), np.int8))

    def get_state(self) -> bytes:
        """Return the whole state, bit for bit."""
        arrays = {name: value.tolist() for name, value in self._arrays().items()}
        return json.dumps({"time": self._time, "random": self._random.bit_generator.state, **arrays}).encode()

    def set_state(self, state: bytes) -> None:
        """Take up a state of :meth:`get_state`.

        Raises:
            UnusableInput: it is none, or one of an arm with other joints.

        """
        try:
            saved: dict[str, Any] = json.loads(state)
            found = {name: np.array(saved[name]).reshape(value.shape) for name, value in self._arrays().items()}
            self._random.bit_generator.state = saved["random"]
            self._time = float(saved["time"])
        except (ValueError, KeyError, TypeError) as error:
            raise UnusableInput(f"{self.spec.name}: expected a state of an arm like this ({error})") from error
        for name, value in self._arrays().items():
            value[:] = found[name]

    def _arrays(self) -> dict[str, NDArray[np.float64]]:
        """Return everything that changes, besides the time and the noise."""
        return {**self._state._asdict(), "open": self._valves.open, "current": self._valves.current}

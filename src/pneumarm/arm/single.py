"""Arms whose joints have one muscle each, against a spring or a weight.

Everything behind the guard knows joints with two muscles. Such an arm has a second one there that is never told
anything: the guard keeps its valves closed, its pressure is 0 (:func:`pneumarm.arm.seam.checked`), and what never
varies weighs nothing in a simulation. The arm itself has arrays of the shape (joints, 1), and nobody has to invent a
muscle. Of a joint's nine actions three are left (:func:`pneumarm.arm.valves.possible_actions`).
"""

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.passed_on import PassedOn
from pneumarm.arm.seam import Reading, checked


class SingleArm(PassedOn):
    """``arm``, which has one muscle a joint, with room for another that is not there."""

    def read(self) -> Reading:
        """Return what the sensors say, the pressure of the muscle that is not there being 0."""
        return checked(self.arm.read(), self.spec)

    def set_valves(self, valves: NDArray[np.int8]) -> None:
        """Set the valves of the muscles that are there."""
        self.arm.set_valves(np.ascontiguousarray(valves[:, :1]))

    def set_pulses(self, command: NDArray[np.float64]) -> bool:
        """Set pulses of the muscles that are there, if the arm can time them."""
        return self.arm.set_pulses(np.ascontiguousarray(command[:, :1]))

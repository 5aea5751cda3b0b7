"""An arm whose sensors are put right by what a calibration found."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import Arm, Reading, checked
from pneumarm.arm.spec_file import ArmFile
from pneumarm.arm.wrapper import ArmWrapper
from pneumarm.errors import UnusableInput


class CorrectedArm(ArmWrapper):
    """``arm`` with the spec and the corrections of its file; everything else is the arm's own."""

    def __init__(self, arm: Arm, known: ArmFile) -> None:
        """Take what is ``known`` of ``arm``.

        Raises:
            UnusableInput: it is for another number of joints or muscles, or names sensors that the arm does not have.

        """
        if known.spec.joints != arm.spec.joints:
            raise UnusableInput(
                f"the file is of an arm with {known.spec.joints} joint(s), this has {arm.spec.joints}"
            )
        if known.spec.muscles != arm.spec.muscles:
            raise UnusableInput(
                f"the file is of an arm with {known.spec.muscles} muscle(s) a joint, {arm.spec.name} has "
                f"{arm.spec.muscles}; set muscles in it"
            )
        missing = [name for name in known.spec.further if name not in arm.spec.further]
        if missing:
            raise UnusableInput(
                f"the file names sensors that {arm.spec.name} lacks ({', '.join(missing)}); remove them from it"
            )
        super().__init__(arm)
        self.spec, self.known = known.spec, known

    def read(self) -> Reading:
        """Return what the sensors say, put right."""
        raw = checked(self.arm.read(), self.arm.spec)
        correction = self.known.correction
        angle, velocity = correction.angle(raw.angle), raw.velocity
        if velocity is not None and correction.angle_raw:
            velocity = correction.angle(raw.angle + velocity / 2) - correction.angle(raw.angle - velocity / 2)
        pressure = correction.pressure(raw.pressure) if raw.pressure.size else raw.pressure
        return replace(raw, angle=angle, pressure=pressure, velocity=velocity)

    def set_pulses(self, command: NDArray[np.float64]) -> bool:
        """Set pulses, of an arm whose control period is that of the file."""
        return self.spec.period == self.arm.spec.period and self.arm.set_pulses(command)

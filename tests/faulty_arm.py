"""A virtual arm that is wired or built as no plan of faults says: readings and valves go through a function."""

from dataclasses import replace

import numpy as np

from pneumarm.arm import Arm
from pneumarm.arm.virtual import VirtualArm, draw_parameters


class FaultyArm(Arm):
    """Arm ``seed`` with changed readings of angles (joints,) and pressures (joints, 2) [counts] or changed valves."""

    def __init__(self, seed, *, joints=1, angle=None, pressure=None, valves=None):
        self.arm = VirtualArm(draw_parameters(seed, joints), seed=seed)
        self.spec = replace(self.arm.spec, name="faulty")
        self._angle, self._pressure = angle or (lambda a: a), pressure or (lambda p: p)
        self._valves = valves or (lambda v: v)
        self.applied = np.zeros((self.spec.joints, 2), np.int8)

    def read(self):
        reading = self.arm.read()
        angle, pressure = self._angle(reading.angle.copy()), self._pressure(reading.pressure.copy())
        return replace(
            reading, angle=np.round(np.clip(angle, 0, 1023)), pressure=np.round(np.clip(pressure, 0, 1023))
        )

    def set_valves(self, valves):
        self.applied = np.array(valves)
        self.arm.set_valves(self._valves(self.applied))

    def wait(self, seconds):
        self.arm.wait(seconds)

    def close(self):
        self.arm.close()


def logarithmic(curvature):
    """The track of a logarithmic potentiometer."""
    return lambda angle: 1023 * np.expm1(curvature * angle / 1023) / np.expm1(curvature)


def coloured():
    """Noise that remembers."""
    random, last = np.random.default_rng(0), 0.0

    def add(angle):
        nonlocal last
        last = 0.9 * last + random.normal(0, 1.5)
        return angle + last

    return add


FAULTS = {
    "pressure sensors swapped": lambda seed: FaultyArm(seed, pressure=lambda p: p[:, ::-1]),
    "angle reversed": lambda seed: FaultyArm(seed, angle=lambda a: 1023 - a),
    "pressure frozen": lambda seed: FaultyArm(seed, pressure=lambda p: p * [[1, 0]]),
    "noise not white": lambda seed: FaultyArm(seed, angle=coloured()),
}
"""Faults by what the check-up calls them."""

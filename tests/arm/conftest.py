"""Arms for the tests of the seam: the smallest one that a user could write, and one that records its calls."""

import pytest

from pneumarm.arm import Arm, ArmSpec, Reading


class SmallestArm(Arm):
    """An arm of any number of joints that a user wrote in plain lists: valves push angles and pressures about."""

    def __init__(self, joints=1, **spec):
        self.spec = ArmSpec(joints=joints, name="smallest", **spec)
        self.time = 0.0
        self.valves = [[0, 0] for _ in range(joints)]
        self.angle = [500 for _ in range(joints)]
        self.pressure = [[0, 0] for _ in range(joints)]
        self.calls = []
        self.closed = 0

    def read(self):
        self.calls.append("read")
        return Reading(self.time, list(self.angle), [list(p) for p in self.pressure])

    def set_valves(self, valves):
        self.valves = [[int(v) for v in joint] for joint in valves]
        self.calls.append(("valves", self.valves))

    def wait(self, seconds):
        self.calls.append(("wait", seconds))
        self.time += seconds
        for joint, valves in enumerate(self.valves):
            for muscle, valve in enumerate(valves):
                # 1 bar in a second, as in a real arm.
                level = self.pressure[joint][muscle] + valve * 166 * seconds
                self.pressure[joint][muscle] = max(0, level)
            self.angle[joint] = 500 + self.pressure[joint][0] - self.pressure[joint][1]

    def close(self):
        self.closed += 1
        self.valves = [[0, 0] for _ in self.valves]


@pytest.fixture(scope="session")
def smallest_arm():
    return SmallestArm

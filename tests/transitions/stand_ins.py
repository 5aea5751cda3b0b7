"""Stand-ins: an arm with first-order pressures and an angle that follows them, and sequences to store."""

import struct

import numpy as np

from pneumarm.arm import Arm, ArmSpec, Reading
from pneumarm.transitions import Recorded


class FirstOrderArm(Arm):
    """Pressures approach 0 or 400 counts while a valve is open; the angle follows their difference."""

    def __init__(self, joints=1, fail_after=None, late=None, **spec):
        self.spec = ArmSpec(joints=joints, **{"counts_per_bar": 300.0, "max_pressure": 1.2, **spec})
        self.time = 0.0
        self.pressure = np.zeros((joints, 2))
        self.angle = np.full(joints, 511.0)
        self.valves = np.zeros((joints, 2), np.int8)
        self.noise = 1
        self.closed = False
        self.reads = 0
        self.fail_after = fail_after  # readings, after which the arm fails
        self.late = late  # a reading before which 0.1 s are lost
        self.log = []  # (time, valves) at every setting

    def read(self):
        self.reads += 1
        if self.fail_after is not None and self.reads > self.fail_after:
            raise OSError("no answer from the board")
        if self.reads == self.late:
            self.wait(0.1)
        self.noise = (1103515245 * self.noise + 12345) % 2**31
        return Reading(self.time, np.rint(self.angle + self.noise / 2**31), np.rint(self.pressure))

    def set_valves(self, valves):
        self.valves = np.array(valves, np.int8)
        self.log.append((self.time, self.valves.copy()))

    def wait(self, seconds):
        self.time += seconds
        target = np.where(self.valves > 0, 400.0, 0.0)
        share = np.where(self.valves == 0, 0.0, 1 - np.exp(-seconds / 0.3))
        self.pressure += share * (target - self.pressure)
        settled = 511.0 + 1.2 * (self.pressure[:, 0] - self.pressure[:, 1])
        self.angle += (1 - np.exp(-seconds / 0.1)) * (settled - self.angle)

    def wait_until(self, time):
        if time > self.time:
            self.wait(time - self.time)

    def close(self):
        self.valves[:] = 0
        self.closed = True

    def get_state(self):
        numbers = struct.pack("<dq", self.time, self.noise)
        return numbers + self.pressure.tobytes() + self.angle.tobytes() + self.valves.tobytes()

    def set_state(self, state):
        joints = self.spec.joints
        self.time, self.noise = struct.unpack_from("<dq", state)
        self.pressure = np.frombuffer(state, float, 2 * joints, 16).reshape(joints, 2).copy()
        self.angle = np.frombuffer(state, float, joints, 16 + 16 * joints).copy()
        self.valves = np.frombuffer(state, np.int8, 2 * joints, 16 + 24 * joints).reshape(joints, 2).copy()


def make_recorded(number=0, n=21, joints=1, valves=True, **given):
    """Return a sequence of ``n`` rows that is different for every ``number``."""
    random = np.random.default_rng(number)
    shape = (n, joints, 2)
    command = random.integers(-1, 2, shape).astype(float) if valves else random.normal(size=shape)
    command[-1] = np.nan
    return Recorded(
        **{
            "time": np.arange(n) / 30,
            "angle": random.integers(256, 768, (n, joints)).astype(float),  # more in a period is no arm
            "pressure": random.integers(0, 170, shape).astype(float),
            "command": command,
            "step": np.arange(n),
            "kind": "velocity",
            "at_rest": True,
            **given,
        }
    )

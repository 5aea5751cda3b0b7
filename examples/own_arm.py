"""An arm of your own: one class with read, set_valves, wait and close. Everything else works with it.

A virtual arm stands in for the hardware here, so that the example runs; yours talks to a port, pins or a bus. On any
command line this one is ``python:own_arm:MyArm``.
"""

import numpy as np

import pneumarm
from pneumarm.arm import Arm, ArmSpec, Reading


class MyArm(Arm):
    """One joint with two muscles."""

    def __init__(self) -> None:
        self.hardware = pneumarm.open_arm("virtual:seed=5")  # yours: open the port here
        self.spec = ArmSpec(name="my arm", counts_per_degree=11.378, counts_per_bar=166.0, angle_range=(0, 1023))

    def read(self) -> Reading:
        """Return the counts of the sensors now: an angle a joint and two pressures a joint, and a time that rises."""
        sensed = self.hardware.read()
        return Reading(sensed.time, sensed.angle, sensed.pressure)

    def set_valves(self, valves: np.ndarray) -> None:
        """Set the valves (1, 2): -1 air out, 0 closed, +1 air in; they stay until the next call."""
        self.hardware.set_valves(valves)

    def wait(self, seconds: float) -> None:
        """Let time pass; on hardware time.sleep(seconds)."""
        self.hardware.wait(seconds)

    def close(self) -> None:
        """Leave every valve closed and let go of the hardware; may be called twice."""
        self.hardware.close()


if __name__ == "__main__":
    print(pneumarm.collect(MyArm(), "mine.db", transitions=3_000))
    print(pneumarm.fit("mine.db", "mine.sim"))
    learned = pneumarm.train("mine.sim", "mine.db", "mine.agent")
    for one in pneumarm.move(learned.agent, MyArm(), goals_deg=[15, -10]):
        print(one)

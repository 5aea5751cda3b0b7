"""Arms that write to a file what happens to them, to be driven by real processes; run from the folder of tests.

``PNEUMARM_TEST_LOG`` names the file. Each line is ``set``, who set the valves, and these, or ``close``.
"""

import os
import sys

import pneumarm.arm.guard
import pneumarm.arm.own
from pneumarm.arm.virtual import VirtualArm, draw_parameters


class Logged(VirtualArm):
    """The virtual arm number 3, which logs who sets its valves."""

    def __init__(self, parameters=None, *, seed=3, name="logged", **options):
        self._log = open(os.environ["PNEUMARM_TEST_LOG"], "a", buffering=1)  # noqa: SIM115
        super().__init__(parameters or draw_parameters(3), seed=seed, name=name, **options)

    def set_valves(self, valves):
        caller = sys._getframe(1)
        while caller.f_globals["__name__"] == pneumarm.arm.own.__name__:
            caller = caller.f_back  # what passes calls on to an arm of somebody's own
        own = caller.f_code in (VirtualArm.close.__code__, VirtualArm.rest.__code__)
        by = "itself" if own else "guard" if caller.f_globals["__name__"] == pneumarm.arm.guard.__name__ else "others"
        self._log.write(f"set {by} {valves.ravel().tolist()}\n")
        super().set_valves(valves)

    def close(self):
        super().close()
        if not self._log.closed:
            self._log.write("close\n")


def logged():
    return Logged()

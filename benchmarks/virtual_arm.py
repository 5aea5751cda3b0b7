"""How much faster than real time the nominal virtual arm is, one joint on one core.

python -m benchmarks virtual_arm
"""

from collections.abc import Callable, Iterator
from time import perf_counter

import numpy as np

from pneumarm.arm.cycle import ControlCycle
from pneumarm.arm.guard import guarded
from pneumarm.arm.valves import VALVES
from pneumarm.arm.virtual import VirtualArm

SIMULATED = 300.0
"""Time to simulate [s]."""
REPEATS = 3


def _through_the_seam(seconds: float) -> None:
    arm = VirtualArm()
    random = np.random.default_rng(0).integers(0, 9, 4096)
    choices = [VALVES[a].reshape(1, 2) for a in random]
    due, turn, period, latency = 0.0, 0, arm.spec.period, arm.spec.latency
    while due < seconds:
        arm.read()
        due += period
        arm.wait(latency)
        arm.set_valves(choices[turn % 4096])
        arm.wait_until(due)
        turn += 1


def _guarded_cycle(seconds: float) -> None:
    choices = [VALVES[a].reshape(1, 2) for a in np.random.default_rng(0).integers(0, 9, 4096)]
    turn = 0

    def decide(reading: object) -> np.ndarray | None:
        nonlocal turn
        turn += 1
        return choices[turn % 4096] if turn * arm.spec.period < seconds else None

    arm = guarded(VirtualArm())
    for _ in ControlCycle(arm).run(decide):
        pass


def _kernel_alone(seconds: float) -> None:
    arm = VirtualArm()
    arm.set_valves(np.array([[1, -1]], np.int8))
    for _ in range(int(seconds / 5)):
        arm.wait(5.0)  # short enough not to be fast-forwarded


def _night(seconds: float) -> None:
    VirtualArm().wait(seconds)


def _best(job: Callable[[float], None], seconds: float) -> float:
    job(1.0)  # compiles, or loads what was compiled
    times = []
    for _ in range(REPEATS):
        begin = perf_counter()
        job(seconds)
        times.append(perf_counter() - begin)
    return min(times)


def measure() -> Iterator[str]:
    """Yield lines with ratios to real time."""
    for name, job in (
        ("read, wait, set valves, wait", _through_the_seam),
        ("guarded arm in the control cycle", _guarded_cycle),
        ("kernel alone, one valve of each kind open", _kernel_alone),
    ):
        yield f"{name}: {SIMULATED / _best(job, SIMULATED):,.0f} times real time"
    yield f"14 hours of rest: {1e3 * _best(_night, 14 * 3600.0):.1f} ms"

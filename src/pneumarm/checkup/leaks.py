"""How much every muscle leaks: fill all muscles, close them, and watch their pressures fall.

While an arm moves a leak cannot be told from what moving does to pressures: a muscle that leaks three times as much
as usual loses 0.03 % of its pressure more in a control period. With closed valves it is the only thing that lasts.
A pressure also changes with the volume: a muscle that loses air is stretched by the other one, which holds its
pressure up and lets that of the other one fall. So what the angle says of the volumes is taken out first. The rate is
a straight line's through what is left, by least squares; what the rubber does by itself (creep after the filling) is
waited for, and as far as it lasts, it is in the rate of the healthy arm too.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.guard import GuardedArm, guarded
from pneumarm.arm.seam import Arm, Reading
from pneumarm.errors import UnusableInput
from pneumarm.settings import NonNegativeFloat, PositiveFloat, Settings

ATMOSPHERE = 1.013
"""Pressure of the surroundings [bar]."""


@dataclass(frozen=True)
class LeakTest(Settings):
    """How a leak test is made."""

    fill: PositiveFloat = 1.5
    """Time that all inlets are open [s]."""
    settle: PositiveFloat = 8.0
    """Time that is waited before the pressures are watched [s]."""
    watch: PositiveFloat = 45.0
    """Time that they are watched [s]."""
    step: PositiveFloat = 1 / 30
    """Time between two readings then [s]."""
    compression: NonNegativeFloat = 0.0065
    """Part of its absolute pressure by which a closed muscle's changes when its joint turns by a degree. With this
    one repeated tests of an arm differ least: by 0.00015 a minute in long tests, five times less than without it."""
    surely: PositiveFloat = 4.0
    """Standard errors by which a rate must exceed the healthy one."""
    drift: PositiveFloat = 0.001
    """... and by how much besides, because rates change with temperature and creep [1/minute] ..."""
    more: PositiveFloat = 1.25
    """... and times as large as that it must be."""


class LeakRates(NamedTuple):
    """What a leak test found."""

    rate: NDArray[np.float64]
    """Part of its pressure that each muscle would lose if it kept its volume, shape (joints, 2) [1/minute]."""
    error: NDArray[np.float64]
    """Standard error of that, shape (joints, 2) [1/minute]."""
    seconds: float
    """Time that the test took on the arm's clock [s]."""


def leak_test(arm: Arm, test: LeakTest | None = None) -> LeakRates:
    """Fill all muscles, close them, and return how fast their pressures fall; the arm is left closed.

    Raises:
        UnusableInput: a muscle holds too little air to be watched: its supply or its valves are to be seen to first.

    """
    if not arm.spec.pressure_sensors:
        raise UnusableInput(f"{arm.spec.name} has no pressure sensors, by which leaks are found")
    arm.spec.require_pairs("a leak test fills two muscles, so that the joint stays")
    test, guard = test or LeakTest(), guarded(arm)
    begin = guard.read().time
    readings = watch_closed(guard, test)
    time, pressure = np.array([r.time for r in readings]), np.array([r.pressure for r in readings])
    degrees = arm.spec.degrees(np.array([r.angle for r in readings]))
    if (pressure.mean(axis=0) < 0.2 * arm.spec.max_pressure_counts).any():
        low = arm.spec.bar(pressure.mean(axis=0)).round(2).tolist()
        raise UnusableInput(f"{arm.spec.name}: filled muscles hold only {low} bar; check supply and valves first")
    turned = (degrees - degrees.mean(axis=0))[..., None] * np.array([-1, 1])  # a muscle pulls its own way
    squeezed = test.compression * turned * (pressure.mean(axis=0) + ATMOSPHERE * arm.spec.counts_per_bar)
    return LeakRates(*falling(time, pressure - squeezed), float(time[-1] - begin))


def watch_closed(
    guard: GuardedArm, test: LeakTest, seen: Callable[[Reading], None] = lambda reading: None
) -> list[Reading]:
    """Fill all muscles, close them, and return what is read after they have settled; the arm is left closed.

    ``seen`` is called with each reading.
    """
    closed = np.zeros_like(guard.applied)
    guard.read()
    guard.set_valves(closed + 1)
    guard.wait(test.fill)
    guard.set_valves(closed)
    guard.wait(test.settle)
    readings = []
    for _ in range(max(3, round(test.watch / test.step))):
        readings.append(guard.read())
        seen(readings[-1])
        guard.wait(test.step)
    return readings


def falling(
    time: NDArray[np.float64], pressure: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the rates (...) [1/minute] at which pressures (n, ...) fall at ``time`` (n,) [s], and their errors.

    ``pressure`` is above that of the surroundings, in any unit; the errors are standard errors.
    """
    minutes = (time - time.mean()) / 60
    mean = pressure.mean(axis=0)
    slope = np.tensordot(minutes, pressure, axes=1) / (minutes @ minutes)
    left = pressure - mean - np.multiply.outer(minutes, slope)
    error = np.sqrt((left**2).sum(axis=0) / (len(time) - 2) / (minutes @ minutes))
    return -slope / mean, error / mean


def leaking(healthy: LeakRates, now: LeakRates, test: LeakTest | None = None) -> NDArray[np.bool_]:
    """Return which muscles (joints, 2) leak more ``now`` than when they were ``healthy``; of a joint's at most one.

    The other muscle of the joint is stretched by the one that leaks, so that its pressure falls too: the muscle
    with more is named.
    """
    test = test or LeakTest()
    more = now.rate - healthy.rate
    surely = test.surely * np.hypot(healthy.error, now.error) + test.drift
    leaks: NDArray[np.bool_] = (more > surely) & (now.rate > test.more * healthy.rate)
    return leaks & (more >= more.max(axis=1, keepdims=True))

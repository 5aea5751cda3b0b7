"""Arms in plain Python whose physics, counts and rates are unlike the virtual arm's: sound ones, as others may have.

Pressures follow laws of their own (a straight line to the supply, a square root, a hose between valve and muscle),
and a joint is a mass on a spring whose rest moves with the difference of the pressures.
``python:tests.plain_arms:linear`` and so on open them by name.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import Arm, ArmSpec, Reading

_STEP = 5e-3  # s, at most


@dataclass(frozen=True)
class Physics:
    """What a plain arm is made of; pressures in bar gauge, angles in degrees."""

    fill: Callable[[float], float]
    """Rise of a muscle's pressure with its inlet open [bar/s], by the pressure."""
    empty: Callable[[float], float]
    """Fall with its outlet open [bar/s]."""
    reach: float
    """Angle that a difference of 1 bar turns to [degrees]."""
    stop: float
    """End stops either side [degrees]."""
    swing: float
    """Frequency of the joint [Hz]."""
    damping: float
    """Damping ratio."""
    squeeze: float
    """Rise of a muscle's pressure when its joint turns against it by a degree [bar]."""
    hose: float = 0.0
    """Time constant of the hose between valve and muscle [s]; sensors are at its beginning where there is one."""
    lag: float = 0.0
    """Dead time of the valves [s]."""
    noise: tuple[float, float] = (0.0, 0.0)
    """Standard deviation of angles and pressures [counts]."""
    zero: float = 0.0
    """What a pressure sensor reads at atmosphere [counts]."""
    sag: float = 0.0
    """Part of the flow that an inlet loses while another is open."""
    spring: tuple[float, float] = (0.0, 0.0)
    """What pulls in place of a second muscle, as a pressure [bar] in the middle and its rise by a degree."""


class _Muscle:
    """One muscle, its valves and its hose."""

    def __init__(self) -> None:
        self.valve = 0
        self.inlet = 0.0
        """Pressure where the sensor is [bar]."""
        self.pressure = 0.0
        """Pressure in the muscle [bar]."""

    def step(self, seconds: float, physics: Physics, others: int) -> None:
        flow = 0.0
        if self.valve > 0:
            flow = physics.fill(self.inlet) * (1.0 - physics.sag * others)
        elif self.valve < 0:
            flow = -physics.empty(self.inlet)
        self.inlet = max(self.inlet + seconds * flow, 0.0)
        if physics.hose:
            through = 0.5 * seconds / physics.hose * (self.inlet - self.pressure)
            self.inlet -= through
            self.pressure += through
        else:
            self.pressure = self.inlet

    def squeeze(self, by: float) -> None:
        if self.pressure > 0.05:
            self.inlet = max(self.inlet + by, 0.0)


class PlainArm(Arm):
    """An arm of ``physics``; without saved states, like hardware."""

    def __init__(self, spec: ArmSpec, physics: Physics, seed: int = 0) -> None:
        self.spec, self._physics = spec, physics
        self._random = np.random.default_rng(seed)
        self._time = 0.0
        self._muscles = [[_Muscle() for _ in range(spec.muscles)] for _ in range(spec.joints)]
        self._coming: list[tuple[float, NDArray[np.int8]]] = []
        self._angle, self._speed = [0.0] * spec.joints, [0.0] * spec.joints

    def read(self) -> Reading:
        spec, physics, random, n = self.spec, self._physics, self._random, self.spec.joints
        low, high = spec.angle_range
        angle = (low + high) / 2 + spec.counts_per_degree * np.array(self._angle)
        pressure = np.array([[muscle.inlet for muscle in pair] for pair in self._muscles])
        counts = physics.zero + spec.counts_per_bar * pressure + physics.noise[1] * random.normal(size=pressure.shape)
        noisy = np.clip(np.round(angle + physics.noise[0] * random.normal(size=n)), low, high)
        if not spec.pressure_sensors:
            return Reading(self._time, noisy)
        return Reading(self._time, noisy, np.maximum(np.round(counts), 0.0))

    def set_valves(self, valves: NDArray[np.int8]) -> None:
        self._coming.append((self._time + self._physics.lag, np.array(valves)))

    def wait(self, seconds: float) -> None:
        end = self._time + seconds
        while self._time < end - 1e-9:
            while self._coming and self._coming[0][0] <= self._time + 1e-9:
                for pair, valves in zip(self._muscles, self._coming.pop(0)[1].tolist(), strict=True):
                    for muscle, valve in zip(pair, valves, strict=False):
                        muscle.valve = valve
            until = min([end, self._time + _STEP, *(when for when, _ in self._coming[:1])])
            self._move(until - self._time)
            self._time = until

    def _move(self, step: float) -> None:
        physics = self._physics
        filling = sum(muscle.valve > 0 for pair in self._muscles for muscle in pair)
        omega = 2 * math.pi * physics.swing
        for j, muscles in enumerate(self._muscles):
            for muscle in muscles:
                muscle.step(step, physics, max(filling - 1, 0))
            before, (first, *others) = self._angle[j], muscles
            against = others[0].pressure if others else physics.spring[0] + physics.spring[1] * before
            rest = physics.reach * (first.pressure - against)
            self._speed[j] += step * (omega**2 * (rest - before) - 2 * physics.damping * omega * self._speed[j])
            self._angle[j] = min(max(before + step * self._speed[j], -physics.stop), physics.stop)
            if abs(self._angle[j]) == physics.stop:
                self._speed[j] = 0.0
            turned = physics.squeeze * (self._angle[j] - before)
            for muscle, way in zip(muscles, (-1, 1), strict=False):
                muscle.squeeze(way * turned)

    def close(self) -> None:
        self.set_valves(np.zeros((self.spec.joints, 2), np.int8))


def linear() -> PlainArm:
    """Fast and coarse: pressures go straight to the supply, 8 bits without noise, 25 Hz, resting on its stops."""
    spec = ArmSpec(
        period=0.04,
        counts_per_degree=2.0,
        counts_per_bar=60.0,
        angle_range=(0.0, 255.0),
        max_pressure=2.0,
        name="linear",
    )
    return PlainArm(spec, Physics(lambda p: 4.0 * (2.5 - p), lambda p: 3.0 * p, 60.0, 50.0, 3.0, 0.3, 0.002))


def throttled() -> PlainArm:
    """Slow inlets, strong springs, 14 bits with noise, 60 Hz, and sensors that read 400 counts at atmosphere."""
    spec = ArmSpec(
        period=1 / 60,
        counts_per_degree=90.0,
        counts_per_bar=3000.0,
        angle_range=(0.0, 16383.0),
        max_pressure=1.2,
        name="throttled",
    )
    physics = Physics(
        lambda p: 0.25 * math.sqrt(max(1.3 - p, 0.0)),
        lambda p: 0.9 * math.sqrt(p),
        35.0,
        40.0,
        5.0,
        0.6,
        0.006,
        lag=0.02,
        noise=(12.0, 10.0),
        zero=400.0,
    )
    return PlainArm(spec, physics)


def hose() -> PlainArm:
    """A long hose with the sensors at its beginning, two joints on one supply that gives way, 20 Hz, 12 bits."""
    spec = ArmSpec(
        joints=2,
        period=0.05,
        counts_per_degree=20.0,
        counts_per_bar=900.0,
        angle_range=(0.0, 4095.0),
        max_pressure=1.5,
        name="hose",
    )
    physics = Physics(
        lambda p: 2.5 * (2.0 - p),
        lambda p: 2.0 * p,
        45.0,
        60.0,
        2.0,
        0.15,
        0.004,
        hose=0.06,
        lag=0.03,
        noise=(2.0, 3.0),
        sag=0.15,
    )
    return PlainArm(spec, physics)


def noisy() -> PlainArm:
    """Slow valves, and sensors whose noise of 0.3 degrees is most of what changes in a period; 25 Hz, 12 bits."""
    spec = ArmSpec(
        period=0.04,
        counts_per_degree=20.0,
        counts_per_bar=900.0,
        angle_range=(0.0, 4095.0),
        max_pressure=1.5,
        name="noisy",
    )
    physics = Physics(
        lambda p: 0.9 * max(2.0 - p, 0.0),
        lambda p: 0.9 * p,
        45.0,
        55.0,
        2.2,
        0.2,
        0.004,
        hose=0.03,
        lag=0.015,
        noise=(6.0, 10.0),
    )
    return PlainArm(spec, physics)


def single() -> PlainArm:
    """One muscle against a spring that grows stronger as it is stretched, 12 bits with noise, 25 Hz."""
    spec = ArmSpec(
        muscles=1,
        period=0.04,
        counts_per_degree=20.0,
        counts_per_bar=900.0,
        angle_range=(0.0, 4095.0),
        max_pressure=1.6,
        name="single",
    )
    physics = Physics(
        lambda p: 1.8 * math.sqrt(max(1.8 - p, 0.0)),
        lambda p: 2.0 * p**0.8,
        60.0,
        50.0,
        2.2,
        0.3,
        0.003,
        lag=0.01,
        noise=(2.0, 4.0),
        spring=(0.7, 0.004),
    )
    return PlainArm(spec, physics)


def single_angle_alone() -> PlainArm:
    """As :func:`single`, without a pressure sensor."""
    arm = single()
    arm.spec = replace(arm.spec, pressure_sensors=False, safe_supply=True, max_pressure=1.8)
    return arm


def with_pressures() -> PlainArm:
    """As :func:`angle_alone`, with pressure sensors."""
    arm = angle_alone()
    arm.spec = replace(arm.spec, pressure_sensors=True)
    return arm


def angle_alone() -> PlainArm:
    """No pressure sensors, a supply of 0.9 bar that muscles fill up to by a law of their own; 10 bits, 25 Hz."""
    spec = ArmSpec(
        period=0.04,
        counts_per_degree=8.0,
        angle_range=(0.0, 1023.0),
        max_pressure=0.9,
        pressure_sensors=False,
        safe_supply=True,
        name="angle alone",
    )
    physics = Physics(
        lambda p: 1.6 * math.sqrt(max(0.9 - p, 0.0)),
        lambda p: 2.2 * p**0.7,
        50.0,
        55.0,
        2.5,
        0.4,
        0.003,
        lag=0.01,
        noise=(0.7, 0.0),
    )
    return PlainArm(spec, physics)

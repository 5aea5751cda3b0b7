"""Arms whose joints stick, drawn at random, with physics that shares nothing with the virtual arm's: sound ones.

A muscle is a cylinder of inextensible fibre (C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1),
1996), its valves are orifices that choke (ISO 6358), and a joint has Coulomb and Stribeck friction with bristles that
bend before it slips (P. R. Dahl, 1968; C. Canudas de Wit et al., IEEE Trans. Automatic Control 40(3), 1995).
``python:tests.friction_arms:joint_7`` is arm 7 with one joint.
"""

import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import Arm, ArmSpec, Reading
from pneumarm.kernels import kernel

_ATMOSPHERE = 101_325.0  # Pa
_STEP = 5e-4  # s, at most
_CHUNK = 2e-3  # s, in which valves and the supply stay as they are
_RATES = 25.0, 30.0, 40.0, 50.0
_BITS = 10, 12, 14


class _Muscle(NamedTuple):
    """SI units; the conductance is that of orifices in volume by time and pressure, at atmosphere."""

    length: float
    diameter: float
    fibre: float
    """Angle of the fibre [rad]."""
    contracted: float
    """Contraction with the joint in its middle, as a share of the length."""
    filling: float
    emptying: float
    leak: float
    dead: float
    """Dead time of its valves [s]."""


class _Joint(NamedTuple):
    """SI units."""

    lever: float
    inertia: float
    coulomb: float
    """Torque of friction while it slides."""
    stribeck: float
    """What friction has besides while it sticks."""
    bristles: float
    """Stiffness of what bends before it slips."""
    viscous: float
    spring: float
    weight: float
    upright: float
    """Angle at which gravity has no hold [rad]."""
    stop: float
    """End stops either side [rad]."""
    stop_stiffness: float


@kernel
def _flow(upstream, downstream, conductance):  # type: ignore[no-untyped-def]
    ratio = downstream / upstream
    if ratio <= 0.35:
        return conductance * upstream
    return conductance * upstream * math.sqrt(max(1.0 - ((ratio - 0.35) / 0.65) ** 2, 0.0))


@kernel
def _step(joint, muscles, valves, state, pressure, supply, seconds):  # type: ignore[no-untyped-def]
    torque = 0.0
    for m in range(2):
        one, side = muscles[m], 1.0 - 2.0 * m
        contraction = one.contracted + side * joint.lever * state[0] / one.length
        section = math.pi / 4 * one.diameter**2
        volume = section * one.length * (1.0 + 1.8 * contraction - 1.2 * contraction**2)
        growth = section * joint.lever * side * (1.8 - 2.4 * contraction) * state[1]
        flow = -one.leak * (pressure[m] - _ATMOSPHERE)
        if valves[m] > 0:
            high, low = max(supply, pressure[m]), min(supply, pressure[m])
            flow += math.copysign(_flow(high, low, one.filling), supply - pressure[m])
        elif valves[m] < 0 and pressure[m] > _ATMOSPHERE:
            flow -= _flow(pressure[m], _ATMOSPHERE, one.emptying)
        pressure[m] += seconds * 1.2 / volume * (_ATMOSPHERE * flow - pressure[m] * growth)
        pressure[m] = max(pressure[m], 0.98 * _ATMOSPHERE)
        pull = 3 / math.tan(one.fibre) ** 2 * (1 - 1.15 * contraction) ** 2 - 1 / math.sin(one.fibre) ** 2
        torque += side * joint.lever * max(section * (pressure[m] - _ATMOSPHERE) * pull, 0.0)
    angle, speed, bend = state
    most = (joint.coulomb + joint.stribeck * math.exp(-((speed / 0.05) ** 2))) / joint.bristles
    bend = min(max(bend + seconds * (speed - abs(speed) * bend / most), -most), most)
    torque -= joint.bristles * bend + joint.viscous * speed + joint.spring * angle
    torque -= joint.weight * math.sin(angle + joint.upright)
    beyond = max(abs(angle) - joint.stop, 0.0)
    if beyond > 0:
        torque -= math.copysign(joint.stop_stiffness * beyond, angle)
    state[1] = speed + seconds * torque / joint.inertia
    state[0] = angle + seconds * state[1]
    state[2] = bend


@kernel
def _advance(joint, muscles, valves, state, pressure, supply, seconds):  # type: ignore[no-untyped-def]
    """Advance ``state`` (angle, speed, bend of the bristles) and ``pressure`` (2,) [Pa] by ``seconds``."""
    steps = math.ceil(seconds / _STEP)
    for _ in range(steps):
        _step(joint, muscles, valves, state, pressure, supply, seconds / steps)


class FrictionArm(Arm):
    """Arm ``seed``; without saved states, like hardware. No joint of it disturbs another, but their supply sags."""

    def __init__(self, seed: int, joints: int = 1) -> None:
        random = np.random.default_rng([seed, joints])
        self._supply = self._full = _ATMOSPHERE + 1e5 * random.uniform(1.3, 3.0)
        self._sag = 1e5 * random.uniform(0.0, 0.4)  # Pa/s for each inlet that is open
        drawn = [_drawn(random, self._full) for _ in range(joints)]
        self._joints, self._muscles = [one[0] for one in drawn], [one[1] for one in drawn]
        top = 2.0 ** random.choice(_BITS) - 1
        gauge = (self._full - _ATMOSPHERE) / 1e5
        self.spec = ArmSpec(
            name=f"friction arm {seed}",
            joints=joints,
            period=1 / random.choice(_RATES),
            counts_per_degree=top / random.uniform(110, 170),
            counts_per_bar=0.7 * top / gauge,
            angle_range=(0.0, top),
            max_pressure=max(gauge * random.choice([0.8, 1.02]), 1.0),
        )
        self._zero, self._bent = 0.1 * top, random.uniform(-3e-4, 3e-4)  # counts; of the potentiometer, 1/degree
        self._noise = self.spec.counts_per_degree * _spread(random, 0.02, 0.2), 1e-3 * top * _spread(random, 0.5, 3)
        self._random = random
        self._time = 0.0
        self._state = np.zeros((joints, 3))
        self._pressure = np.full((joints, 2), _ATMOSPHERE)
        self._valves = np.zeros((joints, 2))
        self._dead = np.array([[muscle.dead for muscle in pair] for pair in self._muscles])
        self._told: deque[tuple[float, NDArray[np.float64]]] = deque()  # what not all valves have answered yet

    def read(self) -> Reading:
        low, high = self.spec.angle_range
        degrees = np.degrees(self._state[:, 0])
        angle = (low + high) / 2 + self.spec.counts_per_degree * (degrees + self._bent * degrees**2)
        pressure = self._zero + self.spec.counts_per_bar * (self._pressure - _ATMOSPHERE) / 1e5
        said = [
            np.clip(np.round(value + noise * self._random.normal(size=value.shape)), low, high)
            for value, noise in zip((angle, pressure), self._noise, strict=True)
        ]
        return Reading(self._time, *said)

    def set_valves(self, valves: NDArray[np.int8]) -> None:
        self._told.append((self._time, np.array(valves, np.float64)))

    def wait(self, seconds: float) -> None:
        end = self._time + seconds
        while self._time < end - 1e-9:
            step = min(_CHUNK, end - self._time)
            for since, valves in self._told:
                answered = self._time >= since + self._dead - _CHUNK / 2
                self._valves = np.where(answered, valves, self._valves)
            while self._told and (self._time >= self._told[0][0] + self._dead - _CHUNK / 2).all():
                self._told.popleft()
            for j, joint in enumerate(self._joints):
                _advance(
                    joint, self._muscles[j], self._valves[j], self._state[j], self._pressure[j], self._supply, step
                )
            recovers = (self._full - self._supply) / 0.2
            self._supply += step * (recovers - self._sag * float((self._valves > 0).sum()))
            self._time += step

    def close(self) -> None:
        self.set_valves(np.zeros(self._valves.shape, np.int8))


def _spread(random: np.random.Generator, least: float, most: float) -> float:
    """Return a number drawn evenly by its logarithm."""
    return float(np.exp(random.uniform(np.log(least), np.log(most))))


def _drawn(random: np.random.Generator, supply: float) -> tuple[_Joint, tuple[_Muscle, _Muscle]]:
    """Return a joint and its muscles, on a ``supply`` [Pa]."""
    length, diameter = _spread(random, 0.12, 0.3), _spread(random, 0.012, 0.022)
    lever, fibre = length * random.uniform(0.18, 0.26), math.radians(random.uniform(22, 28))
    section, fills_in = math.pi / 4 * diameter**2, 0.25 / _spread(random, 0.35, 2.0)
    conductance = 1.3 * section * length / (fills_in * supply)
    contracted, torque = random.uniform(0.1, 0.16), 0.5 * section * (supply - _ATMOSPHERE) * lever
    friction, swing = torque * _spread(random, 0.01, 0.06), 2 * math.pi * _spread(random, 1.2, 4.5)
    inertia = 2 * torque / swing**2

    def muscle() -> _Muscle:
        filling, emptying, leak = conductance * random.uniform([0.8, 0.8, 0.0], [1.2, 1.8, 0.01])
        thick = diameter * random.uniform(0.85, 1.15)
        return _Muscle(
            length, thick, fibre, contracted, filling, emptying, leak, dead=float(random.uniform(0.002, 0.02))
        )

    return _Joint(
        lever,
        inertia,
        coulomb=friction,
        stribeck=friction * random.uniform(0, 0.5),
        bristles=friction / math.radians(_spread(random, 0.1, 0.6)),
        viscous=2 * random.uniform(0.05, 0.25) * inertia * swing,
        spring=torque * random.uniform(0, 0.5),
        weight=torque * random.uniform(0, 0.35),
        upright=random.uniform(-math.pi, math.pi),
        stop=math.radians(random.uniform(28, 60)),
        stop_stiffness=80 * torque,
    ), (muscle(), muscle())


def __getattr__(name: str) -> Callable[[], FrictionArm]:
    """Return what makes the arm called ``joint_N`` or ``joints_N``, which has two joints."""
    kind, _, seed = name.partition("_")
    if kind not in ("joint", "joints") or not seed.isdigit():
        raise AttributeError(f"arms here are called joint_7 or joints_7, not {name}")
    return lambda: FrictionArm(int(seed), 1 + (kind == "joints"))

"""A virtual arm that is wired, built or worn wrongly: what passes between it and the world goes through a fault."""

from dataclasses import replace

import numpy as np

from pneumarm.arm import Arm
from pneumarm.arm.virtual import VirtualArm, draw_parameters


class FaultyArm(Arm):
    """Arm ``seed`` with changed valves, changed readings, and sensors that remember."""

    def __init__(self, seed, *, valves=None, angle=None, pressure=None, parameters=None):
        drawn = draw_parameters(seed)
        self.arm = VirtualArm(parameters(drawn) if parameters else drawn, seed=seed)
        self.spec = replace(self.arm.spec, name="faulty")
        self._valves, self._angle, self._pressure = valves, angle, pressure
        self._applied = np.zeros((self.spec.joints, 2), np.int8)
        self._since = 0.0

    def read(self):
        reading = self.arm.read()
        angle, pressure = reading.angle, reading.pressure
        if self._angle:
            angle = np.round(np.clip(self._angle(angle.copy()), 0, 1023))
        if self._pressure:
            pressure = np.maximum(
                np.round(self._pressure(pressure.copy(), self._applied, reading.time - self._since)), 0
            )
        return replace(reading, angle=angle, pressure=pressure)

    def set_valves(self, valves):
        if not np.array_equal(valves, self._applied):
            self._since = self.arm.time
        self._applied = np.array(valves)
        self.arm.set_valves(self._valves(np.array(valves)) if self._valves else valves)

    def wait(self, seconds):
        self.arm.wait(seconds)

    def close(self):
        self.arm.close()


def stuck(muscle, value, to):
    """Valves of ``muscle`` that are set to ``to`` where ``value`` is asked for."""

    def apply(valves):
        valves[:, muscle] = np.where(valves[:, muscle] == value, to, valves[:, muscle])
        return valves

    return apply


def inlet_and_exhaust(muscle):
    def apply(valves):
        valves[:, muscle] *= -1
        return valves

    return apply


def logarithmic(curvature):
    """The track of a logarithmic potentiometer."""
    return lambda angle: 1023 * np.expm1(curvature * angle / 1023) / np.expm1(curvature)


def at_the_valve(height):
    """Pressure sensors at the valves' side: they read the supply's side of the inlet while air flows (A.1.1)."""

    def apply(pressure, valves, since):
        flow = height * np.clip((since - 0.012) / 0.003, 0, 1)
        lag = height * np.exp(-max(since - 0.012, 0) / 0.004)
        apply.open = np.where(valves > 0, True, apply.open & (since < 0.1))
        return pressure + np.where(valves > 0, flow, np.where((valves == 0) & apply.open, lag, 0))

    apply.open = False
    return apply


def muscle_changed(muscle, **factors):
    """Parameters with some of one muscle's multiplied."""

    def change(parameters):
        joint = parameters.joints[0]
        changed = replace(
            joint.muscles[muscle], **{name: f * getattr(joint.muscles[muscle], name) for name, f in factors.items()}
        )
        both = tuple(changed if m == muscle else joint.muscles[m] for m in range(2))
        return replace(parameters, joints=(replace(joint, muscles=both),))

    return change


def sensors_changed(**values):
    return lambda parameters: replace(parameters, sensors=replace(parameters.sensors, **values))


def supply(bar):
    return lambda parameters: replace(parameters, air=replace(parameters.air, supply=bar * 1e5))


def coloured(angle, state={"last": 0.0}, random=np.random.default_rng(0)):  # noqa: B006 - the noise remembers
    state["last"] = 0.9 * state["last"] + random.normal(0, 1.5)
    return angle + state["last"]


FAULTS = {
    "muscles swapped": lambda seed: FaultyArm(seed, valves=lambda v: v[:, ::-1].copy()),
    "pressure sensors swapped": lambda seed: FaultyArm(seed, pressure=lambda p, v, s: p[:, ::-1]),
    "valves swapped": lambda seed: FaultyArm(seed, valves=inlet_and_exhaust(1)),
    "inlet stuck closed": lambda seed: FaultyArm(seed, valves=stuck(0, 1, 0)),
    "exhaust stuck closed": lambda seed: FaultyArm(seed, valves=stuck(1, -1, 0)),
    "exhaust stuck open": lambda seed: FaultyArm(seed, valves=stuck(0, 0, -1)),
    "inlet stuck open": lambda seed: FaultyArm(seed, valves=stuck(1, 0, 1)),
    "low supply": lambda seed: FaultyArm(seed, parameters=supply(0.6)),
    "leak": lambda seed: FaultyArm(seed, parameters=muscle_changed(0, leak=40.0)),
    "angle reversed": lambda seed: FaultyArm(seed, angle=lambda a: 1023 - a),
    "angle dead": lambda seed: FaultyArm(seed, angle=lambda a: 0 * a),
    "angle frozen": lambda seed: FaultyArm(seed, angle=lambda a: 0 * a + 700),
    "pressure frozen": lambda seed: FaultyArm(seed, pressure=lambda p, v, s: p * [[1, 0]]),
    "angle logarithmic": lambda seed: FaultyArm(seed, angle=logarithmic(3.0)),
    "angle worn": lambda seed: FaultyArm(seed, parameters=sensors_changed(wear=25.0, wear_seed=seed)),
    "pressure at the valve's side": lambda seed: FaultyArm(seed, pressure=at_the_valve(35)),
    "noise not white": lambda seed: FaultyArm(seed, angle=coloured),
}
"""Faults by what the check-up calls them."""

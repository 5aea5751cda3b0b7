"""What classical controllers need to know of an arm, measured on it in two or three minutes.

First all muscles are vented, filled and vented again, twice: filling and emptying rates by pressure, and the dead
time. Then joint by joint pressures of a grid are set and left alone with closed valves: the static map, from below
and from above, so that half of the hysteresis lies on either side.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec, GuardedArm, Reading
from pneumarm.classical.pressure_loop import PressureLoop, Rates
from pneumarm.classical.static_map import StaticMap, fit_map
from pneumarm.errors import ArmFailure
from pneumarm.progress import Report

_VENT, _FILL, _PAUSE = 2.0, 2.5, 0.3
"""Times that all muscles are vented, filled, and left closed in between [s]."""
_SUMS = (0.4, 0.7, 1.0, 1.3, 1.6)
"""Sums of both pressures at which the map is measured, in units of the highest pressure."""
_RATIOS = (-0.96, -0.8, -0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6, 0.8, 0.96)
_SETTING, _RESTING, _LOOKING = 0.6, 0.8, 0.25
"""Times to set the pressures of a point of the map, to let the joint come to rest, and to read it [s]."""
_MARGIN = 0.97
"""Pressures are asked for up to so much of the highest that there is."""
_NODES = 13

_Curve = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Times [s] and pressures [bar], each of shape (n,)."""


@dataclass(frozen=True)
class Calibration:
    """What was measured of an arm."""

    maps: tuple[StaticMap, ...]
    """Static map of each joint."""
    rates: tuple[tuple[Rates, Rates], ...]
    """Rates of each joint's two muscles."""
    goal_range: tuple[tuple[float, float], ...]
    """Angles that each joint came to rest at, lowest and highest [counts]."""
    seconds: float
    """Arm time that it took [s]."""


@dataclass
class _Watched:
    """Readings of a stretch of time with the same valves."""

    time: NDArray[np.float64]
    """Since the valves were set, shape (n,) [s]."""
    angle: NDArray[np.float64]
    """Shape (n, joints) [counts]."""
    pressure: NDArray[np.float64]
    """Shape (n, joints, 2) [bar]."""


def measure_calibration(arm: GuardedArm, report: Report | None = None) -> Calibration:
    """Measure ``arm``, which is free to move all the way.

    Raises:
        ArmFailure: its pressures or its angles do not answer to its valves.

    """
    begin = arm.read().time
    arm.make_ready()
    rates = _measure_rates(arm)
    maps, ranges = [], []
    for joint in range(arm.spec.joints):
        points = _rest_points(arm, joint, rates[joint], lambda: report and report(arm.read().time - begin, 0.0))
        pressures, angles = np.array([p for p, _ in points]), np.array([a for _, a in points])
        highest = _MARGIN * float(rates[joint][0].pressures[-1])
        low, high = float(angles.min()), float(angles.max())
        if high - low < arm.spec.counts_per_degree:
            raise ArmFailure(f"{arm.spec.name}: joint {joint + 1} does not move with its pressures; check the arm")
        maps.append(fit_map(pressures, angles, [share * highest for share in _SUMS], _RATIOS, highest))
        ranges.append((low, high))
    arm.set_valves(np.zeros(arm.applied.shape, np.int8))
    return Calibration(tuple(maps), rates, tuple(ranges), arm.read().time - begin)


def calibration_seconds(spec: ArmSpec) -> float:
    """Return about how long :func:`calibrate` takes on an arm [s]."""
    rates = _VENT + 2 * (_FILL + _PAUSE + _VENT)
    point = _SETTING + _RESTING + _LOOKING + spec.period
    points = sum(2 * len(_ratios(share)) for share in _SUMS)
    return rates + spec.joints * points * point


def _watch(arm: GuardedArm, valves: NDArray[np.int8], seconds: float) -> _Watched:
    """Set ``valves`` (joints, 2) and read once a control period for ``seconds``; the valves stay as they are."""
    begin = arm.read().time
    arm.set_valves(valves)
    readings: list[Reading] = []
    while True:
        readings.append(arm.watch())
        if readings[-1].time - begin >= seconds:
            break
        arm.wait(arm.spec.period)
    time = np.array([one.time - begin for one in readings])
    pressure = arm.spec.bar([one.pressure for one in readings])
    return _Watched(time, np.array([one.angle for one in readings]), pressure)


def _measure_rates(arm: GuardedArm) -> tuple[tuple[Rates, Rates], ...]:
    full = np.ones(arm.applied.shape, np.int8)
    _watch(arm, -full, _VENT)
    filled, vented = [], []
    for _ in range(2):
        filled.append(_watch(arm, full, _FILL))
        _watch(arm, 0 * full, _PAUSE)
        vented.append(_watch(arm, -full, _VENT))
    return tuple(
        (_rates(arm, filled, vented, j, 0), _rates(arm, filled, vented, j, 1)) for j in range(arm.spec.joints)
    )


def _rates(arm: GuardedArm, filled: Sequence[_Watched], vented: Sequence[_Watched], joint: int, muscle: int) -> Rates:
    up = [(one.time, one.pressure[:, joint, muscle]) for one in filled]
    down = [(one.time, one.pressure[:, joint, muscle]) for one in vented]
    highest = min(float(np.mean([p[-3:].mean() for _, p in up])), arm.spec.max_pressure)
    if not highest > 0.1:
        raise ArmFailure(
            f"{arm.spec.name}: joint {joint + 1}, muscle {muscle + 1} reads {highest:.2f} bar after {_FILL} s of "
            "air; check the supply and the arm with `pneumarm arm check`"
        )
    nodes = np.linspace(0.0, highest, _NODES)
    dead = [_dead_time(time, p, highest) for time, p in (*up, *down)]
    return Rates(
        pressures=tuple(nodes.tolist()),
        filling=tuple(_rate_at(nodes, up, highest, 1.0).tolist()),
        emptying=tuple(_rate_at(nodes, down, highest, -1.0).tolist()),
        dead_time=float(np.clip(np.median(dead), 0.0, 0.1)),
    )


def _dead_time(time: NDArray[np.float64], pressure: NDArray[np.float64], highest: float) -> float:
    """Return when a pressure began to change: where the parabola through its first third meets what it began at."""
    moved = np.abs(pressure - pressure[0]) / highest
    reached = int(np.argmax(moved > 0.45))
    chosen = np.flatnonzero((moved > 0.04) & (np.arange(len(moved)) <= reached))
    if len(chosen) < 3:
        return 0.0
    # Time as a function of the change: well-behaved, as the change rises.
    return float(np.polynomial.polynomial.polyfit(moved[chosen], time[chosen], 2 if len(chosen) > 4 else 1)[0])


def _rate_at(
    nodes: NDArray[np.float64],
    curves: Sequence[_Curve],
    highest: float,
    way: float,
) -> NDArray[np.float64]:
    """Return the rates [bar/s], positive, at the pressures ``nodes``: a cubic through differences of ``curves``."""
    middles, rates = [], []
    for time, pressure in curves:
        # Over 40 ms or a period, whichever is longer, for the noise of the sensors.
        stride = max(1, round(0.04 / float(np.median(np.diff(time)))))
        middles.append((pressure[stride:] + pressure[:-stride]) / 2)
        rates.append(way * (pressure[stride:] - pressure[:-stride]) / (time[stride:] - time[:-stride]))
    middle, rate = np.concatenate(middles), np.concatenate(rates)
    begin, end = (0.03, 0.97) if way > 0 else (0.03, 0.9)
    chosen = (middle > begin * highest) & (middle < end * highest) & (rate > 0)
    if chosen.sum() < 6:
        raise ArmFailure(f"pressures change too fast or too slowly to measure: {int(chosen.sum())} usable readings")
    fitted = np.polynomial.Polynomial.fit(middle[chosen], rate[chosen], 3)
    inside = np.clip(nodes, middle[chosen].min(), middle[chosen].max())
    if way < 0:  # what empties ends at 0
        return np.maximum(fitted(inside), 0.0) * np.minimum(nodes / inside, 1.0)
    return np.maximum(fitted(inside), 0.0)


def _rest_points(
    arm: GuardedArm, joint: int, rates: tuple[Rates, Rates], tell: Callable[[], Any]
) -> list[tuple[NDArray[np.float64], float]]:
    """Return pressures (2,) [bar] and the angles [counts] at which ``joint`` came to rest with them."""
    highest = _MARGIN * min(one.pressures[-1] for one in rates)
    found = []
    for share in _SUMS:
        total = share * highest
        ratios = _ratios(share)
        for ratio in [*ratios, *ratios[::-1]]:
            found.append(_rest_point(arm, joint, rates, (total * (1 + ratio) / 2, total * (1 - ratio) / 2)))
            tell()
    return found


def _ratios(share: float) -> list[float]:
    """Return the ratios at which no muscle needs more than the highest pressure, of which both have ``share``."""
    return [one for one in _RATIOS if share * (1 + abs(one)) / 2 <= 1]


def _rest_point(
    arm: GuardedArm, joint: int, rates: tuple[Rates, Rates], wanted: tuple[float, float]
) -> tuple[NDArray[np.float64], float]:
    spec = arm.spec
    loops = [PressureLoop(one, spec.period, 0.0, None, 1.0, 0.0, 1.0) for one in rates]
    valves = np.zeros(arm.applied.shape, np.int8)
    for _ in range(round(_SETTING / spec.period)):
        pressure = spec.bar(arm.watch().pressure[joint])
        for m, loop in enumerate(loops):
            command = loop.command(wanted[m], loop.read(float(pressure[m])))
            loop.commanded(command)
            valves[joint, m] = round(command)
        arm.set_valves(valves)
        arm.wait(spec.period)
    valves[joint] = 0
    _watch(arm, valves, _RESTING)
    seen = _watch(arm, valves, _LOOKING)
    return seen.pressure[:, joint].mean(axis=0), float(seen.angle[:, joint].mean())

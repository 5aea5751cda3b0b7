"""References by their names: sinusoids, ramps, minimum-jerk moves, steps and recorded movements from files.

Degrees in them are counted from the middle of the range of the arm's angle sensor.
"""

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm import ArmSpec
from pneumarm.arm.reference import Reference
from pneumarm.errors import UnusableInput
from pneumarm.files import read_rows

FORMS = (
    "sine:0.5Hz,20deg, ramp:30deg/s,20deg, minimum-jerk:1s,20deg, steps:FILE.csv, or FILE.csv of time [s] and "
    "degrees of each joint"
)
"""What a reference can be, for people."""
_NUMBER = re.compile(r"([+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?|[+-]?\.\d+)\s*([a-zA-Z/]*)")
Shape = Callable[[float], float]


def parse_reference(text: str, spec: ArmSpec, *, known_ahead: bool = True) -> Reference:
    """Return the reference called ``text`` for an arm of ``spec``.

    Raises:
        UnusableInput: there is none of this name, or its file cannot be read or holds something else.

    """
    kind, colon, rest = text.partition(":")
    if colon and kind in _WAVES:
        found = _wave(text, kind, rest, spec)
    elif colon and kind == "steps":
        found = _from_file(Path(rest), spec, jumps=True)
    elif text.endswith(".csv"):
        found = _from_file(Path(text), spec, jumps=False)
    else:
        raise UnusableInput(f"reference {text!r}: expected {FORMS}")
    return replace(found, known_ahead=known_ahead)


def check_reachable(reference: Reference, seconds: float, goal_range: NDArray[np.float64], spec: ArmSpec) -> None:
    """Raise UnusableInput where ``reference`` leaves ``goal_range`` (joints, 2) [counts] within ``seconds``."""
    times = np.arange(0.0, seconds + spec.period, spec.period)
    angles = np.array([reference.at(float(time)) for time in times])
    for j, (low, high) in enumerate(goal_range):
        if angles[:, j].min() < low or angles[:, j].max() > high:
            lowest, highest = spec.degrees([angles[:, j].min(), angles[:, j].max()])
            known = spec.degrees([low, high])
            raise UnusableInput(
                f"the reference asks joint {j + 1} for {lowest:.1f} to {highest:.1f} degrees; its goals lie from "
                f"{known[0]:.1f} to {known[1]:.1f}, where it was often enough to be known; choose a smaller one"
            )


def counts_of(degrees: ArrayLike, spec: ArmSpec) -> NDArray[np.float64]:
    """Return angles in degrees as counts: the inverse of :meth:`~pneumarm.arm.ArmSpec.degrees`."""
    return sum(spec.angle_range) / 2 + np.asarray(degrees, np.float64) * spec.counts_per_degree


def minimum_jerk(share: float) -> float:
    """Return how much of a minimum-jerk move is done after a ``share`` of its time, both from 0 to 1."""
    s = min(max(share, 0.0), 1.0)
    return s**3 * (10 - 15 * s + 6 * s * s)


def _sine(frequency: float, amplitude: float) -> Shape:
    return lambda time: math.sin(2 * math.pi * frequency * time)


def _ramp(speed: float, amplitude: float) -> Shape:
    def triangle(time: float) -> float:
        phase = (time * speed / amplitude + 1) % 4  # of four amplitudes
        return phase - 1 if phase <= 2 else 3 - phase

    return triangle


def _back_and_forth(seconds: float, amplitude: float) -> Shape:
    def moves(time: float) -> float:
        number, within = divmod(time, seconds)
        way = 2 * minimum_jerk(within / seconds) - 1
        return way if number % 2 == 0 else -way

    return moves


_WAVES: dict[str, tuple[tuple[str, ...], Callable[[float, float], Shape]]] = {
    "sine": (("Hz",), _sine),
    "ramp": (("deg/s",), _ramp),
    "minimum-jerk": (("s",), _back_and_forth),
}
"""By name: the units of the first number, and what makes the shape, of amplitude 1, of it and of the amplitude."""


def _wave(text: str, kind: str, rest: str, spec: ArmSpec) -> Reference:
    units, shape = _WAVES[kind]
    first, *amplitudes = rest.split(",")
    rate = _quantity(text, first, units)
    given = [_quantity(text, one, ("deg",)) for one in amplitudes]
    if len(given) == 1:
        given *= spec.joints
    if len(given) != spec.joints:
        raise UnusableInput(f"reference {text!r}: expected one amplitude or {spec.joints}, got {len(given)}")
    middle = sum(spec.angle_range) / 2
    counts = np.array(given) * spec.counts_per_degree
    shapes = [shape(rate, amplitude) for amplitude in given]
    return Reference(lambda time: middle + counts * np.array([one(max(time, 0.0)) for one in shapes]))


def _quantity(text: str, part: str, units: tuple[str, ...]) -> float:
    """Return the number in ``part``, which has one of ``units`` or none and is above 0."""
    found = _NUMBER.fullmatch(part.strip())
    value = float(found[1]) if found else math.nan
    if not found or found[2] not in ("", *units) or not (math.isfinite(value) and value > 0):
        raise UnusableInput(f"reference {text!r}: expected a number above 0 in {units[0]}, got {part!r}; see {FORMS}")
    return value


def _from_file(path: Path, spec: ArmSpec, *, jumps: bool) -> Reference:
    """Return what the file says: held until its next row where it ``jumps``, else with a cubic between."""
    expected = f"rows of rising times [s] and the degrees of {spec.joints} joint(s)"
    rows, width = read_rows(path, expected), 1 + spec.joints
    expected = f"{path}: expected {expected}"

    def numbers() -> Iterator[float]:
        for k, row in enumerate(rows):
            if k > 0 or _NUMBER.fullmatch(row[0].strip()):  # else a header
                if len(row) != width:
                    raise ValueError(f"row {k + 1} has {len(row)} cell(s)")
                yield from map(float, row)

    try:
        values = np.fromiter(numbers(), np.float64).reshape(-1, width)
    except ValueError as error:
        raise UnusableInput(f"{expected}; {error}") from error
    if not len(values):
        raise UnusableInput(f"{expected}; there is none")
    times = values[:, 0] - values[0, 0]
    if not (np.isfinite(values).all() and (np.diff(times) > 0).all()):
        raise UnusableInput(f"{expected}; a number is not finite or a time is not after the one before")
    angles = counts_of(values[:, 1:], spec)
    return _held(times, angles) if jumps else through(times, angles)


def _held(times: NDArray[np.float64], angles: NDArray[np.float64]) -> Reference:
    """Return the reference that jumps to each of the ``angles`` (n, joints) [counts] at its time and stays there."""

    def at(time: float) -> NDArray[np.float64]:
        return angles[max(int(np.searchsorted(times, time, "right")) - 1, 0)]

    return Reference(at, smooth=False, duration=float(times[-1]))


def through(times: NDArray[np.float64], angles: NDArray[np.float64]) -> Reference:
    """Return the reference through ``angles`` (n, joints) [counts] at ``times`` (n,) [s], with a cubic between."""
    slopes = np.gradient(angles, times, axis=0) if len(times) > 1 else np.zeros_like(angles)

    def at(time: float) -> NDArray[np.float64]:
        if not times[0] < time < times[-1]:
            return angles[0 if time <= times[0] else -1]
        i = int(np.searchsorted(times, time, "right")) - 1
        step = times[i + 1] - times[i]
        s = (time - times[i]) / step
        way = s * s * (3 - 2 * s)
        bent = s * (1 - s) * step * ((1 - s) * slopes[i] - s * slopes[i + 1])
        return angles[i] + way * (angles[i + 1] - angles[i]) + bent

    return Reference(at, duration=float(times[-1]))

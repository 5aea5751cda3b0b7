"""What is known of an arm, in a file of its own: its spec, and what its sensors need to be put right.

An ``arm.toml`` holds a table ``[spec]`` with the fields of :class:`~pneumarm.arm.ArmSpec`, and, where a calibration
found that readings must be corrected, a table ``[correction]`` with those of :class:`SensorCorrection`, and a table
``[sound]`` with what the arm did then, those of :class:`SoundState`. ``pneumarm setup`` keeps what was answered in a
table ``[setup]`` until the arm is calibrated, see :class:`Answers`::

    [spec]
    joints = 1
    period = 0.03333333333333333
    counts_per_degree = 11.378
    counts_per_bar = 166.0
    angle_range = [12.0, 1009.0]

    [correction]
    pressure_zero = [[41.0, 40.5]]

    [sound]
    leak = [[0.025, 0.037]]
    leak_error = [[0.0007, 0.0007]]
    ends = [[160.5, 870.0]]

Further sensors are named in the spec, those on a controller's extra channels with the channel and what its counts
are worth; this is an LM35 on the second muscle, 10 mV a degree on a converter of 5 V::

    velocity_sensor = true
    sensors = [{kind = "temperature", joint = 1, muscle = 2, channel = 1, scale = 0.489}]
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec, Sensor
from pneumarm.errors import UnusableInput
from pneumarm.files import as_toml, read_toml, write_text
from pneumarm.settings import NonNegativeInt, PositiveFloat

_LARGEST = 1 << 18
"""Largest file that is read [bytes]: a thousand times what it needs."""


@dataclass(frozen=True)
class SensorCorrection:
    """What is done to the raw counts of an arm's sensors, before anybody else sees them."""

    pressure_zero: tuple[tuple[float, float], ...] = ()
    """What each pressure sensor reads at atmosphere, (joints, 2) [counts]; it is subtracted. None by default."""
    pressure_gain: tuple[tuple[float, float], ...] = ()
    """What each pressure is then multiplied by, (joints, 2), so that all sensors have the same counts per bar."""
    angle_raw: tuple[tuple[float, ...], ...] = ()
    """For each joint the raw counts, rising, at which the linearisation table knows the true angle [counts]."""
    angle_true: tuple[tuple[float, ...], ...] = ()
    """For each joint what a linear potentiometer would read there, rising [counts]."""

    def __post_init__(self) -> None:
        for name in ("pressure_zero", "pressure_gain"):
            _require(all(map(_finite, getattr(self, name))), name, "two finite numbers a joint")
        _require(all(g > 0 for pair in self.pressure_gain for g in pair), "pressure_gain", "positive numbers")
        _require(len(self.angle_raw) == len(self.angle_true), "angle_true", "as many tables as angle_raw")
        for raw, true in zip(self.angle_raw, self.angle_true, strict=True):
            _require(_rising(raw), "angle_raw", "at least two rising numbers a joint")
            _require(_rising(true), "angle_true", "at least two rising numbers a joint")
            _require(len(raw) == len(true), "angle_true", "as many numbers as angle_raw")

    @property
    def is_none(self) -> bool:
        """Whether nothing is corrected."""
        return not any(asdict(self).values())

    def fits(self, joints: int) -> bool:
        """Return whether every table that is there is for ``joints`` joints."""
        return all(len(table) in (0, joints) for table in asdict(self).values())

    def angle(self, raw: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the corrected angles (joints,) [counts]; beyond its ends a table goes on straight."""
        if not self.angle_raw:
            return raw
        pairs = zip(self.angle_raw, self.angle_true, strict=True)
        return np.array([_interpolated(r, *table) for r, table in zip(raw.tolist(), pairs, strict=True)])

    def pressure(self, raw: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the corrected pressures (..., joints, 2) [counts]."""
        shifted = raw - np.asarray(self.pressure_zero) if self.pressure_zero else raw
        return shifted * np.asarray(self.pressure_gain) if self.pressure_gain else shifted


def _interpolated(value: float, raw: Sequence[float], true: Sequence[float]) -> float:
    i = min(max(int(np.searchsorted(raw, value)), 1), len(raw) - 1)
    return true[i - 1] + (value - raw[i - 1]) * (true[i] - true[i - 1]) / (raw[i] - raw[i - 1])


def _finite(values: Sequence[float]) -> bool:
    return all(map(math.isfinite, values))


def _rising(values: Sequence[float]) -> bool:
    return len(values) >= 2 and _finite(values) and all(a < b for a, b in pairwise(values))


def _require(valid: bool, name: str, expected: str) -> None:
    if not valid:
        raise UnusableInput(f"Correction: {name} needs {expected}")


@dataclass(frozen=True)
class SoundState:
    """What a sound arm did when it was calibrated; a later check-up is compared with it. In corrected counts."""

    leak: tuple[tuple[float, float], ...]
    """Part of its pressure that each closed muscle lost, (joints, 2) [1/minute]."""
    leak_error: tuple[tuple[float, float], ...]
    """Standard error of that, (joints, 2) [1/minute]."""
    ends: tuple[tuple[float, float], ...]
    """Angles with muscle 2 full and with muscle 1 full, (joints, 2) [counts]."""

    def __post_init__(self) -> None:
        for name, values in vars(self).items():
            if not all(map(_finite, values)):
                raise UnusableInput(f"SoundState: {name} needs two finite numbers a joint")
        if not all(error >= 0 for pair in self.leak_error for error in pair):
            raise UnusableInput("SoundState: leak_error needs numbers that are not negative")


@dataclass(frozen=True)
class Answers:
    """What a person has answered to ``pneumarm setup`` so far, of an arm that is not calibrated yet."""

    questions: NonNegativeInt = 0
    """Questions about the arm that are answered; the answers are in the spec."""
    supply: PositiveFloat | None = None
    """Pressure of the supply [bar gauge]."""
    valves: NonNegativeInt = 0
    """Valves that were heard to click, in their order."""
    turned: NonNegativeInt = 0
    """Joints whose angle has followed the hand."""
    angles: tuple[tuple[float, float], ...] = ()
    """Angles of the first joints with muscle 2 full and with muscle 1 full, by a protractor [degrees]."""

    def __post_init__(self) -> None:
        if not all(map(_rising, self.angles)):
            raise UnusableInput("[setup] angles needs a lower and a higher one a joint")


@dataclass(frozen=True)
class ArmFile:
    """The content of an ``arm.toml``."""

    spec: ArmSpec
    correction: SensorCorrection = SensorCorrection()
    sound: SoundState | None = None
    setup: Answers | None = None

    def __post_init__(self) -> None:
        if not self.correction.fits(self.spec.joints):
            raise UnusableInput(f"the correction must be for {self.spec.joints} joint(s), as the spec is")
        if self.sound is not None and any(len(v) != self.spec.joints for v in vars(self.sound).values()):
            raise UnusableInput(f"the sound state must be for {self.spec.joints} joint(s), as the spec is")


def load_spec(path: Path | str) -> ArmSpec:
    """Return the spec in the file at ``path``.

    Raises:
        UnusableInput: it cannot be read, or holds anything that is not known or not possible.

    """
    return load_arm_file(path).spec


def save_spec(spec: ArmSpec, path: Path | str) -> None:
    """Write ``spec`` to ``path``, whole or not at all.

    Raises:
        UnusableInput: the folder is missing or cannot be written.

    """
    save_arm_file(ArmFile(spec), path)


def load_arm_file(path: Path | str) -> ArmFile:
    """Return what the file at ``path`` says of an arm.

    Raises:
        UnusableInput: it cannot be read, or holds anything that is not known or not possible.

    """
    expected = "what is known of an arm, as pneumarm arm calibrate writes it"
    found = read_toml(path, expected, _LARGEST)
    try:
        _refuse_unknown(found, ArmFile, "")
        parts = {"spec": ArmSpec, "correction": SensorCorrection, "sound": SoundState, "setup": Answers}
        for part, kind in parts.items():
            if isinstance(found.get(part), dict):
                _refuse_unknown(found[part], kind, f"[{part}] ")
        for sensor in _tables(found.get("spec"), "sensors"):
            _refuse_unknown(sensor, Sensor, "[spec] sensors: ")
        return msgspec.convert(found, ArmFile)
    except (msgspec.MsgspecError, UnusableInput) as error:
        raise UnusableInput(f"{path}: expected {expected}; {error}") from error


def save_arm_file(known: ArmFile, path: Path | str) -> None:
    """Write what is ``known`` of an arm to ``path``, whole or not at all.

    Raises:
        UnusableInput: the folder is missing or cannot be written.

    """
    tables = {"spec": asdict(known.spec)}
    if not known.correction.is_none:
        tables["correction"] = asdict(known.correction)
    if known.sound is not None:
        tables["sound"] = asdict(known.sound)
    if known.setup is not None:
        tables["setup"] = asdict(known.setup)
    lines = ["# An arm as pneumarm knows it: angles and pressures in sensor counts, times in seconds."]
    for name, table in tables.items():
        entries = [f"{key} = {as_toml(value)}" for key, value in table.items() if value is not None and value != ()]
        lines += ["", f"[{name}]", *entries]
    write_text(Path(path), "\n".join(lines) + "\n")


def _refuse_unknown(found: Mapping[str, Any], kind: type, place: str) -> None:
    known = [field.name for field in fields(kind)]
    unknown = [name for name in found if name not in known]
    if unknown:
        raise UnusableInput(f"{place}{', '.join(unknown)} is unknown; known are {', '.join(known)}")


def _tables(table: Any, name: str) -> list[dict[str, Any]]:
    """Return the tables in the list ``name`` of ``table``; what is no table is refused by its type elsewhere."""
    listed = table.get(name) if isinstance(table, dict) else None
    return [one for one in listed if isinstance(one, dict)] if isinstance(listed, list) else []

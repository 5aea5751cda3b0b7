"""Import a recording made elsewhere into a store, by a mapping file (TOML) that says what its columns are.

It is CSV, Parquet, or a dataset of LeRobot (:mod:`pneumarm.transitions.parquet`).

Beside a recording that pneumarm exported lies its mapping. One with every setting that is not of an arm's spec::

    sequence = "episode"          # column that changes where a new sequence begins; optional
    time = "t_s"                  # column of the time [s]; without it rows are one period apart
    commands = "continuous"       # or "valves": then commands must be -1, 0, +1; or "pulses": from -1 to +1

    [arm]                         # fields of ArmSpec but joints; the period is needed
    period = 0.01

    [[joint]]                     # as often as the arm has joints
    angle = { column = "angle_rad", unit = "rad" }                    # rad, deg, counts
    pressure_1 = { column = "p1", unit = "normalised", full_scale = 1.0 }   # bar, counts, normalised
    pressure_2 = { column = "p2", unit = "bar", range = [-0.1, 1.3] }
    command_1 = { column = "a1" }
    command_2 = { column = "a2" }
    velocity = { column = "w", unit = "deg/s" }                       # rad/s, deg/s, counts/ms; this and the rest
    acceleration = { column = "a" }                                   # [m/s2] are for further sensors
    temperature_1 = { column = "t1" }                                 # [Celsius]; temperature_2 alike

``full_scale`` is the pressure [bar] of a normalised 1. ``range`` are the least and the most that a column may hold,
in its own unit; by default the arm's range of the angle, and -0.2 to 1.2 times its largest pressure. An arm that
measures no pressures says so by ``pressure_sensors = false`` in ``[arm]`` and has no columns of them; they are
estimated from the commands of each sequence, at whose begin all muscles count as vented.
"""

import csv
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Literal, TextIO

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.address import StoreAddress
from pneumarm.arm.fill import filled
from pneumarm.arm.seam import ArmSpec, Sensor
from pneumarm.errors import UnusableInput
from pneumarm.files import read_toml
from pneumarm.transitions.lerobot import MAPPING
from pneumarm.transitions.parquet import is_parquet, lines_of
from pneumarm.transitions.rows import Recorded, steps_of
from pneumarm.transitions.store import Store

_LONGEST_LINE = 64 << 10  # characters
_LONGEST_SEQUENCE = 10_000  # rows; a longer one is stored in parts, which costs a window's length of each

_BAR_RANGE = (-0.2, 1.2)  # of max_pressure


class _MappingTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A table of the mapping in which an unknown key is a mistake."""


class AngleColumn(_MappingTable, frozen=True, forbid_unknown_fields=True):
    """The column of a joint's angle; 0 rad and 0 deg are the middle of the arm's range."""

    column: str
    unit: Literal["rad", "deg", "counts"]
    range: tuple[float, float] | None = None


class PressureColumn(_MappingTable, frozen=True, forbid_unknown_fields=True):
    """The column of a muscle's gauge pressure."""

    column: str
    unit: Literal["bar", "counts", "normalised"]
    full_scale: float = 1.0
    range: tuple[float, float] | None = None


class CommandColumn(_MappingTable, frozen=True, forbid_unknown_fields=True):
    """The column of a muscle's command."""

    column: str
    range: tuple[float, float] | None = None


class VelocityColumn(_MappingTable, frozen=True, forbid_unknown_fields=True):
    """The column of a joint's velocity that a sensor of its own measured."""

    column: str
    unit: Literal["rad/s", "deg/s", "counts/ms"]
    range: tuple[float, float] | None = None


class FurtherColumn(_MappingTable, frozen=True, forbid_unknown_fields=True):
    """The column of an accelerometer [m/s2] or a thermometer [Celsius]."""

    column: str
    range: tuple[float, float] | None = None


class JointColumns(_MappingTable, frozen=True, forbid_unknown_fields=True):
    """The columns of one joint; those of further sensors where it has them."""

    angle: AngleColumn
    command_1: CommandColumn
    command_2: CommandColumn
    pressure_1: PressureColumn | None = None
    pressure_2: PressureColumn | None = None
    velocity: VelocityColumn | None = None
    acceleration: FurtherColumn | None = None
    temperature_1: FurtherColumn | None = None
    temperature_2: FurtherColumn | None = None


class Mapping(_MappingTable, frozen=True, forbid_unknown_fields=True):
    """What the columns of a recording are."""

    commands: Literal["valves", "pulses", "continuous"]
    arm: dict[str, object]
    joint: list[JointColumns]
    sequence: str | None = None
    time: str | None = None


@dataclass(frozen=True)
class ImportResult:
    """What was imported."""

    transitions: int
    """Transitions stored."""
    sequences: int
    """Sequences stored; longer ones than 10,000 rows in parts."""
    rows: int
    """Rows of the recording."""
    single: int
    """Rows left out because their sequence has no other."""


@dataclass(frozen=True)
class _Column:
    """Where a quantity is, what it may be, and how it becomes sensor units: factor * value + offset."""

    name: str
    low: float
    high: float
    factor: float = 1.0
    offset: float = 0.0
    whole: bool = False


def mapping_beside(recording: Path) -> Path:
    """Return where the mapping of a ``recording`` lies that pneumarm exported; in a dataset of LeRobot within it."""
    return recording / MAPPING if recording.is_dir() else recording.with_name(f"{recording.name}.toml")


def import_recording(recording: Path | str, mapping: Path | str | None, store: StoreAddress) -> ImportResult:
    """Import ``recording`` into a new store, which is made whole or not at all, in bounded memory.

    Without a ``mapping`` it is the one that was exported with the recording. Imported sequences do not begin at rest:
    windows begin within them. Rows further apart than one and a half periods are not joined.

    Raises:
        UnusableInput: the mapping or the recording cannot be used (file, line and column are named), or there is a
            store already.

    """
    recording = Path(recording)
    mapping = _mapping_of(recording) if mapping is None else Path(mapping)
    chosen, spec = read_mapping(mapping)
    columns = _columns(chosen, spec)
    with Store.made_whole(store, spec, chosen.commands != "continuous") as made:
        made.begin_run("import", {"recording": recording.name, "mapping": mapping.name})
        reader = _Reader(recording, chosen, columns, spec.period)
        made.append_all(_sequences(reader, spec))
        if not made.sequences:
            raise UnusableInput(f"{recording}: holds no sequence of two rows or more")
        return ImportResult(made.transitions, made.sequences, reader.rows, reader.single)


def _mapping_of(recording: Path) -> Path:
    found = mapping_beside(recording)
    if not found.is_file():
        raise UnusableInput(
            f"{recording}: there is no mapping {found}, as an export leaves one; say what the columns are by "
            "--mapping FILE.toml"
        )
    return found


def read_mapping(path: Path) -> tuple[Mapping, ArmSpec]:
    """Return the mapping in the TOML file ``path`` and the arm it describes.

    Raises:
        UnusableInput: no such file, no TOML, or keys that are unknown, missing or of the wrong kind.

    """
    table = read_toml(path, "a mapping file (TOML)")
    try:
        mapping = msgspec.convert(table, Mapping)
        allowed = {field.name for field in fields(ArmSpec)} - {"joints", "velocity_sensor", "sensors"}
        if unknown := mapping.arm.keys() - allowed:
            raise UnusableInput(f"[arm] has no {', '.join(sorted(unknown))}; it has {', '.join(sorted(allowed))}")
        if "period" not in mapping.arm:
            raise UnusableInput("[arm] needs the period [s] between two rows")
        if not mapping.joint:
            raise UnusableInput("needs a [[joint]] for each joint of the arm")
        spec = msgspec.convert({**mapping.arm, "joints": len(mapping.joint)}, ArmSpec)
        _check_pressures(mapping, spec)
        velocity, sensors = _measures_velocity(mapping.joint), _sensors(mapping.joint)
        return mapping, replace(spec, velocity_sensor=velocity, sensors=sensors)
    except (msgspec.ValidationError, UnusableInput) as error:
        raise UnusableInput(f"{path}: {error}") from error


def _check_pressures(mapping: Mapping, spec: ArmSpec) -> None:
    """Raise UnusableInput unless each joint has the columns of both pressures, or the arm has no such sensors."""
    given = [column is not None for joint in mapping.joint for column in (joint.pressure_1, joint.pressure_2)]
    if spec.pressure_sensors and not all(given):
        raise UnusableInput(
            "needs pressure_1 and pressure_2 of every [[joint]]; of an arm that measures none say in [arm] "
            "pressure_sensors = false"
        )
    if not spec.pressure_sensors and any(given):
        raise UnusableInput("has a pressure of an arm without pressure sensors; leave out one or the other")
    if not spec.pressure_sensors and mapping.commands == "continuous":
        raise UnusableInput(
            "has continuous commands, from which no pressures can be estimated; expected valves or pulses"
        )


def _measures_velocity(joints: list[JointColumns]) -> bool:
    given = [joint.velocity is not None for joint in joints]
    if any(given) and not all(given):
        raise UnusableInput("needs the velocity of every [[joint]], or of none")
    return all(given)


def _sensors(joints: list[JointColumns]) -> tuple[Sensor, ...]:
    """Return the accelerometers and thermometers that there are columns of."""
    found = []
    for number, joint in enumerate(joints, start=1):
        if joint.acceleration is not None:
            found.append(Sensor("acceleration", number))
        for muscle, given in enumerate((joint.temperature_1, joint.temperature_2), start=1):
            if given is not None:
                found.append(Sensor("temperature", number, muscle))
    return tuple(found)


def _columns(mapping: Mapping, spec: ArmSpec) -> list[_Column]:
    """Return the columns in the order of a row: per joint angle, pressures and commands; then further sensors."""
    found = []
    for joint in mapping.joint:
        found.append(_angle(joint.angle, spec))
        pressures = (joint.pressure_1, joint.pressure_2)
        found += [_pressure(pressure, spec) for pressure in pressures if pressure is not None]
        for command in (joint.command_1, joint.command_2):
            most = math.inf if mapping.commands == "continuous" else 1.0
            low, high = command.range or (-most, most)
            found.append(_Column(command.column, low, high, whole=mapping.commands == "valves"))
    found += [_velocity(joint.velocity, spec) for joint in mapping.joint if joint.velocity is not None]
    for joint in mapping.joint:
        for further in (joint.acceleration, joint.temperature_1, joint.temperature_2):
            if further is not None:
                found.append(_Column(further.column, *(further.range or (-math.inf, math.inf))))
    return found


def _velocity(velocity: VelocityColumn, spec: ArmSpec) -> _Column:
    per_degree = spec.counts_per_degree / 1e3
    factor = {"rad/s": math.degrees(per_degree), "deg/s": per_degree, "counts/ms": 1.0}[velocity.unit]
    return _Column(velocity.column, *(velocity.range or (-math.inf, math.inf)), factor)


def _angle(angle: AngleColumn, spec: ArmSpec) -> _Column:
    middle = sum(spec.angle_range) / 2
    per_unit = {"rad": spec.counts_per_degree * 180 / math.pi, "deg": spec.counts_per_degree, "counts": 1.0}
    factor = per_unit[angle.unit]
    offset = 0.0 if angle.unit == "counts" else middle
    low, high = angle.range or tuple((count - offset) / factor for count in spec.angle_range)
    return _Column(angle.column, low, high, factor, offset)


def _pressure(pressure: PressureColumn, spec: ArmSpec) -> _Column:
    if not (math.isfinite(pressure.full_scale) and pressure.full_scale > 0):
        raise UnusableInput(f"the full_scale of {pressure.column!r} must be over 0 bar, got {pressure.full_scale}")
    per_unit = {
        "bar": spec.counts_per_bar,
        "counts": 1.0,
        "normalised": spec.counts_per_bar * pressure.full_scale,
    }
    factor = per_unit[pressure.unit]
    low, high = pressure.range or tuple(share * spec.max_pressure_counts / factor for share in _BAR_RANGE)
    return _Column(pressure.column, low, high, factor)


def _sequences(reader: "_Reader", spec: ArmSpec) -> Iterator[Recorded]:
    size = 5 if spec.pressure_sensors else 3
    for time, values in reader:
        per_joint = values[:, : size * spec.joints].reshape(len(time), spec.joints, size)
        command = per_joint[:, :, -2:].copy()
        command[-1] = np.nan
        yield Recorded(
            time=time,
            angle=per_joint[:, :, 0],
            pressure=per_joint[:, :, 1:3] if spec.pressure_sensors else filled(spec, time, command),
            command=command,
            step=steps_of(time, spec.period),
            kind="imported",
            measured=dict(zip(spec.further, values[:, size * spec.joints :].T, strict=True)),
        )


class _Reader:
    """Iterates over the sequences of a recording as time (n,) and values (n, columns) in sensor units."""

    def __init__(self, path: Path, mapping: Mapping, columns: list[_Column], period: float) -> None:
        self._path, self._mapping, self._columns, self._period = path, mapping, columns, period
        self.rows = 0
        self.single = 0

    def __iter__(self) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        if is_parquet(self._path):
            yield from self._read(lines_of(self._path))
            return
        if not self._path.is_file():
            raise UnusableInput(
                f"{self._path}: expected a recording (CSV, Parquet, or a dataset of LeRobot), there is no such file"
            )
        try:
            with open(self._path, encoding="utf-8-sig", newline="") as file:
                yield from self._read(self._lines(file))
        except OSError as error:
            raise UnusableInput(f"{self._path}: cannot be read ({error.strerror})") from error
        except UnicodeDecodeError as error:
            raise UnusableInput(f"{self._path}: expected CSV in UTF-8, this is something else ({error})") from error

    def _read(self, text: Iterator[str]) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        lines = csv.reader(text)
        try:
            header = next(lines, [])
            places = self._places(header)
            sequence, times, table = "", list[float](), list[list[float]]()
            for fields_ in lines:
                if not fields_:
                    continue
                if len(fields_) != len(header):
                    raise self._wrong(lines.line_num, f"expected {len(header)} fields, got {len(fields_)}")
                of_sequence = fields_[places[0]] if self._mapping.sequence else ""
                if times and (of_sequence != sequence or len(times) == _LONGEST_SEQUENCE):
                    yield from self._whole(times, table)
                    times, table = [], []
                sequence = sys.intern(of_sequence) if len(of_sequence) < 100 else of_sequence
                times.append(self._time(fields_, places[1], times, lines.line_num))
                table.append(
                    [
                        self._value(fields_[place], column, lines.line_num)
                        for place, column in zip(places[2:], self._columns, strict=True)
                    ]
                )
                self.rows += 1
            yield from self._whole(times, table)
        except csv.Error as error:
            raise self._wrong(lines.line_num, f"not CSV ({error})") from error

    def _whole(
        self, times: list[float], table: list[list[float]]
    ) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        if len(times) >= 2:
            yield np.array(times), np.array(table)
        else:
            self.single += len(times)

    def _lines(self, file: TextIO) -> Iterator[str]:
        number = 0
        while line := file.readline(_LONGEST_LINE + 1):
            number += 1
            if len(line) > _LONGEST_LINE:
                raise self._wrong(number, f"longer than {_LONGEST_LINE} characters: this is not CSV")
            yield line

    def _places(self, header: list[str]) -> list[int]:
        """Return where sequence, time and the values are; 0 for a sequence or a time that has no column."""
        mapping = self._mapping
        names = [mapping.sequence, mapping.time, *(column.name for column in self._columns)]
        missing = sorted({name for name in names if name is not None and header.count(name) != 1})
        if missing:
            raise UnusableInput(
                f"{self._path}: line 1: the mapping needs the column(s) {', '.join(missing)} once each; "
                f"the file has {', '.join(header)[:300] or 'none'}"
            )
        return [0 if name is None else header.index(name) for name in names]

    def _time(self, fields_: list[str], place: int, before: list[float], line: int) -> float:
        if self._mapping.time is None:
            return len(before) * self._period
        time = self._value(fields_[place], _Column(self._mapping.time, -1e12, 1e12), line)
        if before and time - before[-1] < self._period / 2:
            raise self._wrong(
                line,
                f"column {self._mapping.time!r}: {time:g} s is less than half a period of {self._period:g} s after "
                f"{before[-1]:g} s; is the period right, does a new sequence begin?",
            )
        return time

    def _value(self, text: str, column: _Column, line: int) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self._wrong(line, f"column {column.name!r}: expected a finite number, got {text[:40]!r}")
        if not column.low <= value <= column.high or (column.whole and value != round(value)):
            kind = "-1, 0 or 1" if column.whole else f"{column.low:g} to {column.high:g}"
            raise self._wrong(line, f"column {column.name!r}: expected {kind}, got {text[:40]}; is the unit right?")
        return column.factor * value + column.offset

    def _wrong(self, line: int, what: str) -> UnusableInput:
        return UnusableInput(f"{self._path}: line {line}: {what}")

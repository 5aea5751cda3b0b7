"""Import a recording made elsewhere into a store, by a mapping file (TOML) that says what its columns are.

It is CSV, Parquet, or a dataset of LeRobot (:mod:`pneumarm.transitions.table`).

Beside a recording that pneumarm exported lies its mapping. One with every setting that is not of an arm's spec::

    sequence = "episode"          # column that changes where a new sequence begins; optional
    time = { column = "t", unit = "ms" }   # s, ms, us, ns; "t" is as good for seconds; without it rows are one
                                  # period apart
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

A column of a dataset whose name is not unique in it is called with its feature, such as ``action.elbow.pos``. Rows
that cannot be used are left out and counted, and no transition spans the place.
"""

import hashlib
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.address import StoreAddress
from pneumarm.arm.fill import estimated_pressures
from pneumarm.arm.seam import ArmSpec, Sensor
from pneumarm.errors import UnusableInput
from pneumarm.files import as_toml, read_toml
from pneumarm.transitions.lerobot import MAPPING
from pneumarm.transitions.parquet import files_of
from pneumarm.transitions.rows import Recorded, steps_of
from pneumarm.transitions.store import Store
from pneumarm.transitions.table import OpenTable, TableRow, open_table

_LONGEST_SEQUENCE = 10_000  # rows; a longer one is stored in parts, which costs a window's length of each

_BAR_RANGE = (-0.2, 1.2)  # of max_pressure
_TOLERANCE = 0.05
"""Share of the period by which the median step may differ from it. Speeds are wrong by as much. Whole milliseconds of
120 Hz are 4 % off, 1/30 s written as 0.033 is 1 %; what jitters has its median where it belongs."""
_MOST_SKIPPED = 0.05
"""Share of the rows that may be unusable. Each takes with it the transitions whose windows hold it, four or so: at
one row in twenty a fifth of the recording is lost, and the mapping is more likely wrong than the file."""
_SEEN = 64 << 10  # bytes at either end of a file by which it is known again
_LATEST = 1e12  # s; of a time far past it no step can be counted
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
_MISSING = ("", "nan", "na", "n/a", "null", "none")
_TORN = "torn last line"
_NOT_RISING = "time not after that of the row before"


class _MappingTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A table of the mapping in which an unknown key is a mistake."""


class TimeColumn(_MappingTable, frozen=True, forbid_unknown_fields=True):
    """The column of the time."""

    column: str
    unit: Literal["s", "ms", "us", "µs", "ns"] = "s"


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


class VelocityColumn(_MappingTable, frozen=True, forbid_unknown_fields=True):
    """The column of a joint's velocity that a sensor of its own measured."""

    column: str
    unit: Literal["rad/s", "deg/s", "counts/ms"]
    range: tuple[float, float] | None = None


class OtherColumn(_MappingTable, frozen=True, forbid_unknown_fields=True):
    """The column of a muscle's command, of an accelerometer [m/s2] or of a thermometer [Celsius]."""

    column: str
    range: tuple[float, float] | None = None


class JointColumns(_MappingTable, frozen=True, forbid_unknown_fields=True):
    """The columns of one joint; those of further sensors where it has them."""

    angle: AngleColumn
    command_1: OtherColumn
    command_2: OtherColumn
    pressure_1: PressureColumn | None = None
    pressure_2: PressureColumn | None = None
    velocity: VelocityColumn | None = None
    acceleration: OtherColumn | None = None
    temperature_1: OtherColumn | None = None
    temperature_2: OtherColumn | None = None


class Mapping(_MappingTable, frozen=True, forbid_unknown_fields=True):
    """What the columns of a recording are."""

    commands: Literal["valves", "pulses", "continuous"]
    arm: dict[str, object]
    joint: list[JointColumns]
    sequence: str | None = None
    time: str | TimeColumn | None = None


@dataclass(frozen=True)
class ImportResult:
    """What was imported."""

    transitions: int
    """Transitions stored."""
    sequences: int
    """Sequences stored; longer ones than 10,000 rows in parts."""
    rows: int
    """Rows of the recording, all of them."""
    single: int
    """Rows left out because their sequence has no other."""
    restarts: int = 0
    """Sequences that were begun because the time went back."""
    skipped: dict[str, int] = field(default_factory=dict)
    """Rows left out because they could not be used, by the reason."""


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
    """Import ``recording``, whole or not at all, in bounded memory: into a new store, or one of the same arm.

    Without a ``mapping`` it is the one that was exported with the recording. Imported sequences do not begin at rest:
    windows begin within them. Rows further apart than one and a half periods are not joined, nor are those between
    which one could not be used.

    Raises:
        UnusableInput: the mapping or the recording cannot be used (file, line and column are named), it has been
            imported before, or the store is of another arm.

    """
    recording = Path(recording)
    mapping = _mapping_of(recording) if mapping is None else Path(mapping)
    chosen, spec = read_mapping(mapping)
    reader = _Reader(recording, chosen, _columns(chosen, spec), spec.period)
    settings = {"recording": recording.name, "mapping": mapping.name, "fingerprint": _fingerprint(recording, chosen)}
    with Store.added_whole(store, spec, chosen.commands != "continuous") as kept:
        for number, known in kept.runs().items():
            if known["settings"].get("fingerprint") == settings["fingerprint"]:
                raise UnusableInput(
                    f"{recording}: has been imported into {kept.address} already, as its run {number}"
                )
        before = kept.transitions, kept.sequences
        run = kept.begin_run("import", settings)
        kept.append_all(_sequences(reader, spec))
        transitions, sequences = kept.transitions - before[0], kept.sequences - before[1]
        reader.check()
        if not sequences:
            raise UnusableInput(f"{recording}: holds no sequence of two rows or more")
        if not transitions:
            marked = ", ".join(f"{count:,} x {reason}" for reason, count in kept.marked_rows(run).items())
            why = marked or f"no two rows are one period of {spec.period:g} s apart; is it right?"
            raise UnusableInput(f"{recording}: holds no transition to learn from: {why}")
        return ImportResult(
            transitions, sequences, reader.rows, reader.single, reader.restarts, dict(+reader.skipped)
        )


def _fingerprint(recording: Path, mapping: Mapping) -> str:
    """Return what tells a recording read by a ``mapping`` from others: the sizes and both ends of its files."""
    found = hashlib.sha256(msgspec.json.encode(mapping))
    try:
        for path in files_of(recording):
            with open(path, "rb") as file:
                size = path.stat().st_size
                found.update(size.to_bytes(8, "little") + file.read(_SEEN))
                file.seek(max(size - _SEEN, 0))
                found.update(file.read(_SEEN))
    except OSError as error:
        raise UnusableInput(f"{recording}: cannot be read ({error.strerror})") from error
    return found.hexdigest()


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
    for time, cut, values in reader:
        per_joint = values[:, : size * spec.joints].reshape(len(time), spec.joints, size)
        command = per_joint[:, :, -2:].copy()
        command[-1] = np.nan
        yield Recorded(
            time=time,
            angle=per_joint[:, :, 0],
            pressure=per_joint[:, :, 1:3] if spec.pressure_sensors else estimated_pressures(spec, time, command),
            command=command,
            step=steps_of(time, spec.period) + np.cumsum(cut),
            kind="imported",
            measured=dict(zip(spec.further, values[:, size * spec.joints :].T, strict=True)),
        )


class _Unusable(Exception):  # noqa: N818 - never seen outside
    """A row that is left out: the reason by which it is counted, and what is wrong with it in words."""


class _Read(NamedTuple):
    """A row that was understood."""

    fields: Sequence[str]
    sequence: str
    time: float
    values: list[float]


class _SequenceRows:
    """Rows of a sequence, until they are stored."""

    def __init__(self, sequence: str | None) -> None:
        self.sequence = sequence
        self.rows: list[tuple[float, bool, list[float]]] = []  # time, whether one was left out before it, values
        self.last: Sequence[str] = ()  # fields of the last row
        self.passed = 0  # rows since it began, those left out too
        self.broken = False  # whether one was left out since the last

    def add(self, read: _Read) -> None:
        """Add a row, which does not follow on the one before where one was left out between them."""
        self.rows.append((read.time, self.broken and bool(self.rows), read.values))
        self.last, self.broken = read.fields, False


class _Reader:
    """Iterates over the sequences of a recording, once.

    Gives times (n,) [s], whether a row is cut off from the one before (n,), and values (n, columns) in sensor units.
    """

    def __init__(self, path: Path, mapping: Mapping, columns: list[_Column], period: float) -> None:
        self._path, self._sequence, self._columns, self._period = path, mapping.sequence, columns, period
        self._time = TimeColumn(mapping.time) if isinstance(mapping.time, str) else mapping.time
        time = None if self._time is None else self._time.column
        self._names = [self._sequence, time, *(column.name for column in columns)]
        self._used = self.single = self.restarts = 0
        self.skipped = Counter[str]()
        self._wrong = ""  # what is wrong with the first row that was left out
        self._steps = Counter[float]()  # how often the time went on by so much, to three digits
        self._before = ("", math.inf)  # sequence and time of the row before
        self._decimal = ""  # what decimals begin with, comma or point

    @property
    def rows(self) -> int:
        """Rows read, those left out too."""
        return self._used + self.skipped.total()

    def __iter__(self) -> Iterator[tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]]:
        table, part, early = open_table(self._path, self._names), _SequenceRows(None), None
        for row in table.rows:
            try:
                read = self._read(row, table, part)
            except _Unusable as why:
                if not (row.lines == 1 and row.fields[0].startswith("#")):  # a comment
                    self._skip(row, *why.args)
                    part.broken, part.passed = True, part.passed + 1
                continue
            if read.sequence != part.sequence:
                yield from self._whole(part)
                part = _SequenceRows(read.sequence)
            part.passed += 1
            if part.rows and read.time - part.rows[-1][0] < self._period / 2:
                if early is None or not 0.5 <= (read.time - early.time) / self._period < 1.5:
                    early, before = read, part.rows[-1][0]
                    what = f"{read.time:g} s is less than half a period of {self._period:g} s after {before:g} s"
                    what = f"column {self._names[1]!r}: {what}; is the period right, does a new sequence begin?"
                    self._skip(row, _NOT_RISING, what)
                    part.broken |= read.fields != part.last  # a copy of the row before cuts nothing
                    continue
                yield from self._whole(part)  # it goes on from the row left out before: the clock began anew there
                part = _SequenceRows(read.sequence)
                part.add(early)
                self.skipped[_NOT_RISING] -= 1
                self.restarts += 1
            part.add(read)
            early = None
            if len(part.rows) == _LONGEST_SEQUENCE:
                yield from self._whole(part)
                part = _SequenceRows(part.sequence)
        yield from self._whole(part)

    def check(self) -> None:
        """Raise UnusableInput where the time does not go on by the period, or too many rows could not be used."""
        steps = np.array(sorted(self._steps.items())).reshape(-1, 2)
        passed = np.cumsum(steps[:, 1])
        median = float(steps[np.searchsorted(passed, passed[-1] / 2), 0]) if len(steps) else self._period
        if self._time is not None and abs(median / self._period - 1) > _TOLERANCE:
            wrong = f"the median step of the time is {median:g} s, the mapping's period says {self._period:g} s"
            raw = median / _SECONDS[self._time.unit] / self._period
            likely = next((unit for unit, seconds in _SECONDS.items() if 0.5 < raw * seconds < 2), self._time.unit)
            advice = f"set period = {median:g}, or the unit of the time" if median else "its stamps are too coarse"
            if _SECONDS[likely] != _SECONDS[self._time.unit]:
                told = as_toml({"column": self._time.column, "unit": likely})
                advice = f"the time column seems to be in {likely}: set time = {told}"
            raise UnusableInput(f"{self._path}: {wrong}; {advice}")
        bad = self.skipped.total() - self.skipped[_TORN]
        if bad > _MOST_SKIPPED * self.rows:
            reasons = ", ".join(f"{reason}: {count}" for reason, count in self.skipped.most_common() if count)
            raise UnusableInput(
                f"{self._path}: {self._wrong}; {bad} of {self.rows} rows cannot be used ({reasons}), at most "
                f"{_MOST_SKIPPED:.0%} may"
            )

    def _whole(
        self, part: _SequenceRows
    ) -> Iterator[tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]]:
        self._used += len(part.rows)
        if len(part.rows) >= 2:
            times, cut, values = zip(*part.rows, strict=True)
            yield np.array(times), np.array(cut), np.array(values)
        else:
            self.single += len(part.rows)

    def _skip(self, row: TableRow, reason: str, what: str) -> None:
        self.skipped[_TORN if row.torn and reason != _NOT_RISING else reason] += row.lines
        self._wrong = self._wrong or f"line {row.line}: {what}"

    def _read(self, row: TableRow, table: OpenTable, part: _SequenceRows) -> _Read:
        """Return the ``row`` of a ``table``, the next one of ``part`` or of a new sequence; or raise _Unusable."""
        fields_, width = row.fields, table.width
        if len(fields_) != width and (len(fields_) < width or any(map(str.strip, fields_[width:]))):
            what = f"expected {width} fields, got {len(fields_)} separated by {table.separator!r}"
            raise _Unusable("wrong number of fields", what)
        of_sequence, of_time, *places = table.places
        sequence = "" if self._sequence is None else fields_[of_sequence].strip()
        if self._time is None:
            time = self._period * (part.passed if sequence == part.sequence else 0)
        else:
            time = self._number(fields_[of_time], self._time.column, table) * _SECONDS[self._time.unit]
            step = time - self._before[1]
            if sequence == self._before[0] and step >= 0:
                self._steps[float(f"{step:.3g}")] += 1
            self._before = sequence, time
            if abs(time) > _LATEST:
                raise _Unusable("out of range", f"column {self._time.column!r}: expected a time, got {time:g} s")
        values = [
            self._value(fields_[place], column, table) for place, column in zip(places, self._columns, strict=True)
        ]
        return _Read(fields_, sequence, time, values)

    def _value(self, text: str, column: _Column, table: OpenTable) -> float:
        """Return what a field holds, in sensor units; or raise _Unusable."""
        value = self._number(text, column.name, table)
        if not column.low <= value <= column.high or (column.whole and value != round(value)):
            kind = "-1, 0 or 1" if column.whole else f"{column.low:g} to {column.high:g}"
            what = f"column {column.name!r}: expected {kind}, got {text.strip()[:40]}; is the unit right?"
            raise _Unusable("out of range", what)
        return column.factor * value + column.offset

    def _number(self, text: str, name: str, table: OpenTable) -> float:
        given, marks = text, {mark for mark in text if mark in ",."}
        if marks and table.separator != ",":
            # Decimals may have a comma, for all of the file: what groups thousands is not taken for one.
            self._decimal = self._decimal or (marks.copy().pop() if len(marks) == 1 else "")
            text = text.replace(",", ".") if marks == {self._decimal} else ""
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if math.isfinite(value):
            return value
        reason = "value missing" if given.strip().lower() in _MISSING else "not a number"
        raise _Unusable(reason, f"column {name!r}: expected a finite number, got {given[:40]!r}")

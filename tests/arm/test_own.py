"""Arms of a user's own whose code raises or returns nonsense, or whose clock goes wrong: failures of that arm."""

from dataclasses import replace
from pathlib import Path
from time import monotonic

import numpy as np
import pytest
from tests.arm.conftest import SmallestArm

from pneumarm.arm import Arm, ControlCycle, GuardedArm, Reading, open_arm
from pneumarm.arm.own import LEAP, STILL, OwnArm
from pneumarm.arm.virtual import VirtualArm
from pneumarm.cli import main
from pneumarm.errors import ArmFailure, UnusableInput

OPEN = np.array([[1, -1]], np.int8)
WELL = 20
"""Readings after which an arm goes wrong."""


class Plain(Arm):
    """Plain hardware without a state or a wait_until of its own, that goes wrong after some readings."""

    def __init__(self, **spec):
        self.inner = SmallestArm(**spec)
        self.spec = replace(self.inner.spec, name="mine")
        self.readings, self.longest, self.closed = 0, 0.0, 0
        made.append(self)

    @property
    def bad(self):
        return self.readings > WELL

    def read(self):
        self.readings += 1
        reading = self.inner.read()
        return self.change(reading) if self.bad else reading

    def change(self, reading):
        return reading

    def set_valves(self, valves):
        self.inner.set_valves(valves)

    def wait(self, seconds):
        self.longest = max(self.longest, seconds)
        self.inner.wait(seconds)

    def close(self):
        self.closed += 1
        self.inner.close()


made: list[Plain] = []


class Raises(Plain):
    def change(self, reading):
        raise RuntimeError("sensor <b>board</b> on fire\nsecond line")


class Exits(Plain):
    def change(self, reading):
        raise SystemExit(7)


class OutOfMemory(Plain):
    def change(self, reading):
        raise MemoryError


class Recursive(Plain):
    def change(self, reading):
        return self.change(reading)  # again


class Unspeakable(Plain):
    def change(self, reading):
        class Odd(BaseException):
            def __str__(self):
                raise KeyError("boo")

        raise Odd


class ReadsNone(Plain):
    def change(self, reading):
        return None


class ReadsStrings(Plain):
    def change(self, reading):
        return replace(reading, angle=np.array(["x"]))


class ReadsShape(Plain):
    def change(self, reading):
        return replace(reading, angle=np.zeros(3))


class ReadsNaN(Plain):
    def change(self, reading):
        return replace(reading, angle=[np.nan])


class ReadsHuge(Plain):
    def change(self, reading):
        return replace(reading, angle=[reading.angle[0] * 1e300])


class CannotSet(Plain):
    def set_valves(self, valves):
        if self.bad:
            raise OSError(5, "Input/output error")
        super().set_valves(valves)


class CannotWait(Plain):
    def wait(self, seconds):
        if self.bad:
            raise ValueError("no")
        super().wait(seconds)


class CannotPulse(Plain):
    def set_pulses(self, command):
        raise KeyError("valve 3")


class CannotBeReady(Plain):
    def make_ready(self):
        raise BrokenPipeError("homing")


class BadCounts(Plain):
    def link_counts(self):
        return None


class BadState(Plain):
    def get_state(self):
        return "here"


class BadAir(Plain):
    def air_used(self):
        return "much"


class CannotClose(Plain):
    def close(self):
        super().close()
        raise RuntimeError("will not close")


class NoSpec(Plain):
    def __init__(self):
        super().__init__()
        self.spec = None


class OtherSpec(Plain):
    def __init__(self):
        super().__init__()
        self.spec = {"joints": 1}


def returns_none():
    return None


def exits():
    raise SystemExit(3)


def interrupted():
    raise KeyboardInterrupt


def line_of(text: str) -> int:
    """Return the number of the first line of this file that has ``text``."""
    return next(n for n, line in enumerate(Path(__file__).read_text().splitlines(), 1) if text in line)


IN_USE = [
    (Raises, "read failed: RuntimeError: sensor <b>board</b> on fire second line", "raise RuntimeError("),
    (Exits, "read failed: SystemExit: 7", "raise SystemExit(7)"),
    (OutOfMemory, "read failed: MemoryError", "raise MemoryError"),
    (Recursive, "read failed: RecursionError: maximum recursion depth", "self.change(reading)  # again"),
    (Unspeakable, "read failed: ", "raise Odd"),
    (ReadsNone, "read returned nothing usable: a reading needs a time", "def read(self)"),
    (ReadsStrings, "read returned nothing usable: a reading needs a time", "def read(self)"),
    (ReadsShape, "read returned nothing usable: a reading needs a time, 1 angle(s)", "def read(self)"),
    (ReadsNaN, "read returned nothing usable: a reading must hold finite", "def read(self)"),
    (ReadsHuge, "read returned nothing usable: expected angles of 0 to 1023 counts", "def read(self)"),
    (CannotSet, "set_valves failed: OSError: [Errno 5] Input/output error", "raise OSError("),
    (CannotWait, "wait failed: ValueError: no", 'raise ValueError("no")'),
    (CannotPulse, "set_pulses failed: KeyError: 'valve 3'", 'raise KeyError("valve 3")'),
]


def moving(guard, turns=100):
    """Move for some turns, with pulses at last."""
    remaining = iter(range(turns))
    decided = iter([OPEN] * (turns // 2) + [OPEN * 0.5] * turns)
    for _ in ControlCycle(guard).run(lambda reading: None if next(remaining, None) is None else next(decided)):
        pass


@pytest.mark.parametrize(("kind", "said", "line"), IN_USE, ids=lambda one: getattr(one, "__name__", ""))
def test_what_an_arm_raises_or_returns_is_its_failure_with_the_place(kind, said, line):
    arm = kind()
    with pytest.raises(ArmFailure) as failed:
        moving(GuardedArm(arm))
    name = f"{kind.__module__}.{kind.__qualname__}"
    assert str(failed.value).startswith(f"mine: {name}.{said}")
    assert f"{__file__}:{line_of(line)}" in str(failed.value)
    assert "\n" not in str(failed.value)
    if kind is not CannotSet:
        assert arm.inner.valves == [[0, 0]]  # before anybody closes it


@pytest.mark.parametrize(
    ("kind", "call"),
    [
        (CannotBeReady, GuardedArm.make_ready),
        (BadCounts, GuardedArm.link_counts),
        (BadState, GuardedArm.get_state),
        (BadAir, GuardedArm.air_used),
        (CannotClose, GuardedArm.close),
    ],
)
def test_no_method_of_an_arm_is_taken_for_pneumarm_s(kind, call):
    with pytest.raises(
        ArmFailure, match=rf"mine: .*{kind.__name__}\.{call.__name__} (failed|returned nothing usable): "
    ):
        call(GuardedArm(kind()))


def test_an_interruption_in_an_arm_stays_one():
    class Interrupted(Plain):
        def change(self, reading):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        moving(GuardedArm(Interrupted()))


def test_of_two_failures_both_are_told():
    class Both(Raises, CannotClose):
        pass

    told = r"on fire.*and it could not be closed: .*close failed.*will not close"
    with pytest.raises(ArmFailure, match=told), GuardedArm(Both()) as guard:
        moving(guard)


def in_words(capsys, name, tmp_path):
    """Return the exit code and the last line of a command on the arm ``name`` of this file."""
    made.clear()
    with pytest.raises(SystemExit) as ended:
        main(["collect", f"python:{__name__}:{name}", str(tmp_path / "arm.db"), "--transitions", "1000"])
    return ended.value.code, capsys.readouterr().err.strip().splitlines()[-1]


@pytest.mark.parametrize("name", [kind.__name__ for kind, _, _ in IN_USE if kind is not CannotPulse])
def test_the_command_line_names_the_arm_and_closes_it(capsys, tmp_path, name):
    code, line = in_words(capsys, name, tmp_path)
    assert code == 1
    assert f"{__name__}.{name}." in line
    assert "a bug in" not in line
    assert made[0].closed


@pytest.mark.parametrize(
    ("name", "code", "said"),
    [
        ("NoSpec", 2, "NoSpec: expected a pneumarm.arm.ArmSpec as its spec, got NoneType"),
        ("OtherSpec", 2, "OtherSpec: expected a pneumarm.arm.ArmSpec as its spec, got dict"),
        ("returns_none", 2, "the callable must return a pneumarm.arm.Arm, it returned NoneType"),
        ("exits", 1, "cannot be opened (SystemExit: 3; "),
        ("interrupted", 130, "interrupted"),
    ],
)
def test_what_is_no_arm_from_the_start_is_refused_and_closed(capsys, tmp_path, name, code, said):
    found, line = in_words(capsys, name, tmp_path)
    assert found == code
    assert said in line
    assert all(arm.closed for arm in made)
    assert not (tmp_path / "arm.db").exists()


def test_a_module_that_ends_the_program_is_no_arm(tmp_path, monkeypatch):
    (tmp_path / "ending_arm.py").write_text("raise SystemExit(4)\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(UnusableInput, match=r"ending_arm cannot be imported \(SystemExit: 4; .*ending_arm.py:1"):
        open_arm("python:ending_arm:mine")


def test_a_wrong_option_closes_the_arm_again():
    made.clear()
    with pytest.raises(UnusableInput, match="every=1 or more"):
        open_arm(f"python:{__name__}:Plain,every=0")
    assert made[0].closed == 1


def test_debugging_shows_where(capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("PNEUMARM_DEBUG", "1")
    made.clear()
    with pytest.raises(SystemExit):
        main(["collect", f"python:{__name__}:Raises", str(tmp_path / "arm.db"), "--transitions", "1000"])
    assert "Traceback" in capsys.readouterr().err


def test_arms_of_pneumarm_s_own_are_not_looked_at():
    arm = VirtualArm(seed=1)
    assert GuardedArm(arm).arm is arm
    assert isinstance(GuardedArm(Plain()).arm, OwnArm)
    opened = open_arm(f"python:{__name__}:Plain")
    assert isinstance(opened, OwnArm)
    assert GuardedArm(opened).arm is opened


class Clocked(Plain):
    """Its clock shows what ``clock`` makes of the number of the reading and of the true time."""

    def __init__(self, clock, **spec):
        super().__init__(max_pressure=0.5, max_inflation=2.0, **spec)
        self.clock = clock

    def read(self):
        reading = super().read()
        return replace(reading, time=self.clock(self.readings, reading.time))


CLOCKS = {
    "back by 60 s within a turn": (lambda n, t: t - 60 * (n >= 6), "its clock went back"),
    "back by 60 s between turns": (lambda n, t: t - 60 * (n >= 7), "its clock went back"),
    "back by little": (lambda n, t: t - 0.04 * (n >= 7), "its clock went back"),
    "stands still from the start": (lambda n, t: 0.0, "its clock stands still"),
    "stands still later": (lambda n, t: min(t, 0.2), "its clock stands still"),
    "hardly advances": (lambda n, t: 0.1 * t, "its clock stands still"),
    "leaps": (lambda n, t: t + 60 * (n >= 6), "its clock leapt ahead by 60"),
    "counts milliseconds": (lambda n, t: 1e3 * t, "its clock leapt ahead"),
}


def waiting(guard):
    guard.read()
    guard.set_valves(OPEN)
    guard.wait(10.0)
    guard.read()


def waiting_until(guard):
    begin = guard.read().time
    guard.set_valves(OPEN)
    guard.wait_until(begin + 10.0)
    guard.read()


@pytest.mark.parametrize("pressures", [True, False])
@pytest.mark.parametrize("use", [moving, waiting, waiting_until])
@pytest.mark.parametrize("clock", CLOCKS)
def test_a_clock_that_goes_wrong_is_a_failure_of_the_arm_and_closes_its_valves(clock, use, pressures):
    shows, said = CLOCKS[clock]
    arm = Clocked(shows, pressure_sensors=pressures, safe_supply=True)
    with pytest.raises(ArmFailure, match=f"mine: {said}"):
        use(GuardedArm(arm))
    assert arm.inner.valves == [[0, 0]]
    assert arm.longest < 0.2
    assert arm.inner.time < (2.0 if use is moving else 1.0)
    if pressures:
        assert arm.inner.pressure[0][0] <= (0.5 + 1 / 10) * 166


def test_a_clock_that_gives_times_again_or_is_late_is_sound():
    for clock in (
        lambda n, t: np.floor(t * 10) / 10,  # a sensor of 10 Hz
        lambda n, t: t * 0.9,
        lambda n, t: t * 1.6,
        lambda n, t: t + 0.5 * (n > 9),
        lambda n, t: t + 1e9,
    ):
        arm = Clocked(clock, period=1 / 60)
        moving(GuardedArm(arm), 300)
        assert arm.inner.time > 2


@pytest.mark.parametrize("use", ["wait", "wait_until", "turns"])
def test_limits_act_while_an_arm_waits_that_brings_no_wait_until(use):
    arm = Plain(max_pressure=0.5)
    guard = GuardedArm(arm)
    begin = guard.read().time
    guard.set_valves(np.array([[1, 0]], np.int8))
    if use == "turns":
        arm.inner.wait(0.1)
        guard.wait_until(begin + 3.0)
    else:
        getattr(guard, use)(3.0)
    assert arm.inner.pressure[0][0] <= (0.5 + 2 / 30) * 166
    assert guard.interventions.pressure == 1
    assert arm.inner.time == pytest.approx(3.0)


def test_a_pause_in_which_nobody_looked_is_no_leap(monkeypatch):
    now = monotonic()
    monkeypatch.setattr("pneumarm.arm.own.monotonic", lambda: now)
    arm = Plain()
    guard = GuardedArm(arm)
    guard.read()
    now += 3600.0
    arm.inner.time += 3600.0  # both clocks ran
    guard.read()
    arm.inner.time += 60.0
    guard.make_ready()  # it may have taken its time
    guard.read()
    arm.inner.time += 60.0
    with pytest.raises(ArmFailure, match="leapt ahead by 60 s"):
        guard.read()


@pytest.mark.parametrize("real_time", [True, False])
def test_waits_are_measured_by_the_computer_where_the_arm_runs_in_real_time(monkeypatch, real_time):
    now = 0.0
    monkeypatch.setattr("pneumarm.arm.own.monotonic", lambda: now)

    class Slow(Plain):
        """A simulator that is slow, or hardware whose wait does not end."""

        def wait(self, seconds):
            nonlocal now
            now += 20 * seconds + LEAP
            super().wait(seconds)

    Slow.real_time = real_time
    guard = GuardedArm(Slow())
    guard.read()
    guard.set_valves(OPEN)
    if real_time:
        with pytest.raises(ArmFailure, match=r"its clock is not the computer's: a wait of 0\.0333 s took 1\.67 s"):
            guard.wait(STILL)
    else:
        guard.wait(STILL)


def test_angles_a_little_outside_their_range_are_read():
    arm = Plain()
    guard = GuardedArm(arm)
    for angle, sound in ((-40, True), (1100, True), (4096, True), (1e6, False), (-1e6, False), (-6e302, False)):
        arm.inner.angle = [angle]
        if sound:
            assert guard.read().angle.tolist() == [angle]
        else:
            with pytest.raises(ArmFailure, match="expected angles of 0 to 1023 counts"):
                guard.read()


def test_a_reading_is_what_it_was_behind_the_guard():
    arm = Plain()
    reading = GuardedArm(arm).read()
    assert isinstance(reading, Reading)
    assert reading.angle.tolist() == [500]

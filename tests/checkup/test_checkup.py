"""The check-up complains about every fault, names it, and leaves healthy arms alone."""

import io
import json
import os
import pty
import sys
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.checkup import CASES, complaints_of, played
from scipy import signal, stats

from faulty_arm import FAULTS, FaultyArm, logarithmic
from pneumarm.arm import GuardedArm, guarded, open_arm
from pneumarm.arm.corrected import CorrectedArm
from pneumarm.arm.serial import BoardLine, EmulatedBoard, SerialArm
from pneumarm.arm.spec_file import load_arm_file, save_spec
from pneumarm.arm.virtual import (
    Leak,
    LogarithmicPotentiometer,
    StuckValve,
    VirtualArm,
    WornPotentiometer,
    draw_parameters,
)
from pneumarm.checkup import CheckupSettings, Known, calibrate, diagnose, ends, joint_figures, measure
from pneumarm.checkup.diagnose import WORN
from pneumarm.checkup.figures import (
    LAGS,
    autocorrelation,
    dropped,
    irregularity,
    joint_row,
    ljung_box,
    muscle_row,
    onset,
)
from pneumarm.checkup.measure import JointTest, MuscleTest, Trace, arm_seconds
from pneumarm.cli import main
from pneumarm.commands import asking
from pneumarm.console import table
from pneumarm.errors import ArmFailure, UnusableInput


@pytest.mark.parametrize("seed", [2, 6, 10, 14])
def test_healthy_arms_are_left_alone(seed):
    assert diagnose(measure(open_arm(f"virtual:seed={seed}", seed))) == []


@pytest.mark.parametrize("name", CASES)
@pytest.mark.thorough
def test_every_fault_is_found_in_its_place_and_nothing_else(name):
    assert complaints_of(CASES[name], 3) == {CASES[name].told}


@pytest.mark.parametrize("fault", FAULTS)
def test_every_wrong_wiring_of_sensors_is_found_and_nothing_else(fault):
    found = diagnose(measure(FAULTS[fault](3)))
    assert {finding.kind for finding in found} == {fault}
    for finding in found:
        assert str(finding).startswith("joint")


def _places(*muscles):
    """Return what puts into each place what belongs to the next: an exchange of joints or of (joint, muscle)."""

    def exchange(values):
        changed = values.copy()
        for place, other in zip(muscles, (*muscles[1:], muscles[0]), strict=True):
            changed[place] = values[other]
        return changed

    return exchange


def _inlets(valves):
    """Exchange the inlets of both joints' first muscles; their exhausts are right."""
    opened, vents = np.maximum(valves, 0), np.minimum(valves, 0)
    return _places((0, 0), (1, 0))(opened) + vents


@pytest.mark.parametrize(
    ("kind", "where", "wiring"),
    [
        ("valves", "joint 1, muscle 1 and joint 2, muscle 1", {"valves": _places((0, 0), (1, 0))}),
        ("valves", "joint 1, muscle 2 and joint 2, muscle 1", {"valves": _places((0, 1), (1, 0))}),
        ("inlets", "joint 1, muscle 1 and joint 2, muscle 1", {"valves": _inlets}),
        (
            "pressure sensors",
            "joint 1, muscle 1 and joint 2, muscle 1",
            {"pressure": _places((0, 0), (1, 0))},
        ),
        ("angle sensors", "joint 1 and joint 2", {"angle": _places(0, 1)}),
        ("angle sensors", "joint 1 and joint 3", {"joints": 3, "angle": _places(0, 2)}),
        ("angle sensors", "joint 1 and joint 3 and joint 2", {"joints": 3, "angle": _places(0, 1, 2)}),
    ],
)
@pytest.mark.parametrize("seed", [3, 7])
@pytest.mark.thorough
def test_wires_exchanged_between_joints_are_named_and_nothing_that_follows_from_them(kind, where, wiring, seed):
    found = diagnose(measure(FaultyArm(seed, **{"joints": 2} | wiring), CheckupSettings(rest=5.0)))
    assert [(one.kind, one.where) for one in found] == [(f"{kind} exchanged", where)]


@pytest.mark.thorough
def test_both_muscles_of_joints_and_two_kinds_of_sensors_may_be_exchanged():
    muscles = _places((0, 0), (1, 0)), _places((0, 1), (1, 1))
    arm = FaultyArm(3, joints=2, valves=lambda v: muscles[0](muscles[1](v)))
    assert [one.kind for one in diagnose(measure(arm))] == ["valves exchanged"] * 2
    arm = FaultyArm(3, joints=2, valves=muscles[0], angle=_places(0, 1))
    assert [one.kind for one in diagnose(measure(arm))] == ["valves exchanged", "angle sensors exchanged"]


@pytest.mark.thorough
def test_a_joint_beside_exchanged_ones_is_judged_as_ever():
    arm = FaultyArm(3, joints=3, angle=lambda a: _places(0, 2)(np.array([a[0], 1023 - a[1], a[2]])))
    found = diagnose(measure(arm))
    assert [(one.kind, one.where) for one in found] == [
        ("angle sensors exchanged", "joint 1 and joint 3"),
        ("angle reversed", "joint 2"),
    ]


@pytest.mark.parametrize(("joints", "seed"), [(2, 1), (2, 2), (2, 9), (3, 4)])
@pytest.mark.thorough
def test_healthy_arms_of_several_joints_are_left_alone(joints, seed):
    assert diagnose(measure(FaultyArm(seed, joints=joints))) == []


@pytest.mark.parametrize("seed", [3, 6])
@pytest.mark.thorough
def test_air_that_a_turning_joint_compresses_is_not_let_in_by_an_inlet(seed):
    """A closed muscle gains half of the limit by being stretched, and loses it when the joint goes back."""

    class Compressed(FaultyArm):
        def read(self):
            reading = super().read()
            away = np.clip(np.outer(self.spec.degrees(reading.angle), [-1, 1]) / 35, 0, 1)
            return replace(reading, pressure=np.round(reading.pressure + 0.5 * 166 * away))

    assert diagnose(measure(Compressed(seed))) == []
    stuck = Compressed(seed)
    stuck.arm.faults = (StuckValve(muscle=1, position="open"),)
    assert [(f.kind, f.where) for f in diagnose(measure(stuck))] == [("inlet stuck open", "joint 1, muscle 1")]


@pytest.mark.parametrize("name", [None, "noise", "potentiometer worn at 10 degrees", "sensor at the valve's side"])
@pytest.mark.thorough
def test_the_same_is_said_in_whatever_units_sensors_count(name):
    """The same arm at a third of the pressure, with a converter of two bits more."""
    checkup = measure(VirtualArm(draw_parameters(3), seed=3)) if name is None else played(CASES[name], 3)[0]

    def finer(part):
        if isinstance(part, Trace):
            return replace(part, angle=4 * part.angle, pressure=4 * part.pressure)
        if isinstance(part, float):
            return part
        if isinstance(part, tuple):
            return tuple(finer(each) for each in part)
        return replace(part, **{name: finer(value) for name, value in vars(part).items()})

    spec = replace(
        checkup.spec,
        counts_per_degree=4 * checkup.spec.counts_per_degree,
        counts_per_bar=12 * checkup.spec.counts_per_bar,
        max_pressure=checkup.spec.max_pressure / 3,
        angle_range=tuple(4 * end for end in checkup.spec.angle_range),
    )
    told = [(f.kind, f.where) for f in diagnose(replace(checkup, spec=spec, joints=finer(checkup.joints)))]
    assert told == [(f.kind, f.where) for f in diagnose(checkup)]
    assert {kind for kind, _ in told} == ({CASES[name].told} if name else set())


def test_the_check_up_is_gentle_and_leaves_the_arm_vented_and_closed():
    guard = guarded(open_arm("virtual:seed=8", 8))
    checkup = measure(guard)
    assert guard.applied.tolist() == [[0, 0]]
    assert (guard.read().pressure < 5).all()
    assert (guard.peak_pressure < 1.15 * 166).all()
    assert guard.interventions.inflation == 0
    assert checkup.timing.read.shape == checkup.timing.set_and_read.shape == (200,)
    assert np.median(checkup.timing.periods) == pytest.approx(1 / 30, abs=1e-3)


@pytest.mark.thorough
def test_a_board_is_fed_however_long_its_answers_are_timed():
    inner = VirtualArm(draw_parameters(5), seed=5)
    line = BoardLine(EmulatedBoard(inner), delay=0.5e-3)
    with SerialArm(line, replace(inner.spec, name="board")) as arm:
        checkup = measure(arm, CheckupSettings(repeats=1000, rest=1.0))
        assert len(checkup.timing.read) == 1000
        assert joint_figures(checkup, 0).muscles[0].fill_delay == pytest.approx(0.01, abs=8e-3)


def test_a_broken_check_up_closes_the_valves():
    arm = FaultyArm(1)
    arm.read = fails_after(arm.read, 700)
    with pytest.raises(ArmFailure, match=r"read failed: OSError: cable \(.*test_checkup.py:\d+, in reading\)"):
        measure(arm)
    assert arm.applied.tolist() == [[0, 0]]


def fails_after(read, count):
    left = iter(range(count))

    def reading():
        if next(left, None) is None:
            raise OSError("cable")
        return read()

    return reading


def test_correlation_and_statistic_are_those_of_the_textbook():
    values = signal.lfilter([1.0], [1.0, -0.6], np.random.default_rng(1).normal(size=4000))
    centred = values - values.mean()
    direct = [centred[: len(centred) - lag] @ centred[lag:] for lag in range(LAGS + 1)]
    found = autocorrelation(values)
    assert found == pytest.approx(np.array(direct) / direct[0], abs=1e-9)
    assert found[1] == pytest.approx(0.6, abs=0.05)
    statistics = [
        ljung_box(autocorrelation(np.random.default_rng(seed).normal(size=500)), 500) for seed in range(400)
    ]
    assert stats.kstest(statistics, stats.chi2(LAGS).cdf).pvalue > 1e-3


def test_leaks_and_times_are_measured_as_they_are():
    for seed in (5, 7):
        arm = VirtualArm(draw_parameters(seed), seed=seed)
        one = joint_figures(measure(arm), 0)
        arm.faults = (Leak(muscle=1, factor=10.0, begin=arm.time),)
        other = joint_figures(measure(arm), 0)
        # Not all that a sound muscle loses is leak: it creeps and cools too.
        assert 7 < other.muscles[0].leak / one.muscles[0].leak < 10.5
        assert other.muscles[1].leak < 0.5 * other.muscles[0].leak  # it is only stretched
        delay = float(arm.body.constants.surroundings["opening_delay"][0])
        for muscle in one.muscles:
            assert 0.4 < muscle.fill_time < 0.8
            assert 0.1 < muscle.exhaust_time < 0.4
            assert muscle.fill_delay == pytest.approx(delay, abs=5e-3)
            assert muscle.exhaust_delay == pytest.approx(delay, abs=5e-3)


def test_a_beginning_is_found_between_readings_and_not_from_too_few():
    time = np.arange(0.0, 0.5, 0.005)
    for begin in (0.004, 0.0123, 0.031, 0.11, 0.213):
        noise = np.random.default_rng(1).normal(0, 1.0, (3, len(time)))
        rises = [(time, 40 + each + 400 * np.maximum(time - begin, 0) * (1 - time)) for each in noise]
        assert onset(rises) == pytest.approx(begin, abs=3e-3)
    assert np.isnan(onset([(time[::5], time[::5])]))


def test_both_muscles_that_leak_are_named_and_what_leaks_too_much_to_be_measured():
    def told(*faults):
        found = diagnose(measure(VirtualArm(draw_parameters(6), seed=6, faults=faults)))
        assert {finding.kind for finding in found} == {"leak"}
        return {finding.where: finding.told_by for finding in found}

    both = told(Leak(muscle=1, factor=40.0), Leak(muscle=2, factor=40.0))
    assert list(both) == ["joint 1, muscle 1", "joint 1, muscle 2"]
    assert all("% of its pressure a minute" in detail for detail in both.values())
    assert "before 8 s are over" in told(Leak(muscle=2, factor=1000.0))["joint 1, muscle 2"]


@pytest.mark.thorough
def test_a_leak_is_told_by_the_sound_state_of_the_calibration(tmp_path, capsys):
    file, plan = tmp_path / "arm.toml", tmp_path / "leak.toml"
    assert run(capsys, "arm", "calibrate", "virtual:seed=6", "--out", file)[0] == 0
    code, out, _ = run(capsys, "arm", "check", f"virtual:seed=6,spec={file}", "--seed", 9, "--json")
    told = json.loads(out)
    assert (code, told["healthy"]) == (0, True)
    assert told["sound"]["leak"] == [list(pair) for pair in load_arm_file(file).sound.leak]
    plan.write_text('[[fault]]\nkind = "leak"\nmuscle = 2\nfactor = 3.0\n')
    _, out, _ = run(capsys, "arm", "check", f"virtual:seed=6,faults={plan}", "--json")
    assert json.loads(out)["healthy"]  # without a calibration nobody knows
    _, out, _ = run(capsys, "arm", "check", f"virtual:seed=6,faults={plan},spec={file}")
    assert "joint 1, muscle 2: leak: it leaks 2." in out
    assert "times as much as when calibrated" in " ".join(out.split())


@pytest.mark.thorough
def test_an_arm_that_is_not_as_calibrated_is_told():
    known = calibrate(measure(FaultyArm(5))).file
    slipped, shifted = FaultyArm(5, angle=lambda a: a + 90), FaultyArm(5, pressure=lambda p: p + np.array([0, 15]))
    for arm, where in ((slipped, "joint 1"), (shifted, "joint 1, muscle 2")):
        found = diagnose(measure(CorrectedArm(arm, known)), known.sound)
        assert [(f.kind, f.where) for f in found] == [("not as calibrated", where)]


@pytest.mark.parametrize("bent", ["plan", 3.0, -3.0])
@pytest.mark.thorough
def test_a_logarithmic_potentiometer_is_linearised(bent):
    if bent == "plan":
        arm = VirtualArm(draw_parameters(4), seed=4, faults=(LogarithmicPotentiometer(),))
        bend = logarithmic(2 * np.log(1 / LogarithmicPotentiometer().middle - 1))
    else:
        bend = logarithmic(bent)
        arm = FaultyArm(4, angle=bend)
    calibration = calibrate(measure(arm))
    assert calibration.residual[0] < 2.5
    true = np.linspace(250, 800, 23)
    fitted = np.array([calibration.file.correction.angle(bend(np.array([raw])))[0] for raw in true])
    slope, offset = np.polyfit(true, fitted, 1)
    assert np.abs(fitted - slope * true - offset).max() < 40  # of 550; raw it is over 100
    corrected = CorrectedArm(arm, calibration.file)
    assert "angle logarithmic" not in [f.kind for f in diagnose(measure(corrected), calibration.file.sound)]


@pytest.mark.parametrize("angle", [-15.0, 0.0, 12.0])
def test_a_worn_zone_is_shown_by_its_angle(angle):
    arm = VirtualArm(draw_parameters(6), seed=6, faults=(WornPotentiometer(angle=angle, width=3.0, height=20.0),))
    checkup = measure(arm)
    places, off = irregularity(checkup.joints[0], checkup.spec)
    worst = places[np.argmax(off)]
    assert worst == pytest.approx(angle, abs=6.0)
    (finding,) = [f for f in diagnose(checkup) if f.kind == "angle worn"]
    shown = finding.told_by.partition(" at ")[2].replace(" to ", " and ").removesuffix(" degrees").split(" and ")
    assert all(abs(float(place) - angle) < 9 for place in shown)


def test_a_joint_that_springs_off_its_end_stop_is_not_worn_and_a_worn_one_is():
    """A light joint, at 250 degrees/s when it comes to its stop at 38, where it swings at 15 Hz."""
    spec = VirtualArm(draw_parameters(1), seed=1).spec
    time, random = np.arange(0.0, 1.0, 0.005), np.random.default_rng(1)
    met = 2 * 38 / 250
    since = np.maximum(time - met, 0.0)
    degrees = 38 * np.minimum(time / met, 1) ** 2 + 250 / 91 * np.exp(-10 * since) * np.sin(91 * since)

    def irregular(contact):
        moved = degrees + contact * np.exp(-0.5 * ((degrees - 15) / 3) ** 2) * random.normal(size=len(time))
        counts = np.round(spec.counts_per_degree * moved + random.normal(0, 0.5, len(time)) + 512)
        trace = Trace(time, counts, np.zeros((len(time), 2)))
        muscle = MuscleTest(trace, trace[-1:], trace[-1:], trace + trace[-1:], 0.0, ())
        return irregularity(JointTest(trace, (muscle, muscle), trace, trace, (trace, trace)), spec)

    assert irregular(0.0)[1].max() < WORN / 2
    places, off = irregular(1.0)
    assert abs(places[off > WORN] - 15).max() < 8
    assert places[off > WORN].size


def test_a_pulse_is_over_while_air_still_flows_fast():
    pulses = [measure(arm, CheckupSettings(rest=1.0)).joints[0].muscles[0] for arm in (FaultyArm(3), _fast(3))]
    assert pulses[0].pulsed == CheckupSettings().pulse
    assert 0.01 <= pulses[1].pulsed < 0.2
    for test in pulses:
        taken = test.pulse.pressure[test.pulse.time <= test.pulsed, 0].max()
        assert taken < 0.5 * test.fill.pressure[:, 0].max()


def _fast(seed):
    """An arm whose pressures rise three times as fast as they do."""
    return FaultyArm(seed, pressure=lambda p: 166 * (1 - np.clip(1 - p / 166, 0, 1) ** 3))


def test_air_that_cools_is_no_leap_and_a_sensor_beside_the_valve_leaps():
    for step in (0.005, 0.02):
        time = np.arange(-0.25, 0.5, step)
        since = np.maximum(time - 0.007, 0.0)  # when the valve has closed
        filled = 400 * np.minimum((time + 0.25) / 0.257, 1)
        cooling, leap = 60 * (1 - np.exp(-since / 0.08)), 60 * np.exp(-since / 0.003)
        assert dropped(time, filled - cooling) < 15
        assert dropped(time, filled + leap - cooling) > 25  # read every 20 ms, the last may be before the end
    assert dropped(time[:3], filled[:3]) == 0


def test_what_cannot_be_linearised_is_refused():
    arm = FaultyArm(4, angle=lambda a: np.where(a > 560, a + 250, a))
    with pytest.raises(UnusableInput, match="put in a linear one"):
        calibrate(measure(arm))


def test_a_calibration_finds_scales_and_zeros():
    """Sensors of another make: 0.6 of the counts a bar, 40 at atmosphere; the angle 0.9 of the counts, shifted."""
    arm = FaultyArm(5, pressure=lambda p: 40 + 0.6 * p * [[1.0, 0.95]], angle=lambda a: 80 + 0.9 * a)
    arm.spec = replace(arm.spec, counts_per_bar=130.0)
    raw = FaultyArm(5)
    truth = measure(raw)
    angles = tuple(raw.spec.degrees(ends(truth.joints[0])))
    supply = float(np.mean([m.full for m in joint_figures(truth, 0).muscles]))
    calibration = calibrate(measure(arm, CheckupSettings(fill=3.0)), Known((angles,), supply=supply))
    spec = calibration.file.spec
    assert spec.counts_per_degree == pytest.approx(0.9 * raw.spec.counts_per_degree, rel=0.02)
    assert spec.counts_per_bar == pytest.approx(0.6 * 0.975 * raw.spec.counts_per_bar, rel=0.05)
    corrected = CorrectedArm(arm, calibration.file)
    GuardedArm(corrected).set_valves(np.array([[1, 0]], np.int8))
    corrected.wait(1.0)
    seen, true = corrected.read(), arm.arm.read()  # the virtual arm within has sensors of its own
    assert spec.bar(seen.pressure) == pytest.approx(raw.spec.bar(true.pressure), abs=0.05)
    assert spec.degrees(seen.angle) == pytest.approx(raw.spec.degrees(true.angle), abs=1.5)


@pytest.mark.parametrize(
    ("known", "message"),
    [
        ({"angles": ((3, -3),)}, "a lower and a higher"),
        ({"supply": 60.0}, "a number, 10 or less"),
        ({"supply": np.nan}, "a number, 0.1 or more"),
        ({"counts_per_bar": 0.0}, "a number, more than 0"),
        ({"supply": 1.0, "counts_per_bar": 166.0}, "not both"),
        ({"angles": ((-3, 3),), "counts_per_degree": 4.0}, "not both"),
    ],
)
def test_impossible_knowledge_is_refused(known, message):
    with pytest.raises(UnusableInput, match=message):
        Known(**known)


def test_a_supply_that_is_never_reached_is_refused():
    with pytest.raises(UnusableInput, match="turn the reducer down"):
        calibrate(measure(open_arm("virtual:preset=C")), Known(supply=2.0))


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return ended.value.code, out, err


@pytest.mark.thorough
def test_the_commands(capsys, tmp_path, monkeypatch):
    code, out, _ = run(capsys, "arm", "check", "virtual:seed=4", "--out", tmp_path / "page", "--json")
    told = json.loads(out)
    assert (code, told["healthy"], told["findings"]) == (0, True, [])
    assert 0 < told["timing_ms"]["round trip, p50"] <= told["timing_ms"]["round trip, p99"]
    page = (tmp_path / "page" / "checkup.html").read_text()
    assert page.count("data:image/svg+xml") == 5  # one plays, drawn for wide and for narrow screens
    assert "Nothing is wrong with it." in page

    file = tmp_path / "arm.toml"
    code, out, _ = run(capsys, "arm", "calibrate", "virtual:seed=4", "--out", file, "--angles", -30, 31, "--json")
    assert code == 0
    assert load_arm_file(file).spec.counts_per_degree == json.loads(out)["spec"]["counts_per_degree"]
    db = tmp_path / "a.db"
    assert run(capsys, "collect", f"virtual:seed=4,spec={file}", db, "--transitions", 2000)[0] == 0

    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "crossed_arm.py").write_text(
        "from faulty_arm import FAULTS\nimport functools\nmine = functools.partial(FAULTS['angle reversed'], 2)\n"
    )
    code, out, _ = run(capsys, "arm", "check", "python:crossed_arm:mine", "--json")
    assert code == 0  # it was checked
    assert [f["kind"] for f in json.loads(out)["findings"]] == ["angle reversed"]
    code, again, err = run(capsys, "arm", "check", "python:crossed_arm:mine", "--strict", "--json")
    assert (code, json.loads(again)["findings"]) == (1, json.loads(out)["findings"])
    assert err.splitlines()[-1] == "pneumarm: python:crossed_arm:mine: 1 thing(s) wrong: angle reversed"
    assert run(capsys, "arm", "check", "virtual:seed=4", "--strict")[0] == 0
    code, _, err = run(capsys, "arm", "calibrate", "python:crossed_arm:mine", "--out", tmp_path / "no.toml")
    assert code == 2
    assert "Swap the outer wires of the potentiometer" in err
    assert not (tmp_path / "no.toml").exists()

    code, out, err = run(capsys, "arm", "valves", "virtual", "--pause", 0.1, "--json")
    assert [c["permitted"] for c in json.loads(out)["clicked"]] == [True] * 4
    assert err.splitlines() == [f"joint 1, muscle {m}, {v}" for m in (1, 2) for v in ("inlet", "exhaust")]


def test_sensors_are_shown_with_closed_valves(capsys):
    code, out, _ = run(capsys, "arm", "sensors", "virtual", "--seconds", 1, "--json")
    assert code == 0
    rows = {row["sensor"]: row for row in json.loads(out)["sensors"]}
    assert rows["angle"]["lowest"] == pytest.approx(512, abs=5)
    assert rows["pressure 2"]["highest"] < 5
    _, out, _ = run(capsys, "arm", "sensors", "virtual", "--seconds", 1)
    assert out.count(" bar (") == 10
    assert run(capsys, "arm", "sensors", "virtual", "--every", 0)[0] == 2


@pytest.mark.thorough
def test_further_sensors_are_shown_with_their_units(capsys):
    arm = "virtual:seed=2,sensors=temperature+velocity"
    _, out, _ = run(capsys, "arm", "sensors", arm, "--seconds", 0.5, "--json")
    units = {row["sensor"]: row["unit"] for row in json.loads(out)["sensors"]}
    assert units == {
        **dict.fromkeys(("angle", "pressure 1", "pressure 2"), "counts"),
        "velocity": "counts/ms",
        **dict.fromkeys(("temperature 1", "temperature 2"), "°C"),
    }
    assert "joint 1 temperature 2: " in run(capsys, "arm", "sensors", arm, "--seconds", 0.5)[1]


@pytest.mark.thorough
def test_what_counts_of_a_serial_arm_mean_is_not_guessed(capsys, tmp_path, monkeypatch):
    arm, file = "serial:/dev/nowhere", tmp_path / "arm.toml"
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))
    code, _, err = run(capsys, "arm", "calibrate", arm, "--out", file, "--counts-per-bar", 166)
    assert code == 2
    assert "give --angles or --counts-per-degree" in err
    assert "--supply" not in err
    code, _, err = run(capsys, "arm", "calibrate", arm, "--out", file, "--counts-per-bar", 166, "--angles", -30, 30)
    assert "no such port" in err
    assert run(capsys, "arm", "calibrate", "virtual", "--out", file)[0] == 0
    code, _, err = run(capsys, "arm", "calibrate", f"virtual,spec={file}", "--out", file)
    assert code == 2
    assert "calibrated already" in err


@pytest.mark.thorough
def test_a_person_is_asked_while_the_arm_is_held(monkeypatch):
    """The emulated board vents after a quarter of a second of silence: it is fed while nobody answers."""
    inner = VirtualArm(draw_parameters(5), seed=5)
    arm = SerialArm(BoardLine(EmulatedBoard(inner)), replace(inner.spec, name="board", counts_per_degree=5.0))
    guard = guarded(arm)
    checkup = measure(guard)
    master, slave = pty.openpty()
    asked, said, kept = [], [], []

    def say(text):
        said.append(text)
        if "protractor" not in text:
            return
        asked.append(text)
        guard.wait(65.0 if len(asked) == 5 else 5.0)  # a person takes time
        true = inner.spec.degrees(arm.read().angle)[0]
        # Nonsense, a wrong sign at either end, the air let out before a late answer, and it is moved there again.
        wrong = {1: "about thirty", 2: f"{-true:.1f}", 3: f"{-true:.1f}", 5: ""}
        os.write(master, f"{wrong.get(len(asked), f'{true:.1f}')}\n".encode())

    monkeypatch.setattr(asking, "say", say)
    with open(slave) as terminal, guard:
        monkeypatch.setattr(sys, "stdin", terminal)
        known = asking.asked_for(guard, checkup, Known(counts_per_bar=166.0), asking.AtTerminal(), kept.append)
        arm.wait(2.0)
        assert arm.read().pressure.max() < 10  # nothing is kept full
    os.close(master)
    assert len(asked) == 6
    assert sum("is not a number" in one for one in said) == 1
    assert sum("That is not possible: muscle 1 turns joint 1 to the higher angle" in one for one in said) == 1
    assert sum("The air is let out meanwhile." in one for one in said) == 1
    assert kept == [known]
    spec = calibrate(checkup, known).file.spec
    assert spec.counts_per_degree == pytest.approx(inner.spec.counts_per_degree, rel=0.01)
    assert sum(spec.angle_range) / 2 == pytest.approx(sum(inner.spec.angle_range) / 2, abs=8)


@pytest.mark.parametrize("joints", [1, 2])
def test_how_far_a_check_up_is_is_told_in_the_arms_time(joints):
    arm, told = open_arm(f"virtual:seed=3,joints={joints}"), []
    settings = CheckupSettings(rest=5.0, settle=2.0)
    begun = arm.read().time
    measure(arm, settings, progress=lambda done, total: told.append((done, total)))
    took = arm.read().time - begun
    done, total = np.array(told).T
    assert took == pytest.approx(arm_seconds(arm.spec, settings), rel=0.05)
    assert set(total) == {arm_seconds(arm.spec, settings)}
    assert (np.diff(done) >= 0).all()
    assert np.diff(done)[:-1].max() < 5.0  # it never stands still for long
    assert done[-1] == total[-1]


def test_it_is_said_what_the_board_has_and_what_of_it_is_in_use(capsys, tmp_path):
    save_spec(replace(open_arm("virtual:seed=3,joints=2").spec, pressure_sensors=True), tmp_path / "two.toml")
    _, _, err = run(capsys, "arm", "sensors", "emulated:virtual:seed=3", "--seconds", 0.1)
    assert "In use: 1 of the board's 2 joints, with 4 of its 8 valves and 3 of its 6 sensors; for both write" in err
    two = f"emulated:virtual:joints=2,seed=3,spec={tmp_path / 'two.toml'}"
    _, _, err = run(capsys, "arm", "valves", two, "--pause", 0.01, "--open-for", 0.01)
    assert "In use: 2 of the board's 2 joints, with 8 of its 8 valves and 6 of its 6 sensors." in err
    _, out, err = run(capsys, "arm", "valves", "virtual:seed=3,muscles=1", "--pause", 0.01, "--open-for", 0.01)
    assert "In use" not in err
    assert "the guard permits it" in out
    assert err.splitlines() == ["joint 1, muscle 1, inlet", "joint 1, muscle 1, exhaust"]


def test_no_zero_is_negative():
    figures = joint_figures(measure(open_arm("virtual:seed=3"), CheckupSettings(rest=1.0)), 0)
    muscle = figures.muscles[0]
    figures = replace(figures, muscles=(replace(muscle, leak=-0.001, leap=-0.0001), muscle), lowest=511.4)
    rows = [*muscle_row(figures, 0, 0, None), *joint_row(figures, open_arm("virtual:seed=3").spec)]
    assert not [one for one in rows if one.startswith(("-0", "\u22120")) and not float(one[1:].split("\xa0")[0])]
    assert list(table(("",), [(-0.0,)]).columns[0].cells) == ["0"]

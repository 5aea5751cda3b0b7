"""The check-up complains about every fault, names it, and leaves healthy arms alone."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal, stats

from faulty_arm import FAULTS, FaultyArm, logarithmic
from pneumarm.arm import GuardedArm, guarded, open_arm
from pneumarm.arm.corrected import CorrectedArm
from pneumarm.arm.spec_file import load_arm_file
from pneumarm.checkup import CheckupSettings, Known, calibrate, diagnose, joint_figures, measure
from pneumarm.checkup.diagnose import LAGS, autocorrelation, ljung_box
from pneumarm.cli import main
from pneumarm.errors import UnusableInput


@pytest.mark.parametrize("seed", [2, 6, 10, 14])
def test_healthy_arms_are_left_alone(seed):
    assert diagnose(measure(open_arm(f"virtual:seed={seed}", seed))) == []


@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_is_found_and_named_and_nothing_else(fault):
    found = diagnose(measure(FAULTS[fault](3)))
    assert {finding.kind for finding in found} == {fault}
    for finding in found:
        assert str(finding).startswith("joint")


def test_the_check_up_is_gentle_and_leaves_the_arm_vented_and_closed():
    guard = guarded(open_arm("virtual:seed=8", 8))
    checkup = measure(guard)
    assert guard.applied.tolist() == [[0, 0]]
    assert (guard.read().pressure < 5).all()
    assert (guard.peak_pressure < 1.15 * 166).all()
    assert guard.interventions.inflation == 0
    assert checkup.timing.read.shape == checkup.timing.set_and_read.shape == (200,)
    assert np.median(checkup.timing.periods) == pytest.approx(1 / 30, abs=1e-3)


def test_a_broken_check_up_closes_the_valves():
    arm = FaultyArm(1)
    arm.read = fails_after(arm.read, 700)
    with pytest.raises(OSError, match="cable"):
        measure(arm)
    assert arm._applied.tolist() == [[0, 0]]


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
    slow = measure(FAULTS["leak"](5))
    healthy = measure(FaultyArm(5))
    one, other = (joint_figures(checkup, 0).muscles[0] for checkup in (healthy, slow))
    assert other.leak > 5 * one.leak
    assert 0.4 < one.fill_time < 0.8
    assert 0.1 < one.exhaust_time < 0.4


@pytest.mark.parametrize("curvature", [3.0, -3.0])
def test_a_logarithmic_potentiometer_is_linearised(curvature):
    arm, straight = FaultyArm(4, angle=logarithmic(curvature)), FaultyArm(4)
    calibration = calibrate(measure(arm))
    assert calibration.residual[0] < 2.5
    corrected = CorrectedArm(arm, calibration.file)
    fitted, true = [], []
    for raw in np.linspace(250, 800, 23):
        true.append(raw)
        bent = logarithmic(curvature)(np.array([raw]))
        fitted.append(corrected._correction.angle(bent)[0])
    slope, offset = np.polyfit(true, fitted, 1)
    assert np.abs(np.array(fitted) - slope * np.array(true) - offset).max() < 40  # of 550; raw it is over 100
    assert "angle logarithmic" not in [f.kind for f in diagnose(measure(corrected))]
    assert straight.spec.joints == 1


def test_what_cannot_be_linearised_is_refused():
    arm = FaultyArm(4, angle=lambda a: np.where(a > 560, a + 250, a))
    with pytest.raises(UnusableInput, match="put in a linear one"):
        calibrate(measure(arm))


def test_a_calibration_finds_scales_and_zeros():
    """Sensors of another make: 0.6 of the counts a bar, 40 at atmosphere; the angle 0.9 of the counts, shifted."""
    arm = FaultyArm(5, pressure=lambda p, v, s: 40 + 0.6 * p * [[1.0, 0.95]], angle=lambda a: 80 + 0.9 * a)
    arm.spec = replace(arm.spec, counts_per_bar=130.0)
    raw = FaultyArm(5)
    truth = measure(raw)
    ends = [float(truth.joints[0].muscles[m].whole.pieces(1.7, 1.9)[1].angle.mean()) for m in (1, 0)]
    angles = tuple(raw.spec.degrees(ends))
    supply = float(np.mean([m.full for m in joint_figures(truth, 0).muscles]))
    calibration = calibrate(measure(arm, CheckupSettings(fill=3.0)), Known(angles, supply))
    spec = calibration.file.spec
    assert spec.counts_per_degree == pytest.approx(0.9 * raw.spec.counts_per_degree, rel=0.02)
    assert spec.counts_per_bar == pytest.approx(0.6 * 0.975 * raw.spec.counts_per_bar, rel=0.05)
    corrected, guard = CorrectedArm(arm, calibration.file), GuardedArm(raw)
    for one in (corrected, guard):
        one.set_valves(np.array([[1, 0]], np.int8))
        one.wait(1.0)
    seen, true = corrected.read(), raw.read()
    assert spec.bar(seen.pressure) == pytest.approx(raw.spec.bar(true.pressure), abs=0.05)
    assert spec.degrees(seen.angle) == pytest.approx(raw.spec.degrees(true.angle), abs=1.5)


@pytest.mark.parametrize(
    ("known", "said"),
    [({"angles": (3, -3)}, "a lower and a higher"), ({"supply": 60.0}, "0.1 to 10 bar"), ({"supply": np.nan}, "bar")],
)
def test_impossible_knowledge_is_refused(known, said):
    with pytest.raises(UnusableInput, match=said):
        Known(**known)


def test_a_supply_that_is_never_reached_is_refused():
    with pytest.raises(UnusableInput, match="turn the reducer down"):
        calibrate(measure(open_arm("virtual:preset=C")), Known(supply=2.0))


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return ended.value.code, out, err


def test_the_commands(capsys, tmp_path, monkeypatch):
    code, out, _ = run(capsys, "arm", "check", "virtual:seed=4", "--out", tmp_path / "page", "--json")
    told = json.loads(out)
    assert (code, told["healthy"], told["findings"]) == (0, True, [])
    assert told["timing_ms"]["read, p50"] > 0
    page = (tmp_path / "page" / "checkup.html").read_text()
    assert page.count("data:image/svg+xml") == 3
    assert "Nothing is wrong with it." in page

    file = tmp_path / "arm.toml"
    code, out, _ = run(capsys, "arm", "calibrate", "virtual:seed=4", "--out", file, "--angles", -30, 31, "--json")
    assert code == 0
    assert load_arm_file(file).spec.counts_per_degree == json.loads(out)["spec"]["counts_per_degree"]
    db = tmp_path / "a.db"
    assert run(capsys, "collect", f"virtual:seed=4,spec={file}", db, "--transitions", 2000)[0] == 0

    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "crossed_arm.py").write_text(
        "from faulty_arm import FAULTS\nimport functools\nmine = functools.partial(FAULTS['muscles swapped'], 2)\n"
    )
    _, out, _ = run(capsys, "arm", "check", "python:crossed_arm:mine", "--json")
    assert [f["kind"] for f in json.loads(out)["findings"]] == ["muscles swapped"]
    code, _, err = run(capsys, "arm", "calibrate", "python:crossed_arm:mine", "--out", tmp_path / "no.toml")
    assert code == 2
    assert "Swap the valves of muscle 1 with those of muscle 2" in err
    assert not (tmp_path / "no.toml").exists()

    code, out, err = run(capsys, "arm", "valves", "virtual", "--pause", 0.1, "--json")
    assert [c["opened"] for c in json.loads(out)["clicked"]] == [True] * 4
    assert err.splitlines() == [f"joint 1, muscle {m}, {v}" for m in (1, 2) for v in ("inlet", "exhaust")]

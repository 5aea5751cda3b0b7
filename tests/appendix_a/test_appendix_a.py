"""The errors of appendix A are played, seen in the pictures' figures, and named."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from pneumarm.appendix_a.case_pictures import covariance
from pneumarm.appendix_a.headless import HeadlessArm
from pneumarm.appendix_a.playing_errors import board
from pneumarm.appendix_a.runs import findings
from pneumarm.arm.virtual import StuckValve, VirtualArm, draw_parameters
from pneumarm.cli import main
from pneumarm.control import Monitor
from pneumarm.transitions import WHOLE_PERIODS, Store, collect


@pytest.mark.long
@pytest.mark.thorough
def test_every_error_is_revealed_and_named(capsys, tmp_path):
    with pytest.raises(SystemExit) as ended:
        main(
            [
                "arm",
                "errors",
                "--out",
                str(tmp_path / "errors.html"),
                "--transitions",
                "6000",
                "--epochs",
                "12",
                "--json",
            ]
        )
    assert ended.value.code == 0
    told = json.loads(capsys.readouterr().out)
    named = {
        ("Leaps in pressure", "sensor at the valve"): "pressure at the valve's side",
        ("A supply that builds up", "reducer leaks"): "rising supply",
        ("A logarithmic potentiometer", "logarithmic"): "angle logarithmic",
        ("A worn potentiometer", "worn"): "angle worn",
        ("Noise", "noise, single readings"): "noise",
    }
    for title, cases in told.items():
        for name, said in cases.items():
            kind = named.get((title, name))
            assert all(f": {kind}: " in one for one in said["checkup"])
            assert bool(said["checkup"]) is (kind is not None)
    # A zone of 8 degrees around 5; before it is told from noise it may be called that.
    worn = [one.split() for one in told["A worn potentiometer"]["worn"]["monitor"]]
    angles = [float(one[-5]) for one in worn if one[:2] == ["worn", "potentiometer:"]]
    assert angles
    assert all(abs(one - 5.0) <= 8.0 for one in angles)
    assert {" ".join(one[:2]) for one in worn} <= {"worn potentiometer:", "sensor noise:"}
    assert told["Noise"]["healthy"]["monitor"] == []
    lost = {name: said["error"] for name, said in told["A lost buffer"].items()}
    assert lost["claims believed"]["angle"] > 1.5 * lost["driver in order"]["angle"]
    assert lost["claims seen through"]["angle"] < 1.2 * lost["driver in order"]["angle"]
    page = (tmp_path / "errors.html").read_text()
    assert page.count("data:image/svg+xml") == 11
    assert "pressure at the valve&#39;s side" in page


def test_claims_that_are_believed_repeat_readings_and_headers_do_not():
    arm = HeadlessArm(*board(1, 0.3))
    arm.set_valves(np.array([[1, -1]], np.int8))
    readings = []
    for _ in range(40):
        arm.wait(0.02)
        readings.append(arm.read())
    same = sum(np.array_equal(a.pressure, b.pressure) for a, b in pairwise(readings))
    assert 4 <= arm.link.repeated <= 20
    assert same >= arm.link.repeated - 1
    assert (np.diff([one.time for one in readings]) > 0).all()
    arm.close()


def test_a_recording_is_judged_as_the_arm_was(tmp_path):
    faulty = VirtualArm(draw_parameters(3), seed=3, faults=[StuckValve(begin=60.0, end=90.0)])
    with Store.for_arm(tmp_path / "db", faulty.spec) as store:
        collect(faulty, store, 2_000, 3, settings=WHOLE_PERIODS)
        watched = Monitor(faulty.spec)
        later = findings(store.blocks(), watched)
    again = VirtualArm(draw_parameters(3), seed=3, faults=[StuckValve(begin=60.0, end=90.0)])
    live = Monitor(again.spec)
    with Store.for_arm(tmp_path / "again", again.spec) as store:
        collect(again, store, 2_000, 3, watch=live, settings=WHOLE_PERIODS)
    assert watched.findings[0] == live.findings[0]
    assert later[0] == f"{replace(live.findings[0], until=None)}."


def test_covariance_is_that_of_the_textbook():
    values = np.random.default_rng(1).normal(size=500).cumsum()
    centred = values - values.mean()
    direct = [centred[: len(centred) - lag] @ centred[lag:] / len(centred) for lag in range(21)]
    assert covariance(values) == pytest.approx(np.array(direct))

"""The arm as it is drawn in reports, films, environments and on the live page."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from pneumarm.arm import ArmSpec
from pneumarm.drawing.arm_picture import ArmPicture
from pneumarm.drawing.drawn_arm import DrawnArm, Pose, brightness
from pneumarm.drawing.moving_arm import Shown, moving_arm
from pneumarm.report.data import MovingData
from pneumarm.report.page import Picture

ONE = ArmSpec()


def extent(arm: DrawnArm, kind: str, degrees: float, full: float) -> tuple[float, float]:
    """Return how wide and how long the shape of a ``kind`` is in the drawing."""
    shapes = arm.placed(Pose(np.array([degrees]), np.full((1, 2), full), np.zeros((1, 2))))
    (points,) = (shape.points for shape, _ in shapes if shape.kind == kind)
    width, length = np.ptp(points, axis=0)
    return float(width), float(length)


def test_muscles_swell_with_pressure_and_the_one_that_pulls_is_short() -> None:
    arm = DrawnArm.of(ONE)
    slim, fat = (extent(arm, "air-1", 0.0, full)[0] for full in (0.0, 1.0))
    assert fat > 1.5 * slim
    first, second = (extent(arm, f"air-{n}", 20.0, 0.5)[1] for n in (1, 2))
    assert first < extent(arm, "air-1", 0.0, 0.5)[1] < second


def test_a_spring_stands_in_place_of_the_second_muscle() -> None:
    arm = DrawnArm.of(replace(ONE, muscles=1))
    assert extent(arm, "coil", 20.0, 0.0)[1] > extent(arm, "coil", -20.0, 0.0)[1]
    assert {shape.kind for one in arm.muscles for muscle in one for shape in muscle.body} == {
        "rubber",
        "air-1",
        "weave",
        "coil",
    }


@pytest.mark.parametrize("joints", [1, 2])
def test_a_playing_picture_a_figure_and_the_page_show_the_same_shapes(joints: int) -> None:
    spec = replace(ONE, joints=joints)
    time = np.linspace(0, 1, 31)
    angle, valves = np.full((31, joints), 500.0), np.ones((31, joints, 2))
    valves[16:] = -1
    text = moving_arm(Shown(spec, time, angle, None, valves * 50 + 60, valves))
    playing = re.findall(r'<path class="([^"]+)" d="([^"]+)"', text)
    arm = DrawnArm.of(spec)
    page = arm.for_page("#arm")
    parts = [*page["plate"], *(one for joint in page["turning"] for one in joint)]
    for muscle in (muscle for pair in page["muscles"] for muscle in pair):
        parts += [*muscle["fixed"], *muscle["body"], *muscle["lights"]]
    assert sorted(parts) == sorted(one for one in playing if one[0] != "axis")
    pose = Pose(np.zeros(joints), np.full((joints, 2), 0.5), np.ones((joints, 2)))
    picture = ArmPicture(Figure().add_axes((0.0, 0.0, 1.0, 1.0)), arm, 300.0, 500.0)
    assert len(picture.show(pose)) == len(parts)
    assert len(picture.show(pose, np.zeros(joints))) == len(parts) + joints  # and the goal


def test_a_valve_is_seen_to_close() -> None:
    np.testing.assert_allclose(brightness(np.array([0.0, 1.0, 0.0, 0.0, -0.25])), [0, 1, 0.75, 0.75**2, -0.5])


def test_the_record_of_movements_keeps_pressures_and_one_of_an_older_version_has_none(tmp_path: Path) -> None:
    time, angle = np.linspace(0, 1, 5), np.full((5, 2), 500.0)
    spec = replace(ONE, joints=2)
    MovingData(time, angle, angle, np.full((5, 2, 2), 80.0)).save(tmp_path)
    known = MovingData.load(tmp_path).shown(spec)
    unknown = MovingData(time, angle, angle).shown(spec)
    assert known.pressure is not None
    assert known.poses(time).full == pytest.approx(80 / ONE.counts_per_bar / ONE.max_pressure)
    assert unknown.pressure is None
    assert unknown.poses(time).full.shape == (5, 2, 2)


def test_a_picture_without_a_text_alternative_is_refused() -> None:
    with pytest.raises(ValueError, match="text alternative"):
        Picture(Figure(), "a caption")

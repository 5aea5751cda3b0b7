from pathlib import Path

import numpy as np
import pytest

from pneumarm.arm import ArmSpec
from pneumarm.arm.reference import Reference, constant
from pneumarm.errors import UnusableInput
from pneumarm.task.reference import check_reachable, minimum_jerk, parse_reference

ONE, TWO = ArmSpec(), ArmSpec(joints=2)


def degrees(text: str, times: list[float], spec: ArmSpec = ONE) -> list[list[float]]:
    reference = parse_reference(text, spec)
    return np.array([spec.degrees(reference.at(time)) for time in times]).T.round(6).tolist()


def test_waves_begin_in_the_middle_or_at_an_end() -> None:
    assert degrees("sine:0.5Hz,20deg", [0, 0.5, 1, 1.5]) == [[0, 20, 0, -20]]
    assert degrees("ramp:30deg/s,15deg", [0, 0.25, 0.5, 1, 2]) == [[0, 7.5, 15, 0, 0]]
    assert degrees("minimum-jerk:1s,20deg", [0, 0.5, 1, 1.5, 2]) == [[-20, 0, 20, 0, -20]]
    assert degrees("sine:1Hz,20deg,5deg", [0.25], TWO) == [[20], [5]]
    assert degrees("sine:1Hz,20deg", [0.25], TWO) == [[20], [20]]


def test_files_hold_their_ends(tmp_path: Path) -> None:
    file = tmp_path / "way.csv"
    file.write_text("time,angle\n1,0\n2,10\n4,-10\n")
    assert degrees(str(file), [-1, 0, 1, 3, 9]) == [[0, 0, 10, -10, -10]]
    assert degrees(f"steps:{file}", [-1, 0, 0.9, 1, 2.9, 3]) == [[0, 0, 0, 10, 10, -10]]
    steps = parse_reference(f"steps:{file}", ONE)
    assert (steps.smooth, steps.duration) == (False, 3.0)
    file.write_text("0,1,2\n1,3,4\n")
    assert degrees(str(file), [0.5], TWO) == [[2], [3]]
    times = np.arange(0, 3, 1 / 30)
    file.write_text("".join(f"{time},{20 * np.sin(6 * time)}\n" for time in times))
    fine = np.arange(0.1, 2.8, 0.01)
    np.testing.assert_allclose(degrees(str(file), fine.tolist())[0], 20 * np.sin(6 * fine), atol=0.05)


@pytest.mark.parametrize(
    "text",
    [
        "sine",
        "sine:0Hz,20deg",
        "sine:1Hz",
        "sine:1Hz,20m",
        "sine:1s,20deg",
        "sine:1Hz,20deg,20deg",
        "cosine:1Hz,2deg",
    ],
)
def test_what_is_no_reference_is_refused(text: str) -> None:
    with pytest.raises(UnusableInput, match="reference"):
        parse_reference(text, ONE)


@pytest.mark.parametrize("content", ["", "0,1,2\n", "0,1\n0,2\n", "0,1\n1,nan\n", "0,1\n1\n", "0,1\n1,x\n"])
def test_files_of_something_else_are_refused(tmp_path: Path, content: str) -> None:
    file = tmp_path / "way.csv"
    file.write_text(content)
    with pytest.raises(UnusableInput, match=r"way\.csv: expected rows"):
        parse_reference(str(file), ONE)
    with pytest.raises(UnusableInput, match="cannot be read"):
        parse_reference(str(tmp_path / "none.csv"), ONE)


def test_what_leaves_the_range_is_refused() -> None:
    seen = np.array([[300.0, 700.0]])
    check_reachable(parse_reference("sine:1Hz,15deg", ONE), 5, seen, ONE)
    with pytest.raises(UnusableInput, match=r"its goals lie from -18\.6 to 16\.6"):
        check_reachable(parse_reference("sine:1Hz,17deg", ONE), 5, seen, ONE)


def test_derivatives_are_those_of_the_function_known_ahead_or_not() -> None:
    asked = []

    def at(time: float) -> np.ndarray:
        asked.append(time)
        return np.array([3 + 2 * time + 5 * time**2])

    for known in (True, False):
        asked.clear()
        wanted = Reference(at, known_ahead=known).point(1.0, ahead=0.1)
        assert known or max(asked) <= 1.0
        np.testing.assert_allclose(wanted.angle, [3 + 2.2 + 5 * 1.21])
        np.testing.assert_allclose(wanted.velocity, [2 + 11])
        np.testing.assert_allclose(wanted.acceleration, [10])


def test_a_goal_stays_and_a_minimum_jerk_move_begins_and_ends_gently() -> None:
    assert constant([5.0]).point(3.0).velocity == [0.0]
    shares = [minimum_jerk(share) for share in np.linspace(-0.5, 1.5, 41)]
    assert (shares[0], shares[-1], shares[20]) == (0, 1, 0.5)
    assert (np.diff(shares) >= 0).all()

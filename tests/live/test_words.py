"""What the monitor and the guard have to say, in sentences."""

import pytest

from pneumarm.arm.guard import Interventions
from pneumarm.arm.seam import ArmSpec
from pneumarm.control.monitor.findings import Finding
from pneumarm.live.words import prevented, sentence


@pytest.mark.parametrize(
    ("kind", "detail", "joint", "muscle", "joints", "words"),
    [
        ("stuck-valve", "the inlet is stuck closed", 1, 2, 1, "Muscle 2: the inlet is stuck closed"),
        ("stuck-valve", "the inlet is stuck closed", 2, 1, 2, "Muscle 1 of joint 2: the inlet is stuck closed"),
        ("low-supply", "the supply is gone", None, None, 1, "The supply is gone"),
        (
            "dead-potentiometer",
            "its reading jumped onto a rail and stays there",
            1,
            None,
            1,
            "Joint 1: the potentiometer is dead: its reading jumped onto a rail and stays there",
        ),
        (
            "changed",
            "pressure 1 does not agree with the simulation",
            1,
            None,
            1,
            "Joint 1: the arm has changed: pressure 1 does not agree with the simulation",
        ),
    ],
)
def test_a_finding_is_a_sentence(
    kind: str, detail: str, joint: int | None, muscle: int | None, joints: int, words: str
) -> None:
    spec = ArmSpec(joints=joints, period=1 / 30, counts_per_degree=11.38, counts_per_bar=166.0, angle_range=(0, 1023))
    assert sentence(Finding(kind, detail, joint, muscle, 3.0, 4.0), spec) == words


def test_the_guard_says_what_it_prevented() -> None:
    assert prevented(Interventions()) == "no interventions"
    assert (
        prevented(Interventions(pressure=3, late=1))
        == "prevented 3 x pressure at its limit, 1 x command came too late"
    )

"""Arms that are controlled at every second or third of their periods."""

import numpy as np
import pytest
from tests.plain_arms import throttled

from pneumarm.arm import guarded, open_arm
from pneumarm.arm.slower import SlowerArm, usual_turns
from pneumarm.errors import UnusableInput


@pytest.mark.parametrize(
    ("rate", "turns"), [(22, 1), (30, 1), (50, 1), (52, 2), (60, 2), (75, 2), (90, 3), (100, 3), (1000, 33)]
)
def test_rates_over_50_hz_come_near_to_30(rate, turns):
    assert usual_turns(1 / rate) == turns


def test_arms_by_name_are_controlled_at_such_rates_unless_told_otherwise():
    place = "python:tests.plain_arms:throttled"
    for name, rate in ((place, 30), (f"{place},every=1", 60), (f"{place},every=3", 20)):
        with open_arm(name) as arm:
            assert 1 / arm.spec.period == pytest.approx(rate)
    with open_arm("virtual:wide,seed=30") as arm, open_arm("virtual:wide,seed=30,rate=85") as faster:
        assert arm.spec.period == pytest.approx(3 * faster.spec.period, rel=0.01)


@pytest.mark.parametrize("every", ["0", "-1", "two"])
def test_another_number_is_refused(every):
    with pytest.raises(UnusableInput, match="every=1 or more"):
        open_arm(f"python:tests.plain_arms:throttled,every={every}")


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8, 1.0])
def test_pulses_last_for_their_share_of_the_longer_period(share):
    """Air flows in for as long as with a valve that is closed by hand."""
    arm, alone = guarded(SlowerArm(throttled(), 3)), guarded(throttled())
    due = arm.read().time + arm.spec.period
    arm.decide(np.array([[share, 0.0]]))
    arm.end_pulses(due)
    arm.wait_until(due)
    alone.read()
    alone.set_valves(np.array([[1, 0]], np.int8))
    alone.wait(share * arm.spec.period)
    risen = []
    for one in (arm, alone):
        one.set_valves(np.zeros((1, 2), np.int8))
        one.wait(1.0)
        risen.append(np.mean([one.read().pressure[0, 0] for _ in range(50)]) - 400)
    assert risen[1] > 20 * share
    assert risen[0] == pytest.approx(risen[1], rel=0.03, abs=3)

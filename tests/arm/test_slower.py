"""Arms that are controlled at every second or third of their periods."""

from dataclasses import replace

import numpy as np
import pytest
from tests.plain_arms import PlainArm, throttled

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


def test_an_arm_without_pulses_has_its_own_periods_for_pulses():
    alone = throttled()
    alone.spec = replace(alone.spec, pulses=False)
    arm = SlowerArm(alone, 3)
    own = alone.spec.period
    assert (arm.spec.pulses, arm.spec.shortest_pulse, arm.spec.pulse_step) == (True, own, own)
    asked = np.array([[0.1, 0.2], [-0.45, 0.6], [-0.9, 1.0]])
    np.testing.assert_allclose(arm.spec.possible(asked), np.array([[0, 1], [-1, 2], [-3, 3]]) / 3)
    assert SlowerArm(alone, 1).spec == alone.spec


def test_valves_of_an_arm_without_pulses_change_at_its_own_periods_only():
    changed = []

    class Noted(PlainArm):
        def set_valves(self, valves):
            changed.append(self.read().time)
            super().set_valves(valves)

    inner = throttled()
    inner.__class__ = Noted
    inner.spec = replace(inner.spec, pulses=False)
    with guarded(SlowerArm(inner, 3)) as arm:
        begin = due = arm.read().time
        for share in (0.3, 0.5, 0.8):
            arm.decide(np.array([[share, -share]]))
            due += arm.spec.period
            arm.end_pulses(due)
            arm.wait_until(due)
    turns = (np.array(changed[:-1]) - begin) / inner.spec.period
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-6)
    assert {1, 3, 5, 8} <= set(np.round(turns).astype(int))


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

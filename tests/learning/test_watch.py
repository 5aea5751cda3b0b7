"""Noticing a change, and taking an agent back: worked by hand, and how often they are wrong."""

import math

import numpy as np
import pytest

from pneumarm.adaptation import TrialSettings, WatchSettings
from pneumarm.adaptation.change import ChangeDetector
from pneumarm.adaptation.trial import lower_by, verdict
from pneumarm.errors import UnusableInput


def test_sums_are_those_of_page() -> None:
    watch = ChangeDetector(WatchSettings(allowance=1.5, alarm=3.0, largest=4.0), 2)
    # S_1: 0, 0   then 0.5, 0   then 3.0 (cut at 4, less 1.5), 0   then 3.5, 0.5: over 3
    for squares in ([1.0, 1.0], [2.0, 1.2], [9.0, 0.5]):
        assert not watch.observe(squares)
    assert watch.observe([2.0, 2.0])
    assert watch.alarmed
    assert watch.since == 1  # the sum was last 0 after the first movement
    assert not watch.observe([9.0, 9.0])  # it has been said
    np.testing.assert_allclose(watch.ratio[0], math.sqrt((1 + 2 + 9 + 2 + 9) / 5))
    watch.reset()
    assert not watch.alarmed
    assert np.isnan(watch.ratio).all()
    assert watch.movements == 5
    for _ in range(2):
        watch.observe([9.0, 1.0])
    assert watch.alarmed
    assert watch.since == 5


def squares(movements: int, ratio: float, seed: int) -> np.ndarray:
    """Return mean squares over ten steps whose errors are alike from step to step, as those of a policy are."""
    random = np.random.default_rng(seed)
    return ratio**2 * random.gamma(2.5, 1 / 2.5, (movements, 3))


def test_an_unchanged_arm_is_seldom_taken_for_another() -> None:
    watch, alarms = ChangeDetector(WatchSettings(), 3), 0
    for one in squares(20_000, 1.0, 0):
        if watch.observe(one):
            alarms += 1
            watch.reset()
    assert alarms <= 20


@pytest.mark.parametrize(("ratio", "within"), [(1.3, 150), (1.6, 30), (3.0, 8)])
def test_the_larger_a_change_the_sooner_it_is_noticed(ratio: float, within: int) -> None:
    for seed in range(5):
        watch = ChangeDetector(WatchSettings(), 3)
        for one in squares(100, 0.95, seed):
            watch.observe(one)
        assert not watch.alarmed
        noticed = [watch.observe(one) for one in squares(within, ratio, 50 + seed)]
        assert any(noticed)
        assert 75 <= watch.since <= 100 + noticed.index(True)


def test_a_watch_goes_on_from_its_state() -> None:
    one, other = ChangeDetector(WatchSettings(), 3), ChangeDetector(WatchSettings(), 3)
    for x in squares(30, 1.2, 1):
        one.observe(x)
    other.set_state(one.get_state())
    for x in squares(30, 1.5, 2):
        assert one.observe(x) == other.observe(x)
    assert one.get_state() == other.get_state()
    with pytest.raises(UnusableInput, match="another simulation"):
        ChangeDetector(WatchSettings(), 2).set_state(one.get_state())
    with pytest.raises(UnusableInput, match="damaged"):
        ChangeDetector(WatchSettings(), 3).set_state({"movements": "many"})


def test_rewards_are_compared_in_standard_errors() -> None:
    # means 3 and 1, variances 1 and 4: 2 / sqrt(1/3 + 4/3)
    assert lower_by([2.0, 3.0, 4.0], [-1.0, 1.0, 3.0]) == pytest.approx(2 / math.sqrt(5 / 3))
    assert lower_by([1.0, 1.0], [1.0, 1.0]) == 0
    assert lower_by([2.0, 2.0], [1.0, 1.0]) == math.inf


def test_agents_that_are_no_worse_are_seldom_taken_back_and_bad_ones_soon() -> None:
    random, settings = np.random.default_rng(0), TrialSettings()

    def ends(new_mean: float) -> list[str]:
        found = []
        for _ in range(400):
            old, new = random.normal(38, 6, 30), random.normal(new_mean, 6, settings.looks[-1])
            said = [verdict(old, new[:n], settings) for n in range(1, settings.looks[-1] + 1)]
            found.append(next(one for one in said if one != "open"))
        return found

    assert ends(38).count("worse") <= 8
    assert ends(28).count("worse") >= 380


def test_nothing_is_decided_on_too_little() -> None:
    settings = TrialSettings(looks=(4, 8), fewest=3, remembered=10)
    old, bad = [30.0, 31.0, 32.0], [0.0, 1.0, 2.0, 3.0]
    assert verdict(old[:2], bad, settings) == "open"
    assert verdict(old, bad[:3], settings) == "open"
    assert verdict(old, bad, settings) == "worse"
    assert verdict(old, [*bad, 0.0], settings) == "open"  # looks are at set moments
    assert verdict(old, [31.0] * 8, settings) == "confirmed"

"""What collecting leaves to an arm: how long its muscles take to fill and to empty."""

import numpy as np
import pytest
from stand_ins import FirstOrderArm
from tests.plain_arms import throttled

from pneumarm.arm import guarded
from pneumarm.arm.virtual import VirtualArm, draw_parameters
from pneumarm.transitions import WHOLE_PERIODS, CollectSettings, Store, collect
from pneumarm.transitions.fill_times import find_fill_times
from pneumarm.transitions.rows import join_rows


class Unplugged(FirstOrderArm):
    """No pressure ever changes."""

    def wait(self, seconds):
        self.time += seconds


class Halfway(FirstOrderArm):
    """One muscle of a joint takes no air."""

    def wait(self, seconds):
        super().wait(seconds)
        self.pressure[:, 1] = 0.0


def test_times_are_those_of_nine_tenths_of_the_way():
    # 0.25 sqrt(1.3 - p) bar/s in, up to nine tenths of the limit; 0.9 sqrt(p) out, from there to a tenth
    limit = 1.2 - 400 / 3000  # at atmosphere its sensors read 400 counts of 3000 a bar
    filling, emptying = find_fill_times(guarded(throttled()))
    assert filling == pytest.approx(8 * (np.sqrt(1.3) - np.sqrt(1.3 - 0.9 * limit)), rel=0.1)
    assert emptying == pytest.approx((np.sqrt(limit) - np.sqrt(0.1 * limit)) / 0.45, rel=0.1)


@pytest.mark.parametrize("arm", [FirstOrderArm, Halfway])
def test_pressures_up_to_the_limit_count_and_muscles_that_hardly_move_do_not(arm):
    # time constants of 0.3 s; 360 of 400 counts are the limit, where the guard closes the inlet
    filling, emptying = find_fill_times(guarded(arm()))
    assert filling == pytest.approx(-0.3 * np.log(1 - 0.9 * 360 / 400), rel=0.25)
    assert emptying == pytest.approx(0.3 * np.log(10), rel=0.25)


def test_an_arm_without_air_is_taken_for_one_like_the_thesis():
    assert find_fill_times(guarded(Unplugged())) == (0.9, 0.35)


def full(folder, settings):
    with throttled() as arm, Store.create(folder / "slow.db", arm.spec) as store:
        collect(arm, store, 6_000, settings=settings)
        pressure = join_rows(store).pressure
        low = pressure.min(axis=(0, 1))
        return float((pressure - low > 0.6 * arm.spec.max_pressure_counts).mean())


def test_an_arm_that_fills_slowly_is_seen_at_high_pressures(tmp_path):
    (tmp_path / "thesis").mkdir()
    assert full(tmp_path, CollectSettings()) > 0.15
    assert full(tmp_path / "thesis", WHOLE_PERIODS) < 0.05


def test_an_interrupted_collection_goes_on_with_the_times_found(tmp_path):
    def interrupt(done, wanted):
        if done < wanted:
            raise KeyboardInterrupt

    def content(name, progress=None):
        while True:
            with VirtualArm(draw_parameters(3), seed=1) as arm, Store.for_arm(tmp_path / name, arm.spec) as store:
                try:
                    result = collect(
                        arm, store, 2_000, seed=2, settings=CollectSettings(actions=500), progress=progress
                    )
                except KeyboardInterrupt:
                    continue
                rows = join_rows(store)
                return rows.angle, rows.command, rows.time, result.seconds

    for one, other in zip(content("whole.db"), content("parts.db", interrupt), strict=True):
        np.testing.assert_array_equal(one, other)

import numpy as np
import pytest

from pneumarm.arm.virtual import VirtualArm, draw_parameters, figures, preset_parameters, resting_angle
from pneumarm.arm.virtual.distribution import _draw
from pneumarm.errors import UnusableInput


@pytest.fixture(scope="module")
def drawn():
    random = np.random.default_rng(0)
    return [_draw(random) for _ in range(150)]


def percentiles(values):
    return np.percentile(values, [5, 50, 95])


def test_the_distribution_has_the_reference_percentiles(drawn):
    found = [figures(parameters) for parameters in drawn]
    plus = percentiles([np.degrees(f.sweep[1]) for f in found])
    minus = percentiles([np.degrees(f.sweep[0]) for f in found])
    assert plus == pytest.approx([46.3, 55.1, 66.9], abs=4)
    assert minus == pytest.approx([-66.0, -55.3, -44.8], abs=4)
    assert percentiles([f.fill[0] for f in found]) == pytest.approx([0.68, 0.85, 1.12], abs=0.1)
    assert percentiles([f.ring for f in found]) == pytest.approx([2.10, 2.56, 3.12], abs=0.35)
    assert 0.85 < np.mean([f.usable() for f in found]) < 1


def test_unequal_muscles_shift_the_rest_angle(drawn):
    angles = [np.degrees(resting_angle(p, [[3e4, 3e4]], end_stops=False)[0]) for p in drawn]
    assert percentiles(angles) == pytest.approx([-5.7, -0.4, 6.2], abs=2)


def test_a_number_is_always_the_same_arm_and_another_is_another():
    assert draw_parameters(7) == draw_parameters(7)
    assert draw_parameters(7) != draw_parameters(8)
    first, second = draw_parameters(7).joints[0].muscles
    assert first != second


def test_drawn_arms_can_do_the_job():
    assert all(figures(draw_parameters(seed)).usable() for seed in range(100, 110))


def test_drawn_arms_stay_sane_under_babble():
    for seed in range(40, 60):
        arm, random = VirtualArm(draw_parameters(seed), seed=seed), np.random.default_rng(seed)
        fastest = 0.0
        for _ in range(30 * 10):
            arm.set_valves(random.integers(-1, 2, (1, 2)))
            arm.wait(1 / 30)
            fastest = max(fastest, abs(np.degrees(arm.speed[0])))
            assert abs(np.degrees(arm.angle[0])) < 75
            assert (arm.pressure > -0.6e5).all()
            assert (arm.pressure < 1.6e5).all()
        assert fastest > 100


def test_presets_and_their_figures():
    assert figures(preset_parameters("A")).fill[0] == pytest.approx(1.17, abs=0.02)
    assert figures(preset_parameters("B")).fill[0] == pytest.approx(0.85, abs=0.02)
    assert figures(preset_parameters("C")).fill[0] == pytest.approx(0.62, abs=0.02)
    assert np.degrees(figures(preset_parameters()).sweep) == pytest.approx([-56.8, 56.8], abs=0.06)


def test_unknown_arms_are_refused():
    with pytest.raises(UnusableInput, match="preset 'D': expected one of A, B, C"):
        preset_parameters("D")
    with pytest.raises(UnusableInput, match="seed of a virtual arm must be 0 or more"):
        draw_parameters(-1)

from dataclasses import replace

import numpy as np
import pytest

from pneumarm.arm.virtual import SensorParameters, VirtualArm
from pneumarm.arm.virtual.parameters import ATMOSPHERE, BAR
from pneumarm.errors import UnusableInput


def readings(parameters, count=4000, seed=0, angle=0.1, pressure=0.5 * BAR):
    """Many readings of one moment: angles (count,) and pressures (count, 2) [counts]."""
    arm = VirtualArm(parameters, seed=seed)
    arm.body.joints["angle"] = angle
    arm.body.muscles["pressure"] = ATMOSPHERE + pressure
    read = [arm.read() for _ in range(count)]
    return np.array([r.angle[0] for r in read]), np.array([r.pressure[0] for r in read])


def with_sensors(parameters, **changes):
    return replace(parameters, sensors=replace(SensorParameters(), **changes))


def test_the_counts_are_those_of_the_thesis(nominal):
    angle, pressure = readings(nominal, 1, angle=np.radians(30))
    assert angle[0] == round(511.5 + 30 * 11.378)
    assert pressure[0].tolist() == [83, 83]


def test_readings_are_whole_counts_within_ten_bits(nominal):
    angle, pressure = readings(with_sensors(nominal), 50, angle=2.0, pressure=-0.1 * BAR)
    assert (angle == 1023).all()
    assert (pressure == 0).all()
    angle, pressure = readings(with_sensors(nominal), 50)
    assert (angle == np.round(angle)).all()
    assert (pressure == np.round(pressure)).all()


def test_a_median_tempers_the_noise(nominal):
    spread = []
    for conversions in (1, 5, 7, 9):
        angle, pressure = readings(with_sensors(nominal, conversions=conversions))
        spread.append((angle.std(), pressure.std()))
        assert angle.mean() == pytest.approx(511.5 + np.degrees(0.1) * 11.378, abs=0.1)
    assert (np.diff(spread, axis=0) < 0).all()
    # Of one: the noise and the rounding. Of five: the median's variance is 0.287 of one conversion's.
    assert spread[0] == pytest.approx((1.62, 1.62), abs=0.08)
    assert spread[1] == pytest.approx((0.89, 0.89), abs=0.08)


def test_noise_is_never_larger_than_its_limit(nominal):
    angle, _ = readings(with_sensors(nominal, conversions=1, angle_noise=3.0))
    true = 511.5 + np.degrees(0.1) * 11.378
    assert np.abs(angle - true).max() <= 4.5
    assert np.abs(angle - true).max() > 3.5


def test_wear_makes_bumps_that_stay_where_they_are(nominal):
    worn = replace(nominal, sensors=replace(nominal.sensors, wear=5.0, wear_seed=1))
    places = np.radians(np.linspace(-40, 40, 300))
    bump = [readings(worn, 1, angle=a)[0][0] - readings(nominal, 1, angle=a)[0][0] for a in places]
    again = [readings(worn, 1, seed=9, angle=a)[0][0] - readings(nominal, 1, angle=a)[0][0] for a in places]
    assert bump == again
    assert 3 <= np.abs(bump).max() <= 10
    assert np.mean(np.abs(bump) < 0.5) > 0.3


def test_a_worn_potentiometer_loses_contact_now_and_then(nominal):
    angle, pressure = readings(replace(nominal, sensors=replace(nominal.sensors, dropout=0.01)))
    assert np.mean(angle == 0) == pytest.approx(0.01, abs=0.006)
    assert (pressure == 83).all()


def test_impossible_sensors_are_refused():
    with pytest.raises(UnusableInput, match="conversions cannot be 4; expected 1, 5, 7 or 9"):
        SensorParameters(conversions=4)
    with pytest.raises(UnusableInput, match="angle_noise cannot be nan"):
        SensorParameters(angle_noise=float("nan"))

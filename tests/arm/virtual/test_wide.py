"""The wide distribution: sound arms, and all that they differ in."""

from dataclasses import replace

import numpy as np
import pytest

from pneumarm.arm import open_arm
from pneumarm.arm.virtual import ArmParameters, VirtualArm, draw_wide
from pneumarm.arm.virtual.parameters import BAR
from pneumarm.arm.virtual.wide import is_sound


@pytest.fixture(scope="module")
def drawn():
    return [draw_wide(seed) for seed in range(60)]


def test_a_number_is_always_the_same_arm_and_another_is_another(drawn):
    assert draw_wide(7) == drawn[7]
    assert len(set(drawn)) == len(drawn)


def test_arms_differ_in_all_that_the_distribution_is_for(drawn):
    def spread(values):
        return min(values), max(values)

    muscles = [one.joints[0].muscles[0] for one in drawn]
    wide = {
        "inlet": [one.inlet / 8.8e-10 for one in muscles],
        "supply": [one.air.supply / BAR for one in drawn],
        "delay": [1e3 * one.air.pipe_delay for one in drawn],
        "rate": [1 / one.period for one in drawn],
        "bits": [one.sensors.bits for one in drawn],
        "stroke": [2 * np.degrees(one.joints[0].stop_angle) for one in drawn],
        "tilt": [np.degrees(one.joints[0].tilt) for one in drawn],
        "strength": [(one.diameter / 0.03) ** 2 for one in muscles],
    }
    reached = {
        "inlet": (0.4, 2.2),
        "supply": (1.2, 2.8),
        "delay": (3, 18),
        "rate": (22, 90),
        "bits": (8, 16),
        "stroke": (50, 130),
        "tilt": (-120, 120),
        "strength": (1.15, 1.85),
    }
    for name, (low, high) in reached.items():
        assert spread(wide[name])[0] <= low, name
        assert spread(wide[name])[1] >= high, name
    assert 0 < sum(one.sensor_share > 0 for one in muscles) < len(muscles)
    assert 0 < sum(one.air.droop > 0 for one in drawn) < len(drawn)


def test_every_draw_is_sound_and_an_arm_that_cannot_do_the_job_is_not(drawn):
    assert all(map(is_sound, drawn))
    nominal = ArmParameters()
    assert is_sound(nominal)
    assert not is_sound(replace(nominal, air=replace(nominal.air, supply=0.3 * BAR)))
    heavy = replace(nominal.joints[0], mass=10.0, tilt=np.pi / 2)
    assert not is_sound(replace(nominal, joints=(heavy,)))


def test_a_supply_that_gives_way_falls_with_what_is_taken_and_recovers():
    nominal = ArmParameters()
    steady = replace(nominal.air, fluctuation=0.0, compressor=0.0)
    arm = VirtualArm(replace(nominal, air=replace(steady, droop=1e8, droop_time=0.1)))
    supply = arm.body.surroundings["supply"]
    before = float(supply[0])
    arm.set_valves(np.ones((1, 2), np.int8))
    arm.wait(0.3)
    assert before - float(supply[0]) > 0.1 * BAR
    arm.set_valves(np.zeros((1, 2), np.int8))
    arm.wait(2.0)
    assert before - float(supply[0]) < 1e-3 * BAR


def test_a_sensor_towards_the_valve_reads_too_much_while_air_flows():
    nominal = ArmParameters()
    muscle = replace(nominal.joints[0].muscles[0], sensor_share=0.3)
    arm = VirtualArm(replace(nominal, joints=(replace(nominal.joints[0], muscles=(muscle, muscle)),)))
    arm.set_valves(np.ones((1, 2), np.int8))
    arm.wait(0.1)
    too_much = arm.read().pressure - 166.0 * arm.pressure / BAR
    assert (too_much > 20).all()
    arm.set_valves(np.zeros((1, 2), np.int8))
    arm.wait(0.1)
    assert (abs(arm.read().pressure - 166.0 * arm.pressure / BAR) < 5).all()


def test_counts_of_a_wide_arm_are_in_its_spec():
    with open_arm("virtual:wide,seed=3") as arm:
        spec, reading = arm.spec, arm.read()
        assert spec.angle_range == (0.0, arm.parameters.sensors.highest)
        assert abs(spec.degrees(reading.angle) - np.degrees(arm.angle)) < 1.0

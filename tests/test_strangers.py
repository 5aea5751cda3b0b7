"""The arms of strangers: sound ones, each the same whenever it is opened, and whose physics adds up."""

import math
from dataclasses import replace

import numpy as np
import pytest
from benchmarks import strangers
from benchmarks.strangers import measure, motion
from benchmarks.strangers.air import ATMOSPHERE
from benchmarks.strangers.arm import Stranger
from benchmarks.strangers.draw import draw_arm
from benchmarks.strangers.hysteresis import BOUC_WEN, KINDS, NONE, PLAY, SLIP
from benchmarks.strangers.muscles import BAR, LAWS, LITRES, measured
from benchmarks.strangers.valves import Valves

from pneumarm.arm import guarded, open_arm
from pneumarm.errors import UnusableInput
from tests.arm import test_contract as contract

ARMS = "one_1", "one_2", "one_3", "one_6", "one_7", "one_9", "one_18", "two_1", "two_3"
"""All families of muscles and all flows, with and without hoses, pulses and two joints."""


@pytest.fixture(params=ARMS)
def arm(request):
    with getattr(strangers, request.param)() as arm:
        yield arm


# Five checks of the contract that every arm keeps. Of the others, valves and closing are tested below in other words;
# what the guard's limit and shares of a pulse let in is not, since those checks are in the thesis' counts by bar.
test_a_reading_has_the_shapes_and_units_of_the_spec = contract.test_a_reading_has_the_shapes_and_units_of_the_spec
test_readings_are_kept_apart = contract.test_readings_are_kept_apart
test_time_advances_by_waiting_and_by_nothing_else = contract.test_time_advances_by_waiting_and_by_nothing_else
test_impossible_valves_are_refused = contract.test_impossible_valves_are_refused_before_anything_is_set
test_the_cycle_keeps_period_and_latency = contract.test_the_cycle_keeps_period_and_latency


def valves(arm, first, second):
    return np.tile(np.array([first, second], np.int8), (arm.spec.joints, 1))


def moved(arm, first, second, seconds):
    """Return what the arm reads after all its joints had such valves."""
    arm.set_valves(valves(arm, first, second))
    arm.wait(seconds)
    return arm.read()


def babbled(arm):
    """Return what the arm reads while its valves do anything."""
    random, found = np.random.default_rng(3), []
    for _ in range(150):
        command = random.uniform(-1, 1, (arm.spec.joints, 2))
        if not arm.set_pulses(command):
            arm.set_valves(np.round(command).astype(np.int8))
        arm.wait(arm.spec.period)
        reading = arm.read()
        found.append([reading.time, *reading.angle, *reading.pressure.ravel()])
    return np.array(found)


@pytest.mark.parametrize("name", ["one_3", "two_1"])
def test_an_arm_is_the_same_whenever_it_is_opened(name):
    first, again = (babbled(getattr(strangers, name)()) for _ in range(2))
    assert np.array_equal(first, again)


def test_an_arm_goes_on_from_its_state(arm):
    babbled(arm)
    state = arm.get_state()
    first = babbled(arm)
    other = getattr(strangers, arm.spec.name.split()[1])()
    other.set_state(state)
    assert np.array_equal(babbled(other), first)
    with pytest.raises(UnusableInput, match="expected a state of an arm like this"):
        arm.set_state(b"{}")


def test_numbers_are_different_arms():
    specs = [draw_arm(number, 1).spec for number in (1, 2, 1000)]
    assert len({spec.counts_per_degree for spec in specs}) == 3


def test_readings_are_finite_and_within_what_the_spec_says(arm):
    found = babbled(arm)
    joints, top = arm.spec.joints, arm.design.pressures.top
    low, high = arm.spec.angle_range
    angles, pressures = found[:, 1 : 1 + joints], found[:, 1 + joints :]
    assert np.isfinite(found).all()
    assert ((low < angles) & (angles < high)).all()
    assert ((pressures >= 0) & (pressures <= top)).all()
    assert (np.diff(found[:, 0]) > 0).all()


def test_air_moves_every_joint_both_ways_by_most_of_its_range(arm):
    low, high = arm.spec.angle_range
    safe = guarded(arm)
    ends = []
    for first, second in ((1, -1), (-1, 1)):
        safe.set_valves(valves(arm, first, second))
        safe.wait(9.0)
        ends.append(safe.read().angle)
    turned = (ends[0] - ends[1]) / arm.spec.counts_per_degree
    assert (turned >= 0.75 * 2 * np.degrees(arm.design.body.stop)).all()
    assert ((low < np.array(ends)) & (np.array(ends) < high)).all()
    assert safe.interventions.inflation == 0


def test_each_muscle_obeys_its_own_valve(arm):
    design = arm.design
    for joint in range(arm.spec.joints):
        for muscle in (0, 1):
            moved(arm, -1, -1, 4.0)
            opened = valves(arm, 0, 0)
            opened[joint, muscle] = 1
            before = arm.read().pressure
            arm.set_valves(opened)
            arm.wait(0.5)
            rise = (arm.read().pressure - before) / arm.spec.counts_per_bar
            assert rise[joint, muscle] > 5 * design.pressures.noise
            assert np.argmax(rise) == 2 * joint + muscle


def test_what_is_closed_comes_to_rest_and_stays(arm):
    moved(arm, 1, 1, 0.4 * arm.spec.fill_times[0])
    arm.set_valves(valves(arm, 0, 0))
    arm.wait(12.0)
    degrees = []
    for _ in range(2):
        degrees.append(np.degrees(arm._state.angle))
        arm.wait(1.0)
    assert degrees[1] == pytest.approx(degrees[0], abs=1.5)  # leaks and creep
    assert (arm._state.pressure[arm.design.air.leak == 0] > ATMOSPHERE).all()


def test_closing_closes_the_valves_also_twice(arm):
    moved(arm, 1, 1, 0.2)
    arm.close()
    arm.close()
    arm.wait(0.02)
    assert not (arm._valves.open[..., 1] > arm._time).any()


def test_who_can_do_pulses_does_the_shortest(arm):
    moved(arm, -1, -1, 4.0)
    before = arm._state.line.copy()
    done = arm.set_pulses(np.full((arm.spec.joints, 2), arm.spec.shortest_pulse / arm.spec.period))
    assert done == arm.spec.pulses
    arm.wait(0.05)
    assert ((arm._state.line > before + 1e-4) == arm.spec.pulses).all()


def test_strangers_are_opened_by_name():
    with open_arm("python:benchmarks.strangers:two_5") as arm:
        assert arm.spec.joints == 2
        assert arm.spec.name == "stranger two_5"
    with pytest.raises(AttributeError, match="one_7 or two_7, not three_7"):
        getattr(strangers, "three_7")  # noqa: B009


def test_the_table_has_a_line_a_joint():
    head, *lines = measure()
    assert head.split()[0] == "arm"
    assert [line.split()[0] for line in lines[-3:]] == ["two_3", "two_4", "two_4"]


@pytest.mark.parametrize("family", LAWS, ids=lambda one: one.__name__)
def test_a_muscle_of_constant_pressure_works_as_much_as_it_grows(family):
    law = family(np.random.default_rng(5), 3.0)
    used = law.low + 0.1 * (law.high - law.low), law.low + 0.9 * (law.high - law.low)
    length, area = 0.2, 1e-3
    table, _, spacing = measured(law, area, length, used, 0.4)
    work = np.trapezoid(table[:, 1], dx=spacing * length)  # [N m/bar]
    assert work == pytest.approx(BAR * (table[-1, 3] - table[0, 3]) / LITRES, rel=0.02)
    assert (table[:, 3] > 0).all()


def test_air_that_is_shut_in_is_compressed_by_its_exponent():
    arm = Stranger(3)
    made = arm.design
    assert not made.air.hose.any()
    arm.design = made = replace(made, air=made.air._replace(leak=np.zeros((1, 2))))
    moved(arm, 1, 1, 0.4 * arm.spec.fill_times[0])
    moved(arm, 0, 0, 0.1)

    def shut_in():
        volumes = [motion.volume_at(made.body, made.muscles, arm._state.angle[0], m) for m in (0, 1)]
        return arm._state.pressure[0] * np.array(volumes) ** made.air.exponent, np.array(volumes)

    before, volumes = shut_in()
    arm._state.speed[0] += 4.0
    arm.wait(0.05)
    after, others = shut_in()
    assert np.abs(others / volumes - 1).min() > 0.02
    assert after == pytest.approx(before, rel=2e-3)


def test_the_natural_frequency_is_what_was_drawn():
    arm = Stranger(2)  # lightly damped
    design = arm.design
    assert design.about[0]["damping ratio"] < 0.05
    half = design.loops.full[0] / 2
    arm._state.pressure[:] = arm._state.line[:] = ATMOSPHERE + half
    arm._state.angle[:] = arm._state.speed[:] = 0.0
    without = design.loops._replace(kind=np.array([NONE])), design.body._replace(creep=np.zeros(1))
    arm.design = replace(design, loops=without[0], body=without[1])
    angles = []
    for _ in range(1000):
        arm.wait(2e-3)
        angles.append(arm._state.angle[0])
    swing = np.array(angles) - np.mean(angles)
    peaks = np.flatnonzero((swing[1:-1] > swing[:-2]) & (swing[1:-1] >= swing[2:]))
    assert len(peaks) > 5
    assert 1 / (2e-3 * np.diff(peaks).mean()) == pytest.approx(design.about[0]["swing [Hz]"], rel=0.15)


def test_valves_open_and_close_after_their_dead_times():
    made = Valves(np.full((1, 2, 2), 0.004), np.full((1, 2, 2), 0.002))
    made.set(1.0, np.array([[0.5, -1.0]]), 0.02)  # a pulse of 10 ms in, and out until the next call
    assert made.open[0, 0, 0] == pytest.approx([1.004, 1.012])
    assert made.open[0, 1, 1] == pytest.approx([1.004, math.inf])
    made.set(1.02, np.array([[0.0, 1.0]]), 0.02)
    assert made.open[0, 1, 1] == pytest.approx([1.004, 1.022])
    assert made.open[0, 1, 0] == pytest.approx([1.024, math.inf])
    made.set(1.0215, np.array([[0.0, -1.0]]), 0.02)  # before the outlet has closed, or the inlet opened
    assert made.open[0, 1, 1] == pytest.approx([1.004, math.inf])
    assert np.diff(made.open[0, 1, 0])[0] == 0
    made.set(2.0, np.array([[0.15, -1.0]]), 0.02)  # 3 ms of current, less than it needs
    assert np.diff(made.open[0, 0, 0])[0] == 0


def test_a_valve_counts_for_the_share_of_a_step_in_which_it_is_open():
    assert motion.open_for(1.0, 1.5, 0.8, 1.0) == pytest.approx(0.5)
    assert motion.open_for(1.0, math.inf, 0.8, 0.1) == 0.0
    assert motion.open_for(-math.inf, -math.inf, 0.0, 1.0) == 0.0


@pytest.mark.parametrize("kind", [SLIP, BOUC_WEN, PLAY], ids=lambda kind: KINDS[kind])
def test_loops_take_work_on_a_way_there_and_back(kind):
    number = next(n for n in range(1, 100) if draw_arm(n, 1).loops.kind[0] == kind)
    made = draw_arm(number, 1)
    state = motion.at_atmosphere(1, made.air.full)
    full = made.loops.full[0]
    turn, work = math.radians(10), 0.0
    for begin, end in ((0, 1), (1, -1), (-1, 1)):
        for place in np.linspace(begin, end, 2001)[1:]:
            step = turn * (end - begin) / 2000
            if kind == PLAY:
                state.pressure[0, 0] = ATMOSPHERE + full * (1 + place) / 2
                worth = motion._worth(made.loops, state, 0, 0)
                lag = full * (1 + place) / 2 - worth
                work += lag * (end - begin)
            else:
                state.pressure[:] = ATMOSPHERE + full
                work += motion._remembered(made.loops, state, 0, step) * step
    assert work > 0

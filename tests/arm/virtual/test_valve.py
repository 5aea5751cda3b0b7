import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneumarm.arm.virtual import (
    ArmParameters,
    Leak,
    StuckValve,
    SwappedMuscles,
    SwappedValves,
    VirtualArm,
    draw_parameters,
    without_noise,
)
from pneumarm.arm.virtual.state import INLET, MUSCLE, OUTLET, QUEUE
from pneumarm.arm.virtual.valve import switch, toggle_due

DELAY = 0.012


def test_the_air_notices_after_the_dead_time(held, nominal):
    arm = VirtualArm(held(nominal))
    before = arm.pressure.copy()
    arm.set_valves([[1, 0]])
    arm.wait(DELAY - 1e-6)
    assert arm.pressure == pytest.approx(before, abs=0.1)
    arm.wait(1e-3)
    assert arm.pressure[0, 0] > 100
    assert arm.pressure[0, 1] == pytest.approx(before[0, 1], abs=0.1)


def test_the_dead_time_is_placed_exactly(held, nominal):
    """A pulse of any length lets in air for exactly that length, wherever it falls between the substeps."""
    gained = []
    for offset in (0.0, 0.00013, 0.00037):
        arm = VirtualArm(held(nominal))
        arm.wait(0.1 + offset)
        arm.set_valves([[1, 0]])
        arm.wait(0.00777)
        arm.set_valves([[0, 0]])
        arm.wait(0.1)
        gained.append(arm.pressure[0, 0])
    assert gained == pytest.approx([gained[0]] * 3, rel=2e-4)


def test_a_pulse_shorter_than_the_switching_never_opens():
    muscle = np.zeros(1, MUSCLE)[0]
    switch(muscle, INLET, 1, 1.012)
    switch(muscle, INLET, 0, 1.0115)  # closes faster than it opens
    assert muscle["pending"][INLET] == 0


@given(st.lists(st.tuples(st.integers(0, 1), st.floats(1e-4, 0.02)), max_size=30))
@settings(deadline=None)
def test_the_valve_ends_as_it_was_last_told(commands):
    muscle = np.zeros(1, MUSCLE)[0]
    now = 0.0
    for wanted, pause in commands:
        switch(muscle, OUTLET, wanted, now + (0.012 if wanted else 0.0105))
        assert muscle["pending"][OUTLET] <= QUEUE
        toggles = muscle["toggles"][OUTLET][: muscle["pending"][OUTLET]]
        assert (np.diff(toggles) > 0).all()
        now += pause
        toggle_due(muscle, now)
    toggle_due(muscle, now + 1)
    assert muscle["pending"][OUTLET] == 0
    assert muscle["open"][OUTLET] == (commands[-1][0] if commands else 0)
    assert muscle["open"][INLET] == 0


def test_both_valves_of_a_muscle_are_never_told_to_be_open():
    arm = VirtualArm()
    random = np.random.default_rng(2)
    for _ in range(200):
        arm.set_valves(random.integers(-1, 2, (1, 2)))
        arm.wait(random.uniform(0, 0.04))
        assert (arm.body.muscles["open"].sum(axis=-1) <= 1).all()


@pytest.mark.parametrize("share", [0.1, 0.25, 0.37, 0.9])
def test_a_pulse_is_the_same_as_opening_and_closing_by_hand(share):
    parameters = without_noise(draw_parameters(3))
    by_itself, by_hand, whole = (VirtualArm(parameters, seed=3) for _ in range(3))
    period = by_itself.spec.period
    for _ in range(10):
        assert by_itself.set_pulses(np.array([[share, -share]]))
        by_itself.wait(period)
        by_hand.set_valves([[1, -1]])
        by_hand.wait(share * period)
        by_hand.set_valves([[0, 0]])
        by_hand.wait((1 - share) * period)
        whole.set_valves([[1, -1]])
        whole.wait(period)
    assert by_itself.pressure == pytest.approx(by_hand.pressure, rel=1e-3, abs=1.0)
    assert by_itself.air_used() == pytest.approx(by_hand.air_used(), rel=1e-3)
    assert by_itself.air_used() == pytest.approx(share * whole.air_used(), rel=0.1)


def test_the_air_used_is_what_fills_the_muscle():
    arm = VirtualArm(without_noise(ArmParameters()))
    arm.set_valves([[1, 0]])
    arm.wait(0.5)
    arm.set_valves([[0, 0]])
    arm.wait(0.1)
    muscle, c = arm.body.muscles[0, 0], arm.body.constants.muscles[0, 0]
    # n p V of the air that came in: isothermal would be the gain in p V; polytropic is between.
    gained = (muscle["volume"] + c["dead_volume"]) * arm.pressure[0, 0] / 1e5 * 1e3
    assert gained / 1.4 < arm.air_used() < 1.5 * gained


@pytest.mark.parametrize(
    ("fault", "done"),
    [
        (StuckValve(valve="inlet", position="closed"), [[0.0, -0.25]]),
        (SwappedMuscles(), [[-0.25, 0.5]]),
        (SwappedValves(), [[-0.5, -0.25]]),
    ],
)
def test_faults_of_valves_play_pulses_too(fault, done):
    parameters = without_noise(ArmParameters())
    faulty, sound = VirtualArm(parameters), VirtualArm(parameters)
    for arm, asked in ((faulty, [[0.5, -0.25]]), (sound, done)):
        arm.set_valves([[1, 1]])
        arm.wait(0.3)
        arm.set_valves([[0, 0]])
        if arm is faulty:
            arm.faults = (fault,)
        arm.set_pulses(np.array(asked))
        arm.wait(0.1)
    assert faulty.pressure == pytest.approx(sound.pressure, rel=1e-6)


def test_a_fault_that_begins_within_a_pulse_leaves_its_end_where_it_was():
    parameters = without_noise(ArmParameters())
    begins = Leak(joint=1, muscle=2, factor=1.0001, begin=0.010)
    faulty, sound = VirtualArm(parameters, faults=(begins,)), VirtualArm(parameters)
    for arm in (faulty, sound):
        arm.set_pulses(np.array([[0.6, 0.0]]))
        arm.wait(0.2)
    assert faulty.pressure[0, 0] == pytest.approx(sound.pressure[0, 0], rel=1e-3)

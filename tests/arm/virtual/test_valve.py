import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneumarm.arm.virtual import VirtualArm
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

"""Windows by hand: what eq. 3.5 takes from the rows, at rest, in motion, and around gaps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneumarm.transitions import Rows, Window, transitions
from pneumarm.transitions.window import observations


def rows(angles, joints=1, steps=None, sequences=None, at_rest=True, period=0.1):
    """Return rows whose numbers tell where they come from: pressures and commands are made of the angle."""
    n = len(angles)
    angle = np.array(angles, float)[:, None] + 1000 * np.arange(joints)
    steps = np.arange(n) if steps is None else np.array(steps)
    sequences = np.ones(n, int) if sequences is None else np.array(sequences)
    command = np.stack([angle / 7, -angle / 7], axis=2)
    command[np.append(np.diff(sequences) != 0, True)] = np.nan
    return Rows(
        sequence=sequences,
        step=steps,
        time=period * np.arange(n) + 5.0,
        angle=angle,
        pressure=np.stack([angle + 0.25, angle + 0.5], axis=2),
        command=command,
        at_rest=np.full(n, at_rest),
    )


def test_by_hand_one_joint_three_steps_from_rest():
    found = transitions(rows([10, 30, 60, 100]), Window(1, 3))
    # velocities: 0, 20 counts in 100 ms, 30, 40
    o = [[10, 0, 10.25, 10.5], [30, 0.2, 30.25, 30.5], [60, 0.3, 60.25, 60.5], [100, 0.4, 100.25, 100.5]]
    a = [[10 / 7, -10 / 7], [30 / 7, -30 / 7], [60 / 7, -60 / 7]]
    expected = [
        [*o[0], *o[0], *o[0], 0, 0, 0, 0, *a[0]],
        [*o[1], *o[0], *o[0], *a[0], 0, 0, *a[1]],
        [*o[2], *o[1], *o[0], *a[1], *a[0], *a[2]],
    ]
    np.testing.assert_allclose(found.inputs, expected, rtol=1e-6)
    np.testing.assert_allclose(found.target, o[1:], rtol=1e-6)
    np.testing.assert_allclose(found.interval, 0.1, rtol=1e-6)
    np.testing.assert_allclose(found.observation, o[:3], rtol=1e-6)
    assert found.step.tolist() == [0, 1, 2]
    assert found.inputs.shape[1] == Window(1, 3).input_size == 18


def test_a_sequence_in_motion_waits_for_its_window_and_its_oldest_velocity():
    for history in range(1, 6):
        found = transitions(rows(range(10), at_rest=False), Window(1, history))
        assert found.step.tolist() == list(range(history, 9))


@pytest.mark.parametrize("history", [1, 2, 3, 4, 5])
def test_nothing_spans_a_gap(history):
    steps = [0, 1, 2, 3, 5, 6, 7, 8, 9, 10, 11]
    found = transitions(rows(range(11), steps=steps), Window(1, history))
    # 3 has no next; after the gap the window has to fill again, for the oldest velocity too
    assert found.step.tolist() == [0, 1, 2, *range(5 + history, 11)]


def test_a_time_that_does_not_rise_is_a_gap():
    given_rows = rows(range(6))
    given_rows.time[3] = given_rows.time[2]
    assert transitions(given_rows, Window(1, 1)).step.tolist() == [0, 1, 4]


def test_nothing_spans_two_sequences():
    found = transitions(rows(range(10), sequences=[1] * 4 + [2] * 6, steps=[*range(4), *range(6)]), Window(1, 3))
    assert found.sequence.tolist() == [1] * 3 + [2] * 5
    second = found.inputs[3]
    assert second[0] == second[4] == second[8] == 4  # padded with its own first row


def test_velocity_uses_the_times_as_they_were():
    given_rows = rows([0, 10, 20])
    given_rows.time[:] = [0.0, 0.1, 0.15]
    np.testing.assert_allclose(observations(given_rows, Window())[:, 1], [0, 0.1, 0.2])


@given(st.integers(1, 3), st.integers(1, 5), st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_every_window_equals_one_built_row_by_row(joints, history, seed):
    random = np.random.default_rng(seed)
    n = 25
    steps = np.cumsum(random.integers(1, 3, n) if random.random() < 0.5 else np.ones(n, int)) - 1
    steps -= steps[0]
    given_rows = rows(random.integers(0, 1000, n), joints, steps=steps, at_rest=bool(random.integers(2)))
    window = Window(joints, history)
    found = transitions(given_rows, window)
    observed = observations(given_rows, Window())
    command = given_rows.command.reshape(n, -1)
    built = []
    begin = 0
    for k in range(n - 1):
        if k and steps[k] != steps[k - 1] + 1:
            begin = k
        joined_on = steps[k + 1] == steps[k] + 1
        from_rest = begin == 0 and given_rows.at_rest[0]
        if joined_on and (from_rest or k - begin >= history):
            past = [observed[max(k - lag, begin)] for lag in range(history)]
            zero = np.zeros(2 * joints)
            done = [command[k - lag] if k - lag >= begin else zero for lag in range(1, history)]
            built.append(np.concatenate([*past, *done, command[k]]))
    assert len(built) == len(found.inputs)
    if built:
        np.testing.assert_array_equal(found.inputs, np.array(built, np.float32))
    assert found.inputs.shape[1] == window.input_size == len(window.input_names())


def test_names_say_what_an_input_is():
    names = Window(2, 3).input_names()
    found = transitions(rows([10, 30, 60, 100], joints=2), Window(2, 3))
    of = dict(zip(names, found.inputs[2], strict=True))
    assert of["angle of joint 2[k-1]"] == 1030
    assert of["pressure_2 of joint 1[k]"] == 60.5
    assert of["velocity of joint 2[k]"] == pytest.approx(0.3)
    assert of["command_1 of joint 2[k-2]"] == pytest.approx(1010 / 7)
    assert of["command_2 of joint 1[k]"] == pytest.approx(-60 / 7)
    assert len(set(names)) == len(names)
    observed = ["angle[k]", "velocity[k]", "pressure_1[k]", "pressure_2[k]"]
    assert Window(1, 1).input_names() == [*observed, "command_1[k]", "command_2[k]"]

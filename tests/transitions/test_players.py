"""Trajectories and the keyboard are controllers like any other."""

import os
import pty

import numpy as np
import pytest

from pneumarm.arm import Reading
from pneumarm.errors import UnusableInput
from pneumarm.transitions import Keyboard, Trajectory

READING = Reading(0.0, np.zeros(2), np.zeros((2, 2)))


def test_a_trajectory_is_played_from_the_beginning_and_ends_closed():
    valves = np.array([[[1, -1], [0, 1]], [[-1, 0], [1, 1]]])
    trajectory = Trajectory(valves)
    for _ in range(2):
        trajectory.reset(np.zeros(2))
        played = [trajectory.act(READING) for _ in range(4)]
        np.testing.assert_array_equal(played[:2], valves)
        np.testing.assert_array_equal(played[2:], np.zeros((2, 2, 2)))


@pytest.mark.parametrize(
    "valves", [np.zeros((3, 2)), np.zeros((0, 1, 2)), np.full((3, 1, 2), 2), np.zeros((3, 1, 3))]
)
def test_other_trajectories_are_refused(valves):
    with pytest.raises(UnusableInput, match="shape"):
        Trajectory(valves)


def test_keys_set_valves_and_hold():
    mine, theirs = pty.openpty()
    try:
        with Keyboard(joints=2, descriptor=theirs) as keyboard:
            keyboard.reset(np.zeros(2))
            assert not keyboard.act(READING).any()
            os.write(mine, b"qx?r")
            np.testing.assert_array_equal(keyboard.act(READING), [[1, -1], [0, 1]])
            np.testing.assert_array_equal(keyboard.act(READING), [[1, -1], [0, 1]])
            os.write(mine, b"azf")
            np.testing.assert_array_equal(keyboard.act(READING), [[-1, -1], [0, 0]])
            keyboard.reset(np.zeros(2))
            assert not keyboard.act(READING).any()
    finally:
        os.close(mine)
        os.close(theirs)


def test_the_keyboard_needs_a_terminal_and_keys_enough():
    read_end, write_end = os.pipe()
    with pytest.raises(UnusableInput, match="needs a terminal"):
        Keyboard(descriptor=read_end)
    os.close(read_end)
    os.close(write_end)
    mine, theirs = pty.openpty()
    with pytest.raises(UnusableInput, match="keys for 3 joints, this arm has 4"):
        Keyboard(joints=4, descriptor=theirs)
    os.close(mine)
    os.close(theirs)

"""The thesis' own figures, printed beside ours; each with the table or section it was taken from."""

import numpy as np
from numpy.typing import NDArray

GOAL_TOLERANCE = 25.0
"""Half the width of the goal area [counts] (eq. 5.1)."""

STEP_STD = {"angle": 6.70, "velocity": 0.19, "pressure_1": 1.94, "pressure_2": 1.52}
"""Standard deviation of the one-step error at 30 Hz [counts, velocity in counts/ms] (table 5.2)."""
SECOND_STD = {"angle": 36.70, "pressure_1": 10.63, "pressure_2": 8.33}
"""The same expected after one second by eq. 3.7 [counts] (table 5.2)."""

TRANSITIONS = 200_000
"""Transitions collected (section 3.2.2)."""
COLLECT_HOURS = 2.0
"""Time on the arm that collecting took [h] (section 3.2.2)."""
FILTERED = 40_000
"""Transitions kept by the filter, about (section 3.2.3)."""

REWARD_OPTIMAL: NDArray[np.float64] = np.array([6.85, 5.46, 0.98, 8.43, 8.77, 8.96, 3.82, 10.25])
"""Mean reward in the test of eight runs with the settings derived as optimal (table 5.7)."""
REWARD_TRIAL_10: NDArray[np.float64] = np.array([11.00, 9.81, 12.10, 11.54, 9.27, 8.21, 10.53, 8.98])
"""Mean reward in the test of eight runs of the best trial, from which the transferred agent came (table 5.5)."""
ACTIONS_TRIAL_10: NDArray[np.float64] = np.array([17.23, 17.38, 16.61, 16.69, 16.91, 18.16, 17.18, 17.80])
"""Mean actions an episode of the same runs (table C.8)."""
SWITCHES_TRIAL_10: NDArray[np.float64] = np.array([2.85, 2.98, 2.79, 2.85, 3.10, 3.08, 2.91, 3.03])
"""Mean switches an episode of the same runs (table C.9)."""
EPISODES_OPTIMAL: NDArray[np.int64] = np.array([15000, 19500, 17000, 17000, 16000, 16500, 16500, 17500])
"""Episodes of training of eight runs with the optimal settings (table C.18)."""
TRAIN_MINUTES = 10.0
"""Time that training in the simulation took, about [min] (section 5.5)."""
TRAIN_ON_ARM_HOURS = 29.0
"""Time that training on the arm alone would take, estimated [h] (section 5.5)."""

SUCCESS = "almost 100%"
"""Success rate (section 5.6.1)."""
ACTIONS_SIMULATION = 16.0
"""Mean actions of a successful episode in the simulation, about (section 5.5.1)."""
ACTIONS_ON_ARRIVAL = 20.0
"""The same on the arm just after the transfer, about (section 5.5.1)."""
REWARD_DROP = 15.0
"""Least drop of the reward on arrival (section 5.5.1)."""
SWITCHES_RISE = (2.0, 4.0)
"""Rise of the switches on arrival, while learning and without (section 5.5.1)."""
EPISODES_TO_PROGRESS = 750
"""Episodes on the arm before real progress was seen, about an hour (section 5.5.1)."""

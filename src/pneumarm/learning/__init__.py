"""Learning to control an arm in its simulation (thesis chapter 4), and going on learning on the arm."""

from pneumarm.learning.agent import Agent
from pneumarm.learning.begin import BeginStates, begin_states
from pneumarm.learning.online import OnlineLearner
from pneumarm.learning.settings import Exploration, Reward, Shaping, TrainSettings
from pneumarm.learning.testing import TestResult, test
from pneumarm.learning.tracker import StateTracker
from pneumarm.learning.training import CURVES, Progress, Training, train

__all__ = [
    "CURVES",
    "Agent",
    "BeginStates",
    "Exploration",
    "OnlineLearner",
    "Progress",
    "Reward",
    "Shaping",
    "StateTracker",
    "TestResult",
    "TrainSettings",
    "Training",
    "begin_states",
    "test",
    "train",
]

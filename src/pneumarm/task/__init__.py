"""The task: what is asked of a movement, wherever it is made."""

from pneumarm.task.begin import BeginStates, begin_states
from pneumarm.task.movements import TestResult
from pneumarm.task.reward import Reward
from pneumarm.task.tracker import StateTracker

__all__ = ["BeginStates", "Reward", "StateTracker", "TestResult", "begin_states"]

"""The task: what is asked of a movement, wherever it is made."""

from pneumarm.task.begin import BeginStates, begin_states
from pneumarm.task.movements import Movement, Movements, read_episodes, running_time, write_episodes
from pneumarm.task.reward import Reward
from pneumarm.task.settings import TaskSettings
from pneumarm.task.tracker import StateTracker

__all__ = [
    "BeginStates",
    "Movement",
    "Movements",
    "Reward",
    "StateTracker",
    "TaskSettings",
    "begin_states",
    "read_episodes",
    "running_time",
    "write_episodes",
]

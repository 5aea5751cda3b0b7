"""Learning to control an arm in its simulation (thesis chapter 4), and going on learning on the arm."""

from pneumarm.learning.agent import Agent
from pneumarm.learning.begin import BeginStates, begin_states
from pneumarm.learning.fleet.adaptation import Adaptation, AdaptationSettings, Event, told
from pneumarm.learning.fleet.agent import PolicyAgent
from pneumarm.learning.fleet.refit import RefitSettings
from pneumarm.learning.fleet.settings import BatchedSettings, PolicySettings
from pneumarm.learning.fleet.side_by_side import FLEET_CURVES
from pneumarm.learning.fleet.training import FleetTraining
from pneumarm.learning.fleet.trial import TrialSettings
from pneumarm.learning.fleet.watch import WatchSettings
from pneumarm.learning.kinds import (
    LOOKING_AHEAD,
    METHODS,
    Actor,
    AnyAgent,
    LearnSettings,
    Method,
    Settings,
    Trained,
    adaptation,
    fingerprint,
    load_agent,
    results_with_lookahead,
    test,
    test_ahead,
    train,
)
from pneumarm.learning.online import OnlineLearner
from pneumarm.learning.settings import Exploration, Reward, Shaping, TrainSettings
from pneumarm.learning.testing import TestResult
from pneumarm.learning.tracker import StateTracker
from pneumarm.learning.training import CURVES, Progress, Training

__all__ = [
    "CURVES",
    "FLEET_CURVES",
    "LOOKING_AHEAD",
    "METHODS",
    "Actor",
    "Adaptation",
    "AdaptationSettings",
    "Agent",
    "AnyAgent",
    "BatchedSettings",
    "BeginStates",
    "Event",
    "Exploration",
    "FleetTraining",
    "LearnSettings",
    "Method",
    "OnlineLearner",
    "PolicyAgent",
    "PolicySettings",
    "Progress",
    "RefitSettings",
    "Reward",
    "Settings",
    "Shaping",
    "StateTracker",
    "TestResult",
    "TrainSettings",
    "Trained",
    "Training",
    "TrialSettings",
    "WatchSettings",
    "adaptation",
    "begin_states",
    "fingerprint",
    "load_agent",
    "results_with_lookahead",
    "test",
    "test_ahead",
    "told",
    "train",
]

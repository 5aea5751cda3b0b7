"""Learning to control an arm in its simulation (thesis chapter 4), and going on learning on the arm."""

from pneumarm.learning.fleet_settings import BatchedSettings, PolicySettings
from pneumarm.learning.methods import (
    LOOKING_AHEAD,
    METHODS,
    Actor,
    AnyAgent,
    LearnSettings,
    Method,
    MethodSettings,
    Trained,
    fingerprint,
    load_agent,
    results_with_lookahead,
    test,
    test_ahead,
    train,
)
from pneumarm.learning.online.agent import Agent
from pneumarm.learning.online.learner import OnlineLearner
from pneumarm.learning.online.settings import Exploration, Shaping, TrainSettings
from pneumarm.learning.online.training import CURVES, Progress, Training
from pneumarm.learning.policy.agent import PolicyAgent
from pneumarm.learning.policy.training import FleetTraining
from pneumarm.learning.side_by_side import FLEET_CURVES

__all__ = [
    "CURVES",
    "FLEET_CURVES",
    "LOOKING_AHEAD",
    "METHODS",
    "Actor",
    "Agent",
    "AnyAgent",
    "BatchedSettings",
    "Exploration",
    "FleetTraining",
    "LearnSettings",
    "Method",
    "MethodSettings",
    "OnlineLearner",
    "PolicyAgent",
    "PolicySettings",
    "Progress",
    "Shaping",
    "TrainSettings",
    "Trained",
    "Training",
    "fingerprint",
    "load_agent",
    "results_with_lookahead",
    "test",
    "test_ahead",
    "train",
]

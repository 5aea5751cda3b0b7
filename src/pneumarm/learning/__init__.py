"""Learning to control an arm in its simulation (thesis chapter 4), and going on learning on the arm."""

from pneumarm.learning.agents import (
    Acts,
    Adapts,
    AnyAgent,
    Knows,
    LearningActor,
    Learns,
    LooksAhead,
    Saved,
    SelfTesting,
    SimulationAgent,
    fingerprint,
    goals_of,
)
from pneumarm.learning.batched.settings import BatchedSettings
from pneumarm.learning.method import Method
from pneumarm.learning.methods import (
    LOOKING_AHEAD,
    METHODS,
    LearnSettings,
    find_method,
    load_agent,
    results_with_lookahead,
    test,
    test_ahead,
    train,
)
from pneumarm.learning.online.agent import Agent, OnlineLearner
from pneumarm.learning.online.settings import Exploration, Help, Shaping, TrainSettings
from pneumarm.learning.online.training import CURVES
from pneumarm.learning.policy.agent import PolicyAgent
from pneumarm.learning.policy.settings import PolicySettings
from pneumarm.learning.servo.settings import ServoSettings
from pneumarm.learning.training import Learner, Progress, Training, train_side_by_side

__all__ = [
    "CURVES",
    "LOOKING_AHEAD",
    "METHODS",
    "Acts",
    "Adapts",
    "Agent",
    "AnyAgent",
    "BatchedSettings",
    "Exploration",
    "Help",
    "Knows",
    "LearnSettings",
    "Learner",
    "LearningActor",
    "Learns",
    "LooksAhead",
    "Method",
    "OnlineLearner",
    "PolicyAgent",
    "PolicySettings",
    "Progress",
    "Saved",
    "SelfTesting",
    "ServoSettings",
    "Shaping",
    "SimulationAgent",
    "TrainSettings",
    "Training",
    "find_method",
    "fingerprint",
    "goals_of",
    "load_agent",
    "results_with_lookahead",
    "test",
    "test_ahead",
    "train",
    "train_side_by_side",
]

"""The settings of a small run of the whole job."""

from pneumarm.learning import Shaping, TrainSettings
from pneumarm.run import RunSettings, RunTransferSettings
from pneumarm.simulation import FitSettings

SMALL = RunSettings(
    arm="virtual:seed=3",
    seed=5,
    transitions=6_000,
    test_episodes=300,
    bound_episodes=8,
    fit=FitSettings(epochs=10),
    method="sarsa",
    thesis=TrainSettings(agents=2, max_episodes=3_000, validation_episodes=100, shaping=Shaping(episodes=100)),
    transfer=RunTransferSettings(episodes=30, test_episodes=20),
)

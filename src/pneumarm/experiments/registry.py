"""Experiments by name, loaded when they are asked for."""

import importlib

from pneumarm.errors import UnusableInput
from pneumarm.experiments.experiment import Experiment

PLACES = {
    "switch-punishment": "switch_punishment",
    "all-goals": "all_goals",
    "long-training": "long_training",
    "optimal-settings": "optimal_settings",
    "no-shaping": "no_shaping",
    "control-frequency": "control_frequency",
    "state-history": "state_history",
    "enough-data": "enough_data",
    "noise-for-transfer": "noise_for_transfer",
    "valves-closed": "valves_closed",
    "shaping-settings": "shaping_settings",
    "fine-tuning": "fine_tuning",
    "transfer": "transfer",
    "transferability": "transferability",
    "goal-area": "goal_area",
    "overnight": "overnight",
    "on-the-arm-only": "on_the_arm_only",
    "displacement": "displacement",
    "goal-pairs": "goal_pairs",
    "joint-data": "joint_data",
    "joint-data-long": "joint_data_long",
    "joint-exploration": "joint_exploration",
    "joint-agents": "joint_agents",
    "hierarchy": "hierarchy",
    "coupling": "coupling",
}
"""Name: package below this one; each has an ``EXPERIMENT``."""


def experiment(name: str) -> Experiment:
    """Return the experiment called ``name``.

    Raises:
        UnusableInput: there is none.

    """
    if name not in PLACES:
        raise UnusableInput(f"no experiment {name!r}; there are {', '.join(PLACES)}")
    found: Experiment = importlib.import_module(f"pneumarm.experiments.{PLACES[name]}").EXPERIMENT
    return found

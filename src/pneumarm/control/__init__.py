"""Controllers on an arm: agents, movements, transfer and adaptation."""

from pneumarm.control.agent import AgentController
from pneumarm.control.bound import BoundSettings, Planned, known_bound, measure_bound
from pneumarm.control.monitor import Finding, Monitor, MonitorSettings
from pneumarm.control.movement import LearningController, Movement, move
from pneumarm.control.open_agent import open_agent
from pneumarm.control.plan_agent import PlanAgent
from pneumarm.control.planner import PhysicsModel, Planner, SimulationModel, physics_planner, simulated_planner
from pneumarm.control.players import open_controller
from pneumarm.control.search import PlanSettings
from pneumarm.control.transfer import (
    BEGIN,
    Episode,
    Transferred,
    TransferSettings,
    transfer,
    transfer_into,
    write_episodes,
)
from pneumarm.control.versions import Adapted, History, put_back, read_history, save_history, version_keeper

__all__ = [
    "BEGIN",
    "Adapted",
    "AgentController",
    "BoundSettings",
    "Episode",
    "Finding",
    "History",
    "LearningController",
    "Monitor",
    "MonitorSettings",
    "Movement",
    "PhysicsModel",
    "PlanAgent",
    "PlanSettings",
    "Planned",
    "Planner",
    "SimulationModel",
    "TransferSettings",
    "Transferred",
    "known_bound",
    "measure_bound",
    "move",
    "open_agent",
    "open_controller",
    "physics_planner",
    "put_back",
    "read_history",
    "save_history",
    "simulated_planner",
    "transfer",
    "transfer_into",
    "version_keeper",
    "write_episodes",
]

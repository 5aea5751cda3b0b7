"""Controllers on an arm: agents, movements, transfer and adaptation."""

from pneumarm.control.agent import AgentController
from pneumarm.control.bound import BoundSettings, Planned, measure_bound
from pneumarm.control.leaks import LeakRates, LeakTest, leak_test, leaking
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

__all__ = [
    "BEGIN",
    "AgentController",
    "BoundSettings",
    "Episode",
    "Finding",
    "LeakRates",
    "LeakTest",
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
    "leak_test",
    "leaking",
    "measure_bound",
    "move",
    "open_agent",
    "open_controller",
    "physics_planner",
    "simulated_planner",
    "transfer",
    "transfer_into",
    "write_episodes",
]

"""Controllers on an arm: agents, movements, transfer and adaptation."""

from pneumarm.control.agent import AgentController
from pneumarm.control.bound import BoundSettings, Planned, measure_bound
from pneumarm.control.movement import LearningController, Movement, move
<<<<<<< HEAD
from pneumarm.control.planner import PhysicsModel, Planner, SimulationModel, physics_planner, simulated_planner
from pneumarm.control.search import PlanSettings
=======
from pneumarm.control.players import open_controller
>>>>>>> main
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
    "LearningController",
    "Movement",
    "PhysicsModel",
    "PlanSettings",
    "Planned",
    "Planner",
    "SimulationModel",
    "TransferSettings",
    "Transferred",
    "measure_bound",
    "move",
<<<<<<< HEAD
    "physics_planner",
    "simulated_planner",
=======
    "open_controller",
>>>>>>> main
    "transfer",
    "transfer_into",
    "write_episodes",
]

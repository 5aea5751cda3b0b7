"""Planning: the best sequences of valves, on any world that can be rolled out."""

from pneumarm.planning.planner import PhysicsModel, Planner, SimulationModel, physics_planner, simulated_planner
from pneumarm.planning.search import PlanSettings

__all__ = [
    "PhysicsModel",
    "PlanSettings",
    "Planner",
    "SimulationModel",
    "physics_planner",
    "simulated_planner",
]

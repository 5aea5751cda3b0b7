"""Planning: the best sequences of valves, on any world that can be rolled out."""

from pneumarm.planning.agent import PlanAgent
from pneumarm.planning.planner import PhysicsModel, Planner, SimulationModel, physics_planner, simulated_planner
from pneumarm.planning.search import PlanSettings
from pneumarm.planning.servo import PlannedServo

__all__ = [
    "PhysicsModel",
    "PlanAgent",
    "PlanSettings",
    "PlannedServo",
    "Planner",
    "SimulationModel",
    "physics_planner",
    "simulated_planner",
]

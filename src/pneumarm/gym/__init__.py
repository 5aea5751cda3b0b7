"""The task for everyone else's agents: Gymnasium's interface to a simulation, or to any arm.

    import gymnasium
    import pneumarm.gym  # registers the environment, where Gymnasium did not find it by itself

    name, vectorised = "pneumarm/PointToPoint-v0", "vector_entry_point"
    one = gymnasium.make(name, arm="virtual:seed=7")
    many = gymnasium.make_vec(name, 4096, vectorised, arm="simulation:arm.sim", transitions="arm.db")

Needs the extra ``pneumarm[gym]``.
"""

from pneumarm.errors import UnusableInput

try:
    import gymnasium
except ImportError as error:
    raise UnusableInput("pneumarm.gym needs Gymnasium: pip install 'pneumarm[gym]'") from error

from pneumarm.gym.make import point_to_point, point_to_point_vector
from pneumarm.gym.on_arm import ArmPointToPoint
from pneumarm.gym.simulated import SimulatedPointToPoint
from pneumarm.gym.vector import PointToPointVector

__all__ = [
    "ENVIRONMENT",
    "ArmPointToPoint",
    "PointToPointVector",
    "SimulatedPointToPoint",
    "point_to_point",
    "point_to_point_vector",
    "register",
]

ENVIRONMENT = "pneumarm/PointToPoint-v0"
"""The name that the environment is registered by."""


def register() -> None:
    """Register the environment with Gymnasium; it may be called twice."""
    if ENVIRONMENT not in gymnasium.registry:
        gymnasium.register(
            ENVIRONMENT,
            entry_point="pneumarm.gym.make:point_to_point",
            vector_entry_point="pneumarm.gym.make:point_to_point_vector",
        )


register()

"""The tasks for everyone else's agents: Gymnasium's interface to a simulation, or to any arm.

    import gymnasium
    import pneumarm.gym  # registers the environments

    follow = gymnasium.make("pneumarm/Follow-v0", arm="virtual:seed=7", render_mode="rgb_array")

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

from pneumarm.gym.follow import ArmFollow, FollowSettings
from pneumarm.gym.make import follow, point_to_point, point_to_point_vector
from pneumarm.gym.on_arm import ArmPointToPoint
from pneumarm.gym.simulated import SimulatedPointToPoint
from pneumarm.gym.spaces import View
from pneumarm.gym.vector import PointToPointVector

__all__ = [
    "ENVIRONMENT",
    "FOLLOW",
    "ArmFollow",
    "ArmPointToPoint",
    "FollowSettings",
    "PointToPointVector",
    "SimulatedPointToPoint",
    "View",
    "follow",
    "point_to_point",
    "point_to_point_vector",
    "register",
]

ENVIRONMENT = "pneumarm/PointToPoint-v0"
"""The name that the environment is registered by in which goals are to be reached."""
FOLLOW = "pneumarm/Follow-v0"
"""The name of the one in which goals are to be settled at and held, and references tracked."""


def register() -> None:
    """Register the environments with Gymnasium; it may be called twice."""
    if ENVIRONMENT not in gymnasium.registry:
        gymnasium.register(
            ENVIRONMENT,
            entry_point="pneumarm.gym.make:point_to_point",
            vector_entry_point="pneumarm.gym.make:point_to_point_vector",
        )
    if FOLLOW not in gymnasium.registry:
        gymnasium.register(FOLLOW, entry_point="pneumarm.gym.make:follow")


register()

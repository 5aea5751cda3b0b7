"""Controllers on an arm: agents, movements, transfer and adaptation."""

from pneumarm.control.agent import AgentController
from pneumarm.control.movement import LearningController, Movement, move
from pneumarm.control.players import open_controller
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
    "Episode",
    "LearningController",
    "Movement",
    "TransferSettings",
    "Transferred",
    "move",
    "open_controller",
    "transfer",
    "transfer_into",
    "write_episodes",
]

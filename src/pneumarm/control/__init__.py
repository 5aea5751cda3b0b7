"""Controllers on an arm: agents, movements, transfer and adaptation."""

from pneumarm.control.agent import AgentController, controller_of
from pneumarm.control.monitor import Finding, Monitor, MonitorSettings
from pneumarm.control.movement import BEGIN, Draw, LearningController, drawn, evaluate, make_movements, move
from pneumarm.control.open_agent import open_agent
from pneumarm.control.players import open_controller
from pneumarm.control.transfer import (
    Transferred,
    TransferSettings,
    transfer,
    transfer_into,
)
from pneumarm.control.versions import Adapted, History, put_back, read_history, save_history, version_keeper

__all__ = [
    "BEGIN",
    "Adapted",
    "AgentController",
    "Draw",
    "Finding",
    "History",
    "LearningController",
    "Monitor",
    "MonitorSettings",
    "TransferSettings",
    "Transferred",
    "controller_of",
    "drawn",
    "evaluate",
    "make_movements",
    "move",
    "open_agent",
    "open_controller",
    "put_back",
    "read_history",
    "save_history",
    "transfer",
    "transfer_into",
    "version_keeper",
]

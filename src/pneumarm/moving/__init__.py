"""Moving as a person means it: be there, stay there, follow; with figures in degrees, seconds and litres."""

from pneumarm.moving.holding import Holding
from pneumarm.moving.movement import SECONDS, Moved, MoveSettings, Tracked, at_period, check_seconds, move, track

__all__ = ["SECONDS", "Holding", "MoveSettings", "Moved", "Tracked", "at_period", "check_seconds", "move", "track"]

"""Transitions: the store, collecting, the state window, the grid filter, import of recordings."""

from pneumarm.transitions.choice import held_out
from pneumarm.transitions.collect import (
    FEWEST_TRANSITIONS,
    KINDS,
    WHOLE_PERIODS,
    CollectBegin,
    CollectResult,
    CollectSettings,
    collect,
    require_enough,
)
from pneumarm.transitions.copying import CopyResult, copy_store
from pneumarm.transitions.filtering import Filter, Filtered, NewCells, filter_transitions, new_cells
from pneumarm.transitions.grid import Coverage, Grid, GridSettings
from pneumarm.transitions.players import Keyboard, Trajectory
from pneumarm.transitions.recording import import_recording
from pneumarm.transitions.rows import Mark, Recorded, Rows
from pneumarm.transitions.store import Store
from pneumarm.transitions.window import QUANTITIES, Transitions, Window, transitions

__all__ = [
    "FEWEST_TRANSITIONS",
    "KINDS",
    "QUANTITIES",
    "WHOLE_PERIODS",
    "CollectBegin",
    "CollectResult",
    "CollectSettings",
    "CopyResult",
    "Coverage",
    "Filter",
    "Filtered",
    "Grid",
    "GridSettings",
    "Keyboard",
    "Mark",
    "NewCells",
    "Recorded",
    "Rows",
    "Store",
    "Trajectory",
    "Transitions",
    "Window",
    "collect",
    "copy_store",
    "filter_transitions",
    "held_out",
    "import_recording",
    "new_cells",
    "require_enough",
    "transitions",
]

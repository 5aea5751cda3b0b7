"""Function approximators: tables, tiles, radial basis functions, Kanerva coding, networks (section 4.2.6)."""

from pneumarm.learning.values.approximators.coding import Coding
from pneumarm.learning.values.approximators.function import (
    ValueFunction,
    add_trace,
    follow,
    forget_traces,
    function_shape,
    look,
    update,
    value,
    value_function,
)
from pneumarm.learning.values.approximators.kanerva import kanerva
from pneumarm.learning.values.approximators.network import draw_weights, network
from pneumarm.learning.values.approximators.radial import radial
from pneumarm.learning.values.approximators.table import table
from pneumarm.learning.values.approximators.tiles import tiles

__all__ = [
    "Coding",
    "ValueFunction",
    "add_trace",
    "draw_weights",
    "follow",
    "forget_traces",
    "function_shape",
    "kanerva",
    "look",
    "network",
    "radial",
    "table",
    "tiles",
    "update",
    "value",
    "value_function",
]

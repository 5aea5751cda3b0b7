"""What a user can choose about learning values; what is not here is as in the thesis."""

from dataclasses import dataclass
from typing import Annotated, Literal

from msgspec import Meta

from pneumarm.learning.online.settings import TrainSettings
from pneumarm.learning.values.policies import PolicyName
from pneumarm.settings import NonNegativeFloat, PositiveFloat, PositiveInt, PythonOnly, Share, Valid

Approximator = Literal["table", "tiles", "radial", "kanerva", "network", "networks"]
Variable = Literal["error", "velocity", "pressure_1", "pressure_2", "angle"]
Rule = Literal["td", "monte-carlo", "sarsa-lambda", "q-lambda", "actor-critic", "dynamic-programming"]


@dataclass(frozen=True)
class ValueSettings(TrainSettings):
    """Everything that decides how values are learned; each rule has defaults of its own."""

    rule: Annotated[Rule, PythonOnly] = "sarsa-lambda"
    """Which values are learned, and what they are moved towards; set by the name of the method."""
    approximator: Approximator = "radial"
    """What holds the values: table, tiles, radial basis functions, Kanerva coding, one network for all actions, or
    networks, one an action (thesis: networks)."""
    policy: PolicyName = "max-boltzmann"
    """Which action is taken while learning (thesis: max-boltzmann)."""
    traces: Literal["accumulating", "replacing"] = "replacing"
    """Whether a trace adds up or is set anew where a state is visited again (thesis: accumulating)."""
    step_size: Literal["constant", "1/k"] = "constant"
    """Whether values move by ``learning_rate``, or by 1/k where they were visited k times (thesis: constant)."""
    learning_rate: NonNegativeFloat = 0.1
    """beta (thesis: 0.05)."""
    actor_rate: NonNegativeFloat = 0.02
    """beta of the actor, where there is one."""
    trace_decay: Share = 0.8
    """lambda of the eligibility traces (thesis: 0)."""
    team: Literal["common"] = "common"
    """Each joint has values of its own."""
    agents: Annotated[int, Meta(ge=1, le=4096)] = 4
    """Agents trained at once, of which the best is kept."""
    variables: Annotated[tuple[Variable, ...], Meta(min_length=1)] = (
        "error",
        "velocity",
        "pressure_1",
        "pressure_2",
        "angle",
    )
    """What all but networks see of a joint; error is how far it is from its goal. Networks see the whole state."""
    cells: Annotated[tuple[PositiveInt, ...], Meta(max_length=5)] = ()
    """Cells that a table, a tiling or a code of Kanerva's cuts each variable into; by default as suits it."""
    tilings: PositiveInt = 16
    """Tilings, each with as many cells."""
    room: Annotated[int, Meta(ge=1, le=1_000_000)] = 32_768
    """Tiles in memory; where there are more they share it."""
    centres: Annotated[int, Meta(ge=1, le=100_000)] = 500
    """Radial basis functions, or prototypes of Kanerva's."""
    width: PositiveFloat = 0.15
    """Width of a radial basis function, as a share of the range of each variable."""
    reach: PositiveFloat = 10.0
    """Distance within which a prototype of Kanerva's is active [cells of all variables together]."""

    def _valid(self) -> Valid:
        is_network = self.approximator in {"network", "networks"}
        fits = not self.cells or len(self.cells) == len(self.variables)
        return {
            "variables": len(set(self.variables)) == len(self.variables) or "each of them once",
            "cells": fits or f"{len(self.variables)} numbers, one a variable",
            "traces": not is_network or self.traces == "accumulating" or "accumulating, with networks",
            "step_size": not is_network or self.step_size == "constant" or "constant, with networks",
        }

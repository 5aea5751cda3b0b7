"""What can be rolled out: the worlds in which plans are made, a learned simulation or a virtual arm's true physics.

A world has states, side by side, of which each can be copied to another place and advanced by one control period.
Both kinds read alike: ``states.angle``, ``states.velocity``, ``states.pressure``.
"""

from typing import Any

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from pneumarm.arm.virtual.rollout import PhysicsStates, advance_physics, copy_physics
from pneumarm.kernels import INNER
from pneumarm.simulation.rollout import SimulatedStates, advance_simulated, copy_simulated

_ADVANCE = {PhysicsStates: advance_physics, SimulatedStates: advance_simulated}
_COPY = {PhysicsStates: copy_physics, SimulatedStates: copy_simulated}


def advance(world: Any, states: Any, i: int, valves: NDArray[np.int8]) -> None:
    """Let one control period pass in state ``i`` of any kind of ``states``, with ``valves`` (joints, 2)."""
    _ADVANCE[type(states)](world, states, i, valves)


def copy(states: Any, to: int, source: int) -> None:
    """Copy state ``source`` to the place ``to``, in any kind of ``states``."""
    _COPY[type(states)](states, to, source)


# Compiled code picks by type as well: kernels handed over as arguments could not be cached.
@overload(advance, jit_options=INNER)
def _advance(world, states, i, valves):  # type: ignore[no-untyped-def]
    return _ADVANCE[states.instance_class].py_func


@overload(copy, jit_options=INNER)
def _copy(states, to, source):  # type: ignore[no-untyped-def]
    return _COPY[states.instance_class].py_func

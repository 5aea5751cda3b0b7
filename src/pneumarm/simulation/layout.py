"""Where a state vector holds what: the one place that knows, for kernels and for Python.

Everything that reads the state reads one vector ``x`` of scaled numbers, padded to a multiple of four:

    x = (o_k, ..., o_{k-h+1}, a_{k-1}, ..., a_{k-h+1}, stops, a_k, goal, 1, 0, ...)

with observations and commands as in :mod:`pneumarm.transitions.window`; the 1 carries the biases of networks.
"""

from typing import NamedTuple

from pneumarm.kernels import part
from pneumarm.transitions.window import QUANTITIES, Window

INPUT_BLOCK = 4
"""The length of ``x`` is a multiple of it, so that networks can take that many inputs at a time."""
_QUANTITIES = len(QUANTITIES)
_VELOCITY, _PRESSURE = QUANTITIES.index("velocity"), QUANTITIES.index("pressure_1")


class Layout(NamedTuple):
    """Sizes of a state vector and places in it. Made by :func:`layout_of`."""

    joints: int
    history: int
    observed: int
    """Numbers in an observation."""
    commanded: int
    """Numbers in a command."""
    memory: int
    """Place of the stop operators of the first joint, those of the next following on them."""
    remembered: int
    """Stop operators of each joint."""
    command: int
    """Place of the command that is given now; what lies before it is the state window sigma."""
    goal: int
    """Place of the goals, one a joint."""
    one: int
    """Place of the 1."""
    size: int
    """Length of the vector."""

    @property
    def angles(self) -> range:
        """Places of the newest angles."""
        return range(0, _QUANTITIES * self.joints, _QUANTITIES)

    @property
    def pressures(self) -> list[int]:
        """Places of the newest pressures, muscle by muscle."""
        return [angle + _PRESSURE + muscle for angle in self.angles for muscle in range(2)]


def padded(size: int, block: int) -> int:
    """Return ``size`` rounded up to a multiple of ``block``."""
    return -(-size // block) * block


def layout_of(window: Window) -> Layout:
    """Return how a state ``window`` lies in a state vector."""
    command, commanded = window.state_size, window.command_size
    one = command + commanded + window.joints
    return Layout(
        joints=window.joints,
        history=window.history,
        observed=window.observation_size,
        commanded=commanded,
        memory=command - window.memory_size,
        remembered=len(window.hysteresis),
        command=command,
        goal=command + commanded,
        one=one,
        size=padded(one + 1, INPUT_BLOCK),
    )


@part
def reading_at(layout, lag, joint, quantity):  # type: ignore[no-untyped-def]
    """Return the place of a ``quantity`` (0 to 3) of ``joint``, read ``lag`` periods ago."""
    return lag * layout.observed + _QUANTITIES * joint + quantity


@part
def angle_at(layout, lag, joint):  # type: ignore[no-untyped-def]
    """Return the place of the angle of ``joint``, read ``lag`` periods ago."""
    return lag * layout.observed + _QUANTITIES * joint


@part
def velocity_at(layout, lag, joint):  # type: ignore[no-untyped-def]
    """Return the place of the velocity of ``joint``, read ``lag`` periods ago."""
    return lag * layout.observed + _QUANTITIES * joint + _VELOCITY


@part
def pressure_at(layout, lag, joint, muscle):  # type: ignore[no-untyped-def]
    """Return the place of the pressure in a ``muscle`` of ``joint``, read ``lag`` periods ago."""
    return lag * layout.observed + _QUANTITIES * joint + _PRESSURE + muscle


@part
def further_at(layout, lag, sensor):  # type: ignore[no-untyped-def]
    """Return the place of what a further ``sensor`` read ``lag`` periods ago."""
    return lag * layout.observed + _QUANTITIES * layout.joints + sensor


@part
def command_at(layout, lag):  # type: ignore[no-untyped-def]
    """Return the place of the command given ``lag`` periods ago (history - 1 at most), 0 being now."""
    if lag == 0:
        return layout.command
    return layout.history * layout.observed + (lag - 1) * layout.commanded

"""What a user can choose about a servo and its training."""

from dataclasses import dataclass
from typing import Annotated, TypeAlias

from msgspec import Meta

from pneumarm.settings import Layers, NonNegativeFloat, PositiveFloat, PositiveInt, PythonOnly, Share, Valid
from pneumarm.task.settings import TaskSettings

Ahead: TypeAlias = Annotated[float, Meta(gt=0, le=10)]
"""How far ahead a reference is looked at [s]."""
USUAL_PERIOD = 1 / 30
"""Control period [s] (the thesis: 30 Hz) that prices and limits which count control periods are given for."""
SOFT, STIFF = 0.25, 0.45
"""Stiffnesses that are tried where none is asked for, shares of the range of pressures (docs/decisions/servo.md)."""


@dataclass(frozen=True)
class ServoSettings(TaskSettings):
    """A policy over pulses that settles, holds and tracks; angles and errors in degrees, times in seconds.

    Reward and cut-off are of tests in which it is to reach goals; it learns by the prices below.
    """

    agents: Annotated[int, Meta(ge=1, le=256)] = 2
    """Agents trained at once from different weights, of which the best is kept; one a core takes no longer."""
    updates: PositiveInt = 1000
    """How often movements are made and learned from."""
    arms: Annotated[int, Meta(ge=1, le=65_536)] = 64
    """Simulated arms that move at once."""
    duration: Annotated[float, Meta(gt=0, le=60), PythonOnly] = 1.7
    """Length of a movement in simulation, through which the gradient goes [s]."""
    learning_rate: PositiveFloat = 4e-3
    """Of Adam at the start; falls linearly to 0."""
    largest_gradient: Annotated[PositiveFloat, PythonOnly] = 1.0
    """Longer gradients are cut to this length."""
    hidden: Layers = (48, 48)
    """Hidden units of each layer."""
    preview: Annotated[tuple[Ahead, ...], Meta(min_length=1, max_length=64)] = (
        0.034,
        0.067,
        0.1,
        0.167,
        0.234,
        0.334,
    )
    """How far ahead the reference is looked at [s]; no nearer than one control period."""
    tolerance: PositiveFloat = 1.0
    """Error that counts as settled [degrees]; the prices of errors are in units of it."""
    precision: PositiveFloat = 0.3
    """Error, in tolerances, below which there is little left to gain."""
    flat: Annotated[NonNegativeFloat, PythonOnly] = 0.1
    """Error, in tolerances, that costs nothing but ``far``."""
    far: Annotated[NonNegativeFloat, PythonOnly] = 0.06
    """Price of an error for each tolerance, besides the logarithmic one of being out of precision."""
    change: NonNegativeFloat = 0.15
    """Price of opening or closing a valve, at 30 Hz; at other rates as much in errors times seconds."""
    stiffness: Share | None = None
    """Share of the range of pressures that both muscles are to keep where a goal stays, as far as its angle allows;
    on average, or somewhat more, while a reference moves.

    Pressure in both makes a joint stiff, damps it, and makes a pulse move it less; it also takes more air to move. By
    default pneumarm tries 0.25, which is fast, and 0.45, and keeps the better in simulation; if that does not settle
    on its arm, it is trained again with the higher one.
    """
    slack: Annotated[NonNegativeFloat, PythonOnly] = 6.0
    """Price of the pressure that a muscle is short of that, by the whole range of pressures."""
    cocontraction: Annotated[NonNegativeFloat, PythonOnly] = 6.0
    """Price of the mean pressure of a joint's muscles while its reference moves, as far as it is below that share or
    above 1.6 times of it, by the whole range of pressures."""
    dead: Annotated[float, Meta(ge=0, lt=1), PythonOnly] = 0.15
    """Share of the policy's output around 0 that keeps a valve closed."""
    coarse: Annotated[float, Meta(ge=0, le=0.5)] | None = None
    """On the way to a goal that stays a joint gets no shorter pulse, in periods, and a whole period instead of one
    that is short of it by less: that wears valves less. By default as much as costs nothing in simulation."""
    known: Annotated[Share, PythonOnly] = 0.6
    """Share of movements in which the reference is known ahead; in the others it is forecast from its past."""
    reading_noise: Annotated[NonNegativeFloat, PythonOnly] = 0.6
    """Noise of a reading in standard deviations of the one-step error, most of which is such noise."""
    quiet: Annotated[NonNegativeFloat, PythonOnly] = 0.15
    """Mean error, in tolerances, below which a still arm with a constant goal is left alone with closed valves."""
    alert: Annotated[NonNegativeFloat, PythonOnly] = 0.25
    """Mean error, in tolerances, from which on it no longer is."""
    planned: Annotated[int, Meta(ge=0, le=10_000)] = 20
    """How often plans for the next half second are made better in the simulation, at every control step, where a
    moving reference is followed more closely by plans than by the policy alone; 0: the policy alone."""
    ways: Annotated[tuple[NonNegativeFloat, ...], PythonOnly] = ()
    """How far off its goals each joint of the arm was on average, in tolerances: swinging and left alone, swinging
    and damped, moved by single pulses, moved in every period. Learned on the arm; by default nothing is known."""
    validation_movements: Annotated[PositiveInt, PythonOnly] = 400
    """Movements in simulation on which the best agent is chosen."""

    def _valid(self) -> Valid:
        return {"quiet": self.quiet <= self.alert or "at most alert"}

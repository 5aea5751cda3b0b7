"""What a user can choose about a servo and its training."""

import math
from dataclasses import dataclass

from pneumarm.settings import Valid
from pneumarm.task.settings import TaskSettings

USUAL_PERIOD = 1 / 30
"""Control period [s] (the thesis: 30 Hz) that prices and limits which count control periods are given for."""
SOFT, STIFF = 0.25, 0.45
"""Stiffnesses that are tried where none is asked for, shares of the range of pressures (docs/decisions/servo.md)."""


@dataclass(frozen=True)
class ServoSettings(TaskSettings):
    """A policy over pulses that settles, holds and tracks; angles and errors in degrees, times in seconds.

    Reward and cut-off are of tests in which it is to reach goals; it learns by the prices below.
    """

    agents: int = 2
    """Agents trained at once from different weights, of which the best is kept; one a core takes no longer."""
    updates: int = 1000
    """How often movements are made and learned from."""
    arms: int = 64
    """Simulated arms that move at once."""
    duration: float = 1.7
    """Length of a movement in simulation, through which the gradient goes [s]."""
    learning_rate: float = 4e-3
    """Of Adam at the start; falls linearly to 0."""
    largest_gradient: float = 1.0
    """Longer gradients are cut to this length."""
    hidden: tuple[int, ...] = (48, 48)
    """Hidden units of each layer."""
    preview: tuple[float, ...] = (0.034, 0.067, 0.1, 0.167, 0.234, 0.334)
    """How far ahead the reference is looked at [s]; no nearer than one control period."""
    tolerance: float = 1.0
    """Error that counts as settled [degrees]; the prices of errors are in units of it."""
    precision: float = 0.3
    """Error, in tolerances, below which there is little left to gain."""
    flat: float = 0.1
    """Error, in tolerances, that costs nothing but ``far``."""
    far: float = 0.06
    """Price of an error for each tolerance, besides the logarithmic one of being out of precision."""
    change: float = 0.15
    """Price of opening or closing a valve, at 30 Hz; at other rates as much in errors times seconds."""
    stiffness: float | None = None
    """Share of the range of pressures that both muscles are to keep where a goal stays, as far as its angle allows;
    on average, or somewhat more, while a reference moves.

    Pressure in both makes a joint stiff, damps it, and makes a pulse move it less; it also takes more air to move. By
    default every other agent keeps 0.25, which is fast, and the others 0.45, and the better one in simulation is
    chosen; one that then does not settle on its arm is made anew with the higher one.
    """
    slack: float = 6.0
    """Price of the pressure that a muscle is short of that, by the whole range of pressures."""
    cocontraction: float = 6.0
    """Price of the mean pressure of a joint's muscles while its reference moves, as far as it is below that share or
    above 1.6 times of it, by the whole range of pressures."""
    dead: float = 0.15
    """Share of the policy's output around 0 that keeps a valve closed."""
    coarse: float | None = None
    """On the way to a goal that stays a joint gets no shorter pulse, in periods, and a whole period instead of one
    that is short of it by less: that wears valves less. By default as much as costs nothing in simulation."""
    known: float = 0.6
    """Share of movements in which the reference is known ahead; in the others it is forecast from its past."""
    reading_noise: float = 0.6
    """Noise of a reading in standard deviations of the one-step error, most of which is such noise."""
    quiet: float = 0.15
    """Mean error, in tolerances, below which a still arm with a constant goal is left alone with closed valves."""
    alert: float = 0.25
    """Mean error, in tolerances, from which on it no longer is."""
    planned: int = 20
    """How often plans for the next half second are made better in the simulation, at every turn, where a moving
    reference is followed more closely by plans than by the policy alone; 0: the policy alone."""
    ways: tuple[float, ...] = ()
    """How far off its goals each joint of the arm was on average, in tolerances: swinging and left alone, swinging
    and damped, moved by single pulses, moved in every period. Learned on the arm; by default nothing is known."""
    validation_movements: int = 400
    """Movements in simulation on which the best agent is chosen."""

    def _valid(self) -> Valid:
        return {
            "agents": 1 <= self.agents <= 256 or "1 to 256",
            "updates": self.updates >= 1 or "1 or more",
            "arms": 1 <= self.arms <= 65_536 or "1 to 65,536",
            "duration": 0 < self.duration <= 60 or "above 0 and at most 60 s",
            "learning_rate": 0 < self.learning_rate < math.inf or "above 0",
            "largest_gradient": 0 < self.largest_gradient < math.inf or "above 0",
            "hidden": (1 <= len(self.hidden) <= 8 and all(1 <= size <= 1024 for size in self.hidden))
            or "1 to 8 layers of 1 to 1,024 units",
            "preview": (1 <= len(self.preview) <= 64 and all(0 < ahead <= 10 for ahead in self.preview))
            or "1 to 64 times above 0 and up to 10 s",
            "tolerance": 0 < self.tolerance < math.inf or "above 0 degrees",
            "precision": 0 < self.precision < math.inf or "above 0",
            "flat": 0 <= self.flat < math.inf or "0 or more",
            "far": 0 <= self.far < math.inf or "0 or more",
            "change": 0 <= self.change < math.inf or "0 or more",
            "slack": 0 <= self.slack < math.inf or "0 or more",
            "cocontraction": 0 <= self.cocontraction < math.inf or "0 or more",
            "stiffness": self.stiffness is None or 0 <= self.stiffness <= 1 or "0 to 1",
            "dead": 0 <= self.dead < 1 or "0 to below 1",
            "coarse": self.coarse is None or 0 <= self.coarse <= 0.5 or "0 to 0.5 periods",
            "known": 0 <= self.known <= 1 or "0 to 1",
            "reading_noise": 0 <= self.reading_noise < math.inf or "0 or more",
            "quiet": 0 <= self.quiet <= self.alert or "0 or more, and at most alert",
            "alert": 0 <= self.alert < math.inf or "0 or more",
            "planned": 0 <= self.planned <= 10_000 or "0 to 10,000",
            "ways": all(0 <= error < math.inf for error in self.ways) or "0 or more each",
            "validation_movements": self.validation_movements >= 1 or "1 or more",
        }

"""How much evidence a monitor wants."""

import math
from dataclasses import dataclass
from typing import Literal

from pneumarm.settings import Settings, Valid

Mode = Literal["stop", "warn", "off"]
"""What a monitor does: mark what is spoiled and give up on an arm that stays broken; only tell; nothing."""


@dataclass(frozen=True)
class Weighing(Settings):
    """How much is needed to call something a fault of the valves or the air."""

    alarm: float = 14.0
    """Log-likelihood ratio from which on a fault counts as found."""
    supply: float = 4.0
    """Evidence that a low supply needs less: every inlet speaks for or against it, so by chance it has little."""
    telling: float = 1.5
    """Pressures expected with and without a fault that differ by fewer standard deviations tell nothing."""
    full: float = 0.75
    """Part of the highest pressure over which an open inlet tells only whether the outlet is open, too: the supply
    may be near."""
    empty: float = 0.04
    """A muscle below this part of the highest pressure is empty, and how much air it takes until its pressure rises
    is uncertain ..."""
    clear: float = 0.04
    """... so that expected pressures which differ by less of it tell nothing."""
    unsure: float = 0.2
    """Standard deviation of a filling or emptying as a part of it."""

    def _valid(self) -> Valid:
        not_negative = {name: 0 <= value < math.inf or "0 or more" for name, value in vars(self).items()}
        return {**not_negative, "alarm": 0 < self.alarm < math.inf, "supply": 0 <= self.supply < self.alarm}


@dataclass(frozen=True)
class MonitorSettings(Settings):
    """How much evidence a monitor wants."""

    by_simulation: Weighing = Weighing()
    """Of what does not agree with a simulation."""
    by_identification: Weighing = Weighing(alarm=16.0, supply=0.0, telling=0.3, clear=0.02, unsure=0.25)
    """Of what does not agree with what has been identified of the arm: where little is known that is uncertain, so
    small differences tell something too; but it is no more than an approximation."""
    lead: float = 4.0
    """By how much the evidence of another fault must exceed it for what was found to be called by its name."""
    most: float = 5.0
    """Evidence that a single reading gives at most."""
    fading: float = 20.0
    """Time in which, with a simulation, evidence of what has not been found fades to 37 % [s]: faults show in
    seconds, and what takes minutes to add up, while an arm is held at a goal, is an error of the simulation."""
    torn: float = 6.0
    """The same of evidence of a torn hose, without a simulation [s]."""
    inflation: float = 1.5
    """Standard deviations of the simulation's error on held-out sequences that count as one."""
    calm: float = 20.0
    """A joint slower than this hardly moves [degrees/s]; large leaks are looked for then."""
    fast: float = 150.0
    """Speed at which the simulation's errors are larger by the root of two than at rest [degrees/s]."""
    apart: float = 2.5
    """An arm has changed whose errors are so many times as large as usual."""
    changed: float = 40.0
    """Log-likelihood ratio from which on the arm counts as changed."""
    alternating: float = 0.3
    """Correlation of residuals with those before them under minus which they are noise of a sensor."""
    worn: float = 6.0
    """Mean square of the residuals from which on a part of a potentiometer's range counts as worn ..."""
    sound: float = 1.0
    """... while a quarter of all parts are below this; both in squares of the residuals that are usual."""
    rail: int = 3
    """Readings on a rail, after a jump there, that show a broken potentiometer."""
    jump: float = 10.0
    """Least angle that counts as a jump onto a rail [degrees]; more where the arm was moving there."""
    frozen: int = 10
    """Equal angles in a row, while the pressures change, that show a potentiometer which is frozen; more of them
    where they take less than a third of a second."""
    acted: float = 0.10
    """Change of the difference of a joint's pressures that shows that valves act, as a part of the highest; more on
    an arm whose angle has stayed the same during larger ones."""
    edge: float = 0.04
    """An angle that is nearer to the farthest ones seen, as a part of its range, may be at an end stop."""

    def _valid(self) -> Valid:
        return {
            "lead": 0 <= self.lead < math.inf,
            "most": 0 < self.most < math.inf,
            "fading": 0 < self.fading < math.inf,
            "torn": 0 < self.torn < math.inf,
            "inflation": 0 < self.inflation < math.inf,
            "calm": 0 < self.calm < math.inf,
            "fast": 0 < self.fast < math.inf,
            "apart": 1 < self.apart < math.inf,
            "changed": 0 < self.changed < math.inf,
            "alternating": 0 < self.alternating < 1,
            "worn": self.sound < self.worn < math.inf,
            "sound": 0 < self.sound < math.inf,
            "rail": self.rail >= 1,
            "jump": 0 < self.jump < math.inf,
            "frozen": self.frozen >= 2,
            "acted": 0 < self.acted < math.inf,
            "edge": 0 <= self.edge < 0.5,
        }

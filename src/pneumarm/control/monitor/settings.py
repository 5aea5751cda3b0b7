"""How much evidence a monitor wants."""

from dataclasses import dataclass
from typing import Annotated, Literal

from msgspec import Meta

from pneumarm.settings import NonNegativeFloat, PositiveFloat, PositiveInt, Settings, Valid

Mode = Literal["stop", "warn", "off"]
"""What a monitor does: mark what is spoiled and give up on an arm that stays broken; only tell; nothing."""


@dataclass(frozen=True)
class Weighing(Settings):
    """How much is needed to call something a fault of the valves or the air."""

    alarm: PositiveFloat = 14.0
    """Log-likelihood ratio from which on a fault counts as found."""
    supply: NonNegativeFloat = 4.0
    """Evidence that a low supply needs less: every inlet speaks for or against it, so by chance it has little."""
    telling: NonNegativeFloat = 1.5
    """Pressures expected with and without a fault that differ by fewer standard deviations tell nothing."""
    full: NonNegativeFloat = 0.75
    """Part of the highest pressure over which an open inlet tells only whether the outlet is open, too: the supply
    may be near."""
    empty: NonNegativeFloat = 0.04
    """A muscle below this part of the highest pressure is empty, and how much air it takes until its pressure rises
    is uncertain ..."""
    clear: NonNegativeFloat = 0.04
    """... so that expected pressures which differ by less of it tell nothing."""
    unsure: NonNegativeFloat = 0.2
    """Standard deviation of a filling or emptying as a part of it."""

    def _valid(self) -> Valid:
        return {"supply": self.supply < self.alarm or "below alarm"}


@dataclass(frozen=True)
class MonitorSettings(Settings):
    """How much evidence a monitor wants."""

    by_simulation: Weighing = Weighing()
    """Of what does not agree with a simulation."""
    by_identification: Weighing = Weighing(alarm=16.0, supply=0.0, telling=0.3, clear=0.02, unsure=0.25)
    """Of what does not agree with what has been identified of the arm: where little is known that is uncertain, so
    small differences tell something too; but it is no more than an approximation."""
    lead: NonNegativeFloat = 4.0
    """By how much the evidence of another fault must exceed it for what was found to be called by its name."""
    most: PositiveFloat = 5.0
    """Evidence that a single reading gives at most."""
    fading: PositiveFloat = 20.0
    """Time in which, with a simulation, evidence of what has not been found fades to 37 % [s]: faults show in
    seconds, and what takes minutes to add up, while an arm is held at a goal, is an error of the simulation."""
    torn: PositiveFloat = 6.0
    """The same of evidence of a torn hose, without a simulation [s]."""
    inflation: PositiveFloat = 1.5
    """Standard deviations of the simulation's error on held-out sequences that count as one."""
    calm: PositiveFloat = 20.0
    """A joint slower than this hardly moves [degrees/s]; large leaks are looked for then."""
    fast: PositiveFloat = 150.0
    """Speed at which the simulation's errors are larger by the root of two than at rest [degrees/s]."""
    apart: Annotated[float, Meta(gt=1)] = 2.5
    """An arm has changed whose errors are so many times as large as usual."""
    changed: PositiveFloat = 40.0
    """Log-likelihood ratio from which on the arm counts as changed."""
    alternating: Annotated[float, Meta(gt=0, lt=1)] = 0.3
    """Correlation of residuals with those before them under minus which they are noise of a sensor."""
    worn: float = 6.0
    """Mean square of the residuals from which on a part of a potentiometer's range counts as worn ..."""
    sound: PositiveFloat = 1.0
    """... while a quarter of all parts are below this; both in squares of the residuals that are usual."""
    rail: PositiveInt = 3
    """Readings on a rail, after a jump there, that show a broken potentiometer."""
    jump: PositiveFloat = 10.0
    """Least angle that counts as a jump onto a rail [degrees]; more where the arm was moving there."""
    frozen: Annotated[int, Meta(ge=2)] = 10
    """Equal angles in a row, while the pressures change, that show a potentiometer which is frozen; more of them
    where they take less than a third of a second."""
    acted: PositiveFloat = 0.10
    """Change of the difference of a joint's pressures that shows that valves act, as a part of the highest; more on
    an arm whose angle has stayed the same during larger ones."""
    edge: Annotated[float, Meta(ge=0, lt=0.5)] = 0.04
    """An angle that is nearer to the farthest ones seen, as a part of its range, may be at an end stop."""

    def _valid(self) -> Valid:
        return {"worn": self.sound < self.worn or "above sound"}

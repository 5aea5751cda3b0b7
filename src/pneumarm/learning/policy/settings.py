"""What a user can choose about learning a policy."""

import math
from dataclasses import dataclass

from pneumarm.learning.fleet import FleetSettings
from pneumarm.settings import Valid


@dataclass(frozen=True)
class PolicySettings(FleetSettings):
    """A policy, improved by proximal policy optimisation, and how it acts on the arm."""

    hidden: tuple[int, ...] = (32, 32)
    """Hidden units of each layer, of the policy and of the state's value alike."""
    clip: float = 0.2
    """How much more or less probable an action may become by one batch."""
    entropy: float = 0.01
    """Price of being certain, in standard deviations of the advantage."""
    hold: float = 3.0
    """Bonus, on its logit, of the action that is being held: a first guess at what switches cost."""
    squash: tuple[float, ...] = (25.0, 100.0)
    """Errors of the angle at which the inputs that tell them bend, finely and coarsely [counts of the thesis']."""
    still: float = 2.5
    """Changes of angle and pressures up to this count as none [counts of the thesis' sensors]."""
    patience: int = 2
    """Steps without change, off the goal, after which another action must be taken; 0: never."""
    passes: int = 6
    """Times that a joint may pass its goal in a movement on the arm; then it swings, and its valves stay closed for
    ``rest``; 0: any number."""
    rest: float = 1.0
    """How long they stay closed [s]."""
    lookahead: int = 192
    """Simulated movements by which a decision that is not clear is made on the arm; 0: as the policy says."""
    horizon: int = 25
    """Longest of these movements [steps]."""
    nodes: int = 20_000
    """With several joints: states of the simulation that may be kept in the search for a plan, which is followed as
    long as it may come true; 0: each joint looks ahead for itself."""
    practice: int = 2
    """With several joints: there are so many times as many updates for each joint after the first."""
    noise_share: float = 0.5
    """With several joints: the share of the simulation's noise that it learns and looks ahead in."""
    clear: float = 0.001
    """Actions less probable than this are not looked at; where only one is left the decision is clear."""
    fillings: float = 2.0
    """A movement may last for so many times what the muscles take to fill and then to empty, where that is longer
    than ``cutoff`` actions; 0 for ``cutoff`` actions on any arm."""

    def _valid(self) -> Valid:
        return {
            "hidden": 1 <= len(self.hidden) <= 8 and all(1 <= size <= 1024 for size in self.hidden),
            "clip": 0 < self.clip < 1,
            "entropy": 0 <= self.entropy < math.inf,
            "hold": math.isfinite(self.hold),
            "squash": len(self.squash) <= 16 and all(0 < error < math.inf for error in self.squash),
            "still": 0 <= self.still < math.inf,
            "patience": self.patience >= 0,
            "passes": self.passes >= 0,
            "rest": 0 <= self.rest <= 60 or "0 to 60 s",
            "lookahead": 0 <= self.lookahead <= 65_536,
            "horizon": self.horizon >= 1,
            "nodes": 0 <= self.nodes <= 10_000_000,
            "practice": self.practice >= 1,
            "noise_share": 0 <= self.noise_share <= 1 or "0 to 1",
            "clear": 0 <= self.clear < 1,
            "fillings": 0 <= self.fillings <= 100 or "0 to 100",
        }

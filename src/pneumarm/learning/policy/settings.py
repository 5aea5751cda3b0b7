"""What a user can choose about learning a policy."""

from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta

from pneumarm.learning.fleet import FleetSettings
from pneumarm.settings import Layers, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt, PythonOnly, Share


@dataclass(frozen=True)
class PolicySettings(FleetSettings):
    """A policy, improved by proximal policy optimisation, and how it acts on the arm."""

    hidden: Layers = (32, 32)
    """Hidden units of each layer, of the policy and of the state's value alike."""
    clip: Annotated[float, Meta(gt=0, lt=1)] = 0.2
    """How much more or less probable an action may become by one batch."""
    entropy: NonNegativeFloat = 0.01
    """Price of being certain, in standard deviations of the advantage."""
    hold: float = 3.0
    """Bonus, on its logit, of the action that is being held: a first guess at what switches cost."""
    squash: Annotated[tuple[PositiveFloat, ...], Meta(max_length=16), PythonOnly] = (25.0, 100.0)
    """Errors of the angle at which the inputs that tell them bend, finely and coarsely [counts of the thesis']."""
    still: Annotated[NonNegativeFloat, PythonOnly] = 2.5
    """Changes of angle and pressures up to this count as none [counts of the thesis' sensors]."""
    patience: Annotated[NonNegativeInt, PythonOnly] = 2
    """Steps without change, off the goal, after which another action must be taken; 0: never."""
    passes: NonNegativeInt = 6
    """Times that a joint may pass its goal in a movement on the arm; then it swings, and its valves stay closed for
    ``rest``; 0: any number."""
    rest: Annotated[float, Meta(ge=0, le=60)] = 1.0
    """How long they stay closed [s]."""
    lookahead: Annotated[int, Meta(ge=0, le=65_536)] = 192
    """Simulated movements by which a decision that is not clear is made on the arm; 0: as the policy says."""
    horizon: PositiveInt = 25
    """Longest of these movements [steps]."""
    nodes: Annotated[int, Meta(ge=0, le=10_000_000)] = 20_000
    """With several joints: states of the simulation that may be kept in the search for a plan, which is followed as
    long as it may come true; 0: each joint looks ahead for itself."""
    practice: PositiveInt = 2
    """With several joints: there are so many times as many updates for each joint after the first."""
    noise_share: Annotated[Share, PythonOnly] = 0.5
    """With several joints: the share of the simulation's noise that it learns and looks ahead in."""
    clear: Annotated[float, Meta(ge=0, lt=1), PythonOnly] = 0.001
    """Actions less probable than this are not looked at; where only one is left the decision is clear."""
    fillings: Annotated[float, Meta(ge=0, le=100)] = 2.0
    """A movement may last for so many times what the muscles take to fill and then to empty, where that is longer
    than ``cutoff`` actions; 0 for ``cutoff`` actions on any arm."""

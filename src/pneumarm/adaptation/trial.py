"""Whether an adapted agent earns less on the arm than the one it replaced: a test at a few set moments.

The rewards of the new agent are compared with those of the one before it, by

    z = (mean_new - mean_old) / sqrt(s_new^2 / n_new + s_old^2 / n_old),

when the new one has made as many movements as ``looks`` says. Under ``-limit`` at one of these looks it is put back;
past the last look it is confirmed. Looking several times is allowed for in the limit (P. Armitage, "Sequential
methods in clinical trials", 1958).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike

from pneumarm.settings import PositiveFloat, Settings, Valid

Verdict = Literal["open", "worse", "confirmed"]


@dataclass(frozen=True)
class TrialSettings(Settings):
    """When an adapted agent is taken back."""

    looks: Annotated[tuple[Annotated[int, Meta(ge=2)], ...], Meta(min_length=1)] = (10, 20, 40, 80)
    """Movements of the new agent after which it is compared with the one before it."""
    limit: PositiveFloat = 3.5
    """Standard errors by which its mean reward must be lower. An agent that is no worse is taken back in 0.1 to 0.5 %
    of trials with it, in 1 to 1.5 % with 3 (rewards of steady agents drawn anew; ``python -m benchmarks
    adaptation``)."""
    remembered: int = 100
    """Movements of the agent before it that it is compared with, the newest at most."""
    fewest: Annotated[int, Meta(ge=2)] = 8
    """Movements that the agent before it must have made; with fewer nothing is taken back."""

    def _valid(self) -> Valid:
        rising = all(a < b for a, b in zip(self.looks, self.looks[1:], strict=False))
        return {
            "looks": rising or "rising numbers",
            "remembered": self.remembered >= self.fewest or "fewest or more",
        }


def verdict(old: Sequence[float], new: Sequence[float], settings: TrialSettings) -> Verdict:
    """Return what the rewards of the ``old`` and the ``new`` agent, movement after movement, say by now."""
    looked = len(new) in settings.looks
    if looked and len(old) >= settings.fewest and lower_by(old, new) > settings.limit:
        return "worse"
    return "confirmed" if len(new) >= settings.looks[-1] else "open"


def lower_by(old: ArrayLike, new: ArrayLike) -> float:
    """Return by how many standard errors the mean of ``new`` (n,) is below that of ``old`` (m,)."""
    a, b = np.asarray(old, np.float64), np.asarray(new, np.float64)
    lower = float(a.mean() - b.mean())
    error = math.sqrt(a.var(ddof=1) / len(a) + b.var(ddof=1) / len(b))
    if error == 0:
        return math.copysign(math.inf, lower) if lower else 0.0
    return lower / error

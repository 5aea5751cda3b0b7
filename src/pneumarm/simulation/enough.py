"""Whether a recording is enough: how much better a simulation of all of it is than one of its first half.

Cells of the state space that are new say how much there is still to see, but not whether it matters: a network that
is fitted to some states knows their neighbours. What matters is the error on sequences that neither was fitted to.
Where all of a recording does hardly better than half of it, as much again will do hardly better than all of it.
"""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pneumarm.simulation.fit import FitResult, FitSettings, fit
from pneumarm.transitions.choice import share_held_out
from pneumarm.transitions.collect import FEWEST_TRANSITIONS
from pneumarm.transitions.filtering import filter_transitions
from pneumarm.transitions.store import Store
from pneumarm.transitions.window import Window

_MUCH = 0.1
"""An error that is lower by this part is worth collecting as much again."""
_HELD_OUT = 0.25
"""Share of the sequences that the errors are measured on."""
_SETTINGS = FitSettings(epochs=15)
"""Of both fits: further epochs change both alike."""
_FEWEST_SEQUENCES = 8
TOO_LITTLE = f"collect more: {2 * FEWEST_TRANSITIONS:,} transitions in {_FEWEST_SEQUENCES} sequences can be judged"
"""What to tell a person where there is too little to compare."""


@dataclass(frozen=True)
class Enough:
    """What the second half of a recording was good for."""

    gain: float
    """By which part its second half lowered the one-step error, the geometric mean over what networks predict."""

    @property
    def enough(self) -> bool:
        """Whether that is little."""
        return self.gain < _MUCH

    @property
    def verdict(self) -> str:
        """What to tell a person."""
        if self.enough:
            little = f"by {self.gain:.0%}, less than {_MUCH:.0%}" if self.gain > 0 else "not at all"
            return f"enough: the second half of the recording lowers the simulation's error {little}"
        return f"collect as much again: the second half lowers the simulation's error by {self.gain:.0%}"


def enough_data(store: Store) -> Enough | None:
    """Fit a simulation to the first half of ``store`` and one to all of it, and compare their errors.

    None where there is too little to compare: fewer than twice the fewest transitions that can be fitted, or fewer
    than eight sequences.
    """
    sequences = [entry.number for entry in store.catalogue()]
    if store.transitions < 2 * FEWEST_TRANSITIONS or len(sequences) < _FEWEST_SEQUENCES:
        return None
    window = Window.of(store.spec, _SETTINGS.history, ())
    first = sequences[: len(sequences) // 2]
    share = share_held_out(first, _HELD_OUT)
    half, whole = (
        filter_transitions(store.blocks(sequences=chosen), window, hold_out=share)
        for chosen in (partial(np.isin, test_elements=first), None)
    )
    results = [
        fit(
            filtered.transitions,
            whole.stream("held-out"),
            spec=store.spec,
            goal_range=store.percentiles(),
            valves=store.valves,
            settings=_SETTINGS,
        )
        for filtered in (half, whole)
    ]
    before, after = map(_error, results)
    return Enough(1 - after / before)


def _error(result: FitResult) -> float:
    """Return the geometric mean of the one-step errors of all that networks predict [sensor units]."""
    errors: NDArray[np.float64] = result.held_out.std[result.simulation.outputs]
    return math.exp(np.log(errors).mean())

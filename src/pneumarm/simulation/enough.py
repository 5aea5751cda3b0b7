"""Whether a recording is enough: how much better a simulation of all of it is than one of its first half.

Cells of the state space that are new say how much there is still to see, but not whether it matters: a network that
is fitted to some states knows their neighbours. What matters is the error on sequences that neither was fitted to.
Where all of a recording does hardly better than half of it, as much again will do hardly better than all of it.
"""

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.settings import Settings, Valid
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
_PURPOSE = "enough"
"""The purpose of the runs that note a judgement in a store; no sequence belongs to them."""
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


@dataclass(frozen=True)
class EnoughSettings(Settings):
    """When collecting ends by itself."""

    first: int = 2 * FEWEST_TRANSITIONS
    """Transitions after which it is first judged whether they are enough."""
    growth: float = 1.5
    """Factor by which the record grows from then on until it is judged again."""
    most: int = 60_000
    """Transitions at which collecting ends all the same."""

    def _valid(self) -> Valid:
        return {
            "first": 2 * FEWEST_TRANSITIONS <= self.first <= self.most or f"{2 * FEWEST_TRANSITIONS:,} or more",
            "growth": 1.1 <= self.growth <= 10 or "1.1 to 10",
        }


def collect_enough(
    record: Callable[[int], object], store: Store, settings: EnoughSettings = EnoughSettings()
) -> dict[str, Any]:
    """Have ``record`` fill ``store`` up to a number of transitions, again and again, until they are enough.

    Each judgement is noted in the store, so that a call that was interrupted goes on and ends as if it had not been.

    Returns:
        The numbers of ``transitions`` at which it was judged, by which part the second half had lowered the error
        each time (``gain``), and the last ``verdict``, for ``results.json``.

    """
    note = asdict(settings)
    runs = [run["settings"] for run in store.runs().values() if run["purpose"] == _PURPOSE]
    noted = {run["transitions"]: run["gain"] for run in runs if all(run[name] == note[name] for name in note)}
    sizes, gains, wanted = list[int](), list[float | None](), settings.first
    while True:
        record(wanted)
        if wanted not in noted:
            judged = enough_data(store)
            noted[wanted] = None if judged is None else judged.gain
            store.begin_run(_PURPOSE, {**note, "transitions": wanted, "gain": noted[wanted]})
        sizes.append(wanted)
        gains.append(noted[wanted])
        found = None if gains[-1] is None else Enough(gains[-1])
        if wanted >= settings.most or (found is not None and found.enough):
            verdict = TOO_LITTLE if found is None else found.verdict
            return {"transitions": sizes, "gain": gains, "verdict": verdict}
        wanted = min(round(settings.growth * wanted), settings.most)


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
    """Return the geometric mean of the one-step errors of all that is measured and predicted [sensor units]."""
    simulation = result.simulation
    errors: NDArray[np.float64] = result.held_out.std[simulation.outputs[simulation.measured]]
    return math.exp(np.log(errors).mean())

"""Whether a recording is enough: how much better a simulation of all of it is than one of its first half.

Cells of the state space that are new say how much there is still to see, but not whether it matters: a network that
is fitted to some states knows their neighbours. What matters is the error on sequences that neither was fitted to.
Where all of a recording does hardly better than half of it, as much again will do hardly better than all of it.
"""

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.settings import PositiveFloat, PythonOnly, Settings, Valid
from pneumarm.simulation.fit import SINGLE_STEPS, FitResult, fit
from pneumarm.transitions.choice import Stretched, choose_held_out
from pneumarm.transitions.collect import CollectResult
from pneumarm.transitions.filtering import filter_transitions
from pneumarm.transitions.store import Store
from pneumarm.transitions.window import Window

_MUCH = 0.1
"""An error that is lower by this part is worth collecting as much again."""
_LEFT = 0.1
"""So is an error of the networks alone, without the sensors' noise, of this part of how the arm changes in a step."""
_WIDER = 0.2
"""So is a range of angles whose second half made it wider by more than this part of it: what lies beyond is unknown,
and its errors are in no recording."""
_REACHED = 0.2, 99.8
"""Percentiles of the angles between which that range lies: wherever the joint was more than once or twice."""
_HELD_OUT = 0.25
"""Share of the sequences that the errors are measured on."""
_SETTINGS = replace(SINGLE_STEPS, epochs=15)
"""Of both fits: further epochs change both alike."""
_SEVERAL_JOINTS = replace(SINGLE_STEPS, epochs=6, layers=2)
"""Of several joints: both with two layers, though the first half may be too short for them to be better than one."""
_WORTH = 1.05
"""A record that may grow by less, until the time for it is over, is not judged again."""
_FEWEST_SEQUENCES = 8
_PURPOSE = "enough"
"""The purpose of the runs that note a judgement in a store; no sequence belongs to them."""
FEWEST_JUDGED = 4_000
"""Transitions that can be judged."""
TOO_LITTLE = f"collect more: {FEWEST_JUDGED:,} transitions in {_FEWEST_SEQUENCES} sequences can be judged"
"""What to tell a person where there is too little to compare."""


@dataclass(frozen=True)
class Enough:
    """What the second half of a recording was good for."""

    gain: float
    """By which part its second half lowered the one-step error, the geometric mean over what networks predict."""
    error: float
    """The one-step error that is left, as a part of how the arm changes in a step; the noise of readings included."""
    wider: float = 0.0
    """By which part of the range its second half made that wider, of the joint of which it is most."""

    @property
    def unknown(self) -> float:
        """How much of the error is the networks', not the noise's.

        The variance of theirs falls with the number of transitions, that of the noise does not: the second half took
        away as much of it as is left.
        """
        return self.error * math.sqrt(max((1 - self.gain) ** -2 - 1, 0.0)) if self.gain < 1 else 0.0

    @property
    def enough(self) -> bool:
        """Whether all are little."""
        return self.gain < _MUCH and self.unknown < _LEFT and self.wider < _WIDER

    @property
    def verdict(self) -> str:
        """What to tell a person."""
        if self.enough:
            little = f"by {self.gain:.0%}, less than {_MUCH:.0%}" if self.gain > 0 else "not at all"
            return f"enough: the second half of the recording lowers the simulation's error {little}"
        if self.gain >= _MUCH:
            return f"collect as much again: the second half lowers the simulation's error by {self.gain:.0%}"
        if self.wider >= _WIDER:
            return (
                f"collect as much again: {self.wider:.0%} of the range of angles was reached in the second half "
                "alone, there may be more"
            )
        return (
            "collect as much again: the sensors are noisy, and behind the noise the simulation's error still is "
            f"{self.unknown:.0%} of how the arm changes in a step"
        )


@dataclass(frozen=True)
class EnoughSettings(Settings):
    """When collecting ends by itself."""

    first: Annotated[PositiveFloat, PythonOnly] = FEWEST_JUDGED / 30
    """Seconds of sequences after which it is first judged whether they are enough, because an arm that is read
    oftener moves no more; no fewer transitions than can be judged."""
    growth: Annotated[float, Meta(ge=1.1, le=10), PythonOnly] = 1.5
    """Factor by which the record grows from then on until it is judged again."""
    most: float = 600.0
    """At which collecting ends all the same, for each joint, in seconds on the arm's clock; those between sequences
    count, too."""

    def _valid(self) -> Valid:
        return {"most": self.first <= self.most or f"{self.first:.0f} s or more, after which it is judged first"}

    def first_of(self, spec: ArmSpec) -> int:
        """Return after how many transitions of an arm it is first judged."""
        return max(round(self.first / spec.period), FEWEST_JUDGED)

    def most_of(self, spec: ArmSpec) -> float:
        """Return after which time on an arm's clock collecting ends [s]."""
        return self.most * spec.joints


def collect_enough(
    record: Callable[[int], CollectResult], store: Store, settings: EnoughSettings = EnoughSettings()
) -> dict[str, Any]:
    """Have ``record`` fill ``store`` up to a number of transitions, again and again, until they are enough.

    Each judgement is noted in the store, so that a call that was interrupted goes on and ends as if it had not been.

    Returns:
        The numbers of ``transitions`` at which it was judged, by which part the second half had lowered the error
        each time (``gain``), and the last ``verdict``, for ``results.json``.

    """
    note = asdict(settings)
    runs = [run["settings"] for run in store.runs().values() if run["purpose"] == _PURPOSE]
    noted = {run["transitions"]: run for run in runs if all(run.get(name) == note[name] for name in note)}
    wanted, most = settings.first_of(store.spec), settings.most_of(store.spec)
    sizes, gains = list[int](), list[float | None]()
    while True:
        recorded = record(wanted)
        if wanted not in noted:
            judged = enough_data(store)
            noted[wanted] = {
                "transitions": wanted,
                "judged": None if judged is None else asdict(judged),
                "share": recorded.seconds / most,
            }
            store.begin_run(_PURPOSE, note | noted[wanted])
        judgement, share = noted[wanted]["judged"], noted[wanted]["share"]
        found = None if judgement is None else Enough(**judgement)
        sizes.append(wanted)
        gains.append(None if found is None else found.gain)
        next_size = round(wanted * min(settings.growth, 1 / share))
        if next_size < _WORTH * wanted or (found is not None and found.enough):
            verdict = TOO_LITTLE if found is None else found.verdict
            if found is None or not found.enough:
                minutes = f"{share * most / 60:.0f} minutes of the arm's time"
                verdict += f" (it ended after {minutes}; --enough.most SECONDS allows more)"
            return {"transitions": sizes, "gain": gains, "verdict": verdict}
        wanted = next_size


def enough_data(store: Store) -> Enough | None:
    """Fit a simulation to the first half of ``store`` and one to all of it, and compare their errors.

    None where there is too little to compare: fewer transitions than can be judged, fewer than eight sequences, or
    no movement in those that are held out.
    """
    sequences = [entry.number for entry in store.catalogue()]
    if store.transitions < FEWEST_JUDGED or len(sequences) < _FEWEST_SEQUENCES:
        return None
    settings = (_SETTINGS if store.joints == 1 else _SEVERAL_JOINTS).of_arm(store)
    assert settings.history is not None
    window = Window.of(store.spec, settings.history)
    first = sequences[: len(sequences) // 2]
    parts = store.blocks(sequences=partial(np.isin, test_elements=first)), store.blocks()
    share, stretch = choose_held_out(parts[0], _HELD_OUT, 0, window.history)
    half, whole = (filter_transitions(Stretched(part, stretch), window, hold_out=share) for part in parts)
    results = [
        fit(
            filtered.transitions,
            whole.stream("held-out"),
            spec=store.spec,
            goal_range=store.percentiles(),
            valves=store.valves,
            settings=settings,
        )
        for filtered in (half, whole)
    ]
    before, after = map(_error, results)
    if not (np.isfinite(before) and np.isfinite(after)):
        return None
    ranges = (store.percentiles(_REACHED, chosen) for chosen in (None, partial(np.isin, test_elements=first)))
    whole_range, first_range = (np.ptp(one, axis=1) for one in ranges)
    return Enough(1 - after / before, after, float((1 - first_range / np.maximum(whole_range, 1.0)).max()))


def _error(result: FitResult) -> float:
    """Return the geometric mean of the relative one-step errors of what is measured and predicted; NaN of none."""
    simulation = result.simulation
    errors: NDArray[np.float64] = result.held_out.relative[simulation.outputs[simulation.measured]]
    known = errors[np.isfinite(errors)]  # not of a sensor that reads one constant
    return math.exp(np.log(known).mean()) if len(known) and known.all() else math.nan

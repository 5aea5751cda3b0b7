"""How many observations a state needs on this arm.

Three, a tenth of a second, are enough for the thesis' arm (eq. 3.5). Where readings are noisy, where the arm is
controlled faster, or where valves answer late, more say more: noise averages out, and what was commanded earlier
still has its effect to come. How much, a linear model tells as well as networks do, in no time. Noise shows in the
angles, dead time in the pressures: where valves answer a fifth of a second late, three observations say next to
nothing of how pressures will change, while the angle, which follows them, is predicted as well as ever. So both are
judged.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec, SensorKind
from pneumarm.networks import nested_least_squares
from pneumarm.transitions.choice import held_out, sample, share_held_out
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.window import QUANTITIES, Transitions, Window, transitions

USUAL = 3
"""Observations in a state (thesis eq. 3.5)."""
SEEN = 8
"""Observations in the state that an agent that settles sees, at least."""
LONGEST = 12
"""Observations in a state at most: at the usual 30 a second, valves may answer 0.3 s late."""
_WORTH = 0.07
"""Part by which an error must fall for more observations than usual."""
_AS_GOOD = 0.02
"""Part by which it may be higher than with the best number of them."""
_ROWS = 20_000
_HELD_OUT = 0.25


def chosen_history(source: Iterable[Rows], spec: ArmSpec, kinds: Iterable[SensorKind] = ()) -> int:
    """Return how many observations of the arm ``spec`` a state should hold, judged by a recording of it.

    Args:
        source: blocks of whole sequences, such as a store.
        spec: of the arm.
        kinds: of further sensors whose readings belong to the state.

    """
    window = Window.of(spec, LONGEST, kinds)
    drawn = sample((transitions(rows, window) for rows in source), _ROWS)
    if drawn is None:
        return USUAL
    apart = held_out(drawn.sequence, share_held_out(np.unique(drawn.sequence), _HELD_OUT))
    if min(apart.sum(), (~apart).sum()) <= 2 * window.input_size:
        return USUAL
    lengths = range(USUAL, LONGEST + 1)
    angles, pressures = _errors(drawn, window, lengths, apart)
    return max(_shortest(lengths, angles), _shortest(lengths, pressures))


def _shortest(lengths: range, errors: NDArray[np.float64]) -> int:
    """Return the shortest of ``lengths`` whose error is about the lowest of ``errors``; USUAL if none is worth it."""
    if errors.min() > (1 - _WORTH) * errors[0]:
        return USUAL
    return lengths[int(np.argmax(errors <= (1 + _AS_GOOD) * errors.min()))]


def _errors(
    data: Transitions, window: Window, lengths: range, apart: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the errors of linear models for each length of the history: of the angles, and of the pressures.

    They are geometric means of what changes at all [counts].
    """
    kind = np.tile(np.arange(len(QUANTITIES)), window.joints)
    change = (data.target - data.observation)[:, : window.joint_size].astype(np.float64)
    read = [columns(window, history) for history in lengths]
    order = read[0]
    for more in read[1:]:  # a longer history reads what shorter ones do, and then its own
        order = np.concatenate([order, np.setdiff1d(more, order)])
    x = data.inputs[:, order].astype(np.float64)
    spread = x[~apart].std(axis=0)
    x = (x - x[~apart].mean(axis=0)) / np.where(spread > 0, spread, 1.0)
    sizes = [len(one) for one in read]
    models = nested_least_squares(x[~apart], change[~apart], sizes)
    errors = np.array(
        [(one(x[apart, :size]) - change[apart]).std(axis=0) for one, size in zip(models, sizes, strict=True)]
    )
    changes = change[~apart].std(axis=0) > 0

    def mean(which: NDArray[np.bool_]) -> NDArray[np.float64]:
        found = np.log(np.maximum(errors[:, which & changes], np.finfo(float).tiny))
        return np.exp(found.sum(axis=1) / max(found.shape[1], 1))

    return mean(kind == QUANTITIES.index("angle")), mean(kind > QUANTITIES.index("velocity"))


def columns(window: Window, history: int) -> NDArray[np.int64]:
    """Return the columns of a window's inputs that a window with a shorter ``history`` has."""
    observed, commanded = window.history * window.observation_size, window.command_size
    earlier = observed + np.arange((history - 1) * commanded)
    now = window.input_size - commanded - window.memory_size + np.arange(window.memory_size + commanded)
    return np.concatenate([np.arange(history * window.observation_size), earlier, now])

"""The rules by which joints come to rest and are kept there, as kernels that a board runs as well.

What they do is told at :class:`~.rest.Rest`, which sets their numbers. They are plain loops over joints, without
allocation, because :mod:`~.in_c` writes the same statements as C.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.kernels import inner, kernel
from pneumarm.learning.servo.two_ways import Ways, WaysParameters, end_try, is_second_better, see_error

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Singles = NDArray[np.float32]
_KINDS: dict[Any, type] = {Floats: np.float64, Ints: np.int64, Bools: np.bool_, Singles: np.float32}


def blank(of: Any, joints: int, **shapes: tuple[int, ...]) -> dict[str, Any]:
    """Return the arrays of a named tuple ``of`` them by name, all zeros, of shape (joints,) where none is given."""
    kinds = {name: _KINDS[kind] for name, kind in of.__annotations__.items() if kind in _KINDS}
    return {name: np.zeros(shapes.get(name, (joints,)), kind) for name, kind in kinds.items()}


class RestParameters(NamedTuple):
    """The numbers of :class:`~.rest.Rest`: angles in counts, times in control periods."""

    tolerance: float
    unit: float
    """A tolerance, where ``tolerance`` may be several."""
    near: float
    still: float
    easy: float
    steady: float
    seen_still: float
    counted: float
    close: float
    kept: float
    swing: float
    farther: float
    """Most that is added where the policy acts in every period."""
    share: float
    """Of an error that is added in a period."""
    far: float
    fast: float
    """As many times the error and the drift of coming to rest end it."""
    quiet: float
    alert: float
    most_bias: float
    integral: float
    done: float
    most_pulses: int
    swings: int
    look: int
    slowly: int
    waited: int
    foreseen: int
    arrived: int
    actively: bool
    damped: WaysParameters
    active: WaysParameters
    empty: Floats
    """Pressures below which a muscle has nothing to let out, shape (joints, 2) [counts]."""


class Resting(NamedTuple):
    """How joints are nearly at rest: what changes. Shapes are (joints,) where none is given."""

    angles: Floats
    """The newest readings, the newest last, shape (n, joints) [counts]."""
    seen: Ints
    """How many of them, shape (1,)."""
    pulse: Floats
    """The last of each joint, shape (joints, 2)."""
    missed: Floats
    """Error of the mean of the last readings [counts]."""
    drift: Floats
    """Difference between the means of their halves [counts]."""
    slow: Bools
    steady: Bools
    still: Bools
    asked: Bools
    """Whether a simulation is asked if the joint stays where it is."""
    calm: Bools
    quiet: Bools
    look: Ints
    left: Ints
    pulses: Ints
    error: Floats
    before: Floats
    bias: Floats
    swings: Ints
    side: Floats
    near: Ints
    """Control steps since it first was near this goal, as far as that matters."""
    damped: Ways
    active: Ways


@inner
def mean_of(angles, seen, most, j):  # type: ignore[no-untyped-def]
    """Return the mean of the last ``most`` of the ``seen`` readings of joint ``j``, at the end of ``angles``.

    Loops, as NumPy takes ten times as long for so few numbers.
    """
    n, total = min(most, seen), 0.0
    for i in range(angles.shape[0] - n, angles.shape[0]):
        total += angles[i, j]
    return total / float(n)


@inner
def drift_of(angles, seen, most, j):  # type: ignore[no-untyped-def]
    """Return how far the means of both halves of the same readings differ, whole halves where there are fewer."""
    end, half, early, late = angles.shape[0], most // 2, 0.0, 0.0
    first, n = end - min(most, seen), min(half, seen)
    for i in range(first, first + n):
        early += angles[i, j]
    for i in range(end - n, end):
        late += angles[i, j]
    return abs(late / float(half) - early / float(half))


@inner
def extent_of(angles, seen, most, j):  # type: ignore[no-untyped-def]
    """Return how far the same readings extend."""
    first = angles.shape[0] - min(most, seen)
    low = angles[first, j]
    high = low
    for i in range(first + 1, angles.shape[0]):
        low, high = min(low, angles[i, j]), max(high, angles[i, j])
    return high - low


@inner
def variance_of(angles, seen, most, j):  # type: ignore[no-untyped-def]
    """Return the variance of the same readings."""
    n, total, squares = min(most, seen), 0.0, 0.0
    for i in range(angles.shape[0] - n, angles.shape[0]):
        total += angles[i, j]
    for i in range(angles.shape[0] - n, angles.shape[0]):
        off = angles[i, j] - total / float(n)
        squares += off * off
    return squares / float(n)


@kernel
def look_at_joints(parameters, rest, now, stays, angle):  # type: ignore[no-untyped-def]
    """Take in a reading ``angle`` (joints,) and see how still the joints are.

    ``now`` (joints,) is what is asked for, ``stays`` whether that will stay as it is.
    """
    angles, n = rest.angles, rest.angles.shape[0]
    for i in range(n - 1):
        for j in range(angle.shape[0]):
            angles[i, j] = angles[i + 1, j]
    for j in range(angle.shape[0]):
        angles[n - 1, j] = angle[j]
    rest.seen[0] = min(rest.seen[0] + 1, n)
    seen = rest.seen[0]
    for j in range(angle.shape[0]):
        error = now[j] - mean_of(angles, seen, parameters.look, j)
        rest.missed[j], rest.drift[j] = error, drift_of(angles, seen, parameters.look, j)
        longer = extent_of(angles, seen, parameters.slowly, j)
        lately = extent_of(angles, seen, parameters.foreseen, j)
        rest.slow[j] = seen >= parameters.slowly and longer < parameters.still + parameters.easy * abs(error)
        rest.steady[j] = (
            seen >= parameters.waited and variance_of(angles, seen, parameters.waited, j) < parameters.steady
        )
        rest.still[j] = seen >= parameters.foreseen and lately < parameters.seen_still
        rest.asked[j] = stays[j] and not rest.still[j] and abs(error) <= parameters.near and not rest.calm[j]


@kernel
def choose_joints(parameters, rest, now, stays, remains, acts):  # type: ignore[no-untyped-def]
    """Set which joints may open valves now, ``acts`` (joints,), and note which are nearly at rest.

    ``remains`` (joints,) tells whether they will stay where they are with closed valves; the rest as before.
    """
    last = rest.angles.shape[0] - 1
    for j in range(acts.shape[0]):
        rest.steady[j] = rest.steady[j] and (rest.still[j] or remains[j])
        off = now[j] - rest.angles[last, j]
        if rest.swings[j] >= parameters.swings or rest.damped.seen[j] > 0:
            see_error(parameters.damped, rest.damped, j, off / parameters.tolerance)
        if rest.seen[0] < parameters.look or not stays[j]:
            leave_joint(parameters, rest, j)
            acts[j] = True
        elif is_moved_actively(parameters, rest, j, off):
            acts[j] = True
        else:
            see_swing(parameters, rest, j, off)
            acts[j] = is_moved(parameters, rest, j)


@inner
def is_moved_actively(parameters, rest, j, off):  # type: ignore[no-untyped-def]
    """Return whether the policy moves joint ``j`` in every period, also near its goal, which it is ``off``."""
    if rest.near[j] > 0 or abs(off) <= parameters.near:
        rest.near[j] = min(rest.near[j] + 1, parameters.arrived + 1)
    if rest.near[j] == 0 or not parameters.actively:
        return False
    if rest.near[j] > parameters.arrived:
        see_error(parameters.active, rest.active, j, off / parameters.unit)
    if not is_second_better(rest.active, j):
        return False
    rest.swings[j] = 0
    added = off * parameters.share if abs(off) < parameters.close else 0.0
    mark_moving(parameters, rest, j, parameters.farther, added)
    return True


@inner
def is_moved(parameters, rest, j):  # type: ignore[no-untyped-def]
    """Return whether joint ``j``, whose goal stays, may open valves now; note whether it is nearly at rest."""
    error, calm = rest.missed[j], rest.calm[j]
    far, fast = parameters.far if calm else 1.0, parameters.fast if calm else 1.0
    if abs(error) > far * parameters.near:
        if rest.still[j]:  # it lies there: then its swings are over
            leave_joint(parameters, rest, j)
        rest.bias[j] = 0.0
        mark_moving(parameters, rest, j, 0.0, 0.0)
        return rest.swings[j] < parameters.swings or is_second_better(rest.damped, j)
    if not (calm or rest.steady[j]) or (rest.drift[j] > fast * parameters.still and not rest.slow[j]):
        counted = min(max(error, -parameters.counted), parameters.counted) if abs(error) < parameters.close else 0.0
        mark_moving(parameters, rest, j, parameters.kept, counted * parameters.share)
        return rest.swings[j] < parameters.swings or is_second_better(rest.damped, j)
    return is_pulsed(parameters, rest, j, error)


@inner
def is_pulsed(parameters, rest, j, error):  # type: ignore[no-untyped-def]
    """Return whether joint ``j``, nearly at rest with this ``error``, gets a pulse now."""
    rest.calm[j], rest.error[j] = True, error
    rest.quiet[j] = abs(error) < (parameters.alert if rest.quiet[j] else parameters.quiet)
    rest.look[j] = max(rest.look[j] - 1, 0)
    begins = not rest.quiet[j] and rest.look[j] == 0
    if begins:
        begin_pulses(parameters, rest, j, error)
    saturated = max(abs(rest.pulse[j, 0]), abs(rest.pulse[j, 1])) >= 1.0
    acts = not rest.quiet[j] and (rest.left[j] > 0 or saturated)
    if acts:
        rest.left[j], rest.look[j] = max(rest.left[j] - 1, 0), parameters.look
        if begins and not saturated:
            bias = rest.bias[j] + parameters.integral * error
            rest.bias[j] = min(max(bias, -parameters.most_bias), parameters.most_bias)
    return acts


@inner
def begin_pulses(parameters, rest, j, error):  # type: ignore[no-untyped-def]
    """Note that a pulse is due for the ``error``; where those before did little, several in a row."""
    before = rest.before[j]
    done = error * before <= 0.0 or abs(error) < parameters.done * abs(before)
    rest.pulses[j], rest.before[j] = 1 if done else min(2 * rest.pulses[j], parameters.most_pulses), error
    rest.left[j] = rest.pulses[j]


@inner
def see_swing(parameters, rest, j, error):  # type: ignore[no-untyped-def]
    """Count how often the ``error`` of joint ``j`` went from one side of its goal to the other."""
    if abs(error) > parameters.swing:
        side = 1.0 if error > 0.0 else -1.0
        if side == -rest.side[j]:
            rest.swings[j] = min(rest.swings[j] + 1, parameters.swings)  # more would overflow some day on a board
        rest.side[j] = side


@inner
def mark_moving(parameters, rest, j, kept, added):  # type: ignore[no-untyped-def]
    """Note that joint ``j`` moves: its bias, with what is ``added``, is ``kept`` at most."""
    rest.calm[j], rest.quiet[j], rest.look[j] = False, False, 0
    rest.left[j], rest.pulses[j], rest.error[j], rest.before[j] = 0, 1, 0.0, 0.0
    if rest.swings[j] < parameters.swings:
        rest.bias[j] = min(max(rest.bias[j] + added, -kept), kept)


@inner
def leave_joint(parameters, rest, j):  # type: ignore[no-untyped-def]
    """Note that joint ``j`` is far from what is asked for, or that this moves."""
    rest.swings[j], rest.side[j], rest.bias[j] = 0, 0.0, 0.0
    mark_moving(parameters, rest, j, 0.0, 0.0)


@kernel
def leave_goals(parameters, rest):  # type: ignore[no-untyped-def]
    """Note that something else is asked for."""
    for j in range(rest.calm.shape[0]):
        for muscle in range(2):
            rest.pulse[j, muscle] = 0.0
        leave_joint(parameters, rest, j)
        rest.near[j] = 0
        end_try(rest.damped, j)
        end_try(rest.active, j)


@kernel
def limit_pulses(parameters, rest, pressure, acts, command):  # type: ignore[no-untyped-def]
    """Leave of a ``command`` (joints, 2) what joints that may act need; ``pressure`` is (joints, 2) [counts].

    At rest a muscle with nothing to let out keeps its exhaust closed.
    """
    for j in range(acts.shape[0]):
        for muscle in range(2):
            empty = rest.calm[j] and command[j, muscle] < 0.0 and pressure[j, muscle] < parameters.empty[j, muscle]
            if empty or not acts[j]:
                command[j, muscle] = 0.0


@kernel
def note_pulses(rest, acts, command):  # type: ignore[no-untyped-def]
    """Note the ``command`` (joints, 2) of joints that may act."""
    for j in range(acts.shape[0]):
        if acts[j]:
            for muscle in range(2):
                rest.pulse[j, muscle] = command[j, muscle]

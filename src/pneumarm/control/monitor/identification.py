"""What the sensors of an arm should read next, identified from the arm itself while it moves.

No two arms fill, empty and squeeze their muscles alike, so nothing is taken for granted of how fast or how far. What
an arm usually does is learned from its own readings: the change of each pressure is a linear function of features
(which valves were open when, in slots of a third of a look; how full the muscle is; how far the joint turned), an ARX
model whose weights a Kalman filter estimates recursively. Where little has been seen the estimate is uncertain, and
its variance says so: before an arm has been seen moving, nothing about it is surprising.

A *look* is a thirtieth of a second or a control period, whichever is longer: in less, pressures hardly change and
nothing can be told from noise. Errors are kept by what the muscle was doing, so that each arm sets its own measure
of what is far off.

Valves may answer late. By how many looks says the lag at which commands and changes of pressures correlate most, once
an arm has been watched for a while; where it is more than the slots reach, they begin so many looks ago from then on,
and all is learned anew.

Source: L. Ljung, "System identification", 2nd edition, sections 4.2 (ARX) and 11.2 (recursive least squares); the
weight of a reading that is far off is that of a Student distribution.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.control.monitor.hypotheses import independence, leaked, reduced, time_open, times_opened
from pneumarm.kernels import inner

LOOK = 1 / 30
"""Time between two looks [s], where the control period is not longer."""
SLOTS = 3
"""Slots of a look."""
LOOKS = 3
"""Looks whose slots are features: what is open now, and what may still be under way in pipes and hoses."""
LATEST = 12
"""Looks that valves may answer late at most."""
EXPERIENCE = 20.0
"""An arm is not judged before it has been watched for so long [s]."""
ALL = 40.0
"""Time for which each muscle was seen filling, and emptying, after which an arm is known better than a simulation of
minutes knows it [s]."""
_SLOTS = SLOTS * LOOKS
_CURVES = 4 * _SLOTS  # the first feature after those of the slots
FEATURES = _CURVES + 23
_BY_SLOT, _BY_CHANGE = 0.1, 0.3  # standard deviations of the weights before anything is known
_FREEDOM = 4.0  # degrees of freedom of the Student distribution that weighs a reading
_DRIFT = 3e-9  # variance that a weight gains in a second: air, rubber and supply change with the day
_ERROR = 0.02  # standard deviation of an error before any is known, in highest pressures
_KNOWN = 10.0  # errors that this is worth
_FORGOTTEN = 3000.0  # errors of a class after which earlier ones count less
_LEAST = 0.4  # counts; below this the converter's rounding is all there is
_LOST = 0.25  # of what comes in while both valves are open, standard deviation
_CUT = 4.0  # standard deviations of an error that counts in the mean
_RECENT = 20.0  # s
_FARTHEST = 4.0  # highest pressures; a supply beyond this never shows
_SLOWED = 0.4  # of the filling at half the pressure: the supply is not much higher
SIDES, SPEEDS, LEVELS = 3, 3, 4
"""Classes of errors: closed, filling, emptying; slow, usual, fast; empty, low, high, full."""
_SLOW, _FAST = 0.5, 2.0
_EMPTY, _LOW, _FULL = 0.12, 0.4, 0.7
_SETTLED = 0.02  # of what is left over the lowest reading; a muscle that empties in seconds loses more in two looks
_HIGHEST_EMPTY = 0.3  # highest pressures; no sensor says so much of an empty muscle


class Identified(NamedTuple):
    """What has been learned of an arm of ``m`` muscles. Made by :func:`identified`; saved and restored as a whole."""

    weight: NDArray[np.float64]
    """Shape (m, FEATURES)."""
    covariance: NDArray[np.float64]
    """Shape (m, FEATURES, FEATURES)."""
    error: NDArray[np.float64]
    """By class: how many errors, and their mean square; shape (m, SIDES, SPEEDS, LEVELS, 2)."""
    lasting: NDArray[np.float64]
    """Mean square of the standardised errors while air flows, mean product of one with the one before, the last one;
    shape (m, 3)."""
    open: NDArray[np.float64]
    """Part of each slot, newest first, in which the valves were told to be open, shape (m, slots, inlet and
    outlet)."""
    opened: NDArray[np.float64]
    """How often the valves were told to open in a look, newest first, shape (m, looks, inlet and outlet)."""
    late: NDArray[np.float64]
    """How many looks the valves answer late, and whether that was looked at, shape (2,)."""
    answers: NDArray[np.float64]
    """By lag in looks: sum of what was told times how pressures changed then, and of the square of what was told;
    shape (LATEST + 2, 2)."""
    held: NDArray[np.float64]
    """Which valve is told to stay open at the end of the last period: 1 inlet, -1 outlet, 0 none; shape (m,)."""
    last: NDArray[np.float64]
    """Pressures at the last look and the last two changes that led to them, shape (m, 3) [highest pressures]."""
    angle: NDArray[np.float64]
    """Angles at the last look, shape (joints,) [counts]."""
    turning: NDArray[np.float64]
    """Mean of how far each joint turns from look to look, shape (joints,) [ranges]."""
    span: NDArray[np.float64]
    """Lowest and highest pressure seen, shape (m, 2) [highest pressures]."""
    empty: NDArray[np.float64]
    """Lowest pressure that they settled at when told to empty; infinite before they did; shape (m,) [highest
    pressures]."""
    clock: NDArray[np.float64]
    """Periods since the last look, looks in a row, looks in all; shape (3,)."""
    agreement: NDArray[np.float64]
    """Recent mean of what each muscle was told times how each pressure changed, shape (m told, m read)."""
    squares: NDArray[np.float64]
    """Recent mean squares of what each was told, and of the changes, shape (m, 2)."""
    answer: NDArray[np.float64]
    """How long each inlet was told to be open [s], and the lowest and highest pressure meanwhile, shape (m, 3)."""
    x: NDArray[np.float64]
    """Workspace: the features of each muscle, and those under a hypothesis, shape (m + 1, FEATURES)."""
    gain: NDArray[np.float64]
    """Workspace: covariance times features, shape (m + 1, FEATURES)."""
    variance: NDArray[np.float64]
    """Workspace: of what is expected of each muscle, shape (m,) [highest pressures squared]."""
    look: NDArray[np.float64]
    """Periods of a look, its length [s], highest pressure and range of the angle [counts], middle of that; (5,)."""


def identified(spec: ArmSpec) -> Identified:
    """Return what is known of an arm that was never seen: nothing."""
    muscles = 2 * spec.joints
    periods = max(1, round(LOOK / spec.period))
    low, high = spec.angle_range
    prior = np.full(FEATURES, _BY_SLOT)
    prior[_CURVES:] = _BY_CHANGE
    error = np.empty((muscles, SIDES, SPEEDS, LEVELS, 2))
    error[..., 0], error[..., 1] = _KNOWN, _ERROR**2
    span = np.empty((muscles, 2))
    span[:, 0], span[:, 1] = np.inf, -np.inf
    return Identified(
        weight=np.zeros((muscles, FEATURES)),
        covariance=np.tile(np.diag(prior**2), (muscles, 1, 1)),
        error=error,
        lasting=np.tile([1.0, 0.0, 0.0], (muscles, 1)),
        open=np.zeros((muscles, _SLOTS + SLOTS * LATEST, 2)),
        opened=np.zeros((muscles, 2 + LATEST, 2)),
        late=np.zeros(2),
        answers=np.zeros((LATEST + 2, 2)),
        held=np.zeros(muscles),
        last=np.zeros((muscles, 3)),
        angle=np.zeros(spec.joints),
        turning=np.zeros(spec.joints),
        span=span,
        empty=np.full(muscles, np.inf),
        clock=np.zeros(3),
        agreement=np.zeros((muscles, muscles)),
        squares=np.zeros((muscles, 2)),
        answer=np.tile([0.0, np.inf, -np.inf], (muscles, 1)),
        x=np.zeros((muscles + 1, FEATURES)),
        gain=np.zeros((muscles + 1, FEATURES)),
        variance=np.zeros(muscles),
        look=np.array([periods, periods * spec.period, spec.max_pressure_counts, high - low, (low + high) / 2]),
    )


@inner
def note_valves(known, command):  # type: ignore[no-untyped-def]
    """Note for which parts of the slots the valves were told to be open by the last period's ``command`` (m,)."""
    periods = known.look[0]
    for m in range(command.shape[0]):
        share = abs(command[m])
        if share > 0.0:
            begin = known.clock[0] / periods * SLOTS
            end = begin + share / periods * SLOTS
            side = 0 if command[m] > 0.0 else 1
            if known.held[m] * command[m] <= 0.0:
                known.opened[m, 0, side] += 1.0
            if side == 0:
                known.answer[m, 0] += share * known.look[1] / periods
            for slot in range(SLOTS):
                overlap = min(end, slot + 1.0) - max(begin, float(slot))
                if overlap > 0.0:
                    known.open[m, SLOTS - 1 - slot, side] += overlap
        known.held[m] = 0.0 if share < 1.0 else 1.0 if command[m] > 0.0 else -1.0


@inner
def shift_slots(known):  # type: ignore[no-untyped-def]
    """Make room for the slots of a new look."""
    for m in range(known.open.shape[0]):
        for slot in range(known.open.shape[1] - 1, -1, -1):
            for side in range(2):
                known.open[m, slot, side] = known.open[m, slot - SLOTS, side] if slot >= SLOTS else 0.0
        for side in range(2):
            for look in range(known.opened.shape[1] - 1, -1, -1):
                known.opened[m, look, side] = known.opened[m, look - 1, side] if look > 0 else 0.0


@inner
def features(known, readings, h, m, angle, full, x):  # type: ignore[no-untyped-def]
    """Write the features of muscle ``m`` under hypothesis ``h`` into ``x``; ``angle`` (joints,) is what is read now.

    ``full`` is the pressure at which inlets let no more air in [highest pressures]. Where both valves are open, as in
    no sound arm, some of what comes in leaves at once. Returned is the standard deviation of what stays [highest
    pressures].
    """
    source, joint, level = readings.source[h, m], m // 2, known.last[m, 0]
    filled = max(level - lowest_level(known, m), 0.0)
    supply = 1.0
    if readings.supply[h] < math.inf:
        supply = reduced(readings.supply[h], filled / (full - lowest_level(known, m)))
    taken, given, others, lost, late = 0.0, 0.0, 0.0, 0.0, int(known.late[0])
    for slot in range(_SLOTS):
        then = slot + SLOTS * late
        told_in, told_out = known.open[source, then, 0], known.open[source, then, 1]
        taking = time_open(readings, h, m, 0, told_in, told_out) * supply
        giving = time_open(readings, h, m, 1, told_in, told_out)
        both = max(taking + giving - 1.0, 0.0)
        lost += _LOST * both * (known.weight[m, slot] + level * known.weight[m, _SLOTS + slot])
        x[slot], x[_SLOTS + slot] = taking, taking * level
        x[2 * _SLOTS + slot], x[3 * _SLOTS + slot] = giving, giving * level
        taken += taking / _SLOTS
        given += giving / _SLOTS
        for other in range(known.open.shape[0]):
            if other != m:
                others += known.open[other, then, 0] / _SLOTS
    place = (angle[joint] - known.look[4]) / known.look[3]
    turned = 10.0 * (angle[joint] - known.angle[joint]) / known.look[3]
    x[_CURVES] = taken * level * level
    x[_CURVES + 1] = given * math.sqrt(filled)
    x[_CURVES + 2] = taken * others
    x[_CURVES + 3] = taken * place
    x[_CURVES + 4] = given * place
    x[_CURVES + 5] = 0.1
    x[_CURVES + 6] = 0.1 * level
    x[_CURVES + 7] = turned
    x[_CURVES + 8] = turned * level
    x[_CURVES + 9] = known.last[m, 1]
    x[_CURVES + 10] = known.last[m, 2]
    x[_CURVES + 11] = taken * level * level * level
    empty = max(0.0, 1.0 - filled / _EMPTY)
    x[_CURVES + 12] = turned * place
    x[_CURVES + 13] = turned * level * place
    x[_CURVES + 14] = taken * level * place
    x[_CURVES + 15] = given * level * place
    x[_CURVES + 16] = empty * turned
    x[_CURVES + 17] = empty * taken
    x[_CURVES + 18] = empty * given
    for look in range(2):  # a valve takes a while to open, and another one to close
        fills, empties = known.opened[source, late + look, 0], known.opened[source, late + look, 1]
        x[_CURVES + 19 + look] = 0.1 * supply * times_opened(readings, h, m, 0, fills, empties)
        x[_CURVES + 21 + look] = 0.1 * level * times_opened(readings, h, m, 1, fills, empties)
    return abs(lost)


@inner
def expected_change(known, m, x):  # type: ignore[no-untyped-def]
    """Return the change that is expected of muscle ``m`` by the features ``x`` [highest pressures]."""
    change = 0.0
    for i in range(FEATURES):
        change += known.weight[m, i] * x[i]
    return change


@inner
def takes_air(x):  # type: ignore[no-untyped-def]
    """Return whether a muscle with the features ``x`` takes air, or still may."""
    taken = 0.0
    for slot in range(_SLOTS):
        taken += abs(x[slot])
    return taken > 0.0


@inner
def uncertainty(known, m, x, gain):  # type: ignore[no-untyped-def]
    """Return the variance of what is expected by ``x``, and write covariance times ``x`` into ``gain``."""
    gain[:] = 0.0
    for i in range(FEATURES):
        row, factor = known.covariance[m, i], x[i]
        if factor != 0.0:
            for k in range(FEATURES):
                gain[k] += factor * row[k]
    variance = 0.0
    for i in range(FEATURES):
        variance += gain[i] * x[i]
    return max(variance, 0.0)


@inner
def class_of(known, m, angle):  # type: ignore[no-untyped-def]
    """Return the class of errors (side, speed, level) that the change of muscle ``m`` until now belongs to."""
    joint, taken, given, begin = m // 2, 0.0, 0.0, SLOTS * int(known.late[0])
    for slot in range(begin, begin + 2 * SLOTS):
        taken += known.open[m, slot, 0]
        given += known.open[m, slot, 1]
    side = 0 if taken + given == 0.0 else 1 if taken >= given else 2
    turned = abs(angle[joint] - known.angle[joint]) / known.look[3]
    usual = known.turning[joint]
    speed = 0 if turned < _SLOW * usual else 1 if turned < _FAST * usual else 2
    low = lowest_level(known, m)
    full = (known.last[m, 0] - low) / (highest_level(known, m) - low)
    return side, speed, 0 if full < _EMPTY else 1 if full < _LOW else 2 if full < _FULL else 3


@inner
def lowest_level(known, m):  # type: ignore[no-untyped-def]
    """Return what is read of muscle ``m`` when it is empty, as far as is known [highest pressures].

    The sensors of an arm may say anything where there is only the air of the room. A muscle that is stretched reads
    less, so the lowest of all readings counts only until an empty one has been seen.
    """
    least = known.span[m, 0] if known.empty[m] == math.inf else known.empty[m]
    return min(least, _HIGHEST_EMPTY)


@inner
def highest_level(known, m):  # type: ignore[no-untyped-def]
    """Return the highest pressure of muscle ``m`` that was read [highest pressures]."""
    return max(known.span[m, 1], lowest_level(known, m) + 0.1)


@inner
def filling(known, m, level):  # type: ignore[no-untyped-def]
    """Return how fast muscle ``m`` fills at a ``level`` with its inlet open [highest pressures a look]."""
    rate = level * level * (known.weight[m, _CURVES] + level * known.weight[m, _CURVES + 11])
    for slot in range(_SLOTS):
        rate += known.weight[m, slot] + level * known.weight[m, _SLOTS + slot]
    return rate


@inner
def half_a_filling(known, m):  # type: ignore[no-untyped-def]
    """Return half of what an open inlet fills into muscle ``m`` in a look when it is empty [counts]."""
    rate = filling(known, m, lowest_level(known, m)) + known.weight[m, _CURVES + 17]
    return 0.5 * max(rate, 0.0) * known.look[2]


@inner
def level_of_supply(known, m):  # type: ignore[no-untyped-def]
    """Return at which pressure the inlet of muscle ``m`` lets no more air in, about [highest pressures]."""
    low, top = lowest_level(known, m), highest_level(known, m)
    half, most = filling(known, m, 0.5 * (low + top)), filling(known, m, top)
    if most < _SLOWED * half:
        return top
    if most >= half:
        return max(_FARTHEST, top)
    return min(top + 0.5 * (top - low) * most / (half - most), max(_FARTHEST, top))


@inner
def expect_by_identification(known, readings, memory, angle, pressure, empty):  # type: ignore[no-untyped-def]
    """Set in ``memory`` what pressures are expected under every hypothesis [counts], and how uncertain that is.

    Of the hypotheses only those are asked how uncertain they are that are nearer to the ``pressure`` (joints, 2). A
    muscle below ``empty`` [counts above the lowest] has no air to give: there only what takes air differs.
    """
    muscles, highest = memory.std.shape[0], known.look[2]
    for m in range(muscles):
        read = pressure[m // 2, m % 2] / highest
        full = level_of_supply(known, m)
        memory.lowest[m] = lowest_level(known, m) * highest
        memory.full[m] = highest_level(known, m) * highest
        memory.base[m] = known.last[m, 0] * highest
        memory.trust[m] = independence(known.lasting[m, 0], known.lasting[m, 1])
        features(known, readings, 0, m, angle, full, known.x[m])
        healthy = known.last[m, 0] + expected_change(known, m, known.x[m])
        healthy = max(healthy, min(lowest_level(known, m), read))  # the line goes on below empty, no pressure does
        is_empty = (max(known.last[m, 0], read) - lowest_level(known, m)) * highest < empty
        variance = uncertainty(known, m, known.x[m], known.gain[m])
        known.variance[m] = variance
        side, speed, level = class_of(known, m, angle)
        least = _LEAST / highest
        std = math.sqrt(variance + max(known.error[m, side, speed, level, 1], least * least))
        memory.std[m] = std * highest
        for h in range(memory.expected.shape[0]):
            memory.expected[h, m], memory.doubt[h, m] = healthy * highest, 0.0
            if readings.leak[h, m] > 0.0:
                rate, seconds = readings.leak[h, m], known.look[1]
                memory.expected[h, m] = leaked(rate, seconds, memory.base[m], memory.lowest[m], memory.expected[h, m])
            elif h > 0 and not readings.as_told[h, m]:
                leaving = features(known, readings, h, m, angle, full, known.x[muscles])
                if is_empty and not takes_air(known.x[m]) and not takes_air(known.x[muscles]):
                    continue
                other = known.last[m, 0] + expected_change(known, m, known.x[muscles])
                other = max(other, min(known.span[m, 0], healthy))
                memory.expected[h, m], memory.doubt[h, m] = other * highest, leaving * highest
                if abs(other - read) < abs(healthy - read):
                    doubt = uncertainty(known, m, known.x[muscles], known.gain[muscles])
                    memory.doubt[h, m] = math.sqrt(doubt + leaving * leaving) * highest


@inner
def learn(known, m, angle, pressure):  # type: ignore[no-untyped-def]
    """Learn from the ``pressure`` that muscle ``m`` reads now [counts], after :func:`expect_by_identification`."""
    x, gain, variance, highest = known.x[m], known.gain[m], known.variance[m], known.look[2]
    change = pressure / highest - known.last[m, 0]
    error = change - expected_change(known, m, x)
    side, speed, level = class_of(known, m, angle)
    kept = known.error[m, side, speed, level]
    usual = max(kept[1], (_LEAST / highest) ** 2)
    weight = (_FREEDOM + 1.0) / (_FREEDOM + error * error / (usual + variance))
    total = variance + usual / min(weight, 1.0)
    for i in range(FEATURES):
        row, part_of_gain = known.covariance[m, i], gain[i] / total
        known.weight[m, i] += part_of_gain * error
        for k in range(FEATURES):
            row[k] -= part_of_gain * gain[k]
        row[i] += _DRIFT * known.look[1]
    kept[0] += 1.0
    square = min(error * error, _CUT * _CUT * (usual + variance))
    kept[1] += (max(square - variance, 0.0) - kept[1]) / min(kept[0], _FORGOTTEN)
    lasting, cut = known.lasting[m], error / math.sqrt(usual + variance)
    cut = min(max(cut, -_CUT), _CUT)
    if side > 0:
        share = 1.0 / min(known.clock[2] + 1.0, _FORGOTTEN)
        lasting[0] += share * (cut * cut - lasting[0])
        lasting[1] += share * (cut * lasting[2] - lasting[1])
    lasting[2] = cut


@inner
def note_answers(known, pressure):  # type: ignore[no-untyped-def]
    """Note how the pressures (joints, 2) answer to what the valves were told, whatever was expected [counts]."""
    muscles, highest = known.last.shape[0], known.look[2]
    share = min(1.0, max(known.look[1] / _RECENT, 1.0 / (known.clock[2] + 1.0)))
    begin = SLOTS * int(known.late[0])
    for m in range(muscles):
        level, told = pressure[m // 2, m % 2] / highest, 0.0
        for slot in range(begin, begin + _SLOTS):
            told += (known.open[m, slot, 0] - known.open[m, slot, 1]) / _SLOTS
        change = level - known.last[m, 0]
        known.squares[m, 0] += share * (told * told - known.squares[m, 0])
        known.squares[m, 1] += share * (change * change - known.squares[m, 1])
        for other in range(muscles):
            change = pressure[other // 2, other % 2] / highest - known.last[other, 0]
            known.agreement[m, other] += share * (told * change - known.agreement[m, other])
        known.answer[m, 1] = min(known.answer[m, 1], level)
        known.answer[m, 2] = max(known.answer[m, 2], level)


@inner
def note_dead_time(known, pressure):  # type: ignore[no-untyped-def]
    """Note by how many looks the valves answer late, by the pressures (joints, 2) of the first seconds [counts].

    The look in which an arm without dead time answers is the newest one, or the one before. Returned is whether the
    valves answer later than was thought, so that what was learned is of no use.
    """
    if known.late[1] > 0.0:
        return False
    for m in range(known.last.shape[0]):
        change = pressure[m // 2, m % 2] / known.look[2] - known.last[m, 0]
        for lag in range(LATEST + 2):
            told = 0.0
            for slot in range(SLOTS * lag, SLOTS * lag + SLOTS):
                told += known.open[m, slot, 0] - known.open[m, slot, 1]
            known.answers[lag, 0] += told * change
            known.answers[lag, 1] += told * told
    if known.clock[2] * known.look[1] < EXPERIENCE:
        return False
    known.late[1], best, most = 1.0, 0, 0.0
    for lag in range(LATEST + 2):
        agreement = known.answers[lag, 0] / np.sqrt(max(known.answers[lag, 1], 1e-12))
        if agreement > most:
            best, most = lag, agreement
    known.late[0] = max(best - 1, 0)
    return known.late[0] > 0.0


@inner
def forget_learned(known):  # type: ignore[no-untyped-def]
    """Forget what was learned of how pressures change, and how they answer."""
    for m in range(known.weight.shape[0]):
        for i in range(FEATURES):
            known.weight[m, i] = 0.0
            for k in range(FEATURES):
                known.covariance[m, i, k] = 0.0
            known.covariance[m, i, i] = (_BY_SLOT if i < _CURVES else _BY_CHANGE) ** 2
        for side in range(SIDES):
            for speed in range(SPEEDS):
                for level in range(LEVELS):
                    known.error[m, side, speed, level, 0] = _KNOWN
                    known.error[m, side, speed, level, 1] = _ERROR**2
        known.lasting[m, 0], known.lasting[m, 1], known.lasting[m, 2] = 1.0, 0.0, 0.0
        for other in range(known.weight.shape[0]):
            known.agreement[m, other] = 0.0
        known.squares[m, 0] = known.squares[m, 1] = 0.0
    known.clock[2] = 0.0


@inner
def doubt_what_counts_from(known, m, change):  # type: ignore[no-untyped-def]
    """Trust less what was learned of muscle ``m`` near empty: empty it reads less or more by ``change`` than thought.

    Features that count from there now say something else of the same pressure; their weights are to be learned anew.
    """
    part = min(abs(change) / _EMPTY, 1.0) * _BY_CHANGE
    for i in (_CURVES + 1, _CURVES + 16, _CURVES + 17, _CURVES + 18):
        known.covariance[m, i, i] += part * part


@inner
def is_settled(known, m, angle):  # type: ignore[no-untyped-def]
    """Return whether muscle ``m`` is as empty as it gets.

    It was told to empty for as long as is remembered, and hardly does any more, although more than the lowest reading
    is left; and its joint is slow, so that it is not stretched.
    """
    told, begin = 0.0, SLOTS * int(known.late[0])
    for slot in range(begin, begin + _SLOTS):
        told += known.open[m, slot, 1]
    fallen, left = -known.last[m, 1] - known.last[m, 2], known.last[m, 0] - known.span[m, 0]
    _, speed, _ = class_of(known, m, angle)
    return told > _SLOTS - 0.01 and speed == 0 and fallen <= _SETTLED * left  # a sum of parts is rounded


@inner
def remember_look(known, angle, pressure, fresh):  # type: ignore[no-untyped-def]
    """Remember what is read at a look; ``fresh`` says that a sequence begins with it."""
    for m in range(known.last.shape[0]):
        level = pressure[m // 2, m % 2] / known.look[2]
        known.last[m, 2] = 0.0 if fresh else known.last[m, 1]
        known.last[m, 1] = 0.0 if fresh else level - known.last[m, 0]
        known.last[m, 0] = level
        before = lowest_level(known, m)
        known.span[m, 0] = min(known.span[m, 0], level)
        known.span[m, 1] = max(known.span[m, 1], level)
        if not fresh and is_settled(known, m, angle):
            mean = level - (2.0 * known.last[m, 1] + known.last[m, 2]) / 3.0  # of the last three readings
            known.empty[m] = min(known.empty[m], mean)
        doubt_what_counts_from(known, m, before - lowest_level(known, m))
    for j in range(angle.shape[0]):
        if not fresh:
            turned = abs(angle[j] - known.angle[j]) / known.look[3]
            known.turning[j] += (turned - known.turning[j]) / min(known.clock[2] + 1.0, _FORGOTTEN)
        known.angle[j] = angle[j]
    known.clock[0] = 0.0
    if not fresh:
        known.clock[1] += 1.0
        known.clock[2] += 1.0


def count_of_looks(known: Identified) -> NDArray[np.float64]:
    """Return in how many looks each muscle was seen filling, and emptying, shape (m, 2)."""
    counts: NDArray[np.float64] = (known.error[:, 1:, ..., 0] - _KNOWN).sum(axis=(2, 3))
    return counts


OBEYS, DISOBEYS, CROSSWISE = 0.25, -0.2, 0.4
"""Correlations of what a muscle is told with how a pressure changes: of one that does what another one is told it is
below the first and, with the other's, over the third; of one that does the opposite it is below the second."""
_TOLD = 0.02  # mean square of what is told, below which nothing can be said
UNANSWERED = 20.0
"""Time that an inlet has been open after which a pressure must have changed [s] ..."""
ANSWER = 0.03
"""... by this at least [highest pressures]."""


def wrong_from_the_start(known: Identified) -> list[tuple[str, str, int, int]]:
    """Return what is wrong with an arm that no sound arm ever does: kind, detail, joint and muscle from 1."""
    if known.clock[2] * known.look[1] < EXPERIENCE:
        return []
    told, changed = known.squares.T
    correlation = known.agreement / np.sqrt(np.maximum(np.outer(told, changed), 1e-12))
    correlation[told < _TOLD] = 0.0
    found = []
    for m in range(len(told)):
        place = m // 2 + 1, m % 2 + 1
        open_for, low, high = known.answer[m]
        if open_for >= UNANSWERED and high - low < ANSWER:
            found.append(("no-answer", "its pressure stays the same whatever its valves do", *place))
        elif correlation[m, m] < DISOBEYS:
            found.append(("swapped-valves", "inlet and outlet are swapped", *place))
        for other in range(m + 1, len(told)):
            crosswise = min(correlation[m, other], correlation[other, m]) > CROSSWISE
            if crosswise and max(correlation[m, m], correlation[other, other]) < OBEYS:
                name = f"the valves are those of joint {other // 2 + 1}, muscle {other % 2 + 1}"
                found.append(("swapped-muscles", name, *place))
    return found


def forget_answers(known: Identified) -> None:
    """Begin to wait anew for the answers of the pressures that have given one."""
    answered = (known.answer[:, 0] >= UNANSWERED) & (known.answer[:, 2] - known.answer[:, 1] >= ANSWER)
    known.answer[answered] = 0.0, np.inf, -np.inf

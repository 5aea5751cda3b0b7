"""Weighing what was read against what was expected: one kernel call a reading.

For every hypothesis h the log-likelihood ratio of a reading against the healthy arm is summed, never below 0:

    S_h <- max(0, S_h + log p(reading | h) - log p(reading | healthy))

(the cumulative sum test: E. S. Page, "Continuous inspection schemes", Biometrika 41, 1954). Residuals follow a
Student distribution of four degrees of freedom, and a single reading counts for little: what a simulation gets wrong
in a fast movement must not look like a fault. Where h and the healthy arm differ by little, nothing is summed: there
a lasting error of the simulation, however small, would prove either in the end. The last reading that spoke against h
while S_h was 0 tells since when: what was read after it may have been spoiled, even where it told nothing.
Whether the readings agree with the simulation at all is weighed in the same way, against residuals that are several
times as large as usual. Two figures tell why they may be. Noise of a sensor makes residuals that alternate: it is in
a reading and, with the other sign, in what is expected of the next, so that of white noise n the residual is about
n_k+1 - n_k, whose correlation with the one before it is -1/2. A worn potentiometer makes large ones at some angles
only, so their mean square is kept by angle.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.velocity import derived_velocity
from pneumarm.control.monitor.expectation import expect_by_simulation
from pneumarm.control.monitor.hypotheses import TORN, has_torn_hose, independence
from pneumarm.control.monitor.identification import (
    EXPERIENCE,
    expect_by_identification,
    forget_learned,
    half_a_filling,
    learn,
    note_answers,
    note_dead_time,
    note_valves,
    remember_look,
    shift_slots,
)
from pneumarm.kernels import borrowed, inner, kernel, part

_velocity = part(derived_velocity)

FREEDOM = 4.0
"""Degrees of freedom of the Student distribution of residuals."""
ZONES = 32
"""Parts of the range of an angle by which residuals are kept."""
_NOTHING = 0.1  # evidence that is none
_LEAKING = 1.0  # standard deviations of a difference that tells of a leak: of less, errors tell as much
_FAR = 2.5  # standard deviations of a pressure that is worth telling of
_REMEMBERED = 3000.0  # residuals after which earlier ones count less in how long they last ...
_AT_FIRST = 1000.0  # ... and for how many not lasting at all counts at the beginning
_LASTING = 2.0  # a residual that counts in this: a fault makes large ones
_VISITS = 30.0  # residuals that the mean square of a zone is over, at most
_LARGEST = 5.0  # a residual that counts in these figures


class Thresholds(NamedTuple):
    """What the kernel compares with. Made by :class:`~pneumarm.control.monitor.Monitor`."""

    most: float
    """Evidence of a single reading at most."""
    kept: float
    """Part of the evidence that is left after a period, while nothing was found."""
    torn: float
    """Likewise of the evidence of a torn hose, of an arm that has no simulation."""
    alarm: float
    """Evidence of a fault from which on it counts as found; that of none grows beyond twice this."""
    telling: float
    """Expected pressures that differ by less than so many standard deviations tell nothing."""
    inflation: float
    """Standard deviations of the simulation's error on held-out sequences that count as one here."""
    full: float
    """In a muscle that is so full an open inlet tells of its outlet alone, as a part of ``Memory.full``."""
    empty: float
    """A muscle below this is empty; how much air it takes until its pressure rises is uncertain [counts]."""
    over: float
    """Only a fault brings a muscle over this that is not told to fill; once found it is called no other name for what
    is read there [counts]."""
    clear: float
    """Expected pressures of an empty muscle that differ by less tell nothing [counts]."""
    unsure: float
    """Standard deviation of a filling or emptying as a part of it."""
    calm: float
    """A joint slower than this hardly moves [counts/ms]."""
    fast: float
    """Speed at which errors are larger by the root of two than at rest [counts/ms]."""
    apart: float
    """Residuals of an arm that has changed, in those of one that has not."""
    changed: float
    """Evidence from which on the arm counts as changed."""
    low: float
    """Lowest reading of an angle [counts]."""
    high: float
    """Highest reading of an angle [counts]."""
    jump: float
    """An angle that goes farther than this, and than its usual movement, onto a rail has jumped [counts]."""
    acted: float
    """Change of a pressure that shows that valves act [counts]."""
    frozen: float
    """Equal angles in a row that may show a frozen potentiometer."""
    edge: float
    """An angle nearer than this to the farthest that was seen may be at an end stop [counts]."""
    experience: float
    """Readings after which it is known how an angle usually moves."""


class Memory(NamedTuple):
    """What a monitor remembers. Made by :func:`new_memory`; saved and restored as a whole."""

    observed: NDArray[np.float64]
    """Observations, newest first, shape (history, joints, 4) [sensor units]."""
    command: NDArray[np.float64]
    """Valves chosen after them, shape (history, muscles)."""
    clock: NDArray[np.float64]
    """Time of the newest reading [s]; readings in a row; rows that a window needs; by how much larger residuals are
    than usual: 1, or ``apart`` of an arm that has changed, of which a simulation proves less; 1 while something is
    wrong from which nothing may be learned; 1 while anything is found; shape (6,)."""
    score: NDArray[np.float64]
    """S_h, shape (hypotheses,)."""
    since: NDArray[np.float64]
    """When a reading last spoke against each while it was 0, shape (hypotheses,) [s]."""
    disagreement: NDArray[np.float64]
    """Evidence that angle, pressure 1, pressure 2 are not those of the simulation's arm, shape (joints, 3)."""
    disagreement_since: NDArray[np.float64]
    """Shape (joints, 3) [s]."""
    scatter: NDArray[np.float64]
    """Residuals of angle, pressure 1, pressure 2 since they began to disagree: sum of squares, sum of products with
    the one before, the last one; shape (joints, 3, 3)."""
    zone: NDArray[np.float64]
    """By part of the range of an angle: residuals in it, and their mean square, shape (joints, ZONES, 2)."""
    same: NDArray[np.float64]
    """By joint: readings of the same angle in a row; since when [s]; least and most difference of its two pressures
    meanwhile [counts]; (j, 4)."""
    rail: NDArray[np.float64]
    """By joint: readings on a rail in a row; since when [s]; whether it jumped there, its last movement; (j, 4)."""
    moved: NDArray[np.float64]
    """By joint: readings; the largest change of a movement from one reading to the next, lowest and highest angle
    [counts]; (j, 4)."""
    stayed: NDArray[np.float64]
    """By joint, away from the farthest angles and at them: readings there; how often the angle stayed equal for long,
    as if it was frozen, and was not; the largest change of the difference of its pressures meanwhile [counts];
    (j, 2, 3)."""
    expected: NDArray[np.float64]
    """Pressures expected at the newest reading, shape (hypotheses, muscles) [counts]."""
    std: NDArray[np.float64]
    """Standard deviations of those of a healthy arm, shape (muscles,) [counts]."""
    doubt: NDArray[np.float64]
    """Standard deviations of what is known of the others, shape (hypotheses, muscles) [counts]."""
    base: NDArray[np.float64]
    """The pressures that those expected follow on, shape (muscles,) [counts]."""
    lowest: NDArray[np.float64]
    """Pressures at which muscles are empty, shape (muscles,) [counts]."""
    clear: NDArray[np.float64]
    """Pressures expected of an empty muscle that differ by less tell nothing, shape (muscles,) [counts]."""
    full: NDArray[np.float64]
    """Pressures at which muscles are full, shape (muscles,) [counts]."""
    surprise: NDArray[np.float64]
    """The last pressure of each muscle that was far off: when [s], read, expected, its standard deviation [counts];
    shape (muscles, 4)."""
    trust: NDArray[np.float64]
    """Part of the evidence of a reading that is new, shape (muscles,): an error that lasts proves little."""
    angle: NDArray[np.float64]
    """Angles expected of a healthy arm, shape (joints,) [counts]."""
    lasting: NDArray[np.float64]
    """Residuals of angle and pressures: how many, mean square, mean product of one with the one before, the last one;
    shape (joints, 3, 4)."""
    stops: NDArray[np.float64]
    """Where the stop operators are that a simulation reads, shape (joints remembered,) [scaled]."""


def new_memory(joints: int, history: int, hypotheses: int, stops: int = 0) -> Memory:
    """Return an empty memory; ``history`` is at least 2."""
    return Memory(
        observed=np.zeros((history, joints, 4)),
        command=np.zeros((history, 2 * joints)),
        clock=np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0]),
        score=np.zeros(hypotheses),
        since=np.zeros(hypotheses),
        disagreement=np.zeros((joints, 3)),
        disagreement_since=np.zeros((joints, 3)),
        scatter=np.zeros((joints, 3, 3)),
        zone=np.zeros((joints, ZONES, 2)),
        same=np.zeros((joints, 4)),
        rail=np.zeros((joints, 4)),
        moved=np.tile([0.0, 0.0, np.inf, -np.inf], (joints, 1)),
        stayed=np.zeros((joints, 2, 3)),
        expected=np.zeros((hypotheses, 2 * joints)),
        std=np.zeros(2 * joints),
        doubt=np.zeros((hypotheses, 2 * joints)),
        base=np.zeros(2 * joints),
        lowest=np.zeros(2 * joints),
        clear=np.zeros(2 * joints),
        full=np.zeros(2 * joints),
        surprise=np.zeros((2 * joints, 4)),
        trust=np.ones(2 * joints),
        angle=np.zeros(joints),
        lasting=np.tile([_AT_FIRST, 1.0, 0.0, 0.0], (joints, 3, 1)),
        stops=np.zeros(stops),
    )


@kernel
def see_by_identification(known, readings, thresholds, memory, time, angle, pressure):  # type: ignore[no-untyped-def]
    """Weigh a reading by what is known of the arm; the valves chosen after it go into ``memory.command[0]``."""
    known, readings, memory = borrowed((known, readings, memory))
    is_experienced = known.clock[2] * known.look[1] >= EXPERIENCE
    forget_torn_hoses(thresholds, readings, memory)
    identify(known, readings, thresholds, memory, time, angle, pressure, is_experienced)
    look_at_potentiometers(thresholds, memory, time, angle, pressure)
    observe(memory, time, angle, pressure)


@kernel
def see_by_simulation(  # type: ignore[no-untyped-def]
    predictor, known, readings, thresholds, trusts_simulation, memory, time, angle, pressure
):
    """Weigh a reading by a simulation; the valves chosen after it go into ``memory.command[0]``.

    The arm is identified besides. Unless it ``trusts_simulation``, what is known of the arm judges its valves and the
    simulation only whether it has changed; ``thresholds`` are those of each.
    """
    predictor, known, readings, memory = borrowed((predictor, known, readings, memory))
    by_simulation, by_identification = thresholds
    forget(by_simulation, memory)
    if memory.clock[1] >= memory.clock[2]:
        expect_by_simulation(predictor, readings, memory)
        for m in range(memory.std.shape[0]):
            memory.std[m] = usual(by_simulation, memory, m // 2) * predictor.std[m // 2, 2 + m % 2] * memory.clock[3]
            memory.base[m] = memory.observed[0, m // 2, 2 + m % 2]
            memory.lowest[m], memory.full[m] = predictor.lowest[m], predictor.highest
            memory.clear[m] = by_simulation.clear
            memory.trust[m] = what_is_new(memory, m // 2, 1 + m % 2)
        if trusts_simulation:
            weigh_hypotheses(by_simulation, readings, memory, time, pressure)
        for j in range(angle.shape[0]):
            error = (angle[j] - memory.angle[j]) / (usual(by_simulation, memory, j) * predictor.std[j, 0])
            weigh_disagreement(by_simulation, memory, j, 0, error, time)
            place_residual(by_simulation, memory, j, angle[j], error)
            for side in range(2):
                m = 2 * j + side
                error = memory.clock[3] * (pressure[j, side] - memory.expected[0, m]) / memory.std[m]
                weigh_disagreement(by_simulation, memory, j, 1 + side, error, time)
    identify(known, readings, by_identification, memory, time, angle, pressure, not trusts_simulation)
    look_at_potentiometers(by_simulation, memory, time, angle, pressure)
    observe(memory, time, angle, pressure)


@inner
def identify(known, readings, thresholds, memory, time, angle, pressure, judges):  # type: ignore[no-untyped-def]
    """Learn of the arm from a reading that is a look; if it ``judges``, weigh the hypotheses, too."""
    if memory.clock[1] < 1.0:
        remember_look(known, angle, pressure, True)
    else:
        note_valves(known, memory.command[0])
        known.clock[0] += 1.0
    if known.clock[0] >= known.look[0]:
        if known.clock[1] >= 0.0:
            expect_by_identification(known, readings, memory, angle, pressure, thresholds.empty)
            for m in range(memory.std.shape[0]):
                memory.std[m] *= memory.clock[3]
                memory.clear[m] = min(thresholds.clear, half_a_filling(known, m))
            if judges:
                weigh_hypotheses(thresholds, readings, memory, time, pressure)
            if memory.clock[4] == 0.0:
                for m in range(memory.std.shape[0]):
                    learn(known, m, angle, pressure[m // 2, m % 2])
            note_answers(known, pressure)
            if note_dead_time(known, pressure):
                forget_learned(known)
        remember_look(known, angle, pressure, False)
        shift_slots(known)


@inner
def forget(thresholds, memory):  # type: ignore[no-untyped-def]
    """Let evidence fade while nothing was found: what adds up for minutes is an error of the simulation."""
    if memory.clock[5] == 0.0:
        for h in range(memory.score.shape[0]):
            memory.score[h] = faded(thresholds.kept, memory.score[h])
        for j in range(memory.disagreement.shape[0]):
            for q in range(memory.disagreement.shape[1]):
                memory.disagreement[j, q] = faded(thresholds.kept, memory.disagreement[j, q])


@inner
def forget_torn_hoses(thresholds, readings, memory):  # type: ignore[no-untyped-def]
    """Let evidence of torn hoses fade while nothing was found.

    A muscle that settles after it was filled looks a little like one that loses its air, and what is identified is no
    more than an approximation; a torn hose shows in a second.
    """
    if memory.clock[5] == 0.0:
        for h in range(1, memory.score.shape[0]):
            if has_torn_hose(readings, h):
                memory.score[h] = faded(thresholds.torn, memory.score[h])


@inner
def faded(kept, evidence):  # type: ignore[no-untyped-def]
    """Return what is left of ``evidence`` after a period, of which such a part is ``kept``."""
    left = kept * evidence
    return left if left > _NOTHING else 0.0


@inner
def usual(thresholds, memory, j):  # type: ignore[no-untyped-def]
    """Return how many standard deviations count as one; a simulation is worse where a joint moves fast."""
    fast = memory.observed[0, j, 1] / thresholds.fast
    return thresholds.inflation * math.sqrt(1.0 + fast * fast)


@inner
def what_is_new(memory, j, q):  # type: ignore[no-untyped-def]
    """Return which part of the evidence of a residual is new."""
    return independence(memory.lasting[j, q, 1], memory.lasting[j, q, 2])


@inner
def note_residual(lasting, error):  # type: ignore[no-untyped-def]
    """Note in ``lasting`` of a quantity how much a standardised residual is like the one before."""
    cut = min(max(error, -_LASTING), _LASTING)
    lasting[0] = min(lasting[0] + 1.0, _REMEMBERED)
    lasting[1] += (cut * cut - lasting[1]) / lasting[0]
    lasting[2] += (cut * lasting[3] - lasting[2]) / lasting[0]
    lasting[3] = cut


@inner
def surprise(error):  # type: ignore[no-untyped-def]
    """Return -log p of a standardised residual, up to a constant."""
    return 0.5 * (FREEDOM + 1.0) * math.log1p(error * error / FREEDOM)


@inner
def weigh_hypotheses(thresholds, readings, memory, time, pressure):  # type: ignore[no-untyped-def]
    """Add the evidence of ``pressure`` (joints, 2) to that of every hypothesis."""
    most = 0.0
    for m in range(memory.std.shape[0]):
        read = pressure[m // 2, m % 2]
        if abs(read - memory.expected[0, m]) > _FAR * memory.std[m]:
            last = memory.surprise[m]
            last[0], last[1], last[2], last[3] = time, read, memory.expected[0, m], memory.std[m]
    for h in range(1, memory.score.shape[0]):
        evidence = 0.0
        for m in range(memory.std.shape[0]):
            difference = memory.expected[h, m] - memory.expected[0, m]
            read, lowest = pressure[m // 2, m % 2], memory.lowest[m]
            least = thresholds.telling * memory.std[m]
            if max(memory.base[m], read) - lowest < thresholds.empty:
                least = max(least, memory.clear[m])
            fullness = (memory.base[m] - lowest) / (memory.full[m] - lowest)
            # A full muscle takes little, whatever is wrong; but it empties if its outlet is open.
            fills = max(memory.command[0, m], memory.command[1, m]) > 0.0
            full = fullness > thresholds.full and fills
            telling = abs(difference) > least and not (full and not readings.open[h, m, 1, 2])
            # What has been found brings it so far by itself, and there it looks like other faults.
            telling = telling and (fills or memory.base[m] <= thresholds.over or memory.clock[4] == 0.0)
            unsure = thresholds.unsure * difference
            if readings.leak[h, m] > 0.0:
                if readings.leak[h, m] < TORN:  # smaller differences tell, where a joint that moves makes none
                    telling = is_calm(thresholds, memory, m) and memory.clock[3] == 1.0
                # How much a valve lets through is uncertain by as much as the leak is.
                unsure = thresholds.unsure * (memory.expected[0, m] - memory.base[m])
                telling = telling and abs(difference) > _LEAKING * math.hypot(memory.std[m], unsure)
                # An empty muscle has nothing to lose, and one that empties when it is to fill has other valves.
                telling = telling and memory.base[m] - lowest >= thresholds.empty
                telling = telling and not (fills and read < memory.base[m])
            if telling:
                std = math.sqrt(memory.std[m] ** 2 + unsure * unsure + memory.doubt[h, m] ** 2)
                said = surprise((read - memory.expected[0, m]) / std) - surprise((read - memory.expected[h, m]) / std)
                evidence += memory.trust[m] * said
        evidence = min(max(evidence, -thresholds.most), thresholds.most)
        if memory.score[h] <= 0.0 and evidence < 0.0:
            memory.since[h] = time
        memory.score[h] = max(memory.score[h] + evidence, 0.0)
        most = max(most, memory.score[h])
    if most > 2.0 * thresholds.alarm:
        # All are lowered alike: what one has more than another tells them apart.
        for h in range(1, memory.score.shape[0]):
            memory.score[h] = max(memory.score[h] - (most - 2.0 * thresholds.alarm), 0.0)


@inner
def is_calm(thresholds, memory, m):  # type: ignore[no-untyped-def]
    """Return whether muscle ``m`` is closed for as long as the window reaches, and its joint hardly moves."""
    calm = abs(memory.observed[0, m // 2, 1]) < thresholds.calm
    for lag in range(memory.command.shape[0]):
        calm = calm and memory.command[lag, m] == 0.0
    return calm


@inner
def weigh_disagreement(thresholds, memory, j, q, error, time):  # type: ignore[no-untyped-def]
    """Add the evidence of a standardised residual that residuals are ``apart`` times as large as usual."""
    evidence = surprise(error) - surprise(error / thresholds.apart) - math.log(thresholds.apart)
    evidence *= what_is_new(memory, j, q)
    if memory.clock[4] == 0.0:
        note_residual(memory.lasting[j, q], error)
    cut, scatter = min(max(error, -_LARGEST), _LARGEST), memory.scatter[j, q]
    if memory.disagreement[j, q] <= 0.0:
        memory.disagreement_since[j, q] = time
        scatter[0] = scatter[1] = 0.0
    scatter[0] += cut * cut
    scatter[1] += cut * scatter[2]
    scatter[2] = cut
    total = memory.disagreement[j, q] + min(evidence, thresholds.most)
    memory.disagreement[j, q] = min(max(total, 0.0), 2.0 * thresholds.changed)


@inner
def place_residual(thresholds, memory, j, angle, error):  # type: ignore[no-untyped-def]
    """Keep the standardised residual of an ``angle`` [counts] with those at angles like it."""
    part_of_range = (angle - thresholds.low) / (thresholds.high - thresholds.low)
    zone = memory.zone[j, min(max(int(ZONES * part_of_range), 0), ZONES - 1)]
    zone[0] += 1.0
    zone[1] += (min(error * error, _LARGEST * _LARGEST) - zone[1]) / min(zone[0], _VISITS)


@inner
def look_at_potentiometers(thresholds, memory, time, angle, pressure):  # type: ignore[no-untyped-def]
    """Count readings on a rail, and equal readings in a row, with what the pressures did meanwhile."""
    for j in range(angle.shape[0]):
        before, rail, same, moved = memory.observed[0, j, 0], memory.rail[j], memory.same[j], memory.moved[j]
        turning = pressure[j, 0] - pressure[j, 1]
        fresh = memory.clock[1] < 1.0
        if not (angle[j] <= thresholds.low or angle[j] >= thresholds.high):
            movement = 0.0 if fresh else angle[j] - before
            if not fresh and rail[0] == 0.0:
                moved[1] = max(moved[1], abs(movement - rail[3]))
            rail[0], rail[3] = 0.0, movement
        elif rail[0] == 0.0:
            rail[0], rail[1] = 1.0, time
            rail[2] = 1.0 if not fresh and has_jumped(thresholds, rail, moved, angle[j] - before) else 0.0
        else:
            rail[0] += 1.0
        if same[0] == 0.0 or angle[j] != before or rail[0] > 0.0:
            if same[0] >= 0.5 * thresholds.frozen and rail[0] == 0.0:
                stayed = memory.stayed[j, at_edge(thresholds, moved, before)]
                stayed[1] += 1.0
                stayed[2] = max(stayed[2], same[3] - same[2])
            same[0], same[1], same[2], same[3] = 1.0, time, turning, turning
        else:
            same[0] += 1.0
            same[2], same[3] = min(same[2], turning), max(same[3], turning)
        moved[0] += 1.0
        if rail[0] == 0.0:
            moved[2], moved[3] = min(moved[2], angle[j]), max(moved[3], angle[j])
            memory.stayed[j, at_edge(thresholds, moved, angle[j]), 0] += 1.0


@inner
def has_jumped(thresholds, rail, moved, movement):  # type: ignore[no-untyped-def]
    """Return whether an angle went so far onto a rail by this ``movement`` [counts] as no joint of this arm turns."""
    usual = 1.5 * moved[1] if moved[0] >= thresholds.experience else 3.0 * thresholds.jump
    limit = max(thresholds.jump, usual)
    if movement * rail[3] > 0.0:
        limit += 2.0 * abs(rail[3])
    return abs(movement) > limit


@inner
def at_edge(thresholds, moved, angle):  # type: ignore[no-untyped-def]
    """Return 1 for an ``angle`` that is among the farthest that were seen, as at an end stop, else 0."""
    return 1 if angle - moved[2] < thresholds.edge or moved[3] - angle < thresholds.edge else 0


@inner
def observe(memory, time, angle, pressure):  # type: ignore[no-untyped-def]
    """Shift the window and put a reading in front, its velocity derived (thesis section 2.3.4)."""
    history = memory.observed.shape[0]
    first = memory.clock[1] < 1.0
    for lag in range(history - 1, 0, -1):
        for m in range(memory.command.shape[1]):
            memory.command[lag, m] = memory.command[lag - 1, m]
        for j in range(angle.shape[0]):
            for q in range(4):
                memory.observed[lag, j, q] = memory.observed[lag - 1, j, q]
    for j in range(angle.shape[0]):
        velocity = _velocity(angle[j], memory.observed[0, j, 0], time - memory.clock[0])
        memory.observed[0, j, 0] = angle[j]
        memory.observed[0, j, 1] = 0.0 if first else velocity
        memory.observed[0, j, 2] = pressure[j, 0]
        memory.observed[0, j, 3] = pressure[j, 1]
    if first:
        for lag in range(1, history):
            for j in range(angle.shape[0]):
                for q in range(4):
                    memory.observed[lag, j, q] = memory.observed[0, j, q]
    memory.clock[0] = time
    memory.clock[1] += 1.0

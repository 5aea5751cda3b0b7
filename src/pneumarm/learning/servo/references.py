"""References to learn from: constant goals, steps, sinusoids and minimum-jerk moves in the range of goals."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.kernels import kernel
from pneumarm.transitions.goals import Goals

Array = NDArray[np.float64]

_KINDS = _CONSTANT, _CLOSE, _SINUSOID, _JUMPS, _MOVE = range(5)
_SHARES = (0.32, 0.13, 0.35, 0.1, 0.1)
_FREQUENCIES = 0.05, 2.5  # Hz; slower is as good as constant, faster no arm of rubber follows
_NEAR = 0.08  # standard deviation of goals near to where the arm is, in parts of the range
_STEPS = 0.5, 1.5  # s between two steps
_MOVES = 0.3, 2.0  # s that a move takes


class _Drawn(NamedTuple):
    """What references are made of, each of shape (joints, n); angles in counts, times in s."""

    kind: NDArray[np.int64]
    near: Array
    """Angle near to where the joint is."""
    frequency: Array
    amplitude: Array
    middle: Array
    phase: Array
    begin: Array
    """Of a move, and for how long it lasts."""
    takes: Array
    lasts: Array
    """Of each step."""
    levels: Array
    """Of the steps, (steps, joints, n); the first is what is constant, and a move goes from it to the second."""


@kernel
def _play(drawn, period, references):  # type: ignore[no-untyped-def]
    """Set ``references`` (steps, joints, n) to what was ``drawn``, at every period."""
    steps, joints, n = references.shape
    for joint in range(joints):
        for e in range(n):
            kind, first, second = drawn.kind[joint, e], drawn.levels[0, joint, e], drawn.levels[1, joint, e]
            middle, amplitude, phase = drawn.middle[joint, e], drawn.amplitude[joint, e], drawn.phase[joint, e]
            turning = 2 * np.pi * drawn.frequency[joint, e]
            begin, takes, lasts = drawn.begin[joint, e], drawn.takes[joint, e], drawn.lasts[joint, e]
            for t in range(steps):
                time = t * period
                if kind == _SINUSOID:
                    now = middle + amplitude * np.sin(turning * time + phase)
                elif kind == _JUMPS:
                    now = drawn.levels[int(time / lasts), joint, e]
                elif kind == _MOVE:
                    s = min(max((time - begin) / takes, 0.0), 1.0)
                    now = first + (second - first) * s * s * s * (10 - 15 * s + 6 * s * s)
                else:
                    now = drawn.near[joint, e] if kind == _CLOSE else first
                references[t, joint, e] = now


def draw_references(
    random: np.random.Generator, goals: Goals | Array, angle: Array, steps: int, spec: ArmSpec, fastest: Array
) -> Array:
    """Return references (steps, joints, n) in [counts], at every control period.

    Args:
        random: what is drawn from.
        goals: that the arm can hold, or their range (joints, 2) [counts]; references keep within them.
        angle: where the joints are now, shape (joints, n) [counts].
        steps: how many periods.
        spec: of the arm.
        fastest: highest speed asked for, shape (joints,) [counts/s].

    """
    shape = angle.shape
    possible = Goals.of(goals)
    low, high = possible.range[:, :1], possible.range[:, 1:]
    span = high - low
    frequency = np.exp(random.uniform(np.log(_FREQUENCIES[0]), np.log(_FREQUENCIES[1]), shape))
    amplitude = np.minimum(span / 2 * random.random(shape), fastest[:, None] / (2 * np.pi * frequency))
    most_steps = int((steps - 1) * spec.period / _STEPS[0]) + 1
    drawn = _Drawn(
        kind=random.choice(len(_KINDS), size=shape, p=_SHARES),
        near=np.clip(angle + _NEAR * span * random.standard_normal(shape), low, high),
        frequency=frequency,
        amplitude=amplitude,
        middle=low + amplitude + (span - 2 * amplitude) * random.random(shape),
        phase=2 * np.pi * random.random(shape),
        begin=random.uniform(0, 0.5, shape),
        takes=random.uniform(*_MOVES, shape),
        lasts=random.uniform(*_STEPS, shape),
        levels=low + span * random.random((max(most_steps, 2), *shape)),
    )
    references = np.empty((steps, *shape))
    _play(drawn, spec.period, references)
    if not len(possible.ways):
        return references
    return np.ascontiguousarray(possible.within(references.swapaxes(1, 2)).swapaxes(1, 2))


@kernel
def write_previews(reference, ahead, known, preview):  # type: ignore[no-untyped-def]
    """Set ``preview`` (steps, previews, joints, n) to the reference some steps ``ahead`` (previews,).

    ``reference`` has the shape (more steps, joints, n). Where it is not ``known`` (n,) ahead, it is thought to go on
    as from the step before to now.
    """
    steps, previews, joints, n = preview.shape
    for t in range(steps):
        for p in range(previews):
            far = np.float32(ahead[p])
            for joint in range(joints):
                now, then = reference[t, joint], reference[t + ahead[p], joint]
                before = reference[max(t - 1, 0), joint]
                for e in range(n):
                    preview[t, p, joint, e] = then[e] if known[e] else now[e] + far * (now[e] - before[e])

"""References to learn from: constant goals, steps, sinusoids and minimum-jerk moves in the range of goals."""

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.transitions.goals import Goals

Array = NDArray[np.float64]

_KINDS = ("constant", "near", "sinusoid", "steps", "move")
_SHARES = (0.32, 0.13, 0.35, 0.1, 0.1)
_FREQUENCIES = 0.05, 2.5  # Hz; slower is as good as constant, faster no arm of rubber follows
_NEAR = 0.08  # standard deviation of goals near to where the arm is, in parts of the range
_STEPS = 0.5, 1.5  # s between two steps
_MOVES = 0.3, 2.0  # s that a move takes


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
    joints, n = angle.shape
    possible = Goals.of(goals)
    low, high = possible.range[:, :1], possible.range[:, 1:]
    span = high - low
    time = np.arange(steps)[:, None, None] * spec.period
    kind = random.choice(len(_KINDS), size=(joints, n), p=_SHARES)
    first, second = low + span * random.random((2, joints, n))
    near = np.clip(angle + _NEAR * span * random.standard_normal((joints, n)), low, high)
    references = np.broadcast_to(np.where(kind == _KINDS.index("near"), near, first), (steps, joints, n)).copy()

    frequency = np.exp(random.uniform(np.log(_FREQUENCIES[0]), np.log(_FREQUENCIES[1]), (joints, n)))
    amplitude = np.minimum(span / 2 * random.random((joints, n)), fastest[:, None] / (2 * np.pi * frequency))
    middle = low + amplitude + (span - 2 * amplitude) * random.random((joints, n))
    phase = 2 * np.pi * random.random((joints, n))
    swinging = middle + amplitude * np.sin(2 * np.pi * frequency * time + phase)

    begin, takes = random.uniform(0, 0.5, (joints, n)), random.uniform(*_MOVES, (joints, n))
    s = np.clip((time - begin) / takes, 0.0, 1.0)
    moving = first + (second - first) * s**3 * (10 - 15 * s + 6 * s**2)

    lasts = random.uniform(*_STEPS, (joints, n))
    number = (time / lasts).astype(int)
    levels = low + span * random.random((int(number.max()) + 1, joints, n))
    stepping = np.take_along_axis(levels, number, axis=0)

    for name, values in (("sinusoid", swinging), ("move", moving), ("steps", stepping)):
        references = np.where(kind == _KINDS.index(name), values, references)
    if not len(possible.ways):
        return references
    return np.ascontiguousarray(possible.within(references.swapaxes(1, 2)).swapaxes(1, 2))

"""Goals as x and y of the hand: angles that the arm was seen to hold and that bring its hand there.

For two joints they are computed, one pair an elbow. For any other number they are searched: from the angles, among
many drawn, whose hands come nearest, by the smallest steps that bring the hand there,

    theta <- theta + J^+ (xy - hand(theta))

with J^+ the pseudo-inverse of :func:`~pneumarm.arm.hand.turning`. One joint has its hand on an arc: there a goal
counts as met within a hundredth of the arm's length.
"""

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.hand import both_elbows, hand, turning
from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.task.reference import counts_of
from pneumarm.transitions.goals import Goals

Array = NDArray[np.float64]

_DRAWN = 5000
_STARTS = 50
_STEPS = 20
_INSIDE = 0.95  # of the way from the middle to the limits: rounded to millimetres it is still a goal
_NEAR = 0.01  # of the arm's length
_EXACT = 0.0005  # of it: a hand that comes so near is as good as the best


def angles_for(xy: Array, spec: ArmSpec, goals: Goals, near: Array, called: str) -> Array:
    """Return the angles (joints,) [counts] within ``goals`` that bring the hand to ``xy`` (2,) [m].

    Of several those nearest to ``near`` (joints,) [counts].

    Raises:
        UnusableInput: the links are not known, or there are none; the message begins with ``called``.

    """
    if not spec.links:
        raise UnusableInput(
            f"{called}: how long the links of {spec.name} are is not known; say it in metres from the base to the "
            f"hand, links = {[0.2] * spec.joints} under [spec] in its arm.toml (in Python: ArmSpec(links=...)), or "
            "give angles such as 20deg"
        )
    drawn = goals.draw(np.random.default_rng(0), _DRAWN)
    hands = hand(spec.degrees(drawn), spec.links)
    off = np.hypot(*(hands - xy).T)
    if spec.joints == 2:
        found = counts_of(both_elbows(xy, spec.links), spec)
    else:
        found = _searched(xy, spec, goals, drawn[np.argsort(off)[:_STARTS]])
    found = found[goals.contain(found)]
    if not len(found):
        (left, low), (right, high) = hands.min(axis=0), hands.max(axis=0)
        nearest = _INSIDE * drawn[np.argmin(off)] + (1 - _INSIDE) * goals.middle
        x, y = hand(spec.degrees(nearest), spec.links)
        raise UnusableInput(
            f"{called}: goals of the hand lie at x from {left:.3f}m to {right:.3f}m and y from {low:.3f}m to "
            f"{high:.3f}m, though not all over that, where it was often enough to be known; the nearest is about "
            f"{x:.3f}m,{y:.3f}m"
        )
    return np.asarray(found[np.argmin(((found - near) ** 2).sum(axis=1))])


def _searched(xy: Array, spec: ArmSpec, goals: Goals, starts: Array) -> Array:
    """Return the angles (n, joints) [counts] with the hand near ``xy`` (2,) [m], one a start that led there."""
    angle = starts
    for _ in range(_STEPS):
        degrees = spec.degrees(angle)
        missing = xy - hand(degrees, spec.links)
        step = (np.linalg.pinv(turning(degrees, spec.links)) @ missing[..., None])[..., 0]
        angle = np.clip(goals.within(angle + step * spec.counts_per_degree), *goals.range.T)
    missed = np.hypot(*(xy - hand(spec.degrees(angle), spec.links)).T)
    length = sum(spec.links)
    return angle[missed <= min(missed.min() + _EXACT * length, _NEAR * length)]

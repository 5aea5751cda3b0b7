"""Wires exchanged between joints: where filling a muscle is answered by sensors that belong to another joint.

Looked at alone, each of the joints shows a fault that it does not have: a valve that is stuck, a potentiometer that
turns the wrong way. Two things tell what is exchanged: whose pressure rises when a muscle is told to fill, and which
angle turns.

=================  ============  =====
exchanged          pressure      angle
=================  ============  =====
valves             of the other  of the other
pressure sensors   of the other  its own
angle sensors      its own       of the other
=================  ============  =====
"""

from collections.abc import Iterator, Mapping
from typing import Literal, NamedTuple, TypeVar

import numpy as np

from pneumarm.checkup.figures import FILLED, rise
from pneumarm.checkup.measure import Array, Checkup, MuscleTest, Trace

What = Literal["valves exchanged", "inlets exchanged", "pressure sensors exchanged", "angle sensors exchanged"]
Muscle = tuple[int, int]
"""A joint and one of its muscles, counted from 0."""
Place = TypeVar("Place")

_TURNED = 5.0  # degrees: what a joint is turned by at least whose muscles are filled
_OWN = 0.5  # what answers less than so many times as much as another is not what was told to
_KEPT = 0.7  # share of its rise that a muscle keeps whose exhaust has not opened


class Exchange(NamedTuple):
    """Wires that are exchanged: filling each is answered by the sensor of the next, the last by that of the first."""

    what: What
    muscles: tuple[Muscle, ...] = ()
    """Whose; empty for angle sensors."""
    angles: tuple[int, ...] = ()
    """Joints, counted from 0, whose angle sensors they are; empty for others."""

    @property
    def joints(self) -> set[int]:
        """The joints that can be judged only when this is mended."""
        return {joint for joint, _ in self.muscles} | set(self.angles)


def exchanged(checkup: Checkup) -> list[Exchange]:
    """Return what is exchanged between joints, in the order of their numbers."""
    tests = {(j, m): test for j, joint in enumerate(checkup.joints) for m, test in enumerate(joint.muscles)}
    answering = {muscle: _answering(muscle, test, checkup) for muscle, test in tests.items()}
    crossed = [cycle for cycle in _cycles(answering) if len({joint for joint, _ in cycle}) > 1]
    in_place = set(tests).difference(*crossed)
    turned = {muscle: _turned(test, checkup) for muscle, test in tests.items()}
    angle_of = {joint: _turning(joint, turned, in_place) for joint in range(len(checkup.joints))}
    turning = list(_cycles(angle_of))
    right = {joint: joint for joint in angle_of} | {joint: angle_of[joint] for cycle in turning for joint in cycle}
    of_muscles = [Exchange(_what(cycle, tests, turned, right), muscles=cycle) for cycle in crossed]
    return [*of_muscles, *(Exchange("angle sensors exchanged", angles=cycle) for cycle in turning)]


def _answering(muscle: Muscle, test: MuscleTest, checkup: Checkup) -> Muscle:
    """Return whose pressure sensor answers when ``muscle`` is told to fill; its own where none does clearly."""
    rose = np.array([rise(trace) for trace in _fills(test)]) / checkup.spec.counts_per_bar
    joint, m = np.unravel_index(np.argmax(rose), rose.shape)
    foreign = rose[joint, m] > FILLED * checkup.spec.max_pressure and rose[muscle] < _OWN * rose[joint, m]
    return (int(joint), int(m)) if foreign else muscle


def _turned(test: MuscleTest, checkup: Checkup) -> Array:
    """Return how far each angle turned while a muscle was told to fill, either way, shape (joints,) [degrees]."""
    return np.abs([fill.angle[-1] - fill.angle[0] for fill in _fills(test)]) / checkup.spec.counts_per_degree


def _fills(test: MuscleTest) -> list[Trace]:
    """Return what the sensors of each joint read while the muscle was told to fill."""
    return [seen[: len(test.fill.time)] for seen in test.everywhere]


def _turning(joint: int, turned: Mapping[Muscle, Array], in_place: set[Muscle]) -> int:
    """Return whose angle turns most when the muscles of ``joint`` are filled; its own where none turns.

    The joint itself always turns more than those that hang on it, but hardly so where these are heavy. Where a sensor
    is dead the most is that of another joint; but then that one's own muscles turn it, and they make no ring.
    """
    total = sum((turned[muscle] for muscle in in_place if muscle[0] == joint), np.zeros(1))
    most = int(np.argmax(total))
    return most if total[most] > _TURNED else joint


def _cycles(follows: Mapping[Place, Place]) -> Iterator[tuple[Place, ...]]:
    """Yield the rings of several in which each is followed by the next; what leads into one is in none."""
    seen = set[Place]()
    for first in follows:
        ring = [first]
        while (following := follows[ring[-1]]) not in ring:
            ring.append(following)
        if following == first and len(ring) > 1 and first not in seen:
            seen.update(ring)
            yield tuple(ring)


def _what(
    cycle: tuple[Muscle, ...],
    tests: Mapping[Muscle, MuscleTest],
    turned: Mapping[Muscle, Array],
    angle_of: Mapping[int, int],
) -> What:
    """Return what of the muscles in ``cycle`` is exchanged: what opens, or what is read."""
    following = dict(zip(cycle, (*cycle[1:], cycle[0]), strict=True))
    own = sum(turned[muscle][angle_of[muscle[0]]] for muscle in cycle)
    foreign = sum(turned[muscle][angle_of[other[0]]] for muscle, other in following.items())
    if own > foreign:
        return "pressure sensors exchanged"
    if all(_keeps(tests[muscle], other) for muscle, other in following.items()):
        return "inlets exchanged"
    return "valves exchanged"


def _keeps(test: MuscleTest, other: Muscle) -> bool:
    """Return whether the muscle ``other`` keeps what it was filled with by a test whose exhaust does not vent it."""
    joint, m = other
    pressure = test.everywhere[joint].pressure[:, m]
    began = pressure[0]
    full = np.median(pressure[len(test.fill.time) :][: len(test.hold.time)])
    return bool(pressure[-10:].mean() - began > _KEPT * (full - began))

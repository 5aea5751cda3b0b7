"""The measures that an arm is drawn with, in metres."""

from dataclasses import dataclass
from typing import TypeVar

from pneumarm.arm.seam import Arm
from pneumarm.arm.virtual import VirtualArm

_Kind = TypeVar("_Kind", bound=Arm)


@dataclass(frozen=True)
class Measures:
    """One joint: its link, its pulley, and the muscles that pull at it from the link before."""

    link: float
    """From the hinge to the next one, or to the weight at the end [m]."""
    pulley: float
    """Radius [m]."""
    muscle: float
    """Length of a muscle with the joint in the middle [m]."""
    diameter: float
    """Of a muscle without pressure [m]."""


USUAL = Measures(link=0.21, pulley=0.034, muscle=0.19, diameter=0.03)
"""How an arm is drawn of which nobody knows the measures; then nothing is to scale."""


def behind(arm: Arm | None, kind: type[_Kind]) -> _Kind | None:
    """Return the arm of a ``kind`` behind ``arm``, which may be guarded, paced or corrected; None where none is."""
    while arm is not None and not isinstance(arm, kind):
        arm = getattr(arm, "arm", None)
    return arm


def measures_of(arm: Arm) -> tuple[list[Measures], bool]:
    """Return what to draw each joint of ``arm`` with, and whether that is to scale."""
    virtual = behind(arm, VirtualArm)
    if virtual is None:
        return [USUAL] * arm.spec.joints, False
    return [
        Measures(
            link=link,
            pulley=joint.radius,
            muscle=joint.muscles[0].length_at_zero,
            diameter=joint.muscles[0].diameter,
        )
        for joint, link in zip(virtual.parameters.joints, virtual.parameters.links, strict=True)
    ], True

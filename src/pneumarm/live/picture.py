"""The measures that an arm is drawn with, in metres."""

from typing import TypeVar

from pneumarm.arm.seam import Arm
from pneumarm.arm.virtual import VirtualArm
from pneumarm.report.drawn_arm import USUAL, Measures

_Kind = TypeVar("_Kind", bound=Arm)


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

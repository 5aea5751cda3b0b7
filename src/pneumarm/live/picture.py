"""The arm that is drawn on the page."""

from typing import TypeVar

from pneumarm.arm.seam import Arm
from pneumarm.arm.virtual import VirtualArm
from pneumarm.drawing.drawn_arm import DrawnArm, Measures

_Kind = TypeVar("_Kind", bound=Arm)


def unwrapped(arm: Arm | None, kind: type[_Kind]) -> _Kind | None:
    """Return the arm of a ``kind`` behind ``arm``, which may be guarded, paced or corrected; None where none is."""
    while arm is not None and not isinstance(arm, kind):
        arm = getattr(arm, "arm", None)
    return arm


def drawing_of(arm: Arm) -> tuple[DrawnArm, bool]:
    """Return ``arm`` as it is drawn, and whether that is to scale."""
    virtual = unwrapped(arm, VirtualArm)
    if virtual is None:
        return DrawnArm.of(arm.spec), False
    measures = [
        Measures(
            link=link,
            pulley=joint.radius,
            muscle=joint.muscles[0].length_at_zero,
            diameter=joint.muscles[0].diameter,
        )
        for joint, link in zip(virtual.parameters.joints, virtual.parameters.links, strict=True)
    ]
    return DrawnArm(measures, arm.spec.muscles), True

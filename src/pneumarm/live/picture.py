"""The arm that is drawn on the page."""

from pneumarm.arm.seam import Arm
from pneumarm.arm.virtual import VirtualArm
from pneumarm.arm.wrapper import unwrapped
from pneumarm.drawing.drawn_arm import DrawnArm, Measures


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

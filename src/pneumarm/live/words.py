"""What the monitor and the guard have to say, in sentences for people who look on."""

from pneumarm.arm.guard import Interventions
from pneumarm.arm.seam import ArmSpec
from pneumarm.control.monitor.findings import Finding

_NOTHING = "no interventions"


def sentence(found: Finding, spec: ArmSpec) -> str:
    """Return what was ``found``, in words: ``Muscle 1: the inlet is stuck closed``."""
    place = []
    if found.muscle is not None:
        place.append(f"muscle {found.muscle}")
    if found.joint is not None and (spec.joints > 1 or not place):
        place.append(f"joint {found.joint}")
    what = found.detail
    if found.kind.endswith("-potentiometer"):
        what = f"the potentiometer is {found.kind.partition('-')[0]}: {what}"
    elif found.kind == "changed":
        what = f"the arm has changed: {what}"
    text = f"{' of '.join(place)}: {what}" if place else what
    return text[0].upper() + text[1:]


def prevented(by: Interventions) -> str:
    """Return how often the guard did what, in words: ``prevented 3 x pressure at its limit``."""
    words = {
        "pressure at its limit": by.pressure,
        "muscle inflated for too long": by.inflation,
        "angle at its limit": by.angle,
        "command that was none": by.nonsense,
        "controller failed": by.raised,
        "command came too late": by.late,
    }
    said = ", ".join(f"{count} x {what}" for what, count in words.items() if count)
    return f"prevented {said}" if said else _NOTHING

"""What happens to an agent that adapts, for programs and for people."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

What = Literal["noticed", "accepted", "refused", "rolled back"]


@dataclass(frozen=True)
class Event:
    """Something that happened to an adapting agent."""

    what: What
    movement: int
    """Movements made on the arm by then, those of tests counted."""
    version: int
    """Of the agent after it; 0 is the one that arrived."""
    figures: Mapping[str, Any]
    """``noticed``: since (the movement) and ratio; ``accepted``, ``refused``: movements, and the errors before and
    after over those of the fit; ``rolled back``: the mean rewards before and after, and the version taken back.
    Ratios are of angle, pressure 1, pressure 2, joint after joint."""


def sentences(events: Sequence[Event], quantities: Sequence[str]) -> list[str]:
    """Return the ``events`` that matter to people as sentences; attempts that changed nothing are left out."""
    lines = []
    for event in events:
        found = event.figures
        if event.what == "noticed":
            ratio = np.array(found["ratio"])
            worst = int(ratio.argmax())
            lines.append(
                f"the arm has changed: noticed after movement {event.movement}, since about movement "
                f"{found['since'] + 1} (error of {quantities[worst].replace('_', ' ')} {ratio[worst]:.1f} times that "
                "of the fit)"
            )
        elif event.what == "accepted":
            told = [np.array(found[name]) for name in ("before", "after")]
            before, after = (float(np.exp(np.log(one[one > 0]).mean())) for one in told)  # 0: a muscle not there
            lines.append(
                f"version {event.version} after movement {event.movement}: fitted to {found['movements']} movements, "
                f"error {after:.2f} instead of {before:.2f} times that of the fit"
            )
        elif event.what == "rolled back":
            lines.append(
                f"version {found['taken_back']} rolled back after movement {event.movement}: its movements "
                f"earned {found['reward_after']:.2f} instead of {found['reward_before']:.2f}; again version "
                f"{event.version}"
            )
    return lines

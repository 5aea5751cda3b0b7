"""The options of a reset: what may be chosen for the episode that begins."""

from collections.abc import Mapping
from reprlib import repr as shortened
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.task.goals import goal_in_counts


def known_options(options: object, *known: str) -> Mapping[str, Any]:
    """Return ``options``, none where they are None; UnusableInput where there is another than those ``known``."""
    if options is None:
        return {}
    if not isinstance(options, Mapping) or options.keys() - set(known):
        raise UnusableInput(f"options= takes {' or '.join(known)}, by name, got {shortened(options)}")
    return options


def chosen_goal(options: object, spec: ArmSpec, goals: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the goal (joints,) [counts] that ``options`` choose within ``goals`` (joints, 2); None where none is."""
    given = known_options(options, "goal", "goal_deg")
    return goal_in_counts(given.get("goal"), given.get("goal_deg"), spec, goals) if given else None

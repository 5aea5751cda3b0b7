"""Controllers that move to goals and follow references, by their name on the command line."""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import Arm, ArmSpec
from pneumarm.arm.controller import TrackingController
from pneumarm.classical import is_tuned, load_tuned
from pneumarm.control.agent import AgentController, warm_up
from pneumarm.control.open_agent import open_agent
from pneumarm.control.transfer import check_fit
from pneumarm.errors import UnusableInput
from pneumarm.learning import Tracks
from pneumarm.moving import Holding, at_period
from pneumarm.planning.agent import PlanAgent

_PLAN = "plan:"


def open_tracking(
    name: str, arm: Arm, tolerance: float = 1.0, method: str | None = None
) -> tuple[TrackingController, ArmSpec, NDArray[np.float64]]:
    """Return the controller called ``name`` for ``arm``, the arm's spec, and the goals (joints, 2) [counts] it knows.

    ``name`` is the file of an agent or of a tuned controller, or ``plan:SIM``. The arm, not yet guarded, is
    controlled with the period that a tuned controller was tuned for.

    Args:
        name: of the controller.
        arm: as it was opened.
        tolerance: within which a controller that only reaches goals is made to hold them [degrees].
        method: of one's own that trained the agent, MODULE:NAME, if it is not installed.

    Raises:
        UnusableInput: there is no such controller, or it is for another arm.

    """
    path = Path(name.removeprefix(_PLAN))
    if not path.exists():
        raise UnusableInput(
            f"controller {name!r}: expected the file of an agent, a file from `pneumarm tune`, or plan:SIM; there is "
            f"no file {path}"
        )
    if is_tuned(path):
        tuned = load_tuned(path)
        tuned.check_fit(arm)
        if not math.isclose(arm.spec.period, tuned.spec.period, rel_tol=1e-3):
            at_period(arm, tuned.spec.period)
        return tuned.controller(), arm.spec, tuned.goal_range
    agent = PlanAgent.load(path) if name.startswith(_PLAN) else open_agent(path, method)
    check_fit(agent, arm)
    if isinstance(agent, Tracks):
        return agent.controller(), arm.spec, agent.goal_range
    warm_up(agent)
    return Holding(AgentController(agent), arm.spec, agent.goal_range, tolerance), arm.spec, agent.goal_range

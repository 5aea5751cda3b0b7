"""Controllers that move to goals and follow references: by their name on the command line, or as they are."""

import math
from pathlib import Path

from pneumarm.arm import Arm, ArmSpec
from pneumarm.arm.controller import TrackingController
from pneumarm.classical import Tuned, is_tuned, load_tuned
from pneumarm.control.agent import AgentController, warm_up
from pneumarm.control.open_agent import open_agent
from pneumarm.control.transfer import check_fit
from pneumarm.control.versions import agent_file
from pneumarm.errors import UnusableInput
from pneumarm.files import kind_of
from pneumarm.learning import AnyAgent
from pneumarm.learning.agents import goals_of
from pneumarm.learning.inverse.agent import InverseAgent
from pneumarm.learning.planned.servo import PlannedServo
from pneumarm.moving import Holding, at_period
from pneumarm.simulation.simulation import KIND as SIMULATION
from pneumarm.transitions.goals import Goals
from pneumarm.transitions.store import Store

_PLAN, _INVERSE = "plan:", "inverse:"


def open_tracking(
    name: str, arm: Arm, tolerance: float = 1.0, method: str | None = None
) -> tuple[TrackingController, ArmSpec, Goals]:
    """Return the controller called ``name`` for ``arm``, the arm's spec, and the goals it knows.

    ``name`` is the file of an agent or of a tuned controller, the folder of a run, whose agent is taken,
    ``plan:SIM``, or ``inverse:DB``, which fits the inverse simulation to a store; see :func:`tracking_for` for the
    rest.

    Args:
        name: of the controller.
        arm: as it was opened.
        tolerance: within which a controller that only reaches goals is made to hold them [degrees].
        method: of one's own that trained the agent, MODULE:NAME, if it is not installed.

    Raises:
        UnusableInput: there is no such controller, or it is for another arm.

    """
    if name.startswith(_INVERSE):
        with Store.open(name.removeprefix(_INVERSE)) as store:
            return tracking_for(InverseAgent.of(store), arm, tolerance)
    path = Path(name.removeprefix(_PLAN))
    if not name.startswith(_PLAN):
        path = agent_file(path)
    if not path.is_file():
        raise UnusableInput(
            f"controller {name!r}: expected the folder of a run, the file of an agent, a file from `pneumarm tune`, "
            f"plan:SIM or inverse:DB; there is no file {path}"
        )
    if name.startswith(_PLAN):
        return tracking_for(PlannedServo.load(path), arm, tolerance)
    if is_tuned(path):
        return tracking_for(load_tuned(path), arm, tolerance)
    if kind_of(path) == SIMULATION:
        raise UnusableInput(
            f"controller {name!r}: is a simulation; {_PLAN}{name} plans in it, `pneumarm train` trains an agent in it"
        )
    return tracking_for(open_agent(path, method), arm, tolerance)


def tracking_for(
    made: AnyAgent | InverseAgent | PlannedServo | Tuned, arm: Arm, tolerance: float = 1.0
) -> tuple[TrackingController, ArmSpec, Goals]:
    """Return what was trained or tuned as a controller for ``arm``, the arm's spec, and the goals it knows.

    The arm, not yet guarded, is controlled with the period that a tuned controller was tuned for.

    Raises:
        UnusableInput: it is for another arm.

    """
    if isinstance(made, Tuned):
        made.check_fit(arm)
        if not math.isclose(arm.spec.period, made.spec.period, rel_tol=1e-3):
            at_period(arm, made.spec.period)
        return made.controller(), arm.spec, Goals.of(made.goal_range)
    check_fit(made, arm)
    if (own := made.controller()) is not None:
        return own, arm.spec, goals_of(made)
    assert not isinstance(made, PlannedServo)  # which settles
    warm_up(made)
    return Holding(AgentController(made), arm.spec, made.goal_range, tolerance), arm.spec, goals_of(made)

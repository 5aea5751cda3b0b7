"""Who collects: controllers by their name on the command line."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from pneumarm.arm import Arm, Controller
from pneumarm.control.agent import controller_of, warm_up
from pneumarm.control.open_agent import open_agent
from pneumarm.control.transfer import check_fit
from pneumarm.errors import UnusableInput
from pneumarm.files import read_rows
from pneumarm.transitions import Keyboard, Trajectory


@contextmanager
def open_controller(name: str, arm: Arm, method: str | None = None) -> Iterator[Controller | None]:
    """Give the controller called ``name`` for ``arm`` (thesis section 3.2.2 names all of these).

    ``random`` is None, random actions; ``keyboard`` a person at the terminal; a CSV file predefined trajectories, a
    column a muscle of -1, 0, +1 or pulses in between, a row a control period; any other file an agent, to be
    improved, which a ``method`` of one's own may have trained.

    Raises:
        UnusableInput: there is no such controller, or it is for another arm.

    """
    if name == "random":
        yield None
    elif name == "keyboard":
        with Keyboard(arm.spec.joints) as keyboard:
            yield keyboard
    elif name.endswith(".csv"):
        yield read_trajectory(Path(name), arm.spec.joints)
    else:
        agent = open_agent(Path(name), method)
        check_fit(agent, arm)
        warm_up(agent)
        yield controller_of(agent)


def read_trajectory(path: Path, joints: int) -> Trajectory:
    """Return the trajectory in a CSV file with ``2 * joints`` columns of commands and no header.

    Raises:
        UnusableInput: the file cannot be read or holds something else.

    """
    expected = f"{2 * joints} columns of valves -1, 0 or 1, or pulses in between, a row a control period"
    cells = read_rows(path, expected)
    try:
        rows = [[float(cell) for cell in row] for row in cells]
        return Trajectory(np.array(rows).reshape(len(rows), joints, 2))
    except ValueError as error:
        raise UnusableInput(f"{path}: expected {expected}; {error}") from error

"""pneumarm: learn to control an arm moved by pneumatic muscles, from its own recordings."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pneumarm.arm import Controller

__version__ = "0.1.0"


def load_controller(file: str | Path) -> "Controller":
    """Return the controller in ``file``, a greedy agent or a tuned one: ``reset(goal)``, ``act(reading) -> valves``.

    It has made its first turns when it is returned: an arm that waits for it waits for nothing to be compiled.
    """
    from pneumarm.classical import is_tuned, load_tuned
    from pneumarm.control.agent import controller_of, warm_up
    from pneumarm.control.open_agent import open_agent

    path = Path(file)
    if is_tuned(path):
        return load_tuned(path).controller()
    opened = open_agent(path)
    warm_up(opened)
    return controller_of(opened)

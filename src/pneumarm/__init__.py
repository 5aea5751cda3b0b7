"""pneumarm: learn to control an arm moved by pneumatic muscles, from its own recordings."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pneumarm.control.agent import AgentController

__version__ = "0.1.0"


def load_controller(agent: str | Path) -> "AgentController":
    """Return the greedy controller in the file ``agent``: ``reset(goal)``, then ``act(reading) -> valves``.

    It has made its first turns when it is returned: an arm that waits for it waits for nothing to be compiled.
    """
    from pneumarm.control.agent import AgentController, warm_up
    from pneumarm.control.open_agent import open_agent

    opened = open_agent(Path(agent))
    warm_up(opened)
    return AgentController(opened)

"""``pneumarm transfer``."""

from pathlib import Path
from typing import Annotated

from pneumarm.arm import open_arm
from pneumarm.commands.common import Json, Monitoring, OwnMethod, Settings, move_command
from pneumarm.commands.figures import reaching_table
from pneumarm.commands.versions_ import say_history
from pneumarm.console import say, show
from pneumarm.control import TransferSettings, open_agent, transfer_into
from pneumarm.control.condition import complaints
from pneumarm.control.versions import ADAPTED
from pneumarm.progress import progress


def transfer_(
    agent: Path,
    /,
    *,
    arm: str,
    seed: int = 0,
    out: Path = Path("pneumarm-transfer"),
    method: OwnMethod = None,
    monitor: Monitoring = "stop",
    settings: Annotated[TransferSettings, Settings] = TransferSettings(),
    json: Json = False,
) -> None:
    """Move an agent onto an arm: test it there, let it learn there, test it again. A second call goes on.

    A goal counts as reached, a success, at a reading after at least one action where every joint is within 25 counts
    of it and not faster than 1 count/ms, unless the agent was trained with other tolerances.

    Parameters
    ----------
    agent
        The agent, from ``pneumarm train``.
    arm
        virtual, virtual:seed=N, serial:PORT, simulation:FILE or python:module:callable.
    seed
        Random seed of begin states, goals and exploration, and of a virtual arm's noise.
    out
        Folder for episodes.csv, the store of all movements and the adapted agent; created if it does not exist.
    method
        The method that trained it, MODULE:NAME, if that is one of your own that is not installed.
    """
    trained = open_agent(agent, method)
    with open_arm(arm, seed) as opened, progress("moving on the arm") as report:
        result = transfer_into(out, trained, opened, settings, seed=seed, progress=report, monitor=monitor)
    say_history(out)
    for line in complaints(result, "moving"):
        say(line)
    ready = move_command(out, arm, trained.spec, trained.goal_range)
    say(f"adapted agent: {out / ADAPTED}; move the arm by it with {ready}")
    phases = {"on arrival": result["before"], "after adaptation": result["after"]}
    show(result, json, lambda: [reaching_table(phases, trained_for=not trained.settles)])

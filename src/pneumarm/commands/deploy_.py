"""``pneumarm deploy``."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pneumarm.commands.common import Json
from pneumarm.console import say, show, table
from pneumarm.control import open_agent
from pneumarm.control.deploy import BOARDS, FIRMWARE, deploy

_OTHERWISE = 4.0  # ms that a recording's latency may differ from a decision's


def deploy_(
    agent: Path,
    /,
    *,
    board: Annotated[str, Parameter(help=f"Which board: {', '.join(BOARDS)}.")] = "uno",
    out: Path = Path("build"),
    firmware: Path = FIRMWARE,
    json: Json = False,
) -> None:
    """Build a program by which a board moves its arm with an agent, without a computer; needs avr-gcc and make.

    Its flash, RAM and time are checked. Write it onto the board with ``pneumarm arm flash PORT --agent AGENT``.

    Parameters
    ----------
    agent
        The agent, trained to settle, of an arm with one joint.
    out
        Folder for the program; created if it does not exist.
    firmware
        Folder of the boards' sources, as in a checkout of pneumarm.
    """
    opened = open_agent(agent)
    built, has = deploy(opened, board, out, firmware), BOARDS[board]
    if abs(1e3 * opened.spec.latency - built.milliseconds) > _OTHERWISE:
        say(
            f"recorded with {1e3 * opened.spec.latency:.0f} ms from a reading to the valves: an agent of a recording "
            f"with latency = {1e-3 * built.milliseconds:.3f} in arm.toml settles faster on this board"
        )
    result = {
        "hex": str(built.hex),
        "flash": built.flash,
        "memory": built.memory,
        "weights": built.weights,
        "milliseconds": round(built.milliseconds, 1),
    }
    rows = [
        ("program", str(built.hex)),
        ("flash", f"{built.flash} of {has.flash} bytes"),
        ("RAM", f"{built.memory} and {has.stack} of stack, of {has.memory} bytes"),
        ("weights of 8 bits", str(built.weights)),
        ("a decision", f"{built.milliseconds:.0f} ms"),
    ]
    show(result, json, lambda: [table(("deployed", ""), rows, board)])

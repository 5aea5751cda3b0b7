"""``pneumarm export``."""

from pathlib import Path
from typing import Any

from pneumarm.commands.common import Json, OwnMethod
from pneumarm.console import show, table
from pneumarm.control import open_agent
from pneumarm.errors import UnusableInput
from pneumarm.files import require_folder, write_text
from pneumarm.learning.servo.agent import ServoAgent
from pneumarm.learning.servo.as_c import as_c
from pneumarm.transitions import Store
from pneumarm.transitions.export import FORMATS, export_recording


def export_(file: Path, /, *, out: Path, method: OwnMethod = None, json: Json = False) -> None:
    """Export a recording as CSV or Parquet, or an agent as C, for other programs.

    Parameters
    ----------
    file
        The store, or the agent.
    out
        File to write: .csv (with a .toml beside it, by which it is imported again) or .parquet of a store, .c of an
        agent that settles, holds and tracks: its network and scaling as C99 that needs no library.
    method
        The method that trained the agent, MODULE:NAME, if that is one of your own that is not installed.
    """
    require_folder(out)
    result: dict[str, Any]
    if out.suffix in FORMATS:
        with Store.open(file) as store:
            result = export_recording(store, out)._asdict()
    elif out.suffix == ".c":
        agent = open_agent(file, method)
        if not isinstance(agent, ServoAgent):
            raise UnusableInput(f"{file}: only agents of the method servo are exported as C")
        write_text(out, as_c(agent))
        result = {"weights": len(agent.policy), "inputs": agent.sizes[0], "period": agent.spec.period}
    else:
        raise UnusableInput(f"{out}: expected a file that ends in {', '.join(FORMATS)} (a store) or .c (an agent)")
    show(result, json, lambda: [table(("exported", ""), list(result.items()), str(out))])

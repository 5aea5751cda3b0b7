"""``pneumarm export``."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from pneumarm.address import Address, ServerAddress
from pneumarm.commands.common import AnyStore, Json, OwnMethod
from pneumarm.console import show, table
from pneumarm.control import open_agent
from pneumarm.errors import UnusableInput
from pneumarm.files import write_bytes, write_text
from pneumarm.learning.as_onnx import as_onnx
from pneumarm.learning.network_agent import NetworkAgent
from pneumarm.learning.servo.agent import ServoAgent
from pneumarm.learning.servo.as_c import as_c
from pneumarm.transitions import Store
from pneumarm.transitions.export import FORMATS, export_recording
from pneumarm.transitions.schema import is_store

_OUT = (
    f"What to write. From a store: {', '.join(f'{end} ({one.words})' for end, one in FORMATS.items())}. From an "
    "agent: .onnx, its network and scaling, or .c, the same as plain C99, if it settles, holds and tracks."
)


def export_(
    file: AnyStore, /, *, out: Annotated[Path, Parameter(help=_OUT)], method: OwnMethod = None, json: Json = False
) -> None:
    """Export a recording (CSV, Parquet, LeRobot and others) or an agent (ONNX, C) for other programs.

    Parameters
    ----------
    file
        The store, or the agent.
    method
        The method that trained the agent, MODULE:NAME, if that is one of your own that is not installed.
    """
    result: dict[str, Any]
    if out.suffix in FORMATS:
        with Store.open(file) as store:
            result = export_recording(store, out)._asdict()
    elif out.suffix in (".c", ".onnx"):
        if isinstance(file, ServerAddress):
            raise _no_agent(file)
        if is_store(file):
            raise _no_agent(file)
        agent = open_agent(file, method)
        if not isinstance(agent, NetworkAgent):
            raise UnusableInput(f"{file}: only agents of the methods servo and policy can be exported")
        if out.suffix == ".onnx":
            write_bytes(out, as_onnx(agent))
        elif isinstance(agent, ServoAgent):
            write_text(out, as_c(agent))
        else:
            raise UnusableInput(f"{file}: only agents of the method servo are exported as C")
        result = {"weights": len(agent.policy), "inputs": agent.sizes[0], "period": agent.spec.period}
    else:
        raise UnusableInput(
            f"{out}: expected a name that ends in {', '.join(FORMATS)} (a store), .onnx or .c (an agent)"
        )
    rows = [(_WORDS.get(name, name), value) for name, value in result.items() if value is not None]
    show(result, json, lambda: [table(("exported", ""), rows, str(out))])


def _no_agent(store: Address) -> UnusableInput:
    return UnusableInput(
        f"{store}: this is a store, and expected is the file of an agent; of a store export {', '.join(FORMATS)}"
    )


_WORDS = {"mapping": "imported again by", "period": "control period [s]"}

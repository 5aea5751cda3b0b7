"""What the commands share."""

from typing import Annotated

from cyclopts import Parameter

Json = Annotated[
    bool, Parameter(name="--json", negative="", help="Print one JSON object on stdout and nothing else there.")
]
"""The flag that every command has."""
Settings = Parameter(name="*")
"""Marks a dataclass of settings whose fields become options."""
OwnMethod = Annotated[str | None, Parameter(name="--method")]
"""The option of commands that open an agent: MODULE:NAME of the method that trained it, whose code may run."""
COLUMNS = ("episodes", "reward", "success_rate", "actions", "switches")
"""Figures of movements that tables show."""

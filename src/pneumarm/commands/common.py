"""What the commands share."""

from typing import Annotated

from cyclopts import Parameter

from pneumarm.control.monitor.settings import Mode

Json = Annotated[
    bool, Parameter(name="--json", negative="", help="Print one JSON object on stdout and nothing else there.")
]
"""The flag that every command has."""
Settings = Parameter(name="*")
"""Marks a dataclass of settings whose fields become options."""
OwnMethod = Annotated[str | None, Parameter(name="--method")]
"""The option of commands that open an agent: MODULE:NAME of the method that trained it, whose code may run."""
Monitoring = Annotated[
    Mode,
    Parameter(
        name="--monitor",
        help="stop: mark what a fault spoils, and give up where it lasts; warn: only tell; off: do not look.",
    ),
]
"""What is done about faults of an arm that are found while it moves."""
COLUMNS = ("episodes", "reward", "success_rate", "actions", "switches")
"""Figures of movements that tables show."""

"""``pneumarm report``."""

from pathlib import Path

from pneumarm.commands.common import Json
from pneumarm.console import show
from pneumarm.progress import progress
from pneumarm.report.run_report import write_report


def report_(folder: Path, /, *, json: Json = False) -> None:
    """Rewrite the report of a finished run.

    Parameters
    ----------
    folder
        The folder of the run.
    """
    with progress("drawing"):
        page = write_report(folder)
    show({"report": str(page)}, json, lambda: [str(page)])

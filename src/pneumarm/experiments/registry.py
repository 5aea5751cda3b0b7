"""Experiments by name, loaded when they are asked for."""

import importlib
import re
from pathlib import Path

from pneumarm.errors import UnusableInput
from pneumarm.experiments.experiment import Experiment

PLACES = {
    file.parent.name.replace("_", "-"): file.parent.name
    for file in sorted(Path(__file__).parent.glob("*/__init__.py"))
    if re.search(r"^EXPERIMENT = ", file.read_text(encoding="utf-8"), re.MULTILINE)
}
"""Packages below this one that have an ``EXPERIMENT``, by its name; read as text, so that none is loaded for it."""


def experiment(name: str) -> Experiment:
    """Return the experiment called ``name``.

    Raises:
        UnusableInput: there is none.

    """
    if name not in PLACES:
        raise UnusableInput(f"no experiment {name!r}; there are {', '.join(PLACES)}")
    found: Experiment = importlib.import_module(f"pneumarm.experiments.{PLACES[name]}").EXPERIMENT
    return found

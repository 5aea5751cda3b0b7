"""The files in a run's folder that its report is made of, by their names, beside the records."""

from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import msgspec

from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.files import read_json, write_json
from pneumarm.report.data import Demonstration

REPORT = "report.html"
ANALYSIS = "analysis.html"
RESULTS = "results.json"
EPISODES = "episodes.csv"
SPEC = "arm.json"
TEST = "test_episodes.safetensors"
DEMONSTRATIONS = "demonstration-*.safetensors"


_TABLES = ("collect", "filter", "simulation", "training", "test", "transfer", "wall_seconds", "compile_seconds")


def read_results(folder: Path) -> dict[str, Any]:
    """Return the results of the run in ``folder``; raises UnusableInput where they are something else."""
    results = read_json(folder / RESULTS, "the results of a finished run")
    if wrong := [name for name in _TABLES if not isinstance(results.get(name, {}), dict)]:
        raise UnusableInput(f"{folder / RESULTS}: expected tables of figures; {', '.join(wrong)} is none")
    return results


def write_spec(folder: Path, spec: ArmSpec) -> None:
    """Write what the report must know of the arm to ``folder``."""
    write_json(folder / SPEC, asdict(spec))


def save_demonstration(folder: Path, shown: Demonstration, number: int) -> None:
    """Write a demonstration to ``folder``; the report shows them in the order of their ``number``."""
    shown.save(folder, DEMONSTRATIONS.replace("*", f"{number:02d}"))


_KNOWN = {field.name for field in fields(ArmSpec)}  # of an arm


def read_spec(path: Path) -> ArmSpec:
    """Return what :func:`write_spec` wrote to ``path``; raises UnusableInput where it is something else."""
    stored = read_json(path, "the spec of an arm")
    try:
        if "angle_range" not in stored or set(stored) - _KNOWN:
            raise UnusableInput(f"it has {', '.join(stored)}")
        return msgspec.convert(stored, ArmSpec)
    except (msgspec.ValidationError, UnusableInput) as error:
        raise UnusableInput(f"{path}: expected the spec of an arm, {error}") from error

"""The files in a run's folder that its report is made of, by their names, beside the records."""

from dataclasses import asdict, fields
from pathlib import Path

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


def save_spec(folder: Path, spec: ArmSpec) -> None:
    """Write what the report must know of the arm to ``folder``."""
    write_json(folder / SPEC, asdict(spec))


def save_demonstration(folder: Path, shown: Demonstration, number: int) -> None:
    """Write a demonstration to ``folder``; the report shows them in the order of their ``number``."""
    shown.save(folder, DEMONSTRATIONS.replace("*", f"{number:02d}"))


_KNOWN = {field.name for field in fields(ArmSpec)}  # of an arm


def read_spec(path: Path) -> ArmSpec:
    """Return what :func:`save_spec` wrote to ``path``; raises UnusableInput where it is something else."""
    stored = read_json(path, "the spec of an arm")
    try:
        if "angle_range" not in stored or set(stored) - _KNOWN:
            raise UnusableInput(f"it has {', '.join(stored)}")
        return msgspec.convert(stored, ArmSpec)
    except (msgspec.ValidationError, UnusableInput) as error:
        raise UnusableInput(f"{path}: expected the spec of an arm, {error}") from error

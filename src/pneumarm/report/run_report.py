"""The report of a run: from the files in its folder to one HTML page."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from pneumarm.arm.seam import ArmSpec
from pneumarm.control.versions import HISTORY, read_history
from pneumarm.errors import UnusableInput
from pneumarm.files import write_json, write_text
from pneumarm.report.data import (
    CoverageData,
    Demonstration,
    MarkedData,
    MovingData,
    QualityData,
    Record,
    TrainingData,
    TransferData,
)
from pneumarm.report.health import summary_of_health
from pneumarm.report.page import Section, render
from pneumarm.report.sections import (
    RunData,
    all_sections,
    arrival_words,
    collected,
    moving_words,
    one_step,
    predicted,
    predicted_words,
    propagated,
)
from pneumarm.task.movements import Movements, movements, read_episodes

REPORT = "report.html"
ANALYSIS = "analysis.html"
RESULTS = "results.json"
EPISODES = "episodes.csv"
SPEC = "arm.json"
TEST = "test_episodes.safetensors"
DEMONSTRATIONS = "demonstration-*.safetensors"

_Record = TypeVar("_Record", bound=Record)


def write_report(folder: Path, drawn: Sequence[Section] | None = None) -> Path:
    """Write ``report.html`` of the run in ``folder`` and return its path.

    ``drawn`` are its sections on what was learned, if they have been drawn already.

    The folder holds ``results.json`` and ``arm.json`` (:func:`save_spec`); what else there is of the records
    (:class:`CoverageData`, ...), of ``episodes.csv`` and of demonstrations (:func:`save_demonstration`) enters it.

    Raises:
        UnusableInput: a file is missing or is not what it should be.

    """
    path = folder / REPORT
    write_text(path, run_page(read_run(folder), drawn))
    return path


def write_analysis(
    folder: Path, spec: ArmSpec, coverage: CoverageData, quality: QualityData, found: Mapping[str, Any]
) -> Path:
    """Write ``analysis.html``, the part of the report on a store and a simulation, to ``folder``."""
    path = folder / ANALYSIS
    sections = [
        one_step(quality, spec),
        collected(coverage, spec),
        predicted(quality, spec),
        propagated(quality, spec, found),
    ]
    summary = predicted_words(quality, spec)
    write_text(path, render(f"The simulation of {spec.name}", summary, sections))
    return path


def run_page(run: RunData, drawn: Sequence[Section] | None = None) -> str:
    """Return the HTML page of ``run``; ``drawn`` are its sections on what was learned, if there are such already."""
    return render(f"An arm learns to move: {run.spec.name}", _summary(run), all_sections(run, drawn))


def save_spec(folder: Path, spec: ArmSpec) -> None:
    """Write what the report must know of the arm to ``folder``."""
    write_json(folder / SPEC, asdict(spec))


def save_demonstration(folder: Path, shown: Demonstration, number: int) -> None:
    """Write a demonstration to ``folder``; the report shows them in the order of their ``number``."""
    shown.save(folder, DEMONSTRATIONS.replace("*", f"{number:02d}"))


def read_run(folder: Path) -> RunData:
    """Return what the report of the run in ``folder`` is made of.

    Raises:
        UnusableInput: a file is missing or is not what it should be.

    """
    results = _read_json(folder / RESULTS)
    return RunData(
        spec=read_spec(folder / SPEC),
        results=results,
        coverage=_read(CoverageData, folder),
        quality=_read(QualityData, folder),
        training=_read(TrainingData, folder),
        test=Movements.load(folder / TEST) if (folder / TEST).exists() else None,
        transfer=_read_transfer(folder / EPISODES, results),
        adaptation=read_history(folder) if (folder / HISTORY).exists() else None,
        marked=_read(MarkedData, folder),
        moving=_read(MovingData, folder),
        demonstrations=tuple(Demonstration.load(folder, path.name) for path in sorted(folder.glob(DEMONSTRATIONS))),
    )


def _read(record: type[_Record], folder: Path) -> _Record | None:
    return record.load(folder) if (folder / record.file).exists() else None


def _read_transfer(path: Path, results: dict[str, Any]) -> TransferData | None:
    if not path.exists():
        return None
    phases = read_episodes(path)
    joints = next(iter(phases.values())).goal.shape[1] if phases else 1
    before, learning, after = (phases.get(name) or movements(0, joints) for name in ("before", "learning", "after"))
    found = results.get("transfer", {})
    rate, adaptations = float(found.get("learning_rate", 0.0)), int(found.get("adaptations", 0))
    return TransferData(before, learning, after, rate, adaptations)


_KNOWN = {field.name for field in fields(ArmSpec)}  # of an arm


def read_spec(path: Path) -> ArmSpec:
    """Return what :func:`save_spec` wrote to ``path``; raises UnusableInput where it is something else."""
    stored = _read_json(path)
    try:
        if not isinstance(stored, dict) or "angle_range" not in stored or set(stored) - _KNOWN:
            raise UnusableInput(f"it has {', '.join(stored)}")
        return msgspec.convert(stored, ArmSpec)
    except (msgspec.ValidationError, UnusableInput) as error:
        raise UnusableInput(f"{path}: expected the spec of an arm, {error}") from error


def _read_json(path: Path) -> dict[str, Any]:
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UnusableInput(f"{path}: expected a JSON file of a run; finish the run first ({error})") from error
    if not isinstance(value, dict):
        raise UnusableInput(f"{path}: expected a JSON object, got {type(value).__name__}")
    return value


def _summary(run: RunData) -> list[str]:
    spec = run.spec
    joints = f"{spec.joints} joint{'s' if spec.joints > 1 else ''}"
    text = [f"{spec.name}: {joints}, {1 / spec.period:.3g} Hz, pressures up to {spec.max_pressure:.3g} bar."]
    if not spec.pressure_sensors:
        text.append(
            "Its pressures are not measured: wherever they are shown, they are estimated from what the valves were "
            "told. The guard could not limit them, and the monitor judged angles alone: neither valves, nor the "
            "supply, nor leaks."
        )
    return [*(moving_words(run.results) or arrival_words(run)), *text, *summary_of_health(run.results)]

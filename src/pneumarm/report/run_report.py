"""The report of a run: from the files in its folder to one HTML page."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pneumarm.arm.seam import ArmSpec
from pneumarm.control.versions import HISTORY, read_history
from pneumarm.files import write_text
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
from pneumarm.report.files import (
    ANALYSIS,
    DEMONSTRATIONS,
    EPISODES,
    REPORT,
    SPEC,
    TEST,
    read_results,
    read_spec,
)
from pneumarm.report.front import headline, lights
from pneumarm.report.page import Section, render
from pneumarm.report.sections import (
    RunData,
    all_sections,
    coverage_section,
    one_step,
    predicted_words,
    propagated,
    simulation_section,
)
from pneumarm.task.movements import Movements, movements, read_episodes

_Record = TypeVar("_Record", bound=Record)


def write_report(folder: Path, drawn: Mapping[str, Sequence[Section]] | None = None) -> Path:
    """Write ``report.html`` of the run in ``folder`` and return its path.

    ``drawn`` are parts of it that have been drawn already, as in :data:`~.sections.PARTS`.

    The folder holds ``results.json`` and ``arm.json`` (:func:`~.files.write_spec`); what else there is of the records
    (:class:`CoverageData`, ...), of ``episodes.csv`` and of demonstrations (:func:`~.files.save_demonstration`)
    enters it.

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
        coverage_section(coverage, spec),
        simulation_section(quality, spec),
        propagated(quality, spec, found),
    ]
    summary = predicted_words(quality, spec)
    write_text(path, render(f"The simulation of {spec.name}", summary, sections))
    return path


def run_page(run: RunData, drawn: Mapping[str, Sequence[Section]] | None = None) -> str:
    """Return the HTML page of ``run``; ``drawn`` as of :func:`write_report`."""
    title = f"An arm learns to move: {run.spec.name}"
    return render(title, _summary(run), all_sections(run, drawn), headline(run), lights(run))


def read_run(folder: Path) -> RunData:
    """Return what the report of the run in ``folder`` is made of.

    Raises:
        UnusableInput: a file is missing or is not what it should be.

    """
    results = read_results(folder)
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


def _summary(run: RunData) -> list[str]:
    """Return what the large figures are of."""
    spec, found = run.spec, run.results.get("settle") or {}
    words = f"{spec.joints} joint{'s' if spec.joints > 1 else ''}, {1 / spec.period:.3g} Hz, "
    words += f"pressures up to {spec.max_pressure:.3g} bar"
    if found:
        words += f"; {found['valve_changes_per_second']:.1f} valve changes a second while it moves and holds"
    if (air := found.get("air_litres_per_movement")) is not None:
        words += f", and {air:.2f} normal litres of air a movement"
    text = [f"{words}."]
    if not spec.pressure_sensors:
        text.append(
            "Its pressures are not measured: wherever they are shown, they are estimated from what the valves were "
            "told. The guard could not limit them, and the monitor judged angles alone: neither valves, nor the "
            "supply, nor leaks."
        )
    return text

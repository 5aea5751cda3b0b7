"""Running what the page of claims rests on: which experiments, which arms, and the rows that are published.

A **pilot** takes the first five arms of each kind, as many as its time allows. From the spread that it finds follows
how many arms each experiment needs (:meth:`.Criterion.arms_needed`); these numbers are written to ``arms.json`` once,
before any further row is computed, so that nobody stops where it pleases. The **full** size takes that many.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec

from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.experiments.claims.replica import by_test, chosen_test
from pneumarm.experiments.experiment import Experiment, LaboratorySettings, Row, TrialRows, sorted_rows
from pneumarm.experiments.preparation import SETTINGS
from pneumarm.experiments.registry import experiment
from pneumarm.experiments.results import Results
from pneumarm.experiments.row_file import read_trial_rows
from pneumarm.experiments.sweep import ROWS, sweep
from pneumarm.experiments.trainings import Trainings
from pneumarm.experiments.verdict import FEWEST_ARMS
from pneumarm.files import make_folder, read_bytes, read_json, write_bytes, write_json
from pneumarm.progress import Display

Size = Literal["pilot", "full"]
ORDER = (
    *("optimal-settings", "all-goals", "no-shaping", "switch-punishment", "goal-area", "displacement"),
    *("transferability", "transfer", "long-training", "shaping-settings", "fine-tuning", "valves-closed"),
    *("noise-for-transfer", "control-frequency", "state-history", "enough-data", "overnight"),
    *("goal-pairs", "joint-exploration", "joint-agents", "hierarchy", "coupling", "joint-data"),
    *("calibration", "on-the-arm-only", "joint-data-long"),
)
"""Experiments, about the cheapest first."""
KINDS = {
    "thesis-like": ("virtual:seed={}", "virtual:joints=2,seed={}"),
    "wide": ("virtual:wide,seed={}", ""),
    "foreign physics": ("python:benchmarks.strangers:one_{}", "python:benchmarks.strangers:two_{}"),
}
"""Names of arms by their kind, of one joint and of two."""
THESIS_LIKE = next(iter(KINDS))
RowsByKind = Mapping[str, Mapping[str, TrialRows]]
"""Rows by kind of arm and experiment."""
PLAN = "arms.json"
_MOST = 40  # arms
_HOURS: dict[Size, float] = {"pilot": 1.0, "full": 8.0}
"""Processor time of an experiment on arms of a kind; no arm is begun that would exceed it."""


class Sizes(NamedTuple):
    """How much is run."""

    size: Size
    kinds: tuple[str, ...] = tuple(KINDS)
    workers: int | None = None
    dask: str | None = None
    settings: LaboratorySettings = LaboratorySettings()


def kind_of(arm: str) -> str:
    """Return the kind of an arm by its name."""
    if arm.startswith("virtual"):
        return "wide" if "wide" in arm else THESIS_LIKE
    return "foreign physics" if "benchmarks.strangers" in arm else "your own"


def arms_of(chosen: Experiment, kind: str, count: int) -> list[str]:
    """Return the names of the first ``count`` arms of a ``kind`` with the joints that an experiment needs."""
    name = KINDS[kind]["joints" in chosen.arms[0]]
    return [name.format(number) for number in range(1, count + 1)] if name else []


def run(sizes: Sizes, laboratory: Path, rows: Path, progress: Display, tell: Callable[[str], None]) -> None:
    """Compute the rows that ``laboratory`` lacks and copy what is complete to the folder ``rows``; resumable.

    What is published already is taken up, not computed again. What an arm cannot do is told, and left out.
    """
    for name in ORDER:
        if (rows / name / ROWS).exists() and not (laboratory / name / ROWS).exists():
            _copy(name, read_trial_rows(rows / name / ROWS), rows, laboratory)
    compute = partial(sweep, workers=sizes.workers, dask=sizes.dask, progress=progress)
    planned = plan(rows) if sizes.size == "full" else {}
    for kind in sizes.kinds:
        for name in ORDER:
            chosen = experiment(name)
            count = planned.get(name, {}).get(kind, FEWEST_ARMS) if sizes.size == "full" else FEWEST_ARMS
            folder = laboratory / name
            settings = replace(sizes.settings, exploring=isinstance(chosen, Trainings))
            arms = arms_of(chosen, kind, count)
            for before, arm in enumerate(arms):
                spent = sum(row.seconds for row in read_trial_rows(folder / ROWS) if row.arm in arms[:before])
                if spent * (1 + 1 / max(before, 1)) > 3600 * _HOURS[sizes.size]:
                    tell(f"{name}: its time on {kind} arms is over, without {arm}")
                    break
                try:
                    compute(chosen, laboratory, [arm], settings=settings)
                except PneumarmError as error:
                    tell(f"{name}: not on {arm}: {error}")
            publish_rows(laboratory, rows, (name,))


def publish_rows(laboratory: Path, rows: Path, names: Sequence[str] = ORDER) -> None:
    """Copy to the folder ``rows`` the arms of experiments in ``laboratory`` that are complete."""
    for name in names:
        if found := complete(experiment(name), read_trial_rows(laboratory / name / ROWS)).rows:
            _copy(name, found, laboratory, rows)


def _copy(name: str, found: Sequence[Row], source: Path, to: Path) -> None:
    """Write the rows that were ``found`` of an experiment, with their settings, from one laboratory to another."""
    make_folder(to / name)
    write_bytes(to / name / ROWS, b"".join(msgspec.json.encode(row) + b"\n" for row in found))
    write_bytes(to / name / SETTINGS, read_bytes(source / name / SETTINGS, "settings of an experiment"))


def complete(chosen: Experiment, rows: Sequence[Row]) -> TrialRows:
    """Return the ``rows`` of those arms that have all trials and runs, of an experiment or that there are."""
    keys, runs = {row.key for row in rows}, min(chosen.runs, max((row.run for row in rows), default=0))
    wanted = [(trial, run) for trial in chosen.trials for run in range(1, runs + 1)]
    whole = {row.arm for row in rows if all((row.arm, *one) in keys for one in wanted)}
    return sorted_rows(row for row in rows if row.arm in whole and row.run <= runs)


def rows_by_kind(folder: Path) -> RowsByKind:
    """Return the complete rows of the experiments in ``folder``, by kind of arm.

    Raises:
        UnusableInput: there is no such folder, or no rows are complete in it.

    """
    if not folder.is_dir():
        raise UnusableInput(f"{folder}: expected the folder of a laboratory; run an experiment with --out first")
    found: dict[str, dict[str, TrialRows]] = {}
    for name in ORDER:
        every = complete(experiment(name), read_trial_rows(folder / name / ROWS)).rows
        for kind in sorted({kind_of(row.arm) for row in every}):
            found.setdefault(kind, {})[name] = sorted_rows(row for row in every if kind_of(row.arm) == kind)
    if not found:
        raise UnusableInput(
            f"{folder}: expected rows of experiments; finish one first, as by pneumarm experiment {ORDER[0]} "
            f"--out {folder}"
        )
    return found


def results_of(rows: Mapping[str, TrialRows]) -> dict[str, Results]:
    """Return what the ``rows`` of experiments say, by the test of trainings that is the thesis'."""
    test, results = chosen_test(rows), {}
    for name, found in rows.items():
        made, as_theirs = experiment(name), by_test(found, test)
        results[name] = Results(name, found.arms, found.runs, tuple(made.analyse(as_theirs).claims))
    return results


def plan(rows: Path) -> dict[str, dict[str, int]]:
    """Return how many arms each experiment takes by kind, as its pilot says; written once and never changed."""
    if not (rows / PLAN).exists():
        planned: dict[str, dict[str, int]] = {}
        for kind, found in rows_by_kind(rows).items():
            for name, results in results_of(found).items():
                needed = [claim.judgement.arms for claim in results.claims]
                planned.setdefault(name, {})[kind] = max(len(results.arms), min(_MOST, max(needed, default=0)))
        make_folder(rows)
        write_json(rows / PLAN, planned)
    return msgspec.convert(read_json(rows / PLAN, "arms that were planned"), dict[str, dict[str, int]])

"""Running an experiment: every trial in every run on every arm, on all cores or on a cluster, each once.

The rows that are missing are computed by joblib, by default in threads: what takes the time are kernels that let go
of Python's lock. A dask cluster gets the same calls, with the same result. This process alone writes rows; a sweep
that was killed loses those that were being computed.
"""

import hashlib
import re
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pneumarm.errors import UnusableInput
from pneumarm.experiments.arm_time import arm_time
from pneumarm.experiments.experiment import Experiment, LaboratorySettings, Row, TrialRows, sorted_rows
from pneumarm.experiments.preparation import SETTINGS, claim
from pneumarm.experiments.row_file import RowWriter
from pneumarm.files import make_folder
from pneumarm.learning.training import cores
from pneumarm.progress import Display, silent

ROWS = "rows.jsonl"
_OF_MANY = ("virtual", "simulation:", "emulated:virtual")
"""How the names of arms begin of which there can be several at once."""
_PATIENCE = 10.0  # s, for a scheduler to answer


@dataclass(frozen=True)
class Sweep:
    """A finished sweep."""

    rows: TrialRows
    computed: int
    """TrialRows that were missing."""
    seconds: float
    """Wall time of computing them [s], without preparing arms."""


def sweep(
    experiment: Experiment,
    laboratory: Path,
    arms: Sequence[str] = ("virtual",),
    runs: int | None = None,
    settings: LaboratorySettings | None = None,
    *,
    workers: int | None = None,
    dask: str | None = None,
    progress: Display = silent,
    tell: Callable[[str], None] = lambda line: None,
) -> Sweep:
    """Compute the rows of ``experiment`` that the folder ``laboratory`` does not hold yet, and return all of them.

    Args:
        experiment: what to do.
        laboratory: folder of all experiments; created if it does not exist.
        arms: names as of :func:`pneumarm.arm.open_arm`.
        runs: how often every trial is done, each time with other weights; the experiment's number by default.
        settings: what else decides the rows.
        workers: threads, or tasks at once on a cluster; by default as many as there are cores.
        dask: address of the scheduler of a dask cluster, such as tcp://127.0.0.1:8786; otherwise this machine.
        progress: shows how far preparing and computing are.
        tell: told for how long each arm will be needed, before anything moves.

    Raises:
        UnusableInput: the folder was begun with other settings, another process works in it, no arm or cluster.

    """
    settings, runs = settings or LaboratorySettings(), experiment.runs if runs is None else runs
    if runs < 1 or (workers is not None and workers < 1) or not arms:
        raise UnusableInput(
            f"a sweep needs at least 1 run, 1 worker and 1 arm; got {runs} run(s), "
            f"{'as many workers as cores' if workers is None else f'{workers} worker(s)'} and {len(arms)} arm(s)"
        )
    folder = laboratory / experiment.name
    make_folder(folder)
    arms = tuple(dict.fromkeys(arms))
    keys = [(arm, trial, run) for arm in arms for run in range(1, runs + 1) for trial in experiment.trials]
    with RowWriter(folder / ROWS) as writer:
        if not writer.rows:  # then no settings decided anything yet, as where an arm was misspelt
            (folder / SETTINGS).unlink(missing_ok=True)
        decisive = asdict(settings)
        if settings.collecting == "thesis":
            del decisive["collecting"]  # laboratories of before there was a choice are gone on with
        claim(folder, {"experiment": experiment.settings(), **decisive})
        there = {row.key for row in writer.rows}
        missing = [key for key in keys if key not in there]
        materials = {}
        needed = tuple(dict.fromkeys(arm for arm, _, _ in missing))
        for arm in needed:
            rows = [(trial, run) for one, trial, run in missing if one == arm]
            if (words := arm_time(experiment, arm, arm_folder(laboratory, arm), rows, settings)) is not None:
                tell(words)
        for arm in needed:
            with progress(f"preparing {arm}") as report:
                materials[arm] = experiment.prepare(arm, arm_folder(laboratory, arm), settings, report)
        tasks = [(experiment, materials[key[0]], key, settings) for key in missing]
        if not all(arm.startswith(_OF_MANY) for arm in materials):
            workers = 1  # there is only one of it
        began = time.perf_counter()
        with progress(experiment.name) as report:
            report(len(keys) - len(missing), len(keys))
            for done, row in enumerate(_computed(tasks, workers, dask), 1):
                writer.append(row)
                report(len(keys) - len(missing) + done, len(keys))
        seconds = time.perf_counter() - began
        wanted = set(keys)
        return Sweep(sorted_rows(row for row in writer.rows if row.key in wanted), len(missing), seconds)


def arm_folder(laboratory: Path, arm: str) -> Path:
    """Return the folder of ``arm`` in a laboratory; names that look alike get different ones."""
    plain = re.sub(r"[^a-z0-9]+", "-", arm.lower()).strip("-")[:40]
    return laboratory / "arms" / f"{plain}-{hashlib.sha256(arm.encode()).hexdigest()[:6]}"


def _computed(tasks: Sequence[tuple[Any, ...]], workers: int | None, dask: str | None) -> Iterator[Row]:
    """Give the rows of ``tasks`` as they come."""
    from joblib import Parallel, delayed, parallel_config

    if not tasks:
        return
    calls = [delayed(_measured)(*task) for task in tasks]
    if dask is None:
        parallel = Parallel(workers or cores(), backend="threading", return_as="generator_unordered")
        yield from parallel(calls)
        return
    with _client(dask), parallel_config("dask", n_jobs=workers or -1):
        yield from Parallel(return_as="generator_unordered")(calls)


@contextmanager
def _client(address: str) -> Iterator[None]:
    try:
        from dask.distributed import Client
    except ImportError as error:
        raise UnusableInput("a cluster needs dask: pip install 'pneumarm[dask]'") from error
    try:
        client = Client(address, timeout=_PATIENCE)
    except (OSError, ValueError, TimeoutError) as error:
        raise UnusableInput(f"{address}: no scheduler of a dask cluster answers there ({error})") from error
    with client:
        yield


def _measured(experiment: Experiment, material: Any, key: tuple[str, int, int], settings: LaboratorySettings) -> Row:
    arm, trial, run = key
    began = time.perf_counter()
    figures = experiment.measure(material, trial, run, settings)
    return Row(arm, trial, run, {k: float(v) for k, v in figures.items()}, round(time.perf_counter() - began, 3))

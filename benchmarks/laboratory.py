"""The experiment all-goals on one worker and on two, and through a local dask cluster of two processes.

128 trainings of the thesis' agent (16 trials, 8 runs) and 1.28 million greedy test episodes; every agent is tested as
often with exploration besides. Wall seconds depend on what else the machine does; processor seconds, of all threads
and processes together, less so. Settings come from the environment:

PNEUMARM_LABORATORY_RUNS   8; fewer for a shorter benchmark
PNEUMARM_LABORATORY        folder of a laboratory whose arm is used; otherwise one is collected and fitted first
"""

import resource
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks import _environment as environment
from pneumarm.experiments.experiment import LaboratorySettings
from pneumarm.experiments.registry import experiment
from pneumarm.experiments.sweep import Sweep, arm_folder, sweep

ALL_GOALS = experiment("all-goals")
ARM = "virtual"


def measure() -> Iterator[str]:
    runs = environment.whole("PNEUMARM_LABORATORY_RUNS", 8)
    with tempfile.TemporaryDirectory() as temporary:
        prepared = environment.folder("PNEUMARM_LABORATORY", temporary)
        ALL_GOALS.prepare(ARM, arm_folder(prepared, ARM), LaboratorySettings(), lambda done, total: None)
        found = {}
        for name, workers in (("1 thread", 1), ("2 threads", 2)):
            before = processor_seconds()
            found[name] = done = sweep(ALL_GOALS, fresh(temporary, name, prepared), runs=runs, workers=workers)
            yield line(name, done, processor_seconds() - before)
        try:
            from dask.distributed import LocalCluster
        except ImportError:
            yield "dask is not installed: pip install 'pneumarm[dask]'"
            return
        before = processor_seconds()
        with LocalCluster(2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
            address = cluster.scheduler_address
            found["dask, 2 processes"] = done = sweep(
                ALL_GOALS, fresh(temporary, "dask", prepared), runs=runs, dask=address
            )
        # The processor time of the workers is known once they have ended.
        yield line("dask, 2 processes", done, processor_seconds() - before)
        figures = [[(row.key, row.figures) for row in done.rows.rows] for done in found.values()]
        yield f"the rows of all three are {'the same' if figures.count(figures[0]) == 3 else 'NOT the same'}"


def fresh(folder: str, name: str, prepared: Path) -> Path:
    """Return a new laboratory that has the arm of ``prepared``."""
    laboratory = Path(folder) / name.replace(" ", "-")
    shutil.copytree(arm_folder(prepared, ARM), arm_folder(laboratory, ARM))
    return laboratory


def processor_seconds() -> float:
    """Return the processor time of this process and of those that it has waited for [s]."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in used)


def line(name: str, done: Sweep, processor: float) -> str:
    steps = sum(row.figures["steps"] for row in done.rows.rows)
    episodes = len(done.rows.rows) * LaboratorySettings().test_episodes
    return (
        f"{name:18} {done.seconds:6.1f} s, {processor:6.1f} s of processor time: {done.computed} trainings of "
        f"{steps / 1e6:.0f} million steps, {episodes / 1e6:.2f} million greedy test episodes"
    )

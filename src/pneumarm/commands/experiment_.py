"""``pneumarm experiment``."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pneumarm.arm.open import names_in
from pneumarm.commands.common import Json, Settings
from pneumarm.console import say, show, table
from pneumarm.errors import UnusableInput
from pneumarm.experiments.experiment import Experiment, LaboratorySettings
from pneumarm.experiments.registry import experiment
from pneumarm.experiments.results import write_page
from pneumarm.experiments.sweep import sweep
from pneumarm.progress import progress


def experiment_(
    name: str | None = None,
    /,
    *,
    design: Path | None = None,
    out: Path = Path("laboratory"),
    arms: Annotated[str | None, Parameter(name=("--arms", "--arm"))] = None,
    runs: int | None = None,
    workers: int | None = None,
    dask: str | None = None,
    settings: Annotated[LaboratorySettings, Settings] = LaboratorySettings(),
    json: Json = False,
) -> None:
    """Repeat an experiment of the thesis, or do one of your own, and write its page.

    Before an arm is recorded or moved, the command says for about how long. A second call computes only the
    missing rows, also after a call that was killed or that asked for fewer runs.

    Parameters
    ----------
    name
        Name of the experiment, such as all-goals; an unknown name lists all of them.
    design
        TOML file of an experiment of your own, in place of a name: its factors, levels and settings.
    out
        Folder of the laboratory, shared by all experiments; created if it does not exist.
    arms
        Names of the arms, separated by commas, any that `pneumarm run` takes; by default those of the experiment.
    runs
        How often every trial is done, each time from other weights; by default as often as in the thesis.
    workers
        Rows computed at once; by default as many as there are cores.
    dask
        Address of the scheduler of a dask cluster, such as tcp://127.0.0.1:8786, to compute there.
    """
    chosen = _chosen(name, design)
    names = chosen.arms if arms is None else names_in(arms)
    done = sweep(chosen, out, names, runs, settings, workers=workers, dask=dask, progress=progress, tell=say)
    analysis = chosen.analyse(done.rows)
    page = write_page(chosen, out / chosen.name, analysis, done.rows)
    found = {
        "experiment": chosen.name,
        "rows": len(done.rows.rows),
        "computed": done.computed,
        "seconds": done.seconds,
    }
    claims = [(claim.text, claim.thesis, claim.ours, claim.verdict) for claim in analysis.claims]
    tables = [table(("claim", "thesis", "here", "verdict"), claims)] if claims else []
    show({**found, **analysis.figures, "page": str(page)}, json, lambda: [*tables, *analysis.summary])
    say(f"{done.computed} rows computed in {done.seconds:.1f} s; page: {page}")


def _chosen(name: str | None, design: Path | None) -> Experiment:
    """Return the experiment called ``name``, or that in the file ``design``."""
    if (name is None) == (design is None):
        raise UnusableInput("expected the name of an experiment, or --design FILE.toml with one of your own")
    if design is not None:
        from pneumarm.experiments.own_design import load_own_design

        return load_own_design(design)
    return experiment(name or "")

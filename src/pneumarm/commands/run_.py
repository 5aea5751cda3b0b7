"""``pneumarm run``."""

from pathlib import Path
from typing import Annotated

from pneumarm.commands.common import Json, Settings
from pneumarm.console import progress, say, show, table
from pneumarm.control import TransferSettings
from pneumarm.learning import TrainSettings
from pneumarm.run import Run, RunSettings


def run_(
    *,
    arm: str = "virtual",
    out: Path = Path("pneumarm-run"),
    seed: int = 0,
    transitions: int = 200_000,
    joints: int = 1,
    train: Annotated[TrainSettings, Settings] = TrainSettings(),
    transfer: Annotated[TransferSettings, Settings] = TransferSettings(),
    json: Json = False,
) -> None:
    """Do the whole job: collect, fit, train, test, transfer, report.

    A second call with the same folder goes on where the first was interrupted.

    Example: ``pneumarm run --arm virtual:seed=7 --out runs/seven --transitions 20000``

    Parameters
    ----------
    arm
        virtual, virtual:seed=N, simulation:FILE or python:module:callable.
    out
        Folder of the run; made where there is none.
    seed
        Of everything that is drawn at random.
    transitions
        How many to collect (thesis section 3.2.2: 200,000, two hours).
    joints
        Joints of the arm.
    json
        Print one JSON object on stdout and nothing else there.
    """
    settings = RunSettings(arm=arm, seed=seed, transitions=transitions, joints=joints, train=train, transfer=transfer)
    results = Run(out, settings, progress).do()
    columns = ("episodes", "reward", "success_rate", "actions", "switches")
    phases = {"in simulation": results["test"], "on arrival": results["transfer"]["before"]}
    phases["after adaptation"] = results["transfer"]["after"]
    rows = [(name, *[figures[column] for column in columns]) for name, figures in phases.items()]
    show(results, json, lambda: [table(("", *columns), rows, title="Ledger")])
    say(f"report: {out / 'report.html'}")

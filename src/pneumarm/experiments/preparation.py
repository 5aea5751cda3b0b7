"""What most experiments need of an arm: transitions, a simulation fitted to them, begin states."""

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from pneumarm.arm import open_arm
from pneumarm.errors import UnusableInput
from pneumarm.experiments.experiment import LaboratorySettings
from pneumarm.files import read_json, write_json, write_text
from pneumarm.learning import Help
from pneumarm.progress import Report
from pneumarm.simulation import SINGLE_STEPS, Simulation, fit_store
from pneumarm.task import BeginStates, begin_states
from pneumarm.transitions import WHOLE_PERIODS, CollectSettings, GridSettings, Store, collect

STORE = "transitions.db"
SIMULATION = "simulation.safetensors"
PLAN = "faults.toml"
SETTINGS = "settings.json"
PROCEDURES = {"thesis": WHOLE_PERIODS, "ours": CollectSettings(pulses=0.0)}
"""How arms are recorded, by the name of the procedure; the thesis' agents know no pulses."""
_LATER = {
    "help": asdict(Help()),
    "goal": [],
    "sides": "place",
    "each": False,
    "share": 0.01,
    "grid": asdict(GridSettings()),
}
"""Settings of later versions, and their usual values."""


@dataclass(frozen=True, eq=False)
class Simulated:
    """An arm by name, its simulation and the begin states that go with it."""

    arm: str
    simulation: Simulation
    begin: BeginStates


def simulated(arm: str, folder: Path, settings: LaboratorySettings, progress: Report, faults: str = "") -> Simulated:
    """Return the simulation of ``arm``, collecting and fitting where ``folder`` does not hold it yet; resumable.

    ``faults`` is the text of a plan (:mod:`pneumarm.arm.virtual.faults`) that a virtual arm is collected with; such
    an arm needs a folder of its own.

    Raises:
        UnusableInput: no arm has this name, or the folder was begun with other settings.

    """
    recorded, wanted = arm, {"arm": arm, "seed": settings.seed, "transitions": settings.transitions}
    other = {} if settings.collecting == "thesis" else {"collecting": settings.collecting}
    claim(folder, wanted | other | ({"faults": faults} if faults else {}))
    if faults:
        write_text(folder / PLAN, faults)
        recorded = f"{arm}{',' if ':' in arm else ':'}faults={folder / PLAN}"
    if not (folder / SIMULATION).exists():
        with open_arm(recorded, settings.seed) as opened, Store.for_arm(folder / STORE, opened.spec) as store:
            way = PROCEDURES[settings.collecting]
            collect(opened, store, settings.transitions, settings.seed, progress=progress, settings=way)
        with Store.open(folder / STORE) as store:
            fit_store(store, replace(SINGLE_STEPS, seed=settings.seed)).simulation.save(folder / SIMULATION)
    simulation = Simulation.load(folder / SIMULATION)
    with Store.open(folder / STORE) as store:
        begin = begin_states(store, simulation.window, simulation.scaling, simulation.spec)
    return Simulated(arm, simulation, begin)


def claim(folder: Path, wanted: object) -> None:
    """Make ``folder`` hold what was made with the settings ``wanted`` (JSON) and nothing else.

    Raises:
        UnusableInput: it was begun with others.

    """
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / SETTINGS
    wanted = as_ever(json.loads(json.dumps(wanted)))
    if not file.exists():
        write_json(file, wanted)
        return
    found = read_json(file, "the settings that an experiment was begun with")
    if found != wanted:
        raise UnusableInput(
            f"{folder}: was begun with other settings ({_difference(found, wanted)}); give the same ones or another "
            "folder with --out"
        )


def as_ever(wanted: Any) -> Any:
    """Return ``wanted`` (JSON) without later settings that are as usual: laboratories of before are gone on with."""
    if isinstance(wanted, dict):
        usual = {name for name, value in wanted.items() if name in _LATER and value == _LATER[name]}
        return {name: as_ever(value) for name, value in wanted.items() if name not in usual}
    return [as_ever(one) for one in wanted] if isinstance(wanted, list) else wanted


def _difference(found: object, wanted: object) -> str:
    if not isinstance(found, dict) or not isinstance(wanted, dict):
        return f"was {found!r}, is {wanted!r}"
    names = sorted(name for name in found.keys() | wanted.keys() if found.get(name) != wanted.get(name))
    return "; ".join(f"{name}: {_difference(found.get(name), wanted.get(name))}" for name in names)

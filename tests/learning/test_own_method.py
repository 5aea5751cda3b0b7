"""A method of one's own, whole in this file: it trains, tests, transfers and is reported like any other.

The tests run it as part of a run, from Python and, as ``my_module.py`` in the current folder, on the command line.
"""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, Self

import msgspec
import numpy as np
import pytest

import pneumarm as pneumarm_itself
from pneumarm.control import open_agent
from pneumarm.errors import UnusableInput
from pneumarm.experiments.experiment import LaboratorySettings
from pneumarm.experiments.there_and_back import BEFORE, Prepared, Recipe, train_and_move
from pneumarm.files import kind_of, read_arrays, write_arrays
from pneumarm.learning import Method, SimulationAgent, Training, find_method, fingerprint, load_agent, test
from pneumarm.learning.methods import GROUP
from pneumarm.run import Run, RunSettings, RunTransferSettings
from pneumarm.settings import Valid
from pneumarm.simulation import FitSettings, Simulation
from pneumarm.task import BeginStates, TaskSettings, begin_states
from pneumarm.transitions import KINDS, Store

# ---- The method: it pushes towards the goal until that is near, and tries at random how near that is.

NAME = f"{__name__}:MINE"
DOWN, CLOSED, UP = 2, 4, 6  # actions


@dataclass(frozen=True)
class PushSettings(TaskSettings):
    trials: int = 4
    episodes: int = 50

    def _valid(self) -> Valid:
        return {"trials": self.trials >= 1 or "1 or more", "episodes": self.episodes >= 1}


@dataclass(frozen=True)
class PushAgent(SimulationAgent):
    near: float
    settings: PushSettings

    def actor(self) -> "PushActor":
        return PushActor(self)

    def save(self, path: Path) -> None:
        header, arrays = self.simulation.parts()
        settings = {"simulation": header, "settings": msgspec.to_builtins(self.settings)}
        write_arrays(path, NAME, settings, {**arrays, "near": np.array([self.near])})

    @classmethod
    def load(cls, path: Path) -> Self:
        header, arrays = read_arrays(path, NAME)
        near, settings = float(arrays.pop("near")[0]), msgspec.convert(header["settings"], PushSettings)
        return cls(Simulation.of_parts(header["simulation"], arrays), near, settings)


class PushActor:
    def __init__(self, agent: PushAgent) -> None:
        scaling, self.near = agent.scaling, agent.near
        self.offset, self.scale = scaling.observation_offset[0], scaling.observation_scale[0]

    def begin(self, state: Any, goal: Any) -> None:
        self.goal = float(goal[0])
        self.follow(state)

    def follow(self, next_state: Any) -> None:
        self.error = self.goal - (self.offset + self.scale * float(next_state[0]))

    def act(self) -> np.ndarray:
        return np.array([CLOSED if abs(self.error) < self.near else UP if self.error > 0 else DOWN])


def train_push(
    simulation: Simulation, begin: BeginStates, settings: PushSettings, seed: int = 0, **how: Any
) -> Training[PushAgent]:
    tried = np.random.default_rng(seed).uniform(5.0, 60.0, settings.trials)
    agents = [PushAgent(simulation, float(near), settings) for near in tried]
    tested = tuple(test(one, simulation, begin, settings.episodes, seed) for one in agents)
    best = int(np.argmax([one.reward.mean() for one in tested]))
    return Training(
        agent=agents[best],
        best=best,
        validation=tested,
        columns=("episodes", "reward", "near"),
        curves=tuple(np.array([[50.0, one.reward.mean(), near]]) for one, near in zip(tested, tried, strict=True)),
        episodes=np.full(settings.trials, settings.episodes),
        steps=np.array([one.actions.sum() for one in tested]),
    )


MINE = Method(PushSettings, train_push, PushAgent.load)

# ---- Its tests.


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run with this method."""
    folder = tmp_path_factory.mktemp("runs") / "mine"
    settings = RunSettings(
        arm="virtual:seed=3",
        transitions=2_000,
        test_episodes=20,
        bound_episodes=0,
        fit=FitSettings(epochs=3),
        method=NAME,
        own={"trials": 3},
        transfer=RunTransferSettings(episodes=2, test_episodes=3),
    )
    Run(folder, settings).do()
    return folder


def test_it_goes_all_the_way(done: Path) -> None:
    results = json.loads((done / "results.json").read_text())
    assert results["training"]["episodes"] == 150
    assert results["test"]["episodes"] == 20
    assert results["transfer"]["before"]["episodes"] == 3
    assert results["transfer"]["adaptations"] == results["transfer"]["learning_rate"] == 0
    report = (done / "report.html").read_text()
    assert "3 agents learn at once" in report
    assert "near from" in report  # a curve of its own
    agent, adapted = (load_agent(done / f"{name}.safetensors") for name in ("agent", "adapted"))
    assert isinstance(agent, PushAgent)
    assert fingerprint(agent) == fingerprint(adapted)
    assert fingerprint(agent) != fingerprint(PushAgent(agent.simulation, agent.near + 1, agent.settings))


def test_it_goes_into_an_experiment(done: Path) -> None:
    simulation = Simulation.load(done / "simulation.safetensors")
    with Store.open(done / "transitions.db") as store:
        begin = begin_states(store.blocks(kinds=KINDS), simulation.window, simulation.scaling, simulation.spec)
    material = Prepared("virtual:seed=3", Recipe(), done, simulation, begin, {})
    laboratory = LaboratorySettings(test_episodes=4)
    found = train_and_move(material, PushSettings(trials=2), 1, laboratory, method=MINE)
    assert {"reward", BEFORE + "reward", "episodes"} <= found.keys()


def test_it_works_from_the_current_folder(done: Path, tmp_path: Path) -> None:
    shutil.copy(__file__, tmp_path / "my_module.py")
    agent, files = tmp_path / "agent", (done / "simulation.safetensors", done / "transitions.db")

    def pneumarm(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "pneumarm.cli", *map(str, arguments)]
        places = [str(Path(pneumarm_itself.__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(places)}
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)

    mine = ("--method", "my_module:MINE")
    trained = pneumarm("train", *files, "--out", agent, *mine, "--own.trials", 2, "--json")
    assert trained.returncode == 0, trained.stderr
    assert len(json.loads(trained.stdout)["validation"]) == 2
    assert kind_of(agent) == "my_module:MINE"
    tested = pneumarm("test", agent, *files, "--episodes", 5, *mine, "--json")
    assert json.loads(tested.stdout)["episodes"] == 5
    refused = pneumarm("test", agent, *files, "--episodes", 5)
    assert refused.returncode == 2
    assert "--method my_module:MINE" in refused.stderr


def test_a_file_alone_runs_no_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "stranger", raising=False)  # which another test may have imported
    Path("stranger.py").write_text("open('it ran', 'w')\n")
    write_arrays(tmp_path / "agent", "stranger:MINE", {}, {"near": np.zeros(1)})
    with pytest.raises(UnusableInput, match="give --method stranger:MINE"):
        load_agent(tmp_path / "agent")
    assert not Path("it ran").exists()
    with pytest.raises(UnusableInput, match="module and a Method"):
        open_agent(tmp_path / "agent", "stranger:MINE")
    assert Path("it ran").exists()


def test_an_installed_method_has_a_short_name(monkeypatch: pytest.MonkeyPatch) -> None:
    installed = [EntryPoint("push", NAME, GROUP)]
    monkeypatch.setattr("pneumarm.learning.methods.entry_points", lambda group: installed)
    assert find_method("push") is MINE
    with pytest.raises(UnusableInput, match=r"expected servo, .* q-learning, push or MODULE:NAME"):
        find_method("pull")


@pytest.mark.parametrize(
    ("own", "words"),
    [
        ({"trails": 3}, "no setting trails; it has .*trials"),
        ({"trials": "many"}, "trials"),
        ({"trials": 0}, "trials cannot"),
    ],
)
def test_wrong_settings_are_found_at_once(own: dict[str, Any], words: str) -> None:
    with pytest.raises(UnusableInput, match=words):
        RunSettings(method=NAME, own=own)


@pytest.mark.parametrize("name", ["no_such_module:MINE", f"{__name__}:NAME", f"{__name__}:NONE", "nonsense"])
def test_what_is_no_method_is_refused(name: str) -> None:
    with pytest.raises(UnusableInput, match="method"):
        find_method(name)


def test_own_settings_are_for_own_methods() -> None:
    with pytest.raises(UnusableInput, match="own cannot be"):
        RunSettings(own={"trials": 3})

"""An agent's file: what is written is what is read, and nothing else is taken for one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_arm import synthetic_simulation

from pneumarm.errors import UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.learning import Agent, Shaping, TrainSettings
from pneumarm.learning.online.values import draw_networks
from pneumarm.simulation.noise import NoiseSettings


def an_agent(joints: int = 1, **settings: object) -> Agent:
    simulation, chosen = synthetic_simulation(joints), TrainSettings(**settings)  # type: ignore[arg-type]
    networks = draw_networks(simulation.window, chosen, np.random.default_rng(0))
    return Agent(simulation.spec, simulation.window, simulation.scaling, simulation.goal_range, networks, chosen)


@pytest.mark.parametrize(
    "agent",
    [
        an_agent(),
        an_agent(2, hidden=7, method="q-learning", shaping=None),
        an_agent(shaping=Shaping(weights=(1.0, 2.0)), noise=NoiseSettings(kind="white"), trace_decay=0.3),
    ],
    ids=["defaults", "two joints", "other settings"],
)
def test_round_trip(agent: Agent, tmp_path: Path) -> None:
    agent.save(tmp_path / "agent")
    loaded = Agent.load(tmp_path / "agent")
    assert (loaded.spec, loaded.window, loaded.settings) == (agent.spec, agent.window, agent.settings)
    np.testing.assert_array_equal(loaded.weights(), agent.weights())
    np.testing.assert_array_equal(loaded.goal_range, agent.goal_range)
    for name, array in vars(agent.scaling).items():
        np.testing.assert_array_equal(getattr(loaded.scaling, name), array)


def test_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(UnusableInput, match="does not exist"):
        an_agent().save(tmp_path / "nowhere" / "agent")


def damaged(settings: dict, arrays: dict, how: str) -> tuple[dict, dict]:
    wrong_settings = {
        "negative period": ("spec", "period", -1.0),
        "text for a number": ("settings", "hidden", "five"),
        "unknown method": ("settings", "method", "telepathy"),
        "other hidden": ("settings", "hidden", 6),
        "huge history": ("window", "history", 10**9),
        "no joints": ("window", "joints", 0),
        "other joints": ("window", "joints", 2),
    }
    if how in wrong_settings:
        part, name, value = wrong_settings[how]
        return {**settings, part: {**settings[part], name: value}}, arrays
    if how == "more settings":
        return {**settings, "surprise": 1}, arrays
    if how == "settings are a list":
        return [settings], arrays  # type: ignore[return-value]
    wrong_arrays = {
        "missing array": {"output_bias": None},
        "more arrays": {"surprise": np.zeros(3)},
        "wrong shape": {"output_bias": np.zeros((1, 8), np.float32)},
        "wrong type": {"output_bias": np.zeros((1, 9), np.int64)},
        "zero scale": {"observation_scale": np.zeros(4)},
        "goals upside down": {"goal_range": np.array([[600.0, 400.0]])},
        "not finite": {"hidden_bias": np.full((1, 9, 5), np.nan, np.float32)},
    }[how]
    return settings, {k: v for k, v in {**arrays, **wrong_arrays}.items() if v is not None}


@pytest.mark.parametrize(
    "how",
    [
        "negative period", "text for a number", "unknown method", "other hidden", "huge history", "no joints",
        "other joints", "more settings", "settings are a list", "missing array", "more arrays", "wrong shape",
        "wrong type", "zero scale", "goals upside down", "not finite",
    ],
)  # fmt: skip
def test_hostile_files(how: str, tmp_path: Path) -> None:
    path = tmp_path / "agent"
    an_agent().save(path)
    write_arrays(path, "pneumarm agent", *damaged(*read_arrays(path, "pneumarm agent"), how))
    with pytest.raises(UnusableInput, match=str(path)):
        Agent.load(path)


def test_cut_or_foreign_files(tmp_path: Path) -> None:
    path = tmp_path / "agent"
    an_agent().save(path)
    whole = path.read_bytes()
    for content in (b"", b"hello", whole[:50], whole[:-7], b"\xff" * 200, bytes(8) + whole):
        path.write_bytes(content)
        with pytest.raises(UnusableInput):
            Agent.load(path)
    write_arrays(path, "pneumarm simulation", {}, {"a": np.zeros(3)})
    with pytest.raises(UnusableInput, match="kind"):
        Agent.load(path)
    with pytest.raises(UnusableInput, match="cannot be read"):
        Agent.load(tmp_path / "none")


def test_weights_are_a_copy() -> None:
    agent = an_agent()
    agent.weights()[:] = 0
    assert (agent.weights() != 0).any()
    assert replace(agent, settings=agent.settings).weights().shape == (1, 22, 80)  # 9 networks of 5, 8 wide

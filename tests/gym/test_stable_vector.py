"""What our vectorised environment tells stable-baselines3 about itself, also where that is not installed."""

import sys
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import pytest
from gymnasium.vector import AutoresetMode
from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.gym import PointToPointVector

OURS, THEIRS = "pneumarm.gym.stable_baselines", "stable_baselines3.common.vec_env"


class VecEnv:
    """Stands in for the class of this name of stable-baselines3: what it asks of those that are made of it."""

    def __init__(self, num_envs: int, observation_space: Any, action_space: Any) -> None:
        self.num_envs = num_envs
        assert self.get_attr("render_mode") == [None] * num_envs

    def has_attr(self, attr_name: str) -> bool:
        try:
            self.get_attr(attr_name)
        except AttributeError:
            return False
        return True

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        raise NotImplementedError

    def _get_indices(self, indices: Any) -> Any:
        return range(self.num_envs) if indices is None else indices


@pytest.fixture
def vector(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    try:
        import stable_baselines3  # noqa: F401 - whether it is there
    except ImportError:
        for name in ("stable_baselines3", "stable_baselines3.common", THEIRS):
            monkeypatch.setitem(sys.modules, name, ModuleType(name))
        sys.modules[THEIRS].VecEnv = VecEnv  # type: ignore[attr-defined]
        monkeypatch.delitem(sys.modules, OURS, raising=False)
    from pneumarm.gym.stable_baselines import StableVector

    simulation = synthetic_simulation()
    many = PointToPointVector(
        simulation, synthetic_begin_states(simulation), 3, autoreset_mode=AutoresetMode.SAME_STEP
    )
    yield StableVector(many)
    if not hasattr(sys.modules["stable_baselines3"], "__file__"):
        sys.modules.pop(OURS, None)  # made of what stood in


def test_it_has_no_attributes_that_it_has_not(vector: Any) -> None:
    """An agent that asks for masks of actions has to hear that there are none."""
    assert not vector.has_attr("action_masks")
    assert not vector.has_attr("no_such_thing")
    with pytest.raises(AttributeError, match="no_such_thing"):
        vector.get_attr("no_such_thing")
    assert vector.has_attr("simulation")
    assert vector.get_attr("num_envs", [0, 2]) == [3, 3]

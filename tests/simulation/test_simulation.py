"""The simulation: its prediction in its parts, and its file."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from learning.synthetic_arm import synthetic_simulation
from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.networks import Network
from pneumarm.simulation import FitResult, Scaling, Simulation
from pneumarm.simulation.simulation import KIND
from pneumarm.transitions.window import Transitions, Window

Fitted = tuple[FitResult, Transitions]


def constant(change: list[float], inputs: int) -> Network:
    """Return a network that gives the same changes whatever its inputs."""
    outputs = len(change)
    return Network(np.zeros((inputs, 0)), np.zeros(0), np.zeros((0, outputs)), np.array(change))


def make(change: list[float], velocity: str = "derived", joints: int = 1, **other: Any) -> Simulation:
    window = Window(joints, 2)
    scaling = Scaling(np.full(4 * joints, 100.0), np.tile([10.0, 2.0, 5.0, 5.0], joints), np.ones(2 * joints))
    parts: dict[str, Any] = {
        "spec": ArmSpec(joints=joints, period=0.02),
        "window": window,
        "scaling": scaling,
        "networks": (constant(change, window.input_size),),
        "velocity": velocity,
        "error_std": np.ones((joints, 4)),
        "goal_range": np.tile([100.0, 900.0], (joints, 1)),
        "pressure_range": np.tile([0.0, 200.0], (joints, 2, 1)),
    }
    return Simulation(**{**parts, **other})


def inputs(observation: list[float]) -> NDArray[np.float64]:
    joints = len(observation) // 4
    return np.array([[*observation, *observation, *[0.0] * 4 * joints]])


def test_a_change_by_hand() -> None:
    """+1 scaled of the angle is +10 counts, in 20 ms that is 0.5 counts/ms."""
    predicted = make([1.0, 2.0, -3.0]).predict(inputs([500.0, 0.0, 50.0, 60.0]))
    np.testing.assert_allclose(predicted, [[510.0, 0.5, 60.0, 45.0]])


def test_a_velocity_of_its_own_network() -> None:
    predicted = make([1.0, 0.25, 0.0, 0.0], velocity="network").predict(inputs([500.0, 3.0, 50.0, 60.0]))
    np.testing.assert_allclose(predicted, [[510.0, 3.5, 50.0, 60.0]])


def test_joints_are_apart() -> None:
    simulation = make([1.0, 0.0, 0.0, -1.0, 0.0, 1.0], joints=2)
    predicted = simulation.predict(inputs([500.0, 0.0, 50.0, 60.0, 300.0, 0.0, 10.0, 20.0]))
    np.testing.assert_allclose(predicted, [[510.0, 0.5, 50.0, 60.0, 290.0, -0.5, 10.0, 25.0]])


def test_predictions_stay_where_sensors_can_be() -> None:
    simulation = make([100.0, -100.0, 100.0])
    predicted = simulation.predict(inputs([1000.0, 0.0, 50.0, 60.0]))
    np.testing.assert_allclose(predicted, [[1023.0, 23 / 20, 0.0, 200.0]])


def test_scaling_by_hand() -> None:
    window = Window(1, 2)
    scaling = Scaling(np.array([512.0, 0.0, 80.0, 80.0]), np.array([200.0, 2.0, 40.0, 40.0]), np.array([1.0, 4.0]))
    raw = np.array([[712.0, 1.0, 40.0, 120.0, 512.0, 0.0, 80.0, 80.0, 1.0, 2.0, -1.0, 4.0]])
    expected = [[1.0, 0.5, -1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.5, -1.0, 1.0]]
    np.testing.assert_allclose(scaling.inputs(raw, window), expected)
    state = raw[:, : window.state_size]
    np.testing.assert_allclose(scaling.inputs(state, window), [expected[0][: window.state_size]])


def test_scaling_puts_data_within_about_one(fitted: Fitted) -> None:
    result, held_out = fitted
    scaled = result.simulation.scaling.inputs(held_out.inputs, result.simulation.window)
    assert np.quantile(np.abs(scaled), 0.99) < 2
    assert (scaled.std(axis=0) > 0.3).all()


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"joints": 2},
        {"one_network": True},
        {"velocity": "network"},
        {"approximator": "least-squares", "history": 1},
        {"layers": 2, "ahead": 0.0},
    ],
)
def test_a_file_gives_the_same_simulation(
    options: dict[str, Any], make_fit: Callable[..., Fitted], tmp_path: Path
) -> None:
    result, held_out = make_fit(**options)
    result.simulation.save(tmp_path / "simulation.safetensors")
    loaded = Simulation.load(tmp_path / "simulation.safetensors")
    np.testing.assert_array_equal(
        loaded.predict(held_out.inputs[:50]), result.simulation.predict(held_out.inputs[:50])
    )
    for name in ("spec", "window", "velocity", "valves", "held_out", "seed"):
        assert getattr(loaded, name) == getattr(result.simulation, name)
    for name in ("error_std", "goal_range", "pressure_range"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(result.simulation, name))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "simulation.safetensors"
    make([1.0, 2.0, -3.0]).save(path)
    return path


def change_settings(path: Path, **changes: Any) -> None:
    settings, arrays = read_arrays(path, KIND)
    write_arrays(path, KIND, {**settings, **changes}, arrays)


def change_array(path: Path, name: str, array: NDArray[Any]) -> None:
    settings, arrays = read_arrays(path, KIND)
    write_arrays(path, KIND, settings, {**arrays, name: array})


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        ("error_std", np.ones((2, 4)), r"expected error_std of the shape \(1, 4\), got \(2, 4\)"),
        ("error_std", -np.ones((1, 4)), "error_std holds values out of range"),
        ("goal_range", np.array([[900.0, 100.0]]), "goal_range holds values out of range"),
        ("observation_scale", np.zeros(4), "observation_scale holds values out of range"),
        ("observation_scale", np.ones(4, np.int64), "observation_scale holds int64"),
        ("network_0_output_bias", np.zeros(4), r"expected output_weights of the shape|expected output_bias"),
        ("network_0_hidden_weights", np.zeros((3, 0)), "expected hidden_weights of the shape"),
        ("unknown", np.zeros(1), "also holds unknown"),
        ("network_0_second_bias", np.zeros(3), "a second hidden layer needs weights and a bias"),
        ("goal_range", np.array([[np.nan, 1.0]]), "not finite"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(file: Path, name: str, array: NDArray[Any], message: str) -> None:
    change_array(file, name, array)
    with pytest.raises(UnusableInput, match=message) as caught:
        Simulation.load(file)
    assert str(file) in str(caught.value)


@pytest.mark.parametrize(
    "changes",
    [
        {"window": {"joints": 2, "history": 2}},
        {"window": {"joints": 1, "history": 10**12}},
        {"window": {"joints": 1, "history": 0}},
        {"velocity": "guessed"},
        {"direct": []},
        {"direct": [True]},
        {"direct": [False] * 3},
        {"held_out": 1.5},
        {"spec": {"joints": 1, "period": -1.0}},
        {"spec": None},
        {"seed": "one"},
    ],
)
def test_settings_that_do_not_fit_are_refused(file: Path, changes: dict[str, Any]) -> None:
    change_settings(file, **changes)
    with pytest.raises(UnusableInput, match="is no usable simulation"):
        Simulation.load(file)


def test_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnusableInput, match="cannot be read"):
        Simulation.load(tmp_path / "missing")
    other = tmp_path / "text"
    other.write_text("no simulation")
    with pytest.raises(UnusableInput, match="something else"):
        Simulation.load(other)
    with pytest.raises(UnusableInput, match="does not exist"):
        make([0.0, 0.0, 0.0]).save(tmp_path / "no folder" / "simulation")


def test_the_range_of_an_angle_is_that_of_the_arm() -> None:
    simulation = make([0.0, 0.0, 0.0])
    wider = replace(simulation, spec=replace(simulation.spec, angle_range=(-50.0, 2000.0)))
    np.testing.assert_array_equal(wider.limits[:, 0], [-50.0, 2000.0])
    np.testing.assert_array_equal(wider.limits[:, 2], [0.0, 200.0])


def test_all_networks_have_as_many_layers(tmp_path: Path) -> None:
    one, two = synthetic_simulation(), synthetic_simulation(second=True)
    replace(one, networks=(two.networks[0], *one.networks[1:])).save(tmp_path / "mixed.sim")
    with pytest.raises(UnusableInput, match="all of its networks have a second hidden layer or none"):
        Simulation.load(tmp_path / "mixed.sim")

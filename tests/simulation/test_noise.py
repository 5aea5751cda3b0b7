"""Noise of section 3.4 against appendix B and the rule for slow arms."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.kernels import kernel
from pneumarm.networks.network import Network
from pneumarm.random import normal, random_state
from pneumarm.simulation.noise import NoiseSettings, add_noise, begin_noise, noise_parameters, noise_share
from pneumarm.simulation.simulation import Scaling, Simulation
from pneumarm.transitions.window import Window

STEPS = 200_000


def simulation(velocity: str = "derived", joints: int = 1) -> Simulation:
    window = Window(joints)
    outputs = (3 if velocity == "derived" else 4) * joints
    network = Network(np.zeros((window.input_size, 1)), np.zeros(1), np.zeros((1, outputs)), np.zeros(outputs))
    offset, scale = np.tile([512.0, 0.1, 90.0, 90.0], joints), np.tile([400.0, 5.0, 90.0, 80.0], joints)
    scaling = Scaling(offset, scale, np.ones(2 * joints))
    std = np.array([[6.7, 0.2, 1.9, 1.5], [3.0, 0.1, 1.0, 2.0]])[:joints]
    goals, limits = np.tile([200.0, 800.0], (joints, 1)), np.tile([-9999.0, 9999.0], (joints, 2, 1))
    spec = ArmSpec(joints=joints)
    return Simulation(spec, window, scaling, (network,), velocity, std, goals, limits)  # type: ignore[arg-type]


@kernel
def _injected(noise, x, random, record):  # type: ignore[no-untyped-def]
    average = np.zeros(record.shape[1], np.float32)
    change = np.zeros(record.shape[1], np.float32)
    begin_noise(noise, average, random)
    for k in range(record.shape[0]):
        for o in range(change.shape[0]):
            change[o] = 0.0
        add_noise(noise, x, change, average, random)
        for o in range(change.shape[0]):
            record[k, o] = change[o]


def injected(settings: NoiseSettings, of: Simulation) -> NDArray[np.float64]:
    """Return what a resting arm's predictions get, in sensor units, shape (steps, outputs)."""
    joints = of.window.joints
    outputs = of.networks[0].output_bias.size
    record = np.zeros((STEPS, outputs))
    x = np.zeros(20 * joints, np.float32)
    _injected(noise_parameters(settings, of), x, random_state(1), record)
    quantities = [0, 2, 3] if of.velocity == "derived" else [0, 1, 2, 3]
    return record * of.scaling.observation_scale.reshape(joints, 4)[:, quantities].ravel()


@pytest.mark.parametrize("n", [1, 2, 5, 10])
def test_moving_average_as_derived_in_appendix_b(n: int) -> None:
    got = injected(NoiseSettings(steps=n, by_velocity=False), simulation())
    # The average of a first-order filter has (2n - 1) times fewer independent values than there are steps.
    tolerance = 4 / math.sqrt(STEPS / (2 * n - 1))
    np.testing.assert_allclose(got.std(axis=0), [6.7, 1.9, 1.5], rtol=tolerance)
    np.testing.assert_allclose(got.mean(axis=0) / [6.7, 1.9, 1.5], 0, atol=tolerance)
    for lag in (1, 3):
        correlation = np.corrcoef(got[lag:, 0], got[:-lag, 0])[0, 1]
        assert correlation == pytest.approx(((n - 1) / n) ** lag, abs=tolerance)


def test_drawn_noise_has_sqrt_2n_minus_1_times_the_deviation() -> None:
    """Undo eq. 3.8: what enters the average must have the deviation of eq. 3.9, 3 times for n = 5."""
    average = injected(NoiseSettings(by_velocity=False), simulation())[:, 0]
    drawn = 5 * (average[1:] - 0.8 * average[:-1])
    assert drawn.std() / 6.7 == pytest.approx(3.0, rel=0.01)
    assert abs(np.corrcoef(drawn[1:], drawn[:-1])[0, 1]) < 0.01


def test_begins_in_its_stationary_distribution() -> None:
    noise = noise_parameters(NoiseSettings(by_velocity=False), simulation())
    random, first = random_state(5), np.zeros((3000, 3), np.float32)
    for row in first:
        begin_noise(noise, row, random)
    np.testing.assert_allclose(first.std(axis=0), 1, atol=0.05)


def test_white_noise_factor_and_slow_arm() -> None:
    white = injected(NoiseSettings(kind="white", factor=0.5), simulation())
    np.testing.assert_allclose(white.std(axis=0), 0.2 * 0.5 * np.array([6.7, 1.9, 1.5]), rtol=0.01)
    assert abs(np.corrcoef(white[1:, 0], white[:-1, 0])[0, 1]) < 0.01


@pytest.mark.parametrize("velocity", ["derived", "network"])
def test_uniform_noise_is_a_share_of_the_range(velocity: str) -> None:
    """Of 1,023 counts of the angle 1 % are 10; pressures are within 9,999 here, velocities have twice their scale."""
    got = injected(NoiseSettings(kind="uniform", share=0.01, by_velocity=False), simulation(velocity))
    most = np.array([10.23, 0.1, 199.98, 199.98])[[0, 2, 3] if velocity == "derived" else slice(None)]
    np.testing.assert_allclose(np.abs(got).max(axis=0), most, rtol=0.001)
    np.testing.assert_allclose(got.std(axis=0), most / math.sqrt(3), rtol=0.01)
    assert abs(np.corrcoef(got[1:, 0], got[:-1, 0])[0, 1]) < 0.01
    slow = injected(NoiseSettings(kind="uniform", share=0.01), simulation(velocity))
    np.testing.assert_allclose(slow.std(axis=0), 0.2 * most / math.sqrt(3), rtol=0.01)


def test_network_for_the_velocity_and_two_joints() -> None:
    got = injected(NoiseSettings(kind="white", by_velocity=False), simulation("network", joints=2))
    np.testing.assert_allclose(got.std(axis=0), [6.7, 0.2, 1.9, 1.5, 3.0, 0.1, 1.0, 2.0], rtol=0.01)


@pytest.mark.parametrize("settings", [NoiseSettings(kind="none"), NoiseSettings(factor=0)])
def test_no_noise_draws_nothing(settings: NoiseSettings) -> None:
    noise, random = noise_parameters(settings, simulation()), random_state(0)
    change = np.ones(3, np.float32)
    add_noise(noise, np.zeros(20, np.float32), change, np.zeros(3, np.float32), random)
    assert change.tolist() == [1, 1, 1]
    assert random.tolist() == random_state(0).tolist()


@pytest.mark.parametrize("velocity", ["derived", "network"])
@pytest.mark.parametrize(
    ("omega", "share"), [(0, 0.2), (0.2, 0.2), (-0.2, 0.2), (0.6, 0.6), (-0.6, 0.6), (1.0, 1), (5, 1), (-1.7, 1)]
)
def test_share_by_velocity(velocity: str, omega: float, share: float) -> None:
    """20 % below 0.2 counts/ms, all above 1, linear in between, by the velocity that is predicted."""
    of = simulation(velocity)
    noise = noise_parameters(NoiseSettings(), of)
    x, change = np.zeros(20, np.float32), np.zeros(4, np.float32)
    if velocity == "derived":
        change[0] = omega * 1e3 * of.spec.period / 400
    else:
        x[1], change[1] = (0.3 - 0.1) / 5, (omega - 0.3) / 5
    assert noise_share(noise, 0, x, change) == pytest.approx(share, abs=1e-5)


@pytest.mark.parametrize(
    "wrong", [{"kind": "pink"}, {"factor": -1}, {"factor": math.nan}, {"steps": 0}, {"slow": 2}, {"slow_share": 1.5}]
)
def test_unusable_settings(wrong: dict) -> None:
    with pytest.raises(UnusableInput, match=next(iter(wrong))):
        NoiseSettings(**wrong)


@kernel
def _normals(random, record):  # type: ignore[no-untyped-def]
    for i in range(record.shape[0]):
        record[i] = normal(random)


def test_the_ziggurat_is_normal() -> None:
    """By Kolmogorov and Smirnov over everything, and by counts in the tail, where it is sampled otherwise."""
    stats = pytest.importorskip("scipy.stats")
    record = np.zeros(2_000_000)
    _normals(random_state(11), record)
    assert stats.kstest(record, "norm").pvalue > 0.01
    for beyond in (2.5, 3.6, 3.8, 4.2):
        expected = 2 * stats.norm.sf(beyond) * len(record)
        assert (np.abs(record) > beyond).sum() == pytest.approx(expected, abs=4 * math.sqrt(expected))
    assert abs(record[1:] @ record[:-1]) / len(record) < 4 / math.sqrt(len(record))

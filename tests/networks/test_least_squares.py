"""The linear fit and the importance of its inputs."""

import numpy as np
import pytest

from pneumarm.networks import importance, least_squares, nested_least_squares, nguyen_widrow


def test_a_linear_system_is_found_exactly() -> None:
    g = np.random.default_rng(0)
    x, weights, bias = g.normal(size=(500, 4)), g.normal(size=(4, 2)), np.array([3.0, -1.0])
    found = least_squares(x, x @ weights + bias)
    assert found.direct is not None
    np.testing.assert_allclose(found.direct, weights, atol=1e-10)
    np.testing.assert_allclose(found.output_bias, bias, atol=1e-10)
    np.testing.assert_allclose(found(x), x @ weights + bias, atol=1e-9)


def test_it_is_the_minimum_whatever_the_block() -> None:
    g = np.random.default_rng(1)
    x, y = g.normal(size=(333, 5)), g.normal(size=(333, 2))
    oracle = np.linalg.lstsq(np.column_stack([np.ones(333), x]), y, rcond=None)[0]
    for block in (1, 10, 333, 8192):
        found = least_squares(x, y, block)
        np.testing.assert_allclose(np.vstack([found.output_bias, found.direct]), oracle, atol=1e-10)


def test_nested_models_are_those_of_their_inputs_alone() -> None:
    g = np.random.default_rng(2)
    x, y = g.normal(size=(333, 9)), g.normal(size=(333, 2))
    x[:, 5] = x[:, 3] + x[:, 4]
    sizes = [1, 4, 6, 9]
    for size, found in zip(sizes, nested_least_squares(x, y, sizes, 100), strict=True):
        alone = least_squares(x[:, :size], y)
        assert found.direct is not None
        np.testing.assert_allclose(found.direct, alone.direct, atol=1e-10)
        np.testing.assert_allclose(found.output_bias, alone.output_bias, atol=1e-10)


def test_nearly_equal_inputs_need_no_squared_precision() -> None:
    """Angles a step apart differ by a millionth here: normal equations would lose all digits."""
    g = np.random.default_rng(2)
    base = g.normal(size=400)
    x = np.column_stack([base, base + 1e-6 * g.normal(size=400)])
    found = least_squares(x, x @ np.array([[2.0], [5.0]]))
    np.testing.assert_allclose(found.direct, [[2.0], [5.0]], rtol=1e-5)


def test_an_input_given_twice_shares_its_weight() -> None:
    x = np.random.default_rng(3).normal(size=(100, 1)) @ np.ones((1, 2))
    np.testing.assert_allclose(least_squares(x, 6 * x[:, :1]).direct, [[3.0], [3.0]], atol=1e-8)


def test_importance_is_in_standard_deviations() -> None:
    g = np.random.default_rng(4)
    x = g.normal(size=(20_000, 3)) * [1.0, 10.0, 1.0]
    y = 2 * x[:, :1] + 0.1 * x[:, 1:2]
    found = importance(least_squares(x, y), x, y, ["a", "b", "c"], ["y"])
    expected = np.array([2.0, 1.0, 0.0]) / np.sqrt(5)
    np.testing.assert_allclose(found.weight[:, 0], expected, atol=0.02)
    assert [name for name, _ in found.ranking(0)] == ["a", "b", "c"]


def test_networks_with_hidden_units_do_not_show_importance() -> None:
    x = np.zeros((5, 2))
    with pytest.raises(ValueError, match="linear"):
        importance(nguyen_widrow(2, 3, 1, 0), x, x[:, :1], ["a", "b"], ["y"])


def test_wrong_shapes_are_refused() -> None:
    with pytest.raises(ValueError, match=r"expected x \(n, inputs\)"):
        least_squares(np.zeros((5, 2)), np.zeros((4, 1)))

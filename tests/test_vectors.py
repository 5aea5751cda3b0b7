"""The vector loops: in kernels what they are in plain Python, at all sizes, in the order of the inputs."""

from typing import Any

import numpy as np
import pytest
from numba.core.errors import TypingError

from pneumarm.kernels import kernel
from pneumarm.vectors import LANES, ROWS, add_products, add_sums, follow, product, weighted_sums

SIZES = [
    (ROWS, LANES),
    (20, LANES),
    (20, 2 * LANES),
    (8, 3 * LANES),
    (20, 10 * LANES),
    (4, 18 * LANES),
    (12, 15 * LANES),
]
SPARE = 5
"""Columns and rows that are not meant, and must stay as they are."""


@kernel
def compiled(x: Any, table: Any, traces: Any, first: int, sums: Any) -> None:
    weighted_sums(x, table, first, sums)
    follow(table, traces, first, sums.shape[0], np.float32(0.5), np.float32(0.25))
    add_products(table, first, x, sums)


def numbers(*shape: int) -> np.ndarray:
    """Return multiples of 1/8 between -1 and 1: all that is made of them here is exact in float32."""
    return (np.random.default_rng(sum(shape)).integers(-8, 9, shape) / 8).astype(np.float32)


@pytest.mark.parametrize(("inputs", "units"), SIZES)
@pytest.mark.parametrize("first", [0, 3])
def test_kernels_do_what_the_functions_do(inputs: int, units: int, first: int) -> None:
    x, table, traces = (
        numbers(inputs),
        numbers(inputs + 2, units + SPARE),
        numbers(inputs + 2, units + SPARE)[::-1].copy(),
    )
    plain, followed, sums, expected = (
        table.copy(),
        traces.copy(),
        np.ones(units, np.float32),
        np.ones(units, np.float32),
    )
    compiled(x, table, traces, first, sums)

    weighted_sums(x, plain, first, expected)
    follow(plain, followed, first, units, np.float32(0.5), np.float32(0.25))
    add_products(plain, first, x, expected)
    for name, got, wanted in (("sums", sums, expected), ("table", table, plain), ("traces", traces, followed)):
        np.testing.assert_array_equal(got, wanted, err_msg=name)


@pytest.mark.parametrize("units", [LANES, 2 * LANES, 10 * LANES])
def test_sums_are_made_in_the_order_of_the_inputs(units: int) -> None:
    """1 is lost beside 1e8 and is there after 1e8 has gone: only one order gives each of these."""
    weights, sums = np.ones((8, units), np.float32), np.zeros(units, np.float32)
    for x, wanted in (
        ([1, 1e8, -1e8, 0, 0, 0, 0, 0], 0),
        ([1e8, 0, 0, 0, 0, -1e8, 0, 1], 1),
        ([1e8, 1, 0, 0, -1e8, 1, 0, 0], 1),
    ):
        compiled_sums(np.array(x, np.float32), weights, sums)
        np.testing.assert_array_equal(sums, np.full(units, wanted))


@kernel
def compiled_sums(x: Any, weights: Any, sums: Any) -> None:
    weighted_sums(x, weights, 0, sums)


@kernel
def added_in_kernels(weights: Any, x: Any, out: Any) -> None:
    add_sums(weights, x, out)


@pytest.mark.parametrize("samples", [1, 7, LANES, 2 * LANES + 3, 3 * LANES, 12 * LANES, 61])
@pytest.mark.parametrize(("inputs", "outputs"), [(0, 3), (1, 1), (3, 5), (12, 32), (45, 48)])
@pytest.mark.parametrize("turned", [False, True])
def test_sums_over_many_samples_are_those_of_plain_python(
    samples: int, inputs: int, outputs: int, turned: bool
) -> None:
    shape = inputs + SPARE, outputs + SPARE
    weights = numbers(*shape[::-1]).T if turned else numbers(*shape)
    x, out = numbers(inputs, samples), numbers(outputs + SPARE, samples)
    expected = out.copy()
    added_in_kernels(weights, x, out[:outputs])

    add_sums(weights, x, expected[:outputs])
    np.testing.assert_array_equal(out, expected)


def test_sums_of_a_sample_do_not_depend_on_those_beside_it() -> None:
    random = np.random.default_rng(0)
    weights, x = random.random((45, 48), np.float32), random.random((45, 61), np.float32)
    together, alone = np.zeros((48, 61), np.float32), np.zeros((48, 1), np.float32)
    added_in_kernels(weights, x, together)
    for sample in range(61):
        alone[:] = 0
        added_in_kernels(weights, np.ascontiguousarray(x[:, sample : sample + 1]), alone)
        np.testing.assert_array_equal(alone[:, 0], together[:, sample])


@pytest.mark.parametrize("wrong", [np.zeros((5, 9)), np.zeros((5, 18), np.float32)[:, ::2]])
def test_sums_over_many_samples_refuse_other_arrays_where_they_are_compiled(wrong: Any) -> None:
    with pytest.raises(TypingError):
        added_in_kernels(np.zeros((5, 4), np.float32), wrong, np.zeros((4, 9), np.float32))


@kernel
def multiplied(a: Any, b: Any) -> Any:
    return product(a, b)


@pytest.mark.parametrize("size", [0, LANES, 3 * LANES, 16 * LANES])
def test_a_product_is_what_the_function_says(size: int) -> None:
    a, b = numbers(size), numbers(size)[::-1].copy()
    assert multiplied(a, b) == product(a, b) == a @ b

"""The vector loops: in kernels what they are in plain Python, at all sizes, in the order of the inputs."""

from typing import Any

import numpy as np
import pytest

from pneumarm.kernels import kernel
from pneumarm.vectors import LANES, ROWS, add_products, follow, weighted_sums

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

"""Orthogonal arrays: strength 2, the standard order, and interactions that the array itself tells."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneumarm.errors import UnusableInput
from pneumarm.experiments.design.arrays import LINEAR, NAMES, OrthogonalArray, difference_scheme, orthogonal_array

SHAPES = {
    "L4": (4, [2] * 3),
    "L8": (8, [2] * 7),
    "L16": (16, [2] * 15),
    "L32": (32, [2] * 31),
    "L9": (9, [3] * 4),
    "L27": (27, [3] * 13),
    "L18": (18, [2] + [3] * 7),
}


@pytest.fixture(params=NAMES)
def array(request: pytest.FixtureRequest) -> OrthogonalArray:
    return orthogonal_array(request.param)


def test_arrays_have_the_shapes_of_their_names(array: OrthogonalArray) -> None:
    assert (array.trials, array.counts.tolist()) == SHAPES[array.name]
    assert set(SHAPES) == set(NAMES)


def test_every_pair_of_levels_is_equally_frequent_in_every_pair_of_columns(array: OrthogonalArray) -> None:
    for first, second in itertools.combinations(range(array.columns), 2):
        counts = array.counts[[first, second]]
        pairs = array.levels[:, first] * counts[1] + array.levels[:, second]
        found = np.bincount(pairs, minlength=counts.prod())
        assert (found == array.trials / counts.prod()).all(), (first + 1, second + 1)


def test_every_trial_differs_from_every_other(array: OrthogonalArray) -> None:
    assert len(np.unique(array.levels, axis=0)) == array.trials


def test_trials_begin_with_all_factors_at_their_lowest_level(array: OrthogonalArray) -> None:
    assert (array.levels[0] == 0).all()
    assert (np.diff(array.levels[:, 0]) >= 0).all()


def test_l9_is_the_printed_one() -> None:
    printed = "1111 1222 1333 2123 2231 2312 3132 3213 3321"
    assert [[int(d) - 1 for d in row] for row in printed.split()] == orthogonal_array("L9").levels.tolist()


def test_l27_is_the_printed_one_where_a_single_factor_changes() -> None:
    """TrialRows 2, 4 and 10 of the printed array are those whose number has one digit that is not 0."""
    levels = orthogonal_array("L27").levels + 1
    for row, printed in ((2, "1111222222222"), (4, "1222111222333"), (10, "2123123123123")):
        assert levels[row - 1].tolist() == [int(digit) for digit in printed]


@pytest.mark.parametrize("name", [name for name in LINEAR if LINEAR[name][0] == 2])
def test_interactions_of_two_levels_are_products(name: str) -> None:
    array = orthogonal_array(name)
    for first, second in itertools.combinations(range(1, array.columns + 1), 2):
        (column,) = array.interaction(first, second)
        assert column == first ^ second  # in the standard order columns are numbered so
        assert (array.column(column) == array.column(first) ^ array.column(second)).all()


@pytest.mark.parametrize("name", ["L9", "L27"])
def test_interactions_of_three_levels_have_two_columns(name: str) -> None:
    array = orthogonal_array(name)
    for first, second in itertools.combinations(range(1, array.columns + 1), 2):
        sums = [(array.column(first) + k * array.column(second)) % 3 for k in (1, 2)]
        for column in array.interaction(first, second):
            relabelled = [(m * array.column(column)) % 3 for m in (1, 2)]
            assert any((a == b).all() for a in sums for b in relabelled)
        assert len(array.interaction(first, second)) == 2


def test_interactions_spread_in_the_mixed_array() -> None:
    """In L18 the column of two levels is free of all interactions; of the others one triple decides each other."""
    array = orthogonal_array("L18")
    pairs = itertools.combinations(range(1, array.columns + 1), 2)
    found = {pair: array.interaction(*pair) for pair in pairs if array.interaction(*pair)}
    triples = {frozenset((*pair, *columns)) for pair, columns in found.items()}
    assert len(triples) == 1
    assert len(found) == 3
    assert 1 not in next(iter(triples))


@given(st.integers(0, 5), st.integers(0, 5))
@settings(deadline=None)
def test_differences_in_the_scheme_are_balanced(first: int, second: int) -> None:
    scheme = difference_scheme()
    counts = np.bincount((scheme[:, first] - scheme[:, second]) % 3, minlength=3)
    assert counts.tolist() == ([6, 0, 0] if first == second else [2, 2, 2])


def test_what_is_no_array_is_refused() -> None:
    with pytest.raises(UnusableInput, match="no orthogonal array 'L12'; there are L4"):
        orthogonal_array("L12")
    with pytest.raises(UnusableInput, match="L4 has the columns 1 to 3, not 4"):
        orthogonal_array("L4").column(4)
    with pytest.raises(UnusableInput, match="no interaction with itself"):
        orthogonal_array("L4").interaction(2, 2)

"""The filter keeps what section 3.2.3 says, whatever the blocks; what it leaves out can be streamed."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from stand_ins import make_recorded

from pneumarm.arm import ArmSpec
from pneumarm.arm.valves import ACTIONS, to_valves
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.transitions import Grid, GridSettings, Store, Window, filter_transitions, held_out, new_cells
from pneumarm.transitions.choice import hashed_uniform, join_transitions, sample, share_held_out
from pneumarm.transitions.grid import CellCounts, Coverage

COARSE = GridSettings(angle_bins=3, velocity_bins=2, pressure_bins=2)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """A store of 60 sequences of 100 transitions."""
    path = tmp_path_factory.mktemp("filter") / "s.db"
    with Store.create(path, ArmSpec()) as store:
        store.append_all(make_recorded(i, n=101) for i in range(60))
        yield store


def unit_grid(joints=1, bins=8, valves=True):
    window = Window(joints, 1)
    dimensions = 4 * joints + (0 if valves else 2 * joints)
    return Grid(window, np.zeros(dimensions), np.ones(dimensions), np.full(dimensions, bins), valves)


@pytest.mark.parametrize(("joints", "cells"), [(1, 36_864), (2, 36_864**2), (3, 36_864**3)])
def test_cells_are_numbered_without_gaps_or_collisions(joints, cells):
    grid = unit_grid(joints)
    assert grid.size == cells
    random = np.random.default_rng(0)
    places = random.integers(0, 8, (500, 4 * joints))
    actions = random.integers(0, ACTIONS, (500, joints))
    inputs = np.concatenate([(places + 0.5) / 8, to_valves(actions).reshape(500, -1)], axis=1)
    expected = np.ravel_multi_index([*places.T, *actions.T], [8] * 4 * joints + [ACTIONS] * joints)
    np.testing.assert_array_equal(grid.cells(inputs), expected)


def test_continuous_commands_are_divided_too():
    grid = unit_grid(valves=False, bins=3)
    assert grid.size == 3**6
    inputs = np.full((2, 6), 0.1)
    inputs[1, 5] = 0.5
    assert grid.cells(inputs).tolist() == [0, 1]


def test_what_is_outside_counts_to_the_outermost_cells():
    grid = unit_grid()
    inputs = np.zeros((2, 6))
    inputs[0, :4], inputs[1, :4] = -1e30, 1e30
    inputs[:, 4:] = -1, 1
    first, last = grid.cells(inputs)
    assert (first, last) == (2, 36_864 - 9 + 2)


@given(st.lists(arrays(np.int64, st.integers(0, 30), elements=st.integers(0, 40)), max_size=12))
@settings(deadline=None)
def test_counts_of_a_stream_equal_those_of_the_whole(parts):
    counts = CellCounts()
    for part in parts:
        counts.add(part)
        counts.of(part)  # may be asked at any time
    everything = np.concatenate([*parts, np.zeros(0, np.int64)])
    occupied, held = np.unique(everything, return_counts=True)
    np.testing.assert_array_equal(counts.arrays()[0], occupied)
    np.testing.assert_array_equal(counts.arrays()[1], held)
    expected = np.bincount(everything, minlength=50)
    np.testing.assert_array_equal(counts.of(np.arange(50)), expected)


def test_cells_with_few_are_kept_whole_and_full_cells_on_average(store):
    window = Window(1, 3)
    kept = np.zeros(0)
    for seed in range(40):
        filtered = filter_transitions(store, window, COARSE, seed=seed)
        cells = filtered.filter.grid.cells(filtered.transitions.inputs)
        occupied, counts = filtered.filter.counts.arrays()
        of_cell = np.bincount(np.searchsorted(occupied, cells), minlength=len(occupied))
        few = counts <= 5
        np.testing.assert_array_equal(of_cell[few], counts[few])
        kept = np.append(kept, of_cell[~few].mean())
    assert (~few).sum() > 100
    # the mean number kept of a full cell is n = 5, within four standard errors
    assert kept.mean() == pytest.approx(5, abs=4 * np.sqrt(5 / (~few).sum() / 40))
    assert kept.std() > 0


def test_coverage_counts_what_is_there(store):
    filtered = filter_transitions(store, Window(1, 3), COARSE)
    coverage = filtered.coverage
    _, counts = filtered.filter.counts.arrays()
    assert coverage.cells == 3 * 2 * 2 * 2 * 9
    assert coverage.seen == counts.sum() == store.transitions
    assert coverage.occupied == len(counts) == sum(coverage.histogram)
    assert coverage.full == (counts >= 5).sum()
    assert coverage.kept == len(filtered.transitions.sequence)
    assert coverage.kept == pytest.approx(filtered.filter.expected(), rel=0.1)
    expected = [int(((counts >= 2**i) & (counts < 2 ** (i + 1))).sum()) for i in range(len(coverage.histogram))]
    assert list(coverage.histogram) == expected
    assert coverage.summary()["cells_occupied"] == coverage.occupied


def test_the_chance_of_an_empty_cell_is_that_of_good():
    counts = np.array([1, 1, 4, 2])
    assert Coverage.of(unit_grid(), counts, 5, 8).unseen == 2 / 8
    assert Coverage.of(unit_grid(), np.zeros(0, np.int64), 5, 0).unseen == 1.0


def same(one, other):
    return all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


@pytest.mark.parametrize("rows", [101, 1000, 10_000])
def test_the_outcome_depends_on_the_seed_but_not_on_the_blocks(store, rows):
    window = Window(1, 2)
    one = filter_transitions(store, window, COARSE, seed=3, hold_out=0.2)
    other = filter_transitions(store.blocks(rows=rows), window, COARSE, seed=3, hold_out=0.2)
    assert same(one.transitions, other.transitions)
    assert one.coverage == other.coverage
    assert same(one.sample("generalisation", 50), other.sample("generalisation", 50))
    assert not same(one.sample("kept", 50), filter_transitions(store, window, COARSE, seed=4).sample("kept", 50))


def test_the_three_parts_are_disjoint_and_complete(store):
    filtered = filter_transitions(store, Window(1, 3), COARSE, seed=1, hold_out=0.25)
    keys = {}
    for part in ("kept", "generalisation", "held-out"):
        streamed = join_transitions(list(filtered.stream(part)))
        keys[part] = set(zip(streamed.sequence.tolist(), streamed.step.tolist(), strict=True))
    assert sum(map(len, keys.values())) == len(set.union(*keys.values())) == store.transitions
    apart = {sequence for sequence, _ in keys["held-out"]}
    assert not apart & {sequence for sequence, _ in keys["kept"] | keys["generalisation"]}
    assert 5 <= len(apart) <= 25
    assert same(filtered.transitions, join_transitions(list(filtered.stream("kept"))))
    assert set(np.flatnonzero(held_out(np.arange(61), 0.25, 1))) - {0} == apart


def test_held_out_sequences_do_not_change_with_more_data():
    few, many = held_out(np.arange(100), 0.1, 5), held_out(np.arange(10_000), 0.1, 5)
    np.testing.assert_array_equal(few, many[:100])
    assert many.mean() == pytest.approx(0.1, abs=0.01)
    assert held_out(7, 1.0).tolist() == [True]
    assert not held_out(np.arange(1000), 0.0).any()


@given(st.integers(0, 2**31), st.integers(3, 30), st.floats(0.0, 0.5))
def test_of_few_sequences_at_least_one_is_held_out_and_one_is_not(seed, count, fraction):
    sequences = np.arange(1, count + 1)
    share = share_held_out(sequences, fraction, seed)
    usual, apart = held_out(sequences, fraction, seed), held_out(sequences, share, seed)
    if usual.any():
        assert share == fraction
    else:
        assert apart.sum() == 1
        assert share_held_out(sequences[~apart], fraction, seed) > share  # the smallest that does it


def test_a_single_sequence_is_not_held_out_for_want_of_others():
    alone = [share_held_out(np.array([1]), 0.1, seed) for seed in range(50)]
    assert alone == [0.1] * 50


@given(st.integers(0, 2**40), st.integers(0, 2**40))
def test_hashes_are_uniform_and_of_both_numbers(seed, first):
    count = 2000
    for numbers in (
        (np.arange(first, first + count), 0),
        (first, np.arange(count)),
        (np.arange(count), np.arange(count)),
    ):
        uniform = hashed_uniform(seed, *np.broadcast_arrays(*numbers))
        assert ((uniform >= 0) & (uniform < 1)).all()
        assert uniform.mean() == pytest.approx(0.5, abs=6 / np.sqrt(12 * count))
        assert len(set(uniform.tolist())) == count


def test_a_sample_is_as_large_as_asked_in_order_and_uniform(store):
    blocks = list(filter_transitions(store, Window(1, 1), COARSE).stream("generalisation"))
    everything = join_transitions(blocks)
    total = len(everything.sequence)
    drawn = sample(blocks, 500, 1)
    assert len(drawn.sequence) == 500
    keys = drawn.sequence * 1000 + drawn.step
    assert (np.diff(keys) > 0).all()
    assert drawn.sequence.mean() == pytest.approx(everything.sequence.mean(), abs=4)
    assert same(sample(blocks, total, 1), everything)
    assert sample([], 5) is None
    assert same(sample([everything], 500, 1), drawn)


def test_more_than_the_most_is_thinned_alike(store):
    few = filter_transitions(store, Window(1, 1), GridSettings(most=300))
    assert few.filter.expected() == pytest.approx(300)
    assert len(few.transitions.sequence) == pytest.approx(300, abs=80)


def test_the_grid_spans_nearly_all_of_the_data(store):
    everything = filter_transitions(store, Window(1, 1), GridSettings(inside=1.0)).filter.grid
    angle = np.concatenate([block.angle for block in store])
    assert (everything.low[0], everything.high[0]) == (angle.min(), angle.max())
    nearly = filter_transitions(store, Window(1, 1), GridSettings(inside=0.9)).filter.grid
    assert (nearly.low > everything.low).all()
    assert (nearly.high < everything.high).all()


def test_cells_that_hold_data_are_told_from_those_that_do_not(store):
    chosen = filter_transitions(store, Window(1, 3), COARSE).filter
    block = next(iter(filter_transitions(store, Window(1, 3), COARSE).stream("kept")))
    assert chosen.holds_data(block.inputs).all()
    sparse = filter_transitions(store, Window(1, 3), GridSettings(angle_bins=400)).filter
    moved = block.inputs.copy()
    moved[:, 2] = moved[::-1, 2]
    assert 0.2 < 1 - sparse.holds_data(moved).mean() < 1


def test_ten_dimensions_take_memory_for_occupied_cells_only(tmp_path):
    with Store.create(tmp_path / "two.db", ArmSpec(joints=2)) as store:
        store.append_all(make_recorded(i, n=101, joints=2) for i in range(20))
        filtered = filter_transitions(store, Window(2, 3))
    assert filtered.coverage.cells == (5**4 * 9) ** 2
    assert filtered.coverage.occupied <= 2000
    assert filtered.transitions.inputs.shape[1] == Window(2, 3).input_size


def test_continuous_commands_are_recognised(tmp_path):
    with Store.create(tmp_path / "c.db", ArmSpec(), valves=False) as store:
        store.append_all(make_recorded(i, n=101, valves=False) for i in range(20))
        filtered = filter_transitions(store, Window(1, 3))
        assert not filtered.filter.grid.valves
        assert filtered.coverage.cells == 8**4 * 3**2


def test_pulses_are_divided_and_share_the_cells_of_valves(tmp_path):
    def mixed(number):
        one = make_recorded(number, n=101)
        share = np.random.default_rng([number, 1]).choice([1.0, 0.5, 0.2], one.command.shape)
        return replace(one, command=one.command * share)

    with Store.create(tmp_path / "p.db", ArmSpec()) as store:
        store.append_all(mixed(i) for i in range(20))
        grid = filter_transitions(store, Window(1, 3)).filter.grid
    assert grid.size == 8**4 * 3**2
    inputs = np.zeros((5, Window(1, 3).input_size))
    inputs[:, -2] = -1.0, -0.5, 0.2, 0.5, 1.0
    cells = grid.cells(inputs)
    assert cells[0] == cells[1] < cells[2] < cells[3] == cells[4]


def test_new_cells_are_those_of_the_second_half(store):
    few = new_cells(store, Window(1, 1))  # random rows in 36,864 cells: every second one is new
    assert few.share > 0.1
    assert few.half.seen == 3000
    assert few.whole.seen == 6000
    assert few.count == few.whole.occupied - few.half.occupied
    assert new_cells(store, Window(1, 1), COARSE).share <= 0.1
    for rows in (101, 5000):  # the half does not depend on the blocks
        assert new_cells(store.blocks(rows=rows), Window(1, 1)) == few


def test_mistakes_are_told(store, tmp_path):
    with pytest.raises(PneumarmError, match="read several times"):
        filter_transitions(iter(store), Window(1, 3))
    with pytest.raises(UnusableInput, match=r"the data has 1 joint\(s\), the window 2"):
        filter_transitions(store, Window(2, 3))
    with pytest.raises(UnusableInput, match="within 0 to 1"):
        filter_transitions(store, Window(1, 3), hold_out=1.0)
    with pytest.raises(UnusableInput, match="cannot be numbered"):
        filter_transitions(store, Window(1, 3), GridSettings(angle_bins=10**6, pressure_bins=10**6))
    with pytest.raises(UnusableInput, match="per_cell cannot be 0; expected a whole number, 1 or more"):
        GridSettings(per_cell=0)
    with (
        Store.create(tmp_path / "e.db", ArmSpec()) as empty,
        pytest.raises(UnusableInput, match="not a single complete"),
    ):
        filter_transitions(empty, Window(1, 3))

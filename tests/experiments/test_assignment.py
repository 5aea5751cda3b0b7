"""Factors on columns: table 5.3, assignments without confusion, aliases, design files."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneumarm.errors import UnusableInput
from pneumarm.experiments.design import WantedFactor, assign, load_design, orthogonal_array, thesis_design

# Thesis table 5.3: the labels of the columns, and the levels of its 16 trials.
LABELS = ("a", "b", "ab", "c", "ac", "bc", "de", "ce", "bd", "ad", "d", "e", "ae", "be", "cd")
TABLE = (
    "---------------",
    "-------++++++++",
    "---++++----++++",
    "---++++++++----",
    "-++--++--++--++",
    "-++--++++--++--",
    "-++++----++++--",
    "-++++--++----++",
    "+-+-+-+-+-+-+-+",
    "+-+-+-++-+-+-+-",
    "+-++-+--+-++-+-",
    "+-++-+-+-+--+-+",
    "++--++--++--++-",
    "++--++-+--++--+",
    "++-+--+-++-+--+",
    "++-+--++--+-++-",
)

PAIRS = ["".join(pair) for pair in itertools.combinations("abcde", 2)]


def wanted(letters: str, levels: int = 2) -> list[WantedFactor]:
    return [WantedFactor(letter, letter, tuple(range(levels))) for letter in letters]


def test_the_default_design_is_table_5_3() -> None:
    design = thesis_design()
    assert design.labels() == LABELS
    levels = [["-+".index(sign) for sign in row] for row in TABLE]
    assert design.array.levels.tolist() == levels
    assert {factor.label: factor.column for factor in design.factors} == {"a": 1, "b": 2, "c": 4, "d": 11, "e": 12}


def test_settings_of_trials_are_those_of_table_5_4() -> None:
    design = thesis_design()
    assert design.settings(10) == {"a": 0.10, "b": 5, "c": "sarsa", "d": 0.0, "e": 0.98}
    assert design.settings(1) == {"a": 0.05, "b": 5, "c": "sarsa", "d": 0.0, "e": 0.95}
    for trial in range(1, 17):
        row = design.array.levels[trial - 1]
        assert design.trial({factor.label: int(row[factor.column - 1]) for factor in design.factors}) == trial
    # The 32 combinations are the 16 trials and as many that are none.
    combinations = [dict(zip("abcde", levels, strict=True)) for levels in itertools.product((0, 1), repeat=5)]
    assert sum(design.trial(levels) is None for levels in combinations) == 16


def test_aliases_of_the_thesis_design() -> None:
    """Five factors on 16 trials: every pair is confused with the three others together, no factor with fewer."""
    found = thesis_design().aliases()
    for pair in PAIRS:
        assert found[pair] == ("".join(letter for letter in "abcde" if letter not in pair),)
    assert all(found[letter] == () for letter in "abcde")
    assert thesis_design().aliases(most=4)["a"] == ("bcde",)


@given(st.integers(2, 5), st.sets(st.sampled_from(PAIRS), max_size=10))
@settings(max_examples=40, deadline=None)
def test_assignments_keep_factors_and_wanted_interactions_apart(count: int, pairs: set[str]) -> None:
    letters = "abcde"[:count]
    pairs = {pair for pair in pairs if set(pair) <= set(letters)}
    design = assign(orthogonal_array("L16"), wanted(letters), sorted(pairs))
    used = [factor.column for factor in design.factors]
    for pair in pairs:
        used += design.array.interaction(design.factor(pair[0]).column, design.factor(pair[1]).column)
    assert len(set(used)) == len(used) == count + len(pairs)


def test_mixed_and_three_level_designs() -> None:
    mixed = assign(orthogonal_array("L18"), [*wanted("ab", 3), *wanted("c", 2)])
    assert mixed.factor("c").column == 1
    nine = assign(orthogonal_array("L9"), wanted("ab", 3), ["ab"])
    assert nine.labels() == ("a", "b", "ab", "ab")
    with pytest.raises(UnusableInput, match="two levels"):
        nine.aliases()


@pytest.mark.parametrize(
    ("array", "factors", "pairs", "words"),
    [
        ("L4", wanted("abcd"), [], "no columns of its own"),
        ("L8", wanted("abcde"), PAIRS, "take a larger array"),
        ("L16", wanted("ab", 3), [], "no columns of its own"),
        ("L18", wanted("ab", 3), ["ab"], "no columns of its own"),
        ("L16", wanted("ab"), ["ax"], "labels of two factors"),
        ("L4", [WantedFactor("a", "a", (0, 1), 7)], [], "columns 1 to 3, not 7"),
        ("L4", [*wanted("a"), *wanted("a")], [], "labels of a design's factors must differ"),
    ],
)
def test_what_cannot_be_assigned_is_refused(
    array: str, factors: list[WantedFactor], pairs: list[str], words: str
) -> None:
    with pytest.raises(UnusableInput, match=words):
        assign(orthogonal_array(array), factors, pairs)


def test_design_files(tmp_path: Path) -> None:
    file = tmp_path / "design.toml"
    factor = '[[factors]]\nlabel = "{0}"\nname = "factor {0}"\nlevels = [1, 2]\n'
    file.write_text('array = "L8"\ninteractions = ["xy"]\n' + "".join(factor.format(label) for label in "xyz"))
    design = load_design(file)
    assert design.labels() == ("x", "y", "xy", "z", "xz", "yz", "")
    assert np.array_equal(design.array.levels, orthogonal_array("L8").levels)
    for text in ("array = 3", "array =", 'array = "L8"\nfactors = []\nother = 1'):
        file.write_text(text)
        with pytest.raises(UnusableInput, match="expected a design"):
            load_design(file)
    with pytest.raises(UnusableInput, match="cannot be read"):
        load_design(tmp_path / "none.toml")

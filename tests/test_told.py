"""Figures come with what is normal, and what looks wrong but is not is explained."""

import numpy as np
import pytest

from pneumarm.arm import ArmSpec
from pneumarm.commands.collect_ import _above_limit
from pneumarm.commands.figures import figure_rows
from pneumarm.moving.told import Normal, told_figures

FOUND = {
    "movements": 40,
    "tolerance_deg": 1.0,
    "settled": 0.975,
    "median_seconds": 0.334,
    "rest_error_deg": 0.107,
    "overshoot_deg": 0.76,
}


def test_settling_is_told_in_four_figures_with_what_is_normal() -> None:
    told = told_figures(FOUND)
    assert [one.value for one in told] == ["97.5 %", "0.33 s", "0.11°", "0.8°"]
    assert [one.name.split(",")[0] for one in told] == ["settled within 1°", "time", "rest error", "overshoot"]
    assert [one.normal for one in told] == ["90 % or more", "0.8 s or less", "0.3° or less", "2° or less"]
    assert all(one.is_normal for one in told)
    assert [row[2].endswith("(!)") for row in figure_rows(FOUND, Normal(0.98, 0.2, 0.1, 0.5))] == [True] * 4


def test_what_is_not_known_is_left_open() -> None:
    never = told_figures({**FOUND, "settled": 0.0, "median_seconds": None})
    assert [one.value for one in never[:2]] == ["0 %", "–"]
    assert len(told_figures({name: value for name, value in FOUND.items() if name != "overshoot_deg"})) == 3


@pytest.mark.parametrize(("peak", "words"), [(1.05, ""), (1.13, "That is normal"), (1.4, "pneumarm arm check")])
def test_a_pressure_above_the_limit_is_explained(peak: float, words: str) -> None:
    said = _above_limit(peak, ArmSpec())
    assert len(said) == bool(words)
    assert all(words in line and f"{peak:.2f} bar, is above the limit of 1.05 bar" in line for line in said)


def test_a_pressure_that_is_estimated_is_not_compared() -> None:
    assert _above_limit(np.inf, ArmSpec(pressure_sensors=False, safe_supply=True)) == []

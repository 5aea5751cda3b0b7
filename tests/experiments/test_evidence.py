"""What rows say of arms, and how it is said: samples, differences, verdicts, tables and pictures."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import spearmanr

from pneumarm.experiments.analysis import filled_words, number, shown_trials
from pneumarm.experiments.claims import conclusions
from pneumarm.experiments.experiment import Axis, Row, TrialRows, sorted_rows
from pneumarm.experiments.factorial import rank_correlation
from pneumarm.experiments.means import (
    change,
    difference,
    estimate,
    from_series,
    mean,
    means_table,
    numbers,
    over_arms,
    samples,
    series,
    text,
)
from pneumarm.experiments.overnight.analysis import answer
from pneumarm.experiments.pictures import Curve, against, courses, dots
from pneumarm.experiments.registry import PLACES, experiment
from pneumarm.experiments.verdict import Criterion, Interval, interval
from pneumarm.experiments.words import ClaimWords, Column, Quantity, Words

TRIALS = {1: "one", 2: "the second of them"}
VALUES = {("a", 1): (1.0, 3.0), ("a", 2): (2.0, 6.0), ("b", 1): (5.0, 5.0), ("b", 2): (8.0, 10.0)}
ROWS = sorted_rows(
    Row(arm, trial, run, {"x": x}, 0.0) for (arm, trial), xs in VALUES.items() for run, x in enumerate(xs, 1)
)
TABLES = arrays(
    np.float64,
    st.tuples(st.integers(2, 5), st.integers(1, 4)),
    elements=st.floats(-100, 100, width=32),
)


def test_arms_are_the_sample_and_runs_where_there_is_one() -> None:
    assert samples(ROWS, "x", 1).tolist() == [2.0, 5.0]
    assert mean(ROWS, "x", 1).mean == 3.5
    found = difference(ROWS, "x", 2, 1)  # 2 on arm a, 4 on arm b
    assert (found.mean, found.samples) == (3.0, 2)
    assert found.half == pytest.approx(12.7062, abs=1e-3)  # Student's t for one degree of freedom, times 1
    assert change(ROWS, "x", 2, 1).mean == pytest.approx((100 + 80) / 2)
    twice = Quantity(figure="x", less="x", factor=2.0)
    assert estimate(ROWS, Quantity(figure="x", factor=2.0), 2, 1).mean == 6.0
    assert estimate(ROWS, twice, 2).mean == estimate(ROWS, twice, 2, 1).mean == 0.0
    assert estimate(ROWS, Quantity(figure="x", percent=True), 2, 1) == change(ROWS, "x", 2, 1)
    assert estimate(ROWS, Quantity(figure="x", less="x", percent=True), 2).mean == 0.0
    alone = sorted_rows(row for row in ROWS.rows if row.arm == "a")
    assert samples(alone, "x", 1).tolist() == [1.0, 3.0]
    assert mean(alone, "x", 1).samples == 2


def test_what_is_missing_in_a_row_does_not_count() -> None:
    def row(arm: str, run: int, **figures: float) -> Row:
        return Row(arm, 1, run, figures, 0.0)

    two = TrialRows((row("a", 1, x=1.0), row("a", 2, x=3.0), row("b", 1, x=8.0), row("b", 2)))
    assert mean(two, "x", 1)[:3:2] == (5.0, 2)
    assert f"{mean(two, 'x', 1).times(-1):.0f}" == "−5\u00a0±\u00a038"  # half is t(0.975, 1) 12.7 times 3
    one = TrialRows((row("a", 1, x=1.0), row("a", 2, x=3.0)))
    assert f"{mean(one, 'y', 1):.2f}" == "none"
    assert difference(one, "x", 1, 1).half == 0


@given(TABLES)
def test_an_arm_of_which_nothing_is_known_is_none(values: np.ndarray) -> None:
    """Nor is a run, where its arm has others: what is left has the mean and interval that it had alone."""
    assert over_arms(values)[:3] == pytest.approx(interval(values.mean(axis=1))[:3], nan_ok=True)
    unknown = np.full((1, values.shape[1]), math.nan)
    assert over_arms(np.vstack([values, unknown])) == over_arms(values)
    assert over_arms(np.hstack([values, unknown[:, :1].repeat(len(values), 0)])) == over_arms(values)
    assert over_arms(np.vstack([unknown, unknown])).samples == 0


def test_series_of_figures() -> None:
    assert from_series(series("a", [3, 1, 2]) | series("ab", [5]), "a").tolist() == [3, 1, 2]
    assert from_series({}, "a").size == 0


def test_values_and_differences_in_words() -> None:
    found = Interval(1.25, 0.5, 3)
    assert (f"{found:.1f}", f"{found:+.2f}", f"{found:.0%}") == (
        "1.2\u00a0±\u00a00.5",
        "+1.25\u00a0±\u00a00.50",
        "125\u00a0±\u00a050\u00a0%",
    )
    assert f"{Interval(-12345.6, 1234.5, 3):+.0f}" == "−12,346\u00a0±\u00a01,234"
    assert f"{Interval(-1.0, math.inf, 1):+.2f}" == "−1.00"
    assert f"{Interval(-0.004, 0.01, 3):+.2f}" == "+0.00\u00a0±\u00a00.01"
    assert f"{found}" == str(found) == "+1.25\u00a0±\u00a00.50"


def test_a_table_says_what_programs_are_told() -> None:
    percent = Column(figure="x", words="x [%]", digits=1, factor=100.0, thesis={TRIALS[2]: 0.5})
    columns = [percent, Column(figure="x", words="x")]
    made = means_table(ROWS, TRIALS, columns, "Means.")
    assert made.header == ["trial", "x [%]", "thesis", "x"]
    told = numbers(ROWS, TRIALS, columns)["x"]
    for line, words, thesis in zip(made.rows, TRIALS.values(), ("", "0.5"), strict=True):
        found = Interval(told[words]["mean"], told[words]["half"], 2)
        assert line[1:] == [f"{found.times(100):.1f}", thesis, f"{found:.2f}"]
        assert line[0].replace("\N{NO-BREAK SPACE}", " ") == words


def test_words_are_filled_with_what_was_found_and_claims_left_out_that_lack_it() -> None:
    found = {"sure": Interval(5.0, 1.0, 5), "vague": Interval(0.0, 9.0, 5), "unknown": None}
    stated = [
        Criterion(figure=names, above=0.0, matters=1.0) for names in ("sure", ("sure", "vague"), ("sure", "unknown"))
    ]
    claims = tuple(ClaimWords("says {sure:.1f}", "yes", "{vague:.0f}", one) for one in stated)
    words = Words("title", "question", "source", ("{sure:+.2f}",), claims={"key": claims}).filled(found)
    assert words.summary == ("+5.00\u00a0±\u00a01.00",)
    assert [claim.stated for claim in words.claims["key"]] == stated[:2]
    assert {(claim.claim, claim.ours) for claim in words.claims["key"]} == {
        ("says 5.0\u00a0±\u00a01.0", "0\u00a0±\u00a09")
    }


def test_pictures_say_in_words_what_they_draw() -> None:
    column = Column(figure="x", words="the x [-]", digits=1)
    made = against(ROWS, TRIALS, Axis("place [-]", (0.5, 2.0)), [column], "X by place.")
    assert made.alt == f"the x [-]: {text(ROWS, column, 1)} (one), {text(ROWS, column, 2)} (the second of them)."
    ticks = made.figure.axes[0].get_xticklabels()
    assert [tick.get_text() for tick in ticks] == ["0.5", "2"]
    found = [mean(ROWS, "x", trial) for trial in TRIALS]
    lines = dots(list(TRIALS.values()), {"x\n[-]": found}, "X.", zero=True, reference=1)
    assert lines.alt == f"x [-]: one {found[0]:.2f}, the second of them {found[1]:.2f}."
    drawn = [line.get_xdata()[0] for line in lines.figure.axes[0].lines[:2]]
    assert drawn == [0, found[1].mean]
    course = courses({"x [-]": [Curve("agent", np.arange(12.0).reshape(2, 2, 3))]}, 10, "X.", {15.0: "rest"})
    assert course.alt.startswith("x [-]: agent from 4.50\u00a0±\u00a0")
    assert course.figure.axes[0].lines[0].get_xdata().tolist() == [5, 15, 25]


@given(arrays(np.float64, 12, elements=st.integers(0, 6)), arrays(np.float64, 12, elements=st.integers(0, 6)))
def test_rank_correlation(first: np.ndarray, second: np.ndarray) -> None:
    if np.ptp(first) == 0 or np.ptp(second) == 0:
        assert rank_correlation(first, second) == 0
    else:
        assert rank_correlation(first, second) == pytest.approx(spearmanr(first, second).statistic, abs=1e-9)
    assert rank_correlation(np.exp(first), second.reshape(3, 4)) == rank_correlation(first, second)


def test_the_answer_about_the_night() -> None:
    nothing, much, by_chance = Interval(0.1, 1.0, 5), Interval(9.0, 2.0, 5), Interval(9.0, 20.0, 5)
    assert answer(much, by_chance) == "The night costs an agent that learns reward."
    assert "one that never learns reward" in answer(nothing, much)
    assert answer(nothing, by_chance).startswith("No drop is shown")


@pytest.mark.parametrize("name", PLACES)
def test_words_name_trials_and_columns_that_there_are(name: str) -> None:
    made = experiment(name)
    for one in made.words.estimates.values():
        assert one.trial is None or number(made, one.trial) in made.trials
        assert one.base is None or number(made, one.base) in made.trials
    for about, claims in made.words.claims.items():
        assert about in {each.key for each in conclusions()}
        for claim in claims:
            assert claim.stated.matters > 0
            assert (claim.stated.above, claim.stated.below) != (None, None)
    for section in made.words.sections:
        assert shown_trials(made, section)
        assert len(section.drawn) == len(section.dots)


def test_trials_are_named_or_counted_and_called_by_what_differs() -> None:
    made = experiment("coupling")
    assert [number(made, trial) for trial in ("policy, all goals, 0.5", 2, -1, None)] == [2, 2, 6, None]
    assert list(shown_trials(made, made.words.sections[1]).values()) == [f"coupling\u00a0{x:g}" for x in (0, 0.5, 1)]
    assert list(shown_trials(made, made.words.sections[1], called=False)) == [1, 2, 3]
    with pytest.raises(KeyError, match="no such trial"):
        number(made, "no such trial")


def test_what_programs_get_of_all_trials_is_said_too() -> None:
    made = experiment("transferability")
    rows = sorted_rows(
        Row(arm, trial, 1, {"simulation: reward": 9.0 + arm_ * trial, "reward": 1.0 * trial, "switches": 1.0}, 0.0)
        for arm_, arm in enumerate(("a", "b"))
        for trial in made.trials
    )
    words, found = filled_words(made, rows)
    assert found["lost"]["without shaping"] == estimate(rows, Quantity(figure="simulation: reward", less="reward"), 2)
    assert f"without shaping: {found['lost']['without shaping']:.1f};" in words.summary[0]

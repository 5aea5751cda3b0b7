"""Verdicts: what a claim states, what rows allow, and how often a verdict is right where the truth is known."""

import math

import numpy as np
import pytest

from pneumarm.experiments.all_goals import EXPERIMENT as ALL_GOALS
from pneumarm.experiments.experiment import Row, TrialRows, sorted_rows
from pneumarm.experiments.means import at_limit, difference, estimate, over_arms
from pneumarm.experiments.verdict import (
    FEWEST_ARMS,
    OPEN,
    Criterion,
    Interval,
    Verdict,
    holm,
    interval,
    of_the_best,
    together,
)
from pneumarm.experiments.words import Quantity

MORE = Criterion(above=0.0, matters=2.0)
LESS = Criterion(below=0.0, matters=2.0)
EQUAL = Criterion(above=-3.0, below=3.0, matters=3.0)
NUMBER = Criterion(above=0.97, matters=0.01)
DRAWS, RIGHT = 200, 184


def found(mean: float, half: float, arms: int = 5, median: Interval | None = None) -> dict[str, Interval]:
    return {"found": Interval(mean, half, arms, arms, median)}


# What is stated and what it means ---------------------------------------------------------------------------------


def test_a_claim_states_its_bounds_what_refutes_it_and_the_size_that_matters() -> None:
    assert MORE.stated() == "holds above 0, refuted below 2; 2 matters"
    assert LESS.stated() == "holds below 0, refuted above −2; 2 matters"
    assert EQUAL.stated() == "holds above −3 and below 3, refuted below −3 or above 3; 3 matters"
    assert NUMBER.stated() == "holds above 0.97, refuted below 0.97; 0.01 matters"
    slight = Criterion(above=0.0, below=8.0, matters=2.0)
    assert slight.stated() == "holds above 0 and below 8, refuted below 2 or above 8; 2 matters"


@pytest.mark.parametrize(
    ("criterion", "mean", "half", "verdict"),
    [
        (MORE, 5.0, 2.0, "holds"),
        (MORE, 3.0, 4.0, OPEN),
        (MORE, -3.0, 2.0, "does not hold"),
        (MORE, 0.2, 1.0, "does not hold"),  # what matters is ruled out
        (MORE, 1.0, 0.5, "in part"),  # there is an effect, and it does not matter
        (LESS, -5.0, 2.0, "holds"),
        (LESS, -1.0, 0.5, "in part"),
        (LESS, 0.0, 1.0, "does not hold"),
        (EQUAL, 0.5, 2.0, "holds"),
        (EQUAL, 0.5, 2.6, OPEN),
        (EQUAL, 6.0, 2.0, "does not hold"),
        (NUMBER, 0.98, 0.005, "holds"),
        (NUMBER, 0.972, 0.005, OPEN),
        (NUMBER, 0.975, 0.002, "holds"),
        (NUMBER, 0.96, 0.005, "does not hold"),
        (Criterion(above=0.0, below=8.0, matters=2.0), 15.0, 3.0, "does not hold"),  # an advantage, but no slight one
    ],
)
def test_a_verdict_is_where_the_interval_lies(criterion: Criterion, mean: float, half: float, verdict: str) -> None:
    assert criterion.judge(found(mean, half)).verdict == verdict


def test_one_arm_decides_nothing_however_sure_its_runs_are() -> None:
    """Four runs on one recording of one arm, all the same: +24.23 ± 0.00 says nothing of other arms."""
    runs = over_arms(np.full((1, 4), 24.23))
    assert (runs.mean, runs.half, runs.arms) == (24.23, 0.0, 1)
    said = MORE.judge({"found": runs})
    assert (said.verdict, said.arms) == (OPEN, FEWEST_ARMS)
    assert said.why.startswith("one arm, of which alone this speaks (there it is as claimed)")
    assert "not as claimed" in LESS.judge({"found": runs}).why
    assert (
        MORE.judge({"found": Interval(math.nan, math.inf, 0)}).why
        == "no rows have this figure; 5 arms at least that have it are needed"
    )


def test_what_is_undecided_says_how_many_arms_would_decide_it() -> None:
    draw = np.random.default_rng(0)
    few = interval(5 * draw.normal(size=5) + 1, arms=5)
    said = MORE.judge({"found": few})
    assert said.verdict == OPEN
    assert f"{said.arms:,} arms would tell them apart" in said.why
    # (2.776 + 2.132)² s² / size², the quantiles of Student's t of four degrees of freedom for both errors.
    spread = few.error * math.sqrt(5)
    assert said.arms == math.ceil(4.908**2 * spread**2 / 4)
    assert MORE.arms_needed(few.times(2)) == pytest.approx(4 * said.arms, rel=0.1)
    assert MORE.arms_needed(few._replace(median=few)) > said.arms  # both are to decide it
    assert EQUAL.arms_needed(few) > Criterion(below=3.0, matters=3.0).arms_needed(few)  # both ends at once
    assert MORE.arms_needed(interval([1.0, 1.001, 1.002], arms=3)) == FEWEST_ARMS


def test_mean_and_median_must_agree() -> None:
    holds, refuted, vague = (Interval(mean, half, 5, 5) for mean, half in ((9, 1), (-9, 1), (1, 9)))
    for of_mean, of_median, verdict in (
        (holds, holds, "holds"),
        (holds, vague, "in part"),
        (holds, refuted, "in part"),
        (vague, holds, "in part"),
        (refuted, vague, OPEN),
        (refuted, refuted, "does not hold"),
    ):
        said = MORE.judge({"found": of_mean._replace(median=of_median)})
        assert said.verdict == verdict
        assert ("by the median" in said.why) == (of_mean != of_median)


def test_of_several_figures_the_parts_are_named() -> None:
    both = Criterion(figure=("a", "b"), above=0.0, matters=2.0)
    said = both.judge({"a": found(5, 1)["found"], "b": found(-5, 1)["found"]})
    assert said.verdict == "in part"
    assert said.why == "a: holds; b: does not hold"
    by_trial = Criterion(figure="gains", below=2.0, matters=2.0)
    assert (
        by_trial.judge({"gains": {"20 Hz": found(0, 1)["found"], "60 Hz": found(-9, 1)["found"]}}).verdict == "holds"
    )


def test_verdicts_of_parts_make_one() -> None:
    held, refuted = ["holds"], ["does not hold"]
    cases = [(2 * held, "holds"), (2 * refuted, "does not hold"), (held + refuted, "in part"), ([OPEN], OPEN)]
    cases += [(9 * held + [OPEN], "in part"), (refuted + 9 * [OPEN], OPEN)]
    for parts, whole in cases:
        assert together(parts) == whole  # type: ignore[arg-type]


def test_a_floor_refutes_nothing() -> None:
    """Nine of ten trainings end at the earliest: what shortens training cannot be seen."""
    episodes = np.full((2, 5, 4), 15_500.0)
    episodes[:, 0, 0] += 500
    assert at_limit(episodes)
    assert not at_limit(np.arange(6.0))
    assert not at_limit(np.ones(9))  # a share of all
    rows = sorted_rows(
        Row(f"arm {arm}", 1 + trial, 1 + run, {"episodes": float(episodes[trial, arm, run])}, 0.0)
        for trial, arm, run in np.ndindex(episodes.shape)
    )
    shorter = difference(rows, "episodes", 1, 2)
    said = Criterion(below=0.0, matters=1000.0).judge({"found": shorter})
    assert (shorter.limited, said.verdict, said.arms) == (True, OPEN, 0)
    assert "floor or ceiling" in said.why


def test_a_share_of_all_is_as_sure_as_there_are_arms() -> None:
    """Twenty agents on five arms that all met the criterion are five samples, not twenty, and not certain."""
    sure = over_arms(np.ones((5, 4)), share=True)
    assert (sure.mean, sure.median) == (1.0, None)
    assert sure.low == pytest.approx(1 / (1 + 1.96**2 / 5), abs=1e-3)  # Wilson's interval of five
    assert over_arms(np.ones((50, 4)), share=True).low > 0.92
    nearly_all = Criterion(above=0.95, matters=0.05).judge({"found": sure})
    assert (nearly_all.verdict, nearly_all.arms) == (OPEN, 73)
    assert over_arms(np.ones((73, 4)), share=True).low > 0.94


def test_many_claims_stand_together_by_holms_correction() -> None:
    assert holm([0.001, 0.02, 0.012]) == [True, True, True]
    assert holm([0.02, 0.02]) == [False, False]
    assert holm([0.001, 0.02, 0.5]) == [True, False, False]
    assert holm([]) == []
    assert MORE.judge(found(10, 1)).p < 1e-4
    assert of_the_best(15) == pytest.approx(1 - 0.05 / 15)


# Judged where the truth is known ------------------------------------------------------------------------------------


def drawn(seed: int, arms: int, shift: float, runs: int = 4, diverges: float = 0.0) -> TrialRows:
    """Return rows of two trials, the second better by ``shift`` on an average arm, whose fit all runs of it share.

    Arms differ by 10 whatever the trial, and by 1.5 in how much the trial matters to them; runs by 2. A run of the
    first trial may diverge.
    """
    draw = np.random.default_rng(seed)
    level, slope = 10 * draw.normal(size=arms), shift + 1.5 * draw.normal(size=arms)
    values = level[None, :, None] + 2 * draw.normal(size=(2, arms, runs))
    values[1] += slope[:, None]
    values[0] -= 150 * (draw.random((arms, runs)) < diverges)
    return sorted_rows(
        Row(f"arm {arm:03}", 1 + trial, 1 + run, {"reward": float(values[trial, arm, run])}, 0.0)
        for trial, arm, run in np.ndindex(values.shape)
    )


def judged(criterion: Criterion, shift: float) -> list[str]:
    """Return the verdicts on 200 draws of as many arms as a pilot of twenty asks for."""
    arms = criterion.arms_needed(difference(drawn(10_000, 20, shift), "reward", 2, 1))
    tables = (drawn(seed, arms, shift) for seed in range(DRAWS))
    return [criterion.judge({"found": difference(rows, "reward", 2, 1)}).verdict for rows in tables]


@pytest.mark.parametrize(
    ("criterion", "shift", "verdict"),
    [
        (MORE, 2.0, "holds"),
        (MORE, 0.0, "does not hold"),
        (MORE, -2.0, "does not hold"),
        (LESS, -2.0, "holds"),
        (LESS, 0.0, "does not hold"),
        (Criterion(above=15.0, matters=2.0), 17.0, "holds"),
        (Criterion(above=15.0, matters=2.0), 13.0, "does not hold"),
        (EQUAL, 0.0, "holds"),
        (EQUAL, 6.0, "does not hold"),
        (Criterion(above=0.0, below=8.0, matters=2.0), 4.0, "holds"),
        (Criterion(above=0.0, below=8.0, matters=2.0), 10.0, "does not hold"),
    ],
)
def test_claims_that_are_true_or_false_are_judged_so(criterion: Criterion, shift: float, verdict: str) -> None:
    """At the size that the claim states, on as many arms as a pilot asks for, 184 times of 200."""
    assert judged(criterion, shift).count(verdict) >= RIGHT


def test_runs_that_share_a_fit_are_no_samples() -> None:
    """On a few arms of which half gain and half lose, a false claim is held once in forty, not once in three."""
    rows = [drawn(seed, FEWEST_ARMS, 0.0, runs=20) for seed in range(DRAWS)]
    by_arm = [MORE.judge({"found": difference(table, "reward", 2, 1)}) for table in rows]
    wrong = sum(said.verdict == "holds" for said in by_arm)
    assert wrong <= DRAWS * 0.025 + 3 * math.sqrt(DRAWS * 0.025)

    def by_run(table: TrialRows) -> Interval:  # what would be judged if all runs were samples
        gains = table.table("reward", [2]) - table.table("reward", [1])
        return interval(gains.ravel(), arms=FEWEST_ARMS)

    careless = sum(MORE.judge({"found": by_run(table)}).verdict in ("holds", "in part") for table in rows)
    assert careless > 4 * max(wrong, 5)


def factorial(seed: int, arms: int, effect: float, diverging: bool) -> TrialRows:
    """Return rewards on the thesis' array; a column has an ``effect``, and trial 14 diverges in a run of four."""
    draw, level = np.random.default_rng(seed), ALL_GOALS.design.array.column(2)
    size = effect + 1.2 * draw.normal(size=arms)
    values = 4 * draw.normal(size=(arms, 4, len(ALL_GOALS.trials)))
    values += size[:, None, None] * (level == level.max()) + 10 * draw.normal(size=(arms, 1, 1))
    values[:, 0, 13] -= 400 * diverging
    return sorted_rows(
        Row(f"arm {arm:03}", 1 + trial, 1 + run, {"reward": float(values[arm, run, trial])}, 0.0)
        for arm, run, trial in np.ndindex(values.shape)
    )


def column_2(rows: TrialRows) -> Interval:
    ours = ALL_GOALS.analyses(rows)[0]["reward"] if len(rows.arms) == 1 else None
    return ALL_GOALS.effect(rows, "reward", 2, ours)  # type: ignore[arg-type]


@pytest.mark.parametrize(("effect", "verdict"), [(-2.0, "holds"), (0.0, "does not hold")])
def test_effects_of_an_array_are_judged_so(effect: float, verdict: Verdict) -> None:
    arms = LESS.arms_needed(column_2(factorial(10_000, 40, effect, diverging=False)))
    tables = (factorial(seed, arms, effect, diverging=False) for seed in range(DRAWS))
    assert [LESS.judge({"found": column_2(rows)}).verdict for rows in tables].count(verdict) >= RIGHT


def test_one_trial_that_diverges_decides_no_effect() -> None:
    """Trial 14 is at the higher level of column 2: its mean alone makes an effect that the median denies."""
    rows = factorial(1, 20, 0.0, diverging=True)
    effect = column_2(rows)
    assert effect.high < -8
    assert effect.median is not None
    assert abs(effect.median.mean) < 2
    said = LESS.judge({"found": effect})
    assert said.verdict == "in part"
    assert "by the mean it holds, by the median" in said.why
    told = ALL_GOALS.diverged(rows)
    assert told[0].startswith(
        "Diverged: 20 of 1280 agents earn less than one that does nothing (-100): 20 of trial 14"
    )


def test_a_reduction_is_made_of_each_arm_before_anything_else() -> None:
    """Percentages, and differences of them, are of an arm's means or medians."""
    rows = drawn(3, 6, 5.0, diverges=0.2)
    found = estimate(rows, Quantity(figure="reward", percent=True), 2, 1)
    tables = [rows.table("reward", [t]).reshape(6, 4) for t in (2, 1)]
    for one, reduced in ((found, np.mean), (found.median, np.median)):
        top, base = (reduced(table, axis=1) for table in tables)
        assert one is not None
        assert one[:3] == pytest.approx(interval(100 * (top / base - 1))[:3])

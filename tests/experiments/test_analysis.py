"""Losses, effects, tests and best settings: worked by hand, against other ways to compute them, and by property."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays as any_array
from scipy import stats

from pneumarm.errors import UnusableInput
from pneumarm.experiments.design import WantedFactor, analyse_table, assign, orthogonal_array, thesis_design
from pneumarm.experiments.design.anova import anova, smallest
from pneumarm.experiments.design.best import Aim, confirm, derive, level_at, predict
from pneumarm.experiments.design.distributions import f_tail, half_normal_quantile, incomplete_beta, t_quantile
from pneumarm.experiments.design.effect_plots import half_normal_figure
from pneumarm.experiments.design.effects import effects
from pneumarm.experiments.design.half_normal import lenth, percentages, positions
from pneumarm.experiments.design.loss import loss

NUMBERS = st.floats(-1e3, 1e3)
UNHURRIED = settings(deadline=None, max_examples=40)


def test_losses_by_hand() -> None:
    results = [[1.0, 2.0], [4.0, 4.0], [10.0, 20.0]]
    assert loss(results, "mean").tolist() == [1.5, 4.0, 15.0]
    assert loss(results, "std") == pytest.approx([math.sqrt(0.5), 0.0, math.sqrt(50.0)])
    assert loss(results, "smaller") == pytest.approx([-10 * math.log10(r) for r in (2.5, 16.0, 250.0)])
    assert loss(results, "larger") == pytest.approx([-10 * math.log10(r) for r in (0.625, 0.0625, 0.00625)])
    assert loss([[8.0, 12.0]], "nominal") == pytest.approx([10 * math.log10(100 / 8)])
    for kind in ("larger", "smaller"):
        with pytest.raises(UnusableInput, match="results above 0"):
            loss([[1.0, -1.0]], kind)  # type: ignore[arg-type]
    with pytest.raises(UnusableInput, match="a mean and a variance besides 0"):
        loss(results, "nominal")
    with pytest.raises(UnusableInput, match="two runs at least"):
        loss([[1.0]], "std")


def test_effects_by_hand() -> None:
    found = effects(orthogonal_array("L4"), [1.0, 2.0, 5.0, 12.0])
    assert [average.tolist() for average in found.averages] == [[1.5, 8.5], [3.0, 7.0], [6.5, 3.5]]
    assert found.sizes.tolist() == [7.0, 4.0, 3.0]
    assert found.signed.tolist() == [7.0, 4.0, -3.0]
    assert found.ranking == (1, 2, 3)
    assert [found.best(3, larger) for larger in (True, False)] == [0, 1]


@given(any_array(np.float64, 16, elements=NUMBERS), st.integers(1, 15), st.floats(0.1, 100))
@UNHURRIED
def test_an_effect_put_in_comes_out(losses: np.ndarray, column: int, size: float) -> None:
    """Adding to all trials at one level changes the effect of that column only: the columns are orthogonal."""
    array = orthogonal_array("L16")
    before = effects(array, losses).signed
    after = effects(array, losses + size * array.column(column)).signed
    expected = before + size * (np.arange(1, 16) == column)
    np.testing.assert_allclose(after, expected, atol=1e-8)


def test_half_normal_positions() -> None:
    """Thesis eq. 5.3: 15 effects at 3.3, 10, ..., 96.7 %; the middle one at the median of |Z|."""
    assert percentages(15) == pytest.approx([100 * (i - 0.5) / 15 for i in range(1, 16)])
    assert positions(15)[7] == pytest.approx(stats.halfnorm.ppf(0.5))
    assert positions(15) == pytest.approx(stats.halfnorm.ppf(percentages(15) / 100))


def test_lenth_by_hand() -> None:
    """Median of sizes 2, so s_0 = 3; 100 is beyond 7.5 and left out; the median of the rest is 1.5."""
    found = lenth([1.0, -1.0, 2.0, 2.0, 100.0])
    assert found.pseudo_standard_error == pytest.approx(1.5 * 1.5)
    assert found.margin == pytest.approx(2.25 * stats.t.ppf(0.975, 5 / 3))
    assert found.simultaneous_margin == pytest.approx(2.25 * stats.t.ppf((1 + 0.95 ** (1 / 5)) / 2, 5 / 3))
    with pytest.raises(UnusableInput, match="three effects"):
        lenth([1.0, 2.0])


def test_lenth_seldom_finds_effects_in_noise_and_always_large_ones() -> None:
    """A 95 % margin on 15 effects of pure noise: about one in twenty beyond; the simultaneous one far fewer."""
    random = np.random.default_rng(3)
    noise = random.normal(size=(400, 15))
    margins = [lenth(sizes) for sizes in noise]
    share = np.mean([np.abs(sizes) > m.margin for sizes, m in zip(noise, margins, strict=True)])
    assert 0.02 < share < 0.06
    families = np.mean([np.abs(sizes).max() > m.simultaneous_margin for sizes, m in zip(noise, margins, strict=True)])
    assert families < 0.08
    noise[:, 4] = 15
    assert all(lenth(sizes).simultaneous_margin < 15 for sizes in noise)


@given(st.floats(0, 1), st.floats(0.2, 60), st.floats(0.2, 60))
@UNHURRIED
def test_incomplete_beta_is_scipys(x: float, a: float, b: float) -> None:
    assert incomplete_beta(x, a, b) == pytest.approx(stats.beta.cdf(x, a, b), abs=1e-10)


@given(st.floats(0, 50), st.integers(1, 12), st.integers(1, 120))
@UNHURRIED
def test_f_tail_is_scipys(ratio: float, numerator: int, denominator: int) -> None:
    assert f_tail(ratio, numerator, denominator) == pytest.approx(
        stats.f.sf(ratio, numerator, denominator), abs=1e-10, rel=1e-6
    )


@given(st.floats(0.01, 0.999), st.floats(0.7, 200))
@UNHURRIED
def test_quantiles_are_scipys(probability: float, freedom: float) -> None:
    assert t_quantile(probability, freedom) == pytest.approx(stats.t.ppf((1 + probability) / 2, freedom), rel=1e-6)
    assert half_normal_quantile(probability) == pytest.approx(stats.halfnorm.ppf(probability), rel=1e-9)


@pytest.mark.parametrize("name", ["L8", "L16", "L9", "L18", "L27"])
def test_anova_is_the_regression_on_indicators(name: str) -> None:
    """Sums of squares by leaving a column's indicators out of a least-squares fit, F and p by SciPy."""
    array, random = orthogonal_array(name), np.random.default_rng(5)
    y = random.normal(size=(array.trials, 3)) + 2.0 * array.column(2)[:, None] + np.array([0.0, 1.0, -1.0])
    names = [str(c) for c in range(1, array.columns + 1)]
    *sources, error, total = anova(array, y, names)
    trial, run = np.divmod(np.arange(y.size), 3)
    groups = {n: np.eye(array.counts[c])[array.levels[trial, c]] for c, n in enumerate(names)}
    groups["runs"] = np.eye(3)[run]

    def residual(without: str | None) -> float:
        blocks = [np.ones((y.size, 1)), *(g for n, g in groups.items() if n != without)]
        design = np.concatenate(blocks, axis=1)
        fitted = design @ np.linalg.lstsq(design, y.ravel(), rcond=None)[0]
        return float(((y.ravel() - fitted) ** 2).sum())

    assert error.squares == pytest.approx(residual(None))
    assert error.freedom == y.size - 1 - sum(source.freedom for source in sources)
    for source in sources:
        assert source.squares == pytest.approx(residual(source.name) - residual(None))
        ratio = source.mean_square / error.mean_square
        assert source.p == pytest.approx(stats.f.sf(ratio, source.freedom, error.freedom))
    assert total.squares == pytest.approx(((y - y.mean()) ** 2).sum())
    assert sources[1].p < 1e-3


def test_anova_pools_small_effects_where_there_is_one_run() -> None:
    array = orthogonal_array("L8")
    y = (3.0 * array.column(1) + np.array([0.1, -0.1, 0.05, 0, 0.02, -0.07, 0.1, -0.1]))[:, None]
    names = [str(c) for c in range(1, 8)]
    with pytest.raises(UnusableInput, match="repeat the runs, or pool small effects"):
        anova(array, y, names)
    pooled = smallest(effects(array, y[:, 0]).sizes, 4)
    assert 1 not in pooled
    sources = {source.name: source for source in anova(array, y, names, pooled)}
    assert sources["error"].freedom == 4
    assert sources["1"].p < 1e-3
    assert not {str(column) for column in pooled} & sources.keys()


def test_pictures_of_results_that_do_not_vary() -> None:
    """As the episodes of a training that always ends at its limit: all effects 0, an axis that is not empty."""
    analysis = analyse_table(thesis_design(), np.full((16, 3), 16_000.0), "smaller")
    figure = half_normal_figure(analysis, ("mean", "std"), "episodes")
    assert [axes.get_xlim() for axes in figure.axes] == [(0.0, 1.0)] * 2
    assert analysis.significant("mean") == ()


def test_anova_of_results_that_do_not_vary() -> None:
    *sources, _, total = anova(orthogonal_array("L4"), np.ones((4, 2)), ["a", "b", "c"])
    assert total.squares == 0
    assert all(math.isnan(source.p) for source in sources)


@given(st.permutations(range(5)), st.lists(st.booleans(), min_size=5, max_size=5))
@UNHURRIED
def test_the_derivation_finds_the_best_of_additive_results(order: list[int], raises: list[bool]) -> None:
    """Where only factors matter, in any order of importance, each gets its better level."""
    design = thesis_design()
    weights = np.array([2.0 ** -order[i] * (1 if raises[i] else -1) for i in range(5)])
    results = sum(w * design.array.column(f.column) for w, f in zip(weights, design.factors, strict=True))
    found = effects(design.array, results)
    best = derive(design, [Aim("mean", found, True)])
    assert best.levels == {f.label: int(up) for f, up in zip(design.factors, raises, strict=True)}
    assert [step.factor for step in best.steps] == [design.factors[order.index(k)].label for k in range(5)]


def test_interactions_decide_factors_that_matter_less() -> None:
    """With results -(a - 1)^2 ... only of a and of the product ab: b is fixed by column 3, given a."""
    design = assign(
        orthogonal_array("L8"), [WantedFactor(label, label, (0, 1)) for label in "abc"], ["ab", "ac", "bc"]
    )
    a, ab = design.array.column(1), design.array.column(3)
    for wanted in (0, 1):
        results = 10.0 * a + 5.0 * (ab == wanted) + 0.1 * design.array.column(2) + 0.01 * design.array.column(4)
        best = derive(design, [Aim("mean", effects(design.array, results), True)])
        assert best.levels == {"a": 1, "b": 1 ^ wanted, "c": 1}
        assert {step.factor: step.column for step in best.steps}["b"] == 3
        # An interaction that ranks above both of its factors waits until one of them is fixed.
        results = 10.0 * (ab == wanted) + 5.0 * a + 0.1 * design.array.column(4)
        best = derive(design, [Aim("mean", effects(design.array, results), True)])
        assert (best.levels["a"], best.levels["b"]) == (1, 1 ^ wanted)


def test_smaller_may_be_better() -> None:
    design = thesis_design()
    results = design.array.column(4)[:, None] + np.random.default_rng(0).normal(size=(16, 4)) / 100
    assert analyse_table(design, results, "larger").best.levels["c"] == 1
    assert analyse_table(design, results, "smaller").best.levels["c"] == 0


def test_predictions_of_additive_results_are_exact_and_confirmed() -> None:
    design = thesis_design()
    truth = {"a": 1.0, "b": -2.0, "c": 5.0, "d": 0.5, "e": 3.0}

    def result(levels: dict[str, int]) -> float:
        return 7.0 + sum(truth[label] * level for label, level in levels.items()) + 4.0 * levels["c"] * levels["e"]

    combinations = [dict(zip("abcde", levels, strict=True)) for levels in itertools.product((0, 1), repeat=5)]
    trials = [{f.label: int(design.array.levels[t, f.column - 1]) for f in design.factors} for t in range(16)]
    exact = np.array([[result(levels)] for levels in trials])
    columns = [1, 2, 4, 8, 11, 12]
    for levels in combinations:
        assert predict(design, exact, levels, columns) == pytest.approx(result(levels))
        assert level_at(design, 8, levels) == levels["c"] ^ levels["e"]
    random = np.random.default_rng(1)
    noisy = exact + random.normal(size=(16, 6))
    error = anova(design.array, noisy, design.labels())[-2]
    judged = [
        confirm(design, noisy, levels, columns, result(levels) + shift + random.normal(size=6), (1.0, error.freedom))
        for levels in combinations
        for shift in (0.0, 5.0)
    ]
    assert np.mean([found.confirmed for found in judged[::2]]) > 0.85
    assert not any(found.confirmed for found in judged[1::2])


def test_tables_that_do_not_fit_are_refused() -> None:
    design = thesis_design()
    with pytest.raises(UnusableInput, match="L16 needs 16 trials"):
        analyse_table(design, np.zeros((8, 2)))
    with pytest.raises(UnusableInput, match="finite"):
        analyse_table(design, np.full((16, 2), np.nan))
    analysis = analyse_table(design, np.random.default_rng(0).normal(size=(16, 2)))
    with pytest.raises(UnusableInput, match=r"factor b: expected one of 5, 10, got 7"):
        analysis.confirm([1.0], {"a": 0.05, "b": 7})

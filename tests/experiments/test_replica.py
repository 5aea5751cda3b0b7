"""Which test of the agents is the thesis', and what a table's own scatter lets a replica reach."""

import numpy as np
import pytest

from pneumarm.experiments.all_goals import EXPERIMENT as ALL_GOALS
from pneumarm.experiments.claims.replica import alpha, by_test, chosen_test, replica
from pneumarm.experiments.experiment import Row, TrialRows, sorted_rows
from pneumarm.experiments.trainings import EXPLORING

NAME = ALL_GOALS.name


def rows(greedy: float, exploring: float, arms: int = 3) -> TrialRows:
    """Return rows of all-goals whose tests differ from the thesis' rewards by so much."""
    found = []
    for arm in range(arms):
        for trial, theirs in zip(ALL_GOALS.trials, ALL_GOALS.thesis["reward"].mean(axis=1), strict=True):
            for run in (1, 2):
                figures = {"episodes": 1.0, "met": 1.0}
                for test, off in (("", greedy), (EXPLORING, exploring)):
                    figures[test + "reward"] = float(theirs) + off + arm
                    figures |= {test + "success_rate": 1.0, test + "switches": 3.0, test + "actions": 9.0}
                found.append(Row(f"arm {arm}", trial, run, figures, 0.0))
    return sorted_rows(found)


def test_the_test_is_chosen_by_the_level_of_the_odd_trials() -> None:
    for greedy, exploring, expected in ((-9.0, 1.0, EXPLORING), (1.0, -9.0, "")):
        table = rows(greedy, exploring)
        assert chosen_test({NAME: table}) == expected
        even = [row for row in table.rows if row.trial % 2 == 0]
        changed = sorted_rows(
            [row for row in table.rows if row.trial % 2]
            + [Row(row.arm, row.trial, row.run, {k: -x for k, x in row.figures.items()}, 0.0) for row in even]
        )
        assert chosen_test({NAME: changed}) == expected
        as_theirs = by_test(table, expected)
        assert not any(name.startswith(EXPLORING) for name in as_theirs.figures)
        trials = list(ALL_GOALS.trials)
        assert (as_theirs.table("reward", trials) == table.table(expected + "reward", trials)).all()


def test_rows_without_the_other_test_stay_as_they_are() -> None:
    table = sorted_rows([Row("arm", 1, 1, {"reward": 1.0}, 0.0)])
    assert by_test(table, EXPLORING) is table
    assert chosen_test({NAME: table}) == ""
    assert replica({NAME: table}) is None


def test_alpha_is_the_reliability_of_means() -> None:
    """Of runs that are truth and noise alike, the share of the means' variance that is truth."""
    random = np.random.default_rng(0)
    truth, noise = random.normal(size=(4000, 1)), random.normal(size=(4000, 4))
    assert alpha(truth + noise) == pytest.approx(1 / (1 + 1 / 4), abs=0.02)
    assert alpha(noise) == pytest.approx(0, abs=0.06)
    assert alpha(np.ones((5, 3))) == 0
    assert alpha(truth[:, :1]) == 0


def test_the_section_says_how_close_the_replica_comes() -> None:
    made = replica({NAME: rows(-9.0, 1.0)})
    assert made is not None
    assert "its test is the exploring one" in made.text[0]
    greedy, exploring = made.tables[0].rows
    assert (greedy[1], exploring[1]) == ("greedy", "exploring")
    assert greedy[6] == exploring[6] == "1.00"  # both have the thesis' order
    assert float(exploring[7]) == pytest.approx(np.sqrt(alpha(ALL_GOALS.thesis["reward"])), abs=0.006)

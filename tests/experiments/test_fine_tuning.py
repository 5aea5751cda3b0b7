"""Fine tuning: three levels, chosen by odd runs and confirmed by even ones."""

from typing import Any

import numpy as np

from pneumarm.experiments.claims import keys_of
from pneumarm.experiments.experiment import Row, TrialRows, sorted_rows
from pneumarm.experiments.fine_tuning import EXPERIMENT
from pneumarm.experiments.fine_tuning.analysis import confirmation, returns_figure
from pneumarm.experiments.registry import experiment
from pneumarm.experiments.verdict import OPEN
from pneumarm.learning import TrainSettings

LAST = EXPERIMENT.reference


def test_three_levels_each_and_trial_10() -> None:
    found = [EXPERIMENT.train_settings(trial) for trial in EXPERIMENT.trials]
    for values in zip(*((s.learning_rate, s.hidden, s.trace_decay, s.discount) for s in found[:-1]), strict=True):
        assert sorted(values.count(value) for value in set(values)) == [3, 3, 3]
    assert {s.method for s in found} == {"sarsa"}
    assert found[-1] == experiment("all-goals").train_settings(10)  # type: ignore[attr-defined]


def rows(odd: dict[int, float], even: dict[int, float], runs: int = 6) -> TrialRows:
    """Return rows with these rewards by trial in odd and even runs, 0 elsewhere."""
    draw = np.random.default_rng(1)
    found = []
    for arm in ("a", "b", "c"):
        for run in range(1, runs + 1):
            for trial in EXPERIMENT.trials:
                reward = (odd if run % 2 else even).get(trial, 0.0) + 0.1 * draw.normal()
                figures = {"reward": reward, "success_rate": 1.0, "episodes": 1000.0 + draw.normal()}
                found.append(Row(arm, trial, run, figures, 0.0))
    return sorted_rows(found)


def test_what_was_chosen_is_confirmed_by_other_runs() -> None:
    """A trial that shone in the runs that chose it and nowhere else confirms nothing."""
    said = {
        name: confirmation(EXPERIMENT, rows(*given))
        for name, given in {
            "better": ({4: 9.0}, {4: 9.0}),
            "lucky": ({4: 9.0}, {LAST: 5.0}),
            "other": ({4: 9.0}, {7: 9.0}),
            "once": ({4: 9.0}, {}),
        }.items()
    }
    assert verdict(said["better"]) == "holds"
    assert said["better"]["ours"].startswith(("+9.", "+8.9"))
    assert verdict(said["lucky"]) == "does not hold"
    assert abs(float(said["other"]["ours"].split()[0])) < 0.5
    assert verdict(confirmation(EXPERIMENT, rows({4: 9.0}, {}, runs=1))) == OPEN


def verdict(found: dict[str, Any]) -> str:
    return EXPERIMENT.words.claims["fine-tuning"][0].stated.judge(found).verdict


def test_the_page_has_the_array_and_trial_10() -> None:
    found = EXPERIMENT.analyse(rows({4: 9.0}, {4: 9.0}, runs=2))
    assert found.figures["ours"]["reward"]["best"]["settings"]["a"] == 0.075
    assert any("trial 4" in paragraph for paragraph in found.summary)
    assert [claim.about for claim in found.claims] == list(keys_of(EXPERIMENT.name))


def test_returns_are_sums_of_discounted_rewards() -> None:
    settings = TrainSettings()
    line = returns_figure(settings, (0.9, 0.95, 0.98)).axes[0].lines[1]
    for actions in (1, 2, 30):
        rewards = [settings.reward.action] * (actions - 1) + [settings.reward.goal]
        expected = sum(0.95**k * paid for k, paid in enumerate(rewards))
        np.testing.assert_allclose(line.get_ydata()[actions - 1], expected)

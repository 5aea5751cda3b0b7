"""The page of claims: what is collected, how verdicts add up, what is still to be run."""

import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from pneumarm.cli import main
from pneumarm.errors import UnusableInput
from pneumarm.experiments.all_goals import EXPERIMENT as ALL_GOALS
from pneumarm.experiments.claims import conclusions, judge, keys_of, summary
from pneumarm.experiments.claims.page import sections
from pneumarm.experiments.claims.running import rows_by_kind
from pneumarm.experiments.experiment import Analysis, Claim, Row, TrialRows, sorted_rows
from pneumarm.experiments.factorial import Factorial
from pneumarm.experiments.registry import PLACES, experiment
from pneumarm.experiments.results import Results, write_page
from pneumarm.experiments.sweep import ROWS
from pneumarm.experiments.switch_punishment import EXPERIMENT as PUNISHMENT
from pneumarm.experiments.verdict import OPEN, Criterion, Interval

OF_THE_THESIS = {
    *("control-frequency", "state-history", "enough-data", "noise-for-transfer", "switch-punishment", "all-goals"),
    *("long-training", "optimal-settings", "no-shaping", "transfer", "transferability", "valves-closed", "goal-area"),
    *("shaping-settings", "fine-tuning", "overnight", "on-the-arm-only", "displacement"),
    *("goal-pairs", "joint-data", "joint-data-long", "joint-exploration", "coupling", "joint-agents", "hierarchy"),
}


def results(name: str, claims: list[tuple[str, str]], arms: int = 5, runs: int = 4) -> dict[str, Results]:
    """Return results of an experiment whose claims are about and have the verdict given; 9 arms would decide."""
    below, above = Interval(-2.0, 0.5, 9, 9), Interval(2.0, 0.5, 9, 9)
    open_ = Interval(0.0, 3.0, 5, 5)
    found = {"holds": above, "does not hold": below, OPEN: open_}
    stated = Criterion(above=0, matters=1)
    made = tuple(Claim(about, "1", "2", about, stated, {"found": found[verdict]}) for about, verdict in claims)
    assert [claim.verdict for claim in made] == [verdict for _, verdict in claims]
    return {name: Results(name, tuple(f"arm {n}" for n in range(arms)), runs, made)}


def judged(found: dict[str, Results]) -> dict[str, Any]:
    return {each.conclusion.key: each for each in judge(found)}


def test_every_conclusion_names_experiments_of_the_thesis() -> None:
    named = {name for each in conclusions() for name in each.experiments}
    assert named == OF_THE_THESIS
    keys = [each.key for each in conclusions()]
    assert len(set(keys)) == len(keys)


@pytest.mark.parametrize("name", [name for name in PLACES if isinstance(experiment(name), Factorial)])
def test_claims_are_about_all_conclusions_that_name_their_experiment(name: str) -> None:
    made = experiment(name)
    assert isinstance(made, Factorial)
    assert {claim.about for claim in claims(made, rows(made, wobble))} == keys_of(name)


def test_verdicts_add_up() -> None:
    verdicts = [("sarsa", "holds"), ("sarsa", "holds"), ("neurons", "holds"), ("neurons", "does not hold")]
    verdicts += [("gamma", "does not hold"), ("gamma", OPEN), ("traces", OPEN), ("traces", "holds")]
    found = judged(results("all-goals", verdicts) | results("no-shaping", [("shaping-not-indispensable", OPEN)]))
    expected = {"sarsa": "holds", "neurons": "in part", "gamma": OPEN, "traces": "in part"}
    assert {key: found[key].verdict for key in expected} == expected
    assert found["learning-rate"].verdict == OPEN  # all-goals was run and said nothing of it
    assert found["q-fluctuates"].verdict == OPEN
    assert "Not run: long-training; 5 arms at least are needed." in found["q-fluctuates"].explained()
    both = found["shaping-not-indispensable"]
    assert len(both.claims) == 1
    assert both.missing == ("shaping-settings",)
    assert found["sarsa"].explained() == "Verdict: holds."
    assert found["neurons"].explained() == "Verdict: in part. Holds: neurons. Does not hold: neurons."


def test_what_no_experiment_decides_says_what_would() -> None:
    made = judge(results("all-goals", [("sarsa", "holds")]))
    lacking = [each for each in made if not each.conclusion.experiments]
    assert len(lacking) >= 7
    titles = {section.title: section.text[0] for section in sections(made)}
    for each in lacking:
        assert each.verdict == OPEN
        said = f"Verdict: {OPEN}. What would decide it: {each.conclusion.lacks}."
        assert titles[each.conclusion.says] == f"Thesis section {each.conclusion.section}. {said}"


def test_the_page_of_one_arm_speaks_of_it_alone(tmp_path: Path) -> None:
    made = judge(results("all-goals", [("sarsa", OPEN)], arms=1))
    assert "What rests on one arm speaks of that arm alone: arm 0." in summary(made)
    (tmp_path / "one" / "all-goals").mkdir(parents=True)
    table = rows(ALL_GOALS, wobble, arms=1)
    found = claims(ALL_GOALS, table)
    assert {claim.verdict for claim in found} == {OPEN}
    page = write_page(ALL_GOALS, tmp_path / "one" / "all-goals", Analysis([], {}, [], found), table).read_text()
    assert "All of it is true of arm 0 alone" in page
    assert "one arm, of which alone this speaks" in page
    assert f"{len(found)} claims: {len(found)} undecided by this design" in page
    for claim in found:
        assert claim.criterion.stated() in page


def test_all_that_is_judged_at_once_is_told() -> None:
    made = judge(results("all-goals", [("sarsa", "holds"), ("gamma", "does not hold"), ("traces", OPEN)]))
    rules = " ".join(sections(made)[0].text)
    assert "3 claims are judged one by one" in rules
    assert "Of the 2 that hold or are refuted 2 also stand" in rules
    assert "1 held up" in summary(made)[0]


def test_a_claim_about_nothing_listed_is_not_lost() -> None:
    found = judged(results("all-goals", [("something else", "holds")]))["all-goals"]
    assert found.conclusion.says == ALL_GOALS.words.question
    assert [claim.text for _, claim in found.claims] == ["something else"]


def test_what_is_undecided_says_how_many_arms_would() -> None:
    made = results("all-goals", [("sarsa", "holds")]) | results("long-training", [("q-fluctuates", OPEN)])
    needed = made["long-training"].claims[0].judgement.arms
    found = {section.title: section for section in sections(judge(made))}
    for each in conclusions():
        said = " ".join(found[each.says].text)
        assert all(f"pneumarm experiment {name} --out laboratory" in said for name in each.experiments)
        if each.key == "q-fluctuates":
            assert f"{needed} arms would decide all that is open" in said
        elif "Verdict: holds." not in said:
            assert "5 arms at least" in said or "What would decide it" in said


def test_the_command_judges_the_complete_rows_of_a_laboratory(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whatever the experiment wrote of them; an arm that is not complete does not count."""
    (tmp_path / "all-goals").mkdir()
    table = rows(ALL_GOALS, wobble, arms=4)
    lines = [msgspec.json.encode(row) + b"\n" for row in table.rows]
    (tmp_path / "all-goals" / ROWS).write_bytes(b"".join(lines[:-1]))
    with pytest.raises(SystemExit) as ended:
        main(["claims", "--out", str(tmp_path), "--json"])
    assert ended.value.code == 0
    found = {each["key"]: each for each in json.loads(capsys.readouterr().out)["conclusions"]}
    complete = claims(ALL_GOALS, sorted_rows(table.rows[: 3 * len(table.rows) // 4]))
    for claim in found["sarsa"]["claims"]:
        assert (claim["arms"], claim["runs"]) == (3, 12)
        assert claim["ours"] in {one.ours for one in complete}
    assert "3 arms, 12 runs" in (tmp_path / "claims.html").read_text()
    with pytest.raises(SystemExit):
        main(["claims", "--out", str(tmp_path)])
    shown = " ".join(capsys.readouterr().out.split())
    for each in conclusions():
        assert each.says in shown


def test_a_laboratory_without_rows_is_said(tmp_path: Path) -> None:
    with pytest.raises(UnusableInput, match="expected the folder of a laboratory"):
        rows_by_kind(tmp_path / "nothing")
    with pytest.raises(UnusableInput, match="expected rows of experiments; finish one first"):
        rows_by_kind(tmp_path)
    (tmp_path / "all-goals").mkdir()
    (tmp_path / "all-goals" / ROWS).write_text("{}\n")
    with pytest.raises(UnusableInput, match=r"rows.jsonl, line 1: expected a row of an experiment"):
        rows_by_kind(tmp_path)


def rows(made: Factorial, reward: Any, arms: int = 3, runs: int = 4, success: float = 1.0) -> TrialRows:
    """Return rows of ``made`` with the reward of a trial in a run on an arm as the function says."""
    found = []
    for arm in range(arms):
        for run in range(1, runs + 1):
            for trial in made.trials:
                value = float(reward(arm, trial, run))
                names = ("reward", "actions", "switches", "episodes")
                figures = {name: abs(value) + 1 if name == "switches" else value for name in names}
                figures |= {"success_rate": success, "learning success_rate": 1.0, "gain": value, "met": 1.0}
                found.append(Row(f"arm {arm}", trial, run, figures, 0.0))
    return sorted_rows(found)


def claims(made: Factorial, table: TrialRows) -> list[Claim]:
    return list(made.claims(table, *made.analyses(table)))


def test_weights_dominate_where_runs_decide_and_not_where_a_column_does() -> None:
    draw = np.random.default_rng(0)
    column = ALL_GOALS.design.array.column(4)

    def said(weights: float, effect: float) -> Claim:
        luck = {(arm, run): weights * draw.normal() for arm in range(3) for run in range(1, 5)}
        table = rows(ALL_GOALS, lambda a, t, r: 50 * a + luck[a, r] + effect * column[t - 1] + draw.normal())
        return next(claim for claim in claims(ALL_GOALS, table) if claim.about == "weights-alike")

    assert said(weights=10, effect=1).verdict == "holds"
    refuted = said(weights=2, effect=20)
    assert refuted.verdict == "does not hold"
    assert "the largest column (4)" in refuted.ours
    assert [said(weights=0, effect=0).verdict for _ in range(20)].count(OPEN) == 20  # whichever column is largest


def test_the_share_of_variance_within_settings() -> None:
    """Runs that differ three times as much as settings make nine tenths of the variance."""
    draw = np.random.default_rng(1)
    of_setting = draw.normal(size=17)
    of_setting /= of_setting[1:].std(ddof=1)
    for own, verdict, share in ((3.0, "holds", 90), (1 / 3, "does not hold", 10)):
        table = rows(ALL_GOALS, lambda a, t, r, w=own: of_setting[t] + w * draw.normal() + 50 * a, runs=8)
        (claim,) = (c for c in claims(ALL_GOALS, table) if c.text.startswith("With the same settings"))
        assert claim.verdict == verdict
        assert float(claim.ours.split()[0]) == pytest.approx(share, abs=8)


def test_arms_are_the_sample() -> None:
    """An effect that has another sign on each arm is no effect, however many runs agree on it."""
    column, signs = ALL_GOALS.design.array.column(11), np.array([12.0, -12.0, 12.0])
    for spread, sure in ((signs, False), (np.full(3, 12.0), True)):
        table = rows(ALL_GOALS, lambda a, t, r, s=spread: s[a] * column[t - 1] + a + 0.01 * ((7 * t + 3 * r) % 5))
        ours, _ = ALL_GOALS.analyses(table)
        found = ALL_GOALS.effect(table, "reward", 11, ours["reward"])
        assert found.samples == 3
        assert (found.low > 0) == sure
        (traces,) = (c for c in claims(ALL_GOALS, table) if "marginal" in c.text)
        assert traces.verdict == ("does not hold" if sure else OPEN)


def wobble(arm: int, trial: int, run: int) -> float:
    return ((5 * trial + 3 * run + arm) % 7) / 50


def test_switches_are_compared_by_their_ratio() -> None:
    column = PUNISHMENT.design.array.column(12)
    found = {}
    for more in (0.2, 2.0):
        table = rows(PUNISHMENT, lambda a, t, r, m=more: m * (column[t - 1] == column.max()) + wobble(a, t, r))
        (claim,) = (c for c in claims(PUNISHMENT, table) if c.ours.endswith("times"))
        found[more] = claim
    assert {more: claim.verdict for more, claim in found.items()} == {0.2: "does not hold", 2.0: "holds"}
    assert 2.7 < float(found[2.0].ours.split()[0]) < 3.0


def test_actions_of_successes_follow_from_the_means() -> None:
    """The punished need a quarter less for a success, but fail more often, so that all movements say the contrary."""
    punished = PUNISHMENT.design.array.column(12) == PUNISHMENT.design.array.column(12).min()
    found = []
    for row in rows(PUNISHMENT, wobble).rows:
        success, actions = (0.6, 9.0) if punished[row.trial - 1] else (0.9, 12.0)
        mean = success * (actions + wobble(row.run, row.trial, row.run)) + (1 - success) * PUNISHMENT.base.cutoff
        found.append(msgspec.structs.replace(row, figures={**row.figures, "actions": mean, "success_rate": success}))
    of_all, of_successes = (claim for claim in claims(PUNISHMENT, sorted_rows(found)) if "actions" in claim.text)
    assert of_all.verdict == "holds"
    assert of_successes.verdict == "does not hold"
    assert float(of_successes.ours.split()[0].replace("−", "-")) == pytest.approx(-3, abs=0.1)


def test_the_fewest_switches_are_those_of_agents_that_reach_their_goals() -> None:
    table = rows(ALL_GOALS, lambda a, t, r: 2.0 + wobble(a, t, r))
    stuck = [
        msgspec.structs.replace(row, figures={**row.figures, "switches": 0.0, "success_rate": 0.5})
        if row.trial == 3
        else row
        for row in table.rows
    ]
    (claim,) = (c for c in claims(ALL_GOALS, sorted_rows(stuck)) if c.about == "fewest-switches")
    assert claim.verdict == "holds"
    assert "3.0" in claim.ours


def test_trial_10_is_compared_with_the_others() -> None:
    for more, verdict, rank in ((5.0, "holds", 1), (-5.0, "does not hold", 16)):
        table = rows(ALL_GOALS, lambda a, t, r, m=more: m * (t == 10) + wobble(a, t, r))
        (claim,) = (c for c in claims(ALL_GOALS, table) if c.about == "trial-10")
        assert (claim.verdict, claim.ours.rsplit(" ", 1)[1]) == (verdict, str(rank))


def test_success_is_judged_greedy_and_told_learning() -> None:
    for success, verdict in ((0.8, "does not hold"), (1.0, "holds")):
        table = rows(ALL_GOALS, wobble, success=success)
        (claim,) = (c for c in claims(ALL_GOALS, table) if c.about == "success")
        assert claim.verdict == verdict
        assert claim.ours.startswith(f"{100 * success:.1f}")
        assert "learn on 100.0" in claim.ours


def test_results_carry_what_claims_need(tmp_path: Path) -> None:
    table = rows(ALL_GOALS, wobble)
    (tmp_path / "all-goals").mkdir()
    analysis = Analysis([], {"rows": 3}, [], claims(ALL_GOALS, table))
    write_page(ALL_GOALS, tmp_path / "all-goals", analysis, table)
    found = json.loads((tmp_path / "all-goals" / "results.json").read_text())
    assert (len(found["arms"]), found["runs"], found["rows"]) == (3, 4, 3)
    assert {claim["about"] for claim in found["claims"]} == keys_of("all-goals")

"""What the thesis concludes of its trainings besides the signs of single effects."""

import math

import numpy as np
from numpy.typing import NDArray

from pneumarm.experiments.design.anova import Source, anova
from pneumarm.experiments.experiment import Claim, TrialRows
from pneumarm.experiments.factorial import MATTERS, Analyses, Factorial
from pneumarm.experiments.means import over_arms
from pneumarm.experiments.trainings import LEARNING
from pneumarm.experiments.verdict import Criterion, Interval, interval, of_the_best

_NEARLY_ALL = 0.95  # success rate: what the criterion demands (section 4.3.2)
_SMALLEST = 1e-9
_FEWEST = 2.5  # switches (section 5.4.2)
_TRIAL_10 = 10
MARGINAL = 8.0
"""Reward that is little or marginal: less than what a switch costs (section 5.4.1)."""
_A_FEW = 5.0  # actions
_TRACES, _PUNISHMENT = 11, 12  # columns of table 5.3; in appendix C.1 the second holds the punishment
_NOTHING = Interval(math.nan, math.inf, 0)


def _claim(text: str, thesis: str, ours: str, about: str, found: Interval, **stated: float) -> Claim:
    """Return a claim on one figure that was ``found``, with what was ``stated`` of it."""
    return Claim(text, thesis, ours, about, Criterion(**stated), {"found": found})  # type: ignore[arg-type]


def _tables(made: Factorial, rows: TrialRows) -> list[NDArray[np.float64]]:
    """Return the rewards of each arm, shape (trials, runs)."""
    return [rows.table("reward", list(made.trials), arm) for arm in rows.arms]


def weights_matter_more_than_settings(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Compare the effect of other weights with the same settings on the reward with that of all settings."""
    shares = [_within_settings(table) for table in _tables(made, rows) if rows.runs > 1]
    found = interval(shares, len(shares)) if shares else _NOTHING
    return _claim(
        "With the same settings other initial weights make more of the reward than all settings together",
        f"{100 * _within_settings(theirs['reward'].results):.0f} % of the variance (table C.7)",
        f"{found:.1%} of the variance",
        "initial-weights",
        found,
        above=0.5,
        matters=0.1,
    )


def _within_settings(table: NDArray[np.float64]) -> float:
    """Return the share of variance within trials, of ``table`` (trials, runs): the intraclass correlation's rest.

    With mean squares B between and W within trials of n runs, W / (W + (B - W) / n), no part below 0.
    """
    runs = table.shape[1]
    within = float(table.var(axis=1, ddof=1).mean())
    between = max(0.0, float(table.mean(axis=1).var(ddof=1)) - within / runs)
    return within / (within + between) if within > 0 else 0.0


def weights_dominate(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Compare the effect of runs, that is of initial weights, on the reward with that of any column.

    Shares are of the sum of squares within arms, without what chance would contribute, so that no difference between
    arms counts as one of weights.
    """
    names = [str(column) for column in range(1, made.design.array.columns + 1)]
    shares = [_shares(anova(made.design.array, table, names)) for table in _tables(made, rows) if rows.runs > 1]
    thesis = _shares(anova(made.design.array, theirs["reward"].results, names))
    text, found = _dominance(shares) if shares else ("one run", _NOTHING)
    return _claim(
        "Weights are good or bad whatever the settings: they explain more than any factor or interaction",
        f"{_dominance([thesis])[0]} (table C.7)",
        text,
        "weights-alike",
        found,
        above=0.0,
        matters=0.1,
    )


def _shares(sources: tuple[Source, ...]) -> dict[str, float]:
    """Return the shares of variance of all sources but the last two, the rest and the total; 0 of no variance."""
    *known, rest, total = sources
    error = rest.squares / rest.freedom
    return {s.name: (s.squares - s.freedom * error) / total.squares if total.squares > 0 else 0.0 for s in known}


def _dominance(shares: list[dict[str, float]]) -> tuple[str, Interval]:
    """Return in words how much runs and the largest column explain, and how much more runs explain.

    The largest column is chosen among all, so more than the usual confidence is asked for.
    """
    by_source = {name: np.array([each[name] for each in shares]) for name in shares[0]}
    weights = by_source.pop("runs")
    largest = max(by_source, key=lambda name: float(by_source[name].mean()))
    text = f"weights {interval(weights):.1%} of the variance, the largest column ({largest}) "
    text += f"{interval(by_source[largest]):.1%}"
    return text, interval(weights - by_source[largest], len(shares), of_the_best(len(by_source)))


def traces_are_marginal(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Ask whether the effect of the traces on the mean reward is smaller than the price of a switch."""
    found = made.effect(rows, "reward", _TRACES, ours["reward"])
    their = theirs["reward"]
    effect = float(their.effects["mean"].signed[_TRACES - 1])
    return _claim(
        f"The effect of eligibility traces on the reward is marginal: less than a switch costs ({MARGINAL:g})",
        f"{effect:+.2f} ± {their.margin('mean'):.2f}",
        str(found),
        "traces",
        found,
        above=-MARGINAL,
        below=MARGINAL,
        matters=MARGINAL,
    )


def nearly_all_succeed(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Ask whether agents reach nearly all goals in the test, and tell how many while they learn on."""
    greedy, learning = (over_arms(rows.pooled(name, list(made.trials))) for name in ("success_rate", LEARNING))
    return _claim(
        "Nearly all episodes of the test are successful",
        "nearly 100 % (section 5.4.2, no numbers)",
        f"{greedy:.1%}; the same agents while they learn on {learning:.1%}",
        "success",
        greedy,
        above=_NEARLY_ALL,
        matters=0.02,
    )


def fewest_switches(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Ask whether 2.5 switches are the least that a movement takes, of agents that reach their goals."""
    switches, success = (rows.pooled(name, list(made.trials)) for name in ("switches", "success_rate"))
    fewest = np.where(success >= _NEARLY_ALL, switches, np.inf).min(axis=1)
    found = interval(fewest, len(fewest)) if np.isfinite(fewest).all() else _NOTHING
    return _claim(
        f"All agents that reach {100 * _NEARLY_ALL:.0f} % of their goals switch {_FEWEST} times a movement and more",
        f"at least {theirs['switches'].results.min():.2f} (table C.9)",
        f"the fewest of any agent, mean over arms: {found:.2f}",
        "fewest-switches",
        found,
        above=_FEWEST,
        matters=0.25,
    )


def trial_10_is_best(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Compare trial 10 on each arm with the trial that is the best on all other arms, and tell its rank.

    So the rival is chosen without the rows that it is compared by, and not for its luck in them.
    """
    means = np.stack([table.mean(axis=1) for table in _tables(made, rows)])  # (arms, trials)
    at, found = _TRIAL_10 - 1, _NOTHING
    if len(means) > 1:
        others = (means.sum(axis=0) - means) / (len(means) - 1)
        others[:, at] = -np.inf
        found = interval(means[:, at] - means[np.arange(len(means)), others.argmax(axis=1)], len(means))
    their = theirs["reward"].results.mean(axis=1)
    more = float(their[at] - np.delete(their, at).max())
    return _claim(
        "Trial 10 is the best: it earns more than the best of the others",
        f"{more:+.2f}, rank {_rank(their)} of {len(their)}",
        f"{found}, rank {_rank(means.mean(axis=0))}",
        "trial-10",
        found,
        above=0.0,
        matters=MATTERS["reward"],
    )


def _rank(means: NDArray[np.float64]) -> int:
    return 1 + int((means > means[_TRIAL_10 - 1]).sum())


def training_on_improves(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Ask whether training on raises the reward."""
    found, their = _gains(made, rows, theirs)
    stated = {"above": 0.0, "matters": MATTERS["gain"]}
    return _claim("Training on raises the reward", their, str(found), "long-training", found, **stated)


def training_on_improves_little(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Ask whether training on changes the reward by less than the price of a switch."""
    found, their = _gains(made, rows, theirs)
    text = f"It raises it by little: less than a switch costs ({MARGINAL:g})"
    return _claim(text, their, str(found), "long-training", found, below=MARGINAL, matters=MATTERS["gain"])


def _gains(made: Factorial, rows: TrialRows, theirs: Analyses) -> tuple[Interval, str]:
    """Return the mean gain over trials, and the thesis' in words."""
    their = theirs["gain"].results
    words = f"{their.mean():+.2f}; {int((their > 0).sum())} of {their.size} results are better (table 5.8)"
    return over_arms(rows.pooled("gain", list(made.trials))), words


def agents_meet_the_criterion(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Ask whether nearly all agents meet the criterion."""
    met = rows.pooled("met", list(made.trials))
    found = over_arms(met, share=True)
    return _claim(
        f"Without shaping nearly all agents ({100 * _NEARLY_ALL:.0f} %) meet the criterion of training",
        f"all {theirs['episodes'].results.size} (table C.22)",
        f"{found:.1%}: {int(met.sum())} of {met.size}",
        "shaping-not-indispensable",
        found,
        above=_NEARLY_ALL,
        matters=0.05,
    )


def off_policy_never_diverges(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Ask how many agents of Q-learning earn less than one that does nothing, whose weights led nowhere."""
    trials = [trial for trial in made.trials if made.train_settings(trial).method == "q-learning"]
    lost = rows.pooled("reward", trials) < made.worst
    found = over_arms(lost.astype(np.float64), share=True)
    their = theirs["reward"].results[[trial - 1 for trial in trials]]
    return _claim(
        f"Q-learning does not diverge: fewer than 5 % of its agents earn less than one that does nothing "
        f"({made.worst:g})",
        f"never found (section 4.2.6); {int((their < made.worst).sum())} of {their.size} (table C.7)",
        f"{found:.1%}: {int(lost.sum())} of {lost.size}",
        "q-diverges",
        found,
        below=0.05,
        matters=0.05,
    )


def _levels(made: Factorial, rows: TrialRows, table: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return means of ``table`` (arms, trials times runs) with the punishment and without, shapes (arms, runs)."""
    at = made.design.array.column(_PUNISHMENT)
    by_trial = table.reshape(len(rows.arms), len(at), -1)
    with np.errstate(invalid="ignore"):
        return tuple(np.nanmean(by_trial[:, at == level], axis=1) for level in (at.min(), at.max()))


def punishment_costs_actions(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Compare the actions of movements that reach their goal, with the punishment and without.

    A movement that fails takes as many actions as are allowed, so those of the others follow from both means. In the
    thesis nearly none fails.
    """
    actions, success = (rows.pooled(name, list(made.trials)) for name in ("actions", "success_rate"))
    won = np.where(success > 0, (actions - made.base.cutoff * (1 - success)) / np.maximum(success, _SMALLEST), np.nan)
    punished, free = _levels(made, rows, won)
    found = over_arms(punished - free)
    at, their = made.design.array.column(_PUNISHMENT), theirs["actions"].results
    more = float(their[at == at.min()].mean() - their[at == at.max()].mean())
    return _claim(
        f"With the punishment movements that reach their goal take a few more actions: less than {_A_FEW:g} more",
        f"{more:+.2f} of all movements, nearly all successful",
        str(found),
        "punishment",
        found,
        above=0.0,
        below=_A_FEW,
        matters=MATTERS["actions"],
    )


def punishment_halves_switches(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Compare the switches of agents that are punished for them with those of agents that are not."""
    punished, free = _levels(made, rows, rows.pooled("switches", list(made.trials)))
    found = over_arms(free / punished)
    at, their = made.design.array.column(_PUNISHMENT), theirs["switches"].results
    times = float((their[at == at.max()].mean(axis=0) / their[at == at.min()].mean(axis=0)).mean())
    return _claim(
        "Without the punishment there are more than twice as many switches",
        f"{times:.2f} times (appendix C.1)",
        f"{found:.2f} times",
        "punishment",
        found,
        above=2.0,
        matters=0.25,
    )

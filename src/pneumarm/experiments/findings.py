"""What the thesis concludes of its trainings besides the signs of single effects."""

import numpy as np
from numpy.typing import NDArray

from pneumarm.experiments.design.anova import Source, anova
from pneumarm.experiments.differences import Interval, Verdict, above, below, interval, of_the_best, within_margin
from pneumarm.experiments.experiment import Claim, TrialRows
from pneumarm.experiments.factorial import Analyses, Factorial
from pneumarm.experiments.trainings import LEARNING

_NEARLY_ALL = 0.95  # success rate: what the criterion demands (section 4.3.2)
_SMALLEST = 1e-9
_FEWEST = 2.5  # switches (section 5.4.2)
_TRIAL_10 = 10
_MARGINAL = 8.0  # reward: what a switch costs (section 5.4.1)
_TRACES, _PUNISHMENT = 11, 12  # columns of table 5.3; in appendix C.1 the second holds the punishment


def weights_matter_more_than_settings(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Compare the effect of other weights with the same settings on the reward with that of all settings."""
    tables = [rows.table("reward", list(made.trials), arm) for arm in rows.arms]
    claim = "With the same settings other initial weights make more of the reward than all settings together"
    thesis = f"{100 * _within_settings(theirs['reward'].results):.0f} % of the variance (table C.7)"
    if rows.runs < 2:
        return Claim(claim, thesis, "one run", "open", "initial-weights")
    found = interval([_within_settings(table) for table in tables])
    return Claim(claim, thesis, f"{found:.1%} of the variance", above(found, 0.5), "initial-weights")


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
    trials = list(made.trials)
    tables = [rows.table("reward", trials, arm) for arm in rows.arms]
    found = [_shares(anova(made.design.array, table, names)) for table in tables if table.shape[1] > 1]
    thesis = _shares(anova(made.design.array, theirs["reward"].results, names))
    text, verdict = _dominance(found) if found else ("one run", "open")
    return Claim(
        "Weights are good or bad whatever the settings: they explain more than any factor or interaction",
        f"{_dominance([thesis])[0]} (table C.7)",
        text,
        verdict,
        "weights-alike",
    )


def _shares(sources: tuple[Source, ...]) -> dict[str, float]:
    """Return the shares of variance of all sources but the last two, the rest and the total; 0 of no variance."""
    *known, rest, total = sources
    error = rest.squares / rest.freedom
    return {s.name: (s.squares - s.freedom * error) / total.squares if total.squares > 0 else 0.0 for s in known}


def _dominance(shares: list[dict[str, float]]) -> tuple[str, Verdict]:
    """Return in words how much runs and the largest column explain, and whether runs explain significantly more.

    The largest column is chosen among all, so more than the usual confidence is asked for.
    """
    by_source = {name: np.array([each[name] for each in shares]) for name in shares[0]}
    weights = by_source.pop("runs")
    largest = max(by_source, key=lambda name: float(by_source[name].mean()))
    text = f"weights {interval(weights):.1%} of the variance, the largest column ({largest}) "
    text += f"{interval(by_source[largest]):.1%}"
    return text, above(interval(weights - by_source[largest], of_the_best(len(by_source))))


def traces_are_marginal(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Ask whether the effect of the traces on the mean reward is significantly smaller than the price of a switch."""
    found = made.effect(rows, "reward", _TRACES, ours["reward"])
    their = theirs["reward"]
    effect = float(their.effects["mean"].signed[_TRACES - 1])
    return Claim(
        f"The effect of eligibility traces on the reward is marginal: less than a switch costs ({_MARGINAL:g})",
        f"{effect:+.2f} ± {their.margin('mean'):.2f}",
        str(found),
        within_margin(found, _MARGINAL),
        "traces",
    )


def nearly_all_succeed(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Ask whether agents reach nearly all goals in the test, and tell how many while they learn on."""
    greedy, learning = (
        interval(rows.samples(rows.table(name, list(made.trials)).mean(axis=0)))
        for name in ("success_rate", LEARNING)
    )
    return Claim(
        "Nearly all episodes of the test are successful",
        "nearly 100 % (section 5.4.2, no numbers)",
        f"{greedy:.1%}; the same agents while they learn on {learning:.1%}",
        above(greedy, _NEARLY_ALL),
        "success",
    )


def fewest_switches(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Ask whether 2.5 switches are the least that a movement takes, of agents that reach their goals."""
    switches, success = (rows.table(name, list(made.trials)) for name in ("switches", "success_rate"))
    able = np.where(success >= _NEARLY_ALL, switches, np.inf).reshape(len(made.trials), len(rows.arms), -1)
    fewest = able.min(axis=(0, 2))
    their = float(theirs["switches"].results.min())
    text = (
        f"All agents that reach {100 * _NEARLY_ALL:.0f} % of their goals switch {_FEWEST} times a movement and more"
    )
    if not np.isfinite(fewest).all():
        return Claim(text, f"at least {their:.2f} (table C.9)", "no such agents on an arm", "open", "fewest-switches")
    found = interval(fewest)
    return Claim(
        text,
        f"at least {their:.2f} (table C.9)",
        f"the fewest of any agent, mean over arms: {found:.2f}",
        above(found, _FEWEST),
        "fewest-switches",
    )


def trial_10_is_good(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Compare trial 10 with what the other trials do on average, and tell its rank."""
    reward = rows.table("reward", list(made.trials))
    others = np.arange(1, len(reward) + 1) != _TRIAL_10
    found = interval(rows.samples(reward[_TRIAL_10 - 1] - reward[others].mean(axis=0)))
    their = theirs["reward"].results
    more = float(their[_TRIAL_10 - 1].mean() - their[others].mean())
    return Claim(
        "Trial 10 earns more than the other trials do on average",
        f"{more:+.2f}, rank {_rank(their)} of {len(their)}",
        f"{found}, rank {_rank(reward)}",
        above(found),
        "trial-10",
    )


def _rank(reward: NDArray[np.float64]) -> int:
    means = reward.mean(axis=1)
    return 1 + int((means > means[_TRIAL_10 - 1]).sum())


def training_on_improves(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Ask whether training on raises the reward."""
    found, their = _gains(made, rows, theirs)
    return Claim("Training on raises the reward", their, str(found), above(found), "long-training")


def training_on_improves_little(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Ask whether training on changes the reward by less than the price of a switch."""
    found, their = _gains(made, rows, theirs)
    text = f"It raises it by little: less than a switch costs ({_MARGINAL:g})"
    return Claim(text, their, str(found), below(found, _MARGINAL), "long-training")


def _gains(made: Factorial, rows: TrialRows, theirs: Analyses) -> tuple[Interval, str]:
    """Return the mean gain over trials, and the thesis' in words."""
    gain, their = rows.table("gain", list(made.trials)), theirs["gain"].results
    words = f"{their.mean():+.2f}; {int((their > 0).sum())} of {their.size} results are better (table 5.8)"
    return interval(rows.samples(gain.mean(axis=0))), words


def agents_meet_the_criterion(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Ask whether nearly all agents meet the criterion."""
    met = rows.table("met", list(made.trials))
    found, count = interval(rows.samples(met.mean(axis=0))), theirs["episodes"].results.size
    return Claim(
        f"Without shaping nearly all agents ({100 * _NEARLY_ALL:.0f} %) meet the criterion of training",
        f"all {count} (table C.22)",
        f"{found:.1%}: {int(met.sum())} of {met.size}",
        above(found, _NEARLY_ALL),
        "shaping-not-indispensable",
    )


def punishment_costs_actions(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Compare the actions of movements that reach their goal, with the punishment and without.

    A movement that fails takes as many actions as are allowed, so those of the others follow from both means. In the
    thesis nearly none fails.
    """
    at = made.design.array.column(_PUNISHMENT)
    actions, success = (rows.table(name, list(made.trials)) for name in ("actions", "success_rate"))
    won = np.where(success > 0, (actions - made.base.cutoff * (1 - success)) / np.maximum(success, _SMALLEST), np.nan)

    def less(table: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.nanmean(table[at == at.min()], axis=0) - np.nanmean(table[at == at.max()], axis=0))

    found = interval(rows.samples(less(won)))
    return Claim(
        "With the punishment movements that reach their goal take more actions",
        f"{interval(less(theirs['actions'].results)).mean:+.2f} of all movements, nearly all successful",
        str(found),
        above(found),
        "punishment",
    )


def punishment_halves_switches(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Claim:
    """Compare the switches of agents that are punished for them with those of agents that are not."""
    at = made.design.array.column(_PUNISHMENT)
    their, our = (
        _ratio(table, at) for table in (theirs["switches"].results, rows.table("switches", list(made.trials)))
    )
    found = interval(rows.samples(our))
    return Claim(
        "Without the punishment there are more than twice as many switches",
        f"{interval(their).mean:.2f} times (appendix C.1)",
        f"{found:.2f} times",
        above(found, 2.0),
        "punishment",
    )


def _ratio(switches: NDArray[np.float64], level: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return how many times the switches (trials, runs) at the last level are those at the first, by run."""
    return np.asarray(switches[level == level.max()].mean(axis=0) / switches[level == level.min()].mean(axis=0))

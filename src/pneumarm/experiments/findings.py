"""What is found of trainings besides the signs of single effects; claims on it stand in the experiments' words.

Each returns by name what the words' texts and claims name.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.experiments.design.anova import Source, anova
from pneumarm.experiments.experiment import TrialRows
from pneumarm.experiments.factorial import Analyses, Factorial
from pneumarm.experiments.means import over_arms
from pneumarm.experiments.trainings import LEARNING
from pneumarm.experiments.verdict import Interval, interval, of_the_best

_NEARLY_ALL = 0.95  # success rate: what the criterion demands (section 4.3.2)
_SMALLEST = 1e-9
_TRIAL_10 = 10
_TRACES, _PUNISHMENT = 11, 12  # columns of table 5.3; in appendix C.1 the second holds the punishment
_NOTHING = Interval(math.nan, math.inf, 0)
Found = dict[str, Any]


def _tables(made: Factorial, rows: TrialRows) -> list[NDArray[np.float64]]:
    """Return the rewards of each arm, shape (trials, runs)."""
    return [rows.table("reward", list(made.trials), arm) for arm in rows.arms]


def weights_and_settings(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Found:
    """Return the share of variance that other weights make with the same settings."""
    shares = [_within_settings(table) for table in _tables(made, rows) if rows.runs > 1]
    within = interval(shares, len(shares)) if shares else _NOTHING
    return {"within": within, "their_within": f"{100 * _within_settings(theirs['reward'].results):.0f} %"}


def _within_settings(table: NDArray[np.float64]) -> float:
    """Return the share of variance within trials, of ``table`` (trials, runs): the intraclass correlation's rest.

    With mean squares B between and W within trials of n runs, W / (W + (B - W) / n), no part below 0.
    """
    runs = table.shape[1]
    within = float(table.var(axis=1, ddof=1).mean())
    between = max(0.0, float(table.mean(axis=1).var(ddof=1)) - within / runs)
    return within / (within + between) if within > 0 else 0.0


def weights_and_columns(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Found:
    """Compare the effect of runs, that is of initial weights, on the reward with that of any column.

    Shares are of the sum of squares within arms, without what chance would contribute, so that no difference between
    arms counts as one of weights.
    """
    names = [str(column) for column in range(1, made.design.array.columns + 1)]
    shares = [_shares(anova(made.design.array, table, names)) for table in _tables(made, rows) if rows.runs > 1]
    thesis = _shares(anova(made.design.array, theirs["reward"].results, names))
    text, dominance = _dominance(shares) if shares else ("one run", _NOTHING)
    return {"dominance": dominance, "explained": text, "their_explained": _dominance([thesis])[0]}


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


def traces(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Found:
    """Return the effect of the traces on the mean reward."""
    effect = float(theirs["reward"].effects["mean"].signed[_TRACES - 1])
    their = f"{effect:+.2f} ± {theirs['reward'].margin('mean'):.2f}"
    return {"traces": made.effect(rows, "reward", _TRACES, ours["reward"]), "their_traces": their}


def success(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Found:
    """Return how many goals agents reach in the test, and while they learn on."""
    trials = list(made.trials)
    return {
        name: over_arms(rows.pooled(of, trials)) for name, of in (("greedy", "success_rate"), ("learning", LEARNING))
    }


def fewest_switches(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Found:
    """Return the fewest switches of a movement, of agents that reach their goals."""
    switches, reached = (rows.pooled(name, list(made.trials)) for name in ("switches", "success_rate"))
    fewest = np.where(reached >= _NEARLY_ALL, switches, np.inf).min(axis=1)
    found = interval(fewest, len(fewest)) if np.isfinite(fewest).all() else _NOTHING
    return {"fewest": found, "their_fewest": float(theirs["switches"].results.min())}


def trial_10(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Found:
    """Compare trial 10 on each arm with the trial that is the best on all other arms, and tell its rank.

    So the rival is chosen without the rows that it is compared by, and not for its luck in them.
    """
    means = np.stack([table.mean(axis=1) for table in _tables(made, rows)])  # (arms, trials)
    at, best = _TRIAL_10 - 1, _NOTHING
    if len(means) > 1:
        others = (means.sum(axis=0) - means) / (len(means) - 1)
        others[:, at] = -np.inf
        best = interval(means[:, at] - means[np.arange(len(means)), others.argmax(axis=1)], len(means))
    their = theirs["reward"].results.mean(axis=1)
    words = f"{float(their[at] - np.delete(their, at).max()):+.2f}, rank {_rank(their)} of {len(their)}"
    return {"best": best, "rank": _rank(means.mean(axis=0)), "their_best": words}


def _rank(means: NDArray[np.float64]) -> int:
    return 1 + int((means > means[_TRIAL_10 - 1]).sum())


def gains(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Found:
    """Return the mean gain over trials by training on."""
    their = theirs["gain"].results
    words = f"{their.mean():+.2f}; {int((their > 0).sum())} of {their.size} results are better (table 5.8)"
    return {"gained": over_arms(rows.pooled("gain", list(made.trials))), "their_gained": words}


def criterion_met(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Found:
    """Return how many agents meet the criterion."""
    met = rows.pooled("met", list(made.trials))
    words = f"{int(met.sum())} of {met.size}"
    return {"met": over_arms(met, share=True), "agents": words, "their_agents": theirs["episodes"].results.size}


def off_policy(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Found:
    """Return how many agents of Q-learning earn less than one that does nothing: their weights led nowhere."""
    trials = [trial for trial in made.trials if made.train_settings(trial).method == "q-learning"]
    lost = (rows.pooled("reward", trials) < made.worst).astype(np.float64)
    their = theirs["reward"].results[[trial - 1 for trial in trials]] < made.worst
    words = {name: f"{int(one.sum())} of {one.size}" for name, one in (("lost", lost), ("their_lost", their))}
    return {"diverged": over_arms(lost, share=True), "worst": made.worst, **words}


def _levels(made: Factorial, rows: TrialRows, table: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return means of ``table`` (arms, trials times runs) with the punishment and without, shapes (arms, runs)."""
    at = made.design.array.column(_PUNISHMENT)
    by_trial = table.reshape(len(rows.arms), len(at), -1)
    return tuple(np.nanmean(by_trial[:, at == level], axis=1) for level in (at.min(), at.max()))


def punishment(made: Factorial, rows: TrialRows, ours: Analyses, theirs: Analyses) -> Found:
    """Compare the switches, and the actions of movements that reach their goal, with the punishment and without.

    A movement that fails takes as many actions as are allowed, so those of the others follow from both means. In the
    thesis nearly none fails.
    """
    names = ("switches", "actions", "success_rate")
    switches, actions, reached = (rows.pooled(name, list(made.trials)) for name in names)
    failed = made.base.cutoff * (1 - reached)
    won = np.where(reached > 0, (actions - failed) / np.maximum(reached, _SMALLEST), np.nan)
    (switching, switching_freely), (punished, free) = (_levels(made, rows, table) for table in (switches, won))
    at = made.design.array.column(_PUNISHMENT)
    with_it, without = at == at.min(), at == at.max()
    more, times = theirs["actions"].results, theirs["switches"].results
    return {
        "times": over_arms(switching_freely / switching),
        "more": over_arms(punished - free),
        "their_times": float((times[without].mean(axis=0) / times[with_it].mean(axis=0)).mean()),
        "their_more": float(more[with_it].mean() - more[without].mean()),
    }

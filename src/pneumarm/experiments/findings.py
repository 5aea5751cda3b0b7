"""What the thesis concludes of its trainings besides the signs of single effects."""

import numpy as np
from numpy.typing import NDArray

from pneumarm.experiments.design.anova import Source, anova
from pneumarm.experiments.differences import Interval, Verdict, above, interval
from pneumarm.experiments.evidence import within
from pneumarm.experiments.experiment import Claim, Rows
from pneumarm.experiments.factorial import Analyses, Factorial
from pneumarm.experiments.trainings import LEARNING

_SURELY = 0.05  # probability by chance below which an effect counts
_NEARLY_ALL = 0.95  # success rate: what the criterium demands (section 4.3.2)
_MARGINAL = 8.0  # reward: what a switch costs (section 5.4.1)
_TRACES, _PUNISHMENT = 11, 12  # columns of table 5.3; in appendix C.1 the second holds the punishment


def weights_matter_more_than_settings(made: Factorial, rows: Rows, ours: Analyses, theirs: Analyses) -> Claim:
    """Compare what other weights make of the reward with the same settings, with what all settings together do."""
    tables = [rows.table("reward", list(made.trials), arm) for arm in rows.arms]
    claim = "With the same settings other initial weights make more of the reward than all settings together"
    thesis = f"{100 * _within_settings(theirs['reward'].results):.0f} % of the variance (table C.7)"
    if rows.runs < 2:
        return Claim(claim, thesis, "one run", "open", "initial-weights")
    found = interval([_within_settings(table) for table in tables])
    return Claim(claim, thesis, f"{_percent(found)} of the variance", above(found, 0.5), "initial-weights")


def _within_settings(table: NDArray[np.float64]) -> float:
    """Return the share of variance within trials, of ``table`` (trials, runs): the intraclass correlation's rest.

    With mean squares B between and W within trials of n runs, W / (W + (B - W) / n), no part below 0.
    """
    runs = table.shape[1]
    within = float(table.var(axis=1, ddof=1).mean())
    between = max(0.0, float(table.mean(axis=1).var(ddof=1)) - within / runs)
    return within / (within + between) if within > 0 else 0.0


def weights_dominate(made: Factorial, rows: Rows, ours: Analyses, theirs: Analyses) -> Claim:
    """Compare what runs, that is initial weights, make of the reward with what any column does.

    Shares are of the sum of squares within arms, without what chance would contribute; the runs and columns of
    several arms are added up, so that no difference between arms counts as one of weights.
    """
    names = [str(column) for column in range(1, made.design.array.columns + 1)]
    trials = list(made.trials)
    found = [
        anova(made.design.array, rows.table("reward", trials, arm), names)
        for arm in rows.arms
        if rows.table("reward", trials, arm).shape[1] > 1
    ]
    thesis = anova(made.design.array, theirs["reward"].results, names)
    text, verdict = _dominance(found) if found else ("one run", "open")
    return Claim(
        "Weights are good or bad whatever the settings: they explain more than any factor or interaction",
        f"{_dominance([thesis])[0]} (table C.7)",
        text,
        verdict,
        "weights-alike",
    )


def _dominance(tables: list[tuple[Source, ...]]) -> tuple[str, Verdict]:
    """Return in words how much runs and the largest column explain, and whether the runs surely do so."""
    error = sum(t[-2].squares for t in tables) / sum(t[-2].freedom for t in tables)
    total = sum(t[-1].squares for t in tables)
    shares = {}
    for sources in zip(*(t[:-2] for t in tables), strict=True):
        squares, freedom = sum(s.squares for s in sources), sum(s.freedom for s in sources)
        shares[sources[0].name] = max(0.0, squares - freedom * error) / total if total > 0 else 0.0
    weights = shares.pop("runs")
    largest = max(shares, key=shares.__getitem__)
    p = max(t[-3].p for t in tables) if len(tables) == 1 else _least_known([t[-3].p for t in tables])
    text = (
        f"weights {100 * weights:.1f} % of the variance, the largest column ({largest}) {100 * shares[largest]:.1f} %"
    )
    if not p < _SURELY:
        return f"{text}; the weights are not told from chance (p = {p:.2g})", "open"
    return f"{text} (p = {p:.2g})", "holds" if weights > shares[largest] else "does not hold"


def _least_known(p: list[float]) -> float:
    """Return the probability that chance alone makes the smallest of ``p`` so small (Bonferroni)."""
    return min(1.0, len(p) * min(p))


def traces_are_marginal(made: Factorial, rows: Rows, ours: Analyses, theirs: Analyses) -> Claim:
    """Ask whether the effect of the traces on the mean reward is surely smaller than the price of a switch."""
    found = made.effect(rows, "reward", _TRACES, ours["reward"])
    their = theirs["reward"]
    effect = float(their.effects["mean"].signed[_TRACES - 1])
    return Claim(
        f"The effect of eligibility traces on the reward is marginal: less than a switch costs ({_MARGINAL:g})",
        f"{effect:+.2f} ± {their.margin('mean'):.2f}",
        str(found),
        within(found, _MARGINAL),
        "traces",
    )


def nearly_all_succeed(made: Factorial, rows: Rows, ours: Analyses, theirs: Analyses) -> Claim:
    """Ask whether agents reach nearly all goals in the test, and tell how many while they learn on."""
    greedy, learning = (
        interval(rows.samples(rows.table(name, list(made.trials)).mean(axis=0)))
        for name in ("success_rate", LEARNING)
    )
    return Claim(
        "Nearly all episodes of the test are successful",
        "nearly 100 % (section 5.4.2, no numbers)",
        f"{_percent(greedy)}; the same agents while they learn on {_percent(learning)}",
        above(greedy, _NEARLY_ALL),
        "success",
    )


def punishment_halves_switches(made: Factorial, rows: Rows, ours: Analyses, theirs: Analyses) -> Claim:
    """Compare the switches of agents that are punished for them with those of agents that are not."""
    at = made.design.array.column(_PUNISHMENT)
    their, our = (
        _ratio(table, at) for table in (theirs["switches"].results, rows.table("switches", list(made.trials)))
    )
    found = interval(rows.samples(our))
    return Claim(
        "Without the punishment there are more than twice as many switches",
        f"{interval(their).mean:.2f} times (appendix C.1)",
        f"{found.mean:.2f} ± {found.half:.2f} times",
        above(found, 2.0),
        "punishment",
    )


def _ratio(switches: NDArray[np.float64], level: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return how many times the switches (trials, runs) at the last level are those at the first, by run."""
    return np.asarray(switches[level == level.max()].mean(axis=0) / switches[level == level.min()].mean(axis=0))


def _percent(found: Interval) -> str:
    half = f" ± {100 * found.half:.1f}" if np.isfinite(found.half) else ""
    return f"{100 * found.mean:.1f}{half} %"

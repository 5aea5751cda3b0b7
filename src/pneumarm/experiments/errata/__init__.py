"""Errata of the thesis' tables and of what it concludes from them, each with the numbers that show it.

python -m pneumarm.experiments.errata > docs/errata.md
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.experiments.design.analysis import analyse_table
from pneumarm.experiments.design.assignment import thesis_design
from pneumarm.experiments.design.table import packaged_table

Array = NDArray[np.float64]


class Erratum(NamedTuple):
    """Something that cannot be right."""

    place: str
    printed: str
    evidence: Callable[[], tuple[bool, str]]
    """Whether the numbers show it, and which."""
    consequence: str
    """What is done here instead."""


def _printed(experiment: str, name: str) -> Array:
    return packaged_table(f"pneumarm.experiments.{experiment}", f"thesis_{name}")


def _repeated() -> tuple[bool, str]:
    actions, repeated = _printed("optimal_settings", "actions"), packaged_table(__name__, "table_c_16")
    return bool((actions == repeated).all()), f"all {actions.size} numbers are those of table C.15"


def _runs_of_episodes() -> tuple[bool, str]:
    episodes, reward = _printed("all_goals", "episodes"), _printed("all_goals", "reward")
    runs, of = episodes.shape[1], reward.shape[1]
    return runs < of, f"it holds {runs} runs, table C.7 of the same experiment {of}"


def _runs_of_figures() -> tuple[bool, str]:
    runs = _printed("all_goals", "reward").shape[1]
    return runs != 7, f"table C.7, which they are drawn from, holds {runs} runs, and section C.2 says eight"


def _learning_rate() -> tuple[bool, str]:
    analysis = analyse_table(thesis_design(), _printed("all_goals", "reward"))
    best, column = analysis.best, 5
    step = next(step for step in best.steps if step.factor == "a")
    printed = _printed("optimal_settings", "reward")
    reached = analysis.results[(best.trial or 0) - 1]
    shown = step.column == column and best.settings["a"] == 0.10 and best.trial == 10
    return shown, (
        f"column {step.column} (ac) is best at its higher level, column 4 is fixed to its lower one, so "
        f"column 1 is at its higher level: {best.settings['a']:.2f}. These are trial {best.trial}, whose mean "
        f"reward is {reached.mean():.2f} (standard deviation {reached.std(ddof=1):.2f}); the printed ones got "
        f"{printed.mean():.2f} ({printed.std(ddof=1):.2f})"
    )


def _lowest_without_shaping() -> tuple[bool, str]:
    mean = _printed("no_shaping", "reward").mean(axis=1)
    rank = int((mean > mean[9]).sum()) + 1
    lowest = int(mean.argmin()) + 1
    return rank < len(mean), (
        f"its mean in table C.21 is {mean[9]:.2f}, rank {rank} of {len(mean)}; the lowest is that of trial {lowest}, "
        f"{mean.min():.2f}"
    )


def _traces() -> tuple[bool, str]:
    signed = analyse_table(thesis_design(), _printed("all_goals", "episodes"), "smaller").effects["mean"].signed[10]
    return bool(
        signed < 0
    ), f"by table C.10 they need {-signed:.0f} episodes fewer on average (column 11, three runs)"


def _digits() -> tuple[bool, str]:
    found = _printed("all_goals", "reward")[8, 1]
    return bool(round(found, 2) != found), f"{found}, where table 5.5 has {found:.2f}"


ERRATA = (
    Erratum(
        "Table C.16",
        'The caption says "number of actions", as that of table C.15.',
        _repeated,
        "One criterion of the derived settings is not known; tables C.15, C.17 and C.18 are used.",
    ),
    Erratum(
        "Table C.10",
        "The numbers of training episodes of all-goals are printed for some of its runs only.",
        _runs_of_episodes,
        "Its effects are those of these runs.",
    ),
    Erratum("Figures C.1 and C.2", 'The captions say "for 7 runs separately".', _runs_of_figures, "Eight are drawn."),
    Erratum(
        "Section 5.4.2, optimal settings",
        'Column 1 is fixed "to its higher level, i.e. the learning rate 0.05"; in table 5.4 that is 0.10.',
        _learning_rate,
        "The rule is applied as stated; both settings are confirmed (pneumarm experiment optimal-settings).",
    ),
    Erratum(
        "Section C.5",
        '"Trial 10 actually gets the lowest rewards without shaping [...]. We have no explanation."',
        _lowest_without_shaping,
        "None is needed.",
    ),
    Erratum(
        "Section 5.4.2, training time",
        '"The use of eligibility traces (lambda = 0.3) leads to slightly more episodes."',
        _traces,
        "The claim is judged as printed, its number is that of the table.",
    ),
    Erratum("Table C.7, trial 9, run 2", "The number has three decimals.", _digits, "No ranking depends on it."),
)


def implied_success() -> dict[str, Array]:
    """Return the success rates that the thesis' tables imply, by experiment, shapes (trials, runs).

    An episode that reaches its goal after n actions with w switches is paid 50 - (n - 1) - 8 w, one that is cut off
    -n - 8 w; so the share of the former is (reward + actions + 8 switches) / 51. That it is 1.00 almost everywhere
    and never more shows that the thesis pays and counts as we do; the first action of an episode is no switch.
    """
    found = {}
    for name in ("all_goals", "long_training", "optimal_settings", "no_shaping"):
        reward, actions, switches = (_printed(name, figure) for figure in ("reward", "actions", "switches"))
        found[name] = (reward + actions + 8 * switches) / 51
    return found


def page() -> str:
    """Return the errata as Markdown."""
    lines = ["# Errata of the thesis' tables", "", "Made by `python -m pneumarm.experiments.errata`.", ""]
    lines += ["| where | printed | what the numbers say | here |", "|---|---|---|---|"]
    for erratum in ERRATA:
        lines.append(f"| {erratum.place} | {erratum.printed} | {erratum.evidence()[1]} | {erratum.consequence} |")
    success = implied_success()
    lines += ["", "## What the tables agree on", ""]
    lines += ["(reward + actions + 8 switches) / 51, the success rate that three tables of an experiment imply:", ""]
    lines += ["| experiment | median | lowest | highest |", "|---|---|---|---|"]
    for name, rates in success.items():
        lines.append(f"| {name.replace('_', '-')} | {np.median(rates):.3f} | {rates.min():.3f} | {rates.max():.3f} |")
    lines += ["", "So the thesis pays and counts as pneumarm does: no switch is counted for the first action."]
    return "\n".join(lines) + "\n"

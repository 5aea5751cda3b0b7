"""The tables of the report: the ledger of a transfer, and our figures beside the thesis' figures."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pneumarm.arm.seam import ArmSpec
from pneumarm.report import thesis
from pneumarm.report.data import QualityData, TransferData
from pneumarm.report.figures.propagation import expectation
from pneumarm.report.page import Table
from pneumarm.report.style import quantities
from pneumarm.statistics import Estimate, mean_estimate, rate_estimate
from pneumarm.task import Movements

MISSING = "–"
_PHASES = {"before": "on arrival", "learning": "while learning", "after": "after adaptation"}
_FIGURES = (
    "",
    "episodes",
    "reward",
    "success",
    "actions",
    "… of successes",
    "switches",
    "… of successes",
    "arm time",
)
_SHARE = "{:.2%}"  # of successes
_PLANNERS = {"open_loop": "open loop", "closed_loop": "closed loop"}


def ledger(
    test: Movements | None, transfer: TransferData | None, lookahead: Mapping[str, Any] | None = None
) -> Table:
    """Return reward, success, actions and switches in the simulation and on the arm, with 95% intervals.

    A column a phase: intervals are wide, and beside each other there is room for five. ``lookahead`` holds the
    figures of a test in the simulation in which the controller looked ahead.
    """
    columns = [_ledger_column("in the simulation", test, on_arm=False)] if test is not None else []
    if lookahead:
        reward, success, actions, switches = _summarised(lookahead)
        if np.ndim(lookahead["switches"]):  # of all joints together, as beside it; how these vary was not kept
            switches = f"{np.sum(lookahead['switches']):.2f}"
        count = f"{lookahead['episodes']:,}"
        columns.append(["… looking ahead", count, reward, success, actions, MISSING, switches, MISSING, MISSING])
    if transfer is not None:
        columns += [_ledger_column(_PHASES[name], phase, on_arm=True) for name, phase in transfer.phases.items()]
    header, *rows = zip(_FIGURES, *columns, strict=True)
    return Table(
        header,
        rows,
        "The ledger: means over the episodes with 95% confidence intervals in brackets (normal approximation, for "
        "the success Wilson's; episodes taken as independent; none below 30 episodes). Greedy and without learning, "
        "except while learning. A success reached its goal: at a reading every joint was within 25 counts of it "
        "and not faster than 1 count/ms, on the thesis' arm 2.2° and 88°/s, unless other tolerances were asked for. "
        "Arm time holds everything, the way to the begin states too.",
    )


def _ledger_column(name: str, episodes: Movements, *, on_arm: bool) -> list[str]:
    won = episodes.success
    return [
        name,
        f"{episodes.n:,}",
        with_interval(mean_estimate(episodes.reward), "{:.2f}"),
        with_interval(rate_estimate(won), _SHARE),
        with_interval(mean_estimate(episodes.actions), "{:.1f}"),
        with_interval(mean_estimate(episodes.actions[won]), "{:.1f}"),
        with_interval(mean_estimate(episodes.all_switches), "{:.2f}"),
        with_interval(mean_estimate(episodes.all_switches[won]), "{:.2f}"),
        duration(episodes.seconds) if on_arm else MISSING,
    ]


def _summarised(figures: Mapping[str, Any]) -> tuple[str, str, str, str]:
    """Return reward, success, actions and switches as ``results.json`` holds them of a test, for people."""

    def in_words(name: str, form: str) -> str:
        means, ends = figures[name], figures["intervals"][name]
        if not isinstance(means, list):
            means, ends = [means], [ends]
        return ", ".join(
            with_interval(_estimate(mean, end, figures["episodes"]), form)
            for mean, end in zip(means, ends, strict=True)
        )

    return (
        in_words("reward", "{:.2f}"),
        in_words("success_rate", _SHARE),
        in_words("actions", "{:.1f}"),
        in_words("switches", "{:.2f}"),
    )


def _estimate(mean: float, ends: Sequence[float] | None, samples: int) -> Estimate:
    """Return an estimate as ``results.json`` holds it."""
    low, high = ends or (math.nan, math.nan)
    return Estimate(mean, low, high, samples)


def bound_table(bound: Mapping[str, Any]) -> Table:
    """Return what planning with the true physics achieves, and how far the controller stays below it."""
    phases = [name for name in _PHASES if name in bound["distance"]]
    rows = []
    for planner, name in _PLANNERS.items():
        figures = bound[planner]
        below = []
        for phase in phases:
            distance = bound["distance"][phase][planner]
            estimate = _estimate(distance["reward"], distance["interval"], distance["episodes"])
            below.append(f"{with_interval(estimate, '{:.2f}')} of {written(distance['planned'], '{:.2f}')}")
        rows.append([name, f"{figures['episodes']:,}", *_summarised(figures), *below])
    once = bound["open_loop"]
    # Runs that were made before plans were told from proof have none.
    most = once.get("at_most", once["reward"])
    unproven = f" No such sequences earn more than {most:.2f} in open loop." if most > once["reward"] else ""
    return Table(
        (
            "",
            "episodes",
            "reward",
            "success",
            "actions",
            "switches, joint by joint" if np.ndim(bound["open_loop"]["switches"]) else "switches",
            *(f"controller below, {_PHASES[phase]}" for phase in phases),
        ),
        rows,
        "The bound: the best valve sequences of at most three switches that planning with the virtual arm's true "
        "physics finds for the first movements of the tests on the arm; in open loop planned once, on an arm without "
        "noise, in closed loop again at every control step, on the arm with its sensors. The controller is compared "
        f"movement by movement with what is planned in just these; 95% confidence intervals in brackets."
        f"{unproven} The thesis could not know it (section 5.5.1).",
    )


def with_interval(estimate: Estimate, form: str) -> str:
    """Return an estimate for people: mean and, where there is one, its interval."""
    if math.isnan(estimate.mean):
        return MISSING
    mean, low, high = (written(value, form) for value in estimate[:3])
    # The interval stays together when a narrow column breaks the line.
    return mean if math.isnan(estimate.low) else f"{mean} ({low}\u00a0to\u00a0{high})"


def written(value: float, form: str) -> str:
    """Return ``value`` for people: with a minus, which is longer than a hyphen, but for zero."""
    return form.replace("{:", "{:z").format(value).replace("-", "−")


def duration(seconds: float) -> str:
    """Return a time for people."""
    if seconds >= 5400:
        return f"{seconds / 3600:.1f} h"
    return f"{seconds / 60:.0f} min" if seconds >= 90 else f"{seconds:.2g} s"


def beside_thesis(
    results: Mapping[str, Any],
    quality: QualityData | None,
    test: Movements | None,
    transfer: TransferData | None,
    spec: ArmSpec,
) -> Table:
    """Return our figures beside the thesis' figures, with the place they stand in."""
    rows = [
        *_collected(results),
        *_simulated(results, quality, spec),
        *_learned(results, test),
        *_on_the_arm(test, transfer),
    ]
    return Table(
        ("", "ours", "thesis", "where in the thesis"),
        rows,
        "Our figures beside the thesis' figures. Its arm is another one, with other muscles and a "
        "worn angle sensor, so "
        "that the comparison is one of magnitude."
        + (" Of ours, figures with commas between them are those of the joints." if spec.joints > 1 else ""),
        words=True,
    )


def _collected(results: Mapping[str, Any]) -> list[list[str]]:
    collect, kept = results.get("collect", {}), results.get("filter", {})
    return [
        ["transitions collected", _number(collect.get("transitions")), f"{thesis.TRANSITIONS:,}", "section 3.2.2"],
        ["arm time of collecting", _time(collect.get("seconds")), f"{thesis.COLLECT_HOURS:g} h", "section 3.2.2"],
        ["kept by the filter", _number(kept.get("kept")), f"about {thesis.FILTERED:,}", "section 3.2.3"],
    ]


_NAMES = ("angle", "velocity", "pressure_1", "pressure_2")  # of the quantities, in results


def _simulated(results: Mapping[str, Any], quality: QualityData | None, spec: ArmSpec) -> list[list[str]]:
    """Return errors of the simulation; the thesis' counts are those of its own arm."""
    std = results.get("simulation", {}).get("std", {})
    named = list(zip(_NAMES, quantities(spec), quantities(ArmSpec()), strict=True))
    rows = [
        [
            f"std of one-step error, {ours.in_units()}",
            _decimals(std.get(name), ours.per_count),
            _decimals(thesis.STEP_STD[name], theirs.per_count),
            "table 5.2",
        ]
        for name, ours, theirs in named
    ]
    if quality is None or len(quality.propagation) == 0:
        return rows
    second = min(len(quality.propagation), round(1 / spec.period))
    expected = expectation(quality.propagation)
    for i, (name, ours, theirs) in enumerate(named):
        if name in thesis.SECOND_STD:
            spread, by_chance = (
                _decimals(of[second - 1, :, i], ours.per_count) for of in (quality.propagation, expected)
            )
            rows.append(
                [
                    f"std of error after {second * spec.period:.2g} s, {ours.in_units()}",
                    f"{spread} measured; {by_chance} by eq. 3.7",
                    f"{_decimals(thesis.SECOND_STD[name], theirs.per_count)} by eq. 3.7",
                    "table 5.2",
                ]
            )
    return rows


def _learned(results: Mapping[str, Any], test: Movements | None) -> list[list[str]]:
    trained = results.get("training", {})
    best, optimal = thesis.REWARD_TRIAL_10, thesis.REWARD_OPTIMAL
    few, many = thesis.EPISODES_OPTIMAL.min(), thesis.EPISODES_OPTIMAL.max()
    rows = [
        ["episodes of training", _number(trained.get("episodes")), f"{few:,} to {many:,}", "table C.18, one agent"],
        ["time of training", _time(trained.get("seconds")), f"about {thesis.TRAIN_MINUTES:g} min",
         "section 5.5, one agent"],
    ]  # fmt: skip
    if test is None:
        return rows
    reward, success = mean_estimate(test.reward), rate_estimate(test.success)
    actions, switches = mean_estimate(test.actions), mean_estimate(test.all_switches)
    best_actions, best_switches = thesis.ACTIONS_TRIAL_10, thesis.SWITCHES_TRIAL_10
    return [
        *rows,
        ["reward in the simulation", with_interval(reward, "{:.2f}"),
         f"{_runs(best)} best trial; {_runs(optimal)} settings derived as optimal", "tables 5.5 (trial 10) and 5.7"],
        ["success in the simulation", with_interval(success, _SHARE), thesis.SUCCESS, "section 5.6.1"],
        ["actions an episode", with_interval(actions, "{:.2f}"), _runs(best_actions), "table C.8, trial 10"],
        ["switches an episode", with_interval(switches, "{:.2f}"), _runs(best_switches), "table C.9, trial 10"],
    ]  # fmt: skip


def _on_the_arm(test: Movements | None, transfer: TransferData | None) -> list[list[str]]:
    if test is None or transfer is None or transfer.before.n == 0:
        return []
    came, home = transfer.before, test
    least, most = thesis.SWITCHES_RISE
    rows = [
        ["actions of successes, simulation → on arrival",
         f"{_mean(home.actions[home.success])} → {_mean(came.actions[came.success])}",
         f"about {thesis.ACTIONS_SIMULATION:g} → {thesis.ACTIONS_ON_ARRIVAL:g}", "section 5.5.1"],
        ["drop of the reward on arrival", _mean(home.reward, came.reward), f"over {thesis.REWARD_DROP:g}",
         "section 5.5.1"],
        ["rise of the switches of successes on arrival",
         _mean(came.all_switches[came.success], home.all_switches[home.success]),
         f"{least:g} learning, {most:g} not", "section 5.5.1"],
        ["success on arrival", with_interval(rate_estimate(came.success), _SHARE), thesis.SUCCESS, "section 5.6.1"],
    ]  # fmt: skip
    if transfer.after.n:
        now = transfer.after
        rows += [
            ["success after adaptation", with_interval(rate_estimate(now.success), _SHARE), thesis.SUCCESS,
             "section 5.6.1"],
            ["reward gained by adaptation", _mean(now.reward, came.reward), MISSING, "figure 5.9, not in numbers"],
            ["learning on the arm", f"{transfer.learning.n:,} episodes, {duration(transfer.learning.seconds)}",
             f"about {thesis.EPISODES_TO_PROGRESS} episodes, an hour, to real progress; "
             f"{thesis.TRAIN_ON_ARM_HOURS:g} h estimated without any simulation", "sections 5.5 and 5.5.1"],
        ]  # fmt: skip
    return rows


def _mean(values: Any, less: Any = (0.0,)) -> str:
    """Return the difference of two means, or a mean where there is nothing to take off."""
    return written(np.mean(values) - np.mean(less), "{:.1f}") if len(values) and len(less) else MISSING


def _runs(values: Any) -> str:
    return f"{np.mean(values):.2f} ({np.min(values):.2f} to {np.max(values):.2f} in {len(values)} runs)"


def _number(value: float | None) -> str:
    return MISSING if value is None else f"{value:,.0f}"


def _time(value: float | None) -> str:
    return MISSING if value is None else duration(value)


def _decimals(value: float | Sequence[float] | Any, factor: float) -> str:
    """Return one number, or one a joint, times ``factor``."""
    return MISSING if value is None else ", ".join(f"{factor * v:.2g}" for v in np.atleast_1d(value))

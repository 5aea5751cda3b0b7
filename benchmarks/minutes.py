"""How many minutes of collecting an agent needs: reward and success after transfer, by the time on the arm's clock.

python -m benchmarks minutes

For each arm a collection is cut short after some minutes, those between its sequences included, and a simulation is
fitted and an agent for reaching trained from nothing else, by the defaults. The movements are the same for all agents
of an arm: begin states by their numbers, goals within the range of the angles of the longest collection. Nothing is
learned on the arm. Settings come from the environment:

PNEUMARM_MINUTES_ARMS       seeds of virtual arms; the ten held-out arms by default
PNEUMARM_MINUTES_SEEDS      of collecting, fitting and training, "0"
PNEUMARM_MINUTES_MINUTES    "1,3,5,10,20,60,110"; 1 stands for the fewest transitions that are allowed, 1,000
PNEUMARM_MINUTES_MOVEMENTS  of each agent, 500
PNEUMARM_MINUTES_FOLDER     where rows and the figure are kept; a call with the same folder goes on where another
                            ended. runs/minutes by default

Intervals are Student's, over the pairs of arm and seed, of the difference to the longest collection.
"""

import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import t as student

from benchmarks import _environment as environment
from benchmarks._trials import HELD_OUT, Rows, collected, fitted, greedy_movements
from pneumarm.drawing.colours import DARK, GREY, MIDDLE
from pneumarm.learning import PolicySettings, test, train
from pneumarm.report.style import key, legend_below, panels, styled
from pneumarm.statistics import rate_estimate
from pneumarm.transitions import Store

HEADER = (
    f"{'minutes':>8}{'transitions':>12}{'fitted':>8}{'angle':>7}{'in simulation':>15}{'on the arm':>12}"
    f"{'lowest':>8}{'difference':>17}{'success':>28}{'lowest':>8}{'actions':>9}{'switches':>10}{'fit':>7}{'train':>8}"
)


def measure() -> Iterator[str]:
    folder = environment.folder("PNEUMARM_MINUTES_FOLDER", "runs/minutes")
    arms = environment.seeds("PNEUMARM_MINUTES_ARMS", HELD_OUT)
    seeds = environment.seeds("PNEUMARM_MINUTES_SEEDS", "0")
    minutes = sorted(environment.numbers("PNEUMARM_MINUTES_MINUTES", "1,3,5,10,20,60,110"), reverse=True)
    movements = environment.whole("PNEUMARM_MINUTES_MOVEMENTS", 500)
    rows = Rows(folder / "rows.jsonl", "arm", "seed", "asked", "movements")
    for arm in arms:
        for seed in seeds:
            if all(rows.get(arm, seed, one, movements) for one in minutes):
                continue
            with tempfile.TemporaryDirectory() as place:
                longest = Path(place) / "longest.db"
                collected(longest, arm, seed, minutes=minutes[0])
                with Store.open(longest) as store:
                    goals = store.percentiles()
                for one in minutes:
                    if rows.get(arm, seed, one, movements) is None:
                        db = longest if one == minutes[0] else Path(place) / f"{one}.db"
                        rows.add(trial(db, arm, seed, one, movements, goals))
                        yield f"arm {arm}, seed {seed}, {one:g} minutes: measured"
    found = [[_row(rows, arm, seed, one, movements) for arm in arms for seed in seeds] for one in reversed(minutes)]
    yield HEADER
    for each in found:
        yield line(each, found[-1])
    curve(found).savefig(folder / "minutes.png", dpi=170)
    yield f"drawn in {folder / 'minutes.png'}"


def _row(rows: Rows, *key: Any) -> dict[str, Any]:
    row = rows.get(*key)
    assert row is not None
    return row


def trial(
    db: Path, arm: int, seed: int, minutes: float, movements: int, goals: NDArray[np.float64]
) -> dict[str, Any]:
    """Return what an agent reaches that was made from so many minutes on the arm."""
    transitions, took = collected(db, arm, seed, minutes=minutes)
    made = learned_from(db, arm, seed, movements, goals)
    return {"asked": minutes, "minutes": took, "transitions": transitions, **made}


def learned_from(db: Path, arm: int, seed: int, movements: int, goals: NDArray[np.float64]) -> dict[str, Any]:
    """Return what an agent reaches that learned from the recording ``db`` of a virtual arm."""
    made, begin = fitted(db, seed)
    trained = train(made.simulation, begin, PolicySettings(), seed)
    simulated = test(trained.agent, made.simulation, begin, 2_000, seed)
    on_arm = greedy_movements(trained.agent, arm, goals, range(movements), seed)
    return {
        "arm": arm,
        "seed": seed,
        "movements": movements,
        "fitted": made.result.rows,
        "std": made.result.std,
        "simulated": float(simulated.reward.mean()),
        "reward": float(np.mean([one.reward for one in on_arm])),
        "successes": sum(one.success for one in on_arm),
        "actions": float(np.mean([one.actions for one in on_arm])),
        "switches": float(np.mean([one.switches.sum() for one in on_arm])),
        "fit_seconds": made.result.seconds,
        "train_seconds": trained.seconds,
    }


def line(each: list[dict[str, Any]], longest: list[dict[str, Any]]) -> str:
    """Return the figures of ``each`` row of one length of collecting, beside those of the ``longest``."""

    def mean(name: str) -> float:
        return float(np.mean([row[name] for row in each]))

    total = sum(row["movements"] for row in each)
    rate = rate_estimate(np.arange(total) < sum(row["successes"] for row in each))
    worst = min(row["successes"] / row["movements"] for row in each)
    half = half_width(differences(each, longest))
    difference = "" if each is longest else f"{np.mean(differences(each, longest)):+.2f} ± {half:.2f}"
    angle = float(np.mean([row["std"]["angle"] for row in each]))
    return (
        f"{mean('minutes'):8.1f}{mean('transitions'):12,.0f}{mean('fitted'):8,.0f}{angle:7.2f}{mean('simulated'):15.2f}"
        f"{mean('reward'):12.2f}{min(row['reward'] for row in each):8.2f}{difference:>17}"
        f"{f'{rate.mean:.4f} ({rate.low:.4f}..{rate.high:.4f})':>28}{worst:8.4f}{mean('actions'):9.2f}"
        f"{mean('switches'):10.3f}{mean('fit_seconds'):6.1f}s{mean('train_seconds'):7.1f}s"
    )


def differences(each: list[dict[str, Any]], longest: list[dict[str, Any]]) -> NDArray[np.float64]:
    """Return by how much the rewards differ from those with the longest collection, arm by arm."""
    return np.array([one["reward"] - other["reward"] for one, other in zip(each, longest, strict=True)])


def half_width(values: NDArray[np.float64]) -> float:
    """Return half of the 95 % interval of the mean of ``values`` (n,); NaN of a single one."""
    n = len(values)
    return float(student.ppf(0.975, n - 1) * values.std(ddof=1) / math.sqrt(n)) if n > 1 else math.nan


@styled
def curve(found: list[list[dict[str, Any]]]) -> Figure:
    """Draw reward and failures against the minutes of collecting, each arm thin and all together thick."""
    figure, axes = panels(1, 2, 2.9)
    left, right = axes[0]
    minutes = [np.mean([row["minutes"] for row in each]) for each in found]
    rewards = np.array([[row["reward"] for row in each] for each in found])
    half = [half_width(differences(each, found[-1])) for each in found]
    for one in rewards.T:
        left.plot(minutes, one, color=GREY, lw=0.7)
    left.errorbar(minutes, rewards.mean(axis=1), half, color=DARK, marker="o", lw=1.8, capsize=3)
    left.set_ylabel("reward on the arm, on arrival [-]")
    failed = np.array([[1 - row["successes"] / row["movements"] for row in each] for each in found])
    for one in failed.T:
        right.plot(minutes, 100 * one, color=GREY, lw=0.7)
    right.plot(minutes, 100 * failed.mean(axis=1), color=MIDDLE, marker="s", lw=1.8)
    right.set_ylabel("movements that failed [%]")
    right.set_ylim(0, max(1.0, 105 * failed.max()))
    for place in (left, right):
        place.set_xscale("log")
        place.set_xticks(minutes, [f"{each[0]['asked']:g}" for each in found])
        place.set_xticks([], minor=True)
        place.set_xlabel("collecting, on the arm's clock [min]")
    names = ["mean reward; bars: 95 % of its difference to the longest", "mean failures", "one arm and seed"]
    legend_below(figure, [key(DARK, marker="o"), key(MIDDLE, marker="s"), key(GREY, lw=0.7)], names)
    return figure

"""The table of baselines for people: lines of text, and a page with a picture."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pneumarm.files import write_text
from pneumarm.report.figures.baselines import Baseline, baselines
from pneumarm.report.ledger import with_interval
from pneumarm.report.page import Picture, Section, Table, render
from pneumarm.report.style import RASTER_DPI
from pneumarm.statistics import mean_estimate, rate_estimate, summarise

Row = dict[str, Any]
"""An agent on an arm, as in ``baselines.jsonl``."""
PLANNED = ("open loop", "closed loop")
"""Methods that plan with the true physics; the better one on an arm is its bound."""
ADAPTED = " adapted"
"""Added to the name of a method whose agents make the movements again after they have learned on the arm."""
HEADER = (
    f"{'arm':28}{'method':18}{'seed':>5}{'train: wall':>12}{'cpu':>9}{'in simulation':>16}{'on the arm':>16}"
    f"{'success':>22}{'actions':>15}{'switches':>15}{'p99':>10}"
)


def and_adapted(row: Row) -> list[Row]:
    """Return ``row`` and, where its agent has then learned on the arm, one of what it does afterwards."""
    if not row["adapted"]:
        return [row]
    return [row, row | row["adapted"] | {"method": row["method"] + ADAPTED, "curve": []}]


def line(row: Row) -> str:
    return f"{row['arm']:28}{row['method']:18}{row['seed']:5d}" + cells([row]) + f"{row['p99_ms']:7.2f} ms"


def cells(rows: list[Row]) -> str:
    """Return training, reward, success, actions and switches of some agents together."""
    figures = summarise(*(joined(rows, name) for name in ("reward", "success", "actions", "switches")))
    simulated = [row["simulation"]["reward"] for row in rows if row["simulation"]]
    # One agent: the interval is that of its movements.
    ends = rows[0]["simulation"]["intervals"]["reward"] if len(simulated) == 1 else None
    low, high = figures["intervals"]["success_rate"]
    told = f"{np.mean(simulated):.2f}" + (f" ± {(ends[1] - ends[0]) / 2:.2f}" if ends else "") if simulated else "-"
    success = f"{figures['success_rate']:.4f} ({low:.3f}..{high:.3f})"
    return (
        f"{np.mean([row['wall'] for row in rows]):10.1f} s{np.mean([row['cpu'] for row in rows]):7.1f} s{told:>16}"
        f"{spread(figures, 'reward'):>16}{success:>22}"
        f"{spread(figures, 'actions'):>15}{spread(figures, 'switches'):>15}"
    )


def joined(rows: list[Row], name: str) -> np.ndarray:
    return np.concatenate([row[name] for row in rows])


def spread(figures: dict[str, Any], name: str) -> str:
    ends = figures["intervals"][name]
    return f"{figures[name]:.2f}" + (f" ± {(ends[1] - ends[0]) / 2:.2f}" if ends else "")


def by_method(rows: list[Row]) -> dict[str, list[Row]]:
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row["method"], []).append(row)
    return found


def bound_of(found: dict[str, list[Row]]) -> list[Row]:
    """Return the row of each arm that says what is possible there.

    Planning once with foresight is best wherever a plan is found. Of several joints not every plan is, and then the
    planner that plans again every turn may do better.
    """
    best: dict[str, Row] = {}
    for row in (row for name in PLANNED for row in found.get(name, [])):
        if row["arm"] not in best or np.mean(row["reward"]) > np.mean(best[row["arm"]]["reward"]):
            best[row["arm"]] = row
    return list(best.values())


def below(rows: list[Row], bound: list[Row]) -> np.ndarray | None:
    """Return by how much ``rows`` stay below the ``bound``, movement by movement, as far as that is planned."""
    best = {row["arm"]: np.array(row["reward"]) for row in bound}
    if not all(row["arm"] in best for row in rows):
        return None
    return np.concatenate([best[row["arm"]] - row["reward"][: len(best[row["arm"]])] for row in rows])


def pooled(rows: list[Row]) -> Iterator[str]:
    """Give a line a method over all arms, the intervals over all movements, and its distance to the bound."""
    found = by_method(rows)
    for method, own in found.items():
        means = [np.mean(row["reward"]) for row in own]
        lost = below(own, bound_of(found))
        distance = "" if lost is None or method in PLANNED else f", below the bound {lost.mean():.2f}"
        if all(row.get("at_most") is not None for row in own):  # planned once
            unproven, most = sum(row["unproven"] for row in own), np.mean([row["at_most"] for row in own])
            distance = f"; {unproven} not proven, and no plans earn more than {most:.2f}"
        yield (
            f"{'all':28}{method:18}{len(own):5d}{cells(own)}; an agent {min(means):.2f} to {max(means):.2f}{distance}"
        )


def curves(rows: list[Row]) -> Iterator[str]:
    """Give the learning curve of each method of other libraries, in the simulation and as a mean of its agents."""
    for method, own in by_method([row for row in rows if row["curve"]]).items():
        steps, seconds, reward = np.mean([row["curve"] for row in own], axis=0).T
        points = ", ".join(
            f"{r:.1f} ({n / 1e3:.0f}k, {t:.0f} s)" for n, t, r in zip(steps, seconds, reward, strict=True)
        )
        yield f"{method} while learning: reward (steps, processor time) {points}"


def floor(rows: list[Row]) -> Iterator[str]:
    """Say on each arm whether our agent is above the best of PPO's agents there."""
    found = by_method(rows)
    if not {"policy", "ppo"} <= found.keys():
        return
    for arm in sorted({row["arm"] for row in rows}):
        ours, theirs = ([row for row in found[name] if row["arm"] == arm] for name in ("policy", "ppo"))
        best = max(theirs, key=lambda row: np.mean(row["reward"]))
        gained = np.mean([row["reward"] for row in ours], axis=0) - best["reward"]
        gain, worst = mean_estimate(gained), min(np.mean(row["reward"]) for row in ours)
        yield (
            f"arm {arm}: policy above the best of {len(theirs)} of PPO by {gain.mean:+.2f} ({gain.low:+.2f} to "
            f"{gain.high:+.2f}), the worst of {len(ours)} policies by {worst - np.mean(best['reward']):+.2f}"
        )


def write_page(folder: Path, rows: list[Row]) -> None:
    """Write the page with the table and the picture."""
    found = by_method(rows)
    trained = [
        Baseline(
            name,
            np.array([row["cpu"] for row in own]),
            np.array([np.mean(row["reward"]) for row in own]),
            mean_estimate(joined(own, "reward")),
        )
        for name, own in found.items()
        if is_trained(own) and not name.endswith(ADAPTED)
    ]
    untrained = {name: mean_estimate(joined(own, "reward")) for name, own in found.items() if not is_trained(own)}
    figure = baselines(trained, untrained)
    figure.savefig(folder / "baselines.png", dpi=RASTER_DPI)
    arms = sorted({row["arm"] for row in rows})
    tables = [table(f"All arms together ({len(arms)})", found, bound_of(found))]
    for arm in arms:
        own = {name: [row for row in each if row["arm"] == arm] for name, each in found.items()}
        tables.append(table(f"Arm {arm}", own, bound_of(found)))
    picture = Picture(
        figure,
        "Reward on arrival against the processor time of training, all threads together; small markers are agents, "
        "large ones with 95% intervals all their movements. Lines need no training.",
    )
    sections = [
        Section("All arms", (), [picture], tables[:1]),
        Section("Arm by arm", (), (), tables[1:]),
    ]
    summary = [
        "Every method gets the same simulation, begin states and goals. On the arm nothing is learned. Training is "
        "told in wall time and in processor time of all threads together. Intervals are of 95% and over movements."
    ]
    write_text(folder / "baselines.html", render("Baselines", summary, sections))


def is_trained(rows: list[Row]) -> bool:
    """Return whether the method of ``rows`` is one that learns before it arrives."""
    return any(row["wall"] > 0 for row in rows)


def around(values: np.ndarray) -> str:
    """Return a mean and its interval in one line that does not break."""
    estimate = mean_estimate(values)
    half = "" if np.isnan(estimate.low) else f"\u00a0±\u00a0{estimate.high - estimate.mean:.2f}"
    return f"{estimate.mean:.2f}{half}"


def table(title: str, found: dict[str, list[Row]], bound: list[Row]) -> Table:
    header = (
        "(agents)", "trained [s]", "in simulation", "reward on the arm", "below the bound", "success", "actions",
        "switches",
    )  # fmt: skip
    lines = []
    for method, own in found.items():
        if not own:
            continue
        simulated = [row["simulation"]["reward"] for row in own if row["simulation"]]
        lost = below(own, bound)
        lines.append(
            [
                f"{method} ({len(own)})",
                " / ".join(f"{np.mean([row[clock] for row in own]):.1f}" for clock in ("wall", "cpu")),
                f"{np.mean(simulated):.2f}" if simulated else "–",
                around(joined(own, "reward")),
                "–" if lost is None or method in PLANNED else around(lost),
                with_interval(rate_estimate(joined(own, "success")), "{:.1%}"),
                around(joined(own, "actions")),
                around(joined(own, "switches")),
            ]
        )
    return Table(header, lines, title)

"""What the report of a run opens with: large figures, and three questions answered."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from pneumarm.moving.told import ToldFigure, told_figures
from pneumarm.report.health import HEALTH, findings, tells_of_health
from pneumarm.report.page import Light
from pneumarm.report.sections import COVERAGE, ONE_STEP, RunData

_GOOD_SIMULATION = 0.25
"""Error one control period ahead, as a share of how the angle changes: nearly all virtual arms have less."""


def headline(run: RunData) -> list[ToldFigure]:
    """Return the large figures, of the task that the agent was trained for."""
    if settle := run.results.get("settle"):
        return told_figures(settle)
    phases = () if run.transfer is None else (("on the arm", run.transfer.after), ("on arrival", run.transfer.before))
    for where, made in (*phases, ("in the simulation", run.test)):
        if made is None or not made.n:
            continue
        won = made.success
        figures = [ToldFigure(f"reached, of {made.n:,} goals {where}", f"{100 * won.mean():.4g} %")]
        if won.any():
            seconds = float(np.median(made.actions[won])) * run.spec.period
            off = np.abs(made.angle_end - made.goal)[won].max(axis=1).mean() / run.spec.counts_per_degree
            figures.append(ToldFigure("time, half of the goals", f"{seconds:.2f} s"))
            figures.append(ToldFigure("error when reached, on average", f"{off:.2f}°"))
        return figures
    return []


def lights(run: RunData) -> list[Light]:
    """Return the three questions with their answers."""
    return [_data(run.results), _simulation(run), _arm(run.results)]


def _data(results: Mapping[str, Any]) -> Light:
    question, verdict = "Is my data enough?", results.get("collect", {}).get("enough", {}).get("verdict")
    if verdict is None:
        words = "As many transitions were recorded as were asked for. pneumarm coverage says whether more would help."
        return Light(question, None, "Not judged", words, COVERAGE)
    good, words = verdict.startswith("enough"), verdict.removeprefix("enough: ")
    return Light(question, good, "Yes" if good else "No", f"{words[0].upper()}{words[1:]}.", COVERAGE)


def _simulation(run: RunData) -> Light:
    question, errors = "Is the simulation good?", run.results.get("simulation", {}).get("relative_error", {})
    worst = float(np.max(np.asarray(errors.get("angle", np.nan), float)))  # null is NaN
    if not np.isfinite(worst):
        return Light(question, None, "Not measured", "It was not tried on recordings it does not know.", ONE_STEP)
    good = worst <= _GOOD_SIMULATION
    words = (
        f"One control period ahead it predicts {1 - worst:.0%} of how the angle changes, on recordings that it was "
        f"not fitted to. Normal: {1 - _GOOD_SIMULATION:.0%} or more."
    )
    return Light(question, good, "Yes" if good else "Less than normal", words, ONE_STEP)


def _arm(results: Mapping[str, Any]) -> Light:
    question, found = "Is anything wrong with the arm?", findings(results)
    if not tells_of_health(results):
        return Light(question, None, "Not known", "What the monitor found was not recorded.", HEALTH)
    if not found:
        return Light(question, True, "No", "The monitor found nothing wrong while it moved.", HEALTH)
    words = "; ".join(f"{what} ({where}, {doing})" for what, where, doing, *_ in found[:_TOLD])
    more = f"; and {len(found) - _TOLD} more" if len(found) > _TOLD else ""
    return Light(question, False, "Yes", f"{words[0].upper()}{words[1:]}{more}.", HEALTH)


_TOLD = 3  # findings; the section has all
